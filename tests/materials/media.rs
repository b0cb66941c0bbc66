//! Solids with media: what they absorb, and solids in one another.

use crate::common::estimate_check;
use crate::common::layered::{plastic, without_maps};
use crate::common::prelude::*;
use photonmill::scene::material::{Layers, Medium};
use photonmill::verify::judge::fresnel;

pub fn solid(name: &str, ior: f32, transmittance: Vec3) -> Material {
    let layers = Layers { transmission: 1.0, ior, medium: Some(Medium { transmittance, metres: 1.0 }), ..plastic(0.0) };
    Material::layered(name, Vec3::ONE, layers)
}

pub fn cuboid(name: &str, low: DVec3, high: DVec3, material: usize) -> Vec<Mesh> {
    let size = high - low;
    let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    let side = |origin, u, v| Mesh::parallelogram(name, origin, u, v, material);
    vec![side(low, y, x), side(low, z, y), side(low, x, z), side(high, -x, -y), side(high, -y, -z), side(high, -z, -x)]
}

/// The radiance that arrives from beyond slabs of one index, which emits 1 on one side only: a white lamp behind, black before.
/// Of what enters they keep the share `down`, and of what is reflected back through them the share `up`.
fn slab_check(gpu: &Gpu, materials: Vec<Material>, slabs: Vec<Mesh>, angle: f64, [down, up]: [f64; 2]) -> Check<Complaint> {
    // Wider than what is seen of it through the slabs.
    let half = 20.0 / 9.0 * slabs[0].positions.iter().map(|at| at.x).fold(0.0, f64::max);
    let (x, y) = (2.0 * half * DVec3::X, 2.0 * half * DVec3::Y);
    let lamp = Mesh::parallelogram("lamp", DVec3::new(-half, -half, -4.0), x, y, materials.len());
    let scene = scene_of([slabs, vec![lamp]].concat(), [materials, vec![emissive(0.0)]].concat(), Vec::new());
    let eye = DVec3::new(4.0 * angle.tan(), 0.0, 4.0);
    let camera = Camera::looking_at("ray", eye, DVec3::ZERO, DVec3::Y, 1e-3);
    // No photon map knows any of it.
    let result = seen(gpu, &scene, &without_maps(SceneSettings { rounds: 64, ..by_rounds() }), &camera, [8, 8]);
    let (found, error) = mean_of_all(&means(&result));
    let (found, error) = (found.x, error.x);
    let r = fresnel(angle.cos(), 1.0, 1.5);
    let expected = (1.0 - r).powi(2) * down / (1.0 - r * r * down * up);
    println!("at {angle}: {found} +- {error}, {expected} expected");
    estimate_check(&format!("slabs at {angle}"), found, expected, error.max(2e-5))
}

/// Between two heights, `width` wide.
fn slab(width: f64, bottom: f64, top: f64, material: usize) -> Vec<Mesh> {
    cuboid("slab", DVec3::new(-width, -width, bottom), DVec3::new(width, width, top), material)
}

pub fn absorbing_slab(gpu: &Gpu, angle: f64, transmittance: f32, thickness: f64) -> Check<Complaint> {
    let cos_t = (1.0 - (angle.sin() / 1.5).powi(2)).sqrt();
    let left = f64::from(transmittance).powf(thickness / cos_t);
    slab_check(gpu, vec![solid("slab", 1.5, Vec3::splat(transmittance))], slab(9.0, -thickness, 0.0, 0), angle, [left; 2])
}

#[test]
fn slabs_absorb_by_the_way_inside() {
    let Some(gpu) = device() else { return };
    for (angle, transmittance, thickness) in [(0.0, 0.5, 1.0), (0.6, 0.1, 0.4)] {
        assert_holds("a slab", absorbing_slab(&gpu, angle, transmittance, thickness));
    }
    // So strong a tint that no number of single precision is left after a metre. Where a ray starts is known to some parts in ten million
    // of the scene, and a hundredth of a millimetre takes a thousandth of the light: a small scene.
    let mut ink = solid("slab", 1.5, Vec3::splat(0.1));
    ink.layers.medium = Some(Medium { transmittance: Vec3::splat(0.1), metres: 0.02 });
    assert_holds("ink", slab_check(&gpu, vec![ink], slab(0.05, -0.01, 0.0, 0), 0.0, [0.1f64.sqrt(); 2]));
}

