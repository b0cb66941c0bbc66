//! The scenes of [`crate::scene::closed_forms`], asked by receivers and cameras, by shadow rays and by photons
//! alone.

use std::f64::consts::PI;

use glam::DVec3;

use super::measure::{irradiance, radiance};
use super::{Case, Estimate};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::Scene;
use crate::scene::closed_forms::{DISC_RADIUS, WALL_ALBEDO, by_name};
use crate::settings::transport::{Illumination, TransportSettings};

const BOTH: [Illumination; 2] = [Illumination::Split, Illumination::Photons];

fn scene(name: &str) -> Scene {
    by_name(name).unwrap_or_else(|| panic!("there is no scene {name}"))
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

/// Points of a plane y = 0, evenly over a square around `middle`.
fn floor(middle: DVec3, side: f64) -> Vec<(DVec3, DVec3)> {
    let place = |k: i32| side * ((f64::from(k) + 0.5) / 8.0 - 0.5);
    (0..64).map(|k| (middle + DVec3::new(place(k % 8), 0.0, place(k / 8)), DVec3::Y)).collect()
}

fn case(name: String, expected: f64, measure: impl Fn(&Gpu) -> Result<Estimate> + 'static) -> Case {
    Case { name, expected, on_gpu: true, measure: Box::new(move |gpu| measure(gpu.expect("this case runs on a device only"))) }
}

pub fn cases() -> Vec<Case> {
    [furnace(), integrating_sphere(), point(), disc(), sun_and_sky(), mirrors(), glass()].into_iter().flatten().collect()
}

/// Irradiance pi / (1 - albedo), radiance 1 / (1 - albedo).
fn furnace() -> Vec<Case> {
    let share = 1.0 - f64::from(WALL_ALBEDO);
    BOTH.into_iter()
        .flat_map(|illumination| {
            let settings = settings(illumination, 0.2);
            let other = settings.clone();
            // From edge to edge.
            let points = floor(DVec3::new(0.5, 0.0, 0.5), 1.0);
            [
                case(format!("furnace, {illumination:?}: irradiance"), PI / share, move |gpu| {
                    irradiance(gpu, &scene("furnace"), &settings, &points)
                }),
                case(format!("furnace, {illumination:?}: radiance"), 1.0 / share, move |gpu| {
                    radiance(gpu, scene("furnace"), &other, DVec3::splat(0.5), DVec3::new(0.3, 0.4, 0.0))
                }),
            ]
        })
        .collect()
}

/// 1 / (4 pi) straight from the lamp, albedo / (1 - albedo) / (4 pi) by scattering.
fn integrating_sphere() -> Vec<Case> {
    let expected = 1.0 / (1.0 - f64::from(WALL_ALBEDO)) / (4.0 * PI);
    BOTH.into_iter()
        .map(|illumination| {
            case(format!("integrating sphere, {illumination:?}: irradiance"), expected, move |gpu| {
                let sphere = scene("integrating-sphere");
                let mesh = &sphere.meshes[0];
                let points: Vec<(DVec3, DVec3)> = (0..60)
                    .map(|k| {
                        let triangle = (2 * k + 1) * mesh.triangles.len() / 121;
                        (mesh.corners(triangle).iter().sum::<DVec3>() / 3.0, mesh.normal(triangle))
                    })
                    .collect();
                let found = irradiance(gpu, &sphere, &settings(illumination, 0.2), &points)?;
                // The sphere is of facets, a little smaller and nearer to the lamp.
                Ok(Estimate { standard_error: found.standard_error.max(0.001 * expected), ..found })
            })
        })
        .collect()
}

/// 1 / (1 + r^2)^(3/2); photons tell its mean over the disc of their estimate, of radius h,
/// (2 / h^2) (1 - 1 / sqrt(1 + h^2)) straight below; L = albedo E / pi to the eye.
fn point() -> Vec<Case> {
    let at = |r: f64| [(DVec3::new(r, 0.0, 0.0), DVec3::Y)];
    let mut cases: Vec<Case> = [0.0, 0.5, 1.7]
        .into_iter()
        .map(|r: f64| {
            case(format!("point light, {r} m aside: irradiance"), (1.0 + r * r).powf(-1.5), move |gpu| {
                irradiance(gpu, &scene("point-over-plane"), &settings(Illumination::Split, 0.1), &at(r))
            })
        })
        .collect();
    let h: f64 = 0.7;
    cases.push(case("point light, photons: irradiance".into(), 2.0 / (h * h) * (1.0 - 1.0 / (1.0 + h * h).sqrt()), move |gpu| {
        let photons = TransportSettings { photons: 60_000, bounces: 2, ..settings(Illumination::Photons, h) };
        irradiance(gpu, &scene("point-over-plane"), &photons, &at(0.0))
    }));
    cases.push(case("point light: radiance of the plane".into(), 0.8 / PI * 1.25f64.powf(-1.5), |gpu| {
        let split = settings(Illumination::Split, 0.1);
        radiance(gpu, scene("point-over-plane"), &split, DVec3::new(0.4, 1.0, 1.5), DVec3::X * 0.5)
    }));
    cases
}

/// 1 / (pi (R^2 + 1)) straight below; photons tell the mean over a disc of radius h, from the form factor of two
/// discs that face each other.
fn disc() -> Vec<Case> {
    let below = [(DVec3::ZERO, DVec3::Y)];
    let r = DISC_RADIUS;
    let h: f64 = 0.5;
    let x = 1.0 + (1.0 + h * h) / (r * r);
    let mean = 0.5 * (x - (x * x - 4.0 * (h / r).powi(2)).sqrt()) / (PI * h * h);
    vec![
        case("disc light: irradiance".into(), 1.0 / (PI * (r * r + 1.0)), move |gpu| {
            irradiance(gpu, &scene("disc-over-plane"), &settings(Illumination::Split, 0.1), &below)
        }),
        case("disc light, photons: irradiance".into(), mean, move |gpu| {
            let photons = TransportSettings { photons: 60_000, bounces: 2, ..settings(Illumination::Photons, h) };
            irradiance(gpu, &scene("disc-over-plane"), &photons, &below)
        }),
    ]
}

/// 1.6 and pi, up to the plane's edges, where only the edge correction keeps photons right.
fn sun_and_sky() -> Vec<Case> {
    let mut cases = Vec::new();
    for (name, expected) in [("sun-over-plane", 1.6), ("sky-over-plane", PI)] {
        for illumination in BOTH {
            cases.push(case(format!("{name}, {illumination:?}: irradiance"), expected, move |gpu| {
                let settings = TransportSettings { bounces: 2, ..settings(illumination, 0.25) };
                irradiance(gpu, &scene(name), &settings, &floor(DVec3::ZERO, 4.4))
            }));
        }
    }
    cases.push(case("sky: radiance".into(), 1.0, |gpu| {
        radiance(gpu, scene("sky-over-plane"), &settings(Illumination::Split, 0.1), DVec3::Y, DVec3::Y * 2.0)
    }));
    cases
}

/// Each mirror takes 0.2: a ray that meets them n times sees 0.8^n.
fn mirrors() -> Vec<Case> {
    [1, 3, 6]
        .into_iter()
        .map(|n: i32| {
            case(format!("mirror corridor, {n} mirror(s): radiance"), 0.8f64.powi(n), move |gpu| {
                // Unfolded, the end wall lies straight on: the ray goes to the middle of its nth image.
                let target = DVec3::new(f64::from(n), 0.0, -10.0);
                radiance(gpu, scene("mirror-corridor"), &settings(Illumination::Split, 0.1), DVec3::ZERO, target)
            })
        })
        .collect()
}

/// (1 - F) / (1 + F), F = 0.04: the sum over all reflections within the slab.
fn glass() -> Vec<Case> {
    let fresnel: f64 = (0.5f64 / 2.5).powi(2);
    vec![case("glass slab: radiance".into(), (1.0 - fresnel) / (1.0 + fresnel), |gpu| {
        let settings = TransportSettings { photons: 1, caustic_photons: 1, ..settings(Illumination::Split, 0.1) };
        radiance(gpu, scene("glass-slab"), &settings, DVec3::Z * 2.0, DVec3::ZERO)
    })]
}
