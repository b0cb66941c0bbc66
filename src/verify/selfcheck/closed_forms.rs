//! Cases for the scenes of [`crate::scene::closed_forms`]: with receivers and cameras, with shadow rays and with photons
//! alone.

use std::f64::consts::PI;

use glam::DVec3;

use super::measure::{irradiance, mean_radiance, radiance};
use super::{Case, Estimate};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::closed_forms::{DISC_RADIUS, WALL_ALBEDO, by_name};
use crate::scene::light::LightKind;
use crate::scene::{Camera, Scene};
use crate::settings::scene::{Illumination, SceneSettings};
use crate::settings::{Builder, EmissionLaw};
use crate::text::counted;

const BOTH: [Illumination; 2] = [Illumination::Split, Illumination::Photons];
/// Each way of lighting, and photons by each builder.
const WAYS: [(Illumination, Builder); 4] = [
    (Illumination::Split, Builder::Ballot),
    (Illumination::Photons, Builder::Ballot),
    (Illumination::Photons, Builder::Atomic),
    (Illumination::Photons, Builder::Persistent),
];

fn scene(name: &str) -> Scene {
    by_name(name).unwrap_or_else(|| panic!("there is no scene {name}"))
}

/// A fixed radius, so that the bias, where there is one, is known.
fn settings(illumination: Illumination, radius: f64) -> SceneSettings {
    SceneSettings {
        photons: 30_000,
        caustic_photons: 1000,
        rounds: 2,
        shadow_rays: 32,
        radius: Some(radius),
        alpha: 1.0,
        illumination,
        ..SceneSettings::default()
    }
}

/// Points of a plane y = 0, evenly over a square around `middle`.
fn floor(middle: DVec3, side: f64) -> Vec<(DVec3, DVec3)> {
    let place = |k: i32| side * ((f64::from(k) + 0.5) / 8.0 - 0.5);
    (0..64).map(|k| (middle + DVec3::new(place(k % 8), 0.0, place(k / 8)), DVec3::Y)).collect()
}

/// Points of all walls of the furnace, from edge to edge: wherever a photon lands some of them see it.
fn all_walls() -> Vec<(DVec3, DVec3)> {
    let place = |k: u32| (f64::from(k) + 0.5) / 5.0;
    let of_axis = |axis: usize| {
        let (u, v) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
        let normal = DVec3::AXES[axis];
        (0..25).flat_map(move |k| {
            let point = place(k % 5) * u + place(k / 5) * v;
            [(point, normal), (point + normal, -normal)]
        })
    };
    (0..3).flat_map(of_axis).collect()
}

fn case(name: String, expected: f64, measure: impl Fn(&Gpu) -> Result<Estimate> + 'static) -> Case {
    Case { name, expected, on_gpu: true, measure: Box::new(move |gpu| measure(gpu.expect("this case runs on a device only"))) }
}

pub fn cases() -> Vec<Case> {
    [furnace(), integrating_sphere(), point(), disc(), sun_and_sky(), mirrors(), glass()].into_iter().flatten().collect()
}

