//! A million triangles: written as a file, loaded, rendered. Large, so it waits for `--ignored`.

use crate::common::prelude::*;
use photonmill::bake::{self, Layout};
use photonmill::output::destination::Folder;

/// A glass ball of a million triangles over a plane, lit by a lamp.
#[test]
#[ignore = "long: a million triangles take seconds"]
fn a_million_triangles_load_and_render() {
    let Some(gpu) = device() else { return };
    let ball = Mesh::sphere("ball", 0.6 * DVec3::Y, 0.5, 1002, 2);
    let mut scene = scene_of(
        vec![level(0.0, [4.0; 2], true, 0), level(2.0, [0.6; 2], false, 1), ball],
        vec![matt(0.6), Material { emission: Vec3::splat(40.0), ..matt(0.5) }, glass(1.5)],
        vec![],
    );
    scene.cameras.push(Camera::looking_at("front", DVec3::new(0.6, 1.4, 3.0), 0.3 * DVec3::Y, DVec3::Y, 0.8));
    let folder = tempfile::tempdir().unwrap();
    let layout = Layout::new(&scene, 8.0).unwrap();
    let maps = layout.maps(&vec![bake::TexelEstimate::default(); layout.texel_count()], Default::default());
    bake::write(&Folder::open("-o", folder.path()).unwrap(), &scene, &layout, &maps, 1.0).unwrap();

    let began = Instant::now();
    let file = folder.path().join("scene_lightmap.gltf");
    let loaded = Scene::open(file.to_str().unwrap(), false).unwrap();
    let read = began.elapsed();
    assert!(loaded.triangle_count() > 1_000_000, "{} triangles", loaded.triangle_count());
    let settings = SceneSettings { photons: 100_000, caustic_photons: 100_000, rounds: 4, ..by_rounds() };
    let result = seen(&gpu, &loaded, &settings, &loaded.cameras[0], [256; 2]);
    println!("read in {read:?}, all {:?}", began.elapsed());
    // The caustic under the ball and the plane around it are lit.
    assert!(result.film.part_totals[0] > 0 && result.film.part_totals[1] > 0 && result.film.part_totals[2] > 0);
}
