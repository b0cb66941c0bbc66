//! Scenes from `.gltf` and `.glb` files (glTF 2.0).
//!
//! Read: meshes with node transforms and instances, smooth normals, two sets of texture coordinates,
//! base colour and emission with textures, metallic-roughness (mapped by
//! [`super::material::surface_of`]), KHR_materials_emissive_strength, _ior, _transmission,
//! KHR_lights_punctual, perspective cameras. Whatever else the file holds is named in a warning.

mod accessor;
mod malformed;

use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use glam::{DMat3, DMat4, DVec2, DVec3, Vec3};
use gltf::khr_lights_punctual::Kind;
use gltf::mesh::Mode;
use gltf::{Gltf, Semantic};
use image::{DynamicImage, ImageDecoder};

use super::light::{LUMENS_PER_WATT, Light, LightKind};
use super::material::{Material, TextureUse, surface_of};
use super::texture::{Texture, Wrap, linear_of_srgb};
use super::{Camera, Mesh, Scene};
use crate::error::{Error, Result};

/// Larger files are refused: their triangles would not fit a device's buffers either.
const MAX_FILE_BYTES: u64 = 4 << 30;
const READ_EXTENSIONS: [&str; 4] =
    ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_transmission"];
/// Of all instances together: as many as the GPU's buffers of 4 GiB hold.
const MAX_TRIANGLES: usize = 100_000_000;
/// Of all textures together: 1.5 GiB.
const MAX_TEXELS: u64 = 1 << 27;
/// Texture coordinates beyond that have no digits left for a place in the picture.
const MAX_UV: f64 = 1e6;
/// Nodes within nodes; deeper ones would be a cycle.
const MAX_DEPTH: usize = 512;

/// Reads a file.
pub fn load(path: &Path, radiometric: bool) -> Result<Scene> {
    let content = read_file(path, path)?;
    let refuse = |reason: String| Error::Scene { path: path.to_owned(), object: "the file".into(), reason: one_line(&reason) };
    malformed::binary_length(&content).map_err(refuse)?;
    let unchecked = Gltf::from_slice_without_validation(&content).map_err(|error| refuse(error.to_string()))?;
    malformed::missing_members(unchecked.document.as_json()).map_err(refuse)?;
    let Gltf { document, blob } = Gltf::from_slice(&content).map_err(|error| refuse(error.to_string()))?;
    let version = document.as_json().asset.version.as_str();
    if !version.starts_with("2.") {
        return Err(refuse(format!("is of glTF version {version}; 2.0 is read")));
    }
    if let Some(extension) = document.extensions_required().find(|extension| !READ_EXTENSIONS.contains(extension)) {
        return Err(refuse(format!("cannot be read without {extension}, which is not supported; export it without")));
    }
    let mut loader = Loader {
        path: path.to_owned(),
        file_bytes: content.len(),
        buffers: Vec::new(),
        scene: Scene { name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(), ..Scene::default() },
        left_out: BTreeSet::new(),
        nodes_read: BTreeSet::new(),
        triangle_count: 0,
        texel_count: 0,
        texture_places: HashMap::new(),
        unit: if radiometric { 1.0 } else { 1.0 / LUMENS_PER_WATT },
    };
    loader.read_buffers(&document, blob)?;
    loader.read_textures(&document)?;
    loader.read_materials(&document)?;
    loader.read_nodes(&document)?;
    loader.name_what_is_left_out(&document);
    loader.finish()
}

/// A name without line breaks and other control characters.
fn printable(name: &str) -> String {
    name.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}

/// What a file or a decoder says, without its line breaks.
fn one_line(text: &str) -> String {
    printable(&text.lines().map(str::trim).collect::<Vec<_>>().join(" "))
}

