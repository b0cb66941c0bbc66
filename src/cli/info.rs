//! `photonmill info`: what a file holds, and what became of it.

use std::collections::HashMap;
use std::fmt::Write;

use clap::Args;
use glam::Vec3;
use serde::Serialize;

use super::progress::{ProgressArgs, ProgressReporter};
use super::values::parse_number;
use super::{JsonOrStdoutArg, help, optional_file, say, spell};
use crate::error::Result;
use crate::output::destination::write_all;
use crate::render::scene::stages;
use crate::render::{Event, Observer};
use crate::scene::light::LightKind;
use crate::scene::material::{Coverage, Layers, Material, Medium, NormalMap, Surface, TextureUse, UvTransform};
use crate::scene::texture::{Filter, Texels, Texture, Wrap};
use crate::scene::{Light, Reading, Scene};
use crate::text::counted;

#[derive(Args)]
pub(super) struct InfoArgs {
    #[command(flatten)]
    json: JsonOrStdoutArg,
    #[arg(value_name = "SCENE", help = help::scene())]
    scene: String,
    /// Take nodes, skins and morph targets as the file's first animation has them at this time [default: at rest]
    #[arg(long, value_name = "SECONDS", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Scene")]
    at: Option<f64>,
    #[command(flatten)]
    progress: ProgressArgs,
}

/// What a scene holds.
#[derive(Serialize)]
struct Contents {
    name: String,
    mesh_count: usize,
    triangle_count: usize,
    /// Metres along x, y and z, to the digits that a file has.
    size: [f32; 3],
    texture_bytes: u64,
    extensions_used: Vec<String>,
    materials: Vec<MaterialEntry>,
    textures: Vec<TextureEntry>,
    lights: Vec<LightEntry>,
    cameras: Vec<String>,
    /// What of the file is not simulated, and what is wrong with it.
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct MaterialEntry {
    /// With its place in this list where others have the same.
    name: String,
    /// What it became.
    description: String,
    triangle_count: usize,
}

#[derive(Serialize)]
struct TextureEntry {
    name: String,
    width: u32,
    height: u32,
    /// What its numbers mean, and what lies between them.
    texels: &'static str,
    filter: &'static str,
    bytes: u64,
}

#[derive(Serialize)]
struct LightEntry {
    name: String,
    kind: &'static str,
}

pub(super) fn run(args: &InfoArgs) -> Result<()> {
    let json = optional_file("--json", args.json.json.as_ref())?;
    let reporter = ProgressReporter::new(&args.progress);
    let report = |event: Event| reporter.event(event);
    let observer = Observer { report: &report, ..Observer::default() };
    let reading = Reading { at: args.at, ..Reading::default() };
    let scene = Scene::open_with(&args.scene, reading, &mut stages(&args.scene, &observer))?;
    reporter.finish();
    let contents = Contents::of(&scene);
    if let Some(json) = json {
        let text = serde_json::to_string_pretty(&contents).expect("contents are plain data");
        return write_all([(json, (spell(&text) + "\n").into_bytes())]);
    }
    say(contents.text().trim_end())
}

impl Contents {
    fn of(scene: &Scene) -> Contents {
        let mut triangle_counts = vec![0; scene.materials.len()];
        for mesh in &scene.meshes {
            triangle_counts[mesh.material] += mesh.triangles.len();
        }
        let (low, high) = scene.bounds();
        let mut is_coloured = vec![false; scene.materials.len()];
        for mesh in &scene.meshes {
            is_coloured[mesh.material] |= !mesh.colours.is_empty() || !mesh.alphas.is_empty();
        }
        let mut name_counts: HashMap<&str, usize> = HashMap::new();
        scene.materials.iter().for_each(|material| *name_counts.entry(&material.name).or_default() += 1);
        let material = |((place, material), (triangle_count, is_coloured)): ((usize, &Material), (usize, bool))| MaterialEntry {
            name: if name_counts[&*material.name] > 1 { format!("{} #{place}", material.name) } else { material.name.clone() },
            description: description(material, &scene.textures) + if is_coloured { ", times vertex colours" } else { "" },
            triangle_count,
        };
        let materials = scene.materials.iter().enumerate().zip(triangle_counts.into_iter().zip(is_coloured));
        Contents {
            name: scene.name.clone(),
            mesh_count: scene.meshes.len(),
            triangle_count: scene.triangle_count(),
            size: (high - low).as_vec3().to_array(),
            texture_bytes: scene.textures.iter().map(bytes).sum(),
            extensions_used: scene.extensions.clone(),
            materials: materials.map(material).collect(),
            textures: scene.textures.iter().map(TextureEntry::of).collect(),
            lights: scene.lights.iter().map(LightEntry::of).collect(),
            cameras: scene.cameras.iter().map(|camera| camera.name.clone()).collect(),
            warnings: scene.warnings.clone(),
        }
    }

