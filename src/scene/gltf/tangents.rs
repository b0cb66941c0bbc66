//! Tangents of triangles' corners for normal maps: the file's, or MikkTSpace's as glTF asks where it has none.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{DVec2, DVec3, DVec4, Vec3};
use rayon::prelude::*;

use crate::scene::material::UvTransform;

/// A vertex of more triangles than that has tangents of each triangle's own: the crate's time grows with the square of that
/// number, and its stack with the number.
const MAX_TRIANGLES_OF_VERTEX: u32 = 1000;
/// Sine of the smallest angle of a triangle in the picture: of less no direction is known.
const MIN_ANGLE: f64 = 1e-6;
/// Of a unit tangent, what must be left of it beside the normal.
const MIN_BESIDE_NORMAL: f64 = 1e-6;

/// A mesh in its own space.
pub(super) struct Surface<'a> {
    pub(super) positions: &'a [DVec3],
    /// One a vertex; empty where the mesh is flat.
    pub(super) normals: &'a [DVec3],
    pub(super) triangles: &'a [[u32; 3]],
}

/// What a corner has for MikkTSpace, and its tangent.
struct Corners<'a> {
    surface: &'a Surface<'a>,
    positions: Vec<[f32; 3]>,
    /// One per vertex, or one per triangle where the mesh is flat.
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    /// Triangles that the crate has to do with.
    kept: Vec<usize>,
    tangents: Vec<[DVec4; 3]>,
}

impl Surface<'_> {
    /// The front's, not of unit length.
    fn normal_of_triangle(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.triangles[triangle].map(|vertex| self.positions[vertex as usize]);
        (b - a).cross(c - a)
    }

    /// Whether texture coordinates give tangents on any triangle where u and v grow: not if they lie in one place or on a line.
    pub(super) fn has_directions(&self, uvs: &[DVec2], transform: UvTransform) -> bool {
        self.triangles.is_empty()
            || self.triangles.iter().any(|triangle| {
                let [a, b, c] = triangle.map(|vertex| transform.apply(uvs[vertex as usize]));
                let (s, t) = (b - a, c - a);
                s.perp_dot(t).abs() > MIN_ANGLE * s.length() * t.length()
            })
    }

    /// MikkTSpace's tangents of all corners, not always of unit length. Those without one are 0.
    pub(super) fn tangents(&self, uvs: &[DVec2], transform: UvTransform) -> Vec<[DVec4; 3]> {
        // A power of two, so that products stay in range and no digit changes.
        let most = self.positions.iter().fold(0.0, |most: f64, position| most.max(position.abs().max_element()));
        let scale = if most > 0.0 { 2f64.powi(-(most.log2() as i32).clamp(-1000, 1000)) } else { 1.0 };
        // The sum makes 0 of -0, which are one place.
        let single = |vector: DVec3| (vector.as_vec3() + Vec3::ZERO).to_array();
        let normals = match self.normals.is_empty() {
            true => (0..self.triangles.len()).map(|triangle| single(self.normal_of_triangle(triangle).normalize_or_zero())).collect(),
            false => self.normals.iter().map(|normal| single(*normal)).collect(),
        };
        // glTF's v runs down the picture, the bitangent up.
        // Only their differences count, which have more digits near 0.
        let first = uvs.first().map_or(DVec2::ZERO, |uv| transform.apply(*uv).floor());
        let base = if first.abs().max_element() > 64.0 { first } else { DVec2::ZERO };
        let uv = |uv: &DVec2| ((transform.apply(*uv) - base) * DVec2::new(1.0, -1.0) + DVec2::ZERO).as_vec2().to_array();
        let mut corners = Corners {
            surface: self,
            positions: self.positions.iter().map(|position| single(scale * *position)).collect(),
            normals,
            uvs: uvs.iter().map(uv).collect(),
            kept: Vec::new(),
            tangents: Vec::new(),
        };
        corners.tangents = (0..self.triangles.len()).map(|triangle| [corners.of_triangle(triangle); 3]).collect();
        corners.kept = corners.fit_triangles();
        generate_tangents(&mut corners).expect("the crate knows no error");
        corners.tangents
    }
}

