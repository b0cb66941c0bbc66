//! Built-in scenes that show light which photon maps find easily and path tracers do not.

use glam::{DVec3, Vec3};

use super::light::{Light, LightKind};
use super::material::{Layers, Material, Medium, Surface};
use super::{Camera, Mesh, Named, Scene};

pub(super) const SCENES: [Named; 2] = [("sunlit-room", sunlit_room), ("prism", prism)];

/// A cuboid between two corners; its faces look outwards.
fn cuboid(name: &str, low: [f64; 3], high: [f64; 3], material: usize) -> Vec<Mesh> {
    let (low, high) = (DVec3::from(low), DVec3::from(high));
    let size = high - low;
    let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    let face = |origin, u, v| Mesh::parallelogram(name, origin, u, v, material);
    vec![face(low, y, x), face(low + z, x, y), face(low, z, y), face(low + x, y, z), face(low, x, z), face(low + y, z, x)]
}

/// A room of 5 x 4 x 3 m. Its only light is the sun and the sky through a window of 1 % of its walls; the sun falls on a ball of glass.
fn sunlit_room() -> Scene {
    const WALL: usize = 0;
    const FLOOR: usize = 1;
    const RED: usize = 2;
    const GLASS: usize = 3;
    const METAL: usize = 4;
    let materials = vec![
        Material::lambert("wall", Vec3::new(0.8, 0.78, 0.74)),
        Material::lambert("floor", Vec3::new(0.45, 0.3, 0.18)),
        Material::lambert("red", Vec3::new(0.65, 0.12, 0.08)),
        Material { surface: Surface::Dielectric { ior: 1.5 }, ..Material::lambert("glass", Vec3::ONE) },
        Material::layered("metal", Vec3::new(0.95, 0.75, 0.4), Layers { metallic: 1.0, roughness: 0.25, ..Layers::default() }),
    ];
    // The wall at x = 2.5, 0.2 m thick, around the window.
    let (low, high) = ([1.1, -0.6], [1.9, 0.6]);
    let parts = [
        ("below the window", [2.5, 0.0, -2.0], [2.7, low[0], 2.0], WALL),
        ("above the window", [2.5, high[0], -2.0], [2.7, 3.0, 2.0], WALL),
        ("left of the window", [2.5, low[0], -2.0], [2.7, high[0], low[1]], WALL),
        ("right of the window", [2.5, low[0], high[1]], [2.7, high[0], 2.0], WALL),
        ("ceiling", [-2.7, 3.0, -2.2], [2.7, 3.2, 2.2], WALL),
        ("back", [-2.7, 0.0, -2.2], [2.7, 3.0, -2.0], WALL),
        ("front", [-2.7, 0.0, 2.0], [2.7, 3.0, 2.2], WALL),
        ("red wall", [-2.7, 0.0, -2.0], [-2.5, 3.0, 2.0], RED),
        ("floor", [-2.7, -0.2, -2.2], [2.7, 0.0, 2.2], FLOOR),
        ("table", [-1.9, 0.0, -1.8], [-0.9, 0.7, -0.9], WALL),
    ];
    let mut meshes: Vec<Mesh> = parts.into_iter().flat_map(|(name, low, high, material)| cuboid(name, low, high, material)).collect();
    let ball = DVec3::new(0.55, 0.35, -0.6);
    meshes.push(Mesh::sphere("glass ball", ball, 0.35, 96, GLASS));
    meshes.push(Mesh::sphere("metal ball", DVec3::new(-1.4, 1.0, -1.35), 0.3, 96, METAL));
    let window = DVec3::new(2.5, 1.5, 0.0);
    let sun = LightKind::Directional { direction: (ball - window).normalize(), irradiance: Vec3::new(800.0, 740.0, 640.0) };
    let sky = LightKind::Environment { radiance: Vec3::new(36.0, 46.0, 62.0) };
    let (eye, towards) = (DVec3::new(2.1, 1.6, 1.8), DVec3::new(-0.9, 0.45, -1.4));
    Scene {
        meshes,
        materials,
        lights: [("sun", sun), ("sky", sky)].map(|(name, kind)| Light { name: name.into(), kind }).into(),
        cameras: vec![Camera::looking_at("corner", eye, towards, DVec3::Y, 1.0).with_aspect(1.5)],
        ..Scene::default()
    }
}

