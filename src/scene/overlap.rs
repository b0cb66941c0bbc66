//! Surfaces that lie in one plane and overlap, as a rug on its floor or a lamp that was exported twice. Where only one of them
//! counts ([`super::contact`] has the rule), of the others only what is visible beside it does: [`find`] says what that is.

use std::cell::LazyCell;
use std::collections::HashMap;

use glam::{DVec2, DVec3, UVec2, Vec2, Vec3};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::float::single::SingleFloatOverlay as _;
use i_triangle::float::triangulatable::Triangulatable as _;
use rayon::prelude::*;

use super::contact::{Contact, Kind, Touching};
use super::planes::{IN_PLANE, NUMBER, NUMBER_BITS};
use super::{Scene, work};

/// Overlaps and triangles that are no wider are rounding of edges that only touch.
const WIDTH: f64 = 1.0 / 1_048_576.0;

/// Width of the classes of normals and of distances from the origin: only triangles of one class are compared. Few
/// triangles are so thin that rounding may move them to another class, and few that are far apart share one.
const CLASS: f64 = 1.0 / 128.0;

/// A triangle of which a part is hidden by others in its plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Covered {
    pub triangle: usize,
    /// Those that hide it and face as it does; more may hide it whose back is seen.
    pub by: Vec<usize>,
    /// What remains visible: barycentric weights of the triangle's corners at the corners of each piece.
    pub pieces: Vec<[DVec3; 3]>,
    /// So many hide it that some were left out, and what only they hide counts as visible.
    pub crowded: bool,
}

/// Triangles that are cut out of one, the largest first, where these hide each other as often: each then costs time with each
/// other one. A rug of many triangles that do not overlap is cut out whole.
const MOST_CLIPS: usize = 64;

/// Triangles that are cut out of one at once, where these hide each other as often: of many at once all crossings of their sides
/// cost time, of a few after others only those within what is left.
const CLIPS_AT_ONCE: usize = 4;

/// Members of small classes that are compared between two reports of the share that is done.
const BATCH: usize = 1 << 16;

/// Share of the time that goes into finding pairs, about; the rest goes into clipping.
const PAIRS_SHARE: f64 = 0.5;

/// Which of two overlapping surfaces counts, by mesh: the smaller number. What shines wins over what does not, so that a
/// lamp in a ceiling's plane is seen; what is opaque over what lets light through, as nothing would be lit through it; a small mesh over a
/// large one, as rugs lie on floors; and at last the first. What is hidden is so from both sides: from behind, a rug with
/// one side on a floor with two is the rug's back.
pub fn ranks(scene: &Scene, kinds: &[Kind]) -> Vec<u32> {
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

/// A triangle with what is known of its plane.
pub(super) struct Sheet<'a> {
    pub(super) corners: [DVec3; 3],
    pub(super) normal: DVec3,
    /// The height over its longest side: how well the corners tell the normal.
    altitude: f64,
    pub(super) of: Touching<'a>,
}

impl<'a> Sheet<'a> {
    pub(super) fn new(scene: &'a Scene, kinds: &[Kind], mesh: u32, corners: [Vec3; 3]) -> Sheet<'a> {
        let corners = corners.map(Vec3::as_dvec3);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let of = Touching { kind: kinds[mesh as usize], material: &scene.materials[scene.meshes[mesh as usize].material] };
        Sheet { corners, normal, altitude: altitude(&corners), of }
    }

    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }

