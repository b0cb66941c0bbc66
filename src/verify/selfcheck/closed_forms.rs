//! Cases for the scenes of [`crate::scene::closed_forms`]: with receivers and cameras, with shadow rays and with photons
//! alone.

use std::f64::consts::PI;

use glam::DVec3;

use super::measure::{irradiance, mean_radiance, radiance};
use super::{Case, Estimate};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::built_in;
use crate::scene::closed_forms::{DISC_RADIUS, WALL_ALBEDO};
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
    built_in::by_name(name).unwrap_or_else(|| panic!("there is no scene {name}"))
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
        block: Some(1),
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

fn case(name: impl Into<String>, expected: f64, measure: impl Fn(&Gpu) -> Result<Estimate> + 'static) -> Case {
    let measure = Box::new(move |gpu: Option<&Gpu>| measure(gpu.expect("this case runs on a device only")));
    Case { name: name.into(), expected, on_gpu: true, measure }
}

/// Irradiance at points (position, normal) of a built-in scene.
fn arriving(name: impl Into<String>, expected: f64, in_scene: &'static str, settings: SceneSettings, points: Vec<(DVec3, DVec3)>) -> Case {
    case(format!("{}: irradiance", name.into()), expected, move |gpu| irradiance(gpu, &scene(in_scene), &settings, &points))
}

/// Radiance that an eye sees in a point of a built-in scene.
fn seen(name: impl Into<String>, expected: f64, in_scene: &'static str, settings: SceneSettings, [eye, point]: [DVec3; 2]) -> Case {
    case(name, expected, move |gpu| radiance(gpu, &scene(in_scene), &settings, eye, point))
}

pub(crate) fn cases() -> Vec<Case> {
    [furnace(), integrating_sphere(), point(), disc(), sun_and_sky(), mirrors(), glass()].into_iter().flatten().collect()
}

/// Irradiance pi / (1 - albedo), radiance 1 / (1 - albedo), wherever one looks.
fn furnace() -> Vec<Case> {
    let share = 1.0 - f64::from(WALL_ALBEDO);
    let of_way = |(illumination, builder): (Illumination, Builder)| {
        // More bounces than 24 have 1e-7 of the light.
        let settings = SceneSettings { builder: Some(builder), bounces: 24, ..settings(illumination, 0.2) };
        let what = format!("furnace, {illumination:?}, {builder:?}");
        [
            arriving(&what, PI / share, "furnace", settings.clone(), all_walls()),
            case(format!("{what}: radiance"), 1.0 / share, move |gpu| {
                let camera = Camera::looking_at("wide", DVec3::splat(0.5), DVec3::new(0.3, 0.4, 0.0), DVec3::Y, 2.2);
                mean_radiance(gpu, &scene("furnace"), &settings, &camera)
            }),
        ]
    };
    WAYS.into_iter().flat_map(of_way).collect()
}

/// 1 / (4 pi) straight from the lamp, albedo / (1 - albedo) / (4 pi) by scattering.
fn integrating_sphere() -> Vec<Case> {
    let expected = 1.0 / (1.0 - f64::from(WALL_ALBEDO)) / (4.0 * PI);
    let of = |illumination: Illumination| {
        case(format!("integrating sphere, {illumination:?}: irradiance"), expected, move |gpu| {
            let sphere = scene("integrating-sphere");
            let mesh = &sphere.meshes[0];
            let triangles = (0..60).map(|k| (2 * k + 1) * mesh.triangles.len() / 121);
            let middle = |triangle: usize| mesh.corners(triangle).iter().sum::<DVec3>() / 3.0;
            let points: Vec<(DVec3, DVec3)> = triangles.map(|triangle| (middle(triangle), mesh.normal(triangle))).collect();
            let settings = SceneSettings { bounces: 24, ..settings(illumination, 0.2) };
            let found = irradiance(gpu, &sphere, &settings, &points)?;
            // The sphere is of facets, a little smaller and nearer to the lamp.
            Ok(Estimate { standard_error: found.standard_error.max(0.001 * expected), ..found })
        })
    };
    BOTH.map(of).into()
}

/// 1 / (1 + r^2)^(3/2); photons give its mean over the disc of their estimate, of radius h,
/// (2 / h^2) (1 - 1 / sqrt(1 + h^2)) straight below; L = albedo E / pi to the eye.
fn point() -> Vec<Case> {
    const SCENE: &str = "point-over-plane";
    let split = || settings(Illumination::Split, 0.1);
    let off_axis = |r: f64| {
        let name = format!("point light, {r} m off axis");
        arriving(name, (1.0 + r * r).powf(-1.5), SCENE, split(), vec![(DVec3::X * r, DVec3::Y)])
    };
    // The wider, the more photons.
    let h: f64 = 1.9;
    let over_disc = 2.0 / (h * h) * (1.0 - 1.0 / (1.0 + h * h).sqrt());
    let photons = SceneSettings { photons: 60_000, bounces: 2, ..settings(Illumination::Photons, h) };
    let rays = [DVec3::new(0.4, 1.0, 1.5), DVec3::X * 0.5];
    let others = [
        arriving("point light, photons", over_disc, SCENE, photons, vec![(DVec3::ZERO, DVec3::Y)]),
        seen("point light: radiance of the plane", 0.8 / PI * 1.25f64.powf(-1.5), SCENE, split(), rays),
    ];
    [0.0, 0.5, 1.7].map(off_axis).into_iter().chain(others).collect()
}

