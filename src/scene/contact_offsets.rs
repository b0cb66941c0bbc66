//! Offsets of surfaces that touch and of which both count ([`super::contact`]): some two millionths of the scene's size, so that rays
//! meet one, then the other. A sheet is moved off what it lies on, to the side from which both are seen; solids into each other.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use glam::{DVec3, Vec3};

use super::connected::bits;
use super::contact::{self, Contact, Kind};
use super::coplanar::{self, Sheet};
use super::frame::{Frame, has_area};
use super::overlap;
use super::planes::IN_PLANE;
use super::{Mesh, Scene};

/// In units of the scene: four times what lies in one plane. Where rays start is known to a quarter of it.
const OFFSET: f64 = 4.0 * IN_PLANE;

/// Offsets that a surface is moved at most, of sheets or solids that lie on one another each one more than the next; of more, the
/// outermost lie in one plane.
const MOST_LEVELS: u32 = 16;

/// Directions that differ by less than this sine are one: facets of a curved surface.
const LEAST_SINE: f64 = 0.1;

/// By mesh and vertex, metres.
#[derive(Debug, Default)]
pub(crate) struct Offsets(HashMap<(u32, u32), DVec3>);

/// How far a vertex moves along a direction.
struct Step {
    along: DVec3,
    by: f64,
    /// `None`: a face of a solid, which takes the rest of its solid along.
    sheet: Option<u32>,
}

impl Offsets {
    /// Corners of a triangle.
    pub(crate) fn corners(&self, scene: &Scene, mesh: u32, triangle: u32) -> [DVec3; 3] {
        let of = &scene.meshes[mesh as usize];
        if self.0.is_empty() {
            return of.corners(triangle as usize);
        }
        of.triangles[triangle as usize]
            .map(|vertex| of.positions[vertex as usize] + self.0.get(&(mesh, vertex)).copied().unwrap_or(DVec3::ZERO))
    }

    /// Those that a scene needs.
    pub(crate) fn of(scene: &Scene, kinds: &[Kind]) -> Offsets {
        if kinds.iter().all(|kind| *kind == Kind::Opaque) {
            return Offsets::default();
        }
        let Ok(frame) = Frame::of(scene) else { return Offsets::default() };
        let unit = frame.unit;
        let numbers = |mesh: usize| (0..scene.meshes[mesh].triangles.len() as u32).map(move |triangle| (mesh as u32, triangle));
        let triangles = (0..scene.meshes.len()).flat_map(numbers);
        let (sources, corners): (Vec<(u32, u32)>, Vec<[Vec3; 3]>) = triangles
            .map(|(mesh, triangle)| ((mesh, triangle), scene.meshes[mesh as usize].corners(triangle as usize).map(|at| frame.local(at))))
            .filter(|(_, corners)| has_area(corners))
            .unzip();
        let kind_of = |triangle: u32| kinds[sources[triangle as usize].0 as usize];
        let is_candidate = |triangle: u32| kind_of(triangle) != Kind::Opaque;
        let mut pairs = coplanar::pairs(scene, kinds, &sources, &corners, Contact::Both, is_candidate, |_| ());
        if pairs.is_empty() {
            return Offsets::default();
        }
        let ranks = overlap::ranks(scene, kinds);
        let place = |triangle: u32| {
            let (mesh, number) = sources[triangle as usize];
            (kind_of(triangle) != Kind::Sheet, ranks[mesh as usize], number)
        };
        // Each the one that moves, and the other.
        pairs.iter_mut().filter(|(a, b)| place(*a) > place(*b)).for_each(|(a, b)| std::mem::swap(a, b));
        pairs.sort_unstable();
        pairs.dedup();
        // Of solids with the very same triangles one is left out.
        pairs.retain(|(a, b)| kind_of(*a) == Kind::Sheet || !is_double(&corners[*a as usize], &corners[*b as usize]));
        let sheet = |triangle: u32| Sheet::new(scene, kinds, sources[triangle as usize].0, corners[triangle as usize]);
        let face_alike = |a: u32, b: u32| sheet(a).normal.dot(sheet(b).normal) > 0.0;
        let levels = levels(&pairs, &sources, kinds, &ranks, face_alike);
        let mut steps: HashMap<(usize, [u64; 3]), Vec<Step>> = HashMap::new();
        let mut add = |triangle: u32, along: DVec3, sheet: Option<u32>| {
            let (mesh, number) = sources[triangle as usize];
            let by = f64::from(levels[&mesh]) * OFFSET * unit;
            let of = &scene.meshes[mesh as usize];
            let corners = of.corners(number as usize);
            corners.iter().for_each(|corner| steps.entry((of.material, bits(*corner))).or_default().push(Step { along, by, sheet }));
        };
        for (mover, other) in pairs {
            let (own, beside) = (sheet(mover), sheet(other));
            match kind_of(mover) {
                Kind::Sheet => {
                    let along = if beside.of.material.has_two_sides() { own.normal } else { beside.normal };
                    add(mover, along, Some(sources[mover as usize].0));
                }
                _ => [(mover, own.normal), (other, beside.normal)].into_iter().for_each(|(of, along)| add(of, along, None)),
            }
        }
        let meshes = (0u32..).zip(&scene.meshes);
        Offsets(meshes.flat_map(|(number, mesh)| offsets_of(number, mesh, &steps, IN_PLANE * unit)).collect())
    }
}

