//! Bytes of a file -> loader -> geometry -> plan: a scene, or one line that says why not.

use std::path::PathBuf;
use std::sync::LazyLock;

use super::mutation::{self, MutateBytes};
use super::{file, refused};
use photonmill::plan::Limits;
use photonmill::plan::scene::ScenePlan;
use photonmill::plan::sensor::Sensor;
use photonmill::scene::Scene;
use photonmill::scene::geometry::Geometry;
use photonmill::settings::scene::SceneSettings;

/// The file that the loader opens.
static FILE: LazyLock<PathBuf> = LazyLock::new(|| file("a.gltf"));

pub fn run(bytes: &[u8]) {
    // The loader tells .gltf and .glb apart by content.
    std::fs::write(&*FILE, bytes).expect("the file can be written");
    let outcome = Scene::open(FILE.to_str().expect("a name in letters"), false).and_then(|scene| {
        let geometry = Geometry::new(&scene)?;
        let limits = Limits::of_host();
        let plan = ScenePlan::new(&scene, &geometry, &SceneSettings::default(), Sensor::Picture { width: 16, height: 16 }, &limits)?;
        check(&scene, &geometry);
        assert!(plan.film.scale.is_finite() && plan.film.scale > 0.0, "film scale {}", plan.film.scale);
        assert!(plan.bytes <= limits.memory_bytes, "{} bytes", plan.bytes);
        Ok(())
    });
    if let Err(error) = outcome {
        refused(&error);
    }
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
