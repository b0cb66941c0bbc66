//! The scenes whose light is known in closed form (`scene::closed_forms`), asked by receivers and cameras.

mod common;

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use common::{assert_complains, assert_holds, device, z_check};
use glam::DVec3;
use photonmill::gpu::Gpu;
use photonmill::plan::transport::{Sensor, TransportPlan};
use photonmill::records::Receiver;
use photonmill::render;
use photonmill::scene::closed_forms::{DISC_RADIUS, NAMES, WALL_ALBEDO};
use photonmill::scene::geometry::Geometry;
use photonmill::scene::light::LightKind;
use photonmill::scene::{Camera, Scene, built_in};
use photonmill::settings::transport::{Illumination, TransportSettings};
use photonmill::transport::{self, View, Watch};

const BOTH: [Illumination; 2] = [Illumination::Split, Illumination::Photons];

/// Independent runs of each case.
const SEEDS: u64 = 16;

/// Mean and standard error of the red channel; all scenes here are grey.
type Estimate = (f64, f64);

fn scene(name: &str) -> Scene {
    built_in::by_name(name).unwrap_or_else(|| panic!("there is no scene {name}"))
}

/// Mean of the red channel over all pixels or points, and over seeds; its error from the seeds' spread, since
/// points share photons.
fn light(gpu: &Gpu, scene: &Scene, settings: &TransportSettings, sensor: Sensor, points: &[(DVec3, DVec3)]) -> Estimate {
    let geometry = Geometry::new(scene).unwrap();
    let receiver = |(position, normal): &(DVec3, DVec3)| Receiver {
        position: geometry.to_local(*position),
        normal: normal.as_vec3(),
        shading_normal: normal.as_vec3(),
    };
    let phases: Vec<Vec<Receiver>> = if points.is_empty() { Vec::new() } else { vec![points.iter().map(receiver).collect()] };
    let view = View { geometry: &geometry, camera: scene.cameras.first().filter(|_| points.is_empty()), phases: &phases };
    let means: Vec<f64> = (1..=SEEDS)
        .map(|seed| {
            let settings = TransportSettings { seed, ..settings.clone() };
            let plan = TransportPlan::new(scene, &geometry, &settings, sensor, &render::limits(gpu.facts())).unwrap();
            let never = AtomicBool::new(false);
            let lit = transport::light(gpu, &view, plan, &mut Watch { cancelled: &never, progress: &mut |_, _| {} }).unwrap();
            assert_eq!(lit.anomalies, [0, 0, 0], "values that are no number, or too large for the film");
            (0..lit.film.pixels()).map(|pixel| lit.film.mean(pixel, &lit.plan).x).sum::<f64>() / lit.film.pixels() as f64
        })
        .collect();
    let count = SEEDS as f64;
    let mean = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

fn irradiance(gpu: &Gpu, scene: &Scene, settings: &TransportSettings, points: &[(DVec3, DVec3)]) -> Estimate {
    light(gpu, scene, settings, Sensor::Receivers { count: points.len() as u32 }, points)
}

/// Radiance along one ray, seen through a picture of a narrow view.
fn radiance(gpu: &Gpu, mut scene: Scene, settings: &TransportSettings, eye: DVec3, target: DVec3) -> Estimate {
    scene.cameras = vec![Camera::looking_at("ray", eye, target, DVec3::Y, 0.003)];
    light(gpu, &scene, settings, Sensor::Picture { width: 24, height: 24 }, &[])
}

/// Points of a plane y = 0, evenly over a square around `middle`.
fn floor(middle: DVec3, side: f64) -> Vec<(DVec3, DVec3)> {
    let place = |k: i32| side * ((f64::from(k) + 0.5) / 8.0 - 0.5);
    (0..64).map(|k| (middle + DVec3::new(place(k % 8), 0.0, place(k / 8)), DVec3::Y)).collect()
}

/// Right within the error, and the error small enough for 2 % to be seen. Where nothing is random the error
/// is that of f32.
fn check(what: &str, (mean, error): Estimate, exact: f64) {
    let error = error.max(1e-5 * exact);
    assert_holds(what, z_check(what, mean, exact, error));
    assert_complains(&format!("{what} and 2 %, error {error:.2e} of {exact}"), z_check(what, mean, 1.02 * exact, error));
    assert_complains(&format!("{what} less 2 %, error {error:.2e} of {exact}"), z_check(what, mean, 0.98 * exact, error));
}

/// A fixed radius, so that the bias, where there is one, is known.
fn settings(illumination: Illumination, radius: f64) -> TransportSettings {
    TransportSettings {
        photons: 30_000,
        caustic_photons: 1000,
        rounds: 2,
        shadow_rays: 32,
        radius: Some(radius),
        alpha: 1.0,
        illumination,
        ..TransportSettings::default()
    }
}

#[test]
fn every_scene_of_a_closed_form_is_checked_here() {
    let file = include_str!("closed_form.rs");
    NAMES.iter().for_each(|name| assert!(file.contains(&format!("scene(\"{name}\")")), "{name}"));
}

/// Irradiance pi / (1 - albedo), radiance 1 / (1 - albedo).
#[test]
fn a_furnace_is_even() {
    let Some(gpu) = device() else { return };
    let share = 1.0 - f64::from(WALL_ALBEDO);
    // Next to a wall that shines, few shadow rays find what is nearest: the points keep to the middle.
    let points = floor(DVec3::new(0.5, 0.0, 0.5), 0.6);
    for illumination in BOTH {
        let settings = settings(illumination, 0.2);
        check(&format!("{illumination:?}, irradiance"), irradiance(&gpu, &scene("furnace"), &settings, &points), PI / share);
        let found = radiance(&gpu, scene("furnace"), &settings, DVec3::splat(0.5), DVec3::new(0.3, 0.4, 0.0));
        check(&format!("{illumination:?}, radiance"), found, 1.0 / share);
    }
}

/// 1 / (4 pi) straight from the lamp, albedo / (1 - albedo) / (4 pi) by scattering.
#[test]
fn an_integrating_sphere_is_even() {
    let Some(gpu) = device() else { return };
    let albedo = f64::from(WALL_ALBEDO);
    let sphere = scene("integrating-sphere");
    let mesh = &sphere.meshes[0];
    let points: Vec<(DVec3, DVec3)> = (0..60)
        .map(|k| {
            let triangle = (2 * k + 1) * mesh.triangles.len() / 121;
            (mesh.corners(triangle).iter().sum::<DVec3>() / 3.0, mesh.normal(triangle))
        })
        .collect();
    for illumination in BOTH {
        let (mean, error) = irradiance(&gpu, &sphere, &settings(illumination, 0.2), &points);
        let exact = 1.0 / (1.0 - albedo) / (4.0 * PI);
        // The sphere is of facets, a little smaller and nearer to the lamp.
        check(&format!("{illumination:?}"), (mean, error.max(0.001 * exact)), exact);
    }
}

/// 1 / (1 + r^2)^(3/2); photons tell its mean over the disc of their estimate, of radius h,
/// (2 / h^2) (1 - 1 / sqrt(1 + h^2)) straight below.
#[test]
fn a_point_over_a_plane_falls_by_the_cube_of_its_cosine() {
    let Some(gpu) = device() else { return };
    let at = |r: f64| [(DVec3::new(r, 0.0, 0.0), DVec3::Y)];
    let split = settings(Illumination::Split, 0.1);
    for r in [0.0, 0.5, 1.0, 1.7] {
        let found = irradiance(&gpu, &scene("point-over-plane"), &split, &at(r));
        check(&format!("r = {r}"), found, (1.0 + r * r).powf(-1.5));
    }
    let h: f64 = 0.7;
    let photons = TransportSettings { photons: 60_000, bounces: 2, ..settings(Illumination::Photons, h) };
    let found = irradiance(&gpu, &scene("point-over-plane"), &photons, &at(0.0));
    check("photons", found, 2.0 / (h * h) * (1.0 - 1.0 / (1.0 + h * h).sqrt()));
    // L = albedo E / pi to the eye.
    let found = radiance(&gpu, scene("point-over-plane"), &split, DVec3::new(0.4, 1.0, 1.5), DVec3::X * 0.5);
    check("radiance", found, 0.8 / PI * 1.25f64.powf(-1.5));
}

/// 1 / (pi (R^2 + 1)) straight below; photons tell the mean over a disc of radius h, from the form factor of
/// two discs that face each other.
#[test]
fn a_disc_over_a_plane_meets_its_form_factor() {
    let Some(gpu) = device() else { return };
    let below = [(DVec3::ZERO, DVec3::Y)];
    let r = DISC_RADIUS;
    let found = irradiance(&gpu, &scene("disc-over-plane"), &settings(Illumination::Split, 0.1), &below);
    check("shadow rays", found, 1.0 / (PI * (r * r + 1.0)));
    let h: f64 = 0.5;
    let photons = TransportSettings { photons: 60_000, bounces: 2, ..settings(Illumination::Photons, h) };
    let found = irradiance(&gpu, &scene("disc-over-plane"), &photons, &below);
    let x = 1.0 + (1.0 + h * h) / (r * r);
    check("photons", found, 0.5 * (x - (x * x - 4.0 * (h / r).powi(2)).sqrt()) / (PI * h * h));
}

#[test]
fn sun_and_sky_over_a_plane_are_even() {
    let Some(gpu) = device() else { return };
    // Up to the plane's edges, where only the edge correction keeps photons right.
    let points = floor(DVec3::ZERO, 4.0);
    for (name, light, exact) in [("sun", scene("sun-over-plane"), 1.6), ("sky", scene("sky-over-plane"), PI)] {
        for illumination in BOTH {
            let settings = TransportSettings { bounces: 2, ..settings(illumination, 0.25) };
            check(&format!("{name}, {illumination:?}"), irradiance(&gpu, &light, &settings, &points), exact);
        }
        let found = radiance(&gpu, light, &settings(Illumination::Split, 0.1), DVec3::new(0.3, 2.0, 1.0), DVec3::X);
        check(&format!("{name}, radiance"), found, 0.8 / PI * exact);
    }
    // Beside the plane the sky itself is seen.
    let up = radiance(&gpu, scene("sky-over-plane"), &settings(Illumination::Split, 0.1), DVec3::Y, DVec3::Y * 2.0);
    check("the sky", up, 1.0);
}

#[test]
fn two_skies_shine_as_one_of_both_radiances() {
    let Some(gpu) = device() else { return };
    let mut both = scene("sky-over-plane");
    both.lights.push(both.lights[0].clone());
    assert!(matches!(both.lights[0].kind, LightKind::Environment { .. }));
    let plane = irradiance(&gpu, &both, &settings(Illumination::Split, 0.1), &[(DVec3::ZERO, DVec3::Y)]);
    check("the plane under two skies", plane, 2.0 * PI);
    let up = radiance(&gpu, both, &settings(Illumination::Split, 0.1), DVec3::Y, DVec3::Y * 2.0);
    check("two skies seen", up, 2.0);
}

/// Each mirror takes 0.2: a ray that meets them n times sees 0.8^n.
#[test]
fn a_mirror_corridor_dims_by_each_reflection() {
    let Some(gpu) = device() else { return };
    for illumination in BOTH {
        for n in 0..=6 {
            // Unfolded, the end wall lies straight on: the ray goes to the middle of its nth image.
            let target = DVec3::new(f64::from(n), 0.0, -10.0);
            let found = radiance(&gpu, scene("mirror-corridor"), &settings(illumination, 0.1), DVec3::ZERO, target);
            check(&format!("{illumination:?}, {n} mirrors"), found, 0.8f64.powi(n));
        }
    }
}

/// (1 - F) / (1 + F), F = 0.04: the sum over all reflections within the slab.
#[test]
fn a_glass_slab_lets_through_what_fresnel_says() {
    let Some(gpu) = device() else { return };
    let fresnel: f64 = (0.5f64 / 2.5).powi(2);
    let settings = TransportSettings { photons: 1, caustic_photons: 1, ..settings(Illumination::Split, 0.1) };
    let found = radiance(&gpu, scene("glass-slab"), &settings, DVec3::Z * 2.0, DVec3::ZERO);
    check("glass", found, (1.0 - fresnel) / (1.0 + fresnel));
}

/// One lamp of the paper's box, seen from a point straight before it.
#[test]
fn the_open_box_has_its_direct_light() {
    let Some(gpu) = device() else { return };
    let mut room = scene("open-box");
    // One lamp alone, and walls that scatter nothing.
    room.lights.truncate(1);
    room.materials.iter_mut().for_each(|material| material.base_colour = glam::Vec3::ZERO);
    let LightKind::Disc { centre, normal, radius, power, .. } = room.lights[0].kind else { panic!("{:?}", room.lights) };
    let d = 0.5;
    let below = [(centre + d * normal, -normal)];
    let p = f64::from(power.x);
    let exact = match room.lights[0].kind {
        LightKind::Disc { law: photonmill::settings::EmissionLaw::Cosine, .. } => p / (PI * (radius * radius + d * d)),
        // Equal intensity in all directions: the wall's own cosine alone.
        _ => p / (PI * radius * radius) * (1.0 - d / (d * d + radius * radius).sqrt()),
    };
    let found = irradiance(&gpu, &room, &settings(Illumination::Split, 0.1), &below);
    check("opposite the lamp", found, exact);
}
