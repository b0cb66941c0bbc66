//! Points of texels that nobody sees: inside of a solid, under something that lies on the surface, or behind a wall that crosses it.
//!
//! Where a block stands on a floor, a texel at its foot has points below the block, which are black and never seen. They count for
//! nothing, and a texel that has no others is as the nearest one that has. All is judged within the texel's own length, so that what
//! is dropped is what the map is too coarse to show.

use glam::DVec3;
use rayon::prelude::*;

use super::sides::closed_parts;
use super::{CoveredTexel, MeshLightmap, PHASE_COUNT, SurfacePoint, TexelSample};
use crate::scene::box_tree::BoxTree;
use crate::scene::{Scene, bounds_of, distance_to};

/// Of a texel's length: how high above the surface points are judged, and up to which height what covers them lies on it.
const LIFT: f64 = 1e-3;
const COVER: f64 = 0.25;
/// Within what length of a texel other faces are looked for. A texel next to one that is seen must be as that one, and so may not have a
/// neighbour as near that lies in the same solid and was not looked at.
const NEAR: f64 = 2.0;
/// The longest distance between two points of a whole texel, of its length: they lie in a rotated grid.
const SPREAD: f64 = 0.79;
/// Faces of the own mesh that look about as the surface does are its own bumps.
const OWN_BUMPS: f64 = 0.5;

/// A triangle that light does not go through.
struct Face {
    corners: [DVec3; 3],
    normal: DVec3,
    mesh: usize,
    /// 1 where its back looks into a solid, or is seen by nobody; -1 where its front does; else 0.
    hides: f64,
}

/// All opaque triangles of a scene.
pub(crate) struct Faces {
    faces: Vec<Face>,
    tree: BoxTree,
}

impl Faces {
    /// `meshes` say which backs are baked: those are looked at, and hide nothing.
    pub(super) fn new(scene: &Scene, meshes: &[Option<MeshLightmap>]) -> Faces {
        let of_mesh = |number: usize| {
            let mesh = &scene.meshes[number];
            let material = &scene.materials[mesh.material];
            let is_opaque = !material.lets_light_through();
            let closed = if is_opaque && material.two_sided { closed_parts(scene, mesh) } else { Vec::new() };
            let is_turned = move |triangle: usize| meshes[number].as_ref().is_some_and(|map| map.turned.get(triangle) == Some(&true));
            let face = move |triangle: usize| Face {
                corners: mesh.corners(triangle),
                normal: mesh.normal(triangle),
                mesh: number,
                // Of a room the back is outside, and of a shell that is turned the front is inside.
                hides: match closed.get(triangle) {
                    None => 1.0,
                    Some(facing) if (*facing < 0.0) == is_turned(triangle) => *facing,
                    Some(_) => 0.0,
                },
            };
            (0..if is_opaque { mesh.triangles.len() } else { 0 }).map(face)
        };
        let faces: Vec<Face> = (0..scene.meshes.len()).flat_map(of_mesh).filter(|face| face.normal.is_finite()).collect();
        Faces { tree: BoxTree::new(faces.par_iter().map(|face| face.corners), 0.0), faces }
    }

    /// Calls back for faces in leaves whose boxes meet something.
    fn visit<'a>(&'a self, meets: impl Fn(DVec3, DVec3) -> bool, mut look: impl FnMut(&'a Face)) {
        self.tree.visit(meets, |face| look(&self.faces[face]));
    }

    /// The nearest face along a ray up to a distance, and that distance.
    fn nearest(&self, origin: DVec3, direction: DVec3, most: f64, counts: impl Fn(&Face) -> bool) -> Option<(&Face, f64)> {
        let found = std::cell::Cell::new(most);
        let mut nearest = None;
        let meets = |low: DVec3, high: DVec3| {
            let [a, b] = [low, high].map(|side| (side - origin) / direction);
            // A ray in a box's plane has no number there, which min and max leave out.
            a.min(b).max_element().max(0.0) <= a.max(b).min_element().min(found.get())
        };
        self.visit(meets, |face| {
            if let Some(distance) = distance_to(face.corners, origin, direction).filter(|distance| *distance < found.get())
                && counts(face)
            {
                found.set(distance);
                nearest = Some((face, distance));
            }
        });
        nearest
    }

