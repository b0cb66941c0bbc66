//! A glTF file by hand, for tests to change.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use image::{DynamicImage, ImageFormat};
use serde_json::{Value, json};

pub fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

pub fn data_uri(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", BASE64.encode(bytes))
}

pub fn encoded(picture: &(impl Clone + Into<DynamicImage>), format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    Into::<DynamicImage>::into(picture.clone()).write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// The buffer of a scene, embedded.
pub fn set_buffer(value: &mut Value, bytes: &[u8]) {
    value["buffers"][0] = json!({"byteLength": bytes.len(), "uri": data_uri("application/octet-stream", bytes)});
}

/// Adds to a list, and returns the number of what was added.
pub fn push(list: &mut Value, item: Value) -> usize {
    let list = list.as_array_mut().unwrap();
    list.push(item);
    list.len() - 1
}

/// Adds an accessor of numbers in a buffer of its own, and returns its number.
pub fn add_accessor(value: &mut Value, bytes: &[u8], component: u32, count: usize, kind: &str) -> usize {
    let uri = data_uri("application/octet-stream", bytes);
    let buffer = push(&mut value["buffers"], json!({"byteLength": bytes.len(), "uri": uri}));
    let view = push(&mut value["bufferViews"], json!({"buffer": buffer, "byteOffset": 0, "byteLength": bytes.len()}));
    push(&mut value["accessors"], json!({"bufferView": view, "componentType": component, "count": count, "type": kind}))
}

/// A unit square in the plane z = 0: positions, normals, coordinates and indices in one buffer.
pub fn square_buffer() -> Vec<u8> {
    let mut bytes = floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
    bytes.extend(floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1., 0., 0., 1.]));
    bytes.extend(floats(&[0., 0., 1., 0., 1., 1., 0., 1.]));
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    bytes
}

/// A scene of one square, with everything that the tests change.
pub fn square() -> Value {
    let bytes = square_buffer();
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2, 3, 4]}],
        "nodes": [
            {"name": "wall", "mesh": 0, "translation": [1, 2, 3], "scale": [2, 2, 2]},
            {"name": "eye", "camera": 0, "translation": [0, 0, 5]},
            {"name": "bulb", "translation": [0, 4, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"name": "sun", "extensions": {"KHR_lights_punctual": {"light": 1}}},
            {"name": "beam", "extensions": {"KHR_lights_punctual": {"light": 2}}}
        ],
        "meshes": [{"name": "square", "primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0
        }]}],
        "materials": [{
            "name": "glow", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 0},
            "emissiveFactor": [1, 0.5, 0.25], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}
        }],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "point", "name": "bulb", "color": [1, 0.5, 0.25], "intensity": 683},
            {"type": "directional", "intensity": 1366},
            {"type": "spot", "intensity": 68.3, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4}}
        ]}},
        "buffers": [{"byteLength": bytes.len(), "uri": data_uri("application/octet-stream", &bytes)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 48},
            {"buffer": 0, "byteOffset": 96, "byteLength": 32},
            {"buffer": 0, "byteOffset": 128, "byteLength": 12}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR"}
        ]
    })
}
