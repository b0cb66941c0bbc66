//! Which side of a surface is baked: the front, but for what only its back shows.
//!
//! A two-sided surface shows the light of one side on both. Where none reaches the front, as of a closed shell whose faces look
//! inwards, or where every camera looks at the back of a sheet, the back is baked. A surface with one side shows nothing else, so that
//! a shell of such faces is named. Whether light comes is asked of the path tracer, at a few points of each connected part.

use std::collections::HashMap;

use glam::DVec3;

use crate::scene::{Mesh, Scene, bounds_of, connected as connection};
use crate::verify::judge::Judge;

/// Points of a connected part that are asked about, and paths from each side of them.
const POINTS: usize = 8;
const PATHS: u32 = 8;
/// Of paths: whether there is light at all shows within few.
const BOUNCES: u32 = 4;
const SEED: u64 = 0x51de;
/// A side is dark that receives less of the other's light.
const DARK: f64 = 0.02;
/// Six times the volume beside area^(3/2).
const NEARLY_FLAT: f64 = 1e-4;
/// A mesh of more connected parts is looked at as a whole.
const MOST_PARTS: usize = 256;

/// What was found of the sides of a mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Sides {
    /// Triangles whose back is baked; empty where none is.
    pub turned: Vec<bool>,
    /// Whether a part of one-sided faces looks inwards, where no light comes.
    pub is_inside_out: bool,
}

/// A connected part of a mesh, and the points of it that are asked about.
struct Part {
    mesh: usize,
    triangles: Vec<usize>,
    points: Vec<(DVec3, DVec3)>,
}

/// The sides of some meshes of a scene, by their indices.
pub(crate) fn of(scene: &Scene, meshes: &[usize]) -> HashMap<usize, Sides> {
    let parts: Vec<Part> = meshes.iter().flat_map(|mesh| parts_in_question(scene, *mesh)).collect();
    let mut found: HashMap<usize, Sides> = HashMap::new();
    if parts.is_empty() {
        return found;
    }
    let both = |(point, normal): &(DVec3, DVec3)| [(*point, *normal), (*point, -*normal)];
    let asked: Vec<(DVec3, DVec3)> = parts.iter().flat_map(|part| part.points.iter().flat_map(both)).collect();
    let light = Judge::new(scene, BOUNCES).irradiance_at(&asked, PATHS, SEED);
    let mut light = light.chunks_exact(2).map(|sides| [0, 1].map(|side: usize| sides[side].mean.total().element_sum()));
    for part in parts {
        let of_points = light.by_ref().take(part.points.len());
        let [front, back] = of_points.fold([0.0; 2], |sum, sides| [0, 1].map(|side| sum[side] + sides[side]));
        let is_dark = front <= DARK * back && back > 0.0;
        let mesh = &scene.meshes[part.mesh];
        if !scene.materials[mesh.material].two_sided {
            found.entry(part.mesh).or_default().is_inside_out |= is_dark;
        } else if is_dark || (is_turned_away(scene, &part.points) && back > DARK * front) {
            let turned = &mut found.entry(part.mesh).or_default().turned;
            turned.resize(mesh.triangles.len(), false);
            part.triangles.iter().for_each(|triangle| turned[*triangle] = true);
        }
    }
    found
}

/// Whether every camera looks at the back of every point.
fn is_turned_away(scene: &Scene, points: &[(DVec3, DVec3)]) -> bool {
    let is_behind = |eye: DVec3| points.iter().all(|(point, normal)| (eye - *point).dot(*normal) < 0.0);
    !scene.cameras.is_empty() && scene.cameras.iter().all(|camera| is_behind(camera.eye))
}

