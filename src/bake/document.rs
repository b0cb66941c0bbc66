//! A scene as a glTF 2.0 document and its binary part, with lightmap coordinates.

use std::collections::BTreeSet;

use glam::{DMat3, DQuat, DVec2, DVec3, DVec4, Vec3};
use serde_json::{Map, Value, json};

use super::names::{GEOMETRY, Names};
use super::{Layout, MeshLightmap};
use crate::scene::layers::{Layers, METALLIC_ROUGHNESS, Medium, NormalMap, PARAMETERS, Parameter, TextureUse, UvTransform};
use crate::scene::light::{LUMENS_PER_WATT, LightKind};
use crate::scene::material::Coverage;
use crate::scene::texture::{Filter, Wrap};
use crate::scene::{Camera, Light, Material, Mesh, Projection, Scene, Surface};

/// How a document shows the baked light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Black materials that shine with the radiance that leaves them.
    Radiance,
    /// The scene's materials with MOZ_lightmap.
    Lightmap,
}

// Numbers of the glTF specification.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const NEAREST: u32 = 9728;
const LINEAR: u32 = 9729;
const CLAMP_TO_EDGE: u32 = 33071;
const MIRRORED_REPEAT: u32 = 33648;
const REPEAT: u32 = 10497;

/// The set of coordinates that lightmaps are looked up with.
const LIGHTMAP_SET: usize = 1;

/// Tangents that are nearer to one another are rounded.
const MAX_TANGENT_DIFFERENCE: f64 = 1e-5;

/// The meshes of a scene: what both documents share.
#[derive(Default)]
pub struct Geometry {
    pub bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    /// Attributes and indices, one a mesh.
    primitives: Vec<Value>,
    /// Places of the meshes' nodes, so that 32-bit positions are fine far from the origin as well.
    translations: Vec<Vec3>,
    /// For each mesh the number of the TEXCOORD that holds each of its sets.
    uv_sets: Vec<[usize; 2]>,
}

impl Geometry {
    pub fn new(scene: &Scene, layout: &Layout) -> Geometry {
        let mut geometry = Geometry::default();
        for (mesh, lightmap) in scene.meshes.iter().zip(&layout.meshes) {
            geometry.add(lightmap.as_ref().map_or(mesh, |lightmap| &lightmap.mesh), lightmap.as_ref(), &scene.materials[mesh.material]);
        }
        geometry
    }

    fn add(&mut self, mesh: &Mesh, lightmap: Option<&MeshLightmap>, material: &Material) {
        let (low, high) = mesh.positions.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
        let translation = (0.5 * (low + high)).as_vec3();
        let positions: Vec<Vec3> = mesh.positions.iter().map(|position| (*position - translation.as_dvec3()).as_vec3()).collect();
        let (low, high) = positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
        let mut attributes = Map::new();
        let position = self.floats("VEC3", positions.iter().flat_map(Vec3::to_array), mesh.positions.len());
        self.accessors[position]["min"] = json!(low.to_array());
        self.accessors[position]["max"] = json!(high.to_array());
        attributes.insert("POSITION".into(), json!(position));
        if !mesh.normals.is_empty() {
            // Vertices that no triangle uses may have a normal of no length, which glTF forbids.
            let normals = mesh.normals.iter().flat_map(|normal| normal.normalize_or(DVec3::Y).as_vec3().to_array());
            attributes.insert("NORMAL".into(), json!(self.floats("VEC3", normals, mesh.normals.len())));
        }
        if let Some(tangents) = vertex_tangents(mesh) {
            let floats = tangents.iter().flat_map(|tangent| tangent.as_vec4().to_array());
            attributes.insert("TANGENT".into(), json!(self.floats("VEC4", floats, tangents.len())));
        }
        let colour = |vertex: usize| mesh.colours.get(vertex).copied().unwrap_or(DVec3::ONE).as_vec3();
        let count = mesh.positions.len();
        if !mesh.alphas.is_empty() {
            let colours = (0..count).flat_map(|vertex| colour(vertex).extend(mesh.alphas[vertex] as f32).to_array());
            attributes.insert("COLOR_0".into(), json!(self.floats("VEC4", colours, count)));
        } else if !mesh.colours.is_empty() {
            let colours = (0..count).flat_map(|vertex| colour(vertex).to_array());
            attributes.insert("COLOR_0".into(), json!(self.floats("VEC3", colours, count)));
        }
        let (sets, uv_sets) = texture_coordinates(mesh, lightmap, material);
        for (set, uvs) in sets.into_iter().enumerate() {
            let floats = uvs.iter().flat_map(|uv| uv.as_vec2().to_array());
            attributes.insert(format!("TEXCOORD_{set}"), json!(self.floats("VEC2", floats, uvs.len())));
        }
        let indices: Vec<u8> = mesh.triangles.as_flattened().iter().flat_map(|index| index.to_le_bytes()).collect();
        let indices = self.accessor("SCALAR", UNSIGNED_INT, ELEMENT_ARRAY_BUFFER, &indices, 3 * mesh.triangles.len());
        self.primitives.push(json!({"attributes": attributes, "indices": indices}));
        self.translations.push(translation);
        self.uv_sets.push(uv_sets);
    }

