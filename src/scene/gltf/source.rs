//! A glTF file as it stands on the disk, for what writes it again: its JSON as a value, its buffers, numbers out of its accessors.

use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::{Value, json};

use super::compressed::{self, Target};
use super::{malformed, one_line, read_file, uri};
use crate::error::{Error, Result};

/// The chunk of a `.glb` file that is its first buffer.
const BINARY_CHUNK: [u8; 4] = *b"BIN\0";
const JSON_CHUNK: [u8; 4] = *b"JSON";

/// Kind and content.
pub type Chunk = ([u8; 4], Vec<u8>);

/// A file as it was written.
pub struct File {
    pub path: PathBuf,
    pub json: Value,
    /// Whether it is a `.glb` file.
    pub is_binary: bool,
    /// Its binary part, with the bytes that fill it up.
    pub binary: Option<Vec<u8>>,
    /// Chunks after it, which are of extensions.
    pub other_chunks: Vec<Chunk>,
    /// Whether meshes in it were compressed; they no longer are.
    pub is_unpacked: bool,
    /// `None` for those that are not there.
    buffers: Vec<Option<Vec<u8>>>,
}

/// The elements of an accessor one after another, numbers as they are stored, sparse replacements made.
pub struct Elements {
    pub bytes: Vec<u8>,
    /// Bytes of one element.
    pub size: usize,
    /// Numbers in one element.
    pub components: usize,
    pub count: usize,
    pub component_type: u64,
}

/// A file that another names.
pub struct Beside {
    /// Its path from the other's folder.
    pub name: String,
    pub content: std::result::Result<Vec<u8>, String>,
}

impl File {
    pub fn open(path: &Path) -> Result<File> {
        let refuse = |reason: String| Error::Scene { path: path.to_owned(), object: "the file".into(), reason: one_line(&reason) };
        let content = read_file(path).map_err(refuse)?;
        let is_binary = content.starts_with(b"glTF");
        let mut chunks = if is_binary { chunks(&content).map_err(refuse)? } else { vec![(JSON_CHUNK, content)] }.into_iter();
        let text = chunks.next().filter(|(kind, _)| *kind == JSON_CHUNK).ok_or_else(|| refuse("has no JSON".into()))?.1;
        let mut json = malformed::json(&text).map_err(refuse)?;
        let mut other_chunks: Vec<_> = chunks.collect();
        let mut binary = other_chunks.iter().position(|(kind, _)| *kind == BINARY_CHUNK).map(|place| other_chunks.remove(place).1);
        let is_unpacked = unpack(path, &mut json, &mut binary)?;
        let mut buffers = Vec::new();
        for (index, buffer) in json["buffers"].as_array().into_iter().flatten().enumerate() {
            buffers.push(match buffer["uri"].as_str() {
                Some(uri) => Some(uri::read(path, uri).map_err(|reason| refuse(format!("has a buffer {index} that {reason}")))?),
                None if index == 0 => binary.clone(),
                None => None,
            });
        }
        Ok(File { path: path.to_owned(), json, is_binary, binary, other_chunks, buffers, is_unpacked })
    }

    fn refuse(&self, object: &str, reason: impl Into<String>) -> Error {
        Error::Scene { path: self.path.clone(), object: object.to_owned(), reason: one_line(&reason.into()) }
    }

    /// Files that buffers and images name, each once.
    pub fn beside(&self) -> Vec<Beside> {
        let of = |list: &str| self.json[list].as_array().into_iter().flatten().filter_map(|member| member["uri"].as_str());
        let mut uris: Vec<&str> = of("buffers").chain(of("images")).filter(|uri| !uri.contains(':') && !uri.is_empty()).collect();
        uris.sort_unstable();
        uris.dedup();
        let read = |uri: &str| Beside {
            name: uri::name_beside(&self.path, uri).unwrap_or_else(|| uri.to_owned()),
            content: uri::read(&self.path, uri),
        };
        uris.into_iter().map(read).collect()
    }

