//! Numbers out of glTF buffers, with every offset checked: a file from anywhere may say anything.

use std::collections::HashMap;
use std::sync::OnceLock;

use gltf::accessor::{DataType, Dimensions};
use gltf::json::accessor::GenericComponentType;
use gltf::json::validation::Checked;
use gltf::{Accessor, buffer};
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::Value;

use super::Loader;
use crate::error::Result;

/// Elements that are not worth sharing among threads.
pub(super) const MIN_PIECE: usize = 4096;

/// Elements of `size` bytes, every `stride` bytes.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
    /// What a sparse accessor puts in the place of some.
    replaced: HashMap<usize, &'a [u8]>,
}

impl<'a> Elements<'a> {
    fn element(&self, index: usize) -> &'a [u8] {
        if !self.replaced.is_empty()
            && let Some(element) = self.replaced.get(&index)
        {
            return element;
        }
        &self.bytes[index * self.stride..index * self.stride + self.size]
    }
}

/// `N` numbers of every element, or of those that `vertices` numbers, as `make` makes something of them. Integers are
/// scaled to [0, 1] or [-1, 1] where the accessor says so.
pub(super) fn read<const N: usize, T: Send>(
    loader: &Loader,
    accessor: &Accessor,
    vertices: &Vertices,
    what: &str,
    make: impl Fn([f32; N]) -> T + Sync,
) -> Result<Vec<T>> {
    let size = accessor.data_type().size();
    let elements = elements(loader, accessor, components(N), what)?;
    let (kind, normalized) = (accessor.data_type(), accessor.normalized());
    // Beside the result: a vector of results would be made in pieces and copied.
    let not_finite = OnceLock::new();
    let made = |index: usize| {
        let element = elements.element(index);
        let numbers: [f32; N] = std::array::from_fn(|k| number(&element[k * size..(k + 1) * size], kind, normalized));
        if let Some(number) = numbers.iter().find(|number| !number.is_finite()) {
            not_finite.get_or_init(|| *number);
        }
        make(numbers)
    };
    let made = match vertices {
        Vertices::All => (0..elements.count).into_par_iter().with_min_len(MIN_PIECE).map(made).collect(),
        Vertices::Some(numbers) => numbers.par_iter().with_min_len(MIN_PIECE).map(|index| made(*index as usize)).collect(),
    };
    match not_finite.get() {
        Some(number) => Err(loader.refuse(what, format!("holds {number}; every number must be finite"))),
        None => Ok(made),
    }
}

/// Indices of vertices.
pub(super) fn read_indices(loader: &Loader, accessor: &Accessor, what: &str) -> Result<Vec<u32>> {
    let are_unsigned = matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32);
    loader.require(are_unsigned, what, || "has indices that are no unsigned integers".into())?;
    let elements = elements(loader, accessor, Dimensions::Scalar, what)?;
    Ok((0..elements.count).into_par_iter().with_min_len(MIN_PIECE).map(|index| integer(elements.element(index))).collect())
}

/// Four unsigned integers an element: the joints of a skinned vertex.
pub(super) fn read_joints(loader: &Loader, accessor: &Accessor, vertices: &Vertices, what: &str) -> Result<Vec<[u16; 4]>> {
    let are_unsigned = matches!(accessor.data_type(), DataType::U8 | DataType::U16);
    loader.require(are_unsigned, what, || "has joints that are no unsigned integers of 8 or 16 bits".into())?;
    read(loader, accessor, vertices, what, |numbers: [f32; 4]| numbers.map(|number| number as u16))
}

/// Which of its vertices a primitive uses, as several may share them.
pub(super) enum Vertices {
    All,
    /// In rising order.
    Some(Vec<u32>),
}

fn components(count: usize) -> Dimensions {
    match count {
        1 => Dimensions::Scalar,
        2 => Dimensions::Vec2,
        3 => Dimensions::Vec3,
        4 => Dimensions::Vec4,
        _ => Dimensions::Mat4,
    }
}

/// The kind of numbers that a `componentType` says; `None` of those that glTF does not have.
pub(super) fn kind_of(component_type: &Value) -> Option<DataType> {
    match Checked::deserialize(component_type) {
        Ok(Checked::Valid(GenericComponentType(kind))) => Some(kind),
        _ => None,
    }
}

/// The little-endian unsigned integer in one to four bytes.
#[inline]
pub(super) fn integer(bytes: &[u8]) -> u32 {
    match *bytes {
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
        _ => bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte)),
    }
}