    fn text(&self) -> String {
        let [width, height, depth] = self.size.map(number);
        let mut text = format!(
            "{}: {}, {}, {width} x {height} x {depth} m, {}, {} ({}), {}, {}\n",
            self.name,
            if self.mesh_count == 1 { "1 mesh".to_owned() } else { format!("{} meshes", self.mesh_count) },
            counted(self.triangle_count, "triangle"),
            counted(self.materials.len(), "material"),
            counted(self.textures.len(), "texture"),
            mebibytes(self.texture_bytes),
            counted(self.lights.len(), "light"),
            counted(self.cameras.len(), "camera"),
        );
        let mut list = |title: &str, lines: Vec<String>| {
            if !lines.is_empty() {
                let _ = writeln!(text, "{title}");
                lines.iter().for_each(|line| {
                    let _ = writeln!(text, "    {line}");
                });
            }
        };
        list("extensions", Vec::from_iter((!self.extensions_used.is_empty()).then(|| self.extensions_used.join(", "))));
        let material = |entry: &MaterialEntry| {
            let unused = if entry.triangle_count == 0 { "; on no mesh" } else { "" };
            format!("{}: {}{unused}", entry.name, entry.description)
        };
        list("materials", self.materials.iter().map(material).collect());
        let texture = |entry: &TextureEntry| {
            let TextureEntry { name, width, height, texels, filter, bytes } = entry;
            format!("{name}: {width}x{height}, {texels}, {filter}, {}", mebibytes(*bytes))
        };
        list("textures", self.textures.iter().map(texture).collect());
        list("lights, beside materials that emit", self.lights.iter().map(|light| format!("{}: {}", light.name, light.kind)).collect());
        list("cameras", self.cameras.clone());
        let nothing = || vec!["none".to_owned()];
        list("warnings", if self.warnings.is_empty() { nothing() } else { self.warnings.clone() });
        text
    }
}

/// Here and on the device.
fn bytes(texture: &Texture) -> u64 {
    4 * texture.texels.word_count() as u64
}

fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", number(bytes as f64 / f64::from(1 << 20)))
}

/// Three digits of it.
fn number(value: impl Into<f64>) -> f64 {
    format!("{:.2e}", value.into()).parse().expect("it was a number")
}

impl TextureEntry {
    fn of(texture: &Texture) -> TextureEntry {
        TextureEntry {
            name: texture.name.clone(),
            width: texture.width,
            height: texture.height,
            texels: match texture.texels {
                Texels::Srgb(_) => "sRGB colours",
                Texels::Linear(_) => "linear numbers",
                Texels::Float(_) => "linear colours",
            },
            filter: match texture.filter {
                Filter::Bilinear => "bilinear",
                Filter::Nearest => "nearest texel",
            },
            bytes: bytes(texture),
        }
    }
}

impl LightEntry {
    fn of(light: &Light) -> LightEntry {
        let kind = match light.kind {
            LightKind::Point { .. } => "point",
            LightKind::Spot { .. } => "spot",
            LightKind::Directional { .. } => "directional",
            LightKind::Disc { .. } => "disc",
            LightKind::Environment { .. } | LightKind::Sky(_) => "environment",
        };
        LightEntry { name: light.name.clone(), kind }
    }
}

