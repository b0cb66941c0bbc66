//! From a file's bytes to glTF, with every fault named: where it is, what stands there, what is allowed and what to do.

use std::borrow::Cow;

use gltf::json::validation::{Error as Fault, Validate};
use gltf::json::{Path, Root};
use gltf::json::{accessor, camera, material, mesh, texture};
use serde_json::Value;

use crate::text::echo;

pub(super) const REMEDY: &str = "correct it, or export the file again";
const OLD: &str = "is of glTF 1.0, and glTF 2.0 is read; convert it, as `npx gltf-pipeline -i OLD.gltf -o NEW.gltf` does";
/// Which list a member's number is a place in.
const LISTS: [(&str, &str); 17] = [
    ("buffer", "buffers"),
    ("bufferView", "bufferViews"),
    ("camera", "cameras"),
    ("children", "nodes"),
    ("index", "textures"),
    ("indices", "accessors"),
    ("inverseBindMatrices", "accessors"),
    ("joints", "nodes"),
    ("light", "extensions/KHR_lights_punctual/lights"),
    ("material", "materials"),
    ("mesh", "meshes"),
    ("nodes", "nodes"),
    ("sampler", "samplers"),
    ("scene", "scenes"),
    ("skeleton", "nodes"),
    ("skin", "skins"),
    ("source", "images"),
];

/// Of a `.gltf` file, or of a `.glb` one, which may have a binary part.
pub(super) struct Parts<'a> {
    pub(super) json: Cow<'a, [u8]>,
    pub(super) binary: Option<Vec<u8>>,
}

/// Kind and content.
pub(crate) type Chunk = ([u8; 4], Vec<u8>);

pub(super) fn parts(content: &[u8]) -> Result<Parts<'_>, String> {
    if content.is_empty() {
        return Err("is empty; export it again".to_owned());
    }
    if !content.starts_with(b"glTF") {
        // JSON begins with a bracket.
        let start = without_mark(content).trim_ascii_start();
        if !start.starts_with(b"{") {
            let git =
                if content.starts_with(b"version https://git-lfs") { "; git lfs pull fetches the file that it stands for" } else { "" };
            return Err(format!("is no glTF, neither JSON nor binary{git}"));
        }
        return Ok(Parts { json: Cow::Borrowed(content), binary: None });
    }
    if content.get(4..8) == Some(&1u32.to_le_bytes()) {
        return Err(OLD.to_owned());
    }
    binary_length(content)?;
    let glb = gltf::Glb::from_slice(content).map_err(|error| format!("is not valid glTF: {error}; export it again"))?;
    Ok(Parts { json: glb.json, binary: glb.bin.map(Cow::into_owned) })
}

/// Chunks of a `.glb` file after its parts, which are of extensions.
pub(super) fn other_chunks(content: &[u8], parts: &Parts) -> Result<Vec<Chunk>, String> {
    // Behind the file's head, and that of each chunk.
    let read: usize = [Some(parts.json.len()), parts.binary.as_ref().map(Vec::len)].into_iter().flatten().map(|length| 8 + length).sum();
    let mut rest = content.get(12 + read..).unwrap_or_default();
    let mut chunks = Vec::new();
    while let Some((&[a, b, c, d, ref kind @ ..], after)) = rest.split_first_chunk::<8>() {
        let length = u32::from_le_bytes([a, b, c, d]) as usize;
        let (chunk, after) = after.split_at_checked(length).ok_or("has a chunk that runs past its end")?;
        chunks.push((*kind, chunk.to_vec()));
        rest = after;
    }
    Ok(chunks)
}

/// Without the mark that some editors write in front of a text.
fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

/// Refuses what is not glTF 2.
pub(super) fn version(json: &Value) -> Result<(), String> {
    let version = &json["asset"]["version"];
    // The first version had its objects by names, and needed to say no version.
    let is_old = version.as_str().is_some_and(|version| version.starts_with("1."))
        || version.is_null() && ["meshes", "nodes", "scenes"].iter().any(|list| json[list].is_object());
    match version.as_str() {
        _ if is_old => Err(OLD.to_owned()),
        Some(version) if version != "2" && !version.starts_with("2.") => Err(format!("is of glTF version {}; 2.0 is read", echo(version))),
        _ => Ok(()),
    }
}

