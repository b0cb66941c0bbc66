//! A file with what only extensions bring: instances, an animation, compression, WebP and KTX 2 pictures.

use draco_core::{DataType, EncoderBuffer, EncoderOptions, GeometryAttributeType, Mesh, MeshEncoder, PointAttribute};
use image::{ImageFormat, RgbImage};
use serde_json::{Value, json};

use super::gltf_file::{add_accessor, data_uri, encoded, floats, set_buffer, square, square_buffer};

/// The square, with keys of its translation at 1, 2 and 4 s, of its rotation at 0 and 2 s, and a second node whose scale has one key.
pub fn animated() -> Value {
    let mut value = square();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let times = add_accessor(&mut value, &floats(&[1., 2., 4.]), 5126, 3, "SCALAR");
    let places = add_accessor(&mut value, &floats(&[0., 0., 0., 10., 0., 0., 10., 20., 0.]), 5126, 3, "VEC3");
    let turn_times = add_accessor(&mut value, &floats(&[0., 2.]), 5126, 2, "SCALAR");
    let turns: Vec<u8> =
        [0f32, 0., 0., 1., 0., 0., half, half].iter().flat_map(|of| ((of * 32767.).round() as i16).to_le_bytes()).collect();
    let turns = add_accessor(&mut value, &turns, 5122, 2, "VEC4");
    value["accessors"][turns]["normalized"] = json!(true);
    let once = add_accessor(&mut value, &floats(&[3.]), 5126, 1, "SCALAR");
    let wide = add_accessor(&mut value, &floats(&[5., 5., 5.]), 5126, 1, "VEC3");
    value["nodes"].as_array_mut().unwrap().push(json!({"name": "twin", "mesh": 0}));
    value["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(5));
    let channel = |sampler: usize, node: usize, path: &str| json!({"sampler": sampler, "target": {"node": node, "path": path}});
    value["animations"] = json!([{"name": "move",
        "channels": [channel(0, 0, "translation"), channel(1, 0, "rotation"), channel(2, 5, "scale"),
            {"sampler": 0, "target": {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0"}}}}],
        "samplers": [
            {"input": times, "output": places}, {"input": turn_times, "output": turns, "interpolation": "LINEAR"},
            {"input": once, "output": wide, "interpolation": "STEP"}]
    }, {"channels": [], "samplers": []}]);
    value
}

/// The square at three places, one of them turned, each twice as large.
pub fn instanced() -> Value {
    let mut value = square();
    let places = add_accessor(&mut value, &floats(&[0., 0., 0., 5., 0., 0., 0., 7., 0.]), 5126, 3, "VEC3");
    let turns = add_accessor(&mut value, &[0, 0, 0, 127, 0, 0, 0, 127, 0, 127, 0, 0], 5120, 3, "VEC4");
    value["accessors"][turns]["normalized"] = json!(true);
    let scales = add_accessor(&mut value, &floats(&[2.; 9]), 5126, 3, "VEC3");
    value["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] =
        json!({"TRANSLATION": places, "ROTATION": turns, "SCALE": scales, "_ID": 0});
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("EXT_mesh_gpu_instancing"));
    value["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    value
}

/// The square with every view compressed, normals by the octahedral filter, indices as triangles, and a buffer that only stands for
/// what is decoded.
pub fn compressed(extension: &str) -> Value {
    let mut value = square();
    let bytes = square_buffer();
    let positions = meshopt::encode_vertex_buffer(&bytemuck::pod_collect_to_vec::<u8, [u32; 3]>(&bytes[..48])).unwrap();
    let normals = meshopt::encode_vertex_buffer(&[[0i8, 0, 127, 0]; 4]).unwrap();
    let places = meshopt::encode_vertex_buffer(&bytemuck::pod_collect_to_vec::<u8, [u32; 2]>(&bytes[96..128])).unwrap();
    let indices = meshopt::encode_index_buffer(&[0u32, 1, 2, 0, 2, 3], 4).unwrap();
    let (mut buffer, mut offset) = (Vec::new(), 0);
    let parts: [(&[u8], Value); 4] = [
        (&positions, json!({"byteStride": 12, "count": 4, "mode": "ATTRIBUTES"})),
        (&normals, json!({"byteStride": 4, "count": 4, "mode": "ATTRIBUTES", "filter": "OCTAHEDRAL"})),
        (&places, json!({"byteStride": 8, "count": 4, "mode": "ATTRIBUTES", "filter": "NONE"})),
        (&indices, json!({"byteStride": 2, "count": 6, "mode": "TRIANGLES"})),
    ];
    for (number, (encoded, mut of)) in parts.into_iter().enumerate() {
        (of["buffer"], of["byteOffset"], of["byteLength"]) = (json!(0), json!(buffer.len()), json!(encoded.len()));
        buffer.extend(encoded);
        let length = of["byteStride"].as_u64().unwrap() * of["count"].as_u64().unwrap();
        value["bufferViews"][number] = json!({"buffer": 1, "byteOffset": offset, "byteLength": length, "extensions": {extension: of}});
        offset += length;
    }
    value["bufferViews"][1]["byteStride"] = json!(4);
    value["accessors"][1] = json!({"bufferView": 1, "componentType": 5120, "normalized": true, "count": 4, "type": "VEC3"});
    value["buffers"] = json!([{}, {"byteLength": offset, "extensions": {extension: {"fallback": true}}}]);
    set_buffer(&mut value, &buffer);
    let used = value["extensionsUsed"].as_array_mut().unwrap();
    used.extend([json!(extension), json!("KHR_mesh_quantization")]);
    value["extensionsRequired"] = json!([extension]);
    value
}

/// The square with a picture that only the extension names.
pub fn with_webp() -> Value {
    let mut value = square();
    let picture = RgbImage::from_fn(2, 1, |i, _| image::Rgb(if i == 0 { [255, 0, 0] } else { [0, 255, 0] }));
    value["images"] = json!([{"uri": data_uri("image/webp", &encoded(&picture, ImageFormat::WebP))}]);
    value["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]);
    value["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("EXT_texture_webp"));
    value
}

/// The square with its mesh compressed by Draco.
pub fn draco_square() -> Value {
    let (mut value, buffer) = (square(), square_buffer());
    let mut mesh = Mesh::new();
    for (kind, components, bytes) in [
        (GeometryAttributeType::Position, 3, &buffer[..48]),
        (GeometryAttributeType::Normal, 3, &buffer[48..96]),
        (GeometryAttributeType::TexCoord, 2, &buffer[96..128]),
    ] {
        let mut attribute = PointAttribute::new();
        attribute.init(kind, components, DataType::Float32, false, 4);
        attribute.buffer_mut().write(0, bytes);
        mesh.add_attribute(attribute);
    }
    mesh.set_num_faces(2);
    mesh.set_faces_from_flat_indices(&[0, 1, 2, 0, 2, 3]);
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut out = EncoderBuffer::new();
    encoder.encode(&EncoderOptions::new(), &mut out).unwrap();
    set_buffer(&mut value, out.data());
    value["bufferViews"] = json!([{"buffer": 0, "byteLength": out.data().len()}, {"buffer": 0, "byteLength": 20}]);
    for accessor in value["accessors"].as_array_mut().unwrap() {
        accessor.as_object_mut().unwrap().remove("bufferView");
    }
    let numbers = json!({"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2});
    value["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": numbers}});
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_draco_mesh_compression"));
    value["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    value
}

/// A picture of blocks of 4 x 4 texels beside each other, each of one colour, as UASTC in a KTX 2 container.
pub fn ktx2(blocks: &[[u8; 4]]) -> Vec<u8> {
    let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    let size = 16 * blocks.len() as u64;
    // Format, bytes of a number, width, height, depth, layers, faces, levels, compression; where its description lies.
    let header = [0, 1, 4 * blocks.len() as u32, 4, 0, 0, 1, 1, 0, 80 + 24, 44, 0, 0, 0, 0, 0, 0];
    bytes.extend_from_slice(bytemuck::bytes_of(&header));
    bytes.extend_from_slice(bytemuck::bytes_of(&[80 + 24 + 44, size, size]));
    // UASTC, primaries of sRGB and its curve, 4 x 4 texels in 16 bytes, one sample of all four channels.
    let description = [44, 0, 2 | 40 << 16, 166 | 1 << 8 | 2 << 16, 3 | 3 << 8, 16, 0, 127 << 16 | 3 << 24, 0, 0, u32::MAX];
    bytes.extend_from_slice(bytemuck::bytes_of(&description));
    for colour in blocks {
        // Mode 8: one colour behind five bits.
        let block = 0x17 | u128::from(u32::from_le_bytes(*colour)) << 5;
        bytes.extend(block.to_le_bytes());
    }
    bytes
}

/// The same with its blocks in a frame of Zstandard, which holds them as they are: fewer than 16 of them.
pub fn ktx2_in_zstandard(blocks: &[[u8; 4]]) -> Vec<u8> {
    let mut bytes = ktx2(blocks);
    let texels = bytes.split_off(80 + 24 + 44);
    // Its mark, one byte for its length, one block, which is the last.
    bytes.extend([0x28, 0xb5, 0x2f, 0xfd, 0x20, texels.len() as u8]);
    bytes.extend(&(1 | (texels.len() as u32) << 3).to_le_bytes()[..3]);
    bytes.extend(&texels);
    bytes[44] = 2;
    bytes[88..96].copy_from_slice(&(texels.len() as u64 + 9).to_le_bytes());
    bytes
}

/// The square with a picture that only KHR_texture_basisu names.
pub fn with_ktx2(picture: &[u8]) -> Value {
    let mut value = with_webp();
    value["images"][0] = json!({"mimeType": "image/ktx2", "uri": data_uri("image/ktx2", picture)});
    value["textures"][0]["extensions"] = json!({"KHR_texture_basisu": {"source": 0}});
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_texture_basisu"));
    value["extensionsRequired"] = json!(["KHR_texture_basisu"]);
    value
}

/// The square under a sky of six sides, red, the k-th as bright as k, counted from 1, of 8 x 8 texels, of which the
/// upper left one is green, as bright as 5.
pub fn with_image_light() -> Value {
    let mut value = square();
    let side = |number: u8| {
        // Codes over alpha as the extension packs them: 255 of 1, and beyond with less.
        let colour = |x: u32, y: u32| if (x, y) == (0, 0) { [0, 255, 0, 51] } else { [255, 0, 0, 255 / (number + 1)] };
        let picture = image::RgbaImage::from_fn(8, 8, |x, y| image::Rgba(colour(x, y)));
        json!({"uri": data_uri("image/png", &encoded(&picture, ImageFormat::Png))})
    };
    value["images"] = (0..6).map(side).collect();
    let light = json!({"name": "studio", "intensity": 2, "specularImages": [[0, 1, 2, 3, 4, 5]], "specularImageSize": 8,
        "irradianceCoefficients": [[1, 1, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]});
    value["extensions"]["EXT_lights_image_based"] = json!({"lights": [light]});
    value["scenes"][0]["extensions"] = json!({"EXT_lights_image_based": {"light": 0}});
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("EXT_lights_image_based"));
    value
}
