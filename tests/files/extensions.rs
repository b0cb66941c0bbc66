//! What only extensions of glTF bring, and poses of animations.

use super::gltf::{assert_changes_refused, assert_refused, assert_said, load, load_at, load_whole};
use crate::common::gltf_file::{add_accessor, data_uri, floats, push, square, square_buffer};
use crate::common::prelude::*;
use crate::common::rich_file::{
    animated, compressed, draco_square, instanced, ktx2, ktx2_in_zstandard, with_image_light, with_ktx2, with_webp,
};
use glam::dvec3;
use photonmill::scene::Reading;
use photonmill::scene::gltf::source::File;
use serde_json::{Value, json};

/// Corners of the first square: (1, 2, 3) and twice as large at rest.
#[test]
fn nodes_stand_where_the_animation_puts_them() {
    let corners = |at: Option<f64>| {
        let scene = load_at(&animated(), at).unwrap();
        let corner = |mesh: usize, vertex: usize| scene.meshes[mesh].positions[vertex];
        (corner(0, 0), corner(0, 1) - corner(0, 0), corner(1, 1) - corner(1, 0))
    };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let near = |found: DVec3, expected: DVec3| assert!(found.distance(expected) < 1e-3, "{found}, not {expected}");
    for (at, place, side) in [
        (None, dvec3(1.0, 2.0, 3.0), dvec3(2.0, 0.0, 0.0)),
        (Some(-5.0), DVec3::ZERO, dvec3(2.0, 0.0, 0.0)),
        // Half of its quarter turn, which takes 2 s.
        (Some(1.0), DVec3::ZERO, dvec3(2.0 * half, 2.0 * half, 0.0)),
        (Some(1.5), dvec3(5.0, 0.0, 0.0), dvec3(2.0 * (PI * 0.375).cos(), 2.0 * (PI * 0.375).sin(), 0.0)),
        (Some(3.0), dvec3(10.0, 10.0, 0.0), dvec3(0.0, 2.0, 0.0)),
        (Some(1e9), dvec3(10.0, 20.0, 0.0), dvec3(0.0, 2.0, 0.0)),
    ] {
        let found = corners(at);
        near(found.0, place);
        near(found.1, side);
        // One key is for all times.
        near(found.2, DVec3::X * if at.is_some() { 5.0 } else { 1.0 });
    }
    assert_said(&load_at(&animated(), Some(1.0)).unwrap().warnings, &["animations beside the first", "besides nodes"]);
    assert_said(&load(&animated()).unwrap().warnings, &["`at`"]);
}

#[test]
fn faults_of_animations_are_named() {
    let mut value = animated();
    let two_times = add_accessor(&mut value, &floats(&[1., 2.]), 5126, 2, "SCALAR");
    let falling_times = add_accessor(&mut value, &floats(&[0., 10., 0.]), 5126, 3, "SCALAR");
    let turns = value["animations"][0]["samplers"][1]["output"].clone();
    let cases: [(&str, Value, &[&str]); 6] = [
        ("/animations/0/samplers/0/input", json!(two_times), &["animation 'move'", "node 'wall'", "9 numbers for 2 keys"]),
        ("/animations/0/samplers/0/input", turns, &["animation 'move'", "Scalar"]),
        ("/animations/0/samplers/0/input", json!(falling_times), &["a key at 10 s before one at 0 s", "must rise"]),
        ("/animations/0/channels/0/sampler", json!(99), &["animations[0].channels[0].sampler", "99"]),
        ("/animations/0/channels/1/target/node", json!(77), &["animations[0].channels[1].target.node is 77", "list nodes has 6 members"]),
        ("/animations", json!([]), &["`at`", "has none"]),
    ];
    assert_changes_refused(&value, Some(1.0), &cases);
    value["animations"][0]["samplers"][0]["input"] = json!(two_times);
    assert!(load(&value).is_ok(), "an animation that nobody asks for refuses nothing");
    assert!(Scene::open_with("cornell", Reading { radiometric: false, at: Some(0.0) }, &mut |_, _| {}).is_err());
}

