//! Bytes of a file -> loader -> geometry -> plan: a scene, or one line that says why not.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use super::mutation::{self, MutateBytes};
use super::{file, refused};
use glam::DVec4;
use photonmill::error::Result;
use photonmill::plan::Limits;
use photonmill::plan::scene::ScenePlan;
use photonmill::plan::sensor::Sensor;
use photonmill::scene::Scene;
use photonmill::scene::geometry::Geometry;
use photonmill::scene::material::{Layers, Material};
use photonmill::settings::scene::SceneSettings;

/// The file that the loader opens.
static FILE: LazyLock<PathBuf> = LazyLock::new(|| file("a.gltf"));

pub fn run(bytes: &[u8]) {
    // The loader distinguishes .gltf and .glb by content.
    std::fs::write(&*FILE, bytes).expect("the file can be written");
    if let Err(error) = plan(&FILE) {
        refused(&error);
    }
}

/// How many triangles the plan of a file has.
pub fn plan(path: &Path) -> Result<usize> {
    let scene = Scene::open(path.to_str().expect("a name in letters"), false)?;
    check_scene(&scene);
    let (geometry, limits) = (Geometry::new(&scene)?, Limits::of_host());
    let plan = ScenePlan::new(&scene, &geometry, &SceneSettings::default(), Sensor::Picture { width: 16, height: 16 }, &limits)?;
    check(&scene, &geometry);
    assert!(plan.film.scale.is_finite() && plan.film.scale > 0.0, "film scale {}", plan.film.scale);
    assert!(plan.bytes <= limits.memory_bytes, "{} bytes", plan.bytes);
    Ok(geometry.triangles.len())
}

/// As many of everything as there must be, and shares from 0 to 1.
fn check_scene(scene: &Scene) {
    for mesh in &scene.meshes {
        let name = &mesh.name;
        let has_one_each = |count: usize, of: usize| count == 0 || count == of;
        let (vertices, material) = (mesh.positions.len(), &scene.materials[mesh.material]);
        for count in [mesh.normals.len(), mesh.uvs[0].len(), mesh.uvs[1].len(), mesh.colours.len(), mesh.alphas.len()] {
            assert!(has_one_each(count, vertices), "{name}: {count} of {vertices}");
        }
        assert!(mesh.alphas.iter().all(|alpha| (0.0..=1.0).contains(alpha)), "{name}: alphas");
        let (needed, needed_by_coat) = (material.tangent_coordinates().is_some(), material.layers.coat_normal_map.is_some());
        for (is_needed, tangents) in [(needed, &mesh.tangents), (needed_by_coat, &mesh.coat_tangents)] {
            assert_eq!(tangents.len(), if is_needed { mesh.triangles.len() } else { 0 }, "{name}");
            let is_unit = |tangent: &DVec4| tangent.truncate().is_normalized() && tangent.w.abs() == 1.0;
            assert!(tangents.as_flattened().iter().all(is_unit), "{name}: tangents");
        }
    }
    for material in &scene.materials {
        let Material { name, layers, base_colour, emission, .. } = material;
        let Layers { metallic, roughness, specular, transmission, diffuse_transmission, iridescence, anisotropy, coat, .. } = *layers;
        let shares = [metallic, roughness, specular, transmission, diffuse_transmission, iridescence, anisotropy, coat];
        let more = [layers.coat_roughness, layers.sheen_roughness].into_iter().chain(base_colour.to_array());
        let more =
            more.chain(layers.sheen_colour.to_array()).chain(layers.medium.map_or([1.0; 3], |medium| medium.transmittance.to_array()));
        assert!(shares.into_iter().chain(more).all(|share| (0.0..=1.0).contains(&share)), "{name}: {layers:?}");
        let rest = [layers.ior, layers.ior_spread()].into_iter().chain(layers.specular_colour.to_array()).chain(emission.to_array());
        assert!(rest.into_iter().all(|factor| factor.is_finite() && factor >= 0.0), "{name}: {layers:?}");
        assert!(material.textures().all(|used| used.texture < scene.textures.len() && used.uv_set < 2), "{name}");
    }
    assert!(scene.textures.iter().all(|texture| texture.texels.count() == texture.width as usize * texture.height as usize));
}

/// What is handed to a device holds numbers, in their ranges.
fn check(scene: &Scene, geometry: &Geometry) {
    for triangle in &geometry.triangles {
        for corner in [triangle.a, triangle.b, triangle.c] {
            assert!(corner.is_finite() && corner.abs().max_element() <= 1.0, "{triangle:?}");
        }
        assert!((triangle.material as usize) < geometry.materials.len(), "{triangle:?}");
    }
    for emitter in &geometry.emitters {
        for share in [emitter.strength, emitter.flux] {
            assert!(share.is_finite() && share.min_element() >= 0.0, "{emitter:?}");
        }
        assert!(emitter.position.is_finite() && emitter.direction.is_finite() && emitter.probability > 0.0, "{emitter:?}");
    }
    assert!(geometry.emitters.is_sorted_by(|a, b| a.cumulative < b.cumulative), "cumulative shares must rise");
    assert!(geometry.emitters.last().is_none_or(|last| last.cumulative == 1.0), "the last share must be 1");
    for uvs in &geometry.uvs {
        let all = [uvs.base_a, uvs.base_b, uvs.base_c, uvs.emission_a, uvs.emission_b, uvs.emission_c];
        assert!(all.iter().all(|uv| uv.is_finite()), "{uvs:?}");
    }
    for material in &geometry.materials {
        assert!(material.base_colour.is_finite() && material.emission.is_finite() && material.parameter.is_finite(), "{material:?}");
    }
    assert!(geometry.flux_unit.is_finite() && geometry.flux_unit > 0.0, "flux unit {}", geometry.flux_unit);
    assert!(geometry.power.is_finite() && geometry.area > 0.0, "{} W on {}", geometry.power, geometry.area);
    for camera in &scene.cameras {
        for vector in [camera.eye, camera.forward, camera.right, camera.up] {
            assert!(vector.is_finite(), "{camera:?}");
        }
    }
}

// Bytes alone rarely stay JSON, and never a .glb of the right lengths: most files are changed value by value.
pub fn change(data: &mut [u8], size: usize, max_size: usize, seed: u32, mutate_bytes: MutateBytes) -> usize {
    mutation::put(mutation::mutate(&data[..size], seed, mutate_bytes), data, size, max_size, mutate_bytes)
}