    /// The texels of a map that are left, each with the points that count. `None` where all are as they were.
    pub(super) fn left(&self, number: usize, lightmap: &MeshLightmap) -> Option<Vec<CoveredTexel>> {
        let looked: Vec<Option<Option<[SurfacePoint; PHASE_COUNT]>>> =
            lightmap.texels.par_iter().map(|texel| self.points_left(number, lightmap, texel)).collect();
        let is_changed = looked.iter().any(Option::is_some);
        let is_seen = |(texel, looked): (&CoveredTexel, Option<Option<[SurfacePoint; PHASE_COUNT]>>)| match looked {
            None => Some(*texel),
            Some(points) => Some(CoveredTexel { points: points?, ..*texel }),
        };
        is_changed.then(|| lightmap.texels.iter().zip(looked).filter_map(is_seen).collect())
    }

    /// `None`: all count; `Some(None)`: none does.
    fn points_left(&self, number: usize, lightmap: &MeshLightmap, texel: &CoveredTexel) -> Option<Option<[SurfacePoint; PHASE_COUNT]>> {
        let samples = texel.points.map(|point| lightmap.sample(&point));
        let spread = |a: &TexelSample| samples.iter().map(|b| a.position.distance(b.position)).fold(0.0, f64::max);
        let length = samples.iter().map(spread).fold(0.0, f64::max) / SPREAD;
        // Rounding decides within what a thousandth of a texel is not far above.
        let extent = samples.iter().map(|sample| sample.position.abs().max_element()).fold(0.0, f64::max);
        if length <= 1e-9 * extent {
            return None;
        }
        let (low, high) = bounds_of(samples.iter().map(|sample| sample.position));
        let (low, high) = (low - NEAR * length, high + NEAR * length);
        let mut is_alone = true;
        let is_own = |face: &Face| {
            let plane = &samples[0];
            let is_near = |corner: &DVec3| (*corner - plane.position).dot(plane.geometric_normal).abs() < LIFT * length;
            face.mesh == number && face.corners.iter().all(is_near)
        };
        let meets = |a: DVec3, b: DVec3| a.cmple(high).all() && b.cmpge(low).all();
        self.visit(meets, |face| {
            let [a, b, c] = face.corners;
            is_alone = is_alone && (is_own(face) || !meets(a.min(b).min(c), a.max(b).max(c)));
        });
        if is_alone {
            return None;
        }
        let seen: Vec<usize> = (0..PHASE_COUNT).filter(|point| !self.is_covered(&samples[*point], length)).collect();
        // Points of one side see each other.
        let lifted = |point: usize| samples[point].position + LIFT * length * samples[point].geometric_normal;
        let is_apart = |a: usize, b: usize| {
            let way = lifted(b) - lifted(a);
            let crosses = |face: &Face| face.mesh != number || face.normal.dot(samples[a].geometric_normal).abs() < OWN_BUMPS;
            way.length() > 0.0 && self.nearest(lifted(a), way.normalize(), way.length(), crosses).is_some()
        };
        let side = |from: &usize| seen.iter().copied().filter(|other| from == other || !is_apart(*from, *other)).collect::<Vec<_>>();
        // The first of the largest.
        let largest = seen.iter().map(side).rev().max_by_key(Vec::len).unwrap_or_default();
        match largest.len() {
            0 => Some(None),
            PHASE_COUNT => None,
            count => Some(Some(std::array::from_fn(|phase| texel.points[largest[phase % count]]))),
        }
    }

    /// Whether something lies on a point, or a solid is all around it.
    fn is_covered(&self, sample: &TexelSample, length: f64) -> bool {
        let normal = sample.geometric_normal;
        let origin = sample.position + LIFT * length * normal;
        if self.nearest(origin, normal, COVER * length, |_| true).is_some() {
            return true;
        }
        let (u, v) = normal.any_orthonormal_pair();
        let around = [DVec3::ZERO, u, v, -u, -v].map(|aside| (normal + 1.5 * aside).normalize());
        around.into_iter().all(|direction| {
            let hit = self.nearest(origin, direction, f64::INFINITY, |_| true);
            hit.is_some_and(|(face, _)| face.hides * face.normal.dot(direction) > 0.0)
        })
    }
}
