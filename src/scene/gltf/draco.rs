//! Meshes that Draco has compressed.

use std::collections::HashMap;

use draco_core::decode_limits::DecodeLimits;
use draco_core::{DataType, DecoderBuffer, FaceIndex, Mesh, MeshDecoder, PointIndex};

/// Of one mesh: more would not be read anyhow.
const MAX_COUNT: u64 = 100_000_000;
const MAX_BYTES: u64 = 1 << 30;

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
    /// By glTF's numbers.
    pub(super) component_type: u32,
}

/// Or what is wrong with it.
pub(super) fn decoded(bytes: &[u8]) -> Result<Decoded, String> {
    let limits = DecodeLimits::default().with_max_points(MAX_COUNT).with_max_faces(MAX_COUNT).with_max_decoded_bytes(MAX_BYTES);
    let mut mesh = Mesh::new();
    let decoded = MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh);
    decoded.map_err(|error| format!("has a Draco stream that cannot be decoded ({error})"))?;
    let points = mesh.num_points();
    let corners = (0..mesh.num_faces() as u32).flat_map(|face| mesh.face(FaceIndex(face)));
    let indices: Vec<u32> = corners.map(|point| point.0).collect();
    let mut attributes = HashMap::new();
    for number in 0..mesh.num_attributes() {
        let attribute = mesh.attribute(number);
        let (component_type, width) = match attribute.data_type() {
            DataType::Int8 => (5120, 1),
            DataType::Uint8 | DataType::Bool => (5121, 1),
            DataType::Int16 => (5122, 2),
            DataType::Uint16 => (5123, 2),
            DataType::Uint32 => (5125, 4),
            DataType::Float32 => (5126, 4),
            other => return Err(format!("has a Draco stream with numbers that glTF does not have ({other:?})")),
        };
        let size = width * usize::from(attribute.num_components());
        let stride = size.next_multiple_of(4);
        let (values, step) = (attribute.buffer().data(), attribute.byte_stride().max(0) as usize);
        let mut bytes = vec![0; points * stride];
        for (point, own) in bytes.chunks_exact_mut(stride.max(1)).enumerate() {
            let from = attribute.mapped_index(PointIndex(point as u32)).0 as usize * step;
            let value = values.get(from..from + size).ok_or("has a Draco stream that names values that it has not")?;
            own[..size].copy_from_slice(value);
        }
        attributes
            .insert(u64::from(attribute.unique_id()), Attribute { bytes, stride, components: attribute.num_components(), component_type });
    }
    Ok(Decoded { indices, points, attributes })
}
