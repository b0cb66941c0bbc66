//! Which meshes of a scene share a map, and which objects share their coordinates.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec2;
use rayon::prelude::*;

use super::part::Part;
use super::unwrap;
use super::{MIN_SIDE, MeshLightmap, Object, gutters, texels};
use crate::error::{Error, Result};
use crate::scene::gltf::source::File;
use crate::scene::{Mesh, Scene};

/// An object with coordinates.
pub(crate) struct Unwrapped {
    pub name: String,
    pub meshes: Vec<usize>,
    pub charts: unwrap::Unwrapped,
    pub charts_of: usize,
}

/// Instances whose edges differ in length by more than this factor, beyond their difference in size, get coordinates of their own.
const ALIKE: f64 = 1.1;
/// Instances that are larger by more than this factor get coordinates of their own: free texels around charts grow with the map.
const LARGEST: f64 = 4.0;

/// Objects with their maps' coordinates, in the order of the scene.
pub(crate) fn unwrap(scene: &Scene, file: Option<&File>, texels_per_metre: f64, max_side: u32) -> Result<Vec<Unwrapped>> {
    let objects = objects(scene);
    let parts = |object: usize| -> Vec<&Mesh> { objects[object].iter().map(|mesh| &scene.meshes[*mesh]).collect() };
    let refuse = |object: usize, reason: String| Error::Scene {
        path: scene.name.clone().into(),
        object: format!("mesh '{}'", parts(object)[0].name),
        reason,
    };
    let one = |object: usize, sets: &[_]| {
        unwrap::unwrap(&parts(object), sets, texels_per_metre, max_side).map_err(|reason| refuse(object, reason))
    };
    let alone = |object: usize| one(object, &own_sets(&parts(object), file)?);
    // Instances of one mesh, whose numbers are of the file.
    let mut groups: BTreeMap<(Option<usize>, usize), Vec<usize>> = BTreeMap::new();
    for object in 0..objects.len() {
        let source = &parts(object)[0].source;
        groups.entry(source.as_ref().map_or((None, object), |source| (Some(source.mesh), 0))).or_default().push(object);
    }
    let groups: Vec<Vec<usize>> = groups.into_values().collect();
    let unwrap_group = |group: &Vec<usize>| -> Result<Vec<(usize, usize, unwrap::Unwrapped)>> {
        let mut by_size: Vec<(f64, usize)> = group.iter().map(|object| (area(&parts(*object)), *object)).collect();
        // The smallest is first, so that no other has fewer free texels around its charts.
        by_size.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let node = |object: usize| parts(object)[0].source.as_ref().map(|source| source.node);
        let mut made: Vec<(usize, usize, unwrap::Unwrapped)> = Vec::new();
        for (own_area, object) in by_size {
            let own = parts(object);
            let shared = made.iter().filter(|(other, charts_of, _)| other == charts_of).find_map(|(other, _, charts)| {
                if charts.set.is_some() {
                    return None;
                }
                let others = parts(*other);
                // Instances of one node have its mesh, whatever their shapes.
                let is_alike = node(*other) == node(object) || are_alike(&others, &own);
                let turned = same_triangles(&others, &own).filter(|_| is_alike)?;
                Some((*other, charts.of_instance(turned, (own_area / area(&others)).sqrt(), max_side)))
            });
            made.push(match shared {
                Some((other, charts)) => (object, other, charts),
                None => (object, object, alone(object)?),
            });
        }
        Ok(made)
    };
    let made: Vec<Vec<(usize, usize, unwrap::Unwrapped)>> = groups.par_iter().map(unwrap_group).collect::<Result<_>>()?;
    let mut made = made.into_iter().flatten().collect::<Vec<_>>();
    made.sort_by_key(|(object, ..)| *object);
    let object = |(object, charts_of, charts): (usize, usize, unwrap::Unwrapped)| Unwrapped {
        name: parts(object)[0].name.clone(),
        meshes: objects[object].clone(),
        charts,
        charts_of,
    };
    Ok(made.into_iter().map(object).collect())
}

/// Meshes that get a lightmap, those of one node together.
fn objects(scene: &Scene) -> Vec<Vec<usize>> {
    let kinds = scene.lobe_kinds();
    let mut objects: Vec<Vec<usize>> = Vec::new();
    // Node and primitives of the last object.
    let mut last: Option<(usize, BTreeSet<usize>)> = None;
    for (index, mesh) in scene.meshes.iter().enumerate().filter(|(_, mesh)| kinds[mesh.material].rough) {
        // A primitive that comes again is of another instance.
        let is_of_last = match (&mesh.source, &mut last) {
            (Some(source), Some((node, primitives))) => source.node == *node && primitives.insert(source.primitive),
            _ => false,
        };
        if is_of_last {
            objects.last_mut().expect("there is a last object").push(index);
        } else {
            objects.push(vec![index]);
            last = mesh.source.as_ref().map(|source| (source.node, BTreeSet::from([source.primitive])));
        }
    }
    objects
}

/// Sets of coordinates from the second on that all meshes of an object have.
fn own_sets(meshes: &[&Mesh], file: Option<&File>) -> Result<Vec<(usize, Vec<Vec<DVec2>>)>> {
    let mut sets = Vec::new();
    if meshes.iter().all(|mesh| !mesh.uvs[1].is_empty()) {
        sets.push((1, meshes.iter().map(|mesh| mesh.uvs[1].clone()).collect()));
        for set in 2.. {
            let of_file = |mesh: &&Mesh| file.map_or(Ok(None), |file| coordinates(file, mesh, set));
            let Some(of_meshes) = meshes.iter().map(of_file).collect::<Result<Option<Vec<_>>>>()? else { break };
            sets.push((set, of_meshes));
        }
    }
    Ok(sets)
}

