//! A scene as a glTF 2.0 document and its binary part, with lightmap coordinates.

use std::collections::BTreeSet;

use glam::{DVec2, DVec3, DVec4, Vec3};
use gltf::json::texture::{CLAMP_TO_EDGE, LINEAR};
use serde_json::{Map, Value, json};

use super::names::{GEOMETRY, Names, texture_name};
use super::{Layout, MeshLightmap};
use crate::scene::gltf::writer::{Writer, sampler};
use crate::scene::layers::{Layers, TextureUse, UvTransform};
use crate::scene::material::Coverage;
use crate::scene::{Material, Mesh, Scene, bounds_of};

/// How a document shows the baked light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Black materials that emit the radiance that leaves them.
    Radiance,
    /// The scene's materials with MOZ_lightmap.
    Lightmap,
}

/// The set of coordinates that lightmaps are looked up with.
const LIGHTMAP_SET: usize = 1;

/// Tangents that are nearer to one another are rounded.
const MAX_TANGENT_DIFFERENCE: f64 = 1e-5;

/// The meshes of a scene: what both documents share.
#[derive(Default)]
pub(crate) struct Geometry {
    /// Accessors and what they lead to.
    pub file: Writer,
    /// Attributes and indices, one a mesh.
    primitives: Vec<Value>,
    /// Places of the meshes' nodes, so that 32-bit positions are fine far from the origin as well.
    translations: Vec<Vec3>,
    /// For each mesh the number of the TEXCOORD that holds each of its sets.
    uv_sets: Vec<[usize; 2]>,
}

impl Geometry {
    pub(super) fn new(scene: &Scene, layout: &Layout) -> Geometry {
        let mut geometry = Geometry::default();
        for (mesh, lightmap) in scene.meshes.iter().zip(&layout.meshes) {
            geometry.add(lightmap.as_ref().map_or(mesh, |lightmap| &lightmap.mesh), lightmap.as_ref(), &scene.materials[mesh.material]);
        }
        geometry
    }

    fn add(&mut self, mesh: &Mesh, lightmap: Option<&MeshLightmap>, material: &Material) {
        let (low, high) = bounds_of(mesh.positions.iter().copied());
        let translation = (0.5 * (low + high)).as_vec3();
        let positions: Vec<Vec3> = mesh.positions.iter().map(|position| (*position - translation.as_dvec3()).as_vec3()).collect();
        let (low, high) = positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
        let mut attributes = Map::new();
        let mut add = |name: &str, accessor: usize| drop(attributes.insert(name.to_owned(), json!(accessor)));
        let position = self.file.vectors(positions.iter().map(Vec3::to_array));
        self.file.json["accessors"][position]["min"] = json!(low.to_array());
        self.file.json["accessors"][position]["max"] = json!(high.to_array());
        add("POSITION", position);
        if !mesh.normals.is_empty() {
            // Vertices that no triangle uses may have a normal of no length, which glTF forbids.
            let normals = mesh.normals.iter().map(|normal| normal.normalize_or(DVec3::Y).as_vec3().to_array());
            add("NORMAL", self.file.vectors(normals));
        }
        if let Some(tangents) = vertex_tangents(mesh) {
            add("TANGENT", self.file.vectors(tangents.iter().map(|tangent| tangent.as_vec4().to_array())));
        }
        let colour = |vertex: usize| mesh.colours.get(vertex).copied().unwrap_or(DVec3::ONE).as_vec3();
        let vertices = 0..mesh.positions.len();
        if !mesh.alphas.is_empty() {
            add("COLOR_0", self.file.vectors(vertices.map(|vertex| colour(vertex).extend(mesh.alphas[vertex] as f32).to_array())));
        } else if !mesh.colours.is_empty() {
            add("COLOR_0", self.file.vectors(vertices.map(|vertex| colour(vertex).to_array())));
        }
        let (sets, uv_sets) = texture_coordinates(mesh, lightmap, material);
        for (set, uvs) in sets.into_iter().enumerate() {
            add(&format!("TEXCOORD_{set}"), self.file.vectors(uvs.iter().map(|uv| uv.as_vec2().to_array())));
        }
        let indices = self.file.triangles(&mesh.triangles, false);
        self.primitives.push(json!({"attributes": attributes, "indices": indices}));
        self.translations.push(translation);
        self.uv_sets.push(uv_sets);
    }
}

/// Tangents as glTF has them, one per vertex; `None` where corners that meet at a vertex have several: they are computed again
/// where the file is read.
fn vertex_tangents(mesh: &Mesh) -> Option<Vec<DVec4>> {
    let of_corners = if mesh.tangents.is_empty() { &mesh.coat_tangents } else { &mesh.tangents };
    // Without normals glTF ignores them.
    if of_corners.is_empty() || mesh.normals.is_empty() {
        return None;
    }
    let mut tangents: Vec<Option<DVec4>> = vec![None; mesh.positions.len()];
    for (vertex, tangent) in mesh.triangles.iter().flatten().zip(of_corners.as_flattened()) {
        let known = tangents[*vertex as usize].get_or_insert(*tangent);
        if known.distance(*tangent) > MAX_TANGENT_DIFFERENCE {
            return None;
        }
    }
    Some(tangents.into_iter().map(|tangent| tangent.unwrap_or(DVec4::new(1.0, 0.0, 0.0, 1.0))).collect())
}

