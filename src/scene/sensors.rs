//! Sheets for points in the air. Photons alone show what mirrors and glass send to a point, and they are stored where they meet a surface;
//! so such a point gets one of its own, in its plane, which all light passes as if it were not there.

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::box_tree::BoxTree;
use super::material::{Coverage, Layers};
use super::planes::IN_PLANE;
use super::{LobeKinds, Material, Mesh, Scene};
use crate::settings::scene::{Effect, Illumination, SceneSettings};

/// How far a sheet reaches around its points at least, of the scene's extent: about as far as a density estimate. A smaller one takes in
/// fewer photons, a larger one some that no point counts; neither shifts what is found.
const REACH: f64 = 1.0 / 32.0;
/// Least cosine between the normals of a point and of the surface that it lies on, as the kernels have it (`glsl/gather/cover.glsl`).
const ON_SURFACE_COSINE: f64 = 0.999_85;
/// Points in one plane, by their normal and their height.
const NORMAL_STEPS: f64 = (1u32 << 22) as f64;

/// The scene with sheets for the points, with their normals, that lie on no surface, where photons alone show some of the light. Without
/// the effects that let light pass a sheet there is none.
pub(crate) fn with_sensors<'a>(scene: &'a Scene, points: &[(DVec3, DVec3)], settings: &SceneSettings) -> Cow<'a, Scene> {
    let passes = ![Effect::Layers, Effect::Alpha].into_iter().any(|effect| settings.leaves_out(effect));
    let kinds = scene.lobe_kinds();
    let has_sharp = scene.meshes.iter().any(|mesh| kinds[mesh.material].is_sharp());
    if !(passes && scene.is_lit() && (has_sharp || settings.illumination == Illumination::Photons)) {
        return Cow::Borrowed(scene);
    }
    let (min, max) = scene.bounds();
    let extent = (max - min).max_element();
    let surfaces = Surfaces::new(scene, &kinds, 2.0 * IN_PLANE * extent);
    let in_air: Vec<(DVec3, DVec3)> = points.par_iter().filter(|(position, normal)| !surfaces.hold(*position, *normal)).copied().collect();
    if in_air.is_empty() {
        return Cow::Borrowed(scene);
    }
    let mut scene = scene.clone();
    scene.meshes.push(sheets(&in_air, extent, scene.materials.len()));
    scene.materials.push(material());
    Cow::Owned(scene)
}

/// Of a sheet that is not there.
fn material() -> Material {
    let layers = Layers { metallic: 0.0, specular: 0.0, ..Layers::default() };
    Material { two_sided: true, coverage: Coverage::Blend { alpha: 0.0 }, ..Material::layered("points in the air", Vec3::ZERO, layers) }
}

/// Triangles on which photons are stored, in a tree.
struct Surfaces {
    /// Corners, unit normal, and whether the back counts.
    triangles: Vec<([DVec3; 3], DVec3, bool)>,
    tree: BoxTree,
    /// Metres off a triangle at which a point lies on it.
    tolerance: f64,
}

impl Surfaces {
    fn new(scene: &Scene, kinds: &[LobeKinds], tolerance: f64) -> Surfaces {
        let of_mesh = |mesh: &'_ Mesh| {
            let is_two_sided = scene.materials[mesh.material].has_two_sides();
            (0..mesh.triangles.len()).map(|triangle| (mesh.corners(triangle), mesh.normal(triangle), is_two_sided)).collect::<Vec<_>>()
        };
        let meshes = scene.meshes.iter().filter(|mesh| kinds[mesh.material].rough);
        let triangles: Vec<_> = meshes.flat_map(of_mesh).filter(|(_, normal, _)| normal.is_finite()).collect();
        Surfaces { tree: BoxTree::new(triangles.par_iter().map(|(corners, ..)| *corners), tolerance), triangles, tolerance }
    }

    /// Whether a point with this normal lies on one.
    fn hold(&self, position: DVec3, normal: DVec3) -> bool {
        let is_found = Cell::new(false);
        let meets = |low: DVec3, high: DVec3| !is_found.get() && position.cmpge(low).all() && position.cmple(high).all();
        self.tree.visit(meets, |triangle| is_found.set(is_found.get() || self.lies_on(triangle, position, normal)));
        is_found.get()
    }

    fn lies_on(&self, triangle: usize, position: DVec3, normal: DVec3) -> bool {
        let (corners, front, is_two_sided) = self.triangles[triangle];
        let cosine = front.dot(normal);
        let faces = cosine >= ON_SURFACE_COSINE || is_two_sided && -cosine >= ON_SURFACE_COSINE;
        // Not beyond any edge.
        let is_inside = |corner: usize| {
            let (from, to) = (corners[corner], corners[(corner + 1) % 3]);
            front.cross(to - from).normalize_or_zero().dot(position - from) >= -self.tolerance
        };
        faces && front.dot(position - corners[0]).abs() <= self.tolerance && (0..3).all(is_inside)
    }
}