/// The node stands at (1, 2, 3), twice as large.
#[test]
fn instances_stand_where_their_attributes_say() {
    let scene = load_whole(&instanced());
    let expected = [
        (dvec3(1.0, 2.0, 3.0), dvec3(5.0, 6.0, 3.0)),
        (dvec3(11.0, 2.0, 3.0), dvec3(15.0, 6.0, 3.0)),
        // Half a turn about y.
        (dvec3(1.0, 16.0, 3.0), dvec3(-3.0, 20.0, 3.0)),
    ];
    for (mesh, expected) in pairs(&scene.meshes, expected) {
        let found = (mesh.positions[0], mesh.positions[2]);
        assert!(found.0.distance(expected.0) < 1e-5 && found.1.distance(expected.1) < 1e-5, "{found:?}, not {expected:?}");
    }
    let mut value = instanced();
    let two = add_accessor(&mut value, &floats(&[2.; 6]), 5126, 2, "VEC3");
    let cases: [(&str, Value, &[&str]); 3] = [
        ("/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/SCALE", json!(two), &["node 'wall'", "{2, 3}", "as many"]),
        ("/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes", json!({"SCALE": 77}), &["SCALE", "77"]),
        ("/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes", json!({}), &["node 'wall'", "as many"]),
    ];
    assert_changes_refused(&value, None, &cases);
}