/// Coordinates to be written as TEXCOORD_0, _1 and so on, without a gap as glTF wants it, and where
/// the mesh's own two sets went.
fn texture_coordinates(mesh: &Mesh, lightmap: Option<&MeshLightmap>, material: &Material) -> (Vec<Vec<DVec2>>, [usize; 2]) {
    let is_used = |set: usize| material.textures().any(|used| used.uv_set == set);
    // A texture that has no coordinates is looked up at the origin.
    let own = |set: usize| match mesh.uvs[set].is_empty() {
        true => vec![DVec2::ZERO; mesh.positions.len()],
        false => mesh.uvs[set].clone(),
    };
    let Some(lightmap) = lightmap else {
        let count = (0..2).filter(|set| is_used(*set) || !mesh.uvs[*set].is_empty()).max().map_or(0, |last| last + 1);
        return ((0..count).map(own).collect(), [0, 1]);
    };
    let first = if is_used(1) && !is_used(0) { 1 } else { 0 };
    let base = if is_used(first) || !mesh.uvs[first].is_empty() { own(first) } else { lightmap.uvs.clone() };
    let mut sets = vec![base, lightmap.uvs.clone()];
    let mut places = [0, 0];
    if is_used(0) && is_used(1) {
        places[1] = if lightmap.is_second_set { LIGHTMAP_SET } else { 2 };
        if !lightmap.is_second_set {
            sets.push(own(1));
        }
    }
    (sets, places)
}

/// Indices of the textures that a material of a mesh uses.
pub(crate) fn textures_used(scene: &Scene) -> Vec<usize> {
    let textures = scene.meshes.iter().flat_map(|mesh| scene.materials[mesh.material].textures());
    let used: BTreeSet<usize> = textures.map(|used| used.texture).collect();
    used.into_iter().collect()
}

/// No highlights on top of the baked light either. Alpha is as it was.
fn black(material: &Material) -> Material {
    let Material { coverage, two_sided, .. } = *material;
    let base_colour_texture = material.base_colour_texture.filter(|_| coverage != Coverage::Whole);
    let layers = Layers { metallic: 0.0, specular: 0.0, ..Layers::default() };
    Material { base_colour_texture, coverage, two_sided, ..Material::layered(&material.name, Vec3::ZERO, layers) }
}

/// A document of the scene. `intensity` is by how much the texels of a mesh's linear lightmap are to be
/// multiplied.
pub(crate) fn document(
    scene: &Scene,
    layout: &Layout,
    geometry: &Geometry,
    names: &Names,
    kind: Kind,
    intensity: impl Fn(usize) -> f32,
) -> Value {
    let mut document = Writer { json: geometry.file.json.clone(), ..Writer::default() };
    document.json["asset"] = json!({"version": "2.0", "generator": concat!("photonmill ", env!("CARGO_PKG_VERSION"))});
    let used = textures_used(scene);
    for index in &used {
        document.texture(texture_name(*index), sampler(&scene.textures[*index]));
    }
    // Not mipmapped: smaller levels would mix charts.
    let of_charts = || json!({"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE});
    for (index, mesh) in scene.meshes.iter().enumerate() {
        let material = &scene.materials[mesh.material];
        if material.textures().any(|used| used.transform != UvTransform::NONE) {
            document.use_extension("KHR_texture_transform");
        }
        // Textures are numbered anew, without those that nothing uses.
        let place = |of: TextureUse| {
            let texture = used.binary_search(&of.texture).expect("the material's mesh uses the texture");
            (texture, geometry.uv_sets[index][of.uv_set])
        };
        let value = match (&layout.meshes[index], kind) {
            (None, _) => document.material(material, place),
            (Some(_), Kind::Radiance) => {
                let texture = document.texture(names.radiance(index), of_charts());
                let mut value = document.material(&black(material), place);
                value["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
                value["emissiveTexture"] = json!({"index": texture, "texCoord": LIGHTMAP_SET});
                value
            }
            (Some(_), Kind::Lightmap) => {
                let mut value = document.material(material, place);
                let texture = document.texture(names.lightmap(index), of_charts());
                document.use_extension("MOZ_lightmap");
                value["extensions"]["MOZ_lightmap"] = json!({"index": texture, "texCoord": LIGHTMAP_SET, "intensity": intensity(index)});
                value
            }
        };
        let mut primitive = geometry.primitives[index].clone();
        primitive["material"] = json!(document.push("materials", value));
        document.push("meshes", json!({"name": mesh.name, "primitives": [primitive]}));
        document.push("nodes", json!({"name": mesh.name, "mesh": index, "translation": geometry.translations[index].to_array()}));
    }
    let (low, high) = scene.bounds();
    let near = ((high - low).max_element() * 1e-3).clamp(1e-6, 0.1);
    scene.cameras.iter().for_each(|camera| document.camera(camera, near));
    if kind == Kind::Radiance {
        scene.lights.iter().for_each(|light| document.light(light));
    }
    let mut json = document.json;
    let node_count = json["nodes"].as_array().map_or(0, Vec::len);
    json["scene"] = json!(0);
    json["scenes"] = json!([{"name": scene.name, "nodes": (0..node_count).collect::<Vec<_>>()}]);
    json["buffers"] = json!([{"uri": GEOMETRY, "byteLength": geometry.file.bytes.len()}]);
    json
}