    /// The elements of an accessor that `what` has.
    pub fn elements(&self, accessor: usize, what: &str) -> Result<Elements> {
        let json = &self.json["accessors"][accessor];
        let refuse = |reason: &str| self.refuse(what, format!("has the accessor {accessor}, which {reason}"));
        let number = |value: &Value| value.as_u64().and_then(|number| usize::try_from(number).ok());
        let component_type = json["componentType"].as_u64().unwrap_or_default();
        let number_bytes = number_bytes(component_type).ok_or_else(|| refuse("has no numbers that glTF knows"))?;
        let (columns, rows) = match json["type"].as_str() {
            Some("SCALAR") => (1, 1),
            Some("VEC2") => (1, 2),
            Some("VEC3") => (1, 3),
            Some("VEC4") => (1, 4),
            Some("MAT2") => (2, 2),
            Some("MAT3") => (3, 3),
            Some("MAT4") => (4, 4),
            _ => return Err(refuse("has a type that glTF does not know")),
        };
        // Columns of matrices begin at multiples of four bytes.
        let column_bytes = if columns > 1 { (rows * number_bytes).next_multiple_of(4) } else { rows * number_bytes };
        let size = columns * column_bytes;
        let count = number(&json["count"]).ok_or_else(|| refuse("says no count"))?;
        let mut bytes = match json.get("bufferView") {
            Some(view) => self.slice(view, number(&json["byteOffset"]).unwrap_or(0), count, size).map_err(|reason| refuse(&reason))?,
            None => vec![0; count.checked_mul(size).filter(|bytes| *bytes <= 1 << 32).ok_or_else(|| refuse("is too large"))?],
        };
        if let Some(sparse) = json.get("sparse") {
            let replaced = number(&sparse["count"]).ok_or_else(|| refuse("is sparse and says no count"))?;
            let index_bytes =
                number_bytes_of(&sparse["indices"]["componentType"]).ok_or_else(|| refuse("has sparse indices of no type"))?;
            let part = |name: &str, size: usize| {
                let offset = number(&sparse[name]["byteOffset"]).unwrap_or(0);
                self.slice(&sparse[name]["bufferView"], offset, replaced, size).map_err(|reason| refuse(&reason))
            };
            let (indices, values) = (part("indices", index_bytes)?, part("values", size)?);
            for (index, value) in indices.chunks_exact(index_bytes).zip(values.chunks_exact(size)) {
                let place = size * unsigned(index) as usize;
                bytes.get_mut(place..place + size).ok_or_else(|| refuse("replaces an element that is not there"))?.copy_from_slice(value);
            }
        }
        Ok(Elements { bytes, size, components: columns * rows, count, component_type })
    }

    /// `count` elements of `size` bytes from `offset` in a buffer view, one after another.
    fn slice(&self, view: &Value, offset: usize, count: usize, size: usize) -> std::result::Result<Vec<u8>, String> {
        let number = |value: &Value| value.as_u64().and_then(|number| usize::try_from(number).ok());
        let view = number(view).and_then(|view| self.json["bufferViews"].get(view)).ok_or("lies in a buffer view that is not there")?;
        let bytes = number(&view["buffer"]).and_then(|buffer| self.buffers.get(buffer)).and_then(Option::as_ref);
        let bytes = bytes.ok_or("lies in a buffer that is not there")?;
        let start = number(&view["byteOffset"]).unwrap_or(0);
        let end = number(&view["byteLength"]).and_then(|length| start.checked_add(length));
        let bytes = end.and_then(|end| bytes.get(start..end)).ok_or("lies in a buffer view that runs past its buffer")?;
        let stride = number(&view["byteStride"]).unwrap_or(size);
        let element = |k: usize| {
            let place = k.checked_mul(stride)?.checked_add(offset)?;
            bytes.get(place..place.checked_add(size)?)
        };
        if count > 0 && element(count - 1).is_none() {
            return Err("runs past its buffer view".into());
        }
        Ok((0..count).filter_map(element).flatten().copied().collect())
    }
}