    fn floats(&mut self, kind: &str, values: impl Iterator<Item = f32>, count: usize) -> usize {
        let bytes: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
        self.accessor(kind, FLOAT, ARRAY_BUFFER, &bytes, count)
    }

    /// Appends numbers of four bytes each, so that every view is aligned, and returns their accessor.
    fn accessor(&mut self, kind: &str, component: u32, target: u32, bytes: &[u8], count: usize) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target}));
        self.bytes.extend_from_slice(bytes);
        self.accessors.push(json!({"bufferView": self.views.len() - 1, "componentType": component, "count": count, "type": kind}));
        self.accessors.len() - 1
    }
}

/// Tangents as glTF has them, one a vertex; `None` where corners that meet at a vertex have several: they are computed again
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
pub fn textures_used(scene: &Scene) -> Vec<usize> {
    let textures = scene.meshes.iter().flat_map(|mesh| scene.materials[mesh.material].textures());
    let used: BTreeSet<usize> = textures.map(|used| used.texture).collect();
    used.into_iter().collect()
}

/// The document's parts that grow with materials, textures and nodes.
#[derive(Default)]
struct Document {
    materials: Vec<Value>,
    textures: Vec<Value>,
    images: Vec<Value>,
    samplers: Vec<Value>,
    nodes: Vec<Value>,
    extensions: BTreeSet<&'static str>,
}