/// A set that the file has for a mesh.
fn coordinates(file: &File, mesh: &Mesh, set: usize) -> Result<Option<Vec<DVec2>>> {
    let Some(source) = &mesh.source else { return Ok(None) };
    let json = &file.json["meshes"][source.mesh]["primitives"][source.primitive]["attributes"][format!("TEXCOORD_{set}")];
    let Some(accessor) = json.as_u64() else { return Ok(None) };
    let what = format!("mesh '{}', TEXCOORD_{set},", mesh.name);
    let elements = file.elements(accessor as usize, &what)?;
    let vertices: Vec<usize> = (0..mesh.positions.len() as u32).map(|vertex| source.vertex(vertex) as usize).collect();
    if elements.components != 2 || vertices.iter().any(|vertex| *vertex >= elements.count) {
        return Ok(None);
    }
    let largest = if file.json["accessors"][accessor as usize]["normalized"] == true { elements.largest() } else { 1.0 };
    let uv = |vertex: usize| DVec2::new(elements.number(vertex, 0), elements.number(vertex, 1)) / largest;
    Ok(Some(vertices.into_iter().map(uv).collect()))
}

fn area(meshes: &[&Mesh]) -> f64 {
    meshes.iter().map(|mesh| mesh.whole_area()).sum()
}

/// Whether two objects of the same triangles differ in size only, the second being the larger one.
fn are_alike(meshes: &[&Mesh], others: &[&Mesh]) -> bool {
    let edges = |mesh: &Mesh, triangle: usize| {
        let [a, b, c] = mesh.corners(triangle);
        [a.distance(b), b.distance(c), c.distance(a)]
    };
    let (mut low, mut high) = (f64::INFINITY, 0.0f64);
    for (mesh, other) in meshes.iter().zip(others) {
        if mesh.triangles.len() != other.triangles.len() || mesh.triangles.is_empty() {
            return false;
        }
        for triangle in 0..mesh.triangles.len() {
            // Mirrored, the same triangle may begin and turn otherwise; sorted, its edges are the same.
            let [mut one, mut two] = [edges(mesh, triangle), edges(other, triangle)];
            one.sort_by(f64::total_cmp);
            two.sort_by(f64::total_cmp);
            for (one, two) in one.into_iter().zip(two).filter(|(one, two)| *one > 0.0 || *two > 0.0) {
                (low, high) = (low.min(two / one), high.max(two / one));
            }
        }
    }
    high <= ALIKE * low && high <= LARGEST
}

/// Whether the second object's triangles are the first one's: `Some(false)`, or with another front: `Some(true)`.
fn same_triangles(meshes: &[&Mesh], others: &[&Mesh]) -> Option<bool> {
    let is_same = |is_turned: bool| {
        let turned = |[a, b, c]: [u32; 3]| if is_turned { [a, c, b] } else { [a, b, c] };
        let of_primitive = |mesh: &Mesh| mesh.source.as_ref().map(|source| (source.primitive, source.vertices.clone()));
        meshes.len() == others.len()
            && meshes.iter().zip(others).all(|(mesh, other)| {
                of_primitive(mesh) == of_primitive(other)
                    && mesh.triangles.len() == other.triangles.len()
                    && mesh.triangles.iter().zip(&other.triangles).all(|(one, two)| turned(*one) == *two)
            })
    };
    [false, true].into_iter().find(|is_turned| is_same(*is_turned))
}

impl unwrap::Unwrapped {
    /// The same charts for an instance larger by a factor. `is_turned`: its triangles have another front.
    fn of_instance(&self, is_turned: bool, factor: f64, max_side: u32) -> unwrap::Unwrapped {
        let sides = [self.width, self.height].map(|side| (f64::from(side) * factor).round().max(MIN_SIDE.into()));
        let too_long = (sides[0].max(sides[1]) / f64::from(max_side)).max(1.0);
        let [width, height] = sides.map(|side| ((side / too_long) as u32).max(MIN_SIDE));
        let turned = |[a, b, c]: [u32; 3]| if is_turned { [a, c, b] } else { [a, b, c] };
        let part = |part: &Part| Part { triangles: part.triangles.iter().map(|triangle| turned(*triangle)).collect(), ..part.clone() };
        let is_coarse = self.is_coarse || too_long > 1.0;
        unwrap::Unwrapped { parts: self.parts.iter().map(part).collect(), width, height, is_coarse, ..self.clone() }
    }
}

impl Unwrapped {
    /// With the texels that it covers.
    pub(super) fn with_texels(self, scene: &Scene) -> (Object, Vec<MeshLightmap>) {
        let Unwrapped { name, meshes, charts, charts_of } = self;
        let unwrap::Unwrapped { parts, width, height, set, offset, scale, .. } = charts;
        let lightmap = |(part, mesh): (Part, &usize)| {
            let mesh = part.of(&scene.meshes[*mesh]);
            let texels = texels::covered(&mesh, &part.uvs, width, height);
            MeshLightmap {
                mesh,
                uvs: part.uvs,
                is_second_set: set == Some(1) && scale == DVec2::ONE,
                width,
                height,
                texels,
                turned: Vec::new(),
            }
        };
        let lightmaps: Vec<MeshLightmap> = parts.into_iter().zip(&meshes).map(lightmap).collect();
        let covered = lightmaps.iter().flat_map(|lightmap| lightmap.texels.iter().map(|texel| (texel.x, texel.y)));
        let nearest = gutters::nearest(width, height, covered);
        (Object { name, meshes, width, height, set, offset, scale, charts_of, nearest }, lightmaps)
    }
}