/// Moves the vertices of a scene's surfaces that touch.
pub(crate) fn apply(scene: &mut Scene) {
    for ((mesh, vertex), way) in Offsets::of(scene, &contact::kinds(scene)).0 {
        scene.meshes[mesh as usize].positions[vertex as usize] += way;
    }
}

/// Whether two triangles have the same corners and face the same way.
fn is_double(one: &[Vec3; 3], other: &[Vec3; 3]) -> bool {
    (0..3).any(|turn| (0..3).all(|corner| one[corner] == other[(corner + turn) % 3]))
}

/// How many offsets each sheet and each solid that touches another is moved. Faces of solids all move outwards, so that none leaves air
/// to what it touches; where two look the same way the larger moves further, and so encloses the other.
fn levels(
    pairs: &[(u32, u32)],
    sources: &[(u32, u32)],
    kinds: &[Kind],
    ranks: &[u32],
    face_alike: impl Fn(u32, u32) -> bool,
) -> BTreeMap<u32, u32> {
    let mesh_of = |triangle: u32| sources[triangle as usize].0;
    // By mesh, those that it is moved further than.
    let mut below: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for (mover, other) in pairs {
        let (of_mover, of_other) = (mesh_of(*mover), mesh_of(*other));
        let is_sheet = kinds[of_mover as usize] == Kind::Sheet;
        let under_mover = below.entry(of_mover).or_default();
        if is_sheet {
            under_mover.insert(of_other);
        } else {
            let under_other = below.entry(of_other).or_default();
            if face_alike(*mover, *other) {
                under_other.insert(of_mover);
            }
        }
    }
    // Solids, the smallest first, then sheets, the largest first.
    let mut order: Vec<u32> = below.keys().copied().collect();
    order.sort_by_key(|mesh| {
        let rank = i64::from(ranks[*mesh as usize]);
        if kinds[*mesh as usize] == Kind::Sheet { (true, -rank) } else { (false, rank) }
    });
    let mut levels = BTreeMap::new();
    for mesh in order {
        let highest = below[&mesh].iter().map(|other| levels.get(other).copied().unwrap_or(0)).max().unwrap_or(0);
        levels.insert(mesh, (highest + 1).min(MOST_LEVELS));
    }
    levels
}

/// The offsets of a mesh's vertices.
fn offsets_of(number: u32, mesh: &Mesh, steps: &HashMap<(usize, [u64; 3]), Vec<Step>>, in_plane: f64) -> Vec<((u32, u32), DVec3)> {
    let steps_at = |vertex: u32| steps.get(&(mesh.material, bits(mesh.positions[vertex as usize])));
    // A solid that touches another of its material has vertices at the same places: whose they are shows the side that their triangles
    // lie on.
    let mut others: HashSet<(u32, usize)> = HashSet::new();
    for (triangle, vertices) in mesh.triangles.iter().enumerate() {
        for vertex in vertices {
            for (k, step) in steps_at(*vertex).into_iter().flatten().enumerate().filter(|(_, step)| step.sheet.is_none()) {
                let heights = mesh.corners(triangle).map(|corner| step.along.dot(corner - mesh.positions[*vertex as usize]));
                let lies_in = heights.iter().all(|height| height.abs() <= in_plane);
                let is_other =
                    if lies_in { mesh.normal(triangle).dot(step.along) < 0.0 } else { heights.iter().any(|height| *height > in_plane) };
                if is_other {
                    others.insert((*vertex, k));
                }
            }
        }
    }
    let mut offsets = Vec::new();
    for vertex in 0..mesh.positions.len() as u32 {
        let wanted = steps_at(vertex).into_iter().flatten().enumerate();
        let own = wanted.filter(|(k, step)| step.sheet.map_or(!others.contains(&(vertex, *k)), |of| of == number));
        let way = together(own.map(|(_, step)| step));
        if way != DVec3::ZERO {
            offsets.push(((number, vertex), way));
        }
    }
    offsets
}

/// The shortest offset with all of these steps; of directions that are nearly the same the first counts.
fn together<'a>(steps: impl Iterator<Item = &'a Step>) -> DVec3 {
    let mut way = DVec3::ZERO;
    let mut known: Vec<DVec3> = Vec::new();
    for step in steps {
        let rest = known.iter().fold(step.along, |rest, direction| rest - *direction * direction.dot(rest));
        if known.len() < 3 && rest.length() > LEAST_SINE {
            way += rest * ((step.by - step.along.dot(way)) / rest.length_squared());
            known.push(rest.normalize());
        }
    }
    way
}
