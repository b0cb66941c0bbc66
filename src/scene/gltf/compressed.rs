//! What a file has compressed, unpacked into one more buffer before anything else is read: buffer views by meshoptimizer
//! (EXT_meshopt_compression and its later name, KHR_meshopt_compression), primitives by Draco (KHR_draco_mesh_compression).

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use meshoptimizer_rs::codec::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat, decode_index_buffer, decode_index_sequence,
    decode_vertex_buffer,
};
use meshoptimizer_rs::{Limits, Workspace};
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::{Value, json};

use super::malformed::REMEDY;
use super::members::{INDICES, accessors, index, items};
use super::writer::Writer;
use super::{draco, named, one_line, uri};
use crate::error::{Error, Result};

const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
const DRACO: &str = "KHR_draco_mesh_compression";
/// Of all together, unpacked: a few bytes must not unfold into many gigabytes.
const MAX_BYTES: u64 = 2 << 30;

/// What the extension says of a view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

#[derive(Deserialize, PartialEq, Clone, Copy)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Deserialize, PartialEq, Clone, Copy, Default)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Bytes that hold a mesh: their buffer, where they begin and where they end.
type Stream = (usize, usize, usize);

/// One that Draco has compressed.
struct Primitive {
    mesh: usize,
    number: usize,
    /// Its name in complaints.
    what: String,
    stream: Stream,
}

/// A file that may have something compressed.
struct Packed<'a> {
    path: &'a Path,
    binary: Option<&'a [u8]>,
    to: Writer,
}

/// Unpacks all that is compressed, leads the JSON there, and gives the bytes that belong into the target, a buffer and how many bytes it has
/// already; none if nothing is. `binary` is the binary part of a `.glb` file.
pub(super) fn unpack(path: &Path, json: &mut Value, binary: Option<&[u8]>, (buffer, start): (usize, usize)) -> Result<Vec<u8>> {
    let mut packed = Packed { path, binary, to: Writer { json: json.take(), bytes: Vec::new(), buffer, start } };
    packed.unpack_views()?;
    packed.unpack_primitives()?;
    packed.to.fill();
    *json = packed.to.json;
    Ok(packed.to.bytes)
}

/// Takes what compression a file no longer needs off its lists.
pub(super) fn forget(json: &mut Value) {
    for list in ["extensionsUsed", "extensionsRequired"] {
        let Some(names) = json.get_mut(list).and_then(Value::as_array_mut) else { continue };
        names.retain(|name| name.as_str().is_none_or(|name| name != DRACO && !MESHOPT.contains(&name)));
        // Empty lists are not allowed.
        if names.is_empty() {
            json.as_object_mut().expect("it has a list").remove(list);
        }
    }
}

impl<'a> Packed<'a> {
    fn refuse(&self, object: &str, reason: impl AsRef<str>) -> Error {
        Error::Scene { path: self.path.to_owned(), object: object.to_owned(), reason: one_line(reason.as_ref()) }
    }

