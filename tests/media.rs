//! Solids with media: what they absorb, and solids in one another.

use crate::common::prelude::*;
use photonmill::engine::scene::{self, Target};
use photonmill::scene::material::{Layers, Medium};
use photonmill::verify::judge::Verdict;

fn solid(name: &str, ior: f32, transmittance: Vec3) -> Material {
    let layers =
        Layers { metallic: 0.0, roughness: 0.0, transmission: 1.0, ior, medium: Some(Medium { transmittance }), ..Layers::default() };
    Material::layered(name, Vec3::ONE, layers)
}

fn cuboid(name: &str, low: DVec3, high: DVec3, material: usize) -> Vec<Mesh> {
    let size = high - low;
    let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    let side = |origin, u, v| Mesh::parallelogram(name, origin, u, v, material);
    vec![side(low, y, x), side(low, z, y), side(low, x, z), side(high, -x, -y), side(high, -y, -z), side(high, -z, -x)]
}

fn reflectance(cos_i: f64, ior: f64) -> f64 {
    let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (ior * ior)).sqrt();
    let (p, s) = ((ior * cos_i - cos_t) / (ior * cos_i + cos_t), (cos_i - ior * cos_t) / (cos_i + ior * cos_t));
    0.5 * (p * p + s * s)
}

/// The radiance that arrives from beyond a slab, which shines with 1 on one side only: a white lamp behind, black before.
fn through_slab(gpu: &Gpu, materials: Vec<Material>, slabs: Vec<Mesh>, angle: f64) -> (f64, f64) {
    let lamp = Material { emission: Vec3::ONE, ..Material::lambert("lamp", Vec3::ZERO) };
    let mut scene = Scene { materials, meshes: slabs, ..Scene::default() };
    scene.materials.push(lamp);
    scene.meshes.push(Mesh::parallelogram(
        "lamp",
        DVec3::new(-20.0, -20.0, -4.0),
        40.0 * DVec3::X,
        40.0 * DVec3::Y,
        scene.materials.len() - 1,
    ));
    let eye = DVec3::new(4.0 * angle.tan(), 0.0, 4.0);
    let camera = Camera::looking_at("ray", eye, DVec3::ZERO, DVec3::Y, 1e-3);
    let settings = SceneSettings { rounds: 64, photons: 100, caustic_photons: 100, ..SceneSettings::default() };
    let lit = scene::render(gpu, &scene, &settings, Target::Picture(&camera, [8, 8])).unwrap();
    mean_and_error(&means(&lit).iter().map(|mean| mean.x).collect::<Vec<_>>())
}

/// T = (1 - R)^2 a / (1 - R^2 a^2), a of the way d / cos t inside.
#[test]
fn slabs_absorb_by_the_way_inside() {
    let Some(gpu) = device() else { return };
    for (angle, transmittance, thickness) in [(0.0f64, 0.5f32, 1.0), (1.0, 0.5, 1.0), (0.6, 0.1, 0.4)] {
        let slab = cuboid("slab", DVec3::new(-9.0, -9.0, -thickness), DVec3::new(9.0, 9.0, 0.0), 0);
        let (found, error) = through_slab(&gpu, vec![solid("slab", 1.5, Vec3::splat(transmittance))], slab, angle);
        let cos_t = (1.0 - (angle.sin() / 1.5).powi(2)).sqrt();
        let (a, r) = (f64::from(transmittance).powf(thickness / cos_t), reflectance(angle.cos(), 1.5));
        let expected = (1.0 - r).powi(2) * a / (1.0 - (r * a).powi(2));
        assert!((found - expected).abs() < 4.0 * error + 1e-4, "angle {angle}: {found} +- {error} instead of {expected}");
    }
}

/// A solid within another of the same index is seen by its absorption alone; the inner medium counts where both are.
#[test]
fn nested_solids_of_one_index_make_one_slab() {
    let Some(gpu) = device() else { return };
    let outer = cuboid("outer", DVec3::new(-9.0, -9.0, -1.0), DVec3::new(9.0, 9.0, 0.0), 0);
    let inner = cuboid("inner", DVec3::new(-8.0, -8.0, -0.7), DVec3::new(8.0, 8.0, -0.3), 1);
    let materials = vec![solid("outer", 1.5, Vec3::splat(0.5)), solid("inner", 1.5, Vec3::splat(0.1))];
    let (found, error) = through_slab(&gpu, materials, [outer, inner].concat(), 0.0);
    let (a, r) = (0.5f64.powf(0.6) * 0.1f64.powf(0.4), reflectance(1.0, 1.5));
    let expected = (1.0 - r).powi(2) * a / (1.0 - (r * a).powi(2));
    assert!((found - expected).abs() < 4.0 * error + 1e-4, "{found} +- {error} instead of {expected}");
}

/// An eye, a lamp and a matt ball in water, and a ball of glass in it.
#[test]
fn what_lies_in_a_medium_agrees_with_the_judge() {
    const SIZE: u32 = 24;
    let Some(gpu) = device() else { return };
    let lamp = Material { emission: Vec3::splat(20.0), ..matt(0.0) };
    let materials = vec![matt(0.6), lamp, solid("water", 1.33, Vec3::new(0.4, 0.7, 0.9)), solid("glass", 1.5, Vec3::new(0.9, 0.2, 0.3))];
    let mut meshes = cuboid("water", DVec3::new(-1.4, -0.4, -1.4), DVec3::new(1.4, 1.5, 1.4), 2);
    meshes.extend([
        level(0.0, [1.2, 1.2], true, 0),
        level(1.2, [0.5, 0.5], false, 1),
        Mesh::sphere("matt ball", DVec3::new(-0.35, 0.3, 0.0), 0.25, 16, 0),
        Mesh::sphere("glass ball", DVec3::new(0.35, 0.35, 0.1), 0.25, 32, 3),
    ]);
    // What paths seldom find is little beside the sky.
    let mut scene = scene_of(meshes, materials, vec![LightKind::Environment { radiance: Vec3::splat(0.5) }]);
    scene.materials[0].two_sided = true;
    scene.cameras.push(Camera::looking_at("camera", DVec3::new(0.1, 0.6, 1.3), DVec3::new(0.0, 0.3, 0.0), DVec3::Y, 0.8));
    let settings = SceneSettings { photons: 20_000, caustic_photons: 20_000, samples: 4, rounds: 32, ..SceneSettings::default() };
    let camera = scene.first_camera();
    let lit = scene::render(&gpu, &scene, &settings, Target::Picture(&camera, [SIZE; 2])).unwrap();
    let judged = Judge::new(&scene, 64).image(&camera, SIZE, SIZE, 1024, 77);
    let verdict = Verdict::new(&means(&lit), &standard_errors(&lit), 32, &judged, None);
    println!("{verdict}");
    assert!(verdict.agrees(), "{verdict}");
}
