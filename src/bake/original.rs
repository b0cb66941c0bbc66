//! The user's own file with lightmap coordinates: its JSON and its buffers, to which is only added.
//!
//! - New coordinates become the next set of each primitive, TEXCOORD_1 where it has one set or none. Where the charts' seams
//!   double vertices, all attributes of the primitive and of its morph targets are written again with these vertices, in the types
//!   that they have; the old ones stay in their buffers.
//! - A mesh that several nodes have keeps its one entry where they are alike in shape. Where they are not, as coordinates of a cube
//!   do not suit a wall, it gets another entry for the others.
//! - Every node with a lightmap has in its `extras`, as [`KEY`], the picture, the set and what takes the set to the picture.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::DVec2;
use gltf::accessor::DataType;
use gltf::json::buffer::ARRAY_BUFFER;
use gltf::json::mesh::TRIANGLES;
use gltf::json::validation::Checked;
use gltf::mesh::Mode;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::pages::Pages;
use super::{Layout, MeshLightmap};
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::scene::gltf::meshes::triangles_of;
use crate::scene::gltf::source::{Elements, File, binary_file};
use crate::scene::gltf::writer::Writer;
use crate::scene::mesh::Source;
use crate::text::some_of;

/// The member of a node's `extras` that says which lightmap it has.
pub(crate) const KEY: &str = "photonmill_lightmap";

/// Primitives that use less of their vertices than that, as many may share one list, get a list of their own.
const LEAST_USED: f64 = 0.5;

/// A file with lightmap coordinates.
pub(crate) struct Extended {
    pub json: Value,
    /// What is added to the binary part of a `.glb` file, or what a file beside it holds.
    pub bytes: Vec<u8>,
    pub warnings: Vec<String>,
}

/// Adds coordinates and what nodes say of their lightmaps. `pictures` and `errors` are files' names, one a page.
pub(crate) fn extended(
    file: &File,
    scene: &Scene,
    layout: &Layout,
    pages: &Pages,
    pictures: &[String],
    errors: &[String],
) -> Result<Extended> {
    let buffer = new_buffer(file);
    let own_part = file.binary.as_ref().filter(|_| file.is_binary && buffer == 0);
    let start = own_part.map_or(0, |binary| binary.len().next_multiple_of(4));
    let mut added = Added { file, to: Writer { json: file.json.clone(), bytes: Vec::new(), buffer, start }, warnings: BTreeSet::new() };
    // The mesh and the set that objects with new coordinates have.
    let mut made: HashMap<usize, (usize, usize)> = HashMap::new();
    let mut changed = BTreeSet::new();
    let source = |object: usize| scene.meshes[layout.objects[object].meshes[0]].source.as_ref().expect("the scene is from the file");
    for (index, object) in layout.objects.iter().enumerate().filter(|(index, object)| object.set.is_none() && object.charts_of == *index) {
        let mesh = source(index).mesh;
        let set = next_set(&file.json, mesh, object.meshes.iter().map(|mesh| &scene.meshes[*mesh].source));
        let place = if changed.insert(mesh) { mesh } else { added.to.push("meshes", file.json["meshes"][mesh].clone()) };
        for own in &object.meshes {
            let lightmap = layout.part(*own);
            let source = scene.meshes[*own].source.as_ref().expect("the scene is from the file");
            added.extend_primitive(place, source, &scene.meshes[*own].triangles, lightmap, set)?;
        }
        made.insert(index, (place, set));
    }
    let mut of_nodes: BTreeMap<usize, Vec<Value>> = BTreeMap::new();
    let mut beyond_second = Vec::new();
    for (index, object) in layout.objects.iter().enumerate() {
        let node = source(index).node;
        let set = object.set.unwrap_or_else(|| {
            let (mesh, set) = made[&object.charts_of];
            if added.to.json["nodes"][node]["mesh"] != mesh {
                added.to.json["nodes"][node]["mesh"] = json!(mesh);
            }
            set
        });
        if set > 1 {
            beyond_second.push(format!("'{}'", object.name));
        }
        let (offset, scale) = pages.transform(layout, index);
        let page = pages.places[index].page;
        of_nodes.entry(node).or_default().push(json!({
            "irradiance": pictures[page], "error": errors[page], "unit": "W/m2",
            "texCoord": set, "offset": offset.to_array(), "scale": scale.to_array(),
        }));
    }
    if !beyond_second.is_empty() {
        let names = some_of(beyond_second.iter());
        added.warnings.insert(format!("the lightmap coordinates of {names} are no second UV set (TEXCOORD_1), the only one that many engines take for lightmaps; remove the second set from the file and bake again to get one"));
    }
    for (node, mut lightmaps) in of_nodes {
        let json = &mut added.to.json["nodes"][node];
        if json.get("extras").is_none() {
            json["extras"] = json!({});
        }
        // Instances that one node has are a list.
        let value = if lightmaps.len() == 1 { lightmaps.remove(0) } else { lightmaps.into() };
        match json["extras"].as_object_mut() {
            Some(extras) => drop(extras.insert(KEY.into(), value)),
            None => {
                let name = json["name"].as_str().unwrap_or_default();
                added.warnings.insert(format!("node {node} '{name}' has extras that are no object: it cannot name its lightmap"));
            }
        }
    }
    Ok(added.finish())
}