/// A document of the scene. `intensity` is by how much the texels of a mesh's linear lightmap are to be
/// multiplied.
pub fn document(scene: &Scene, layout: &Layout, geometry: &Geometry, names: &Names, kind: Kind, intensity: impl Fn(usize) -> f32) -> Value {
    let mut document = Document::default();
    let used = textures_used(scene);
    for index in &used {
        let texture = &scene.textures[*index];
        let [wrap_s, wrap_t] = texture.wrap.map(|wrap| match wrap {
            Wrap::Repeat => REPEAT,
            Wrap::MirroredRepeat => MIRRORED_REPEAT,
            Wrap::Clamp => CLAMP_TO_EDGE,
        });
        let filter = match texture.filter {
            Filter::Bilinear => LINEAR,
            Filter::Nearest => NEAREST,
        };
        document.texture(names.texture(*index), json!({"magFilter": filter, "wrapS": wrap_s, "wrapT": wrap_t}));
    }
    // Not mipmapped: smaller levels would mix charts.
    let of_charts = || json!({"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE});
    // Textures are numbered anew, without those that nothing uses.
    let place = |texture: usize| used.binary_search(&texture).expect("the material's mesh uses the texture");

    let mut meshes = Vec::new();
    for (index, mesh) in scene.meshes.iter().enumerate() {
        let material = &scene.materials[mesh.material];
        let of_texture = |used: TextureUse| {
            let mut value = json!({"index": place(used.texture), "texCoord": geometry.uv_sets[index][used.uv_set]});
            let UvTransform { scale, rotation, offset } = used.transform;
            if used.transform != UvTransform::NONE {
                value["extensions"]["KHR_texture_transform"] =
                    json!({"scale": scale.to_array(), "rotation": rotation, "offset": offset.to_array()});
            }
            value
        };
        if material.textures().any(|used| used.transform != UvTransform::NONE) {
            document.extensions.insert("KHR_texture_transform");
        }
        let value = match (&layout.meshes[index], kind) {
            (None, _) => document.material(material, of_texture),
            (Some(_), Kind::Radiance) => {
                let texture = document.texture(names.radiance(index), of_charts());
                // No highlights on top of the baked light either. Alpha is as it was.
                let base_colour_texture = material.base_colour_texture.filter(|_| material.coverage != Coverage::Whole);
                let black = Material {
                    base_colour_texture,
                    coverage: material.coverage,
                    two_sided: material.two_sided,
                    ..Material::layered(&material.name, Vec3::ZERO, Layers { metallic: 0.0, specular: 0.0, ..Layers::default() })
                };
                let mut value = document.material(&black, of_texture);
                value["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
                value["emissiveTexture"] = json!({"index": texture, "texCoord": LIGHTMAP_SET});
                value
            }
            (Some(_), Kind::Lightmap) => {
                let mut value = document.material(material, of_texture);
                let texture = document.texture(names.lightmap(index), of_charts());
                document.extensions.insert("MOZ_lightmap");
                value["extensions"]["MOZ_lightmap"] = json!({"index": texture, "texCoord": LIGHTMAP_SET, "intensity": intensity(index)});
                value
            }
        };
        document.materials.push(value);
        let mut primitive = geometry.primitives[index].clone();
        primitive["material"] = json!(document.materials.len() - 1);
        meshes.push(json!({"name": mesh.name, "primitives": [primitive]}));
        document.nodes.push(json!({"name": mesh.name, "mesh": index, "translation": geometry.translations[index].to_array()}));
    }
    let (low, high) = scene.bounds();
    let near = ((high - low).max_element() * 1e-3).clamp(1e-6, 0.1);
    let cameras: Vec<Value> = scene.cameras.iter().enumerate().map(|(index, camera)| document.camera(index, camera, near)).collect();
    let mut lights = Vec::new();
    if kind == Kind::Radiance {
        for (mut node, light) in scene.lights.iter().filter_map(light_of) {
            node["extensions"] = json!({"KHR_lights_punctual": {"light": lights.len()}});
            document.nodes.push(node);
            lights.push(light);
        }
    }
    let mut value = json!({
        "asset": {"version": "2.0", "generator": concat!("photonmill ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"name": scene.name, "nodes": (0..document.nodes.len()).collect::<Vec<_>>()}],
        "nodes": document.nodes,
        "meshes": meshes,
        "materials": document.materials,
        "accessors": geometry.accessors,
        "bufferViews": geometry.views,
        "buffers": [{"uri": GEOMETRY, "byteLength": geometry.bytes.len()}],
    });
    if !lights.is_empty() {
        document.extensions.insert("KHR_lights_punctual");
        value["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    }
    // glTF forbids empty lists.
    let mut list = |name: &str, values: Vec<Value>| {
        if !values.is_empty() {
            value[name] = values.into();
        }
    };
    list("cameras", cameras);
    list("textures", document.textures);
    list("images", document.images);
    list("samplers", document.samplers);
    list("extensionsUsed", document.extensions.into_iter().map(Value::from).collect());
    value
}

impl Document {
    fn texture(&mut self, uri: String, sampler: Value) -> usize {
        let sampler = self.samplers.iter().position(|known| *known == sampler).unwrap_or_else(|| {
            self.samplers.push(sampler);
            self.samplers.len() - 1
        });
        self.images.push(json!({"uri": uri}));
        self.textures.push(json!({"source": self.images.len() - 1, "sampler": sampler}));
        self.textures.len() - 1
    }

    /// The material's own, or what is nearest to it among those of glTF.
    fn material(&mut self, material: &Material, of_texture: impl Fn(TextureUse) -> Value) -> Value {
        let Material { coverage, normal_map, base_colour, .. } = *material;
        let layers = layers(material);
        let (alpha, alpha_mode) = match coverage {
            Coverage::Whole => (1.0, "OPAQUE"),
            Coverage::Mask { alpha, .. } => (alpha, "MASK"),
            Coverage::Blend { alpha } => (alpha, "BLEND"),
        };
        let mut value = json!({
            "name": material.name,
            METALLIC_ROUGHNESS: {"baseColorFactor": base_colour.extend(alpha).to_array()},
            "alphaMode": alpha_mode,
            "doubleSided": material.two_sided,
        });
        if let Coverage::Mask { cutoff, .. } = coverage {
            value["alphaCutoff"] = json!(cutoff);
        }
        let of_normal_map = |map: NormalMap| {
            let mut value = of_texture(map.texture);
            value["scale"] = json!(map.scale);
            value
        };
        if let Some(used) = material.base_colour_texture {
            value[METALLIC_ROUGHNESS]["baseColorTexture"] = of_texture(used);
        }
        if let Some(used) = material.emission_texture {
            value["emissiveTexture"] = of_texture(used);
        }
        if let Some(map) = normal_map {
            value["normalTexture"] = of_normal_map(map);
        }

        let mut extensions = Map::new();
        let mut add = |name: &'static str, content: Value| {
            self.extensions.insert(name);
            extensions.insert(name.to_owned(), content);
        };
        if material.is_emissive() {
            let strength = material.emission.max_element().max(1.0);
            value["emissiveFactor"] = json!((material.emission / strength).to_array());
            if strength > 1.0 {
                add("KHR_materials_emissive_strength", json!({"emissiveStrength": strength}));
            }
        }
        if layers.is_unlit {
            add("KHR_materials_unlit", json!({}));
        }
        if let Some(Medium { transmittance, metres }) = layers.medium {
            // Rays measure the thickness; any above 0 makes a solid.
            let after_a_metre =
                json!({"thicknessFactor": 1.0, "attenuationDistance": metres, "attenuationColor": transmittance.to_array()});
            add("KHR_materials_volume", after_a_metre);
        }
        for (group, parameters) in PARAMETERS {
            let members = |mut layers: Layers| -> Map<String, Value> {
                let member = |(member, parameter): &(&str, Parameter)| {
                    let value = match parameter {
                        Parameter::Number(_, _, of) => json!(of(&mut layers)),
                        Parameter::Colour(_, _, of) => json!(of(&mut layers).to_array()),
                        Parameter::NumberTexture(_, of) | Parameter::ColourTexture(_, of) => of_texture((*of(&mut layers))?),
                        Parameter::NormalMap(_, of) => of_normal_map((*of(&mut layers))?),
                    };
                    Some(((*member).to_owned(), value))
                };
                parameters.iter().filter_map(member).collect()
            };
            let own = members(layers);
            if *group == METALLIC_ROUGHNESS {
                value[group].as_object_mut().expect("it has the base colour").extend(own);
            } else if own != members(Layers::default()) {
                // What is as usual is left out.
                add(group, own.into());
            }
        }
        if !extensions.is_empty() {
            value["extensions"] = extensions.into();
        }
        value
    }

    fn camera(&mut self, index: usize, camera: &Camera, near: f64) -> Value {
        let rotation = DQuat::from_mat3(&DMat3::from_cols(camera.right, camera.up, -camera.forward)).normalize();
        self.nodes.push(json!({
            "name": camera.name, "camera": index, "translation": camera.eye.to_array(), "rotation": rotation.to_array(),
        }));
        match camera.projection {
            Projection::Perspective { vertical_view } => {
                json!({"name": camera.name, "type": "perspective", "perspective": {"yfov": vertical_view, "znear": near}})
            }
            Projection::Orthographic { half_height } => json!({"name": camera.name, "type": "orthographic", "orthographic": {
                "xmag": half_height * camera.aspect.unwrap_or(1.0), "ymag": half_height, "znear": 0, "zfar": 1e4 * near,
            }}),
        }
    }
}

/// glTF's layers of a material. The paper's Phong has no counterpart and becomes Lambertian, as which it scatters.
fn layers(material: &Material) -> Layers {
    let usual = Layers::default();
    match material.surface {
        Surface::Layered => material.layers,
        // Nothing is reflected, so that all light reaches what is matt.
        Surface::Lambert | Surface::PaperPhong { .. } => Layers { metallic: 0.0, specular: 0.0, ..usual },
        Surface::Glossy { exponent } => Layers { roughness: (2.0 / (exponent + 2.0)).powf(0.25), ..usual },
        Surface::Mirror => Layers { roughness: 0.0, ..usual },
        Surface::Dielectric { ior } => {
            let medium = Some(Medium::CLEAR);
            Layers { metallic: 0.0, roughness: 0.0, transmission: 1.0, ior, medium, ..usual }
        }
    }
}

/// Node and light in photometric units; none for lights that glTF does not know.
fn light_of(light: &Light) -> Option<(Value, Value)> {
    // The loader calls lights by their kind as well.
    let name = light.name.strip_prefix("light '").and_then(|name| name.strip_suffix('\'')).unwrap_or(&light.name);
    let towards = |direction: DVec3| DQuat::from_rotation_arc(DVec3::NEG_Z, direction).normalize().to_array();
    let (kind, strength, mut node, spot) = match light.kind {
        LightKind::Point { position, intensity } => ("point", intensity, json!({"translation": position.to_array()}), None),
        LightKind::Spot { position, direction, intensity, inner_angle, outer_angle } => (
            "spot",
            intensity,
            json!({"translation": position.to_array(), "rotation": towards(direction)}),
            Some(json!({"innerConeAngle": inner_angle, "outerConeAngle": outer_angle})),
        ),
        LightKind::Directional { direction, irradiance } => ("directional", irradiance, json!({"rotation": towards(direction)}), None),
        LightKind::Disc { .. } | LightKind::Environment { .. } | LightKind::Sky(_) => return None,
    };
    let brightest = strength.max_element().max(f32::MIN_POSITIVE);
    let mut value = json!({
        "name": name, "type": kind, "color": (strength / brightest).to_array(), "intensity": brightest * LUMENS_PER_WATT,
    });
    if let Some(spot) = spot {
        value["spot"] = spot;
    }
    node["name"] = json!(name);
    Some((node, value))
}