impl Corners<'_> {
    fn vertex(&self, triangle: usize, corner: usize) -> usize {
        self.surface.triangles[triangle][corner] as usize
    }

    fn normal_of(&self, triangle: usize, corner: usize) -> [f32; 3] {
        self.normals[if self.surface.normals.is_empty() { triangle } else { self.vertex(triangle, corner) }]
    }

    /// Those that are no lines and whose vertices have no more than the most triangles.
    fn fit_triangles(&self) -> Vec<usize> {
        let key = |triangle: usize, corner: usize| {
            let vertex = self.vertex(triangle, corner);
            let ([x, y, z], [i, j, k], [u, v]) = (self.positions[vertex], self.normal_of(triangle, corner), self.uvs[vertex]);
            [x, y, z, i, j, k, u, v].map(f32::to_bits)
        };
        let mut counts: HashMap<[u32; 8], u32> = HashMap::new();
        for triangle in 0..self.surface.triangles.len() {
            (0..3).for_each(|corner| *counts.entry(key(triangle, corner)).or_default() += 1);
        }
        let is_fit = |triangle: &usize| {
            let [a, b, c] = [0, 1, 2].map(|corner| self.positions[self.vertex(*triangle, corner)]);
            a != b && b != c && c != a && (0..3).all(|corner| counts[&key(*triangle, corner)] <= MAX_TRIANGLES_OF_VERTEX)
        };
        (0..self.surface.triangles.len()).filter(is_fit).collect()
    }

    /// Where u grows on one triangle; 0 where it does not.
    fn of_triangle(&self, triangle: usize) -> DVec4 {
        let at = [0, 1, 2].map(|corner| self.vertex(triangle, corner));
        let [a, b, c] = at.map(|vertex| self.surface.positions[vertex]);
        let [uv_a, uv_b, uv_c] = at.map(|vertex| glam::Vec2::from(self.uvs[vertex]).as_dvec2());
        let (s, t) = (uv_b - uv_a, uv_c - uv_a);
        let sign = if s.perp_dot(t) > 0.0 { 1.0 } else { -1.0 };
        (sign * ((b - a) * t.y - (c - a) * s.y)).extend(sign)
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.kept.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.positions[self.vertex(self.kept[face], corner)]
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.normal_of(self.kept[face], corner)
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.uvs[self.vertex(self.kept[face], corner)]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let Some(space) = space else { return };
        let tangent = Vec3::from(space.tangent()).as_dvec3();
        if tangent.is_finite() && tangent != DVec3::ZERO {
            self.tangents[self.kept[face]][corner] = tangent.extend(if space.is_orientation_preserving() { 1.0 } else { -1.0 });
        }
    }
}

/// Tangents of a mesh's own space in the world, where `surface` is: `turned` is a vertex's own transform of directions. They
/// are of unit length and perpendicular to the normal, in any direction where they have none.
pub(super) fn in_world(
    tangents: &[[DVec4; 3]],
    surface: &Surface,
    is_mirrored: bool,
    turned: impl Fn(usize, DVec3) -> DVec3 + Sync,
) -> Vec<[DVec4; 3]> {
    let of_triangle = |(triangle, tangents): (usize, &[DVec4; 3])| {
        let flat = surface.normal_of_triangle(triangle).normalize_or(DVec3::Y);
        std::array::from_fn(|corner| {
            let vertex = surface.triangles[triangle][corner] as usize;
            let normal = surface.normals.get(vertex).copied().filter(|normal| *normal != DVec3::ZERO).unwrap_or(flat);
            let tangent = turned(vertex, tangents[corner].truncate()).normalize_or_zero();
            let beside = tangent - normal * normal.dot(tangent);
            let tangent = match beside.length() > MIN_BESIDE_NORMAL {
                true => beside.normalize(),
                false => normal.any_orthonormal_vector(),
            };
            let sign = if (tangents[corner].w < 0.0) != is_mirrored { -1.0 } else { 1.0 };
            tangent.extend(sign)
        })
    };
    tangents.par_iter().enumerate().map(of_triangle).collect()
}