/// A sheet for each plane: rectangles of squares that lie within reach of its points.
fn sheets(points: &[(DVec3, DVec3)], extent: f64, material: usize) -> Mesh {
    let mut mesh = Mesh { name: "points in the air".into(), material, ..Mesh::default() };
    let mut planes: BTreeMap<[i64; 4], Vec<(DVec3, DVec3)>> = BTreeMap::new();
    for &(position, normal) in points {
        let key = (NORMAL_STEPS * normal).extend(normal.dot(position) / (IN_PLANE * extent));
        planes.entry(key.to_array().map(|value| value.round() as i64)).or_default().push((position, normal));
    }
    let square = REACH * extent;
    for of_plane in planes.values() {
        let (origin, normal) = of_plane[0];
        let (x, y) = normal.any_orthonormal_pair();
        let mut rows: BTreeMap<i64, BTreeSet<i64>> = BTreeMap::new();
        for (position, _) in of_plane {
            let [column, row] = [x, y].map(|axis| (axis.dot(*position - origin) / square).round() as i64);
            // From the middle of a square, its neighbours are half of one away.
            (row - 1..=row + 1).for_each(|row| rows.entry(row).or_default().extend(column - 1..=column + 1));
        }
        for ([left, right], [low, high]) in rectangles(&rows) {
            let corner = |column: i64, row: i64| origin + square * ((column as f64 - 0.5) * x + (row as f64 - 0.5) * y);
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([corner(left, low), corner(right, low), corner(right, high), corner(left, high)]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    mesh
}

/// Columns and rows of rectangles, each from the first up to, but without, the last, that hold all squares once.
fn rectangles(rows: &BTreeMap<i64, BTreeSet<i64>>) -> Vec<([i64; 2], [i64; 2])> {
    let mut all = Vec::new();
    // Those that the row before has reached, by their columns, with the row in which they began.
    let mut open: BTreeMap<[i64; 2], i64> = BTreeMap::new();
    let mut next_row = i64::MIN;
    for (&row, columns) in rows {
        let mut runs: Vec<[i64; 2]> = Vec::new();
        for &column in columns {
            match runs.last_mut().filter(|run| run[1] == column) {
                Some(run) => run[1] += 1,
                None => runs.push([column, column + 1]),
            }
        }
        let before = std::mem::take(&mut open);
        let goes_on = |run: &[i64; 2]| row == next_row && runs.contains(run);
        all.extend(before.iter().filter(|(run, _)| !goes_on(run)).map(|(run, first)| (*run, [*first, next_row])));
        open = runs.iter().map(|run| (*run, before.get(run).copied().filter(|_| row == next_row).unwrap_or(row))).collect();
        next_row = row + 1;
    }
    all.extend(open.into_iter().map(|(run, first)| (run, [first, next_row])));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::built_in;

    #[test]
    fn rectangles_hold_every_square_once() {
        let squares = [(0, 0), (0, 1), (1, 0), (1, 1), (1, 3), (2, 3), (4, 0), (4, 1), (5, 0)];
        let mut rows: BTreeMap<i64, BTreeSet<i64>> = BTreeMap::new();
        squares.iter().for_each(|(row, column)| rows.entry(*row).or_default().extend([*column]));
        let all = rectangles(&rows);
        let in_all = all
            .iter()
            .flat_map(|([left, right], [low, high])| (*low..*high).flat_map(move |row| (*left..*right).map(move |column| (row, column))));
        let mut found: Vec<(i64, i64)> = in_all.collect();
        found.sort_unstable();
        assert_eq!(found, squares);
        assert_eq!(all.len(), 4);
    }

    #[test]
    fn only_points_in_the_air_get_sheets_and_only_beside_mirrors_and_glass() {
        let settings = SceneSettings::default();
        let count = |name: &str, points: &[(DVec3, DVec3)], settings: &SceneSettings| {
            let scene = built_in::by_name(name).unwrap();
            let with = with_sensors(&scene, points, settings);
            with.triangle_count() - scene.triangle_count()
        };
        let (floor, air, below) =
            ((DVec3::new(0.5, 0.0, 0.5), DVec3::Y), (DVec3::new(0.2, 0.5, 0.5), DVec3::Y), (DVec3::new(0.5, 0.0, 0.5), DVec3::NEG_Y));
        assert_eq!(count("cornell-spheres", &[floor], &settings), 0);
        assert_eq!(count("cornell-spheres", &[floor, air], &settings), 2);
        assert_eq!(count("cornell-spheres", &[below], &settings), 2);
        // Of one plane together, of two planes each.
        let grid: Vec<(DVec3, DVec3)> =
            (0..100).map(|k| (air.0 + DVec3::new(0.01 * f64::from(k % 10), 0.0, 0.01 * f64::from(k / 10)), DVec3::Y)).collect();
        assert_eq!(count("cornell-spheres", &grid, &settings), 2);
        assert_eq!(count("cornell-spheres", &[air, (air.0 + 0.1, DVec3::X)], &settings), 4);
        assert_eq!(count("cornell", &[air], &settings), 0);
        let by_photons = SceneSettings { illumination: Illumination::Photons, ..settings.clone() };
        assert_eq!(count("cornell", &[air], &by_photons), 2);
        let without = SceneSettings { without: vec![Effect::Alpha], ..settings };
        assert_eq!(count("cornell-spheres", &[air], &without), 0);
    }
}