/// 1 / (pi (R^2 + 1)) straight below, and for equal intensity in all directions the disc's solid angle over
/// 2 pi (pi R^2), (1 - 1 / sqrt(1 + R^2)) / (pi R^2); photons give the mean over a disc of radius h, from the form factor of two
/// discs that face each other.
fn disc() -> Vec<Case> {
    const SCENE: &str = "disc-over-plane";
    let below = [(DVec3::ZERO, DVec3::Y)];
    let split = settings(Illumination::Split, 0.1);
    let r = DISC_RADIUS;
    let h: f64 = 0.5;
    let x = 1.0 + (1.0 + h * h) / (r * r);
    let mean = 0.5 * (x - (x * x - 4.0 * (h / r).powi(2)).sqrt()) / (PI * h * h);
    let photons = SceneSettings { photons: 60_000, bounces: 2, ..settings(Illumination::Photons, h) };
    let by_intensity = (1.0 - 1.0 / (1.0 + r * r).sqrt()) / (PI * r * r);
    vec![
        arriving("disc light", 1.0 / (PI * (r * r + 1.0)), SCENE, split.clone(), below.into()),
        arriving("disc light, photons", mean, SCENE, photons, below.into()),
        case("disc light, uniform intensity: irradiance", by_intensity, move |gpu| {
            let mut scene = scene(SCENE);
            for light in &mut scene.lights {
                if let LightKind::Disc { law, .. } = &mut light.kind {
                    *law = EmissionLaw::Uniform;
                }
            }
            irradiance(gpu, &scene, &split, &below)
        }),
    ]
}

/// 1.6 and pi, up to the plane's edges, where only the edge correction keeps photons right.
fn sun_and_sky() -> Vec<Case> {
    let mut cases = Vec::new();
    for (name, expected) in [("sun-over-plane", 1.6), ("sky-over-plane", PI)] {
        for illumination in BOTH {
            // A sixth of the sky's photons meets the plane.
            let settings = SceneSettings { bounces: 2, photons: 120_000, ..settings(illumination, 0.25) };
            cases.push(arriving(format!("{name}, {illumination:?}"), expected, name, settings, floor(DVec3::ZERO, 4.4)));
        }
    }
    let up = [DVec3::Y, DVec3::Y * 2.0];
    cases.push(seen("sky: radiance", 1.0, "sky-over-plane", settings(Illumination::Split, 0.1), up));
    cases
}

/// Each mirror takes 0.2: a ray that meets them n times sees 0.8^n.
fn mirrors() -> Vec<Case> {
    let of = |n: i32| {
        // Unfolded, the end wall lies straight on: the ray goes to the middle of its nth image.
        let ray = [DVec3::ZERO, DVec3::new(f64::from(n), 0.0, -10.0)];
        let name = format!("mirror corridor, {}: radiance", counted(n, "mirror"));
        seen(name, 0.8f64.powi(n), "mirror-corridor", settings(Illumination::Split, 0.1), ray)
    };
    [1, 3, 6].map(of).into()
}

/// (1 - F) / (1 + F): the sum over all reflections within the slab; F = 0.04 straight on.
fn glass() -> Vec<Case> {
    let of = |(name, degrees): (&str, f64)| {
        let fresnel = reflectance(degrees.to_radians(), 1.5);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let rays = SceneSettings { photons: 1, caustic_photons: 1, rounds: 16, ..settings(Illumination::Split, 0.1) };
        let ray = [2.0 * DVec3::new(sin, 0.0, cos), DVec3::ZERO];
        seen(format!("glass slab, {name}: radiance"), (1.0 - fresnel) / (1.0 + fresnel), "glass-slab", rays, ray)
    };
    [("normal incidence", 0.0), ("at 60 degrees", 60.0)].map(of).into()
}

/// What a smooth surface reflects of unpolarised light (Fresnel; Born and Wolf 1.5.2).
fn reflectance(angle: f64, ior: f64) -> f64 {
    let (cos, inner_cos) = (angle.cos(), (angle.sin() / ior).asin().cos());
    let amplitude = |a: f64, b: f64| ((a - b) / (a + b)).powi(2);
    0.5 * (amplitude(cos, ior * inner_cos) + amplitude(ior * cos, inner_cos))
}
