//! A glTF file as it stands on the disk, for what writes it again: its JSON as a value, its buffers, numbers out of its accessors.

use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use gltf::accessor::{DataType, Dimensions};
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde_json::{Value, json};

use super::accessor::{integer, kind_of, largest, stored};
use super::compressed;
use super::malformed;
pub(crate) use super::malformed::Chunk;
use super::members::{index, items};
use super::{one_line, read_file, uri};
use crate::error::{Error, Result};

/// The chunk of a `.glb` file that is its first buffer.
const BINARY_CHUNK: [u8; 4] = *b"BIN\0";
const JSON_CHUNK: [u8; 4] = *b"JSON";

/// A file as it was written.
pub(crate) struct File {
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
pub(crate) struct Elements {
    pub bytes: Vec<u8>,
    /// Bytes of one element.
    pub size: usize,
    /// Numbers in one element.
    pub components: usize,
    pub count: usize,
    pub kind: DataType,
}

/// A file that another names.
pub(crate) struct Beside {
    /// Its path from the other's folder.
    pub name: String,
    pub content: std::result::Result<Vec<u8>, String>,
}

impl File {
    pub(crate) fn open(path: &Path) -> Result<File> {
        let refuse = |reason: String| Error::Scene { path: path.to_owned(), object: "the file".into(), reason: one_line(&reason) };
        let content = read_file(path).map_err(refuse)?;
        let is_binary = content.starts_with(b"glTF");
        let parts = malformed::parts(&content).map_err(refuse)?;
        let other_chunks = if is_binary { malformed::other_chunks(&content, &parts).map_err(refuse)? } else { Vec::new() };
        let malformed::Parts { json: text, mut binary } = parts;
        let mut json = malformed::json(&text).map_err(refuse)?;
        let is_unpacked = unpack(path, &mut json, &mut binary)?;
        let mut buffers = Vec::new();
        for (index, buffer) in items(&json["buffers"]).enumerate() {
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
    pub(crate) fn beside(&self) -> Vec<Beside> {
        let of = |list: &str| items(&self.json[list]).filter_map(|member| member["uri"].as_str());
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
    pub(crate) fn elements(&self, accessor: usize, what: &str) -> Result<Elements> {
        let json = &self.json["accessors"][accessor];
        let refuse = |reason: &str| self.refuse(what, format!("has the accessor {accessor}, which {reason}"));
        let kind = kind_of(&json["componentType"]).ok_or_else(|| refuse("has no numbers that glTF knows"))?;
        let Ok(Checked::Valid(dimensions)) = Checked::<Dimensions>::deserialize(&json["type"]) else {
            return Err(refuse("has a type that glTF does not know"));
        };
        let components = dimensions.multiplicity();
        let columns = match dimensions {
            Dimensions::Mat2 => 2,
            Dimensions::Mat3 => 3,
            Dimensions::Mat4 => 4,
            _ => 1,
        };
        // Columns of matrices begin at multiples of four bytes.
        let column_bytes = components / columns * kind.size();
        let size = if columns > 1 { columns * column_bytes.next_multiple_of(4) } else { column_bytes };
        let count = index(&json["count"]).ok_or_else(|| refuse("says no count"))?;
        let mut bytes = match json.get("bufferView") {
            Some(view) => self.slice(view, index(&json["byteOffset"]).unwrap_or(0), count, size).map_err(|reason| refuse(&reason))?,
            None => vec![0; count.checked_mul(size).filter(|bytes| *bytes <= 1 << 32).ok_or_else(|| refuse("is too large"))?],
        };
        if let Some(sparse) = json.get("sparse") {
            let replaced = index(&sparse["count"]).ok_or_else(|| refuse("is sparse and says no count"))?;
            let index_kind = kind_of(&sparse["indices"]["componentType"]).ok_or_else(|| refuse("has sparse indices of no type"))?;
            let index_bytes = index_kind.size();
            let part = |name: &str, size: usize| {
                let offset = index(&sparse[name]["byteOffset"]).unwrap_or(0);
                self.slice(&sparse[name]["bufferView"], offset, replaced, size).map_err(|reason| refuse(&reason))
            };
            let (indices, values) = (part("indices", index_bytes)?, part("values", size)?);
            for (index, value) in indices.chunks_exact(index_bytes).zip(values.chunks_exact(size)) {
                let place = size * integer(index) as usize;
                bytes.get_mut(place..place + size).ok_or_else(|| refuse("replaces an element that is not there"))?.copy_from_slice(value);
            }
        }
        Ok(Elements { bytes, size, components, count, kind })
    }

    /// `count` elements of `size` bytes from `offset` in a buffer view, one after another.
    fn slice(&self, view: &Value, offset: usize, count: usize, size: usize) -> std::result::Result<Vec<u8>, String> {
        let view = index(view).and_then(|view| self.json["bufferViews"].get(view)).ok_or("lies in a buffer view that is not there")?;
        let bytes = index(&view["buffer"]).and_then(|buffer| self.buffers.get(buffer)).and_then(Option::as_ref);
        let bytes = bytes.ok_or("lies in a buffer that is not there")?;
        let start = index(&view["byteOffset"]).unwrap_or(0);
        let end = index(&view["byteLength"]).and_then(|length| start.checked_add(length));
        let bytes = end.and_then(|end| bytes.get(start..end)).ok_or("lies in a buffer view that runs past its buffer")?;
        let stride = index(&view["byteStride"]).unwrap_or(size);
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
    pub(crate) fn number(&self, element: usize, component: usize) -> f64 {
        let width = self.size / self.components;
        stored(&self.bytes[element * self.size + component * width..][..width], self.kind)
    }

    /// What whole numbers are divided by where they stand for shares.
    pub(crate) fn largest(&self) -> f64 {
        largest(self.kind)
    }
}

/// Unpacks what is compressed, behind what a free binary part has, else into one more buffer; whether something was.
fn unpack(path: &Path, json: &mut Value, binary: &mut Option<Vec<u8>>) -> Result<bool> {
    let buffers = json["buffers"].as_array().map_or(0, Vec::len);
    let is_free = binary.is_some() && json["buffers"][0]["uri"].is_null();
    let start = binary.as_ref().map_or(0, |binary| binary.len().next_multiple_of(4));
    let target = if is_free { (0, start) } else { (buffers, 0) };
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

/// A `.glb` file of these parts; each is filled up to a multiple of four bytes.
pub(crate) fn binary_file(json: &Value, binary: &[u8], other_chunks: &[Chunk]) -> Vec<u8> {
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
