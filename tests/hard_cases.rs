//! Hard cases of geometry and materials: whatever is done to a scene that should not change its light does not,
//! and extremes stay finite and right.

mod common;

use std::f64::consts::PI;

use common::{Check, assert_complains, assert_holds, device, z_check};
use glam::{DVec2, DVec3, Vec3};
use photonmill::gpu::Gpu;
use photonmill::scene::light::{Light, LightKind};
use photonmill::scene::{Material, Mesh, Scene, Surface, built_in};
use photonmill::selfcheck::Estimate;
use photonmill::selfcheck::measure::irradiance;
use photonmill::settings::transport::{Illumination, TransportSettings};

fn settings() -> TransportSettings {
    TransportSettings { photons: 4000, caustic_photons: 4000, rounds: 2, shadow_rays: 8, ..TransportSettings::default() }
}

/// Two independent estimates of one light.
fn same_light(what: &str, found: Estimate, expected: Estimate) -> Check {
    z_check(what, found.mean, expected.mean, found.standard_error.hypot(expected.standard_error).max(1e-5 * expected.mean.abs()))
}

fn cornell() -> Scene {
    built_in::by_name("cornell").unwrap()
}

const POINTS: [(DVec3, DVec3); 3] =
    [(DVec3::new(0.85, 0.0, 0.9), DVec3::Y), (DVec3::new(0.0, 0.4, 0.6), DVec3::X), (DVec3::new(0.7, 0.8, 0.0), DVec3::Z)];

fn moved(mut scene: Scene, scale: f64, way: DVec3) -> (Scene, Vec<(DVec3, DVec3)>) {
    scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|position| *position = *position * scale + way);
    (scene, POINTS.iter().map(|(position, normal)| (*position * scale + way, *normal)).collect())
}

/// Radiance does not depend on size or place; the file's own coordinates may be far from the origin.
#[test]
fn size_and_place_do_not_change_the_light() {
    let Some(gpu) = device() else { return };
    let expected = irradiance(&gpu, &cornell(), &settings(), &POINTS).unwrap();
    assert!(expected.mean > 0.5 && expected.standard_error < 0.03 * expected.mean, "{expected:?}");
    let far = DVec3::new(1e4, -2e4, 5e3);
    for (what, scale, way) in [("a thousandth", 1e-3, DVec3::ZERO), ("ten thousand times", 1e4, DVec3::ZERO), ("far away", 1.0, far)] {
        let (scene, points) = moved(cornell(), scale, way);
        let found = irradiance(&gpu, &scene, &TransportSettings { seed: 99, ..settings() }, &points).unwrap();
        assert_holds(what, same_light(what, found, expected));
    }
    let (scene, points) = moved(cornell(), 1.0, DVec3::ZERO);
    let mut brighter = scene;
    brighter.materials[3].emission *= 1.3;
    let found = irradiance(&gpu, &brighter, &settings(), &points).unwrap();
    assert_complains("a lamp a third brighter", same_light("brighter", found, expected));
}

/// A parallelogram of `n` x `n` x 2 triangles in place of one of two.
fn tessellated(mesh: &Mesh, n: u32) -> Mesh {
    let [o, a, _, b] = mesh.positions[..] else { panic!("{} is no parallelogram", mesh.name) };
    let place = |i: u32, j: u32| o + (a - o) * (f64::from(i) / f64::from(n)) + (b - o) * (f64::from(j) / f64::from(n));
    let vertex = |i: u32, j: u32| j * (n + 1) + i;
    Mesh {
        positions: (0..=n).flat_map(|j| (0..=n).map(move |i| place(i, j))).collect(),
        triangles: (0..n)
            .flat_map(|j| {
                (0..n).flat_map(move |i| {
                    [[vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1)], [vertex(i, j), vertex(i + 1, j + 1), vertex(i, j + 1)]]
                })
            })
            .collect(),
        uvs: [Vec::<DVec2>::new(), Vec::new()],
        ..mesh.clone()
    }
}

/// Edges, corners and slivers inside a wall are no edges of its light; neither are triangles that lie on it.
#[test]
fn how_a_wall_is_cut_does_not_change_its_light() {
    let Some(gpu) = device() else { return };
    let expected = irradiance(&gpu, &cornell(), &settings(), &POINTS).unwrap();
    let replace = |cut: &dyn Fn(&Mesh) -> Mesh| {
        let mut scene = cornell();
        scene.meshes.iter_mut().take(5).for_each(|mesh| *mesh = cut(mesh));
        irradiance(&gpu, &scene, &TransportSettings { seed: 98, ..settings() }, &POINTS).unwrap()
    };
    let fine = replace(&|mesh| tessellated(mesh, 40));
    assert_holds("3200 triangles a wall", same_light("3200 triangles a wall", fine, expected));
    let sliver = replace(&|mesh| {
        let mut mesh = mesh.clone();
        // A vertex a hair from the diagonal: two slivers beside two triangles.
        let middle = 0.5 * (mesh.positions[0] + mesh.positions[2]);
        mesh.positions.push(middle + 1e-5 * (mesh.positions[1] - mesh.positions[3]));
        mesh.triangles = vec![[0, 1, 4], [1, 2, 4], [0, 4, 2], [0, 2, 3]];
        mesh
    });
    assert_holds("slivers", same_light("slivers", sliver, expected));
    let doubled = replace(&|mesh| Mesh { triangles: [&mesh.triangles[..], &mesh.triangles[..]].concat(), ..mesh.clone() });
    assert_holds("every triangle twice", same_light("every triangle twice", doubled, expected));
}