/// What a material is, in words.
fn description(material: &Material, textures: &[Texture]) -> String {
    let mut parts = match material.surface {
        Surface::Lambert => vec!["matt".to_owned()],
        Surface::PaperPhong { exponent } => vec![format!("the paper's Phong, exponent {}", number(exponent))],
        Surface::Glossy { exponent } => vec![format!("Phong lobe, exponent {}", number(exponent))],
        Surface::Mirror => vec!["mirror".to_owned()],
        Surface::Dielectric { ior } => vec!["smooth glass".to_owned(), format!("ior {}", number(ior))],
        Surface::Layered if material.layers.is_unlit => vec!["unlit: the eye sees its base colour as it is".to_owned()],
        Surface::Layered => of_base(&material.layers, textures),
    };
    if material.base_colour != Vec3::ONE {
        parts.push(format!("base colour {}", colour(material.base_colour)));
    }
    parts.extend(material.base_colour_texture.map(|used| format!("base colour {}", texture(used, textures))));
    match material.coverage {
        Coverage::Whole => {}
        Coverage::Mask { cutoff, .. } => parts.push(format!("cut out where alpha is below {}", number(cutoff))),
        Coverage::Blend { alpha: 1.0 } => parts.push("blended by alpha".to_owned()),
        Coverage::Blend { alpha } => parts.push(format!("blended by alpha {}", number(alpha))),
    }
    parts.extend(normal_map("normal map", material.normal_map, textures));
    if material.surface == Surface::Layered && !material.layers.is_unlit {
        parts.extend(of_layers_above(&material.layers, textures));
    }
    if material.is_emissive() {
        parts.push(format!("emits {} W/m2/sr{}", colour(material.emission), by_texture(material.emission_texture, textures)));
    }
    if material.two_sided {
        parts.push("two-sided".to_owned());
    }
    parts.join(", ")
}

/// Metal, dielectric or glass.
fn of_base(layers: &Layers, textures: &[Texture]) -> Vec<String> {
    let (metallic, of_texture) = (number(layers.metallic), by_texture(layers.metallic_roughness_texture, textures));
    let has_dielectric = layers.metallic < 1.0 || layers.metallic_roughness_texture.is_some();
    let mut parts = vec![match (layers.metallic, layers.transmission > 0.0, layers.medium) {
        (1.0, _, _) if !has_dielectric => "metal".to_owned(),
        (0.0, false, _) => "dielectric".to_owned(),
        (0.0, true, None) => "thin wall of glass".to_owned(),
        (0.0, true, Some(_)) => "solid glass".to_owned(),
        (_, false, _) => format!("dielectric and metal, metallic {metallic}{of_texture}"),
        (_, true, None) => format!("thin wall of glass, and metal, metallic {metallic}{of_texture}"),
        (_, true, Some(_)) => format!("solid glass and metal, metallic {metallic}{of_texture}"),
    }];
    if has_dielectric {
        parts.push(if layers.ior == 0.0 { "ior infinite".to_owned() } else { format!("ior {}", number(layers.ior)) });
    }
    if layers.dispersion > 0.0 {
        parts.push(format!("dispersion {}", number(layers.dispersion)));
    }
    parts.push(format!("roughness {}{of_texture}", number(layers.roughness)));
    if !has_dielectric {
        return parts;
    }
    if layers.specular != 1.0 || layers.specular_texture.is_some() {
        parts.push(format!("specular {}{}", number(layers.specular), by_texture(layers.specular_texture, textures)));
    }
    if layers.specular_colour != Vec3::ONE || layers.specular_colour_texture.is_some() {
        parts.push(format!("specular colour {}{}", colour(layers.specular_colour), by_texture(layers.specular_colour_texture, textures)));
    }
    if layers.transmission > 0.0 && (layers.transmission < 1.0 || layers.transmission_texture.is_some()) {
        parts.push(format!("transmission {}{}", number(layers.transmission), by_texture(layers.transmission_texture, textures)));
    }
    if layers.diffuse_transmission > 0.0 {
        let [share, tint] =
            [layers.diffuse_transmission_texture, layers.diffuse_transmission_colour_texture].map(|used| by_texture(used, textures));
        let (factor, of) = (number(layers.diffuse_transmission), colour(layers.diffuse_transmission_colour));
        parts.push(format!("diffuse transmission {factor}{share} of colour {of}{tint}"));
    }
    if let Some(Medium { transmittance, metres }) = layers.medium.filter(|medium| medium.transmittance != Vec3::ONE) {
        let way = if metres == 1.0 { "a metre".to_owned() } else { format!("{} m", number(metres)) };
        parts.push(format!("{} of the light left after {way}", colour(transmittance)));
    }
    parts
}