fn two_media() -> Vec<Material> {
    vec![solid("pale", 1.5, Vec3::splat(0.5)), solid("dark", 1.5, Vec3::splat(0.1))]
}

/// A solid within another of the same index is seen by its absorption alone; the inner medium counts where both are.
pub fn nested_slabs(gpu: &Gpu) -> Check<Complaint> {
    let left = 0.5f64.powf(0.6) * 0.1f64.powf(0.4);
    slab_check(gpu, two_media(), [slab(9.0, -1.0, 0.0, 0), slab(8.0, -0.7, -0.3, 1)].concat(), 0.0, [left; 2])
}

/// Where solids lie partly in one another, the smaller one counts, whichever light enters last: from above that is the dark one.
pub fn overlapping_slabs(gpu: &Gpu) -> Check<Complaint> {
    let left = |pale: f64, dark: f64| 0.5f64.powf(pale) * 0.1f64.powf(dark);
    let overlapping = |pale: f64, dark: f64| [slab(pale, -1.0, 0.0, 0), slab(dark, -1.5, -0.5, 1)].concat();
    slab_check(gpu, two_media(), overlapping(9.0, 8.0), 0.0, [left(0.5, 1.0); 2])?;
    slab_check(gpu, two_media(), overlapping(8.0, 9.0), 0.0, [left(1.0, 0.5); 2])
}

/// Under a sky of 1, radiance in clear glass is the square of its index wherever one looks: refraction compresses it.
pub fn eye_in_glass(gpu: &Gpu) -> Check<Complaint> {
    let materials = vec![solid("glass", 1.5, Vec3::ONE)];
    let scene = scene_of(slab(9.0, -1.0, 1.0, 0), materials, vec![LightKind::Environment { radiance: Vec3::ONE }]);
    let camera = Camera::looking_at("eye", DVec3::ZERO, DVec3::new(0.3, 0.1, 1.0), DVec3::Y, 0.1);
    let settings = without_maps(SceneSettings { rounds: 4, with: vec![Effect::Direct], ..by_rounds() });
    let result = seen(gpu, &scene, &settings, &camera, [8, 8]);
    estimate_check("an eye in glass", mean_red(&result), 2.25, 1e-4)
}

/// With y for z.
fn lying(mut slab: Vec<Mesh>) -> Vec<Mesh> {
    slab.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|at| *at = DVec3::new(at.x, at.z, -at.y));
    slab
}

/// A lamp of 1 W/sr and a black floor in a dark solid within a pale one.
pub fn lamp_in_a_medium(gpu: &Gpu) -> Check<Complaint> {
    let mut meshes = lying([slab(3.0, -2.0, 2.0, 0), slab(2.0, -1.0, 1.0, 1)].concat());
    meshes.push(level(-0.5, [1.0; 2], true, 2));
    let materials = two_media().into_iter().chain([matt(0.0)]).collect();
    let scene = scene_of(meshes, materials, vec![point(DVec3::Y * 0.3)]);
    let settings = SceneSettings { rounds: 1, part: Part::Direct, ..by_rounds() };
    let found = means(&received(gpu, &scene, &settings, &[(DVec3::Y * -0.5, DVec3::Y)]))[0].x;
    // Nothing is random.
    estimate_check("a lamp in a medium", found, 0.1f64.powf(0.8) / 0.64, 1e-5)
}

/// Photons of a sun straight above an absorbing slab, on a black floor below it.
pub fn photons_through_a_slab(gpu: &Gpu) -> Check<Complaint> {
    let mut meshes = lying(slab(1.5, 0.5, 1.5, 1));
    meshes.push(level(0.0, [2.0; 2], true, 0));
    let scene = scene_of(meshes, vec![matt(0.0), solid("slab", 1.5, Vec3::splat(0.5))], vec![sun(DVec3::NEG_Y)]);
    let result = received(gpu, &scene, &mapped(20_000, 16, 16, 0.5), &[(DVec3::ZERO, DVec3::Y)]);
    let r = fresnel(1.0, 1.0, 1.5);
    red_check("photons through a slab", &result, 0, 0.5 * (1.0 - r).powi(2) / (1.0 - (0.5 * r).powi(2)), [0.02, 0.0])
}
