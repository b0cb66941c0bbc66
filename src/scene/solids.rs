//! Solids that light enters, as closed shells of triangles: which way they face, how many lie in one another, and which of these counts.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::connected::{bits, connected};
use super::layers::Medium;
use super::{Material, Scene, bounds_of};

/// Triangles that are connected by their corners' places, of one material.
struct Shell {
    /// Mesh and triangle.
    triangles: Vec<(u32, u32)>,
    corners: Vec<[DVec3; 3]>,
    min: DVec3,
    max: DVec3,
}

/// Along no axis and no diagonal.
const DIRECTION: DVec3 = DVec3::new(0.290_380_3, 0.829_658_1, 0.476_861_2);

/// Triangles of a shell just inside of which one looks for the solids around, and for one that it lies partly in.
const PLACES: usize = 8;
const PLACES_OF_A_PAIR: usize = 64;

impl Shell {
    /// Positive where faces look outwards; whatever the origin, of a closed shell.
    fn volume(&self) -> f64 {
        self.corners.iter().map(|[a, b, c]| (*a - self.min).dot((*b - self.min).cross(*c - self.min)) / 6.0).sum()
    }

    /// But for rounding, also of the corners along a seam: the areas that look one way are as large as those that look the other.
    fn is_closed(&self) -> bool {
        let areas = || self.corners.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a));
        areas().sum::<DVec3>().length() < 1e-6 * areas().map(DVec3::length).sum::<f64>()
    }

    /// How often it goes around a point: 1 inside of a shell that faces outwards, -1 of one that faces inwards.
    fn winding(&self, point: DVec3) -> i32 {
        if point.cmplt(self.min).any() || point.cmpgt(self.max).any() {
            return 0;
        }
        let crossed = |[a, b, c]: &[DVec3; 3]| {
            let (a, b, c) = (*a - point, *b - point, *c - point);
            let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|side| DIRECTION.dot(side));
            let leaves = i32::from(sides.iter().all(|side| *side > 0.0)) - i32::from(sides.iter().all(|side| *side < 0.0));
            // The plane is ahead of the point, not behind it.
            let normal = (b - a).cross(c - a);
            if normal.dot(a) * f64::from(leaves) > 0.0 { leaves } else { 0 }
        };
        self.corners.iter().map(crossed).sum()
    }

    fn middle(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners[triangle];
        (a + b + c) / 3.0
    }

    /// About so many places just inside of it, each with its triangle.
    fn places_inside(&self, count: usize) -> impl Iterator<Item = (usize, DVec3)> {
        (0..self.corners.len()).step_by(self.corners.len().div_ceil(count)).map(|triangle| {
            let [a, b, c] = self.corners[triangle];
            (triangle, self.middle(triangle) - (b - a).cross(c - a).normalize_or_zero() * (1e-6 * (self.max - self.min).length()))
        })
    }

    fn meets(&self, other: &Shell) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Whether it lies partly within another, as far as places just inside of it show.
    fn is_partly_in(&self, other: &Shell) -> bool {
        let mut is_inside = self.places_inside(PLACES_OF_A_PAIR).map(|(_, place)| other.winding(place) != 0);
        let first = is_inside.next();
        is_inside.any(|is_inside| Some(is_inside) != first)
    }
}

/// The shells of meshes that enclose a medium, by material.
fn shells(scene: &Scene, corners_of: impl Fn(u32, u32) -> [DVec3; 3]) -> BTreeMap<usize, Vec<Shell>> {
    let mut by_material: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    for (number, mesh) in (0u32..).zip(&scene.meshes) {
        if scene.materials[mesh.material].enclosed_medium().is_some() {
            by_material.entry(mesh.material).or_default().push(number);
        }
    }
    by_material.into_iter().map(|(material, meshes)| (material, shells_of(scene, &meshes, &corners_of))).collect()
}