/// Parts of which the back may be what is seen: two-sided ones, and those whose faces look inwards.
fn parts_in_question(scene: &Scene, number: usize) -> Vec<Part> {
    let mesh = &scene.meshes[number];
    let material = &scene.materials[mesh.material];
    // Light goes through what transmits, to both sides.
    if material.transmits() {
        return Vec::new();
    }
    let mut parts: Vec<Part> = Vec::new();
    for triangles in connected(mesh) {
        let is_in_question = material.two_sided || looks_inwards(mesh, &triangles);
        let points = if is_in_question { points(mesh, &triangles) } else { Vec::new() };
        if !points.is_empty() {
            parts.push(Part { mesh: number, triangles, points });
        }
    }
    parts
}

/// Six times the signed volume that triangles bound, seen from one of their corners.
fn volume(mesh: &Mesh, triangles: &[usize]) -> f64 {
    let origin = mesh.corners(triangles[0])[0];
    let of_triangle = |triangle: &usize| {
        let [a, b, c] = mesh.corners(*triangle).map(|corner| corner - origin);
        a.dot(b.cross(c))
    };
    triangles.iter().map(of_triangle).sum()
}

/// Whether the faces of a shell look inwards, which may be open; not those of a sheet that is nearly flat.
fn looks_inwards(mesh: &Mesh, triangles: &[usize]) -> bool {
    let area: f64 = triangles.iter().map(|triangle| mesh.area(*triangle)).sum();
    volume(mesh, triangles) < -NEARLY_FLAT * area.powf(1.5)
}

fn is_closed(mesh: &Mesh, triangles: &[usize]) -> bool {
    let triangles = triangles.iter().map(|triangle| mesh.triangles[*triangle]).collect();
    Mesh::are_closed([&Mesh { triangles, positions: mesh.positions.clone(), ..Mesh::default() }])
}

/// Points spread over the area, with the normals of the front.
fn points(mesh: &Mesh, triangles: &[usize]) -> Vec<(DVec3, DVec3)> {
    let area: f64 = triangles.iter().map(|triangle| mesh.area(*triangle)).sum();
    let mut points = Vec::new();
    let mut below = 0.0;
    for triangle in triangles {
        below += mesh.area(*triangle);
        while area > 0.0 && points.len() < POINTS && below > (points.len() as f64 + 0.5) / POINTS as f64 * area {
            let [a, b, c] = mesh.corners(*triangle);
            // Not all in the middle, where a part of the scene may cover it: golden ratios.
            let turn = |step: f64| (0.5 + step * points.len() as f64).fract();
            let (s, t) = (turn(0.754_877_666_246_692_8), turn(0.569_840_290_998_053_2));
            let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
            // Nor on an edge, where rounding decides which side a ray starts on.
            let [s, t] = [s, t].map(|weight| 1.0 / 3.0 + 0.9 * (weight - 1.0 / 3.0));
            points.push((a + s * (b - a) + t * (c - a), mesh.normal(*triangle)));
        }
    }
    points
}

/// The triangles of each connected part: of one place in space are corners that may be different vertices.
fn connected(mesh: &Mesh) -> Vec<Vec<usize>> {
    let triangles = 0..mesh.triangles.len();
    let parts = connection::connected(triangles.clone().map(|triangle| mesh.corners(triangle).map(connection::bits)));
    if parts.len() > MOST_PARTS { vec![triangles.collect()] } else { parts }
}

/// Of each triangle 1 where it is of a closed part that faces outwards, -1 where of one that faces inwards, else 0. One that has a
/// camera in its box may be a room.
pub(crate) fn closed_parts(scene: &Scene, mesh: &Mesh) -> Vec<f64> {
    let mut closed = vec![0.0; mesh.triangles.len()];
    for triangles in connected(mesh) {
        let (low, high) = bounds_of(triangles.iter().flat_map(|triangle| mesh.corners(*triangle)));
        let is_seen_inside = scene.cameras.iter().any(|camera| camera.eye.cmpge(low).all() && camera.eye.cmple(high).all());
        if !is_seen_inside && is_closed(mesh, &triangles) {
            let facing = volume(mesh, &triangles).signum();
            triangles.iter().for_each(|triangle| closed[*triangle] = facing);
        }
    }
    closed
}