/// Names and contents: the file, and before it the added buffer where that has no place in the file's binary part.
pub(crate) fn files(file: &File, extended: &Extended, name: &str, buffer_name: &str) -> Vec<(String, Vec<u8>)> {
    let mut json = extended.json.clone();
    let mut binary = file.binary.clone().unwrap_or_default();
    let mut beside = None;
    if file.is_binary && new_buffer(file) == 0 {
        binary.resize(binary.len().next_multiple_of(4), 0);
        binary.extend(&extended.bytes);
    } else if !extended.bytes.is_empty() {
        json["buffers"][new_buffer(file)]["uri"] = json!(buffer_name);
        beside = Some((buffer_name.to_owned(), extended.bytes.clone()));
    }
    let content = match file.is_binary {
        true => binary_file(&json, &binary, &file.other_chunks),
        false => serde_json::to_vec_pretty(&json).expect("a document is plain data"),
    };
    beside.into_iter().chain([(name.to_owned(), content)]).collect()
}

/// The buffer that takes what is added: the binary part, or one more.
fn new_buffer(file: &File) -> usize {
    let buffers = file.json["buffers"].as_array().map_or(0, Vec::len);
    let has_free_part = file.is_binary && file.json["buffers"][0].get("uri").is_none();
    if has_free_part { 0 } else { buffers }
}

/// The first set that none of the primitives has.
fn next_set<'a>(json: &Value, mesh: usize, sources: impl Iterator<Item = &'a Option<Source>>) -> usize {
    let own = |primitive: usize| {
        let attributes = &json["meshes"][mesh]["primitives"][primitive]["attributes"];
        (0..).find(|set| attributes.get(format!("TEXCOORD_{set}")).is_none()).unwrap_or(0)
    };
    sources.flatten().map(|source| own(source.primitive)).max().unwrap_or(0).max(1)
}

/// What is being added to a file.
struct Added<'a> {
    file: &'a File,
    to: Writer,
    warnings: BTreeSet<String>,
}