fn shells_of(scene: &Scene, meshes: &[u32], corners_of: impl Fn(u32, u32) -> [DVec3; 3]) -> Vec<Shell> {
    let triangles = meshes.iter().flat_map(|mesh| (0..scene.meshes[*mesh as usize].triangles.len() as u32).map(move |of| (*mesh, of)));
    let all: Vec<((u32, u32), [DVec3; 3])> = triangles.map(|(mesh, triangle)| ((mesh, triangle), corners_of(mesh, triangle))).collect();
    let shell = |group: Vec<usize>| {
        let (triangles, corners): (Vec<(u32, u32)>, Vec<[DVec3; 3]>) = group.into_iter().map(|place| all[place]).unzip();
        let (min, max) = bounds_of(corners.iter().flatten().copied());
        Shell { triangles, corners, min, max }
    };
    connected(all.iter().map(|(_, corners)| corners.map(bits))).into_iter().map(shell).collect()
}

/// Turns closed solids whose faces look inwards, and returns the names of their meshes. A shell that looks inwards within another of its
/// material is a hollow.
pub(crate) fn turn_outwards(scene: &mut Scene) -> BTreeSet<String> {
    let mut turned: Vec<(u32, u32)> = Vec::new();
    for shells in shells(scene, |mesh, triangle| scene.meshes[mesh as usize].corners(triangle as usize)).values() {
        let volumes: Vec<f64> = shells.iter().map(Shell::volume).collect();
        if volumes.iter().all(|volume| *volume >= 0.0) {
            continue;
        }
        let around = |own: usize| -> Vec<usize> {
            let middle = shells[own].middle(0);
            (0..shells.len()).filter(|other| *other != own && shells[*other].winding(middle) % 2 != 0).collect()
        };
        let is_turned = |own: usize| volumes[own] < 0.0 && around(own).len() % 2 == 0 && shells[own].is_closed();
        for own in 0..shells.len() {
            // The hollows of what is inside out are so, too.
            let is_hollow_of_turned =
                || volumes[own] > 0.0 && around(own).len() % 2 == 1 && around(own).iter().any(|other| is_turned(*other));
            if is_turned(own) || is_hollow_of_turned() {
                turned.extend(&shells[own].triangles);
            }
        }
    }
    let mut names = BTreeSet::new();
    let mut turned_normals: BTreeSet<(u32, u32)> = BTreeSet::new();
    for (number, triangle) in turned {
        let mesh = &mut scene.meshes[number as usize];
        names.insert(format!("mesh '{}'", mesh.name));
        mesh.triangles[triangle as usize].swap(1, 2);
        for tangents in [&mut mesh.tangents, &mut mesh.coat_tangents] {
            if let Some(corners) = tangents.get_mut(triangle as usize) {
                corners.swap(1, 2);
            }
        }
        if !mesh.normals.is_empty() {
            let front = mesh.normal(triangle as usize);
            for vertex in mesh.triangles[triangle as usize] {
                let normal = &mut mesh.normals[vertex as usize];
                if normal.dot(front) < 0.0 && turned_normals.insert((number, vertex)) {
                    *normal = -*normal;
                }
            }
        }
    }
    names
}

/// The most solids that lie in one another anywhere, as far as places just inside of their shells show, if it may be more than `few`; and
/// a mesh that has so many around it.
pub(crate) fn most_nested(scene: &Scene, few: usize, corners_of: impl Fn(u32, u32) -> [DVec3; 3]) -> Option<(usize, u32)> {
    let shells: Vec<Shell> = shells(scene, corners_of).into_values().flatten().collect();
    let mut order: Vec<&Shell> = shells.iter().collect();
    order.sort_by(|a, b| a.min.x.total_cmp(&b.min.x));
    let mut most: Option<(usize, u32)> = None;
    for (place, shell) in order.iter().enumerate() {
        // Along one axis, those that begin before this one does and those that begin before it ends.
        let after = order[place + 1..].iter().take_while(|other| other.min.x <= shell.max.x);
        let near: Vec<&Shell> = order[..place].iter().chain(after).copied().filter(|other| shell.meets(other)).collect();
        if near.len() < few {
            continue;
        }
        for (triangle, inside) in shell.places_inside(PLACES) {
            // Its own side is known, whatever rounding says.
            let depth = 1 + near.iter().map(|other| other.winding(inside)).sum::<i32>().max(0) as usize;
            if depth > few && most.is_none_or(|(known, _)| depth > known) {
                most = Some((depth, shell.triangles[triangle].0));
            }
        }
    }
    most
}

