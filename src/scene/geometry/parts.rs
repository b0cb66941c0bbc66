//! Which triangles of a scene can be met, and which parts of those that others cover.

use std::cell::LazyCell;
use std::collections::BTreeSet;
use std::ops::{Add, Mul};

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::{pack_normal, turns};
use crate::constants::{HIDDEN, NONE};
use crate::records::{Triangle, TriangleColours, TriangleNormals, TriangleUvs};
use crate::scene::contact::Kind;
use crate::scene::contact_offsets::Offsets;
use crate::scene::frame::{Frame, has_area};
use crate::scene::material::TextureUse;
use crate::scene::planes::{Planes, for_equals, hash_of};
use crate::scene::{Mesh, Progress, Scene, overlap};

/// Whole triangles, behind them parts of others.
pub(super) struct Parts {
    /// For each (mesh, triangle of the mesh).
    pub sources: Vec<(u32, u32)>,
    /// Normalised.
    pub corners: Vec<[Vec3; 3]>,
    /// Of their planes the numbers of triangles that parts stand for are marked by [`HIDDEN`].
    pub planes: Planes,
    /// Of the parts: weights of their triangle's corners at each corner.
    weights: Vec<[DVec3; 3]>,
    /// Triangles without area, or that lie on others.
    pub left_out: usize,
    /// Meshes that overlap in one plane, facing alike: (hidden there, seen there).
    pub overlaps: BTreeSet<(u32, u32)>,
    /// Triangles that more others overlap than are cut out of one.
    pub uncut: usize,
}

/// A triangle of a mesh, or a part of it.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    pub mesh: &'a Mesh,
    pub triangle: usize,
    /// Normalised.
    corners: [Vec3; 3],
    plane: u32,
    weights: Option<&'a [DVec3; 3]>,
}

impl Parts {
    pub(super) fn of(scene: &Scene, kinds: &[Kind], offsets: &Offsets, frame: Frame, progress: Progress) -> Parts {
        let mut sources: Vec<(u32, u32)> = Vec::with_capacity(scene.triangle_count());
        for (mesh, of) in (0..).zip(&scene.meshes) {
            sources.extend((0..of.triangles.len() as u32).map(|triangle| (mesh, triangle)));
        }
        let corners_of = |&(mesh, triangle): &(u32, u32)| offsets.corners(scene, mesh, triangle).map(|at| frame.local(at));
        let mut corners: Vec<[Vec3; 3]> = sources.par_iter().map(corners_of).collect();
        let count = corners.len();
        let ranks = LazyCell::new(|| overlap::ranks(scene, kinds));
        let mut overlaps = BTreeSet::new();
        let is_kept = kept(&sources, &corners, |one, other| ranks[one as usize] < ranks[other as usize], &mut overlaps);
        let mut kept = is_kept.iter().copied().cycle();
        sources.retain(|_| kept.next().expect("one for each"));
        corners.retain(|_| kept.next().expect("one for each"));
        progress("looking for overlaps", 0.0);
        let left_out = count - corners.len();
        let planes = Planes::of(&corners);
        let mut parts = Parts { sources, corners, planes, weights: Vec::new(), left_out, overlaps, uncut: 0 };
        let report = |done| progress("looking for overlaps", done);
        for covered in overlap::find(scene, kinds, || &ranks, &parts.sources, &parts.corners, report) {
            parts.cut(covered);
        }
        parts
    }

    /// Puts what is visible of a triangle behind all others.
    fn cut(&mut self, covered: overlap::Covered) {
        let overlap::Covered { triangle, by, pieces, uncut } = covered;
        let (source, [a, b, c]) = (self.sources[triangle], self.corners[triangle].map(Vec3::as_dvec3));
        let plane = self.planes.of_triangles[triangle];
        self.planes.of_triangles[triangle] |= HIDDEN;
        self.uncut += usize::from(uncut);
        self.overlaps.extend(by.iter().map(|other| (source.0, self.sources[*other].0)));
        for piece in pieces {
            let corners = piece.map(|of| (a * of.x + b * of.y + c * of.z).as_vec3());
            if has_area(&corners) {
                self.sources.push(source);
                self.corners.push(corners);
                self.planes.of_triangles.push(plane);
                self.weights.push(piece);
            }
        }
    }

    /// The number behind those of the planes in which something lies that is there.
    pub(super) fn first_sensor_plane(&self, scene: &Scene) -> u32 {
        let is_seen = |(_, (mesh, _)): &(&u32, &(u32, u32))| !scene.materials[scene.meshes[*mesh as usize].material].is_not_there();
        let of_surfaces = self.planes.of_triangles.iter().zip(&self.sources).filter(is_seen).map(|(plane, _)| plane & !HIDDEN);
        of_surfaces.max().map_or(0, |last| last + 1)
    }
}

/// Parts in the order of the hierarchy's leaves.
pub(super) struct Leaves<'a> {
    pub scene: &'a Scene,
    pub parts: &'a Parts,
    pub order: &'a [u32],
}

impl Leaves<'_> {
    pub(super) fn each<T: Send>(&self, of: impl Fn(Part) -> T + Sync) -> Vec<T> {
        let Parts { sources, corners, planes, weights, .. } = self.parts;
        let whole_count = corners.len() - weights.len();
        let part = |place: &u32| {
            let place = *place as usize;
            let (mesh, triangle) = sources[place];
            of(Part {
                mesh: &self.scene.meshes[mesh as usize],
                triangle: triangle as usize,
                corners: corners[place],
                plane: planes.of_triangles[place],
                weights: place.checked_sub(whole_count).map(|part| &weights[part]),
            })
        };
        self.order.par_iter().map(part).collect()
    }
}