/// Anisotropy, film, coat and sheen.
fn of_layers_above(layers: &Layers, textures: &[Texture]) -> Vec<String> {
    let mut parts = Vec::new();
    if layers.anisotropy > 0.0 {
        let (strength, texture) = (number(layers.anisotropy), by_texture(layers.anisotropy_texture, textures));
        let turn = match layers.anisotropy_rotation {
            0.0 => String::new(),
            radians => format!(" turned by {} degrees", number(radians.to_degrees())),
        };
        parts.push(format!("anisotropy {strength}{texture}{turn}"));
    }
    if layers.iridescence > 0.0 {
        let [share, shades] = [layers.iridescence_texture, layers.film_thickness_texture].map(|used| by_texture(used, textures));
        let [least, most] = layers.film_thickness.map(number);
        let thickness = if shades.is_empty() { most.to_string() } else { format!("{least} to {most}") };
        let (factor, ior) = (number(layers.iridescence), number(layers.film_ior));
        parts.push(format!("iridescence {factor}{share}, a film of {thickness} nm{shades} and ior {ior}"));
    }
    if layers.coat > 0.0 {
        let (coat, roughness) = (by_texture(layers.coat_texture, textures), by_texture(layers.coat_roughness_texture, textures));
        parts.push(format!("clear coat {}{coat} of roughness {}{roughness}", number(layers.coat), number(layers.coat_roughness)));
        parts.extend(normal_map("normal map of the coat", layers.coat_normal_map, textures));
    }
    if layers.sheen_colour != Vec3::ZERO {
        let (sheen, roughness) = (by_texture(layers.sheen_colour_texture, textures), by_texture(layers.sheen_roughness_texture, textures));
        parts.push(format!("sheen {}{sheen} of roughness {}{roughness}", colour(layers.sheen_colour), number(layers.sheen_roughness)));
    }
    parts
}

fn normal_map(what: &str, map: Option<NormalMap>, textures: &[Texture]) -> Option<String> {
    let scale = |map: NormalMap| if map.scale == 1.0 { String::new() } else { format!(" of scale {}", number(map.scale)) };
    map.map(|map| format!("{what}{}{}", scale(map), by_texture(Some(map.texture), textures)))
}

fn by_texture(used: Option<TextureUse>, textures: &[Texture]) -> String {
    used.map_or_else(String::new, |used| format!(" ({})", texture(used, textures)))
}

/// Which picture it is, and how it is looked up where that is not as usual.
fn texture(used: TextureUse, textures: &[Texture]) -> String {
    let texture = &textures[used.texture];
    // The reader's word for a picture that cannot be read.
    let mut text = format!("texture {}", texture.name.strip_prefix("texture image ").unwrap_or(&texture.name));
    if used.uv_set != 0 {
        let _ = write!(text, ", UV set {}", used.uv_set);
    }
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => "repeated",
        Wrap::MirroredRepeat => "mirrored",
        Wrap::Clamp => "clamped",
    };
    match texture.wrap {
        [Wrap::Repeat, Wrap::Repeat] => {}
        [u, v] if u == v => drop(write!(text, ", {}", wrap(u))),
        [u, v] => drop(write!(text, ", {} in u, {} in v", wrap(u), wrap(v))),
    }
    let UvTransform { scale, rotation, offset } = used.transform;
    if scale != UvTransform::NONE.scale {
        let _ = write!(text, ", scaled by {} {}", number(scale.x), number(scale.y));
    }
    if rotation != 0.0 {
        let _ = write!(text, ", turned by {} rad", number(rotation));
    }
    if offset != UvTransform::NONE.offset {
        let _ = write!(text, ", moved by {} {}", number(offset.x), number(offset.y));
    }
    text
}

/// Three channels, or one where they are equal.
fn colour(colour: Vec3) -> String {
    let [red, green, blue] = colour.to_array().map(number);
    if colour == Vec3::splat(colour.x) { red.to_string() } else { format!("{red} {green} {blue}") }
}
