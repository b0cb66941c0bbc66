//! The files of a bake: what each is called and what it holds.

use std::collections::{HashMap, HashSet};
use std::f32::consts::PI;

use glam::Vec3;

use super::document::{self, Geometry, Kind};
use super::{Layout, Map, MeshLightmap};
use crate::error::Result;
use crate::output::colour;
use crate::output::destination::{Folder, write_all};
use crate::scene::material::TextureUse;
use crate::scene::{Material, Scene};

pub const GEOMETRY: &str = "scene.bin";
const RADIANCE_SCENE: &str = "scene.gltf";
const LIGHTMAP_SCENE: &str = "scene_lightmap.gltf";

/// Writes all files of a bake, or none. `exposure` multiplies radiance (and irradiance / pi) in every
/// PNG and in the scenes; EXR files hold values untouched. `maps` are all of [`Layout::maps`].
pub fn write(folder: &Folder, scene: &Scene, layout: &Layout, maps: &[Map], exposure: f32) -> Result<()> {
    let names = Names::new(scene, layout);
    let geometry = Geometry::new(scene, layout);
    let intensities: HashMap<usize, f32> = maps.iter().map(|map| (map.mesh, ceiling(map) * exposure)).collect();
    let texture = |index: usize| {
        let texture = &scene.textures[index];
        (names.texture(index), colour::png(texture.width, texture.height, texture.texels.iter().copied()))
    };
    let textures = document::textures_used(scene).into_iter().map(texture);
    let pictures = maps.iter().flat_map(|map| {
        let stem = names.stem(map.mesh);
        let lightmap = layout.meshes[map.mesh].as_ref().expect("a map belongs to a mesh that has one");
        // Encoded only when it is their turn: pictures of a large scene need not lie in memory together.
        let encode = move |ending: &str| match ending {
            IRRADIANCE => colour::exr(map.width, map.height, &map.irradiance),
            ERROR => colour::exr(map.width, map.height, &map.error),
            LIGHTMAP => {
                let ceiling = ceiling(map);
                colour::linear_png(map.width, map.height, map.irradiance.iter().map(|value| *value / ceiling))
            }
            RADIANCE => colour::png(map.width, map.height, radiance(scene, lightmap, map).into_iter().map(|value| value * exposure)),
            _ => colour::png(map.width, map.height, map.irradiance.iter().map(|value| *value * (exposure / PI))),
        };
        ENDINGS.into_iter().map(move |ending| (format!("{stem}{ending}"), encode(ending)))
    });
    let documents = [(RADIANCE_SCENE, Kind::Radiance), (LIGHTMAP_SCENE, Kind::Lightmap)].into_iter().map(|(name, kind)| {
        let document = document::document(scene, layout, &geometry, &names, kind, |mesh| intensities[&mesh]);
        (name.to_owned(), serde_json::to_vec_pretty(&document).expect("a document is plain data"))
    });
    let files = pictures.chain(textures).chain([(GEOMETRY.to_owned(), geometry.bytes.clone())]).chain(documents);
    write_all(files.map(|(name, content)| (folder.file(&name), content)))
}

const IRRADIANCE: &str = "_irradiance.exr";
const ERROR: &str = "_error.exr";
const PREVIEW: &str = ".png";
const RADIANCE: &str = "_radiance.png";
const LIGHTMAP: &str = "_lightmap.png";
const ENDINGS: [&str; 5] = [IRRADIANCE, ERROR, PREVIEW, RADIANCE, LIGHTMAP];

/// Irradiance that is white in the map's linear PNG: the brightest, but for the brightest thousandth
/// of its texels. So a few caustic texels do not leave the rest a handful of 8-bit steps.
fn ceiling(map: &Map) -> f32 {
    let mut values: Vec<f32> =
        map.irradiance.iter().map(|value| value.max_element()).filter(|value| *value > 0.0 && value.is_finite()).collect();
    if values.is_empty() {
        return 1.0;
    }
    let place = values.len() - 1 - values.len() / 1000;
    *values.select_nth_unstable_by(place, f32::total_cmp).1
}