/// Whole numbers are integers in it, however they are written, as `3.0`.
pub(super) fn json(text: &[u8]) -> Result<Value, String> {
    // Some writers fill a part of a .glb file with zeros.
    let text = without_mark(text);
    let text = &text[..text.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1)];
    let mut value = serde_json::from_slice(text).map_err(|error| {
        const AROUND: usize = 25;
        let line = text.split(|byte| *byte == b'\n').nth(error.line().saturating_sub(1)).unwrap_or_default();
        let place = error.column().min(line.len());
        let found = String::from_utf8_lossy(&line[place.saturating_sub(AROUND)..(place + AROUND).min(line.len())]);
        format!("is not valid JSON: {error}, near '{}'; {REMEDY} (JSON has no NaN and no infinity)", found.trim())
    })?;
    make_whole(&mut value);
    Ok(value)
}

fn make_whole(value: &mut Value) {
    // Beyond, not every integer is a number of double precision.
    const MOST: f64 = (1u64 << 53) as f64;
    match value {
        Value::Number(number) => {
            let float = number.as_f64().filter(|float| number.is_f64() && float.fract() == 0.0 && float.abs() < MOST);
            // -0 is no integer.
            if let Some(float) = float.filter(|float| *float != 0.0 || float.is_sign_positive()) {
                *number = (float as i64).into();
            }
        }
        Value::Array(members) => members.iter_mut().for_each(make_whole),
        Value::Object(members) => members.values_mut().for_each(make_whole),
        _ => {}
    }
}

pub(super) fn root(json: Value) -> Result<Root, String> {
    serde_path_to_error::deserialize(json).map_err(|error| format!("is not valid glTF: at {}: {}; {REMEDY}", error.path(), error.inner()))
}

/// Numbers of objects that are not there, values that glTF has not, and members that are missing. `text` is the file's JSON.
pub(super) fn faults(root: &Root, text: &[u8]) -> Result<(), String> {
    let mut first = None;
    root.validate(root, Path::new, &mut |path, fault| {
        // An accessor without a view holds zeros, and a primitive without positions is left out.
        let is_optional = |path: &str| path.starts_with("accessors[") && path.ends_with("].bufferView") || path.ends_with("[\"POSITION\"]");
        let is_allowed = |path: &str| fault == Fault::Missing && is_optional(path);
        if first.is_none() {
            first = Some((path().0, fault)).filter(|(path, _)| !is_allowed(path));
        }
    });
    let Some((path, fault)) = first else { return Ok(()) };
    let json = json(text)?;
    let pointer = pointer(&json, &path);
    let path = if pointer.contains("/extensions/") { readable(&pointer) } else { path };
    let found = json.pointer(&pointer).map_or_else(|| "a name that glTF does not have".to_owned(), echo);
    // The last name of `meshes[0].primitives[1].mode` is `mode`.
    let member = pointer.rsplit('/').find(|part| part.parse::<usize>().is_err()).unwrap_or_default();
    let reason = match fault {
        Fault::Missing => format!("{path} is missing; add it"),
        Fault::IndexOutOfBounds => {
            let list = LISTS.iter().find(|(name, _)| *name == member).map_or(member, |(_, list)| *list);
            let count = json.pointer(&format!("/{list}")).and_then(Value::as_array).map_or(0, Vec::len);
            let list = list.replace('/', ".");
            format!("{path} is {found}, and the list {list} has {count} members, counted from 0; correct the number")
        }
        Fault::Invalid => match allowed(&path, member) {
            Some(allowed) => format!("{path} is {found}; it must be one of {allowed}; correct it"),
            None => format!("{path} is {found}, which glTF does not allow; correct it"),
        },
        Fault::Oversize | Fault::Unsupported => format!("{path} is {found}: {}; correct it", fault.to_string().to_lowercase()),
    };
    Err(format!("is not valid glTF: {reason}, or export the file again"))
}