impl Elements {
    /// A number of an element as it is stored; matrices have gaps and are not asked for.
    pub fn number(&self, element: usize, component: usize) -> f64 {
        let width = self.size / self.components;
        let bytes = &self.bytes[element * self.size + component * width..][..width];
        match self.component_type {
            5120 => f64::from(bytes[0] as i8),
            5122 => f64::from(unsigned(bytes) as u16 as i16),
            5126 => f64::from(f32::from_bits(unsigned(bytes))),
            _ => f64::from(unsigned(bytes)),
        }
    }

    /// What whole numbers are divided by where they stand for shares.
    pub fn largest(&self) -> f64 {
        match self.component_type {
            5120 => 127.0,
            5121 => 255.0,
            5122 => 32_767.0,
            5123 => 65_535.0,
            _ => 1.0,
        }
    }
}

fn number_bytes(component_type: u64) -> Option<usize> {
    match component_type {
        5120 | 5121 => Some(1),
        5122 | 5123 => Some(2),
        5125 | 5126 => Some(4),
        _ => None,
    }
}

fn number_bytes_of(component_type: &Value) -> Option<usize> {
    component_type.as_u64().and_then(number_bytes)
}

fn unsigned(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte))
}

/// Unpacks what is compressed, behind what a free binary part has, else into one more buffer; whether something was.
fn unpack(path: &Path, json: &mut Value, binary: &mut Option<Vec<u8>>) -> Result<bool> {
    let buffers = json["buffers"].as_array().map_or(0, Vec::len);
    let is_free = binary.is_some() && json["buffers"][0]["uri"].is_null();
    let start = binary.as_ref().map_or(0, |binary| binary.len().next_multiple_of(4));
    let target = if is_free { Target { buffer: 0, start } } else { Target { buffer: buffers, start: 0 } };
    let unpacked = compressed::unpack(path, json, binary.as_deref(), target)?;
    if unpacked.is_empty() {
        return Ok(false);
    }
    compressed::forget(json);
    match binary.as_mut().filter(|_| is_free) {
        Some(binary) => {
            binary.resize(start, 0);
            binary.extend(unpacked);
            json["buffers"][0]["byteLength"] = json!(binary.len());
        }
        None => {
            let uri = format!("data:application/octet-stream;base64,{}", BASE64.encode(&unpacked));
            let buffers = json.get_mut("buffers").and_then(Value::as_array_mut).expect("what is compressed lies in one");
            buffers.push(json!({"byteLength": unpacked.len(), "uri": uri}));
        }
    }
    Ok(true)
}

/// The chunks of a `.glb` file.
fn chunks(content: &[u8]) -> std::result::Result<Vec<Chunk>, String> {
    // Its head.
    malformed::parts(content)?;
    let mut rest = content.get(12..).unwrap_or_default();
    let mut chunks = Vec::new();
    while let Some((head, after)) = rest.split_at_checked(8) {
        let length = unsigned(&head[..4]) as usize;
        let (chunk, after) = after.split_at_checked(length).ok_or("has a chunk that runs past its end")?;
        chunks.push(([head[4], head[5], head[6], head[7]], chunk.to_vec()));
        rest = after;
    }
    Ok(chunks)
}

/// A `.glb` file of these parts; each is filled up to a multiple of four bytes.
pub fn binary_file(json: &Value, binary: &[u8], other_chunks: &[Chunk]) -> Vec<u8> {
    let text = serde_json::to_vec(json).expect("a document is plain data");
    let mut content = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    let mut add = |kind: [u8; 4], bytes: &[u8], filling: u8| {
        let length = bytes.len().next_multiple_of(4);
        content.extend((length as u32).to_le_bytes());
        content.extend(kind);
        content.extend(bytes);
        content.extend(std::iter::repeat_n(filling, length - bytes.len()));
    };
    add(JSON_CHUNK, &text, b' ');
    if !binary.is_empty() {
        add(BINARY_CHUNK, binary, 0);
    }
    other_chunks.iter().for_each(|(kind, bytes)| add(*kind, bytes, 0));
    let length = (content.len() as u32).to_le_bytes();
    content[8..12].copy_from_slice(&length);
    content
}
