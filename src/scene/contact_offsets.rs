//! Offsets of surfaces that touch and of which both count ([`super::contact`]): some two millionths of the scene's size, so that rays
//! meet one, then the other. A sheet is moved off what it lies on, to the side from which both are seen; a solid into the one beside it.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::{DVec3, Vec3};

use super::contact::{self, Contact, Kind};
use super::overlap::{self, Sheet};
use super::planes::IN_PLANE;
use super::{Mesh, Scene};

/// In units of the scene: four times what lies in one plane. Where rays start is known to a quarter of it.
const OFFSET: f64 = 4.0 * IN_PLANE;

/// Sheets of different materials that lie on one another, each one offset above the next; of more, the uppermost lie in one plane.
const MOST_LEVELS: u32 = 16;

/// Directions that differ by less than this sine are one: facets of a curved surface.
const LEAST_SINE: f64 = 0.1;

/// By mesh and vertex, metres.
#[derive(Debug, Default)]
pub struct Offsets(HashMap<(u32, u32), DVec3>);

/// How far a vertex moves along a direction.
struct Step {
    along: DVec3,
    by: f64,
    /// `None`: a face of a solid, which takes the rest of its solid along.
    sheet: Option<u32>,
}

impl Offsets {
    /// Corners of a triangle.
    pub fn corners(&self, scene: &Scene, mesh: u32, triangle: u32) -> [DVec3; 3] {
        let of = &scene.meshes[mesh as usize];
        if self.0.is_empty() {
            return of.corners(triangle as usize);
        }
        of.triangles[triangle as usize]
            .map(|vertex| of.positions[vertex as usize] + self.0.get(&(mesh, vertex)).copied().unwrap_or(DVec3::ZERO))
    }

    /// Those that a scene needs.
    pub fn of(scene: &Scene, kinds: &[Kind]) -> Offsets {
        let (min, max) = scene.bounds();
        let (centre, extent) = (0.5 * (min + max), (max - min).max_element());
        if kinds.iter().all(|kind| *kind == Kind::Opaque) || !extent.is_normal() {
            return Offsets::default();
        }
        // As scenes are normalised.
        let unit = 2f64.powi(extent.log2().ceil() as i32);
        let numbers = |mesh: usize| (0..scene.meshes[mesh].triangles.len() as u32).map(move |triangle| (mesh as u32, triangle));
        let is_wide = |corners: &[Vec3; 3]| (corners[1] - corners[0]).cross(corners[2] - corners[0]).length_squared() >= f32::MIN_POSITIVE;
        let local = |position: DVec3| ((position - centre) / unit).as_vec3();
        let triangles = (0..scene.meshes.len()).flat_map(numbers);
        let (sources, corners): (Vec<(u32, u32)>, Vec<[Vec3; 3]>) = triangles
            .map(|(mesh, triangle)| ((mesh, triangle), scene.meshes[mesh as usize].corners(triangle as usize).map(local)))
            .filter(|(_, corners)| is_wide(corners))
            .unzip();
        let kind_of = |triangle: u32| kinds[sources[triangle as usize].0 as usize];
        let is_candidate = |triangle: u32| kind_of(triangle) != Kind::Opaque;
        let mut pairs = overlap::pairs(scene, kinds, &sources, &corners, Contact::Both, is_candidate, |_| ());
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
        let levels = levels(&pairs, &sources, kinds, &ranks);
        let sheet = |triangle: u32| Sheet::new(scene, kinds, sources[triangle as usize].0, corners[triangle as usize]);
        let mut steps: HashMap<(usize, [u64; 3]), Vec<Step>> = HashMap::new();
        for (mover, other) in pairs {
            let (mesh, triangle) = sources[mover as usize];
            let (own, beside) = (sheet(mover), sheet(other));
            let step = || match kinds[mesh as usize] {
                Kind::Sheet => Step {
                    along: if beside.of.material.has_two_sides() { own.normal } else { beside.normal },
                    by: f64::from(levels[&mesh]) * OFFSET * unit,
                    sheet: Some(mesh),
                },
                _ => Step { along: own.normal, by: -own.normal.dot(beside.normal).signum() * OFFSET * unit, sheet: None },
            };
            let of = &scene.meshes[mesh as usize];
            of.corners(triangle as usize).iter().for_each(|corner| steps.entry((of.material, bits(*corner))).or_default().push(step()));
        }
        let meshes = (0u32..).zip(&scene.meshes);
        Offsets(meshes.flat_map(|(number, mesh)| offsets_of(number, mesh, &steps, IN_PLANE * unit)).collect())
    }
}

/// Moves the vertices of a scene's surfaces that touch.
pub fn apply(scene: &mut Scene) {
    for ((mesh, vertex), way) in Offsets::of(scene, &contact::kinds(scene)).0 {
        scene.meshes[mesh as usize].positions[vertex as usize] += way;
    }
}

/// The sum turns -0 into 0.
fn bits(position: DVec3) -> [u64; 3] {
    (position + DVec3::ZERO).to_array().map(f64::to_bits)
}

/// Whether two triangles have the same corners and face the same way.
fn is_double(one: &[Vec3; 3], other: &[Vec3; 3]) -> bool {
    (0..3).any(|turn| (0..3).all(|corner| one[corner] == other[(corner + turn) % 3]))
}

/// How many offsets each sheet lies above what is below all.
fn levels(pairs: &[(u32, u32)], sources: &[(u32, u32)], kinds: &[Kind], ranks: &[u32]) -> BTreeMap<u32, u32> {
    let mesh_of = |triangle: u32| sources[triangle as usize].0;
    let mut below: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (mover, other) in pairs.iter().filter(|(mover, _)| kinds[mesh_of(*mover) as usize] == Kind::Sheet) {
        below.entry(mesh_of(*mover)).or_default().push(mesh_of(*other));
    }
    let mut order: Vec<u32> = below.keys().copied().collect();
    order.sort_by_key(|mesh| std::cmp::Reverse(ranks[*mesh as usize]));
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
    // A solid that touches another of its material has vertices at the same places: whose they are, tells the side that their triangles
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
