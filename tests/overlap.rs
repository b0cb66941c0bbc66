//! Surfaces that lie in one plane, or next to it: their light is that of one, and of each.

use crate::common::lit::{level, matt, received, scene_of, shining};
use crate::common::{device, z_check};
use glam::{DQuat, DVec3};
use photonmill::gpu::Gpu;
use photonmill::scene::{Mesh, Scene};
use photonmill::settings::transport::{Illumination, TransportSettings};

/// A room of 4 x 3 x 4 m around the y axis with a lamp of a square metre below its ceiling.
fn room() -> Scene {
    let (corner, x, y, z) = (DVec3::new(-2.0, 0.0, -2.0), DVec3::X * 4.0, DVec3::Y * 3.0, DVec3::Z * 4.0);
    let wall = |name: &str, origin: DVec3, u: DVec3, v: DVec3| Mesh::parallelogram(name, origin, u, v, 0);
    let mut meshes = vec![
        wall("floor", corner, z, x),
        wall("ceiling", corner + y, x, z),
        wall("back", corner, x, y),
        wall("front", corner + z, y, x),
        wall("left", corner, y, z),
        wall("right", corner + x, z, y),
    ];
    meshes.push(Mesh { name: "lamp".into(), ..level(2.5, [1.0; 2], false, 1) });
    scene_of(meshes, vec![matt(0.6), shining(0.6)], vec![])
}

/// Turned and moved, so that no coordinate is a round number.
fn tilted(at: DVec3) -> DVec3 {
    DQuat::from_axis_angle(DVec3::new(0.3, 0.5, -0.8).normalize(), 1.1) * at + DVec3::new(0.1, -0.7, 0.2)
}

fn turned(mut scene: Scene) -> Scene {
    scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|at| *at = tilted(*at));
    scene
}

/// A rug of `cells` x `cells` x 2 triangles around a point of the floor, `height` above it.
fn rug(middle: DVec3, size: f64, height: f64, cells: u32) -> Mesh {
    let place = |k: u32| size * (f64::from(k) / f64::from(cells) - 0.5);
    let vertex = |i: u32, j: u32| j * (cells + 1) + i;
    Mesh {
        name: "rug".into(),
        positions: (0..=cells).flat_map(|j| (0..=cells).map(move |i| middle + DVec3::new(place(i), height, place(j)))).collect(),
        triangles: (0..cells)
            .flat_map(|j| {
                (0..cells).flat_map(move |i| {
                    [[vertex(i, j), vertex(i, j + 1), vertex(i + 1, j)], [vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)]]
                })
            })
            .collect(),
        ..Mesh::default()
    }
}

/// Points of the rug and beside it; the floor below a rug that is a surface of its own is dark, and a radius off its edge
/// that does not count.
fn points(height: f64) -> Vec<(DVec3, DVec3)> {
    let on_rug = [(0.0, 0.0), (0.31, 0.2), (-0.44, 0.57), (0.7, -0.7), (0.95, 0.1)].map(|(x, z)| DVec3::new(x, height, z));
    let beside = [(1.4, 0.3), (1.5, -1.2), (-0.2, -1.35)].map(|(x, z)| DVec3::new(x, 0.0, z));
    on_rug.into_iter().chain(beside).map(|at| (at, DVec3::Y)).collect()
}

/// Red irradiance at each point, with its standard error.
fn irradiance(gpu: &Gpu, scene: &Scene, settings: &TransportSettings, points: &[(DVec3, DVec3)]) -> Vec<(f64, f64)> {
    let lit = received(gpu, scene, settings, points);
    (0..points.len()).map(|point| (lit.film.mean(point, &lit.plan).x, lit.film.standard_error(point, &lit.plan).x)).collect()
}

fn settings() -> TransportSettings {
    TransportSettings {
        photons: 20_000,
        rounds: 16,
        radius: Some(0.3),
        alpha: 1.0,
        illumination: Illumination::Photons,
        ..TransportSettings::default()
    }
}

/// Complains where a scene is not lit as another at some points.
fn compare(gpu: &Gpu, what: &str, scene: &Scene, points: &[(DVec3, DVec3)], expected: &[(f64, f64)]) -> Vec<String> {
    let found = irradiance(gpu, scene, &TransportSettings { seed: 99, ..settings() }, points);
    let pairs = points.iter().zip(found.iter().zip(expected));
    pairs
        .filter_map(|((at, _), ((found, error), (expected, other)))| {
            assert!(*error < 0.03 * expected && *expected > 0.1, "{what}: {found} +- {error} at {at}, {expected} expected");
            z_check(&format!("{what}, {at}"), *found, *expected, error.hypot(*other)).err()
        })
        .collect()
}

/// A rug is lit as the floor is, however high it lies, however it is cut, and so is the floor beside it.
#[test]
fn a_rug_on_the_floor_is_lit_like_the_floor() {
    let Some(gpu) = device() else { return };
    let expected = irradiance(&gpu, &room(), &settings(), &points(0.0));
    let mut complaints = Vec::new();
    for (height, cells) in [(0.0, 1), (0.0, 7), (1e-7, 1), (1e-6, 1), (1e-5, 7), (3e-5, 1), (1e-4, 1), (1e-3, 1)] {
        for is_turned in [false, true] {
            let mut scene = room();
            scene.meshes.push(rug(DVec3::ZERO, 2.0, height, cells));
            let (mut scene, mut points) = (scene, points(height));
            if is_turned {
                let up = tilted(DVec3::Y) - tilted(DVec3::ZERO);
                (scene, points) = (turned(scene), points.iter().map(|(at, _)| (tilted(*at), up)).collect());
            }
            let what = format!("{height} m above, {cells} x {cells} cells, turned {is_turned}");
            complaints.extend(compare(&gpu, &what, &scene, &points, &expected));
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}
