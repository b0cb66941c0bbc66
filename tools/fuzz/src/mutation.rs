//! A glTF file changed in one place, so that it stays a file that can be read: its JSON value by value, its buffers
//! byte by byte, the lengths of a .glb mended.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use photonmill::scene::gltf::source::binary_file;
use serde_json::{Value, json};

use super::change::{Random, change, parts, pointers};

/// Bytes, how many of them count, and how many there may be; returns how many count now.
pub type MutateBytes = fn(&mut [u8], usize, usize) -> usize;

/// Puts a changed input in the place of the old one; where there is none that fits, libFuzzer changes the old one.
pub fn put(new: Option<Vec<u8>>, data: &mut [u8], size: usize, max_size: usize, mutate_bytes: MutateBytes) -> usize {
    match new.filter(|new| new.len() <= max_size) {
        Some(new) => {
            data[..new.len()].copy_from_slice(&new);
            new.len()
        }
        None => mutate_bytes(data, size, max_size),
    }
}

/// The changed file; `None` where it cannot be read, and now and then where it can.
pub fn mutate(file: &[u8], seed: u32, mutate_bytes: MutateBytes) -> Option<Vec<u8>> {
    let mut random = Random(u64::from(seed));
    if random.below(10) == 0 {
        return None;
    }
    let (mut value, binary) = match parts(file) {
        Some((text, binary)) => (serde_json::from_slice::<Value>(text).ok()?, Some(binary.to_vec())),
        None => (serde_json::from_slice(file).ok()?, None),
    };
    match binary {
        Some(binary) if random.below(3) == 0 => return Some(binary_file(&value, &grown(binary, mutate_bytes), &[])),
        None if random.below(3) == 0 => change_embedded(&mut value, &mut random, mutate_bytes)?,
        _ => (0..=random.below(3)).for_each(|_| change(&mut value, &mut random)),
    }
    Some(binary.map_or_else(|| value.to_string().into_bytes(), |binary| binary_file(&value, &binary, &[])))
}

/// libFuzzer's own changes, with room for a few bytes more.
pub fn grown(mut bytes: Vec<u8>, mutate_bytes: MutateBytes) -> Vec<u8> {
    let length = bytes.len();
    bytes.resize(length + 16, 0);
    let most = bytes.len();
    let length = mutate_bytes(&mut bytes, length, most);
    bytes.truncate(length);
    bytes
}

/// Changes what one data URI holds; `None` without one.
fn change_embedded(value: &mut Value, random: &mut Random, mutate_bytes: MutateBytes) -> Option<()> {
    let is_embedded = |value: &Value| value.as_str().is_some_and(|text| text.contains(";base64,"));
    let places: Vec<String> = pointers(value).into_iter().filter(|place| value.pointer(place).is_some_and(is_embedded)).collect();
    let uri = value.pointer_mut(places.get(random.below(places.len()))?)?;
    let (kind, text) = uri.as_str()?.split_once(";base64,")?;
    let bytes = grown(BASE64.decode(text).ok()?, mutate_bytes);
    *uri = json!(format!("{kind};base64,{}", BASE64.encode(bytes)));
    Some(())
}