impl Part<'_> {
    /// Colours where no mesh has any.
    pub(super) const WHITE: TriangleColours = TriangleColours { a: Vec3::ONE, b: Vec3::ONE, c: Vec3::ONE, alphas: Vec3::ONE };

    pub(super) fn record(&self) -> Triangle {
        let [a, b, c] = self.corners;
        Triangle { a, b, c, material: self.mesh.material as u32, plane: self.plane }
    }

    pub(super) fn normals(&self) -> TriangleNormals {
        let flat = TriangleNormals { a: NONE, b: NONE, c: NONE };
        if self.mesh.normals.is_empty() {
            return flat;
        }
        let normals = self.mesh.triangles[self.triangle].map(|vertex| self.mesh.normals[vertex as usize]);
        // Normals that are all the triangle's own are no smooth shading.
        let own = self.mesh.normal(self.triangle);
        if normals.iter().any(|normal| normal.length_squared() < 0.25) || normals.iter().all(|normal| normal.dot(own) > 1.0 - 1e-9) {
            return flat;
        }
        let [a, b, c] = self.at_corners(normals).map(|normal| pack_normal(normal.as_vec3()));
        TriangleNormals { a, b, c }
    }

    pub(super) fn colours(&self) -> TriangleColours {
        let [a, b, c] = self.of_vertices(|vertex| self.mesh.colours.get(vertex).copied().unwrap_or(DVec3::ONE)).map(DVec3::as_vec3);
        let alphas = self.of_vertices(|vertex| self.mesh.alphas.get(vertex).copied().unwrap_or(1.0));
        TriangleColours { a, b, c, alphas: DVec3::from(alphas).as_vec3() }
    }

    /// Texture coordinates as transformed.
    pub(super) fn uvs(&self, scene: &Scene) -> TriangleUvs {
        let of = |used: Option<TextureUse>| -> [Vec2; 3] {
            let Some(TextureUse { uv_set, transform, texture }) = used else { return [Vec2::ZERO; 3] };
            let uvs = self.own_uvs(uv_set).map(|uv| transform.apply(uv));
            self.at_corners(turns::near(uvs, scene.textures[texture].wrap)).map(DVec2::as_vec2)
        };
        let material = &scene.materials[self.mesh.material];
        let [base_a, base_b, base_c] = of(material.base_colour_texture);
        let [emission_a, emission_b, emission_c] = of(material.emission_texture);
        TriangleUvs { base_a, base_b, base_c, emission_a, emission_b, emission_c }
    }

    /// Of the whole triangle; zero where the mesh has none.
    pub(super) fn own_uvs(&self, set: usize) -> [DVec2; 3] {
        self.mesh.triangles[self.triangle].map(|vertex| self.mesh.uvs[set].get(vertex as usize).copied().unwrap_or_default())
    }

    /// Values of its corners, from what each vertex has.
    fn of_vertices<T: Copy + Add<Output = T> + Mul<f64, Output = T>>(&self, of_vertex: impl Fn(usize) -> T) -> [T; 3] {
        self.at_corners(self.mesh.triangles[self.triangle].map(|vertex| of_vertex(vertex as usize)))
    }

    /// The same, from what the corners of the whole triangle have.
    pub(super) fn at_corners<T: Copy + Add<Output = T> + Mul<f64, Output = T>>(&self, values: [T; 3]) -> [T; 3] {
        let [a, b, c] = values;
        self.weights.map_or(values, |weights| weights.map(|of| a * of.x + b * of.y + c * of.z))
    }
}

/// Which triangles have an area and lie on no other that counts: of those that are the same, facing alike, only one can be met; the others
/// would emit, and count as surface, where none is seen. `wins` says which of two meshes counts.
fn kept(sources: &[(u32, u32)], corners: &[[Vec3; 3]], wins: impl Fn(u32, u32) -> bool, overlaps: &mut BTreeSet<(u32, u32)>) -> Vec<bool> {
    let mut is_kept: Vec<bool> = corners.par_iter().map(has_area).collect();
    let find_seen = |alike: &[u32]| {
        let mut solid = alike.iter().map(|place| *place as usize).filter(|place| has_area(&corners[*place]));
        let Some(mut seen) = solid.next() else { return };
        for place in solid {
            let (mesh, other) = (sources[place].0, sources[seen].0);
            let is_seen = wins(mesh, other);
            overlaps.insert(if is_seen { (other, mesh) } else { (mesh, other) });
            let hidden = if is_seen { std::mem::replace(&mut seen, place) } else { place };
            is_kept[hidden] = false;
        }
    };
    let of_place = |place: u32| &corners[place as usize];
    for_equals(corners.len(), |place| hash_of_corners(of_place(place)), |place| in_fixed_order(of_place(place)), find_seen);
    is_kept
}

/// The bits of a corner; the sum turns -0 into 0.
fn bits(corner: Vec3) -> [u32; 3] {
    (corner + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// The bits of a triangle's corners, the same from whichever corner it is read.
fn in_fixed_order(corners: &[Vec3; 3]) -> [u32; 9] {
    let bits = corners.map(bits);
    let first = (0..3).min_by_key(|corner| bits[*corner]).expect("a triangle has corners");
    std::array::from_fn(|k| bits[(first + k / 3) % 3][k % 3])
}

/// Of a triangle's corners, the same from whichever corner it is read.
fn hash_of_corners(corners: &[Vec3; 3]) -> u64 {
    corners.iter().map(|corner| hash_of(&bits(*corner))).fold(0, u64::wrapping_add)
}