/// A lamp and a glass pane in a room: an index of refraction of 1 is no pane.
fn behind_a_pane(ior: Option<f32>) -> Scene {
    let mut scene = cornell();
    if let Some(ior) = ior {
        scene.materials.push(Material { surface: Surface::Dielectric { ior }, ..Material::lambert("pane", Vec3::ONE) });
        let pane = scene.materials.len() - 1;
        let (x, z) = (DVec3::X, DVec3::Z);
        scene.meshes.push(Mesh::parallelogram("above", DVec3::new(0.0, 0.97, 0.0), z, x, pane));
        scene.meshes.push(Mesh::parallelogram("below", DVec3::new(0.0, 0.96, 0.0), x, z, pane));
    }
    scene
}

#[test]
fn glass_of_the_air_s_own_index_is_not_there() {
    let Some(gpu) = device() else { return };
    // A wide radius: all direct light comes as a caustic now.
    let settings = TransportSettings { photons: 30_000, caustic_photons: 30_000, caustic_radius: Some(0.08), ..settings() };
    let expected = irradiance(&gpu, &behind_a_pane(None), &settings, &POINTS).unwrap();
    for ior in [1.0, 1.0 + 1e-6] {
        let found = irradiance(&gpu, &behind_a_pane(Some(ior)), &TransportSettings { seed: 97, ..settings.clone() }, &POINTS).unwrap();
        // The wide radius blurs the light by a per cent or so.
        let found = Estimate { standard_error: found.standard_error.hypot(0.01 * expected.mean), ..found };
        assert_holds(ior, same_light(&format!("index {ior}"), found, expected));
    }
    let found = irradiance(&gpu, &behind_a_pane(Some(2.5)), &settings, &POINTS).unwrap();
    assert_complains("an index of 2.5", same_light("index 2.5", found, expected));
}

/// The furnace at the ends of reflectance and of bounces.
#[test]
fn reflectances_and_bounces_at_their_ends_are_right() {
    let Some(gpu) = device() else { return };
    let furnace = |albedo: f32| {
        let mut scene = built_in::by_name("furnace").unwrap();
        scene.materials[0].base_colour = Vec3::splat(albedo);
        scene
    };
    let points = [(DVec3::new(0.5, 0.0, 0.5), DVec3::Y), (DVec3::new(0.2, 0.0, 0.999), DVec3::Y)];
    let ask = |gpu: &Gpu, albedo, bounces| {
        let settings = TransportSettings { bounces, radius: Some(0.2), alpha: 1.0, illumination: Illumination::Photons, ..settings() };
        irradiance(gpu, &furnace(albedo), &settings, &points).unwrap()
    };
    // b landings: 1 + rho + ... + rho^(b - 1) times pi.
    for (albedo, bounces, exact) in [(0.0, 32, PI), (1.0, 1, PI), (1.0, 7, 7.0 * PI), (0.9, 1000, 10.0 * PI), (0.5, 2, 1.5 * PI)] {
        let Estimate { mean, standard_error } = ask(&gpu, albedo, bounces);
        let what = format!("albedo {albedo}, {bounces} bounces");
        assert!(standard_error < 0.05 * exact, "{what}: error {standard_error}");
        assert_holds(&what, z_check(&what, mean, exact, standard_error));
    }
}

/// A lamp flush with a wall lights what faces it, and neither its wall nor what lies behind.
#[test]
fn a_light_flush_with_a_wall_shines_into_the_room() {
    let Some(gpu) = device() else { return };
    let mut scene = built_in::by_name("point-over-plane").unwrap();
    let kind = |height: f64| LightKind::Disc {
        centre: DVec3::Y * height,
        normal: DVec3::Y,
        radius: 0.1,
        power: Vec3::ONE,
        law: photonmill::settings::EmissionLaw::Cosine,
    };
    scene.lights = vec![Light { name: "flush".into(), kind: kind(0.0) }];
    let above = [(DVec3::Y * 2.0, DVec3::NEG_Y)];
    let found = irradiance(&gpu, &scene, &TransportSettings { shadow_rays: 32, ..settings() }, &above).unwrap();
    let exact = 1.0 / (PI * (0.01 + 4.0));
    assert_holds("above", z_check("above", found.mean, exact, found.standard_error.max(1e-4 * exact)));
    for illumination in [Illumination::Split, Illumination::Photons] {
        let settings = TransportSettings { illumination, bounces: 1, ..settings() };
        let beside = irradiance(&gpu, &scene, &settings, &[(DVec3::X * 0.3, DVec3::Y)]).unwrap();
        assert_eq!(beside.mean, 0.0, "{illumination:?}: the lamp's own wall");
    }
}
