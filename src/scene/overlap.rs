//! Surfaces that lie in one plane and overlap, as a rug on its floor or a lamp that was exported twice. Where only one of them
//! counts ([`super::contact`] has the rule), of the others only what is visible beside it does: [`find`] says what that is.

use std::cell::LazyCell;
use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec3};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::float::single::SingleFloatOverlay as _;
use i_triangle::float::triangulatable::Triangulatable as _;
use rayon::prelude::*;

use super::contact::{Contact, Kind};
use super::coplanar::{Sheet, WIDTH, altitude, pairs};
use super::{Scene, work};

/// A triangle of which a part is hidden by others in its plane.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Covered {
    pub triangle: usize,
    /// Those that hide it and face as it does; more may hide it whose back is seen.
    pub by: Vec<usize>,
    /// What remains visible: barycentric weights of the triangle's corners at the corners of each piece.
    pub pieces: Vec<[DVec3; 3]>,
    /// So many hide it that some were left out, and what only they hide counts as visible.
    pub uncut: bool,
}

/// Triangles that are cut out of one, the largest first, where these hide each other as often: each then costs time with each
/// other one. A rug of many triangles that do not overlap is cut out whole.
const MOST_CLIPS: usize = 64;

/// Triangles that are cut out of one at once, where these hide each other as often: of many at once all crossings of their sides
/// cost time, of a few after others only those within what is left.
const CLIPS_AT_ONCE: usize = 4;

/// Share of the time that goes into finding pairs, about; the rest goes into clipping.
const PAIRS_SHARE: f64 = 0.5;

/// Which of two overlapping surfaces counts, by mesh: the smaller number. What emits light wins over what does not, so that a
/// lamp in a ceiling's plane is seen; what is opaque over what lets light through, as nothing would be lit through it; a small mesh over a
/// large one, as rugs lie on floors; and at last the first. What is hidden is so from both sides: from behind, a rug with
/// one side on a floor with two is the rug's back.
pub(crate) fn ranks(scene: &Scene, kinds: &[Kind]) -> Vec<u32> {
    const PIECE: usize = 1 << 14;
    let class = |mesh: usize| {
        let lets_through = i32::from(kinds[mesh] != Kind::Opaque);
        2 * lets_through + i32::from(!scene.materials[scene.meshes[mesh].material].is_emissive())
    };
    let key = |mesh: usize| {
        let of = &scene.meshes[mesh];
        // Sums of pieces of one length do not depend on the number of threads.
        let area_of =
            |piece: usize| -> f64 { (piece * PIECE..of.triangles.len().min((piece + 1) * PIECE)).map(|triangle| of.area(triangle)).sum() };
        let areas: Vec<f64> = (0..of.triangles.len().div_ceil(PIECE)).into_par_iter().map(area_of).collect();
        (class(mesh), areas.iter().sum())
    };
    let keys: Vec<(i32, f64)> = (0..scene.meshes.len()).into_par_iter().map(key).collect();
    let mut order: Vec<usize> = (0..scene.meshes.len()).collect();
    order.sort_by(|a, b| keys[*a].0.cmp(&keys[*b].0).then(keys[*a].1.total_cmp(&keys[*b].1)));
    let mut ranks = vec![0; order.len()];
    (0..).zip(order).for_each(|(rank, mesh)| ranks[mesh] = rank);
    ranks
}

impl Sheet<'_> {
    /// Weights of the second and third corner at a point of its plane.
    fn place(&self, point: DVec3) -> [f64; 2] {
        let [a, b, c] = self.corners;
        let doubled = (b - a).cross(c - a);
        let off = point - a;
        [off.cross(c - a).dot(doubled) / doubled.length_squared(), (b - a).cross(off).dot(doubled) / doubled.length_squared()]
    }

    /// What others, so many at a time, leave of it; `None` if that is all.
    fn without(&self, others: &[Sheet], at_once: usize) -> Option<Vec<[DVec3; 3]>> {
        let own = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].to_vec();
        let clips: Vec<Vec<[f64; 2]>> = others.iter().map(|other| other.corners.map(|corner| self.place(corner)).to_vec()).collect();
        // Clips may run either way.
        let mut visible = vec![vec![own]];
        for clips in clips.chunks(at_once) {
            // Those of one step are cut at each other, too.
            work::add(|| clips.len().pow(2));
            visible = visible.overlay_as::<i64>(&clips.to_vec(), OverlayRule::Difference, FillRule::NonZero);
        }
        let mesh = visible.triangulate_as::<i64>().to_triangulation::<u32>();
        let corner = |index: u32| {
            let [u, v] = mesh.points[index as usize];
            DVec3::new(1.0 - u - v, u, v)
        };
        let pieces: Vec<[DVec3; 3]> = mesh.indices.chunks_exact(3).map(|of| [corner(of[0]), corner(of[1]), corner(of[2])]).collect();
        let share = |[a, b, c]: &[DVec3; 3]| DVec2::new(b.y - a.y, b.z - a.z).perp_dot(DVec2::new(c.y - a.y, c.z - a.z));
        if 1.0 - pieces.iter().map(share).sum::<f64>() < 1e-9 {
            return None;
        }
        let at = |weights: &DVec3| self.corners[0] * weights.x + self.corners[1] * weights.y + self.corners[2] * weights.z;
        Some(pieces.into_iter().filter(|piece| altitude(&[at(&piece[0]), at(&piece[1]), at(&piece[2])]) > WIDTH).collect())
    }
}

