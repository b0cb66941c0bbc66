//! glTF as it is written: members of the document's lists, bytes with the views and accessors that lead to them, and what materials, cameras
//! and lights of a scene are in it.

use glam::{DMat3, DQuat, DVec3};
use gltf::accessor::DataType;
use gltf::json::buffer::{ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER};
use gltf::json::texture::{CLAMP_TO_EDGE, LINEAR, MIRRORED_REPEAT, NEAREST, REPEAT};
use serde_json::{Map, Value, json};

use crate::scene::layers::{Layers, METALLIC_ROUGHNESS, Medium, NormalMap, PARAMETERS, Parameter, TextureUse, UvTransform};
use crate::scene::light::{LUMENS_PER_WATT, Light, LightKind};
use crate::scene::material::Coverage;
use crate::scene::texture::{Filter, Texture, Wrap};
use crate::scene::{Camera, Material, Projection, Surface};

const LIGHTS: &str = "KHR_lights_punctual";

/// A document, and the bytes that are added to one of its buffers.
#[derive(Default)]
pub(crate) struct Writer {
    pub json: Value,
    pub bytes: Vec<u8>,
    pub buffer: usize,
    /// Bytes that the buffer has before these: a multiple of four.
    pub start: usize,
}

impl Writer {
    /// Adds a member to a list, which need not be there, as glTF forbids empty ones.
    pub(crate) fn push(&mut self, list: &str, member: Value) -> usize {
        let list = &mut self.json[list];
        if !list.is_array() {
            *list = json!([]);
        }
        let list = list.as_array_mut().expect("it is one now");
        list.push(member);
        list.len() - 1
    }

    /// The same, unless there is an equal one.
    fn push_once(&mut self, list: &str, member: Value) -> usize {
        let known = self.json[list].as_array().and_then(|list| list.iter().position(|known| *known == member));
        known.unwrap_or_else(|| self.push(list, member))
    }

    pub(crate) fn use_extension(&mut self, name: &str) {
        self.push_once("extensionsUsed", json!(name));
        let names = self.json["extensionsUsed"].as_array_mut().expect("one was added");
        names.sort_by(|a, b| a.as_str().cmp(&b.as_str()));
    }

    /// Fills the bytes up, so that numbers of any kind can follow.
    pub(crate) fn fill(&mut self) {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
    }

    /// Adds bytes, and gives where they begin in the buffer.
    pub(crate) fn append(&mut self, bytes: &[u8]) -> usize {
        self.fill();
        let place = self.start + self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        place
    }

    /// A view of bytes, so many from one element to the next, for a target of the graphics card.
    pub(crate) fn view(&mut self, bytes: &[u8], stride: Option<usize>, target: Option<u32>) -> usize {
        let mut view = json!({"buffer": self.buffer, "byteOffset": self.append(bytes), "byteLength": bytes.len()});
        for (name, value) in [("byteStride", stride.map(|stride| json!(stride))), ("target", target.map(|target| json!(target)))] {
            value.into_iter().for_each(|value| view[name] = value);
        }
        self.push("bufferViews", view)
    }

    fn accessor(&mut self, bytes: &[u8], target: u32, kind: DataType, dimensions: &str, count: usize) -> usize {
        let view = self.view(bytes, None, Some(target));
        self.push("accessors", json!({"bufferView": view, "componentType": kind.as_gl_enum(), "count": count, "type": dimensions}))
    }

    /// An accessor of vectors, one per vertex.
    pub(crate) fn vectors<const N: usize>(&mut self, vectors: impl IntoIterator<Item = [f32; N]>) -> usize {
        let bytes: Vec<u8> = vectors.into_iter().flatten().flat_map(f32::to_le_bytes).collect();
        self.accessor(&bytes, ARRAY_BUFFER, DataType::F32, &format!("VEC{N}"), bytes.len() / (4 * N))
    }

    /// An accessor of triangles' vertices, in 16 bits each where that is enough.
    pub(crate) fn triangles(&mut self, triangles: &[[u32; 3]], is_short: bool) -> usize {
        let indices = triangles.as_flattened();
        let (bytes, kind): (Vec<u8>, DataType) = match is_short {
            true => (indices.iter().flat_map(|index| (*index as u16).to_le_bytes()).collect(), DataType::U16),
            false => (indices.iter().flat_map(|index| index.to_le_bytes()).collect(), DataType::U32),
        };
        self.accessor(&bytes, ELEMENT_ARRAY_BUFFER, kind, "SCALAR", indices.len())
    }

