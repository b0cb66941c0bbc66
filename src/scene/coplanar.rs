//! Triangles that lie in one plane and touch each other: pairs of them, found by classes of planes and grids in these.

use glam::{DVec2, DVec3, UVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::contact::{Contact, Kind, Touching};
use super::planes::{IN_PLANE, NUMBER, NUMBER_BITS};
use super::{Scene, work};

/// Overlaps and triangles that are no wider are rounding of edges that only touch.
pub(super) const WIDTH: f64 = 1.0 / 1_048_576.0;

/// Width of the classes of normals and of distances from the origin: only triangles of one class are compared. Few
/// triangles are so thin that rounding may move them to another class, and few that are far apart share one.
const CLASS: f64 = 1.0 / 128.0;

/// Members of small classes that are compared between two reports of the share that is done.
const BATCH: usize = 1 << 16;

/// Triangles in a cell of which those of one mesh are not compared: so many meet in a corner, as in the middle of a disc,
/// and to compare all would take time with the square of their number.
const CROWD: usize = 1024;

/// Entries of a grid for each triangle: with more its cells are made larger.
const ENTRIES: f64 = 8.0;

/// Cells between two reports of the share that is done.
const CELLS: usize = 1 << 16;

/// A triangle with what is known of its plane.
pub(super) struct Sheet<'a> {
    pub(super) corners: [DVec3; 3],
    pub(super) normal: DVec3,
    /// The height over its longest side: how well the corners show the normal.
    pub(super) altitude: f64,
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
}

/// Height of a triangle over its longest side.
pub(super) fn altitude([a, b, c]: &[DVec3; 3]) -> f64 {
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
    // A plane has two normals: that whose largest component is above 0 counts, and the class shows which that is.
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
    // Most that are near each other are neighbours in a mesh, which touch: that is quickly found.
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