/// A claim of a billion instances is refused before their numbers are looked for, one of a million as these are not there, and a hundred
/// thousand are read.
#[test]
fn very_many_instances_are_read_or_refused() {
    let mut value = instanced();
    let attributes = &value["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
    let places = attributes["TRANSLATION"].as_u64().unwrap() as usize;
    value["accessors"][places]["count"] = json!(1_000_000_000);
    assert_refused(&value, &["node 'wall'", "over 2000000 primitives"]);
    value["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = json!({"TRANSLATION": places});
    value["accessors"][places]["count"] = json!(1_000_000);
    assert_refused(&value, &["node 'wall'", "runs past"]);
    let count = 100_000;
    let places = add_accessor(&mut value, &floats(&(0..3 * count).map(|k| k as f32).collect::<Vec<f32>>()), 5126, count, "VEC3");
    value["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = json!({"TRANSLATION": places});
    assert_eq!(load(&value).unwrap().triangle_count(), 2 * count);
}

#[test]
fn hidden_nodes_hide_all_below_them() {
    let mut value = animated();
    value["extensionsRequired"] = json!(["KHR_node_visibility"]);
    value["nodes"][5]["children"] = json!([2, 1]);
    value["scenes"][0]["nodes"] = json!([0, 3, 4, 5]);
    let shown = load_at(&value, Some(1.0)).unwrap();
    assert_eq!((shown.meshes.len(), shown.lights.len(), shown.cameras.len()), (2, 3, 1));
    value["nodes"][5]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    for at in [None, Some(1.0)] {
        let hidden = load_at(&value, at).unwrap();
        assert_eq!((hidden.meshes.len(), hidden.lights.len(), hidden.cameras.len()), (1, 2, 0));
    }
    value["nodes"][5]["extensions"] = json!({"KHR_node_visibility": {"visible": true}});
    assert_eq!(load(&value).unwrap().meshes.len(), 2);
}

/// Without triangles a primitive takes memory all the same.
#[test]
fn too_many_primitives_are_refused_before_they_are_listed() {
    let mut value = square();
    let two = push(&mut value["accessors"], json!({"bufferView": 3, "componentType": 5123, "count": 2, "type": "SCALAR"}));
    let primitive = json!({"attributes": {"POSITION": 0}, "indices": two});
    value["meshes"][0]["primitives"] = json!(vec![primitive; 2000]);
    value["nodes"] = json!(vec![json!({"mesh": 0}); 2000]);
    value["scenes"][0]["nodes"] = json!((0..2000).collect::<Vec<usize>>());
    assert_refused(&value, &["node 1000", "over 2000000 primitives", "join meshes"]);
}

#[test]
fn compressed_views_hold_what_was_compressed() {
    let plain = load_whole(&square());
    for extension in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let scene = load_whole(&compressed(extension));
        assert_eq!(format!("{:?}", scene.meshes), format!("{:?}", plain.meshes));
    }
    let cases: [(&str, Value, &[&str]); 7] = [
        ("/bufferViews/0/extensions/EXT_meshopt_compression/byteLength", json!(9), &["compressed buffer view 0", "cannot be decoded"]),
        ("/bufferViews/0/extensions/EXT_meshopt_compression/byteLength", json!(1 << 20), &["compressed buffer view 0", "runs past"]),
        ("/bufferViews/0/extensions/EXT_meshopt_compression/count", json!(1u64 << 40), &["compressed buffer view 0", "allowed are"]),
        ("/bufferViews/0/extensions/EXT_meshopt_compression/byteStride", json!(13), &["compressed buffer view 0", "13 bytes"]),
        ("/bufferViews/0/extensions/EXT_meshopt_compression/mode", json!("ALL"), &["compressed buffer view 0", "ALL"]),
        ("/bufferViews/0/extensions/EXT_meshopt_compression/buffer", json!(7), &["compressed buffer view 0", "buffer 7 of 2"]),
        ("/bufferViews/1/extensions/EXT_meshopt_compression/filter", json!("QUATERNION"), &["compressed buffer view 1", "filter"]),
    ];
    assert_changes_refused(&compressed("EXT_meshopt_compression"), None, &cases);
}

/// Corners of the triangles of a scene's mesh, however they are numbered.
fn corners(scene: &Scene) -> BTreeSet<String> {
    let mesh = &scene.meshes[0];
    let triangle = |triangle: &[u32; 3]| {
        let mut corners = triangle.map(|vertex| format!("{:.3} {:.3}", mesh.positions[vertex as usize], mesh.uvs[0][vertex as usize]));
        let first = (0..3).min_by_key(|k| corners[*k].clone()).unwrap();
        corners.rotate_left(first);
        corners.join(", ")
    };
    mesh.triangles.iter().map(triangle).collect()
}

#[test]
fn draco_meshes_hold_what_was_compressed() {
    let (scene, plain) = (load_whole(&draco_square()), load_whole(&square()));
    assert_eq!((corners(&scene), scene.triangle_count()), (corners(&plain), 2));
    let extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    let (view, positions) = (format!("{extension}/bufferView"), format!("{extension}/attributes/POSITION"));
    let cases: [(&str, Value, &[&str]); 5] = [
        (&view, json!(99), &["mesh 'square', primitive 0", "buffer view 99"]),
        (&view, json!("none"), &["mesh 'square', primitive 0", "none"]),
        (&view, json!(1), &["mesh 'square', primitive 0", "Draco stream that cannot be decoded"]),
        (&positions, json!(77), &["compressed POSITION of the number 77", "not there"]),
        (&positions, json!(2), &["compressed POSITION of 2 numbers", "VEC3"]),
    ];
    assert_changes_refused(&draco_square(), None, &cases);
}

/// A compressed mesh that shares its accessors with one that is not leaves that one as it is.
#[test]
fn draco_meshes_do_not_change_what_shares_their_accessors() {
    let plain = square();
    let mut value = draco_square();
    value["accessors"][0]["max"] = json!([0.5, 1, 0]);
    // The same numbers twice: compressed, and plain in accessors that hold other places.
    let mut bytes = square_buffer();
    bytes[..48].copy_from_slice(&floats(&[0., 0., 0., 7., 0., 0., 7., 7., 0., 0., 7., 0.]));
    push(&mut value["buffers"], json!({"byteLength": bytes.len(), "uri": data_uri("application/octet-stream", &bytes)}));
    for (number, view) in plain["bufferViews"].as_array().unwrap().iter().enumerate() {
        let mut view = view.clone();
        view["buffer"] = json!(1);
        value["accessors"][number]["bufferView"] = json!(push(&mut value["bufferViews"], view));
    }
    let primitive = &plain["meshes"][0]["primitives"][0];
    push(&mut value["meshes"], json!({"primitives": [primitive]}));
    push(&mut value["nodes"], json!({"mesh": 1}));
    push(&mut value["scenes"][0]["nodes"], json!(5));
    let scene = load(&value).unwrap();
    assert_eq!([0, 1].map(|mesh| scene.meshes[mesh].area(0)), [2.0, 24.5]);
    // Each of them has bounds of its own in the file that a bake writes.
    let place = Place::new();
    place.write("scene.gltf", value.to_string());
    let file = File::open(&place.at("scene.gltf")).unwrap();
    let positions = |mesh: usize| file.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    assert_eq!(positions(1), 0);
    let unpacked = file.elements(positions(0), "the square").unwrap();
    for (bound, choose) in [("min", f64::min as fn(f64, f64) -> f64), ("max", f64::max)] {
        let of = |k: usize| (0..unpacked.count).map(|vertex| unpacked.number(vertex, k)).reduce(choose).unwrap();
        assert_eq!(file.json["accessors"][positions(0)][bound], json!([of(0), of(1), of(2)]));
    }
    // Nor is what no node uses unpacked.
    value["scenes"][0]["nodes"] = json!([5]);
    value["bufferViews"][0]["byteLength"] = json!(5);
    assert_eq!(load(&value).unwrap().meshes.len(), 1);
    let mut value = compressed("EXT_meshopt_compression");
    let mut unused = value["bufferViews"][0].clone();
    unused["extensions"]["EXT_meshopt_compression"]["byteLength"] = json!(3);
    push(&mut value["bufferViews"], unused);
    assert_eq!(load(&value).unwrap().meshes.len(), 1);
}

/// A few bytes are not unpacked again and again: views together have a limit, and one stream is decoded once.
#[test]
fn what_is_compressed_has_a_limit_of_all_together() {
    let mut value = compressed("EXT_meshopt_compression");
    value["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["count"] = json!(1 << 26);
    let unpacked = value["bufferViews"][0].clone();
    for _ in 0..40 {
        let view = push(&mut value["bufferViews"], unpacked.clone());
        let positions = push(&mut value["accessors"], json!({"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3"}));
        push(&mut value["meshes"][0]["primitives"], json!({"attributes": {"POSITION": positions}, "indices": 3}));
    }
    assert_refused(&value, &["compressed buffer view 5", "with those before it", "2147483648"]);
    let mut value = draco_square();
    let (view, mut primitive) = (value["bufferViews"][0].clone(), value["meshes"][0]["primitives"][0].clone());
    for _ in 1..40 {
        primitive["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = json!(push(&mut value["bufferViews"], view.clone()));
        push(&mut value["meshes"][0]["primitives"], primitive.clone());
    }
    assert_eq!(load(&value).unwrap().triangle_count(), 80);
}

#[test]
fn webp_and_ktx2_pictures_are_read() {
    let two_blocks = with_ktx2(&ktx2(&[[255, 0, 0, 255], [0, 255, 0, 255]]));
    for (value, size, reds, greens) in [(with_webp(), (2, 1), [0, 0], [1, 1]), (two_blocks, (8, 4), [0, 3], [4, 31])] {
        let scene = load_whole(&value);
        let texture = &scene.textures[scene.materials[0].base_colour_texture.unwrap().texture];
        assert_eq!((texture.width, texture.height), size);
        assert_eq!([reds, greens].map(|places| places.map(|place| texture.texels.at(place).truncate())), [[Vec3::X; 2], [Vec3::Y; 2]]);
    }
    let whole = ktx2(&[[1, 2, 3, 4]]);
    let mut broken = whole.clone();
    broken[116] = 1;
    for bytes in [&whole[..30], &whole[..whole.len() - 3], &broken] {
        assert_refused(&with_ktx2(bytes), &["texture image", "cannot be decoded"]);
    }
}

/// Whatever the head of a picture claims, it is read or refused in a line, and takes no memory that the picture does not need.
#[test]
fn heads_of_ktx2_pictures_are_not_believed() {
    let blocks = [[255, 0, 0, 255], [0, 255, 0, 255]];
    for whole in [ktx2(&blocks), ktx2_in_zstandard(&blocks)] {
        assert!(load(&with_ktx2(&whole)).is_ok());
        for at in (12..104).step_by(4) {
            for number in [u64::MAX, 1 << 63, 1 << 40, 1 << 33, 0x7fff_ffff, 1 << 16] {
                for width in [4, 8] {
                    let mut bytes = whole.clone();
                    bytes[at..at + width].copy_from_slice(&number.to_le_bytes()[..width]);
                    if let Err(error) = load(&with_ktx2(&bytes)) {
                        assert_eq!(error.to_string().lines().count(), 1, "{at}: {error}");
                    }
                }
            }
        }
    }
    // A key that ends where no word ends.
    let mut bytes = ktx2(&blocks);
    let keys = bytes.len() as u32;
    bytes.extend(9u32.to_le_bytes());
    bytes.extend(b"KTXwriter\0\0\0");
    bytes[56..60].copy_from_slice(&keys.to_le_bytes());
    bytes[60..64].copy_from_slice(&13u32.to_le_bytes());
    assert!(load(&with_ktx2(&bytes)).is_ok());
    for (at, value, words) in [
        (12, 43, &["texture image", "Vulkan's format 43", "toktx --encode uastc"][..]),
        (80 + 24 + 12, 1, &["colour model 1", "toktx --encode uastc"]),
        (36, 6, &["6 faces", "one picture"]),
        (88, 77, &["bytes that it does not have"]),
    ] {
        let mut bytes = ktx2(&blocks);
        bytes[at] = value;
        assert_refused(&with_ktx2(&bytes), words);
    }
}

#[test]
fn skies_of_six_sides_are_read() {
    let sky = |value: &Value| {
        let mut lights = load_whole(value).lights.into_iter();
        lights.find_map(|light| if let LightKind::Sky(sky) = light.kind { Some(sky) } else { None }).unwrap()
    };
    let near = |found: DVec3, expected: DVec3| assert!(found.distance(expected) < 0.02 * expected.length(), "{found}, not {expected}");
    let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let plain = sky(&with_image_light());
    for (place, axis) in axes.iter().enumerate() {
        near(plain.radiance(*axis), 2.0 * (place as f64 + 1.0) * DVec3::X);
    }
    // Upper left texels, by OpenGL's directions.
    let corners =
        [dvec3(8., 7., 7.), dvec3(-8., 7., -7.), dvec3(-7., 8., -7.), dvec3(-7., -8., 7.), dvec3(-7., 7., 8.), dvec3(7., 7., -8.)];
    for corner in corners {
        let found = plain.radiance(corner.normalize());
        assert!(found.y > 3.0, "{corner}: {found}");
    }
    let mut value = with_image_light();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // A quarter about y takes z to x.
    value["extensions"]["EXT_lights_image_based"]["lights"][0]["rotation"] = json!([0, half, 0, half]);
    near(sky(&value).radiance(DVec3::X), 10.0 * DVec3::X);
    let cases: [(&str, Value, &[&str]); 5] = [
        ("/extensions/EXT_lights_image_based/lights/0/rotation", json!([0, 0, 0, 0]), &["environment 'studio'", "rotation", "length"]),
        ("/extensions/EXT_lights_image_based/lights/0/intensity", json!(-1), &["environment 'studio'", "intensity -1", "0 or more"]),
        ("/extensions/EXT_lights_image_based/lights/0/specularImages", json!([]), &["environment 'studio'", "no pictures"]),
        ("/extensions/EXT_lights_image_based/lights/0/specularImages/0/5", json!(99), &["environment 'studio'", "picture 99 of 6"]),
        ("/extensions/EXT_lights_image_based/lights/0/specularImages/0", json!([0, 1]), &["environment 'studio'", "not valid"]),
    ];
    assert_changes_refused(&value, None, &cases);
}