fn read_file(path: &Path, of: &Path) -> Result<Vec<u8>> {
    let refuse = |reason: String| Error::Scene { path: of.to_owned(), object: printable(&path.display().to_string()), reason };
    let facts = std::fs::metadata(path).map_err(|error| refuse(format!("cannot be read ({})", error.kind())))?;
    if !facts.is_file() {
        return Err(refuse("is no file".into()));
    }
    if facts.len() > MAX_FILE_BYTES {
        return Err(refuse(format!("has {} bytes, and at most {MAX_FILE_BYTES} are read", facts.len())));
    }
    std::fs::read(path).map_err(|error| refuse(format!("cannot be read ({})", error.kind())))
}

/// A file being read.
pub(super) struct Loader {
    path: PathBuf,
    file_bytes: usize,
    buffers: Vec<Vec<u8>>,
    scene: Scene,
    /// What the file holds and the scene does not, each once.
    left_out: BTreeSet<String>,
    /// Nodes that were read; each has one place in the scene.
    nodes_read: BTreeSet<usize>,
    /// Triangles and vertices of all instances so far.
    triangle_count: usize,
    texel_count: u64,
    /// Where a texture of the file stands in the scene.
    texture_places: HashMap<usize, usize>,
    /// Watts in one unit of a punctual light.
    unit: f32,
}

impl Loader {
    /// An error that names the file and the object in it.
    fn refuse(&self, object: &str, reason: impl Into<String>) -> Error {
        Error::Scene { path: self.path.clone(), object: object.to_owned(), reason: one_line(&reason.into()) }
    }

    fn leave_out(&mut self, what: impl Into<String>) {
        self.left_out.insert(one_line(&what.into()));
    }

