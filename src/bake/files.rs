//! The files of a bake: what each is called and what it holds.

use std::collections::HashMap;
use std::f32::consts::PI;

use glam::Vec3;

use super::document::{self, Geometry, Kind};
use super::names::{ENDINGS, ERROR, GEOMETRY, IRRADIANCE, LIGHTMAP, LIGHTMAP_SCENE, Names, RADIANCE, RADIANCE_SCENE};
use super::{Layout, Map, MeshLightmap};
use crate::error::Result;
use crate::output::colour;
use crate::output::destination::{Folder, write_all};
use crate::scene::material::TextureUse;
use crate::scene::{Material, Scene};

/// Writes all files of a bake, or none. `exposure` multiplies radiance (and irradiance / pi) in every
/// PNG and in the scenes; EXR files hold values untouched. `maps` are all of [`Layout::maps`].
pub fn write(folder: &Folder, scene: &Scene, layout: &Layout, maps: &[Map], exposure: f32) -> Result<()> {
    let names = Names::new(scene, layout);
    let geometry = Geometry::new(scene, layout);
    let intensities: HashMap<usize, f32> = maps.iter().map(|map| (map.mesh, ceiling(map) * exposure)).collect();
    let texture = |index: usize| {
        let texture = &scene.textures[index];
        (names.texture(index), colour::texture_png(texture))
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
                Some(used) => scene.textures[used.texture].sample(used.transform.apply(point.uv(&lightmap.mesh, used.uv_set))).truncate(),
                None => Vec3::ONE,
            };
            base_colour * point.colour(&lightmap.mesh).as_vec3() * colour(base_colour_texture) * irradiance / PI
                + emission * colour(emission_texture)
        });
        of_points.sum::<Vec3>() / texel.points.len() as f32
    });
    lightmap.spread(&radiance.collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

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