/// A number as it is stored.
#[inline]
pub(super) fn stored(bytes: &[u8], kind: DataType) -> f64 {
    let bits = integer(bytes);
    match kind {
        DataType::F32 => f64::from(f32::from_bits(bits)),
        DataType::I8 => f64::from(bits as u8 as i8),
        DataType::I16 => f64::from(bits as u16 as i16),
        DataType::U8 | DataType::U16 | DataType::U32 => f64::from(bits),
    }
}

/// What whole numbers are divided by where they stand for shares.
pub(super) fn largest(kind: DataType) -> f64 {
    match kind {
        DataType::F32 => 1.0,
        DataType::I8 => 127.0,
        DataType::U8 => 255.0,
        DataType::I16 => 32_767.0,
        DataType::U16 => 65_535.0,
        DataType::U32 => f64::from(u32::MAX),
    }
}

#[inline]
fn number(bytes: &[u8], kind: DataType, normalized: bool) -> f32 {
    let value = stored(bytes, kind) as f32;
    if normalized && kind != DataType::F32 { (value / largest(kind) as f32).max(-1.0) } else { value }
}

/// The bytes of every element, sparse replacements made.
fn elements<'a>(loader: &'a Loader, accessor: &Accessor, dimensions: Dimensions, what: &str) -> Result<Elements<'a>> {
    let found = accessor.dimensions();
    loader.require(found == dimensions, what, || format!("is of type {found:?} where {dimensions:?} is wanted"))?;
    let size = accessor.data_type().size() * dimensions.multiplicity();
    let count = accessor.count();
    let mut elements = match accessor.view() {
        Some(view) => slice(loader, &view, accessor.offset(), count, size, what)?,
        // Without a view the accessor holds zeros; a count that no file backs must not fill memory.
        None if count <= loader.file_bytes + loader.buffers.iter().map(Vec::len).sum::<usize>() => {
            Elements { bytes: &[0u8; 64], stride: 0, size, count, replaced: HashMap::new() }
        }
        None => return Err(loader.refuse(what, format!("claims {count} elements that the file does not hold"))),
    };
    if let Some(sparse) = accessor.sparse() {
        let (indices, values) = (sparse.indices(), sparse.values());
        let index_size = match indices.index_type() {
            gltf::accessor::sparse::IndexType::U8 => 1,
            gltf::accessor::sparse::IndexType::U16 => 2,
            gltf::accessor::sparse::IndexType::U32 => 4,
        };
        let replaced = slice(loader, &indices.view(), indices.offset(), sparse.count(), index_size, what)?;
        let by = slice(loader, &values.view(), values.offset(), sparse.count(), size, what)?;
        for k in 0..sparse.count() {
            let index = integer(replaced.element(k)) as usize;
            loader.require(index < count, what, || format!("replaces element {index} of {count}"))?;
            elements.replaced.insert(index, by.element(k));
        }
    }
    Ok(elements)
}

/// `count` elements of `size` bytes from `offset` in a buffer view.
fn slice<'a>(loader: &'a Loader, view: &buffer::View, offset: usize, count: usize, size: usize, what: &str) -> Result<Elements<'a>> {
    let stride = view.stride().unwrap_or(size);
    let bytes = view_bytes(loader, view, what)?;
    let end = match count {
        0 => Some(offset),
        _ => (count - 1).checked_mul(stride).and_then(|last| last.checked_add(size)).and_then(|length| length.checked_add(offset)),
    };
    match end.and_then(|end| bytes.get(offset..end)) {
        Some(bytes) if stride >= size => Ok(Elements { bytes, stride, size, count, replaced: HashMap::new() }),
        Some(_) => Err(loader.refuse(what, format!("has elements of {size} bytes every {stride} bytes"))),
        None => Err(loader.refuse(what, format!("runs past the {} bytes of buffer view {}", bytes.len(), view.index()))),
    }
}

/// The bytes of a buffer view, as far as its buffer has them.
pub(super) fn view_bytes<'a>(loader: &'a Loader, view: &buffer::View, what: &str) -> Result<&'a [u8]> {
    let buffer = &loader.buffers[view.buffer().index()];
    let end = view.offset().saturating_add(view.length()).min(buffer.len());
    buffer.get(view.offset()..end).ok_or_else(|| {
        loader.refuse(what, format!("lies in buffer view {}, which begins past the {} bytes of its buffer", view.index(), buffer.len()))
    })
}