/// Finds the triangles of a scene, normalised, that others of their plane hide in part or whole. `sources` are the
/// triangles' meshes and numbers there, `ranks` gives those of [`ranks`] where they matter, and `report` is called with the
/// share that is done.
pub(crate) fn find<'a>(
    scene: &Scene,
    kinds: &[Kind],
    ranks: impl FnOnce() -> &'a [u32],
    sources: &[(u32, u32)],
    corners: &[[Vec3; 3]],
    mut report: impl FnMut(f64),
) -> Vec<Covered> {
    let sheet = |triangle: u32| Sheet::new(scene, kinds, sources[triangle as usize].0, corners[triangle as usize]);
    let mut pairs = pairs(scene, kinds, sources, corners, Contact::Once, |_| true, |done| report(PAIRS_SHARE * done));
    if pairs.is_empty() {
        return Vec::new();
    }
    // Each the hidden one and what hides it.
    let ranks = ranks();
    let place = |triangle: u32| (ranks[sources[triangle as usize].0 as usize], sources[triangle as usize].1);
    pairs.par_iter_mut().filter(|(a, b)| place(*a) < place(*b)).for_each(|(a, b)| std::mem::swap(a, b));
    pairs.par_sort_unstable();
    pairs.dedup();
    let hider_count = |triangle: u32| pairs.partition_point(|pair| pair.0 <= triangle) - pairs.partition_point(|pair| pair.0 < triangle);
    let visible = |own: &[(u32, u32)]| {
        let hidden = sheet(own[0].0);
        let mut others: Vec<(u32, Sheet)> = own.iter().map(|(_, other)| (*other, sheet(*other))).collect();
        // How often others are hidden, in all.
        let hidden_count: usize = if others.len() > CLIPS_AT_ONCE { others.iter().map(|(other, _)| hider_count(*other)).sum() } else { 0 };
        let uncut = others.len() > MOST_CLIPS && hidden_count > MOST_CLIPS * others.len();
        if uncut {
            let size = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a).length_squared();
            others.sort_by(|(a, one), (b, other)| size(&other.corners).total_cmp(&size(&one.corners)).then(a.cmp(b)));
            others.truncate(MOST_CLIPS);
        }
        // Of a rug in a few layers, each hides a few of very many.
        let overlaps_often = uncut || hidden_count > others.len() * CLIPS_AT_ONCE.max(others.len() / 8);
        let clips_at_once = if overlaps_often { CLIPS_AT_ONCE } else { others.len() };
        let (others, sheets): (Vec<u32>, Vec<Sheet>) = others.into_iter().unzip();
        let pieces = hidden.without(&sheets, clips_at_once)?;
        let alike = others.iter().zip(&sheets).filter(|(_, other)| other.normal.dot(hidden.normal) > 0.0);
        Some(Covered { triangle: own[0].0 as usize, by: alike.map(|(other, _)| *other as usize).collect(), pieces, uncut })
    };
    let hidden: Vec<&[(u32, u32)]> = pairs.chunk_by(|a, b| a.0 == b.0).collect();
    let mut covered = Vec::new();
    let batch = (hidden.len() / 100).max(4 * rayon::current_num_threads());
    for (number, own) in hidden.chunks(batch).enumerate() {
        report(PAIRS_SHARE + (1.0 - PAIRS_SHARE) * (number * batch) as f64 / hidden.len() as f64);
        covered.par_extend(own.par_iter().copied().filter_map(visible));
    }
    covered
}

