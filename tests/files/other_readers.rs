//! What glTF forbids and other readers take: the table on the guide's page of scenes says which of it this one takes.

use super::gltf::{assert_refusal, assert_refused, assert_said, load, open, with_image};
use crate::common::gltf_file::{data_uri, encoded, push, set_buffer, square, square_buffer};
use crate::common::prelude::*;
use image::{ImageFormat, RgbImage};
use photonmill::scene::gltf::source;
use serde_json::{Value, json};

pub fn noise() -> RgbImage {
    RgbImage::from_fn(64, 64, |i, j| image::Rgb([(37 * i * j) as u8, (91 * i + j) as u8, (i ^ j) as u8]))
}

#[test]
fn data_uris_may_be_broken_into_lines_or_escaped() {
    let whole = square()["buffers"][0]["uri"].as_str().unwrap().to_owned();
    let (head, body) = whole.split_once(',').unwrap();
    let lines: Vec<&str> = (0..body.len()).step_by(76).map(|start| &body[start..(start + 76).min(body.len())]).collect();
    let escaped = body.replace('A', "%41").replace('/', "%2F").replace('+', "%2b").replace('=', "%3D");
    for uri in [
        format!("{head},{}", lines.join("\n")),
        format!("{head}, {}\r\n", lines.join("\r\n ")),
        format!("{head},{escaped}"),
        format!("{},{body}", head.replace("data:", "DATA:").replace("base64", "BASE64")),
        format!("{head},{}", body.trim_end_matches('=')),
        format!("data:,{}", square_buffer().iter().map(|byte| format!("%{byte:02x}")).collect::<String>()),
    ] {
        let mut value = square();
        value["buffers"][0]["uri"] = json!(uri);
        assert_eq!(load(&value).unwrap().meshes[0].positions[2], DVec3::new(3.0, 4.0, 3.0), "{}", &uri[..40]);
    }
}

/// A whole picture whose end is not marked is that picture, baseline or with marks for restarts.
#[test]
fn a_jpeg_may_lack_the_mark_of_its_end() {
    let texels = |bytes: &[u8]| load(&with_image(json!({"uri": data_uri("image/jpeg", bytes)}))).unwrap().textures[0].texels.clone();
    let jpeg = encoded(&noise(), ImageFormat::Jpeg);
    assert!(jpeg.ends_with(&[0xff, 0xd9]));
    let whole = texels(&jpeg);
    for missing in [1, 2] {
        assert!(texels(&jpeg[..jpeg.len() - missing]) == whole, "without {missing} bytes");
    }
}