    /// A texture of a picture's file.
    pub(crate) fn texture(&mut self, uri: String, sampler: Value) -> usize {
        let sampler = self.push_once("samplers", sampler);
        let source = self.push("images", json!({"uri": uri}));
        self.push("textures", json!({"source": source, "sampler": sampler}))
    }

    /// A material, or what is nearest to it among those of glTF. `place`: the numbers of a texture and of its set of coordinates.
    pub(crate) fn material(&mut self, material: &Material, place: impl Fn(TextureUse) -> (usize, usize)) -> Value {
        let of_texture = |used: TextureUse| texture_use(used, place(used));
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
        let mut add = |name: &str, content: Value| {
            self.use_extension(name);
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

    /// A camera that sees what is not nearer than that, and its node.
    pub(crate) fn camera(&mut self, camera: &Camera, near: f64) {
        let rotation = DQuat::from_mat3(&DMat3::from_cols(camera.right, camera.up, -camera.forward)).normalize();
        let written = match camera.projection {
            Projection::Perspective { vertical_view } => {
                json!({"name": camera.name, "type": "perspective", "perspective": {"yfov": vertical_view, "znear": near}})
            }
            Projection::Orthographic { half_height } => json!({"name": camera.name, "type": "orthographic", "orthographic": {
                "xmag": half_height * camera.aspect.unwrap_or(1.0), "ymag": half_height, "znear": 0, "zfar": 1e4 * near,
            }}),
        };
        let number = self.push("cameras", written);
        let (translation, rotation) = (camera.eye.to_array(), rotation.to_array());
        self.push("nodes", json!({"name": camera.name, "camera": number, "translation": translation, "rotation": rotation}));
    }

    /// A light in photometric units, and its node; none of those that glTF does not know.
    pub(crate) fn light(&mut self, light: &Light) {
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
            LightKind::Disc { .. } | LightKind::Environment { .. } | LightKind::Sky(_) => return,
        };
        let brightest = strength.max_element().max(f32::MIN_POSITIVE);
        let mut value = json!({
            "name": name, "type": kind, "color": (strength / brightest).to_array(), "intensity": brightest * LUMENS_PER_WATT,
        });
        if let Some(spot) = spot {
            value["spot"] = spot;
        }
        self.use_extension(LIGHTS);
        // Beside the lists of the document's own.
        let mut lights = Writer { json: self.json["extensions"][LIGHTS].take(), ..Writer::default() };
        node["extensions"] = json!({LIGHTS: {"light": lights.push("lights", value)}});
        self.json["extensions"][LIGHTS] = lights.json;
        node["name"] = json!(name);
        self.push("nodes", node);
    }
}

/// How a texture is looked up.
pub(crate) fn sampler(texture: &Texture) -> Value {
    let [wrap_s, wrap_t] = texture.wrap.map(|wrap| match wrap {
        Wrap::Repeat => REPEAT,
        Wrap::MirroredRepeat => MIRRORED_REPEAT,
        Wrap::Clamp => CLAMP_TO_EDGE,
    });
    let filter = if texture.filter == Filter::Nearest { NEAREST } else { LINEAR };
    json!({"magFilter": filter, "wrapS": wrap_s, "wrapT": wrap_t})
}

/// By the numbers of the texture and of the set of coordinates.
fn texture_use(used: TextureUse, (texture, set): (usize, usize)) -> Value {
    let mut value = json!({"index": texture, "texCoord": set});
    let UvTransform { scale, rotation, offset } = used.transform;
    if used.transform != UvTransform::NONE {
        value["extensions"]["KHR_texture_transform"] =
            json!({"scale": scale.to_array(), "rotation": rotation, "offset": offset.to_array()});
    }
    value
}

/// glTF's layers of a material. The paper's Phong has no counterpart and becomes Lambertian, as which it scatters.
fn layers(material: &Material) -> Layers {
    let usual = Layers::default();
    match material.surface {
        Surface::Layered => material.layers,
        // Nothing is reflected, so that all light reaches the diffuse lobe.
        Surface::Lambert | Surface::PaperPhong { .. } => Layers { metallic: 0.0, specular: 0.0, ..usual },
        Surface::Glossy { exponent } => Layers { roughness: (2.0 / (exponent + 2.0)).powf(0.25), ..usual },
        Surface::Mirror => Layers { roughness: 0.0, ..usual },
        Surface::Dielectric { ior } => {
            let medium = Some(Medium::CLEAR);
            Layers { metallic: 0.0, roughness: 0.0, transmission: 1.0, ior, medium, ..usual }
        }
    }
}