/// A path of the `gltf` crate as a JSON pointer. The crate has names of its own for extensions: `ior` for `KHR_materials_ior`.
fn pointer(json: &Value, path: &str) -> String {
    let letters = |name: &str| name.replace('_', "").to_lowercase();
    let mut found = String::new();
    for part in path.replace(['.', '['], "/").replace([']', '"'], "").split('/') {
        let names = json.pointer(&found).and_then(Value::as_object).filter(|_| found.ends_with("/extensions"));
        let name = names.and_then(|names| names.keys().find(|name| letters(name).ends_with(&letters(part))));
        found = format!("{found}/{}", name.map_or(part, String::as_str));
    }
    found
}

/// A JSON pointer as a path: `nodes[0].mesh` for `/nodes/0/mesh`.
fn readable(pointer: &str) -> String {
    let part = |part: &str| if part.parse::<usize>().is_ok() { format!("[{part}]") } else { format!(".{part}") };
    let path: String = pointer.split('/').skip(1).map(part).collect();
    path.trim_start_matches('.').to_owned()
}

/// The values of a member.
fn allowed(path: &str, member: &str) -> Option<String> {
    Some(match member {
        "alphaMode" => format!("{:?}", material::VALID_ALPHA_MODES),
        "componentType" if path.contains("sparse") => format!("{:?}", accessor::VALID_INDEX_TYPES),
        "componentType" => format!("{:?}", accessor::VALID_COMPONENT_TYPES),
        "mode" => format!("{:?}", mesh::VALID_MODES),
        "type" if path.starts_with("cameras") => format!("{:?}", camera::VALID_CAMERA_TYPES),
        "type" if path.starts_with("accessors") => format!("{:?}", accessor::VALID_ACCESSOR_TYPES),
        "wrapS" | "wrapT" => format!("{:?}", texture::VALID_WRAPPING_MODES),
        _ => return None,
    })
}

/// Checks the length that a .glb announces: a file that was cut off is not to be read as far as it goes.
fn binary_length(content: &[u8]) -> Result<(), String> {
    let announced = content.get(8..12).map_or(0, |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize);
    if announced != content.len() {
        let fault = if content.len() < announced {
            "was cut off: copy or download it again"
        } else {
            "has something behind its end: export it again"
        };
        return Err(format!("announces {announced} bytes and has {}; it {fault}", content.len()));
    }
    Ok(())
}

/// Members without which the `gltf` crate would stop the program.
pub(super) fn missing_members(root: &Root) -> Result<(), String> {
    use gltf::json::validation::Checked;
    for (number, mesh) in root.meshes.iter().enumerate() {
        for (place, primitive) in mesh.primitives.iter().enumerate() {
            let mut accessors = primitive.attributes.values().chain(&primitive.indices).map(gltf::json::Index::value);
            if let Some(accessor) = accessors.find(|accessor| *accessor >= root.accessors.len()) {
                return Err(format!("has a mesh {number} whose primitive {place} uses accessor {accessor} of {}", root.accessors.len()));
            }
        }
    }
    for (number, animation) in root.animations.iter().enumerate() {
        let mut nodes = animation.channels.iter().map(|channel| channel.target.node.value()).enumerate();
        if let Some((place, node)) = nodes.find(|(_, node)| *node >= root.nodes.len()) {
            let path = format!("animations[{number}].channels[{place}].target.node");
            let count = root.nodes.len();
            return Err(format!("is not valid glTF: {path} is {node}, and the list nodes has {count} members, counted from 0; {REMEDY}"));
        }
    }
    for (number, image) in root.images.iter().enumerate() {
        if image.uri.is_none() && image.buffer_view.is_none() {
            return Err(format!("has an image {number} with neither a URI nor a buffer view"));
        }
    }
    for (number, camera) in root.cameras.iter().enumerate() {
        let whole = match camera.type_ {
            Checked::Valid(camera::Type::Perspective) => camera.perspective.is_some(),
            Checked::Valid(camera::Type::Orthographic) => camera.orthographic.is_some(),
            Checked::Invalid => true,
        };
        if !whole {
            return Err(format!("has a camera {number} without the numbers of its type"));
        }
    }
    Ok(())
}