impl Added<'_> {
    fn refuse(&self, what: &str, reason: &str) -> Error {
        Error::Scene { path: self.file.path.clone(), object: what.to_owned(), reason: reason.to_owned() }
    }

    fn coordinates(&mut self, uvs: &[DVec2]) -> usize {
        self.to.vectors(uvs.iter().map(|uv| uv.as_vec2().to_array()))
    }

    /// An accessor of the same numbers for other vertices.
    fn gathered(&mut self, accessor: usize, vertices: &[u32], what: &str) -> Result<usize> {
        let all = self.file.elements(accessor, what)?;
        if vertices.iter().any(|vertex| *vertex as usize >= all.count) {
            return Err(self.refuse(what, &format!("has the accessor {accessor} of {} elements, fewer than vertices", all.count)));
        }
        let bytes = vertices.iter().flat_map(|vertex| &all.bytes[*vertex as usize * all.size..][..all.size]).copied().collect();
        let gathered = Elements { bytes, count: vertices.len(), ..all };
        // Elements begin at multiples of four bytes.
        let stride = gathered.size.next_multiple_of(4);
        let filled = |element: &[u8]| [element, &[0; 4][..stride - gathered.size]].concat();
        let bytes: Vec<u8> = gathered.bytes.chunks_exact(gathered.size).flat_map(filled).collect();
        let view = self.to.view(&bytes, (stride != gathered.size).then_some(stride), Some(ARRAY_BUFFER));
        let mut json = self.file.json["accessors"][accessor].clone();
        let object = json.as_object_mut().expect("it was read");
        object.remove("sparse");
        object.remove("byteOffset");
        object.insert("bufferView".into(), json!(view));
        object.insert("count".into(), json!(vertices.len()));
        // Matrices have gaps between their numbers.
        let is_matrix = object.get("type").and_then(Value::as_str).is_some_and(|kind| kind.starts_with("MAT"));
        if object.contains_key("min") && object.contains_key("max") && !is_matrix {
            let range = |pick: fn(f64, f64) -> f64| -> Vec<Value> {
                let of = |component| (0..gathered.count).map(|element| gathered.number(element, component)).reduce(pick).unwrap_or(0.0);
                (0..gathered.components).map(|component| number(of(component), gathered.kind)).collect()
            };
            let (min, max) = (range(f64::min), range(f64::max));
            object.insert("min".into(), json!(min));
            object.insert("max".into(), json!(max));
        }
        Ok(self.to.push("accessors", json))
    }

    /// Gives a primitive of the mesh at `place` its coordinates. `triangles` are those of the scene's mesh.
    fn extend_primitive(
        &mut self,
        place: usize,
        source: &Source,
        triangles: &[[u32; 3]],
        lightmap: &MeshLightmap,
        set: usize,
    ) -> Result<()> {
        let what = format!("mesh '{}', primitive {}", lightmap.mesh.name, source.primitive);
        let mut primitive = self.to.json["meshes"][place]["primitives"][source.primitive].clone();
        let position = primitive["attributes"]["POSITION"].as_u64().ok_or_else(|| self.refuse(&what, "has no positions"))? as usize;
        let count = self.file.json["accessors"][position]["count"].as_u64().unwrap_or_default() as usize;
        for name in primitive["extensions"].as_object().into_iter().flat_map(Map::keys) {
            if name != "KHR_materials_variants" {
                self.warnings.insert(format!("{what} has the extension {name}, which stays as it was even if it numbers vertices"));
            }
        }
        let corners = self.corners(&primitive, count, &what)?;
        let Some(split) = split(&corners, source, triangles, lightmap, count) else {
            return Err(self.refuse(&what, "has other triangles than the scene that was read"));
        };
        let coordinates = self.coordinates(&split.uvs);
        if let Some(vertices) = &split.vertices {
            let mut known = HashMap::new();
            let mut gather = |added: &mut Self, attributes: &mut Value| -> Result<()> {
                for value in attributes.as_object_mut().into_iter().flat_map(Map::values_mut) {
                    let Some(accessor) = value.as_u64().map(|accessor| accessor as usize) else { continue };
                    let gathered = match known.get(&accessor) {
                        Some(gathered) => *gathered,
                        None => added.gathered(accessor, vertices, &what)?,
                    };
                    known.insert(accessor, gathered);
                    *value = json!(gathered);
                }
                Ok(())
            };
            gather(self, &mut primitive["attributes"])?;
            if let Some(targets) = primitive.get_mut("targets").and_then(Value::as_array_mut) {
                targets.iter_mut().try_for_each(|target| gather(self, target))?;
            }
            let is_short = vertices.len() < usize::from(u16::MAX);
            primitive["indices"] = json!(self.to.triangles(&split.triangles, is_short));
            if primitive["mode"].as_u64().is_some_and(|mode| mode != u64::from(TRIANGLES)) {
                primitive["mode"] = json!(TRIANGLES);
            }
        }
        // Sets are numbered without a gap. A set that is missing is that of textures, which see its origin.
        for missing in 0..set {
            let name = format!("TEXCOORD_{missing}");
            if primitive["attributes"].get(&name).is_none() {
                let origin = vec![DVec2::ZERO; split.uvs.len()];
                let has_textures = self.file.json["materials"][primitive["material"].as_u64().unwrap_or(u64::MAX) as usize]
                    .to_string()
                    .contains("Texture");
                primitive["attributes"][name] = json!(if has_textures { self.coordinates(&origin) } else { coordinates });
            }
        }
        primitive["attributes"][format!("TEXCOORD_{set}")] = json!(coordinates);
        self.to.json["meshes"][place]["primitives"][source.primitive] = primitive;
        Ok(())
    }

    /// Vertices of a primitive's triangles.
    fn corners(&self, primitive: &Value, count: usize, what: &str) -> Result<Vec<[u32; 3]>> {
        let indices: Vec<u32> = match primitive["indices"].as_u64() {
            Some(accessor) => {
                let elements = self.file.elements(accessor as usize, what)?;
                (0..elements.count).map(|k| elements.number(k, 0) as u32).collect()
            }
            None => (0..count as u32).collect(),
        };
        let mode = Checked::deserialize(&primitive["mode"]).unwrap_or(Checked::Valid(Mode::Triangles));
        Ok(triangles_of(if let Checked::Valid(mode) = mode { mode } else { Mode::Triangles }, &indices))
    }

    fn finish(mut self) -> Extended {
        if !self.to.bytes.is_empty() {
            if self.to.json["buffers"].get(self.to.buffer).is_none() {
                self.to.push("buffers", json!({}));
            }
            self.to.json["buffers"][self.to.buffer]["byteLength"] = json!(self.to.start + self.to.bytes.len());
        }
        Extended { json: self.to.json, bytes: self.to.bytes, warnings: self.warnings.into_iter().collect() }
    }
}