/// Irradiance pi / (1 - albedo), radiance 1 / (1 - albedo), wherever one looks.
fn furnace() -> Vec<Case> {
    let share = 1.0 - f64::from(WALL_ALBEDO);
    WAYS.into_iter()
        .flat_map(|(illumination, builder)| {
            // More bounces than 24 have 1e-7 of the light.
            let settings = SceneSettings { builder: Some(builder), bounces: 24, ..settings(illumination, 0.2) };
            let other = settings.clone();
            let what = format!("furnace, {illumination:?}, {builder:?}");
            [
                case(format!("{what}: irradiance"), PI / share, move |gpu| irradiance(gpu, &scene("furnace"), &settings, &all_walls())),
                case(format!("{what}: radiance"), 1.0 / share, move |gpu| {
                    let camera = Camera::looking_at("wide", DVec3::splat(0.5), DVec3::new(0.3, 0.4, 0.0), DVec3::Y, 2.2);
                    mean_radiance(gpu, &scene("furnace"), &other, &camera)
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
                let settings = SceneSettings { bounces: 24, ..settings(illumination, 0.2) };
                let found = irradiance(gpu, &sphere, &settings, &points)?;
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
            case(format!("point light, {r} m off axis: irradiance"), (1.0 + r * r).powf(-1.5), move |gpu| {
                irradiance(gpu, &scene("point-over-plane"), &settings(Illumination::Split, 0.1), &at(r))
            })
        })
        .collect();
    // The wider, the more photons.
    let h: f64 = 1.9;
    cases.push(case("point light, photons: irradiance".into(), 2.0 / (h * h) * (1.0 - 1.0 / (1.0 + h * h).sqrt()), move |gpu| {
        let photons = SceneSettings { photons: 60_000, bounces: 2, ..settings(Illumination::Photons, h) };
        irradiance(gpu, &scene("point-over-plane"), &photons, &at(0.0))
    }));
    cases.push(case("point light: radiance of the plane".into(), 0.8 / PI * 1.25f64.powf(-1.5), |gpu| {
        let split = settings(Illumination::Split, 0.1);
        radiance(gpu, &scene("point-over-plane"), &split, DVec3::new(0.4, 1.0, 1.5), DVec3::X * 0.5)
    }));
    cases
}

/// 1 / (pi (R^2 + 1)) straight below, and for equal intensity in all directions the disc's solid angle over
/// 2 pi (pi R^2), (1 - 1 / sqrt(1 + R^2)) / (pi R^2); photons tell the mean over a disc of radius h, from the form factor of two
/// discs that face each other.
fn disc() -> Vec<Case> {
    let below = [(DVec3::ZERO, DVec3::Y)];
    let r = DISC_RADIUS;
    let h: f64 = 0.5;
    let x = 1.0 + (1.0 + h * h) / (r * r);
    let mean = 0.5 * (x - (x * x - 4.0 * (h / r).powi(2)).sqrt()) / (PI * h * h);
    let by_intensity = (1.0 - 1.0 / (1.0 + r * r).sqrt()) / (PI * r * r);
    vec![
        case("disc light, uniform intensity: irradiance".into(), by_intensity, move |gpu| {
            let mut scene = scene("disc-over-plane");
            for light in &mut scene.lights {
                if let LightKind::Disc { law, .. } = &mut light.kind {
                    *law = EmissionLaw::Uniform;
                }
            }
            irradiance(gpu, &scene, &settings(Illumination::Split, 0.1), &below)
        }),
        case("disc light: irradiance".into(), 1.0 / (PI * (r * r + 1.0)), move |gpu| {
            irradiance(gpu, &scene("disc-over-plane"), &settings(Illumination::Split, 0.1), &below)
        }),
        case("disc light, photons: irradiance".into(), mean, move |gpu| {
            let photons = SceneSettings { photons: 60_000, bounces: 2, ..settings(Illumination::Photons, h) };
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
                // A sixth of the sky's photons meets the plane.
                let settings = SceneSettings { bounces: 2, photons: 120_000, ..settings(illumination, 0.25) };
                irradiance(gpu, &scene(name), &settings, &floor(DVec3::ZERO, 4.4))
            }));
        }
    }
    cases.push(case("sky: radiance".into(), 1.0, |gpu| {
        radiance(gpu, &scene("sky-over-plane"), &settings(Illumination::Split, 0.1), DVec3::Y, DVec3::Y * 2.0)
    }));
    cases
}

/// Each mirror takes 0.2: a ray that meets them n times sees 0.8^n.
fn mirrors() -> Vec<Case> {
    [1, 3, 6]
        .into_iter()
        .map(|n: i32| {
            case(format!("mirror corridor, {}: radiance", counted(n, "mirror")), 0.8f64.powi(n), move |gpu| {
                // Unfolded, the end wall lies straight on: the ray goes to the middle of its nth image.
                let target = DVec3::new(f64::from(n), 0.0, -10.0);
                radiance(gpu, &scene("mirror-corridor"), &settings(Illumination::Split, 0.1), DVec3::ZERO, target)
            })
        })
        .collect()
}

/// (1 - F) / (1 + F): the sum over all reflections within the slab; F = 0.04 straight on.
fn glass() -> Vec<Case> {
    let of = |name: &str, degrees: f64| {
        let fresnel = reflectance(degrees.to_radians(), 1.5);
        case(format!("glass slab, {name}: radiance"), (1.0 - fresnel) / (1.0 + fresnel), move |gpu| {
            let rays = SceneSettings { photons: 1, caustic_photons: 1, rounds: 16, ..settings(Illumination::Split, 0.1) };
            let (sin, cos) = degrees.to_radians().sin_cos();
            radiance(gpu, &scene("glass-slab"), &rays, 2.0 * DVec3::new(sin, 0.0, cos), DVec3::ZERO)
        })
    };
    vec![of("normal incidence", 0.0), of("at 60 degrees", 60.0)]
}

/// What a smooth surface reflects of unpolarised light (Fresnel; Born and Wolf 1.5.2).
fn reflectance(angle: f64, ior: f64) -> f64 {
    let (cos, inner_cos) = (angle.cos(), (angle.sin() / ior).asin().cos());
    let amplitude = |a: f64, b: f64| ((a - b) / (a + b)).powi(2);
    0.5 * (amplitude(cos, ior * inner_cos) + amplitude(ior * cos, inner_cos))
}
