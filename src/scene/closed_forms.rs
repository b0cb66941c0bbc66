//! Scenes whose light is known in closed form. Each says what is right.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::light::{Light, LightKind};
use super::material::{Material, Surface};
use super::{Camera, Mesh, Named, Scene};
use crate::settings::EmissionLaw;

pub(crate) const SCENES: [Named; 8] = [
    ("furnace", furnace),
    ("integrating-sphere", integrating_sphere),
    ("point-over-plane", || over_plane(LightKind::Point { position: DVec3::Y, intensity: Vec3::ONE })),
    ("disc-over-plane", || {
        let (centre, normal, law) = (DVec3::Y, DVec3::NEG_Y, EmissionLaw::Cosine);
        over_plane(LightKind::Disc { centre, normal, radius: DISC_RADIUS, power: Vec3::ONE, law })
    }),
    ("sun-over-plane", || over_plane(LightKind::Directional { direction: DVec3::new(0.0, -0.8, -0.6), irradiance: Vec3::splat(2.0) })),
    ("sky-over-plane", || over_plane(LightKind::Environment { radiance: Vec3::ONE })),
    ("mirror-corridor", mirror_corridor),
    ("glass-slab", glass_slab),
];

/// Radius of the lamp of `disc-over-plane`, metres.
pub(crate) const DISC_RADIUS: f64 = 0.25;
/// Share of light that the furnace's and the integrating sphere's walls scatter.
pub(crate) const WALL_ALBEDO: f32 = 0.5;

/// Irradiance of the floor of a scene at (x, 0, z) in closed form, W/m2; `None` where there is none at every point.
pub(crate) fn floor_irradiance(name: &str, x: f64, z: f64) -> Option<f64> {
    let squared = x * x + z * z;
    match name {
        "furnace" => Some(PI / (1.0 - f64::from(WALL_ALBEDO))),
        // 1 W/sr at a height of 1 m: cosine over squared distance.
        "point-over-plane" => Some((1.0 + squared).powf(-1.5)),
        // 1 W over the disc, times the factor of a parallel disc and a small surface beside its axis (Hamilton and Morgan
        // 1952).
        "disc-over-plane" => {
            let disc = DISC_RADIUS * DISC_RADIUS;
            let root = ((squared + 1.0 + disc).powi(2) - 4.0 * disc * squared).sqrt();
            Some(0.5 * (1.0 - (squared + 1.0 - disc) / root) / (PI * disc))
        }
        "sun-over-plane" => Some(2.0 * 0.8),
        "sky-over-plane" => Some(PI),
        _ => None,
    }
}

/// A closed cube of 1 m whose walls emit 1 W/m2/sr and scatter [`WALL_ALBEDO`] of what arrives:
/// radiance 1 / (1 - albedo) and irradiance pi / (1 - albedo) everywhere.
fn furnace() -> Scene {
    let material = Material { emission: Vec3::ONE, ..Material::lambert("wall", Vec3::splat(WALL_ALBEDO)) };
    let (x, y, z, far) = (DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE);
    Scene {
        meshes: vec![
            Mesh::parallelogram("floor", DVec3::ZERO, z, x, 0),
            Mesh::parallelogram("back", DVec3::ZERO, x, y, 0),
            Mesh::parallelogram("left", DVec3::ZERO, y, z, 0),
            Mesh::parallelogram("ceiling", far, -x, -z, 0),
            Mesh::parallelogram("front", far, -y, -x, 0),
            Mesh::parallelogram("right", far, -z, -y, 0),
        ],
        materials: vec![material],
        cameras: vec![Camera::looking_at("inside", DVec3::splat(0.5), DVec3::new(0.1, 0.4, 0.0), DVec3::Y, 1.4).with_aspect(1.0)],
        ..Scene::default()
    }
}

/// A sphere of 1 m radius around a point light of 1 W: after the first bounce the light is even, so the
/// irradiance is 1 / (4 pi) directly and albedo / (1 - albedo) / (4 pi) by scattering, in W/m2.
fn integrating_sphere() -> Scene {
    let mut sphere = Mesh::sphere("sphere", DVec3::ZERO, 1.0, 128, 0);
    // Seen from inside.
    sphere.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    sphere.normals.iter_mut().for_each(|normal| *normal = -*normal);
    let intensity = Vec3::splat((1.0 / (4.0 * PI)) as f32);
    Scene {
        meshes: vec![sphere],
        materials: vec![Material::lambert("wall", Vec3::splat(WALL_ALBEDO))],
        lights: vec![Light { name: "middle".into(), kind: LightKind::Point { position: DVec3::ZERO, intensity } }],
        cameras: vec![Camera::looking_at("inside", DVec3::new(0.0, 0.0, 0.5), DVec3::NEG_Z, DVec3::Y, 1.4).with_aspect(1.0)],
        ..Scene::default()
    }
}