/// What is visible of each triangle of a scene, by mesh and number, that others of its plane hide in part or whole. `corners_of` gives
/// the corners of a mesh's triangle.
pub(crate) fn of_scene(scene: &Scene, kinds: &[Kind], corners_of: impl Fn(u32, u32) -> [DVec3; 3]) -> HashMap<(u32, u32), Vec<[DVec3; 3]>> {
    let (min, max) = scene.bounds();
    let (centre, extent) = (0.5 * (min + max), (max - min).max_element());
    if !extent.is_normal() {
        return HashMap::new();
    }
    let numbers = |mesh: usize| (0..scene.meshes[mesh].triangles.len() as u32).map(move |triangle| (mesh as u32, triangle));
    let sources: Vec<(u32, u32)> = (0..scene.meshes.len()).flat_map(numbers).collect();
    let local = |position: DVec3| ((position - centre) / extent).as_vec3();
    let corners: Vec<[Vec3; 3]> = sources.iter().map(|(mesh, triangle)| corners_of(*mesh, *triangle).map(local)).collect();
    let ranks = LazyCell::new(|| ranks(scene, kinds));
    let covered = find(scene, kinds, || &ranks, &sources, &corners, |_| ());
    covered.into_iter().map(|covered| (sources[covered.triangle], covered.pieces)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::contact::Touching;
    use crate::scene::geometry::Geometry;
    use crate::scene::{Material, Mesh};

    /// A disc whose triangles meet in its middle, and a rug on it.
    fn disc(segments: u32) -> Scene {
        let rim = |k: u32| f64::from(k) / f64::from(segments) * std::f64::consts::TAU;
        let at = |k: u32| DVec3::new(rim(k).sin(), 0.0, rim(k).cos());
        let disc = Mesh {
            positions: [DVec3::ZERO].into_iter().chain((0..segments).map(at)).collect(),
            triangles: (0..segments).map(|k| [0, 1 + k, 1 + (k + 1) % segments]).collect(),
            ..Mesh::default()
        };
        let rug = Mesh::parallelogram("rug", DVec3::new(0.3, 0.0, 0.3), DVec3::Z * 0.1, DVec3::X * 0.1, 0);
        Scene { meshes: vec![disc, rug], materials: vec![Material::lambert("matt", Vec3::ONE)], ..Scene::default() }
    }

    /// Triangles of one size around one middle, each turned against the one before.
    fn turned(count: u32) -> Scene {
        let corner = |k: u32| {
            let angle = (f64::from(k % 3) + f64::from(k / 3) / f64::from(count)) / 3.0 * std::f64::consts::TAU;
            DVec3::new(angle.sin(), 0.0, angle.cos())
        };
        let mesh = Mesh {
            positions: (0..3 * count).map(corner).collect(),
            triangles: (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
            ..Mesh::default()
        };
        Scene { meshes: vec![mesh], materials: vec![Material::lambert("matt", Vec3::ONE)], ..Scene::default() }
    }

    /// Of many that hide each other a few are cut out at a time, in a tenth of the time, and the share that is done rises.
    #[test]
    fn many_that_hide_each_other_are_cut_out_quickly() {
        let scene = turned(120);
        let mut shares = Vec::new();
        let mut report = |stage: &str, done: f64| {
            if stage == "looking for overlaps" {
                shares.push(done);
            }
        };
        let (_, done) = work::of(|| Geometry::new_with(&scene, &mut report).unwrap());
        // All at once would be a third of the cube of their number.
        assert!(done < 120 * 120 * 120 / 15, "{done}");
        assert!(shares.len() > 10 && shares.is_sorted() && shares[shares.len() - 1] > 0.9, "{shares:?}");
    }

    /// However many are cut out at a time, the same is left.
    #[test]
    fn what_is_left_does_not_depend_on_how_many_are_cut_out_at_once() {
        let scene = turned(24);
        let sheets: Vec<Sheet> = (0..24)
            .map(|triangle| {
                let corners = scene.meshes[0].corners(triangle);
                let of = Touching { kind: Kind::Opaque, material: &scene.materials[0] };
                Sheet { corners, normal: DVec3::Y, altitude: altitude(&corners), of }
            })
            .collect();
        let left = |at_once: usize| -> f64 {
            let at = |weights: DVec3| DVec2::new(weights.y, weights.z);
            let area = |[a, b, c]: [DVec3; 3]| (at(b) - at(a)).perp_dot(at(c) - at(a));
            sheets[0].without(&sheets[1..], at_once).unwrap().into_iter().map(area).sum()
        };
        let expected = left(23);
        assert!(expected > 0.001 && expected < 0.1, "{expected}");
        for at_once in [1, CLIPS_AT_ONCE, 7] {
            assert!((left(at_once) - expected).abs() < 1e-9, "{at_once} at once: {} instead of {expected}", left(at_once));
        }
    }

    /// Boxes of long triangles cross a share of all cells each, were these as small as triangles are.
    #[test]
    fn long_triangles_take_no_more_room_than_others() {
        let scene = disc(30_000);
        let corners_of = |mesh: u32, triangle: u32| scene.meshes[mesh as usize].corners(triangle as usize);
        let (parts, done) = work::of(|| of_scene(&scene, &[Kind::Opaque; 2], corners_of));
        // Entries of cells and pairs that are compared.
        assert!(done < 40 * 30_000, "{done}");
        // From the middle the rug is seen under 16.26 degrees.
        assert!((1353..1358).contains(&parts.len()), "{}", parts.len());
        assert!(parts.keys().all(|(mesh, _)| *mesh == 0));
    }
}