    /// What becomes of both where they lie in one plane.
    fn contact(&self, other: &Sheet) -> Contact {
        let cosine = self.normal.dot(other.normal);
        if cosine.abs() < 0.9 {
            return Contact::None;
        }
        let contact = self.of.contact(&other.of, cosine);
        let (wide, narrow) = if self.altitude > other.altitude { (self, other) } else { (other, self) };
        let in_plane = contact != Contact::None && narrow.corners.iter().all(|corner| wide.height(*corner).abs() <= IN_PLANE);
        if in_plane { contact } else { Contact::None }
    }

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

/// Height of a triangle over its longest side.
fn altitude([a, b, c]: &[DVec3; 3]) -> f64 {
    let longest = (*b - *a).length_squared().max((*c - *b).length_squared()).max((*a - *c).length_squared());
    (*b - *a).cross(*c - *a).length() / longest.sqrt()
}

/// Whether a line along a side of the first of two triangles of one plane separates them, but for rounding.
fn separates([a, b, c]: &[DVec3; 3], others: &[DVec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    // Distances from a side, times its length and twice the area: the corner across is as far off as this.
    let own = normal.length_squared();
    [(a, b), (b, c), (c, a)].into_iter().any(|(from, to)| {
        let side = to - from;
        let inwards = normal.cross(side);
        let [x, y, z] = others.map(|corner| inwards.dot(corner - from));
        let shared = own.min(x.max(y).max(z)) - 0f64.max(x.min(y).min(z));
        shared <= 0.0 || shared * shared <= WIDTH * WIDTH * own * side.length_squared()
    })
}

/// Calls `each` with the classes of planes that a triangle may be in: one, but for what rounding may shift; none of a line.
fn for_classes(corners: [DVec3; 3], mut each: impl FnMut(u64)) {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize();
    let altitude = altitude(&corners);
    let is_exact = (0..3).any(|axis| a[axis] == b[axis] && a[axis] == c[axis]);
    let uncertain = if is_exact { IN_PLANE } else { (0.25 * IN_PLANE / altitude).min(0.5 * CLASS) + IN_PLANE };
    // A plane has two normals: that whose largest component is above 0 counts, and the class tells which that is.
    let size = normal.abs();
    let least = if altitude > WIDTH { size.max_element() - 2.0 * uncertain } else { f64::INFINITY };
    for axis in (0..3).filter(|axis| size[*axis] >= least) {
        let front = if normal[axis] < 0.0 { -normal } else { normal };
        // Above 0, where to drop the fraction is to round down; and no wall along an axis or at a round height lies between
        // two classes.
        let steps = |value: f64| [-uncertain, uncertain].map(|off| ((value + off) / CLASS + 256.4) as u64);
        let ends = [front[(axis + 1) % 3], front[(axis + 2) % 3], front.dot(a)].map(steps);
        let [x, y, z] = ends;
        for class in (x[0]..=x[1]).flat_map(|x| (y[0]..=y[1]).map(move |y| x << 9 | y)) {
            (z[0]..=z[1]).for_each(|z| each((axis as u64) << 27 | class << 9 | z));
        }
    }
}

/// The axis of which a class's normals have most.
fn axis_of(class: u64) -> usize {
    (class >> 27) as usize
}

/// Pairs of triangles of a scene, normalised, that touch so. Of their planes, one of the triangles must be a candidate. `report` is called
/// with the share that is done.
///
/// Triangles are sorted by classes of planes, then by place, so that the time goes with their number.
pub(super) fn pairs(
    scene: &Scene,
    kinds: &[Kind],
    sources: &[(u32, u32)],
    corners: &[[Vec3; 3]],
    contact: Contact,
    is_candidate: impl Fn(u32) -> bool + Sync,
    mut report: impl FnMut(f64),
) -> Vec<(u32, u32)> {
    let wide = |triangle: u32| corners[triangle as usize].map(Vec3::as_dvec3);
    let sheet = |triangle: u32| Sheet::new(scene, kinds, sources[triangle as usize].0, corners[triangle as usize]);
    let with_classes = |mut members: Vec<u64>, triangle: u32| {
        for_classes(wide(triangle), |class| members.push(class << NUMBER_BITS | u64::from(triangle)));
        members
    };
    let members: Vec<Vec<u64>> = (0..corners.len() as u32).into_par_iter().fold(Vec::new, with_classes).collect();
    let mut members = members.concat();
    members.par_sort_unstable();
    // Most that are near each other are neighbours in a mesh, which touch: that is quickly told.
    let overlap = |a: u32, b: u32| {
        let (one, other) = (wide(a), wide(b));
        !separates(&one, &other) && !separates(&other, &one) && sheet(a).contact(&sheet(b)) == contact
    };
    let is_one_class = |a: &u64, b: &u64| a >> NUMBER_BITS == b >> NUMBER_BITS;
    let has_candidate = |class: &[u64]| class.len() > 1 && class.iter().any(|member| is_candidate((member & NUMBER) as u32));
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    // Small classes together, a large one by itself.
    let mut rest = &members[..];
    while !rest.is_empty() {
        let share = |left: usize| (members.len() - left) as f64 / members.len() as f64;
        let class_end = |from: usize| from + rest[from..].partition_point(|member| is_one_class(member, &rest[from])).max(1);
        let (batch, others) = rest.split_at(match class_end(0) {
            own if own > BATCH || own == rest.len() => own,
            _ => class_end(BATCH.min(rest.len()) - 1),
        });
        report(share(rest.len()));
        if is_one_class(&batch[0], &batch[batch.len() - 1]) {
            let span = share(others.len()) - share(rest.len());
            if has_candidate(batch) {
                pairs.extend(near(batch, sources, corners, overlap, |done| report(share(rest.len()) + span * done)));
            }
        } else {
            let pairs_of = |class: &[u64]| if has_candidate(class) { near(class, sources, corners, overlap, |_| ()) } else { Vec::new() };
            pairs.par_extend(batch.par_chunk_by(is_one_class).flat_map_iter(pairs_of));
        }
        rest = others;
    }
    pairs
}

/// Finds the triangles of a scene, normalised, that others of their plane hide in part or whole. `sources` are the
/// triangles' meshes and numbers there, `ranks` gives those of [`ranks`] where they matter, and `report` is called with the
/// share that is done.
pub fn find<'a>(
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
        let crowded = others.len() > MOST_CLIPS && hidden_count > MOST_CLIPS * others.len();
        if crowded {
            let size = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a).length_squared();
            others.sort_by(|(a, one), (b, other)| size(&other.corners).total_cmp(&size(&one.corners)).then(a.cmp(b)));
            others.truncate(MOST_CLIPS);
        }
        // Of a rug in a few layers, each hides a few of very many.
        let overlaps_often = crowded || hidden_count > others.len() * CLIPS_AT_ONCE.max(others.len() / 8);
        let clips_at_once = if overlaps_often { CLIPS_AT_ONCE } else { others.len() };
        let (others, sheets): (Vec<u32>, Vec<Sheet>) = others.into_iter().unzip();
        let pieces = hidden.without(&sheets, clips_at_once)?;
        let alike = others.iter().zip(&sheets).filter(|(_, other)| other.normal.dot(hidden.normal) > 0.0);
        Some(Covered { triangle: own[0].0 as usize, by: alike.map(|(other, _)| *other as usize).collect(), pieces, crowded })
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
pub fn of_scene(scene: &Scene, kinds: &[Kind], corners_of: impl Fn(u32, u32) -> [DVec3; 3]) -> HashMap<(u32, u32), Vec<[DVec3; 3]>> {
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

/// Triangles in a cell of which those of one mesh are not compared: so many meet in a corner, as in the middle of a disc,
/// and to compare all would take time with the square of their number.
const CROWD: usize = 1024;

/// Entries of a grid for each triangle: with more its cells are made larger.
const ENTRIES: f64 = 8.0;

/// Cells between two reports of the share that is done.
const CELLS: usize = 1 << 16;

/// Pairs of the triangles of a class whose boxes overlap and that `is_wanted` holds for.
fn near(
    class: &[u64],
    sources: &[(u32, u32)],
    corners: &[[Vec3; 3]],
    is_wanted: impl Fn(u32, u32) -> bool + Sync,
    mut report: impl FnMut(f64),
) -> Vec<(u32, u32)> {
    // Along the two axes in which the plane is widest.
    let across = axis_of(class[0] >> NUMBER_BITS);
    let flat = |point: Vec3| Vec2::new(point[(across + 1) % 3], point[(across + 2) % 3]);
    let number = |member: usize| (class[member] & NUMBER) as u32;
    let box_of = |member: &u64| {
        let [a, b, c] = corners[(member & NUMBER) as usize].map(flat);
        (a.min(b).min(c), a.max(b).max(c))
    };
    let boxes: Vec<(Vec2, Vec2)> = class.par_iter().with_min_len(CELLS).map(box_of).collect();
    let is_near = |a: usize, b: usize| boxes[a].1.min(boxes[b].1).cmpgt(boxes[a].0.max(boxes[b].0)).all();
    let count = class.len();
    if count <= 16 {
        let pairs = (0..count).flat_map(|b| (0..b).map(move |a| (a, b))).filter(|(a, b)| is_near(*a, *b));
        return pairs.map(|(a, b)| (number(a), number(b))).filter(|(a, b)| is_wanted(*a, *b)).collect();
    }
    // A grid of about as many cells as triangles, or fewer where these are long.
    let low = boxes.iter().fold(Vec2::INFINITY, |low, of| low.min(of.0)).as_dvec2();
    let high = boxes.iter().fold(Vec2::NEG_INFINITY, |high, of| high.max(of.1)).as_dvec2();
    let extent = (high - low).max(DVec2::splat(WIDTH));
    let mut size = (extent.element_product() / count as f64).sqrt().max(extent.max_element() / count as f64);
    let entries = |size: f64| boxes.iter().map(|of| ((of.1 - of.0).as_dvec2() / size + 1.0).element_product()).sum::<f64>();
    while entries(size) > ENTRIES * count as f64 {
        size *= 2.0;
    }
    // No more along an axis than triangles.
    let place = |point: DVec2| ((point - low) * (1.0 / size)).as_uvec2();
    let last = place(high);
    let cell = |point: Vec2| place(point.as_dvec2()).min(last);
    let number_of = |cell: UVec2| cell.y as usize * (last.x as usize + 1) + cell.x as usize;
    let crossed = |of: &(Vec2, Vec2)| {
        let (first, end) = (cell(of.0), cell(of.1));
        (first.y..=end.y).flat_map(move |y| (first.x..=end.x).map(move |x| number_of(UVec2::new(x, y))))
    };
    // Each cell's members, ascending, from its start to that of the next: a counting sort, in linear time.
    let mut starts = vec![0; number_of(last) + 2];
    boxes.iter().flat_map(crossed).for_each(|cell| starts[cell] += 1);
    let mut sum = 0;
    for start in &mut starts {
        sum += *start;
        *start = sum;
    }
    let mut members = vec![0u32; sum];
    work::add(|| sum);
    for (member, of) in boxes.iter().enumerate().rev() {
        for cell in crossed(of) {
            starts[cell] -= 1;
            members[starts[cell]] = member as u32;
        }
    }
    let pairs_of = |own_cell: usize| {
        let members = &members[starts[own_cell]..starts[own_cell + 1]];
        let mut pairs = Vec::new();
        let mesh = |member: u32| sources[number(member as usize) as usize].0;
        for (place, b) in members.iter().enumerate() {
            // A mesh's triangles stand side by side.
            let others = match members.len() {
                0..=CROWD => place,
                _ => members.partition_point(|a| mesh(*a) < mesh(*b)),
            };
            work::add(|| others);
            let b = *b as usize;
            for a in &members[..others] {
                let a = *a as usize;
                // In the one cell that holds the lower corner of what both boxes share.
                let is_here = || number_of(cell(boxes[a].0.max(boxes[b].0))) == own_cell;
                if is_near(a, b) && is_here() && is_wanted(number(a), number(b)) {
                    pairs.push((number(a), number(b)));
                }
            }
        }
        pairs
    };
    let mut pairs = Vec::new();
    let cell_count = starts.len() - 1;
    for first in (0..cell_count).step_by(CELLS) {
        report(first as f64 / cell_count as f64);
        pairs.par_extend((first..cell_count.min(first + CELLS)).into_par_iter().with_min_len(CELLS / 16).flat_map_iter(pairs_of));
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
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