/// Which of the solids that a place is in counts there.
pub(crate) enum Order {
    /// The one entered last: each holds the other or lies outside of it, or their media are the same.
    Entry,
    /// Solids lie partly in one another, and who is in both may have entered either last: the smaller one counts. Materials, the largest
    /// first, each as large as the smallest solid of its medium.
    Size(Vec<usize>),
    /// They do, but size would hide this mesh in the solid around it, as smaller solids of that medium lie elsewhere.
    Unclear(u32),
}

/// What makes solids' media different: index of refraction, its spread over colours, and what is absorbed.
pub(crate) fn medium(material: &Material) -> Option<(f32, f32, Medium)> {
    material.enclosed_medium().map(|medium| (material.layers.ior, material.layers.ior_spread(), medium))
}

/// As far as places just inside of their shells show.
pub(crate) fn order(scene: &Scene) -> Order {
    let medium = |material: usize| medium(&scene.materials[material]);
    let mut media = scene.meshes.iter().filter_map(|mesh| medium(mesh.material));
    let Some(first) = media.next() else { return Order::Entry };
    if media.all(|other| other == first) {
        return Order::Entry;
    }
    let by_material = shells(scene, |mesh, triangle| scene.meshes[mesh as usize].corners(triangle as usize));
    let mut shells: Vec<(usize, &Shell)> =
        by_material.iter().flat_map(|(material, shells)| shells.iter().map(|shell| (*material, shell))).collect();
    shells.sort_by(|a, b| a.1.min.x.total_cmp(&b.1.min.x));
    let are_alike = |a: usize, b: usize| medium(a) == medium(b);
    let mut partly: BTreeSet<(usize, usize)> = BTreeSet::new();
    let mut near: Vec<(usize, usize)> = Vec::new();
    for (place, (one, a)) in shells.iter().enumerate() {
        let after = shells.iter().enumerate().skip(place + 1).take_while(|(_, (_, b))| b.min.x <= a.max.x);
        for (other_place, (_, b)) in after.filter(|(_, (other, b))| a.meets(b) && !are_alike(*one, *other)) {
            near.extend([(place, other_place), (other_place, place)]);
            if a.is_partly_in(b) || b.is_partly_in(a) {
                partly.extend([(place, other_place), (other_place, place)]);
            }
        }
    }
    if partly.is_empty() {
        return Order::Entry;
    }
    let least = |material: &usize| {
        let of_medium = by_material.iter().filter(|(other, _)| are_alike(**other, *material)).flat_map(|(_, shells)| shells);
        of_medium.map(Shell::volume).filter(|volume| *volume > 0.0).fold(f64::INFINITY, f64::min)
    };
    let mut order: Vec<(f64, usize)> = by_material.keys().map(|material| (least(material), *material)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let size = |material: usize| order.iter().find(|(_, known)| *known == material).map_or(0.0, |(size, _)| *size);
    // What lies wholly in another solid, and not in a hollow of it, must count there.
    let is_hidden = |&(place, around): &(usize, usize)| {
        let ((own, shell), (other, _)) = (shells[place], shells[around]);
        let (_, inside) = shell.places_inside(1).next().expect("a shell has a triangle");
        let times_around = || by_material[&other].iter().map(|shell| shell.winding(inside)).sum::<i32>();
        shell.volume() > 0.0 && size(other) < size(own) && !partly.contains(&(place, around)) && times_around() > 0
    };
    match near.iter().find(|pair| is_hidden(pair)) {
        Some((place, _)) => Order::Unclear(shells[*place].1.triangles[0].0),
        None => Order::Size(order.into_iter().map(|(_, material)| material).collect()),
    }
}