/// A narrow beam through a slit and a prism of glass, whose index of refraction differs by colour, onto a screen.
fn prism() -> Scene {
    const SCREEN: usize = 0;
    const BLACK: usize = 1;
    const GLASS: usize = 2;
    const DARK: usize = 3;
    let glass = Layers {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        ior: 1.62,
        // An Abbe number of 13, which makes the bands two to three times as wide as those of flint glass.
        dispersion: 1.5,
        medium: Some(Medium::CLEAR),
        ..Layers::default()
    };
    let materials = vec![
        Material::lambert("screen", Vec3::splat(0.75)),
        Material { two_sided: true, ..Material::lambert("black", Vec3::splat(0.02)) },
        Material::layered("glass", Vec3::ONE, glass),
        Material::lambert("dark", Vec3::splat(0.06)),
    ];
    // Its edge is up, along z; the base is 0.35 m above the floor.
    let (side, length, base) = (0.3, 0.5, 0.35);
    let height = side * 0.75f64.sqrt();
    let [left, right, top] = [(-side / 2.0, base), (side / 2.0, base), (0.0, base + height)].map(|(x, y)| DVec3::new(x, y, -length / 2.0));
    let along = DVec3::Z * length;
    let quad = |name: &str, origin: DVec3, u: DVec3, v: DVec3| Mesh::parallelogram(name, origin, u, v, GLASS);
    let end = |name: &str, corners: [DVec3; 3]| Mesh {
        name: name.into(),
        positions: corners.into(),
        triangles: vec![[0, 1, 2]],
        material: GLASS,
        ..Mesh::default()
    };
    let mut meshes = vec![
        Mesh::parallelogram("floor", DVec3::new(-1.2, 0.0, -0.7), DVec3::Z * 1.4, DVec3::X * 2.6, SCREEN),
        Mesh::parallelogram("wall", DVec3::new(1.4, 0.0, -0.7), DVec3::Z * 1.4, DVec3::Y * 1.1, SCREEN),
        Mesh::parallelogram("back", DVec3::new(-1.2, 0.0, -0.7), DVec3::X * 2.6, DVec3::Y * 1.1, DARK),
        quad("prism, left", left, along, top - left),
        quad("prism, right", right, top - right, along),
        quad("prism, base", left, right - left, along),
        end("prism, back", [left, top, right]),
        end("prism, front", [left + along, right + along, top + along]),
    ];
    // The beam meets the middle of the left face at the angle of least deviation, about, and passes a slit of 12 mm on its way.
    let entry = 0.5 * (left + top) + 0.5 * along;
    let beam = DVec3::new(0.9, 0.43, 0.0).normalize();
    let lamp = entry - 1.0 * beam;
    let across = beam.cross(DVec3::Z).normalize();
    let slit = entry - 0.45 * beam;
    for (name, off) in [("slit, above", 0.006), ("slit, below", -0.126)] {
        meshes.push(Mesh::parallelogram(name, slit + off * across - 0.2 * DVec3::Z, 0.12 * across, 0.4 * DVec3::Z, BLACK));
    }
    let spot = LightKind::Spot { position: lamp, direction: beam, intensity: Vec3::splat(60.0), inner_angle: 0.05, outer_angle: 0.06 };
    let room = LightKind::Environment { radiance: Vec3::splat(0.05) };
    Scene {
        meshes,
        materials,
        lights: [("lamp", spot), ("room", room)].map(|(name, kind)| Light { name: name.into(), kind }).into(),
        cameras: vec![
            Camera::looking_at("front", DVec3::new(-0.1, 0.8, 2.2), DVec3::new(0.32, 0.36, 0.0), DVec3::Y, 0.58).with_aspect(16.0 / 9.0),
        ],
        ..Scene::default()
    }
}