#[test]
fn pictures_in_views_need_not_say_their_kind() {
    let mut value = with_image(json!({"bufferView": 4}));
    let (bytes, png) = (square_buffer(), encoded(&noise(), ImageFormat::Png));
    push(&mut value["bufferViews"], json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": png.len()}));
    set_buffer(&mut value, &[bytes, png].concat());
    assert_eq!(load(&value).unwrap().textures[0].width, 64);
}

#[test]
fn strides_and_targets_of_0_are_none() {
    let mut value = square();
    for view in value["bufferViews"].as_array_mut().unwrap() {
        (view["byteStride"], view["target"]) = (json!(0), json!(0));
    }
    assert_eq!(load(&value).unwrap().meshes[0].positions, load(&square()).unwrap().meshes[0].positions);
}

#[test]
fn the_text_of_a_binary_file_may_begin_with_a_mark_and_end_with_zeros() {
    for (before, after) in [(&b"\xef\xbb\xbf"[..], &b""[..]), (b"", b"\0\0\0"), (b"\xef\xbb\xbf", b" \0")] {
        let mut text = [before, square().to_string().as_bytes(), after].concat();
        text.resize(text.len().next_multiple_of(4), if after.is_empty() { b' ' } else { 0 });
        let chunk = [&(text.len() as u32).to_le_bytes(), b"JSON".as_slice(), &text].concat();
        let file = [b"glTF".as_slice(), &2u32.to_le_bytes(), &(12 + chunk.len() as u32).to_le_bytes(), &chunk].concat();
        assert_eq!(open("scene.glb", &file).unwrap().triangle_count(), 2);
        // What writes it again reads it too.
        let place = Place::new();
        place.write("a.glb", &file);
        assert!(source::File::open(&place.at("a.glb")).unwrap().json["asset"].is_object());
    }
}

#[test]
fn names_of_pictures_may_be_those_of_servers_and_of_windows() {
    let place = Place::new();
    std::fs::create_dir(place.at("maps")).unwrap();
    let png = encoded(&noise(), ImageFormat::Png);
    for name in ["maps/a.png", "100%.png", "what?.png"] {
        place.write(name, &png);
    }
    let file = place.at("scene.gltf");
    let open = |uri: &str| {
        place.write("scene.gltf", with_image(json!({"uri": uri})).to_string());
        Scene::open(file.to_str().unwrap(), false)
    };
    for uri in
        ["maps/a.png?v=2", "maps/a.png#top", "maps\\a.png", ".\\maps\\a.png?v=2", "maps%5Ca.png", "100%.png", "what?.png", "what%3F.png"]
    {
        assert_eq!(open(uri).map(|scene| scene.textures[0].width).map_err(|error| error.to_string()), Ok(64), "{uri}");
    }
    for uri in ["..\\a.png", "maps\\..\\..\\a.png", "..%5Ca.png?v=2"] {
        assert_refusal(open(uri), &["outside the scene's folder"]);
    }
    // Written again beside a file that names it, it has the name by which it was found.
    open("maps\\a.png?v=2").unwrap();
    let beside: Vec<String> = source::File::open(&file).unwrap().beside().into_iter().map(|beside| beside.name).collect();
    assert_eq!(beside, ["maps/a.png"]);
}

#[test]
fn the_first_version_is_called_so() {
    let old = json!({"asset": {"version": "1.0"}, "meshes": {"a": {}}, "nodes": {"b": {"meshes": ["a"]}}, "scenes": {"c": {}}});
    let mut unnamed = old.clone();
    unnamed.as_object_mut().unwrap().remove("asset");
    let binary =
        [b"glTF".as_slice(), &1u32.to_le_bytes(), &24u32.to_le_bytes(), &4u32.to_le_bytes(), &0u32.to_le_bytes(), b"{  }"].concat();
    for (name, content) in [("a.gltf", old.to_string().into_bytes()), ("b.gltf", unnamed.to_string().into_bytes()), ("c.glb", binary)] {
        assert_refusal(open(name, &content), &["is of glTF 1.0", "gltf-pipeline"]);
    }
}

#[test]
fn a_file_without_scenes_has_all_its_nodes() {
    let mut value = square();
    value.as_object_mut().unwrap().remove("scenes");
    value["nodes"][1]["children"] = json!([5]);
    push(&mut value["nodes"], json!({"mesh": 0, "translation": [0, 0, 2]}));
    let scene = load(&value).unwrap();
    assert_eq!((scene.meshes.len(), scene.cameras.len(), scene.lights.len()), (2, 1, 3));
    // Below the camera, which stands at 5.
    assert!(scene.meshes.iter().any(|mesh| mesh.positions[0] == DVec3::Z * 7.0));
    value["scenes"] = json!([]);
    assert_eq!(load(&value).unwrap().meshes.len(), 2);
    value.as_object_mut().unwrap().remove("nodes");
    assert_refused(&value, &["neither a scene nor a node"]);
}

/// Bytes that are announced and not there matter where something lies in them.
#[test]
fn only_the_bytes_that_are_used_must_be_there() {
    let mut value = square();
    let length = value["buffers"][0]["byteLength"].as_u64().unwrap();
    value["buffers"][0]["byteLength"] = json!(length + 1000);
    let views = value["bufferViews"].as_array_mut().unwrap();
    let last = views.iter_mut().max_by_key(|view| view["byteOffset"].as_u64().unwrap_or(0)).unwrap();
    last["byteLength"] = json!(last["byteLength"].as_u64().unwrap() + 2);
    let scene = load(&value).unwrap();
    assert_eq!(scene.meshes[0].triangles.len(), load(&square()).unwrap().meshes[0].triangles.len());
    assert_said(&scene.warnings, &["1000 bytes that are announced and not there"]);
    value["bufferViews"].as_array_mut().unwrap().iter_mut().for_each(|view| view["byteOffset"] = json!(length - 4));
    assert_refused(&value, &["runs past the 4 bytes of buffer view"]);
}

/// A wider inner cone has a sharp edge, an outer cone ends at half pi, one of 0 lights nothing, and where there is none it has a quarter
/// of pi.
#[test]
fn cones_of_spot_lights_are_brought_into_their_range() {
    for (spot, expected, is_named) in [
        (json!({"innerConeAngle": 0.2, "outerConeAngle": 0.5}), Some(DVec2::new(0.2, 0.5)), false),
        (json!({"innerConeAngle": 0.5, "outerConeAngle": 0.5}), Some(DVec2::new(0.4995, 0.5)), false),
        (json!({"innerConeAngle": 0.7, "outerConeAngle": 0.5}), Some(DVec2::new(0.4995, 0.5)), false),
        (json!({"innerConeAngle": 0.2, "outerConeAngle": 1.6}), Some(DVec2::new(0.2, FRAC_PI_2)), true),
        (json!({"innerConeAngle": 1.6, "outerConeAngle": 1.6}), Some(DVec2::new(0.999, 1.0) * FRAC_PI_2), true),
        (json!({"innerConeAngle": 0, "outerConeAngle": 0}), None, true),
        (Value::Null, Some(DVec2::new(0.0, 0.5 * FRAC_PI_2)), false),
    ] {
        let mut value = square();
        value["extensions"]["KHR_lights_punctual"]["lights"][2]["spot"] = spot.clone();
        if spot.is_null() {
            value["extensions"]["KHR_lights_punctual"]["lights"][2].as_object_mut().unwrap().remove("spot");
        }
        let scene = load(&value).unwrap();
        let cone = scene.lights.iter().find_map(|light| match light.kind {
            LightKind::Spot { inner_angle, outer_angle, .. } => Some(Vec2::new(inner_angle, outer_angle).as_dvec2()),
            _ => None,
        });
        let is_near = pairs(cone, expected).all(|(cone, expected)| cone.abs_diff_eq(expected, 1e-6));
        assert!(is_near, "{spot}: {cone:?}");
        let found = scene.warnings.iter().any(|text| text.contains("outer cone") && text.contains("'beam'"));
        assert_eq!(found, is_named, "{spot}: {:?}", scene.warnings);
    }
}

/// Of one name are the primitives of a mesh, and the nodes without one that have a mesh.
#[test]
fn messages_distinguish_primitives_and_nodes() {
    let mut value = square();
    value["meshes"][0].as_object_mut().unwrap().remove("name");
    let primitive = value["meshes"][0]["primitives"][0].clone();
    value["meshes"][0]["primitives"] = json!([primitive, primitive, primitive]);
    value["nodes"][0].as_object_mut().unwrap().remove("name");
    push(&mut value["nodes"], json!({"mesh": 0, "translation": [9, 9, 9]}));
    push(&mut value["scenes"][0]["nodes"], json!(5));
    let scene = load(&value).unwrap();
    let names = scene.mesh_names();
    assert_eq!(names[0], "mesh 0, node 0, primitive 0");
    assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), 6, "{names:?}");
    let lines = Geometry::new(&scene).unwrap().warnings(&scene);
    assert_said(&lines, &["mesh 0, node 5, primitive 0", "mesh 0, node 5, primitive 1"]);
    assert_eq!(lines.iter().collect::<BTreeSet<_>>().len(), lines.len(), "{lines:?}");
    // Where a name says it all, it is all.
    assert_eq!(load(&square()).unwrap().mesh_names(), ["wall"]);
}

/// glTF-Transform's `metalRough()` writes 1000 for a mirror's index.
#[test]
fn any_index_of_refraction_from_1_is_one() {
    for (ior, kept) in [(0.99999, 1.0), (1.0, 1.0), (1000.0, 1000.0), (1e30, 1e6), (0.0, 0.0)] {
        let mut value = square();
        value["materials"][0]["extensions"] =
            json!({"KHR_materials_ior": {"ior": ior}, "KHR_materials_iridescence": {"iridescenceIor": f64::max(ior, 1.0)}});
        let scene = load(&value).unwrap();
        assert_eq!(scene.materials[0].layers.ior, kept);
        assert_eq!(scene.materials[0].layers.film_ior, f32::max(kept, 1.0));
        Geometry::new(&scene).unwrap();
    }
}