/// A white plane of 4 m at y = 0 under one light. Irradiance at horizontal distance r from the middle:
/// - `point-over-plane`, 1 W/sr at 1 m: 1 / (1 + r^2)^(3/2);
/// - `disc-over-plane`, a Lambertian disc of radius R and 1 W at 1 m, straight below it:
///   1 / (pi (R^2 + 1));
/// - `sun-over-plane`, 2 W/m2 from 0.8 above the horizon (sine): 1.6;
/// - `sky-over-plane`, 1 W/m2/sr from everywhere: pi.
///
/// The plane is flat and alone, so nothing but direct light arrives.
fn over_plane(light: LightKind) -> Scene {
    Scene {
        meshes: vec![Mesh::parallelogram("plane", DVec3::new(-2.0, 0.0, -2.0), DVec3::Z * 4.0, DVec3::X * 4.0, 0)],
        materials: vec![Material::lambert("plane", Vec3::splat(0.8))],
        lights: vec![Light { name: "light".into(), kind: light }],
        cameras: vec![Camera::looking_at("above", DVec3::new(0.0, 1.5, 3.5), DVec3::ZERO, DVec3::Y, 0.9).with_aspect(4.0 / 3.0)],
        ..Scene::default()
    }
}

/// Two facing mirrors of reflectance 0.8, 1 m apart, and a plane of 1 W/m2/sr at the end of the corridor,
/// 10 m off: a ray that meets the mirrors n times sees 0.8^n.
fn mirror_corridor() -> Scene {
    let mirror = Material { surface: Surface::Mirror, ..Material::lambert("mirror", Vec3::splat(0.8)) };
    let lamp = Material { emission: Vec3::ONE, ..Material::lambert("lamp", Vec3::ZERO) };
    Scene {
        meshes: vec![
            Mesh::parallelogram("left", DVec3::new(-0.5, -1.0, -10.0), DVec3::Y * 2.0, DVec3::Z * 10.0, 0),
            Mesh::parallelogram("right", DVec3::new(0.5, -1.0, -10.0), DVec3::Z * 10.0, DVec3::Y * 2.0, 0),
            Mesh::parallelogram("end", DVec3::new(-0.5, -1.0, -10.0), DVec3::X, DVec3::Y * 2.0, 1),
        ],
        materials: vec![mirror, lamp],
        cameras: vec![Camera::looking_at("entrance", DVec3::ZERO, DVec3::new(0.0, 0.0, -1.0), DVec3::Y, 0.5).with_aspect(1.0)],
        ..Scene::default()
    }
}

/// A slab of glass, index 1.5, between the camera and a lamp of 1 W/m2/sr: at normal incidence
/// (1 - F) / (1 + F) of it is seen, F = 0.04.
fn glass_slab() -> Scene {
    let glass = Material { surface: Surface::Dielectric { ior: 1.5 }, ..Material::lambert("glass", Vec3::ONE) };
    let lamp = Material { emission: Vec3::ONE, ..Material::lambert("lamp", Vec3::ZERO) };
    let corner = DVec3::new(-2.0, -2.0, 0.0);
    Scene {
        meshes: vec![
            Mesh::parallelogram("lamp", corner - DVec3::Z, DVec3::X * 4.0, DVec3::Y * 4.0, 1),
            Mesh::parallelogram("front", corner, DVec3::X * 4.0, DVec3::Y * 4.0, 0),
            Mesh::parallelogram("back", corner - 0.1 * DVec3::Z, DVec3::Y * 4.0, DVec3::X * 4.0, 0),
        ],
        materials: vec![glass, lamp],
        cameras: vec![Camera::looking_at("front", DVec3::Z * 2.0, DVec3::ZERO, DVec3::Y, 0.3).with_aspect(1.0)],
        ..Scene::default()
    }
}