/// A number as JSON, whole where the accessor's are.
fn number(value: f64, kind: DataType) -> Value {
    if kind == DataType::F32 { json!(value) } else { json!(value as i64) }
}

/// Coordinates for the vertices of a primitive.
struct Split {
    /// One a vertex.
    uvs: Vec<DVec2>,
    /// Which vertex of the primitive each was; `None` where they are what they were.
    vertices: Option<Vec<u32>>,
    triangles: Vec<[u32; 3]>,
}

/// `corners`: the file's triangles. `triangles`: the scene's mesh, which lacks those without area. `None` if they do not belong together.
fn split(corners: &[[u32; 3]], source: &Source, triangles: &[[u32; 3]], lightmap: &MeshLightmap, count: usize) -> Option<Split> {
    let mut used: Vec<u32> = corners.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    let is_shared = (used.len() as f64) < LEAST_USED * count as f64;
    let mut vertices: Vec<u32> = if is_shared { used } else { (0..count as u32).collect() };
    let kept = vertices.len();
    let place_of: HashMap<u32, u32> =
        if is_shared { vertices.iter().zip(0..).map(|(vertex, place)| (*vertex, place)).collect() } else { HashMap::new() };
    let place = |vertex: u32| if is_shared { place_of.get(&vertex).copied() } else { Some(vertex) };
    // The vertex of the lightmap's mesh that each is.
    let mut owner: Vec<Option<u32>> = vec![None; kept];
    let mut doubled: HashMap<u32, u32> = HashMap::new();
    let mut of_scene = triangles.iter().zip(&lightmap.mesh.triangles).peekable();
    let mut result = Vec::with_capacity(corners.len());
    for corners in corners {
        let mut triangle = [place(corners[0])?, place(corners[1])?, place(corners[2])?];
        let orders = [[0, 1, 2], [0, 2, 1]];
        let own = of_scene.peek().and_then(|(scene, charted)| {
            let order = orders.iter().find(|order| (0..3).all(|k| source.vertex(scene[order[k]]) == corners[k]))?;
            Some(order.map(|k| charted[k]))
        });
        if let Some(own) = own {
            of_scene.next();
            for (place, own) in triangle.iter_mut().zip(own) {
                let first = &mut owner[*place as usize];
                if *first.get_or_insert(own) != own {
                    let vertex = vertices[*place as usize];
                    *place = *doubled.entry(own).or_insert_with(|| {
                        vertices.push(vertex);
                        owner.push(Some(own));
                        vertices.len() as u32 - 1
                    });
                }
            }
        }
        result.push(triangle);
    }
    if of_scene.next().is_some() {
        return None;
    }
    let uvs = owner.iter().map(|own| own.map_or(DVec2::ZERO, |own| lightmap.uvs[own as usize])).collect();
    let is_as_it_was = !is_shared && vertices.len() == kept;
    Some(Split { uvs, vertices: (!is_as_it_was).then_some(vertices), triangles: result })
}
