//! Meshes that Draco has compressed.

use std::collections::HashMap;

use draco_core::decode_limits::DecodeLimits;
use draco_core::{DataType, DecoderBuffer, FaceIndex, Mesh, MeshDecoder, PointIndex};
use gltf::accessor::DataType as Kind;

use super::accessor::stored;

/// Of one mesh: more would not be read anyhow, and a decoder needs memory beside what it decodes.
const MAX_COUNT: u64 = 100_000_000;

/// A mesh as accessors have it.
pub(super) struct Decoded {
    pub(super) indices: Vec<u32>,
    pub(super) points: usize,
    /// By the numbers that the file knows them by.
    pub(super) attributes: HashMap<u64, Attribute>,
}

/// One value a point.
pub(super) struct Attribute {
    pub(super) bytes: Vec<u8>,
    /// Bytes from one point's to the next.
    pub(super) stride: usize,
    pub(super) components: u8,
    pub(super) kind: Kind,
}

impl Decoded {
    pub(super) fn bytes(&self) -> u64 {
        let attributes: usize = self.attributes.values().map(|attribute| attribute.bytes.len()).sum();
        (size_of_val(&self.indices[..]) + attributes) as u64
    }
}

impl Attribute {
    /// The smallest and the largest number of each component, as accessors say them.
    pub(super) fn bounds(&self) -> [Vec<f64>; 2] {
        let width = self.kind.size();
        let of = |choose: fn(f64, f64) -> f64| -> Vec<f64> {
            let component = |k: usize| {
                let all = self.bytes.chunks_exact(self.stride.max(1)).map(|point| stored(&point[k * width..(k + 1) * width], self.kind));
                all.filter(|number| number.is_finite()).reduce(choose).unwrap_or(0.0)
            };
            (0..usize::from(self.components)).map(component).collect()
        };
        [of(f64::min), of(f64::max)]
    }
}

/// What takes no more bytes than that; or what is wrong with it.
pub(super) fn decoded(bytes: &[u8], most_bytes: u64) -> Result<Decoded, String> {
    let limits = DecodeLimits::default()
        .with_max_points(most_bytes.min(MAX_COUNT))
        .with_max_faces((most_bytes / 12).min(MAX_COUNT))
        .with_max_decoded_bytes(most_bytes);
    let mut mesh = Mesh::new();
    let decoded = MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh);
    decoded.map_err(|error| format!("has a Draco stream that cannot be decoded ({error})"))?;
    let points = mesh.num_points();
    let corners = (0..mesh.num_faces() as u32).flat_map(|face| mesh.face(FaceIndex(face)));
    let indices: Vec<u32> = corners.map(|point| point.0).collect();
    let mut left = most_bytes.saturating_sub(size_of_val(&indices[..]) as u64);
    let mut attributes = HashMap::new();
    for number in 0..mesh.num_attributes() {
        let attribute = mesh.attribute(number);
        let kind = match attribute.data_type() {
            DataType::Int8 => Kind::I8,
            DataType::Uint8 | DataType::Bool => Kind::U8,
            DataType::Int16 => Kind::I16,
            DataType::Uint16 => Kind::U16,
            DataType::Uint32 => Kind::U32,
            DataType::Float32 => Kind::F32,
            other => return Err(format!("has a Draco stream with numbers that glTF does not have ({other:?})")),
        };
        let size = kind.size() * usize::from(attribute.num_components());
        let stride = size.next_multiple_of(4);
        left = left.checked_sub((points * stride) as u64).ok_or("has a Draco stream of more bytes than may be unpacked")?;
        let (values, step) = (attribute.buffer().data(), attribute.byte_stride().max(0) as usize);
        let mut bytes = vec![0; points * stride];
        for (point, own) in bytes.chunks_exact_mut(stride.max(1)).enumerate() {
            let from = attribute.mapped_index(PointIndex(point as u32)).0 as usize * step;
            let value = values.get(from..from + size).ok_or("has a Draco stream that names values that it has not")?;
            own[..size].copy_from_slice(value);
        }
        attributes.insert(u64::from(attribute.unique_id()), Attribute { bytes, stride, components: attribute.num_components(), kind });
    }
    Ok(Decoded { indices, points, attributes })
}