/// What leaves the front of every texel, W/m2/sr: irradiance by the base colour, and the emission.
/// For a glossy surface that is the mean over all directions.
fn radiance(scene: &Scene, lightmap: &MeshLightmap, map: &Map) -> Vec<Vec3> {
    let Material { base_colour, base_colour_texture, emission, emission_texture, .. } = scene.materials[lightmap.mesh.material];
    let radiance = lightmap.texels.iter().map(|texel| {
        let irradiance = map.irradiance[(texel.y * map.width + texel.x) as usize];
        let of_points = texel.points.iter().map(|point| {
            let colour = |texture: Option<TextureUse>| match texture {
                Some(used) => scene.textures[used.texture].sample(point.uv(&lightmap.mesh, used.uv_set)),
                None => Vec3::ONE,
            };
            base_colour * colour(base_colour_texture) * irradiance / PI + emission * colour(emission_texture)
        });
        of_points.sum::<Vec3>() / texel.points.len() as f32
    });
    lightmap.spread(&radiance.collect::<Vec<_>>())
}

/// File names, each once even where case does not count.
pub struct Names {
    /// One a mesh of the scene; empty where it has no map.
    stems: Vec<String>,
}

impl Names {
    fn new(scene: &Scene, layout: &Layout) -> Names {
        let mut taken: HashSet<String> = [GEOMETRY, RADIANCE_SCENE, LIGHTMAP_SCENE].map(str::to_owned).into();
        taken.extend((0..scene.textures.len()).map(texture_name));
        let mut stems = vec![String::new(); scene.meshes.len()];
        // Meshes of one name are told apart by numbers that go on, so that many of them cost no search.
        let mut counts = HashMap::new();
        for (mesh, lightmap) in layout.lightmaps() {
            let wanted = sanitised(&lightmap.mesh.name);
            let count = counts.entry(wanted.to_lowercase()).or_insert(0);
            stems[mesh] = loop {
                *count += 1;
                let stem = if *count == 1 { wanted.clone() } else { format!("{wanted}_{count}") };
                let files = ENDINGS.map(|ending| format!("{stem}{ending}").to_lowercase());
                if files.iter().all(|file| !taken.contains(file)) {
                    taken.extend(files);
                    break stem;
                }
            };
        }
        Names { stems }
    }

    fn stem(&self, mesh: usize) -> &str {
        &self.stems[mesh]
    }

    pub fn radiance(&self, mesh: usize) -> String {
        format!("{}{RADIANCE}", self.stem(mesh))
    }

    pub fn lightmap(&self, mesh: usize) -> String {
        format!("{}{LIGHTMAP}", self.stem(mesh))
    }

    pub fn texture(&self, texture: usize) -> String {
        texture_name(texture)
    }
}

fn texture_name(texture: usize) -> String {
    format!("texture_{texture}.png")
}

/// A name that every file system takes and that needs no escapes in a URI's path: letters, digits, `-`
/// and `_`.
fn sanitised(name: &str) -> String {
    const LONGEST: usize = 60;
    // Names of devices on Windows, whatever their extension.
    const RESERVED: [&str; 4] = ["con", "prn", "aux", "nul"];
    let kept = |letter: char| if letter.is_alphanumeric() || letter == '-' { letter } else { '_' };
    let text: String = name.trim().chars().take(LONGEST).map(kept).collect();
    let is_port = |text: &str| text.len() == 4 && (text.starts_with("com") || text.starts_with("lpt"));
    let lower = text.to_lowercase();
    match text.is_empty() || RESERVED.contains(&lower.as_str()) || is_port(&lower) {
        true => format!("mesh_{text}"),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_suit_every_file_system() {
        let names = ["tall block", "../../etc/passwd", "a:b*c?", "Würfel", "", "NUL", "com1", ".hidden"];
        let sane = ["tall_block", "______etc_passwd", "a_b_c_", "Würfel", "mesh_", "mesh_NUL", "mesh_com1", "_hidden"];
        assert_eq!(names.map(sanitised), sane);
        assert!(sanitised(&"x".repeat(500)).len() < 100);
    }

    #[test]
    fn a_few_bright_texels_do_not_set_the_scale() {
        let mut irradiance = vec![Vec3::splat(2.0); 4000];
        irradiance[7] = Vec3::splat(500.0);
        let map = Map { mesh: 0, width: 40, height: 100, error: Vec::new(), irradiance };
        assert_eq!(ceiling(&map), 2.0);
        assert_eq!(ceiling(&Map { irradiance: vec![Vec3::ZERO; 4], ..map.clone() }), 1.0);
        assert_eq!(ceiling(&Map { irradiance: vec![Vec3::new(0.5, 3.0, 0.0)], ..map }), 3.0);
    }
}