    /// The buffers of these numbers, each read once.
    fn buffers(&self, numbers: impl Iterator<Item = usize>) -> Result<HashMap<usize, Cow<'a, [u8]>>> {
        let mut read = HashMap::new();
        let count = items(&self.to.json["buffers"]).count();
        for number in numbers {
            if read.contains_key(&number) {
                continue;
            }
            let what = format!("buffer {number}");
            let bytes = match (self.to.json["buffers"][number]["uri"].as_str(), self.binary) {
                _ if number >= count => return Err(self.refuse(&what, format!("is named by what is compressed; there are {count}"))),
                (Some(uri), _) => Cow::Owned(uri::read(self.path, uri).map_err(|reason| self.refuse(&what, reason))?),
                (None, Some(binary)) if number == 0 => Cow::Borrowed(binary),
                _ => return Err(self.refuse(&what, "is the file's binary part, and there is none")),
            };
            read.insert(number, bytes);
        }
        Ok(read)
    }

    /// Refuses bytes of which there would be too many with those that are unpacked.
    fn require_few(&self, bytes: &[u8], what: &str) -> Result<()> {
        if (self.to.bytes.len() + bytes.len()) as u64 > MAX_BYTES { Err(self.refuse(what, too_large())) } else { Ok(()) }
    }

    fn unpack_views(&mut self) -> Result<()> {
        let packed = |list: &str| -> Vec<(usize, Value)> {
            let of = |(place, object): (usize, &Value)| {
                MESHOPT.iter().find_map(|name| object["extensions"].get(name)).map(|found| (place, found.clone()))
            };
            items(&self.to.json[list]).enumerate().filter_map(of).collect()
        };
        let views = packed("bufferViews");
        // Buffers that stand for what is unpacked.
        let holds = |place: &usize| views.iter().any(|(_, view)| view["buffer"].as_u64() == Some(*place as u64));
        let has_file = |place: &usize| self.to.json["buffers"][place]["uri"].is_string();
        let stand_ins: Vec<usize> =
            packed("buffers").into_iter().map(|(place, _)| place).filter(|place| !has_file(place) && !holds(place)).collect();
        let parse = |(number, view): &(usize, Value)| {
            let what = format!("compressed buffer view {number}");
            let view = View::deserialize(view).map_err(|error| self.refuse(&what, format!("is not valid: {error}; {REMEDY}")))?;
            let count = items(&self.to.json["buffers"]).count();
            if view.buffer >= count {
                return Err(self.refuse(&what, format!("lies in buffer {} of {count}", view.buffer)));
            }
            Ok((*number, what, view))
        };
        let parsed = views.iter().map(parse).collect::<Result<Vec<_>>>()?;
        let mut claimed = 0u64;
        for (_, what, View { count, byte_stride, .. }) in &parsed {
            claimed = (*count as u64).saturating_mul(*byte_stride as u64).saturating_add(claimed);
            if claimed > MAX_BYTES {
                let reason = format!("claims, with those before it, {claimed} bytes; allowed are {MAX_BYTES} for all that is compressed");
                return Err(self.refuse(what, reason));
            }
        }
        let buffers = self.buffers(parsed.iter().map(|(_, _, view)| view.buffer))?;
        for batch in parsed.chunks(rayon::current_num_threads()) {
            let decoded: Vec<_> = batch.par_iter().map(|(_, _, view)| decoded_view(&buffers[&view.buffer], view)).collect();
            for ((number, what, _), decoded) in batch.iter().zip(decoded) {
                let bytes = decoded.map_err(|reason| self.refuse(what, reason))?;
                self.require_few(&bytes, what)?;
                let start = self.to.append(&bytes);
                let view = &mut self.to.json["bufferViews"][number];
                view["buffer"] = json!(self.to.buffer);
                view["byteOffset"] = json!(start);
                view["byteLength"] = json!(bytes.len());
                drop_extensions(view, &MESHOPT);
            }
        }
        for buffer in stand_ins {
            self.to.json["buffers"][buffer] = json!({"byteLength": 0, "uri": "data:application/octet-stream;base64,"});
        }
        Ok(())
    }

    fn unpack_primitives(&mut self) -> Result<()> {
        let found = self.packed_primitives()?;
        let decoded = self.decoded_streams(&found)?;
        // They stay as they are.
        let is_plain = |primitive: &Value, name: &str| {
            let compressed = primitive["extensions"].get(DRACO);
            compressed.is_none_or(|compressed| name != INDICES && compressed["attributes"].get(name).is_none())
        };
        let mut taken = accessors(&self.to.json, items(&self.to.json["nodes"]), is_plain);
        let mut indices_of: HashMap<Stream, usize> = HashMap::new();
        let mut accessor_of: HashMap<(Stream, u64), usize> = HashMap::new();
        for Primitive { mesh, number, what, stream } in &found {
            let draco::Decoded { indices, points, attributes } = &decoded[stream];
            let indices = match indices_of.get(stream) {
                Some(known) => *known,
                None => {
                    let accessor = json!({"componentType": 5125, "count": indices.len(), "type": "SCALAR"});
                    let old = index(&self.to.json["meshes"][mesh]["primitives"][number][INDICES]).filter(|old| taken.insert(*old));
                    let added = self.set_accessor(old, accessor, None, (bytemuck::cast_slice(indices), what))?;
                    *indices_of.entry(*stream).or_insert(added)
                }
            };
            let primitive = self.to.json["meshes"][mesh]["primitives"][number].clone();
            let names = primitive["extensions"][DRACO]["attributes"].as_object().cloned().unwrap_or_default();
            for (name, id) in names {
                let Some(old) = index(&primitive["attributes"][&name]) else { continue };
                let like = self.to.json["accessors"].get(old).cloned();
                let found = id.as_u64().and_then(|id| Some((id, attributes.get(&id)?)));
                let (Some(like), Some((id, attribute))) = (like, found) else {
                    return Err(self.refuse(what, format!("has a compressed {name} of the number {id}, which is not there; {REMEDY}")));
                };
                let is_alike = matches!(
                    (like["type"].as_str(), attribute.components),
                    (Some("SCALAR"), 1) | (Some("VEC2"), 2) | (Some("VEC3"), 3) | (Some("VEC4"), 4)
                );
                if !is_alike {
                    let reason = format!("has a compressed {name} of {} numbers, and {} was announced", attribute.components, like["type"]);
                    return Err(self.refuse(what, format!("{reason}; {REMEDY}")));
                }
                let added = match accessor_of.get(&(*stream, id)) {
                    Some(known) => *known,
                    None => {
                        let mut accessor = like;
                        accessor["count"] = json!(points);
                        accessor["componentType"] = json!(attribute.kind.as_gl_enum());
                        for member in ["byteOffset", "sparse"] {
                            accessor.as_object_mut().expect("it has a type").remove(member);
                        }
                        // Compression moves vertices.
                        [accessor["min"], accessor["max"]] = attribute.bounds().map(|bound| json!(bound));
                        let old = Some(old).filter(|old| taken.insert(*old));
                        let added = self.set_accessor(old, accessor, Some(attribute.stride), (&attribute.bytes, what))?;
                        *accessor_of.entry((*stream, id)).or_insert(added)
                    }
                };
                self.to.json["meshes"][mesh]["primitives"][number]["attributes"][&name] = json!(added);
            }
            let primitive = &mut self.to.json["meshes"][mesh]["primitives"][number];
            primitive["indices"] = json!(indices);
            // Strips are unpacked to triangles.
            primitive["mode"] = json!(4);
            drop_extensions(primitive, &[DRACO]);
        }
        Ok(())
    }

    /// All primitives that are compressed.
    fn packed_primitives(&self) -> Result<Vec<Primitive>> {
        let mut found: Vec<Primitive> = Vec::new();
        for (mesh, of) in items(&self.to.json["meshes"]).enumerate() {
            for (number, primitive) in items(&of["primitives"]).enumerate() {
                let Some(extension) = primitive["extensions"].get(DRACO) else { continue };
                let what = format!("mesh '{}', primitive {number}", named("mesh", of["name"].as_str(), mesh));
                let view = index(&extension["bufferView"]).and_then(|view| self.to.json["bufferViews"].get(view));
                let Some(view) = view else {
                    let view = &extension["bufferView"];
                    return Err(self.refuse(&what, format!("is compressed in the buffer view {view}, which is not there; {REMEDY}")));
                };
                let start = index(&view["byteOffset"]).unwrap_or(0);
                let end = index(&view["byteLength"]).and_then(|length| start.checked_add(length));
                let stream = index(&view["buffer"]).zip(end).map(|(buffer, end)| (buffer, start, end));
                let stream =
                    stream.ok_or_else(|| self.refuse(&what, format!("is compressed in a buffer view that says no place; {REMEDY}")))?;
                found.push(Primitive { mesh, number, what, stream });
            }
        }
        Ok(found)
    }

    /// Decodes each stream once, however many primitives it is for.
    fn decoded_streams(&self, found: &[Primitive]) -> Result<HashMap<Stream, draco::Decoded>> {
        let buffers = self.buffers(found.iter().map(|primitive| primitive.stream.0))?;
        let mut streams: BTreeMap<Stream, (&[u8], &str)> = BTreeMap::new();
        for Primitive { stream, what, .. } in found {
            let (buffer, start, end) = *stream;
            let bytes = buffers[&buffer].get(start..end);
            let bytes = bytes.ok_or_else(|| self.refuse(what, "is compressed in a buffer view that runs past its buffer"))?;
            streams.entry(*stream).or_insert((bytes, what));
        }
        let streams: Vec<_> = streams.into_iter().collect();
        let mut left = MAX_BYTES - self.to.bytes.len() as u64;
        let mut decoded = HashMap::new();
        for batch in streams.chunks(rayon::current_num_threads()) {
            let share = left / batch.len() as u64;
            let within_share: Vec<_> = batch.par_iter().map(|(_, (bytes, _))| draco::decoded(bytes, share)).collect();
            for ((stream, (bytes, what)), own) in batch.iter().zip(within_share) {
                // What needs more than its share is decoded alone.
                let own = own.or_else(|_| draco::decoded(bytes, left));
                let own = own.map_err(|reason| self.refuse(what, format!("{reason}; {REMEDY}")))?;
                left = left.checked_sub(own.bytes()).ok_or_else(|| self.refuse(what, too_large()))?;
                decoded.insert(*stream, own);
            }
        }
        Ok(decoded)
    }

    /// Gives an accessor a view of its own, of vertices with the bytes from one to the next, or of indices. It takes the place of the
    /// old one, or is one more.
    fn set_accessor(
        &mut self,
        old: Option<usize>,
        mut accessor: Value,
        stride: Option<usize>,
        (bytes, what): (&[u8], &str),
    ) -> Result<usize> {
        self.require_few(bytes, what)?;
        accessor["bufferView"] = json!(self.to.view(bytes, stride, None));
        Ok(match old.filter(|old| self.to.json["accessors"].get(*old).is_some()) {
            Some(old) => {
                self.to.json["accessors"][old] = accessor;
                old
            }
            None => self.to.push("accessors", accessor),
        })
    }
}

