//! A million triangles: written as a file, loaded, rendered. Large, so it waits for `--ignored`.

use crate::common::prelude::*;
use photonmill::bake::{self, Layout};
use photonmill::engine::scene::{self, View};
use photonmill::output::destination::Folder;

/// A glass ball of a million triangles over a plane, lit by a lamp.
fn million() -> Scene {
    let lamp = Material { emission: Vec3::splat(40.0), ..Material::lambert("lamp", Vec3::splat(0.5)) };
    let glass = Material { surface: Surface::Dielectric { ior: 1.5 }, ..Material::lambert("glass", Vec3::ONE) };
    Scene {
        name: "million".into(),
        meshes: vec![
            Mesh::parallelogram("plane", DVec3::new(-2.0, 0.0, -2.0), DVec3::Z * 4.0, DVec3::X * 4.0, 0),
            Mesh::parallelogram("lamp", DVec3::new(-0.3, 2.0, -0.3), DVec3::X * 0.6, DVec3::Z * 0.6, 1),
            Mesh::sphere("ball", DVec3::new(0.0, 0.6, 0.0), 0.5, 1002, 2),
        ],
        materials: vec![Material::lambert("plane", Vec3::splat(0.6)), lamp, glass],
        cameras: vec![Camera::looking_at("front", DVec3::new(0.6, 1.4, 3.0), DVec3::new(0.0, 0.3, 0.0), DVec3::Y, 0.8)],
        ..Scene::default()
    }
}

#[test]
#[ignore = "a million triangles take seconds"]
fn a_million_triangles_load_and_render() {
    let Some(gpu) = device() else { return };
    let folder = tempfile::tempdir().unwrap();
    let scene = million();
    let layout = Layout::new(&scene, 8.0).unwrap();
    let maps = layout.maps(&vec![bake::TexelEstimate::default(); layout.texel_count()]);
    bake::write(&Folder::open("-o", folder.path()).unwrap(), &scene, &layout, &maps, 1.0).unwrap();

    let began = Instant::now();
    let file = folder.path().join("scene_lightmap.gltf");
    let loaded = Scene::open(file.to_str().unwrap(), false).unwrap();
    let read = began.elapsed();
    assert!(loaded.triangle_count() > 1_000_000, "{} triangles", loaded.triangle_count());
    let geometry = Geometry::new(&loaded).unwrap();
    let built = began.elapsed() - read;

    let settings = SceneSettings { photons: 100_000, caustic_photons: 100_000, rounds: 4, ..by_rounds() };
    let sensor = Sensor::Picture { width: 256, height: 256 };
    let plan = ScenePlan::new(&loaded, &geometry, &settings, sensor, &engine::limits(gpu.facts())).unwrap();
    let view = View { geometry: &geometry, camera: loaded.cameras.first(), phases: &[] };
    let lit = scene::light(&gpu, &view, plan, &mut Control::default()).unwrap();
    let row = |name: &str| lit.timings.row(name).and_then(|row| row.gpu_ms).unwrap_or_default();
    println!("read {read:?}, hierarchy {built:?}, GPU ms: 4 rounds {:.1}, photons {:.1}", row("round"), row("round/global/trace"));
    assert_eq!(lit.film.anomalies[..2], [0, 0]);
    // The caustic under the ball and the plane around it are lit.
    assert!(lit.film.part_totals[0] > 0 && lit.film.part_totals[1] > 0 && lit.film.part_totals[2] > 0);
}
