//! Scenes that need no file.

use glam::{DVec3, Vec3};

use super::light::{Light, LightKind};
use super::material::{Material, Surface};
use super::room::face_axis;
use super::{Camera, Mesh, Named, Scene, closed_forms, open_box, showcase};
use crate::settings::{Preset, RoomSettings};

const SCENES: [Named; 5] = [
    ("open-box", || open_box(Preset::Modified)),
    ("open-box-phong", || open_box(Preset::Phong)),
    ("cornell", cornell),
    ("cornell-spheres", cornell_spheres),
    ("caustic-sphere", caustic_sphere),
];

/// Every built-in scene, those of [`closed_forms`] last.
fn all() -> impl Iterator<Item = Named> {
    SCENES.into_iter().chain(showcase::SCENES).chain(closed_forms::SCENES)
}

pub fn names() -> Vec<&'static str> {
    all().map(|(name, _)| name).collect()
}

pub fn by_name(name: &str) -> Option<Scene> {
    let (name, make) = all().find(|(known, _)| *known == name)?;
    Some(Scene { name: name.into(), ..make() })
}

/// The paper's box, with the lamps and walls of one of its experiments.
fn open_box(preset: Preset) -> Scene {
    let settings = RoomSettings::preset(preset);
    let room = open_box::open_box(&settings);
    let mut scene = Scene::default();
    for (face, wall) in room.walls() {
        let rectangle = room.rectangle(face);
        // u x v looks along the positive axis; the wall faces into the room.
        let (_, sign) = face_axis(face);
        let (u, v) = if sign < 0.0 { (rectangle.u, rectangle.v) } else { (rectangle.v, rectangle.u) };
        let surface = wall.shininess.map_or(Surface::Lambert, |exponent| Surface::PaperPhong { exponent });
        scene.materials.push(Material { surface, ..Material::lambert(wall.name, Vec3::splat(wall.albedo)) });
        scene.meshes.push(Mesh::parallelogram(wall.name, rectangle.origin, u, v, scene.materials.len() - 1));
    }
    for light in &room.lights {
        let (axis, sign) = face_axis(light.face);
        let kind = LightKind::Disc {
            centre: room.rectangle(light.face).centre(),
            normal: -sign * DVec3::AXES[axis],
            radius: light.radius,
            power: Vec3::splat(light.power as f32),
            law: settings.emission,
        };
        scene.lights.push(Light { name: format!("lamp on face {}", light.face), kind });
    }
    scene.cameras.push(Camera::looking_at("front", DVec3::new(0.0, 0.0, 1.0), DVec3::ZERO, DVec3::Y, 0.7).with_aspect(1.0));
    scene
}

/// Edge of the Cornell box, metres.
const BOX: f64 = 1.0;

/// Materials of the Cornell box, in linear RGB as commonly rounded from Cornell's measured spectra.
fn cornell_materials() -> Vec<Material> {
    let lamp = Material { emission: Vec3::new(17.0, 12.0, 4.0), ..Material::lambert("lamp", Vec3::splat(0.78)) };
    vec![
        Material::lambert("white", Vec3::new(0.725, 0.71, 0.68)),
        Material::lambert("red", Vec3::new(0.63, 0.065, 0.05)),
        Material::lambert("green", Vec3::new(0.14, 0.45, 0.091)),
        lamp,
    ]
}

/// Floor, ceiling, back, a red wall on the left, a green one on the right, a lamp under the ceiling;
/// open towards the camera at +z.
fn cornell_room() -> Scene {
    let (x, y, z) = (DVec3::X * BOX, DVec3::Y * BOX, DVec3::Z * BOX);
    let lamp = DVec3::new(0.35, 0.999, 0.35) * BOX;
    Scene {
        meshes: vec![
            Mesh::parallelogram("floor", DVec3::ZERO, z, x, 0),
            Mesh::parallelogram("ceiling", y, x, z, 0),
            Mesh::parallelogram("back", DVec3::ZERO, x, y, 0),
            Mesh::parallelogram("left", DVec3::ZERO, y, z, 1),
            Mesh::parallelogram("right", x, z, y, 2),
            Mesh::parallelogram("lamp", lamp, 0.3 * x, 0.3 * z, 3),
        ],
        materials: cornell_materials(),
        cameras: vec![
            Camera::looking_at("front", DVec3::new(0.5, 0.5, 2.4) * BOX, DVec3::new(0.5, 0.5, 0.0) * BOX, DVec3::Y, 39.0f64.to_radians())
                .with_aspect(1.0),
        ],
        ..Scene::default()
    }
}