fn too_large() -> String {
    format!("unpacks to more than the {MAX_BYTES} bytes that all together may have")
}

fn drop_extensions(object: &mut Value, names: &[&str]) {
    let Some(extensions) = object.get_mut("extensions").and_then(Value::as_object_mut) else { return };
    extensions.retain(|name, _| !names.contains(&name.as_str()));
    if extensions.is_empty() {
        object.as_object_mut().expect("it has extensions").remove("extensions");
    }
}

/// Or what is wrong with it.
fn decoded_view(buffer: &[u8], view: &View) -> std::result::Result<Vec<u8>, String> {
    let View { count, byte_stride: stride, .. } = *view;
    let end = view.byte_offset.checked_add(view.byte_length);
    let encoded = end.and_then(|end| buffer.get(view.byte_offset..end));
    let encoded = encoded.ok_or_else(|| format!("runs past the {} bytes of its buffer", buffer.len()))?;
    let is_stride = match view.mode {
        Mode::Attributes => stride % 4 == 0 && (4..=256).contains(&stride),
        Mode::Triangles | Mode::Indices => matches!(stride, 2 | 4),
    };
    if !is_stride {
        return Err(format!("has {stride} bytes an element, which its mode does not allow"));
    }
    if view.mode == Mode::Triangles && count % 3 != 0 {
        return Err(format!("has {count} indices, no whole triangles"));
    }
    let is_filtered = match view.filter {
        Filter::None => true,
        Filter::Octahedral | Filter::Color => view.mode == Mode::Attributes && matches!(stride, 4 | 8),
        Filter::Quaternion => view.mode == Mode::Attributes && stride == 8,
        Filter::Exponential => view.mode == Mode::Attributes,
    };
    if !is_filtered {
        return Err(format!("has a filter that is not for {stride} bytes an element"));
    }
    // What it unpacks to is known to be allowed.
    let work = &mut Workspace::new(Limits { max_bytes: usize::MAX, max_work: u64::MAX });
    let decoded = match view.mode {
        Mode::Attributes => decode_vertex_buffer(count, stride, encoded, work),
        Mode::Triangles => decode_index_buffer(count, stride, encoded, work),
        Mode::Indices => decode_index_sequence(count, stride, encoded, work),
    };
    let filtered = decoded.and_then(|mut decoded| {
        match view.filter {
            Filter::None => Ok(()),
            Filter::Octahedral => decode_filter_oct(&mut decoded, count, stride, work),
            Filter::Quaternion => decode_filter_quat(&mut decoded, count, stride, work),
            Filter::Exponential => decode_filter_exp(&mut decoded, count, stride, work),
            Filter::Color => decode_filter_color(&mut decoded, count, stride, work),
        }?;
        Ok(decoded)
    });
    filtered.map_err(|_| format!("cannot be decoded; {REMEDY}"))
}