    fn read_buffers(&mut self, document: &gltf::Document, mut blob: Option<Vec<u8>>) -> Result<()> {
        for buffer in document.buffers() {
            let what = format!("buffer {}", buffer.index());
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => {
                    blob.take().ok_or_else(|| self.refuse(&what, "is the file's binary part, and there is none"))?
                }
                gltf::buffer::Source::Uri(uri) => self.read_uri(uri, &what)?,
            };
            if bytes.len() < buffer.length() {
                return Err(self.refuse(&what, format!("has {} bytes where {} are announced", bytes.len(), buffer.length())));
            }
            self.buffers.push(bytes);
        }
        Ok(())
    }

    /// A data URI, or a file beside this one.
    fn read_uri(&self, uri: &str, what: &str) -> Result<Vec<u8>> {
        if let Some(embedded) = uri.strip_prefix("data:") {
            let text = embedded.split_once(";base64,").map(|(_, text)| text);
            return text.and_then(|text| BASE64.decode(text).ok()).ok_or_else(|| self.refuse(what, "has a data URI that is not base64"));
        }
        if uri.contains(':') {
            return Err(self.refuse(what, format!("lies at {uri}; only files beside this one are read")));
        }
        let name = percent_decoded(uri).ok_or_else(|| self.refuse(what, format!("has a name that cannot be decoded: {uri}")))?;
        read_file(&self.path.parent().unwrap_or(Path::new("")).join(name), &self.path)
    }

    fn read_textures(&mut self, document: &gltf::Document) -> Result<()> {
        // Pictures that only normal or roughness maps use are not looked at.
        let mut used = BTreeSet::new();
        for material in document.materials() {
            used.extend(material.pbr_metallic_roughness().base_color_texture().map(|info| info.texture().index()));
            used.extend(material.emissive_texture().map(|info| info.texture().index()));
        }
        // Materials that use the same picture in the same way share it.
        let mut places: HashMap<(usize, Option<usize>), usize> = HashMap::new();
        for texture in document.textures().filter(|texture| used.contains(&texture.index())) {
            let place = match places.entry((texture.source().index(), texture.sampler().index())) {
                Entry::Occupied(place) => *place.get(),
                Entry::Vacant(free) => {
                    let read = self.read_texture(&texture)?;
                    self.texel_count += u64::from(read.width) * u64::from(read.height);
                    self.scene.textures.push(read);
                    *free.insert(self.scene.textures.len() - 1)
                }
            };
            self.texture_places.insert(texture.index(), place);
        }
        Ok(())
    }

    fn read_texture(&self, texture: &gltf::Texture) -> Result<Texture> {
        let source = texture.source();
        let what = format!(
            "texture image {}",
            source.name().map(printable).map_or_else(|| source.index().to_string(), |name| format!("'{name}'"))
        );
        let bytes = match source.source() {
            gltf::image::Source::View { view, .. } => accessor::view_bytes(self, &view, &what)?.to_vec(),
            gltf::image::Source::Uri { uri, .. } => self.read_uri(uri, &what)?,
        };
        let mut reader = image::ImageReader::new(std::io::Cursor::new(&bytes));
        reader = reader.with_guessed_format().map_err(|error| self.refuse(&what, error.to_string()))?;
        // A picture of a few bytes must not unfold into gigabytes.
        let mut limits = image::Limits::default();
        limits.max_alloc = Some(1 << 30);
        reader.limits(limits.clone());
        let undecodable = |error: image::ImageError| self.refuse(&what, format!("cannot be decoded ({})", one_line(&error.to_string())));
        let decoder = reader.into_decoder().map_err(undecodable)?;
        let (width, height) = decoder.dimensions();
        // Asked before it is decoded: as numbers it takes many times the memory.
        if self.texel_count + u64::from(width) * u64::from(height) > MAX_TEXELS {
            return Err(self.refuse(&what, format!("makes more than {MAX_TEXELS} texels, the most that are read; use smaller pictures")));
        }
        limits.reserve(decoder.total_bytes()).map_err(undecodable)?;
        let picture = DynamicImage::from_decoder(decoder).map_err(undecodable)?.into_rgb8();
        let wrap = |mode: gltf::texture::WrappingMode| match mode {
            gltf::texture::WrappingMode::ClampToEdge => Wrap::Clamp,
            gltf::texture::WrappingMode::MirroredRepeat => Wrap::MirroredRepeat,
            gltf::texture::WrappingMode::Repeat => Wrap::Repeat,
        };
        Ok(Texture {
            name: what,
            width: picture.width(),
            height: picture.height(),
            texels: picture.pixels().map(|pixel| Vec3::from(pixel.0.map(linear_of_srgb))).collect(),
            wrap: [wrap(texture.sampler().wrap_s()), wrap(texture.sampler().wrap_t())],
        })
    }

    fn read_materials(&mut self, document: &gltf::Document) -> Result<()> {
        for material in document.materials() {
            let read = self.read_material(&material)?;
            self.scene.materials.push(read);
        }
        // The material of primitives that name none.
        self.scene.materials.push(Material::lambert("default", Vec3::ONE));
        Ok(())
    }

    fn read_material(&mut self, material: &gltf::Material) -> Result<Material> {
        let pbr = material.pbr_metallic_roughness();
        let name = material.name().map_or_else(|| format!("material {}", material.index().unwrap_or(0)), printable);
        let transmission = material.transmission();
        let factor = transmission.as_ref().map_or(0.0, gltf::material::Transmission::transmission_factor);
        let ior = material.ior().unwrap_or(1.5);
        for (what, present) in [
            ("normal textures", material.normal_texture().is_some()),
            ("occlusion textures", material.occlusion_texture().is_some()),
            ("metallic-roughness textures", pbr.metallic_roughness_texture().is_some()),
            ("transmission textures", transmission.as_ref().is_some_and(|t| t.transmission_texture().is_some())),
            ("transparency by alpha", material.alpha_mode() != gltf::material::AlphaMode::Opaque),
            ("rough transmission (taken as smooth)", factor >= 0.5 && pbr.roughness_factor() > 0.05),
        ] {
            if present {
                self.leave_out(what);
            }
        }
        for (what, share) in [("metallic", pbr.metallic_factor()), ("transmission", factor)] {
            if share > 0.0 && share < 1.0 {
                self.leave_out(format!("partly {what} surfaces (taken as the nearer of both)"));
            }
        }
        let in_range = |value: f32, low: f32, high: f32| value.is_finite() && value >= low && value <= high;
        let [red, green, blue, _] = pbr.base_color_factor();
        let emission = Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0);
        let object = format!("material '{name}'");
        if ![red, green, blue].iter().all(|channel| in_range(*channel, 0.0, 1.0)) {
            return Err(self.refuse(&object, format!("has the base colour {red} {green} {blue}; each must be from 0 to 1")));
        }
        if !emission.to_array().iter().all(|channel| in_range(*channel, 0.0, f32::MAX)) {
            return Err(self.refuse(&object, format!("emits {emission}; each channel must be 0 or more and finite")));
        }
        if !in_range(ior, 1.0, 100.0) {
            return Err(self.refuse(&object, format!("has the index of refraction {ior}; it must be from 1 to 100")));
        }
        if !in_range(pbr.metallic_factor(), 0.0, 1.0) || !in_range(pbr.roughness_factor(), 0.0, 1.0) || !in_range(factor, 0.0, 1.0) {
            return Err(self.refuse(&object, "has a metallic, roughness or transmission factor outside 0 to 1"));
        }
        let places = self.texture_places.clone();
        let mut texture_use = |info: Option<gltf::texture::Info>| {
            info.map(|info| {
                if info.tex_coord() > 1 {
                    self.leave_out("texture coordinates beyond the second set (the first is used)");
                }
                TextureUse { texture: places[&info.texture().index()], uv_set: if info.tex_coord() == 1 { 1 } else { 0 } }
            })
        };
        Ok(Material {
            surface: surface_of(pbr.metallic_factor(), pbr.roughness_factor(), factor, ior),
            base_colour: Vec3::new(red, green, blue),
            base_colour_texture: texture_use(pbr.base_color_texture()),
            emission,
            emission_texture: texture_use(material.emissive_texture()),
            two_sided: material.double_sided(),
            name,
        })
    }

    fn read_nodes(&mut self, document: &gltf::Document) -> Result<()> {
        let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
            return Err(self.refuse("the file", "holds no scene"));
        };
        if document.scenes().len() > 1 {
            self.leave_out("scenes beside the default one");
        }
        scene.nodes().try_for_each(|node| self.read_node(&node, DMat4::IDENTITY, 0))
    }

    fn read_node(&mut self, node: &gltf::Node, parent: DMat4, depth: usize) -> Result<()> {
        let what = format!("node {}", node.name().map(printable).map_or_else(|| node.index().to_string(), |name| format!("'{name}'")));
        if depth > MAX_DEPTH {
            return Err(self.refuse(&what, format!("lies more than {MAX_DEPTH} nodes deep, or within itself")));
        }
        if !self.nodes_read.insert(node.index()) {
            return Err(self.refuse(&what, "has two parents; a node has one place in a scene"));
        }
        let matrix = DMat4::from_cols_array_2d(&node.transform().matrix().map(|column| column.map(f64::from)));
        let to_world = parent * matrix;
        if !to_world.is_finite() {
            return Err(self.refuse(&what, "has a transform that is not finite"));
        }
        if node.skin().is_some() {
            self.leave_out("skins (meshes are taken in their rest pose)");
        }
        if let Some(mesh) = node.mesh() {
            for primitive in mesh.primitives() {
                let name = node.name().or(mesh.name()).map_or_else(|| format!("mesh {}", mesh.index()), printable);
                self.read_primitive(&primitive, name, to_world)?;
            }
        }
        if let Some(camera) = node.camera() {
            self.read_camera(&camera, node, to_world);
        }
        if let Some(light) = node.light() {
            self.read_light(&light, &what, to_world)?;
        }
        node.children().try_for_each(|child| self.read_node(&child, to_world, depth + 1))
    }

    fn read_primitive(&mut self, primitive: &gltf::Primitive, name: String, to_world: DMat4) -> Result<()> {
        let what = format!("mesh '{name}', primitive {}", primitive.index());
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.leave_out("points and lines");
            return Ok(());
        }
        if primitive.morph_targets().len() > 0 {
            self.leave_out("morph targets (meshes are taken in their base shape)");
        }
        if primitive.get(&Semantic::Colors(0)).is_some() {
            self.leave_out("vertex colours");
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            return Err(self.refuse(&what, "has no positions"));
        };
        let positions: Vec<DVec3> = accessor::read::<3>(self, &positions, &what)?
            .into_iter()
            .map(|position| to_world.transform_point3(Vec3::from(position).as_dvec3()))
            .collect();
        let of_vertices = |length: usize, kind: &str| {
            if length == positions.len() {
                Ok(())
            } else {
                Err(self.refuse(&what, format!("has {length} {kind} for {} vertices", positions.len())))
            }
        };
        // Normals go with the inverse transpose; the cofactors are that times the determinant, and
        // stay finite where a scale is zero.
        let cofactors = cofactor_matrix(DMat3::from_mat4(to_world)) * to_world.determinant().signum();
        let normals = match primitive.get(&Semantic::Normals) {
            Some(normals) => accessor::read::<3>(self, &normals, &what)?
                .into_iter()
                .map(|normal| (cofactors * Vec3::from(normal).as_dvec3()).normalize_or_zero())
                .collect(),
            None => Vec::new(),
        };
        if !normals.is_empty() {
            of_vertices(normals.len(), "normals")?;
        }
        let mut uvs = [Vec::new(), Vec::new()];
        for (set, uvs) in uvs.iter_mut().enumerate() {
            if let Some(coordinates) = primitive.get(&Semantic::TexCoords(set as u32)) {
                *uvs = accessor::read::<2>(self, &coordinates, &what)?
                    .into_iter()
                    .map(|[u, v]| DVec2::new(f64::from(u), f64::from(v)))
                    .collect();
                of_vertices(uvs.len(), "texture coordinates")?;
                if let Some(uv) = uvs.iter().find(|uv| uv.is_nan() || uv.abs().max_element() > MAX_UV) {
                    return Err(self.refuse(&what, format!("has the texture coordinates {uv}; they must be within {MAX_UV:e}")));
                }
            }
        }
        self.triangle_count += primitive.indices().map_or(positions.len(), |indices| indices.count()) / 3 + positions.len() / 4;
        if self.triangle_count > MAX_TRIANGLES {
            return Err(self.refuse(&what, format!("brings the scene over {MAX_TRIANGLES} triangles, the most that are read")));
        }
        let indices = match primitive.indices() {
            Some(indices) => accessor::read_indices(self, &indices, &what)?,
            None => (0..positions.len() as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|index| **index as usize >= positions.len()) {
            return Err(self.refuse(&what, format!("uses vertex {index} of {}", positions.len())));
        }
        if positions.iter().any(|position| !position.is_finite()) {
            return Err(self.refuse(&what, "has a vertex that is not finite once transformed"));
        }
        let mut triangles = triangles_of(primitive.mode(), &indices);
        if to_world.determinant() < 0.0 {
            // A mirrored instance would show its back.
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let material = primitive.material().index().unwrap_or(self.scene.materials.len() - 1);
        self.scene.meshes.push(Mesh { name, positions, normals, uvs, triangles, material });
        Ok(())
    }

    fn read_camera(&mut self, camera: &gltf::Camera, node: &gltf::Node, to_world: DMat4) {
        let gltf::camera::Projection::Perspective(perspective) = camera.projection() else {
            self.leave_out("orthographic cameras");
            return;
        };
        let vertical_view = f64::from(perspective.yfov());
        // Within the angles for which a pinhole picture means something.
        if !(0.002..3.12).contains(&vertical_view) {
            self.leave_out(format!("a camera with a vertical view of {vertical_view} radians"));
            return;
        }
        let name = node.name().or(camera.name()).map_or_else(|| format!("camera {}", camera.index()), printable);
        let eye = to_world.transform_point3(DVec3::ZERO);
        let target = eye + to_world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let up = to_world.transform_vector3(DVec3::Y);
        // Where the file leaves the aspect open, so does the camera.
        let aspect = perspective.aspect_ratio().map(f64::from);
        let is_usable = |aspect: &f64| aspect.is_finite() && *aspect > 0.0;
        if let Some(aspect) = aspect.filter(|aspect| !is_usable(aspect)) {
            self.leave_out(format!("an aspect ratio of {aspect} of camera '{name}'"));
        }
        let camera = Camera::looking_at(&name, eye, target, up, vertical_view);
        self.scene.cameras.push(Camera { aspect: aspect.filter(is_usable), ..camera });
    }

    fn read_light(&mut self, light: &gltf::khr_lights_punctual::Light, node: &str, to_world: DMat4) -> Result<()> {
        let what = format!("light {}", light.name().map(printable).map_or_else(|| format!("of {node}"), |name| format!("'{name}'")));
        let strength = Vec3::from(light.color()) * light.intensity() * self.unit;
        if !strength.is_finite() || strength.min_element() < 0.0 {
            return Err(self
                .refuse(&what, format!("has the intensity {} and colour {:?}; both must be 0 or more", light.intensity(), light.color())));
        }
        if light.range().is_some() {
            self.leave_out("ranges of lights (they reach as far as light does)");
        }
        let position = to_world.transform_point3(DVec3::ZERO);
        let direction = to_world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let kind = match light.kind() {
            Kind::Point => LightKind::Point { position, intensity: strength },
            Kind::Directional => LightKind::Directional { direction, irradiance: strength },
            Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                if !(inner_cone_angle >= 0.0
                    && inner_cone_angle < outer_cone_angle
                    && outer_cone_angle <= std::f32::consts::FRAC_PI_2 + 1e-6)
                {
                    return Err(self.refuse(&what, format!("has cones of {inner_cone_angle} and {outer_cone_angle} radians; the inner must be smaller, the outer at most half pi")));
                }
                LightKind::Spot { position, direction, intensity: strength, inner_angle: inner_cone_angle, outer_angle: outer_cone_angle }
            }
        };
        if strength.max_element() > 0.0 {
            self.scene.lights.push(Light { name: what, kind });
        }
        Ok(())
    }

    fn name_what_is_left_out(&mut self, document: &gltf::Document) {
        if document.animations().len() > 0 {
            self.leave_out("animations");
        }
        const READ: [&str; 4] =
            ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_transmission"];
        for extension in document.extensions_used().filter(|extension| !READ.contains(extension)) {
            self.leave_out(format!("the extension {extension}"));
        }
    }

    /// The scene, degenerate triangles gone, with its warnings.
    fn finish(mut self) -> Result<Scene> {
        let (min, max) = self.scene.bounds();
        let extent = (max - min).max_element();
        let dropped: usize = self.scene.meshes.iter_mut().map(|mesh| mesh.drop_degenerate_triangles(extent)).sum();
        self.scene.meshes.retain(|mesh| !mesh.triangles.is_empty());
        if self.scene.triangle_count() == 0 {
            return Err(self.refuse("the scene", "holds no triangle"));
        }
        if dropped > 0 {
            self.scene.warnings.push(format!("{dropped} triangle(s) have no area and are left out"));
        }
        if !self.left_out.is_empty() {
            let list: Vec<&str> = self.left_out.iter().map(String::as_str).collect();
            self.scene.warnings.push(format!("not simulated: {}", list.join(", ")));
        }
        Ok(self.scene)
    }
}

/// Determinant times the inverse transpose.
fn cofactor_matrix(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

fn triangles_of(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let turned = |(k, window): (usize, &[u32])| {
                if k % 2 == 0 { [window[0], window[1], window[2]] } else { [window[1], window[0], window[2]] }
            };
            indices.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => indices.get(1..).unwrap_or_default().windows(2).map(|pair| [indices[0], pair[0], pair[1]]).collect(),
        _ => indices.chunks_exact(3).map(|triangle| [triangle[0], triangle[1], triangle[2]]).collect(),
    }
}

/// `%20` and the like turned into bytes; `None` if that gives no text.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = uri.bytes();
    while let Some(byte) = rest.next() {
        if byte == b'%' {
            let digit = |byte: Option<u8>| byte.and_then(|byte| char::from(byte).to_digit(16));
            bytes.push((digit(rest.next())? * 16 + digit(rest.next())?) as u8);
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}