/// A block standing on the floor, turned about the vertical.
fn block(name: &str, centre: DVec3, size: DVec3, turn: f64) -> Vec<Mesh> {
    let (sin, cos) = turn.sin_cos();
    let (u, v, w) = (DVec3::new(cos, 0.0, -sin) * size.x, DVec3::Y * size.y, DVec3::new(sin, 0.0, cos) * size.z);
    let corner = centre - 0.5 * (u + w);
    vec![
        Mesh::parallelogram(name, corner + w, u, v, 0),
        Mesh::parallelogram(name, corner + u, -u, v, 0),
        Mesh::parallelogram(name, corner, w, v, 0),
        Mesh::parallelogram(name, corner + u + w, -w, v, 0),
        Mesh::parallelogram(name, corner + v, w, u, 0),
    ]
}

fn cornell() -> Scene {
    let mut scene = cornell_room();
    scene.meshes.extend(block("tall block", DVec3::new(0.33, 0.0, 0.35), DVec3::new(0.3, 0.6, 0.3), 0.3));
    scene.meshes.extend(block("short block", DVec3::new(0.66, 0.0, 0.67), DVec3::new(0.3, 0.3, 0.3), -0.3));
    scene
}

/// A mirror sphere at the back left, a glass sphere at the front right.
fn cornell_spheres() -> Scene {
    let mut scene = cornell_room();
    let smooth = |name: &str, surface: Surface| Material { surface, ..Material::lambert(name, Vec3::ONE) };
    scene.materials.push(smooth("mirror", Surface::Mirror));
    scene.materials.push(smooth("glass", Surface::Dielectric { ior: 1.5 }));
    scene.meshes.push(Mesh::sphere("mirror sphere", DVec3::new(0.3, 0.19, 0.34), 0.18, 96, 4));
    scene.meshes.push(Mesh::sphere("glass sphere", DVec3::new(0.68, 0.19, 0.66), 0.18, 96, 5));
    scene
}

/// A glass sphere over a plane, lit by a small lamp from above: a bright caustic in its shadow.
fn caustic_sphere() -> Scene {
    let lamp = Material { emission: Vec3::splat(300.0), ..Material::lambert("lamp", Vec3::splat(0.5)) };
    let glass = Material { surface: Surface::Dielectric { ior: 1.5 }, ..Material::lambert("glass", Vec3::ONE) };
    Scene {
        meshes: vec![
            Mesh::parallelogram("plane", DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0, 0),
            Mesh::parallelogram("lamp", DVec3::new(-0.45, 1.5, -0.05), DVec3::X * 0.1, DVec3::Z * 0.1, 1),
            Mesh::sphere("glass sphere", DVec3::new(0.0, 0.35, 0.0), 0.25, 128, 2),
        ],
        materials: vec![Material::lambert("plane", Vec3::splat(0.6)), lamp, glass],
        cameras: vec![
            Camera::looking_at("front", DVec3::new(0.6, 1.0, 2.2), DVec3::new(0.1, 0.15, 0.0), DVec3::Y, 0.7).with_aspect(4.0 / 3.0),
        ],
        ..Scene::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_a_lit_scene() {
        for name in names() {
            let scene = by_name(name).unwrap();
            assert_eq!(scene.name, name);
            assert!(scene.is_lit() && scene.triangle_count() > 0 && scene.cameras.iter().any(|camera| camera.aspect.is_some()), "{name}");
            assert!(scene.meshes.iter().all(|mesh| mesh.material < scene.materials.len()), "{name}");
        }
    }

    /// Every face of the room looks into it, and every face of a block out of it.
    #[test]
    fn faces_look_the_right_way() {
        let scene = by_name("cornell").unwrap();
        let centre_of = |mesh: &Mesh| mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
        for mesh in &scene.meshes {
            let from = match mesh.name.as_str() {
                "tall block" => DVec3::new(0.33, 0.3, 0.35),
                "short block" => DVec3::new(0.66, 0.15, 0.67),
                _ => DVec3::splat(0.5),
            };
            let outwards = mesh.normal(0).dot(centre_of(mesh) - from);
            assert!(if mesh.name.ends_with("block") { outwards > 0.0 } else { outwards < 0.0 }, "{}", mesh.name);
        }
    }
}
