//! Faults of a file that the `gltf` crate would overlook, or end the program for.

/// Checks the length that a .glb announces: a file that was cut off is not to be read as far as it goes.
pub(super) fn binary_length(content: &[u8]) -> Result<(), String> {
    if !content.starts_with(b"glTF") {
        return Ok(());
    }
    let announced = content.get(8..12).map_or(0, |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize);
    if announced != content.len() {
        return Err(format!("announces {announced} bytes and has {}", content.len()));
    }
    Ok(())
}

/// Members without which the `gltf` crate would stop the program.
pub(super) fn missing_members(root: &gltf::json::Root) -> Result<(), String> {
    use gltf::json::validation::Checked;
    for (number, mesh) in root.meshes.iter().enumerate() {
        for (place, primitive) in mesh.primitives.iter().enumerate() {
            let mut accessors = primitive.attributes.values().chain(&primitive.indices).map(gltf::json::Index::value);
            if let Some(accessor) = accessors.find(|accessor| *accessor >= root.accessors.len()) {
                return Err(format!("has a mesh {number} whose primitive {place} uses accessor {accessor} of {}", root.accessors.len()));
            }
        }
    }
    for (number, image) in root.images.iter().enumerate() {
        if image.uri.is_none() && (image.buffer_view.is_none() || image.mime_type.is_none()) {
            return Err(format!("has an image {number} with neither a URI nor a buffer view and its MIME type"));
        }
    }
    for (number, camera) in root.cameras.iter().enumerate() {
        let whole = match camera.type_ {
            Checked::Valid(gltf::json::camera::Type::Perspective) => camera.perspective.is_some(),
            Checked::Valid(gltf::json::camera::Type::Orthographic) => camera.orthographic.is_some(),
            Checked::Invalid => true,
        };
        if !whole {
            return Err(format!("has a camera {number} without the numbers of its type"));
        }
    }
    Ok(())
}
