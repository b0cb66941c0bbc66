//! Scenes from glTF: what a file says is what the scene holds, and what it cannot be used for is refused in one line. What mutations
//! of files come to is in tests/files/fuzz.rs.

use super::other_readers::noise;
use crate::common::gltf_file::{add_accessor, data_uri, encoded, floats, push, set_buffer, square, square_buffer};
use crate::common::prelude::*;
use image::{ImageFormat, RgbImage, Rgba, RgbaImage};
use photonmill::output::colour::exr;
use photonmill::scene::Reading;
use photonmill::scene::gltf::source::binary_file;
use photonmill::scene::material::{Coverage, Layers, Medium, NormalMap};
use photonmill::scene::texture::Filter;
use serde_json::{Value, json};

type Spoil = fn(&mut Value);

fn read(name: &str, content: &[u8], reading: Reading) -> Result<Scene, Error> {
    let place = Place::new();
    place.write(name, content);
    Scene::open_with(place.at(name).to_str().unwrap(), reading, &mut |_, _| {})
}

/// The scene of a file of this name.
pub fn open(name: &str, content: &[u8]) -> Result<Scene, Error> {
    read(name, content, Reading::default())
}

pub fn load(value: &Value) -> Result<Scene, Error> {
    load_at(value, None)
}

/// The same in the pose of so many seconds.
pub fn load_at(value: &Value, at: Option<f64>) -> Result<Scene, Error> {
    read("scene.gltf", value.to_string().as_bytes(), Reading { radiometric: false, at })
}

/// A scene of which nothing is left out, and nothing else said.
pub fn load_whole(value: &Value) -> Scene {
    let scene = load(value).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    scene
}

/// The square as a binary file.
fn glb() -> Vec<u8> {
    let mut value = square();
    value["buffers"][0].as_object_mut().unwrap().remove("uri");
    binary_file(&value, &square_buffer(), &[])
}

/// Fails unless one of these lines has all of these words.
#[track_caller]
pub fn assert_said(lines: &[String], words: &[&str]) {
    let is_said = lines.iter().any(|line| words.iter().all(|word| line.contains(word)));
    assert!(is_said, "no line has {words:?}: {lines:?}");
}

/// Fails unless what was read is refused in one line that has these words.
#[track_caller]
pub fn assert_refusal(result: Result<Scene, Error>, words: &[&str]) {
    let error = result.expect_err(&format!("must be refused for {words:?}"));
    let line = error.to_string();
    assert_eq!((error.exit_code(), line.lines().count()), (2, 1), "{line}");
    for word in words {
        assert!(line.contains(word), "must name {word:?}: {line}");
    }
}

#[track_caller]
pub fn assert_refused(value: &Value, words: &[&str]) {
    assert_refusal(load(value), words);
}

/// Fails unless each of these values, put where its path leads, is why the file is refused.
#[track_caller]
pub fn assert_changes_refused(whole: &Value, at: Option<f64>, cases: &[(&str, Value, &[&str])]) {
    for (path, new, words) in cases {
        let mut value = whole.clone();
        *value.pointer_mut(path).unwrap_or_else(|| panic!("nothing is at {path}")) = new.clone();
        assert_refusal(load_at(&value, at), words);
    }
}

#[test]
fn a_file_says_what_the_scene_holds() {
    // A mark of the byte order is passed over.
    let marked = [b"\xef\xbb\xbf".as_slice(), square().to_string().as_bytes()].concat();
    for scene in [load(&square()), open("scene.glb", &glb()), open("scene.gltf", &marked)].map(Result::unwrap) {
        let [mesh] = scene.meshes.as_slice() else { panic!("{:?}", scene.meshes) };
        assert_eq!(mesh.name, "wall");
        assert_eq!(mesh.positions[2], DVec3::new(3.0, 4.0, 3.0));
        assert_eq!((mesh.normals[0], mesh.normal(0), mesh.area(0)), (DVec3::Z, DVec3::Z, 2.0));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        let material = &scene.materials[mesh.material];
        assert_eq!((material.surface, material.base_colour), (Surface::Layered, Vec3::new(0.5, 0.25, 0.125)));
        assert_eq!(material.layers, Layers { metallic: 0.0, ..Layers::default() });
        // Factor times strength is radiance, untouched.
        assert_eq!(material.emission, Vec3::new(8.0, 4.0, 2.0));
        assert_eq!((scene.cameras[0].name.as_str(), scene.cameras[0].eye), ("eye", DVec3::new(0.0, 0.0, 5.0)));
        assert_eq!(scene.cameras[0].forward, DVec3::NEG_Z);
        // 683 lumens a watt.
        let kinds: Vec<&LightKind> = scene.lights.iter().map(|light| &light.kind).collect();
        assert_eq!(*kinds[0], LightKind::Point { position: DVec3::new(0.0, 4.0, 0.0), intensity: Vec3::new(1.0, 0.5, 0.25) });
        assert_eq!(*kinds[1], LightKind::Directional { direction: DVec3::NEG_Z, irradiance: Vec3::splat(2.0) });
        let LightKind::Spot { intensity, outer_angle, .. } = kinds[2] else { panic!("{kinds:?}") };
        assert!((intensity.x - 0.1).abs() < 1e-6 && *outer_angle == 0.4, "{kinds:?}");
        assert_eq!(scene.warnings, Vec::<String>::new());
    }
    let radiometric = read("a.glb", &glb(), Reading { radiometric: true, at: None }).unwrap();
    assert!(matches!(radiometric.lights[1].kind, LightKind::Directional { irradiance, .. } if irradiance == Vec3::splat(1366.0)));
}

#[test]
fn instances_are_meshes_of_their_own_and_mirrored_ones_keep_their_front() {
    let mut value = square();
    value["nodes"][0]["children"] = json!([5]);
    value["nodes"].as_array_mut().unwrap().push(json!({"name": "twin", "mesh": 0, "scale": [-1, 1, 1]}));
    let scene = load(&value).unwrap();
    assert_eq!(scene.meshes.len(), 2);
    let twin = &scene.meshes[1];
    assert_eq!(twin.positions[2], DVec3::new(-1.0, 4.0, 3.0));
    assert_eq!((twin.normal(0), twin.normals[0]), (DVec3::Z, DVec3::Z));
}

#[test]
fn textures_are_read_as_linear_values() {
    let picture = RgbImage::from_fn(2, 1, |i, _| image::Rgb(if i == 0 { [255, 0, 188] } else { [0, 255, 0] }));
    let scene = load(&with_png(&picture)).unwrap();
    let texture = &scene.textures[scene.materials[0].base_colour_texture.unwrap().texture];
    assert_eq!((texture.width, texture.height), (2, 1));
    assert!((texture.texels.at(0).truncate() - Vec3::new(1.0, 0.0, 0.502_886)).abs().max_element() < 1e-5, "{:?}", texture.texels);
}

#[test]
fn what_is_left_out_is_named_once() {
    let mut value = with_png(&RgbImage::new(1, 1));
    value["materials"][0]["occlusionTexture"] = json!({"index": 0});
    let extensions = json!({"EXT_materials_fur": {"length": 1}, "KHR_materials_volume": {"thicknessTexture": {"index": 0}}});
    value["materials"].as_array_mut().unwrap().push(json!({"occlusionTexture": {"index": 0}, "extensions": extensions}));
    use_material(&mut value, 1);
    value["animations"] = json!([{"channels": [], "samplers": []}]);
    // The file may say that it needs these, and is read without.
    let needed = ["KHR_materials_variants", "KHR_xmp_json_ld", "KHR_animation_pointer", "MSFT_lod", "KHR_materials_volume_scatter"];
    value["extensionsUsed"].as_array_mut().unwrap().extend(needed.map(Value::from));
    value["extensionsUsed"].as_array_mut().unwrap().extend([json!("EXT_materials_fur"), json!("EXT_unheard_of")]);
    value["extensionsRequired"] = json!(needed);
    value["cameras"][0] = json!({"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 1, "zfar": 9, "znear": 0.1}});
    value["meshes"][0]["primitives"][0]["attributes"]["COLOR_1"] = json!(1);
    let scene = load(&value).unwrap();
    let [warning] = scene.warnings.as_slice() else { panic!("{:?}", scene.warnings) };
    for name in needed {
        assert_eq!(warning.matches(&format!("the extension {name}")).count(), 1, "{name}: {warning}");
    }
    let wanted = [
        "occlusion textures (what they guess is computed): material 'glow', material 'material 1'",
        "thickness textures (rays measure the thickness): material 'material 1'",
        "animations",
        "the extension EXT_materials_fur: material 'material 1'",
        "the extension EXT_unheard_of",
        "an orthographic camera of 0 by 1 metres: camera 'eye'",
        "second sets of vertex colours: mesh 'wall'",
    ];
    for words in wanted {
        assert_eq!(warning.matches(words).count(), 1, "{words}: {warning}");
    }

    // Of many names the first few.
    let dispersion = json!({"KHR_materials_dispersion": {"dispersion": 1}});
    let materials: Vec<Value> = (0..40).map(|k| json!({"name": format!("m{k:02}"), "extensions": dispersion})).collect();
    let mut value = square();
    value["materials"] = json!(materials);
    (1..40).for_each(|k| use_material(&mut value, k));
    let warnings = load(&value).unwrap().warnings.join(" ");
    assert!(warnings.contains("material 'm00', ") && warnings.contains(" and 35 more") && !warnings.contains("m05"), "{warnings}");
}

/// At half a turn a picture is mirrored, at none all of its rays are one.
#[test]
fn views_too_wide_or_too_narrow_are_left_out_by_name() {
    let with = |angle: f64| {
        let mut value = square();
        value["cameras"][0]["perspective"]["yfov"] = json!(angle);
        load(&value)
    };
    for angle in [0.0, 1e-4, -0.7, 3.13, PI, 7.0, 1e30] {
        match with(angle) {
            Ok(scene) => {
                assert!(scene.cameras.is_empty(), "{angle}");
                assert_said(&scene.warnings, &["vertical view"]);
            }
            Err(error) => assert_eq!(error.exit_code(), 2, "{angle}: {error}"),
        }
    }
    for angle in [0.0021, 0.7, 3.11] {
        assert_eq!(with(angle).unwrap().cameras.len(), 1, "{angle}");
    }
}

#[test]
fn a_scene_without_light_is_read_and_flat_triangles_are_a_warning() {
    let mut value = square();
    value["materials"] = json!([{"name": "dull"}]);
    value["scenes"][0]["nodes"] = json!([0]);
    value["accessors"][3]["count"] = json!(3);
    let scene = load(&value).unwrap();
    assert_eq!((scene.triangle_count(), scene.cameras.len()), (1, 0));
    // The program says so, once lights of the command line have joined.
    assert!(!scene.is_lit());

    // Two corners of the second triangle in one place.
    let mut bytes = square_buffer();
    bytes[136..138].copy_from_slice(&2u16.to_le_bytes());
    bytes[138..140].copy_from_slice(&2u16.to_le_bytes());
    let mut value = square();
    set_buffer(&mut value, &bytes);
    let scene = load(&value).unwrap();
    assert_eq!(scene.triangle_count(), 1);
    assert_said(&scene.warnings, &["1 triangle without area left out (mesh 'wall')"]);
}

/// The square once more, with another material.
fn use_material(value: &mut Value, material: usize) {
    let primitives = value["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(primitives[0].clone());
    primitives.last_mut().unwrap()["material"] = json!(material);
}

/// What is wrong where no mesh of the scene looks is no matter.
#[test]
fn what_no_mesh_uses_refuses_nothing() {
    let spoils: &[Spoil] = &[
        |v| v["images"][7] = json!({"uri": "absent.png"}),
        |v| v["images"][7] = json!({}),
        |v| v["images"][7] = json!({"bufferView": 99, "mimeType": "image/png"}),
        |v| v["textures"][7] = json!({"source": 99}),
        |v| v["textures"][7] = json!({"source": "seven", "sampler": 3}),
        |v| v["textures"][7] = json!({}),
        |v| v["samplers"] = json!([{"wrapS": 5}]),
        |v| v["materials"][1] = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 99}}}),
        |v| v["materials"][1] = json!({"pbrMetallicRoughness": {"roughnessFactor": "rough"}, "alphaMode": 3}),
        |v| v["materials"][1] = json!({"pbrMetallicRoughness": {"roughnessFactor": 5, "baseColorTexture": {"index": 7}}}),
        |v| v["animations"] = json!([{"channels": [{"sampler": 9, "target": {"node": 99, "path": "nowhere"}}], "samplers": 5}]),
        |v| v["materials"][0]["occlusionTexture"] = json!({"index": 99}),
        |v| v["materials"][0]["occlusionTexture"] = json!({"index": 7, "strength": []}),
        |v| v["materials"][0]["extensions"] = json!({"KHR_materials_volume": {"thicknessTexture": {"index": 99}}}),
        |v| v["materials"][0]["extensions"] = json!({"EXT_materials_fur": {"furTexture": {"index": 99}}}),
    ];
    for (place, spoil) in spoils.iter().enumerate() {
        let mut value = with_material(json!({"name": "used", "pbrMetallicRoughness": {"baseColorTexture": {"index": 3}}}));
        value["materials"].as_array_mut().unwrap().push(json!({"name": "spare"}));
        // On a mesh, but not of the scene.
        value["meshes"].as_array_mut().unwrap().push(json!({"primitives": [{"attributes": {"POSITION": 0}, "material": 1}]}));
        value["nodes"].as_array_mut().unwrap().push(json!({"mesh": 1}));
        value["images"][7] = json!({"uri": data_uri("image/png", b"no picture")});
        spoil(&mut value);
        let scene = load(&value).unwrap_or_else(|error| panic!("{place}: {error}"));
        assert_eq!((scene.materials.len(), scene.textures.len()), (1, 1), "{place}");
        assert_eq!(scene.textures[0].texels, Texels::Srgb(vec![[3, 6, 9, 200]]), "{place}");
        assert!(scene.warnings[0].contains("materials on no mesh: material '"), "{place}: {:?}", scene.warnings);
        // With the node in the scene the same is refused, unless it is nothing that is read.
        if place < 10 && place != 6 {
            value["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(5));
            value["materials"][1]["emissiveTexture"] = json!({"index": 7});
            assert_refused(&value, &["scene.gltf"]);
        }
    }
}

/// Where a fault is, what stands there, what is allowed, what to do.
#[test]
fn faults_of_the_json_have_place_value_and_remedy() {
    let textured = |spoil: Spoil| {
        let mut value = with_material(json!({"name": "used", "pbrMetallicRoughness": {"baseColorTexture": {"index": 3}}}));
        value["samplers"] = json!([{}]);
        value["textures"][3]["sampler"] = json!(0);
        spoil(&mut value);
        value
    };
    let cases: &[(Spoil, &[&str])] = &[
        (|v| v["samplers"][0]["wrapS"] = json!(12), &["samplers[0].wrapS is 12", "must be one of [33071, 33648, 10497]"]),
        (|v| v["samplers"][0]["wrapT"] = json!("repeat"), &["samplers[0].wrapT", "string \"repeat\"", "[33071, 33648, 10497]"]),
        (|v| v["materials"][0]["alphaMode"] = json!("GLASS"), &["materials[0].alphaMode is \"GLASS\"", "\"OPAQUE\", \"MASK\", \"BLEND\""]),
        (|v| v["meshes"][0]["primitives"][0]["mode"] = json!(9), &["meshes[0].primitives[0].mode is 9", "[0, 1, 2, 3, 4, 5, 6]"]),
        (|v| v["accessors"][0]["type"] = json!("VEC9"), &["accessors[0].type is \"VEC9\"", "\"VEC3\""]),
        (|v| v["accessors"][0]["componentType"] = json!(1), &["accessors[0].componentType is 1", "5126"]),
        (|v| v["accessors"][0]["bufferView"] = json!(44), &["accessors[0].bufferView is 44", "bufferViews has 4 members, counted from 0"]),
        (|v| v["meshes"][0]["primitives"][0]["material"] = json!(7), &["primitives[0].material is 7", "list materials has 1 members"]),
        (|v| v["textures"][3]["sampler"] = json!(4), &["textures[3].sampler is 4", "list samplers has 1 members"]),
        (
            |v| v["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = json!(30),
            &["baseColorTexture.index is 30", "list textures has 17 members"],
        ),
        (|v| drop(v["accessors"][0].as_object_mut().unwrap().remove("type")), &["accessors[0]", "missing field `type`"]),
        (
            |v| v["nodes"][2]["extensions"]["KHR_lights_punctual"]["light"] = json!(5),
            &["nodes[2].extensions.KHR_lights_punctual.light is 5", "list extensions.KHR_lights_punctual.lights has 3 members"],
        ),
        (
            |v| v["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = json!("red"),
            &["materials[0].pbrMetallicRoughness.roughnessFactor", "\"red\"", "expected f32"],
        ),
        (|v| v["nodes"][0]["scale"] = json!([1, 2]), &["nodes[0].scale", "length 2", "array of length 3"]),
        (|v| v["nodes"][0]["mesh"] = json!(-1), &["nodes[0].mesh", "`-1`", "expected index"]),
    ];
    for (spoil, named) in cases {
        assert_refused(&textured(*spoil), &[&["scene.gltf", "not valid glTF", "export the file again"], *named].concat());
    }
    let text = square().to_string();
    for number in ["NaN", "01", "+1", "Infinity"] {
        let spoiled = text.replace("\"yfov\":0.7", &format!("\"yfov\":{number}"));
        assert_ne!(spoiled, text);
        assert_refusal(
            open("a.gltf", spoiled.as_bytes()),
            &["not valid JSON", "line 1 column", &format!("\"yfov\":{number}"), "export the file again"],
        );
    }
}

/// The square with a picture.
pub fn with_image(image: Value) -> Value {
    let mut value = square();
    value["images"] = json!([image]);
    value["textures"] = json!([{"source": 0}]);
    value["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    value
}

fn with_png(picture: &RgbImage) -> Value {
    with_image(json!({"uri": data_uri("image/png", &encoded(picture, ImageFormat::Png))}))
}

#[test]
fn what_cannot_be_used_is_refused_with_file_and_object() {
    let cases: &[(Spoil, &[&str])] = &[
        (|v| v["bufferViews"][0]["byteOffset"] = json!(1_000_000), &["scene.gltf", "mesh 'wall'", "buffer view 0"]),
        (|v| v["bufferViews"][0]["byteLength"] = json!(40), &["mesh 'wall'", "runs past"]),
        (|v| v["accessors"][0]["count"] = json!(400_000_000), &["mesh 'wall'", "runs past"]),
        (|v| v["accessors"][0].as_object_mut().unwrap().remove("bufferView").map_or((), drop), &["scene.gltf"]),
        (|v| v["accessors"][1]["count"] = json!(3), &["mesh 'wall'", "3 normals for 4 vertices"]),
        (|v| v["accessors"][3]["componentType"] = json!(5126), &["mesh 'wall'", "indices"]),
        (|v| v["buffers"][0]["uri"] = json!("absent.bin"), &["buffer 0", "absent.bin", "cannot be read"]),
        (|v| *v = with_image(json!({"uri": "absent.png"})), &["scene.gltf", "texture image 0", "absent.png", "no such file"]),
        (
            |v| {
                *v = with_image(json!({"uri": "a.avif"}));
                v["textures"] = json!([{"extensions": {"EXT_texture_avif": {"source": 0}}}]);
            },
            &["material 'glow'", "texture 0", "but by EXT_texture_avif", "PNG, JPEG, WebP or KTX 2"],
        ),
        (|v| v["buffers"][0]["uri"] = json!("%ff"), &["buffer 0", "cannot be decoded", "%ff"]),
        (|v| v["buffers"][0]["uri"] = json!("%zz"), &["buffer 0", "%zz", "no such file"]),
        (|v| v["buffers"][0]["uri"] = json!("https://example.com/a.bin"), &["buffer 0", "only files beside this one"]),
        (|v| v["buffers"][0]["uri"] = json!("data:x;base64,@@@"), &["buffer 0", "not base64"]),
        (|v| v["buffers"][0]["uri"] = json!("data:x"), &["buffer 0", "without the comma"]),
        (|v| v["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([2, 0, 0, 1]), &["material 'glow'", "from 0 to 1"]),
        (|v| v["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = json!(1.0001), &["material 'glow'", "1.0001", "from 0 to 1"]),
        (|v| v["materials"][0]["emissiveFactor"] = json!([-1, 0, 0]), &["material 'glow'", "emits"]),
        (|v| v["nodes"][0]["scale"] = json!([1e300, 1, 1]), &["'wall'", "finite"]),
        (|v| v["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = json!(-1), &["light 'bulb'", "0 or more"]),
        (
            |v| v["extensions"]["KHR_lights_punctual"]["lights"][2]["spot"]["outerConeAngle"] = json!(-0.1),
            &["light", "cones", "-0.1", "0 or more"],
        ),
        (|v| v["scenes"][0]["nodes"] = json!([1]), &["no triangle"]),
        (|v| drop(v["scenes"][0].as_object_mut().unwrap().remove("nodes")), &["the scene holds no triangle"]),
        (|v| v["meshes"][0]["primitives"][0]["mode"] = json!(1), &["no triangle; ignored: points and lines: mesh 'wall'"]),
        (
            |v| drop(v["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("POSITION")),
            &["no triangle; ignored: primitives without positions: mesh 'wall'"],
        ),
        (|v| v["extensionsRequired"] = json!(["EXT_materials_fur"]), &["scene.gltf", "EXT_materials_fur", "export its materials"]),
        (|v| v["asset"]["version"] = json!("9.9"), &["scene.gltf", "9.9"]),
    ];
    for (spoil, named) in cases {
        let mut value = square();
        spoil(&mut value);
        assert_refused(&value, named);
    }
    // A vertex that is no number, an index past the vertices.
    let mut nan = square_buffer();
    nan[4..8].copy_from_slice(&f32::NAN.to_le_bytes());
    let mut past = square_buffer();
    past[130..132].copy_from_slice(&9u16.to_le_bytes());
    for (bytes, named) in [(nan, ["mesh 'wall'", "NaN"]), (past, ["mesh 'wall'", "vertex 9 of 4"])] {
        let mut value = square();
        set_buffer(&mut value, &bytes);
        assert_refused(&value, &named);
    }
    // Files that are none.
    let whole = glb();
    assert_refusal(open("a.glb", &whole[..whole.len() / 2]), &["a.glb"]);
    assert_refusal(open("a.glb", &[]), &["a.glb"]);
    assert_refusal(open("a.gltf", b"{"), &["a.gltf"]);
    assert_refusal(Scene::open("absent.glb", false), &["absent.glb", "cannot be read"]);
    assert_refusal(Scene::open("cornel", false), &["SCENE cornel", "cornell-spheres"]);
}

/// What is cut off would be read as grey.
#[test]
fn pictures_are_whole_and_of_the_kinds_that_gltf_has() {
    let read = |bytes: &[u8]| load(&with_image(json!({"name": "paint", "uri": data_uri("image/jpeg", bytes)})));
    let jpeg = encoded(&noise(), ImageFormat::Jpeg);
    assert_eq!(read(&jpeg).unwrap().textures[0].width, 64);
    // Some writers pad their files.
    assert!(read(&[&jpeg[..], &[0; 3]].concat()).is_ok());
    for left in [jpeg.len() - 6, jpeg.len() - 40, jpeg.len() / 2] {
        assert_refusal(read(&jpeg[..left]), &["texture image 'paint'", "is cut off"]);
    }
    let png = encoded(&noise(), ImageFormat::Png);
    assert!(read(&png).is_ok());
    let cut = read(&png[..png.len() / 2]);
    assert!(!cut.as_ref().unwrap_err().to_string().contains(['{', '[']), "what a decoder says is no use");
    assert_refusal(cut, &["texture image 'paint'", "cannot be decoded", "broken or cut off; export it again"]);
    assert_refusal(read(&exr(1, 1, &[Vec3::ONE])), &["texture image 'paint'", "neither PNG, JPEG, WebP nor KTX 2"]);
}

/// Sets an attribute of the square's vertices, and returns its accessor's number.
fn set_attribute(value: &mut Value, name: &str, bytes: &[u8], component: u32, count: usize, kind: &str) -> usize {
    let accessor = add_accessor(value, bytes, component, count, kind);
    value["meshes"][0]["primitives"][0]["attributes"][name] = json!(accessor);
    accessor
}

/// The square as the skin of two joints, of which the second has the vertices 2 and 3. In the bind pose their matrices
/// are none.
pub fn skinned_square() -> Value {
    let mut value = square();
    let moved = |by: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, by, 1.0f32];
    let matrices = add_accessor(&mut value, &floats(&[moved(-7.0), moved(-9.0)].concat()), 5126, 2, "MAT4");
    set_attribute(&mut value, "JOINTS_0", &[0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], 5121, 4, "VEC4");
    set_attribute(&mut value, "WEIGHTS_0", &floats(&[1.0, 0.0, 0.0, 0.0].repeat(4)), 5126, 4, "VEC4");
    value["skins"] = json!([{"inverseBindMatrices": matrices, "joints": [5, 6]}]);
    value["nodes"][0]["skin"] = json!(0);
    push(&mut value["nodes"], json!({"name": "hip", "translation": [0, 0, 7], "children": [6]}));
    push(&mut value["nodes"], json!({"name": "knee", "translation": [0, 0, 2]}));
    push(&mut value["scenes"][0]["nodes"], json!(5));
    value
}

#[test]
fn a_skinned_mesh_follows_its_joints_and_not_its_node() {
    let bind = load_whole(&skinned_square());
    let corners = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
    assert_eq!(bind.meshes[0].positions, corners);
    assert_eq!((bind.meshes[0].normals[0], bind.meshes[0].area(0)), (DVec3::Z, 0.5));

    // A joint moved takes its vertices along; a joint below it is moved with it.
    let mut posed = skinned_square();
    posed["nodes"][6]["translation"] = json!([0, 3, 2]);
    let up = 3.0 * DVec3::Y;
    assert_eq!(load(&posed).unwrap().meshes[0].positions, [corners[0], corners[1], corners[2] + up, corners[3] + up]);
    posed["nodes"][5]["scale"] = json!([-1, 1, 1]);
    let mirrored = load(&posed).unwrap();
    assert_eq!((mirrored.meshes[0].positions[1], mirrored.meshes[0].normal(0)), (-DVec3::X, DVec3::Z));

    // Weights count as shares of their sum.
    let mut halves = skinned_square();
    set_attribute(&mut halves, "WEIGHTS_0", &floats(&[0.25, 0.25, 0.0, 0.0].repeat(4)), 5126, 4, "VEC4");
    set_attribute(&mut halves, "JOINTS_0", &[0, 1, 0, 0].repeat(4), 5121, 4, "VEC4");
    halves["nodes"][6]["translation"] = json!([0, 3, 2]);
    assert_eq!(load(&halves).unwrap().meshes[0].positions, corners.map(|corner| corner + 1.5 * DVec3::Y));

    let cases: [(&str, Value, &[&str]); 5] = [
        ("/nodes/0/skin", json!(99), &["scene.gltf"]),
        ("/skins/0/joints/1", json!(99), &["scene.gltf"]),
        ("/skins/0/inverseBindMatrices", json!(99), &["scene.gltf"]),
        ("/skins/0/joints", json!([5]), &["mesh 'wall'", "joint 1 of 1"]),
        ("/scenes/0/nodes", json!([0, 1, 2, 3, 4]), &["skin 0", "node 'hip'", "not in the scene"]),
    ];
    assert_changes_refused(&skinned_square(), None, &cases);
}

/// Morph targets shift a mesh at rest by the weights of its node, or else of the mesh, before joints move it.
#[test]
fn morph_targets_shift_vertices_by_their_weights_at_rest() {
    let mut value = square();
    let up = add_accessor(&mut value, &floats(&[0.0, 0.0, 2.0].repeat(4)), 5126, 4, "VEC3");
    let aside = add_accessor(&mut value, &floats(&[4.0, 0.0, 0.0].repeat(4)), 5126, 4, "VEC3");
    let lean = add_accessor(&mut value, &floats(&[1.0, 0.0, 0.0].repeat(4)), 5126, 4, "VEC3");
    value["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": up, "NORMAL": lean}, {"POSITION": aside}]);
    let first = |value: &Value| {
        let scene = load_whole(value);
        (scene.meshes[0].positions[0], scene.meshes[0].normals[0])
    };
    // The node scales by 2 and moves by 1, 2, 3.
    assert_eq!(first(&value), (DVec3::new(1.0, 2.0, 3.0), DVec3::Z));
    value["meshes"][0]["weights"] = json!([0.5, 0.0]);
    let (position, normal) = first(&value);
    assert_eq!(position, DVec3::new(1.0, 2.0, 5.0));
    assert!((normal - DVec3::new(0.5, 0.0, 1.0).normalize()).length() < 1e-12, "{normal}");
    value["nodes"][0]["weights"] = json!([1.0, -0.25]);
    assert_eq!(first(&value).0, DVec3::new(-1.0, 2.0, 7.0));

    let mut skinned = skinned_square();
    let up = add_accessor(&mut skinned, &floats(&[0.0, 0.0, 2.0].repeat(4)), 5126, 4, "VEC3");
    skinned["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": up}]);
    skinned["meshes"][0]["weights"] = json!([1.0]);
    skinned["nodes"][5]["scale"] = json!([1, 1, 3]);
    // The joint's own 7 m are not scaled, the target's 2 m are.
    assert_eq!(load(&skinned).unwrap().meshes[0].positions[0].z, 7.0 + 3.0 * (2.0 - 7.0));

    for weights in [json!([1.0]), json!([1.0, 0.0, 0.5])] {
        value["nodes"][0]["weights"] = weights;
        let scene = load(&value).unwrap();
        assert_eq!(scene.meshes[0].positions[0].z, 3.0 + 2.0 * 2.0);
        let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
        assert!(warning.contains("weights that are not as many as morph targets") && warning.contains("mesh 'wall'"), "{warning}");
    }
    value["nodes"][0]["weights"] = json!([1.0, -0.25]);

    let few = add_accessor(&mut value, &floats(&[0.0; 9]), 5126, 3, "VEC3");
    value["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": few}, {}]);
    assert_refused(&value, &["mesh 'wall'", "3 positions in a morph target for 4 vertices"]);
}

/// Mistakes that leave no doubt of what is meant.
#[test]
fn small_mistakes_refuse_nothing() {
    let spoils: &[Spoil] = &[
        |v| drop(v["accessors"][0].as_object_mut().unwrap().remove("min")),
        |v| v["accessors"][0]["max"] = json!([1, 2]),
        |v| drop(v["cameras"][0]["perspective"].as_object_mut().unwrap().remove("znear")),
        |v| v["accessors"][0]["count"] = json!(4.0),
        |v| v["meshes"][0]["primitives"][0]["indices"] = json!(3.0),
        |v| v["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = json!(1.000_001),
        |v| v["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.25, 0.125, 1.000_000_1]),
        |v| v["meshes"].as_array_mut().unwrap().push(json!({"primitives": [{"attributes": {"POSITION": 99}}], "weights": "none"})),
        |v| v["accessors"].as_array_mut().unwrap().push(json!({"bufferView": 99, "count": "many"})),
        |v| v["scenes"].as_array_mut().unwrap().push(json!({})),
        |v| v["meshes"][0]["primitives"][0]["attributes"]["BATCHID"] = json!(1),
        |v| v["meshes"][0]["primitives"].as_array_mut().unwrap().push(json!({"attributes": {"NORMAL": 1}})),
    ];
    for (place, spoil) in spoils.iter().enumerate() {
        let mut value = square();
        spoil(&mut value);
        let scene = load(&value).unwrap_or_else(|error| panic!("{place}: {error}"));
        assert_eq!((scene.triangle_count(), scene.cameras.len()), (2, 1), "{place}");
        assert_eq!(scene.materials[0].layers, Layers { metallic: 0.0, ..Layers::default() }, "{place}");
        let named =
            ["scenes beside", "attributes that glTF does not have (BATCHID): mesh 'square'", "primitives without positions: mesh 'wall'"];
        let expected = place.checked_sub(spoils.len() - named.len()).map(|place| named[place]);
        match (expected, &scene.warnings[..]) {
            (None, []) => {}
            (Some(named), [warning]) if warning.contains(named) => {}
            found => panic!("{place}: {found:?}"),
        }
    }
}

/// What a file beside the scene holds backs an accessor as well as what the scene's own file holds.
#[test]
fn sparse_accessors_without_a_view_may_be_as_long_as_their_buffers() {
    let mut value = square();
    let count = 20_000;
    let indices = floats(&vec![0.0; count]);
    let many = add_accessor(&mut value, &indices, 5125, count, "SCALAR");
    let place = Place::new();
    place.write("indices.bin", &indices);
    value["buffers"][1]["uri"] = json!("indices.bin");
    let replaced = add_accessor(&mut value, &square_buffer(), 5126, 4, "VEC3");
    let (positions, numbers) = (value["accessors"][replaced]["bufferView"].clone(), value["accessors"][3]["bufferView"].clone());
    value["accessors"][many] = json!({"componentType": 5126, "count": count, "type": "VEC3", "sparse": {"count": 4,
        "indices": {"bufferView": numbers, "byteOffset": 4, "componentType": 5123}, "values": {"bufferView": positions}}});
    value["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": many});
    place.write("scene.gltf", value.to_string());
    Scene::open(place.at("scene.gltf").to_str().unwrap(), false).unwrap();
}

/// Integers stand for themselves, or for parts of their range.
#[test]
fn quantized_meshes_are_read() {
    let mut value = square();
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_mesh_quantization"));
    value["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let shorts = |numbers: &[i16]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    // Each vertex takes a multiple of four bytes.
    set_attribute(&mut value, "POSITION", &shorts(&[0, 0, 0, 0, 300, 0, 0, 0, 300, 300, 0, 0, 0, 300, -5, 0]), 5122, 4, "VEC3");
    value["bufferViews"][4]["byteStride"] = json!(8);
    let uvs = set_attribute(&mut value, "TEXCOORD_0", &shorts(&[0, 0, -1, 0, -1, -1, 0, -1]), 5123, 4, "VEC2");
    value["accessors"][uvs]["normalized"] = json!(true);
    value["nodes"][0]["scale"] = json!([0.01, 0.01, 0.01]);
    let mesh = load_whole(&value).meshes.remove(0);
    value["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_emissive_strength"]);
    value.as_object_mut().unwrap().remove("extensionsRequired");
    let scene = load(&value).unwrap();
    assert_said(&scene.warnings, &["KHR_mesh_quantization is not named", "mesh 'wall'"]);
    assert_eq!(scene.meshes[0].positions, mesh.positions);
    assert!((mesh.positions[3] - DVec3::new(1.0, 5.0, 2.95)).length() < 1e-7, "{:?}", mesh.positions);
    assert_eq!(mesh.uvs[0], [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(DVec2::from));
}

#[test]
fn vertex_colours_are_read() {
    let mut value = square();
    let bytes = [[255, 0, 51, 0], [0, 255, 0, 0], [0, 0, 255, 255], [255; 4]].concat();
    let colours = set_attribute(&mut value, "COLOR_0", &bytes, 5121, 4, "VEC4");
    value["accessors"][colours]["normalized"] = json!(true);
    let scene = load_whole(&value);
    assert_eq!(scene.meshes[0].colours, [DVec3::new(1.0, 0.0, 0.2f32.into()), DVec3::Y, DVec3::Z, DVec3::ONE]);
    assert_eq!(scene.meshes[0].alphas, [0.0, 0.0, 1.0, 1.0]);

    // Alpha that is 1 everywhere is none.
    let mut whole = value.clone();
    set_attribute(&mut whole, "COLOR_0", &floats(&[0.5, 0.25, 0.125, 1.0].repeat(4)), 5126, 4, "VEC4");
    assert!(load(&whole).unwrap().meshes[0].alphas.is_empty());
    // What is out of range by rounding, or by far, is cut off, and named.
    let mut with_value = |value: f32| {
        set_attribute(&mut whole, "COLOR_0", &floats(&[0.5, 0.25, value, value].repeat(4)), 5126, 4, "VEC4");
        load(&whole)
    };
    for (value, cut) in [(1.0 + f32::EPSILON, 1.0), (1.5, 1.0), (-1e-9, 0.0)] {
        let scene = with_value(value).unwrap();
        assert_eq!(scene.meshes[0].colours, [DVec3::new(0.5, 0.25, cut); 4]);
        assert_eq!(scene.meshes[0].alphas, if cut == 1.0 { vec![] } else { vec![cut; 4] });
        assert_eq!(scene.warnings, ["ignored: what vertex colours have below 0 or above 1: mesh 'wall'"]);
    }
    for value in [f32::NAN, f32::INFINITY] {
        assert_refusal(with_value(value), &["mesh 'wall'", "every number must be finite"]);
    }
    set_attribute(&mut value, "COLOR_0", &floats(&[0.5; 9]), 5126, 3, "VEC3");
    assert_refused(&value, &["mesh 'wall'", "3 vertex colours for 4 vertices"]);
}

/// The specification's matrices: scaled, then turned, then moved; another set may be named.
#[test]
fn texture_coordinates_are_transformed() {
    let mut value = with_png(&RgbImage::new(2, 2));
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_texture_transform"));
    value["extensionsRequired"] = json!(["KHR_texture_transform"]);
    value["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(2);
    let transform = json!({"offset": [0.5, 0.25], "rotation": FRAC_PI_2, "scale": [2.0, 3.0], "texCoord": 1});
    value["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = json!({"KHR_texture_transform": transform});
    let scene = load_whole(&value);
    let used = scene.materials[0].base_colour_texture.unwrap();
    assert_eq!(used.uv_set, 1);
    for (uv, expected) in [([0.0, 0.0], [0.5, 0.25]), ([1.0, 0.0], [0.5, -1.75]), ([0.0, 1.0], [3.5, 0.25])] {
        let found = used.transform.apply(DVec2::from(uv));
        assert!((found - DVec2::from(expected)).length() < 1e-6, "{uv:?}: {found}");
    }
    value["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"]["scale"] = json!([1e30, 1]);
    assert_refused(&value, &["material 'glow'", "texture transform", "1e30"]);
}

/// Primitives that share vertices each take those that they use.
#[test]
fn shared_vertices_are_read_once_for_each_use() {
    let mut value = square();
    let primitive = |indices: usize| json!({"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": indices});
    let second = add_accessor(&mut value, &[0, 2, 3], 5121, 3, "SCALAR");
    value["accessors"][3]["count"] = json!(3);
    value["meshes"][0]["primitives"] = json!([primitive(3), primitive(second)]);
    let scene = load(&value).unwrap();
    assert_eq!(scene.meshes.iter().map(|mesh| mesh.positions.len()).collect::<Vec<_>>(), [3, 3]);
    assert_eq!(scene.meshes[1].corners(0), [DVec3::new(1.0, 2.0, 3.0), DVec3::new(3.0, 4.0, 3.0), DVec3::new(1.0, 4.0, 3.0)]);
    assert_eq!((scene.meshes[1].uvs[0].len(), scene.meshes[1].normals.len()), (3, 3));
}

/// What the extension would say is missing without it: the complaint is about the extension, with what to do.
#[test]
fn extensions_that_are_needed_and_not_read_are_one_line() {
    for (extension, remedy) in [("EXT_texture_avif", "PNG or JPEG"), ("EXT_unheard_of", "export settings of the program")] {
        let mut value = square();
        value["extensionsRequired"] = json!([extension]);
        value["images"] = json!([{}]);
        for accessor in value["accessors"].as_array_mut().unwrap() {
            for member in ["bufferView", "min", "max"] {
                accessor.as_object_mut().unwrap().remove(member);
            }
        }
        assert_refused(&value, &["scene.gltf", extension, remedy]);
        let line = load(&value).unwrap_err().to_string();
        assert!(!line.contains("Missing") && line.len() < 300, "{line}");
    }
}

/// A file may name what lies in its folder or below, and nothing else.
#[test]
fn files_outside_the_folder_are_not_opened() {
    let place = Place::new();
    std::fs::create_dir_all(place.at("inside/below")).unwrap();
    for name in ["outside.bin", "inside/beside it.bin", "inside/below/it.bin"] {
        place.write(name, square_buffer());
    }
    let open = |uri: &str| {
        let mut value = square();
        value["buffers"][0]["uri"] = json!(uri);
        place.write("inside/scene.gltf", value.to_string());
        Scene::open(place.at("inside/scene.gltf").to_str().unwrap(), false)
    };
    for uri in ["beside%20it.bin", "below/it.bin", "./below/../below/it.bin"] {
        assert_eq!(open(uri).unwrap().triangle_count(), 2, "{uri}");
    }
    let absolute = place.at("outside.bin").to_str().unwrap().to_owned();
    for uri in [absolute.as_str(), "../outside.bin", "%2e%2e/outside.bin", "below/../../outside.bin", "../inside/below/it.bin"] {
        assert_refusal(open(uri), &["buffer 0", uri, "outside the scene's folder"]);
    }
    assert_refusal(open(&format!("file://{absolute}")), &["buffer 0", "only files beside this one"]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(place.path(), place.at("inside/link")).unwrap();
        assert_refusal(open("link/outside.bin"), &["buffer 0", "outside the scene's folder"]);
    }
}

/// What is being done is reported, in order, with shares from 0 to 1.
#[test]
fn loading_reports_its_stages() {
    let mut value = with_png(&RgbImage::new(2, 2));
    value["materials"][0]["emissiveTexture"] = json!({"index": 0});
    let place = Place::new();
    place.write("scene.gltf", value.to_string());
    let mut stages = Vec::new();
    let mut report = |stage: &'static str, done: f64| {
        assert!((0.0..=1.0).contains(&done), "{stage}: {done}");
        if stages.last() != Some(&stage) {
            stages.push(stage);
        }
    };
    let scene = Scene::open_with(place.at("scene.gltf").to_str().unwrap(), Reading::default(), &mut report).unwrap();
    Geometry::new_with(&scene, &mut report).unwrap();
    let wanted = "reading the file, decoding textures, reading meshes, preparing triangles, looking for overlaps, \
        building the hierarchy, preparing triangles, packing textures, collecting lights";
    assert_eq!(stages.join(", "), wanted);
}

/// What Blender's own exporter writes (tools/make_blender_scene.py).
#[test]
fn a_blender_file_loads() {
    let scene = Scene::open(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/blender.glb"), false).unwrap();
    let material_of = |mesh: &str| {
        let mesh = scene.meshes.iter().find(|candidate| candidate.name.starts_with(mesh)).unwrap_or_else(|| panic!("no mesh {mesh}"));
        &scene.materials[mesh.material]
    };
    assert_eq!((material_of("mirror").layers.metallic, material_of("mirror").layers.roughness), (1.0, 0.0));
    let glass = material_of("glass").layers;
    assert_eq!((glass.transmission, glass.roughness, glass.medium), (1.0, 0.0, Some(Medium::CLEAR)));
    assert!((glass.ior - 1.45).abs() < 1e-6, "{glass:?}");
    assert!(material_of("tiles").base_colour_texture.is_some());
    assert!((material_of("panel").emission - Vec3::new(12.0, 9.6, 7.2)).abs().max_element() < 1e-4, "{:?}", material_of("panel"));
    assert_eq!(scene.cameras[0].name, "eye");
    // Blender's z is up; glTF's and ours is y.
    assert!((scene.cameras[0].eye - DVec3::new(0.0, 1.8, 5.0)).length() < 1e-5, "{:?}", scene.cameras);
    let kinds: Vec<&LightKind> = scene.lights.iter().map(|light| &light.kind).collect();
    assert!(kinds.iter().any(|kind| matches!(kind, LightKind::Point { .. })), "{kinds:?}");
    assert!(kinds.iter().any(|kind| matches!(kind, LightKind::Spot { .. })), "{kinds:?}");
    assert!(kinds.iter().any(|kind| matches!(kind, LightKind::Directional { .. })), "{kinds:?}");
    let ball = |segments: usize| segments * segments - 2 * segments;
    assert_eq!(scene.triangle_count(), 6 * 2 + 2 * ball(32) + 5 * ball(16));
    let parts = |mesh: &str| material_of(mesh).layers;
    assert_eq!((parts("lacquer").coat, parts("velvet").sheen_colour), (1.0, Vec3::ONE));
    assert!(material_of("worn").normal_map.is_some() && parts("worn").metallic_roughness_texture.is_some());
    let amber = parts("amber").medium.unwrap();
    assert!(amber.transmittance.z.powf(1.0 / amber.metres) < 1e-3, "{amber:?}");
    assert_eq!((parts("frosted").transmission, parts("frosted").medium), (1.0, None));
    assert!(matches!(material_of("leaf").coverage, Coverage::Mask { .. }));
    assert!(matches!(material_of("net").coverage, Coverage::Blend { .. }));
    assert!(scene.meshes.iter().any(|mesh| mesh.name.starts_with("shell") && !mesh.colours.is_empty()));
    assert!(parts("shell").specular_colour.y < 1.0);
}

/// What is left out or has no effect, each by its own words; and how much of a surface is there.
#[test]
fn what_has_no_effect_is_a_warning() {
    let warnings = |value: &Value| load(value).unwrap().warnings.join(" ");
    let mut value = square();
    assert_eq!(warnings(&value), "");
    value["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 0, "TEXCOORD_0": 2}]);
    assert_eq!(warnings(&value), "ignored: texture coordinates and colours of morph targets: mesh 'wall'");
    value["meshes"][0]["primitives"][0]["targets"] = json!([{"COLOR_0": 0}]);
    assert_eq!(warnings(&value), "ignored: texture coordinates and colours of morph targets: mesh 'wall'");
    // Not in the list of what the file uses.
    let mut value = square();
    value["nodes"][0]["extensions"] = json!({"EXT_lights_of_a_kind": {"attributes": {"TRANSLATION": 0}}});
    assert_eq!(warnings(&value), "ignored: the extension EXT_lights_of_a_kind: node 'wall'");
    // Numbers as the file has them, names without what turns the order of a line.
    let mut value = square();
    value["cameras"][0]["perspective"]["yfov"] = json!(0.001_1);
    value["nodes"][1]["name"] = json!("a\u{202e}b\u{2066}c\u{200f}d\u{1b}e\u{2028}f \u{e9}");
    assert_eq!(warnings(&value), "ignored: a camera with a vertical view of 0.0011 radians: camera 'a b c d e f \u{e9}'");

    // How a picture is made smaller is not asked for, and without a word on how it is made larger there is the usual way.
    let mut value = with_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 3}}}));
    value["samplers"] = json!([{"magFilter": 1, "minFilter": "fine"}]);
    value["textures"][3]["sampler"] = json!(0);
    let scene = load(&value).unwrap();
    assert_eq!((scene.textures[0].filter, scene.warnings.len()), (Filter::Bilinear, 1));
    assert_said(&scene.warnings, &["magFilter must be one of [9728, 9729]): sampler 0 with 1"]);
    assert_said(&scene.warnings, &["minFilter must be one of [9728, 9729, 9984, 9985, 9986, 9987]): sampler 0 with \"fine\""]);

    let nowhere = "ignored: surfaces that are nowhere seen (their alpha is 0, or below the cutoff): material 'pane'";
    for (mode, cutoff, alpha, expected) in [
        ("MASK", 1.5, 1.0, nowhere),
        ("MASK", 0.5, 0.25, nowhere),
        ("MASK", 0.5, 0.5, ""),
        ("MASK", 0.0, 0.0, ""),
        ("BLEND", 0.5, 0.0, nowhere),
        ("BLEND", 0.5, 0.25, ""),
        ("OPAQUE", 2.0, 0.0, ""),
    ] {
        let pbr = json!({"baseColorFactor": [1, 1, 1, alpha], "baseColorTexture": {"index": 3}});
        let value = with_material(json!({"name": "pane", "alphaMode": mode, "alphaCutoff": cutoff, "pbrMetallicRoughness": pbr}));
        assert_eq!(warnings(&value), expected, "{mode} {cutoff} {alpha}");
        let scene = load(&value).unwrap();
        let coverage = match mode {
            "MASK" => Coverage::Mask { alpha, cutoff },
            "BLEND" => Coverage::Blend { alpha },
            _ => Coverage::Whole,
        };
        assert_eq!(scene.materials[0].coverage, coverage);
        assert!((scene.textures[0].texels.at(0).w - 200.0 / 255.0).abs() < 1e-6);
    }

    let anyhow = "ignored: that normal maps or anisotropy lie on meshes without tangents (they have arbitrary directions): material 'bumpy' on mesh 'wall'";
    for (coordinates, expected) in [
        ([0.5; 8], anyhow),
        ([0., 0., 1., 0., 2., 0., 3., 0.], anyhow),
        ([0., 0., 0.1, 0.3, 0.2, 0.6, 0.7, 2.1], anyhow),
        // One triangle of two.
        ([0., 0., 1., 0., 2., 0., 0., 1.], ""),
        ([0., 0., 1., 0., 1., 1e-3, 0., 1e-3], ""),
    ] {
        let mut value = with_material(json!({"name": "bumpy", "normalTexture": {"index": 0}}));
        uvs(&mut value, &coordinates);
        assert_eq!(warnings(&value), expected, "{coordinates:?}");
        with_tangents(&mut value, [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(warnings(&value), "");
    }
    let mut value = with_material(json!({"name": "bumpy", "normalTexture": {"index": 0}}));
    value["materials"][0]["normalTexture"]["extensions"] = json!({"KHR_texture_transform": {"scale": [1, 0]}});
    assert_eq!(warnings(&value), anyhow);
}

fn rgba_png(width: u32, height: u32, of: impl Fn(u32, u32) -> [u8; 4]) -> String {
    let mut bytes = std::io::Cursor::new(Vec::new());
    RgbaImage::from_fn(width, height, |i, j| Rgba(of(i, j))).write_to(&mut bytes, ImageFormat::Png).unwrap();
    data_uri("image/png", &bytes.into_inner())
}

/// The square with one material, textures 0 to 16 of one picture each, and no warning of extensions.
pub fn with_material(material: Value) -> Value {
    let mut value = square();
    value["images"] = (0..17u8).map(|k| json!({"uri": rgba_png(1, 1, |_, _| [k, 2 * k, 3 * k, 200])})).collect();
    value["textures"] = (0..17).map(|k| json!({"source": k})).collect();
    value["materials"] = json!([material]);
    value["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    value
}

/// A material with every factor and every texture: `texture` gives the k-th, and hears whether it has colours or numbers.
pub fn everything(mut texture: impl FnMut(u8, bool) -> TextureUse) -> Material {
    let mut used = |k: u8, is_colour: bool| Some(texture(k, is_colour));
    let layers = Layers {
        metallic: 0.25,
        roughness: 0.3,
        metallic_roughness_texture: used(3, false),
        anisotropy: 0.55,
        anisotropy_rotation: -1.2,
        anisotropy_texture: used(16, false),
        ior: 1.1,
        specular: 0.9,
        specular_texture: used(4, false),
        specular_colour: Vec3::new(0.1, 2.0, 0.7),
        specular_colour_texture: used(5, true),
        transmission: 0.4,
        transmission_texture: used(6, false),
        diffuse_transmission: 0.7,
        diffuse_transmission_texture: used(12, false),
        diffuse_transmission_colour: Vec3::new(0.3, 0.6, 0.5),
        diffuse_transmission_colour_texture: used(13, true),
        dispersion: 2.5,
        iridescence: 0.35,
        iridescence_texture: used(14, false),
        film_ior: 1.7,
        film_thickness: [50.0, 900.0],
        film_thickness_texture: used(15, false),
        // So much is left after half a metre.
        medium: Some(Medium { transmittance: Vec3::new(0.1, 1.0, 0.0), metres: 0.5 }),
        coat: 0.6,
        coat_texture: used(7, false),
        coat_roughness: 0.05,
        coat_roughness_texture: used(8, false),
        coat_normal_map: used(9, false).map(|texture| NormalMap { texture, scale: 0.7 }),
        sheen_colour: Vec3::new(0.2, 0.4, 0.6),
        sheen_colour_texture: used(10, true),
        sheen_roughness: 0.8,
        sheen_roughness_texture: used(11, false),
        is_unlit: false,
    };
    Material {
        base_colour_texture: used(2, true),
        emission: Vec3::new(0.5, 4.0, 2.0),
        emission_texture: used(0, true),
        two_sided: true,
        coverage: Coverage::Blend { alpha: 0.7 },
        normal_map: used(1, false).map(|texture| NormalMap { texture, scale: -1.3 }),
        ..Material::layered("all", Vec3::new(0.1, 0.2, 0.3), layers)
    }
}

fn load_material(material: Value) -> Scene {
    load(&with_material(material)).unwrap()
}

/// Every factor and every texture is where it belongs, colours by the sRGB curve and numbers as they are.
#[test]
fn everything_of_a_material_is_read() {
    let transform = json!({"KHR_texture_transform": {"offset": [0.5, 0.25], "rotation": 0.75, "scale": [2, -3], "texCoord": 1}});
    let texture = |k: usize| json!({"index": k, "extensions": transform});
    let mut value = with_material(json!({
        "name": "all", "doubleSided": true, "alphaMode": "BLEND", "emissiveFactor": [0.125, 1.0, 0.5], "emissiveTexture": texture(0),
        "normalTexture": {"index": 1, "scale": -1.3, "extensions": transform},
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.7], "baseColorTexture": texture(2),
            "metallicFactor": 0.25, "roughnessFactor": 0.3, "metallicRoughnessTexture": texture(3)},
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 4},
            "KHR_materials_ior": {"ior": 1.1},
            "KHR_materials_dispersion": {"dispersion": 2.5},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.55, "anisotropyRotation": -1.2, "anisotropyTexture": texture(16)},
            "KHR_materials_iridescence": {"iridescenceFactor": 0.35, "iridescenceTexture": texture(14), "iridescenceIor": 1.7,
                "iridescenceThicknessMinimum": 50, "iridescenceThicknessMaximum": 900, "iridescenceThicknessTexture": texture(15)},
            "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.7, "diffuseTransmissionTexture": texture(12),
                "diffuseTransmissionColorFactor": [0.3, 0.6, 0.5], "diffuseTransmissionColorTexture": texture(13)},
            "KHR_materials_specular": {"specularFactor": 0.9, "specularTexture": texture(4),
                "specularColorFactor": [0.1, 2.0, 0.7], "specularColorTexture": texture(5)},
            "KHR_materials_transmission": {"transmissionFactor": 0.4, "transmissionTexture": texture(6)},
            "KHR_materials_volume": {"thicknessFactor": 2, "attenuationDistance": 0.5, "attenuationColor": [0.1, 1.0, 0.0]},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.6, "clearcoatTexture": texture(7), "clearcoatRoughnessFactor": 0.05,
                "clearcoatRoughnessTexture": texture(8), "clearcoatNormalTexture": {"index": 9, "scale": 0.7, "extensions": transform}},
            "KHR_materials_sheen": {"sheenColorFactor": [0.2, 0.4, 0.6], "sheenColorTexture": texture(10),
                "sheenRoughnessFactor": 0.8, "sheenRoughnessTexture": texture(11)}
        }
    }));
    // The square has no second set.
    let without = load(&value).unwrap();
    let [hole, warning] = &without.warnings[..] else { panic!("{:?}", without.warnings) };
    assert!(hole.starts_with("solids with holes (mesh 'wall')"), "{hole}");
    assert!(warning.contains("normal maps on meshes without texture coordinates: material 'all' on mesh 'wall'"), "{warning}");
    let stretched = "anisotropy on meshes without tangents and texture coordinates: material 'all' on mesh 'wall'";
    assert!(warning.contains(stretched), "{warning}");
    assert!(warning.contains("(its textures have their value at 0 0): material 'all' on mesh 'wall'"), "{warning}");
    // Another one has.
    use_material(&mut value, 0);
    value["meshes"][0]["primitives"][1]["attributes"]["TEXCOORD_1"] = json!(2);
    let scene = load(&value).unwrap();

    let material = &scene.materials[scene.meshes[1].material];
    let transform = UvTransform { scale: DVec2::new(2.0, -3.0), rotation: 0.75, offset: DVec2::new(0.5, 0.25) };
    let used = |k: u8, is_colour: bool| {
        let codes = vec![[k, 2 * k, 3 * k, 200]];
        let texels = if is_colour { Texels::Srgb(codes) } else { Texels::Linear(codes) };
        let place = scene.textures.iter().position(|texture| texture.texels == texels);
        TextureUse { transform, ..TextureUse::of(place.unwrap_or_else(|| panic!("no texture has {texels:?}")), 1) }
    };
    assert_eq!(*material, everything(used));
    assert_eq!(scene.textures.len(), 17);

    // What this mesh has no coordinates for is taken from its own copy of the material alone.
    let own = &scene.materials[scene.meshes[0].material];
    let layers = Layers { coat_normal_map: None, anisotropy: 0.0, ..material.layers };
    let without = Material { normal_map: None, layers, ..material.clone() };
    assert_eq!(*own, without);
}

/// What a material leaves out has the specification's defaults.
#[test]
fn materials_that_say_nothing_have_the_defaults() {
    let scene = load_material(json!({"name": "plain"}));
    assert_eq!(scene.materials[0], Material::layered("plain", Vec3::ONE, Layers::default()));
    let empty = "volume specular clearcoat sheen ior transmission dispersion diffuse_transmission iridescence anisotropy".split(' ');
    let empty: serde_json::Map<String, Value> = empty.map(|name| (format!("KHR_materials_{name}"), json!({}))).collect();
    let scene = load_whole(&with_material(json!({"name": "empty", "extensions": empty})));
    assert_eq!(scene.materials[0], Material::layered("empty", Vec3::ONE, Layers::default()));

    let mut value = with_material(json!({}));
    value["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
    let scene = load(&value).unwrap();
    let default = &scene.materials[scene.meshes[0].material];
    assert_eq!(*default, Material::layered("default", Vec3::ONE, Layers::default()));
    assert_eq!((default.layers.metallic, default.layers.roughness, default.two_sided), (1.0, 1.0, false));
}

/// A thickness above 0 makes a solid; without it the surface is a thin wall.
#[test]
fn volumes_have_a_transmittance_over_a_distance() {
    let medium = |volume: Value, transmission: f32| {
        let scene = load_material(json!({"name": "jar", "extensions": {
            "KHR_materials_volume": volume, "KHR_materials_transmission": {"transmissionFactor": transmission}}}));
        (scene.materials[0].layers.medium, scene.warnings.join(" "))
    };
    let grey = |value: f32, metres: f32| Some(Medium { transmittance: Vec3::splat(value), metres });
    for (volume, transmittance) in [
        (json!({}), None),
        (json!({"thicknessFactor": 0, "attenuationColor": [0.5, 0.5, 0.5], "attenuationDistance": 1}), None),
        (json!({"thicknessFactor": 0.01}), grey(1.0, 1.0)),
        // Without a distance nothing is taken.
        (json!({"thicknessFactor": 1, "attenuationColor": [0.5, 0.5, 0.5]}), grey(1.0, 1.0)),
        (json!({"thicknessFactor": 1, "attenuationColor": [0.25, 0.25, 0.25], "attenuationDistance": 2}), grey(0.25, 2.0)),
        (json!({"thicknessFactor": 1, "attenuationColor": [0, 0, 0], "attenuationDistance": 2}), grey(0.0, 2.0)),
        // After a metre no number of single precision would be left.
        (json!({"thicknessFactor": 1, "attenuationColor": [0.5, 0.5, 0.5], "attenuationDistance": 0.001}), grey(0.5, 0.001)),
    ] {
        let (found, warnings) = medium(volume.clone(), 1.0);
        assert_eq!(found, transmittance, "{volume}");
        // The square is no solid.
        assert_eq!(warnings.contains("solids with holes (mesh 'wall')"), found.is_some(), "{volume}: {warnings}");
    }
    assert_eq!(medium(json!({"thicknessFactor": 1}), 0.0).0, None);
}

#[test]
fn unlit_materials_have_a_base_colour_and_nothing_else() {
    let mut value =
        with_material(json!({"name": "sign", "alphaMode": "MASK", "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 3},
        "normalTexture": {"index": 4},
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 0.75], "baseColorTexture": {"index": 2}, "metallicFactor": 0.5},
        "extensions": {"KHR_materials_unlit": {}, "KHR_materials_clearcoat": {"clearcoatFactor": 1}}}));
    value["extensionsRequired"] = json!(["KHR_materials_unlit"]);
    let scene = load(&value).unwrap();
    let base_colour_texture = Some(TextureUse::of(0, 0));
    let coverage = Coverage::Mask { alpha: 0.75, cutoff: 0.5 };
    let layers = Layers { is_unlit: true, ..Layers::default() };
    let unlit = Material { base_colour_texture, coverage, ..Material::layered("sign", Vec3::new(0.5, 0.25, 1.0), layers) };
    assert_eq!((scene.materials[0].clone(), scene.textures.len()), (unlit, 1));
}

/// KHR_materials_pbrSpecularGlossiness is a dielectric whose reflectance along the normal is its specular colour.
#[test]
fn specular_and_glossiness_have_their_equivalent() {
    let material = |glossiness: Value| {
        let mut value = with_material(json!({"name": "old", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]},
            "extensions": {"KHR_materials_pbrSpecularGlossiness": glossiness}}));
        value["images"][1] = json!({"uri": rgba_png(2, 1, |i, _| [10, 20, 30, [0, 100][i as usize]])});
        value["extensionsRequired"] = json!(["KHR_materials_pbrSpecularGlossiness"]);
        load(&value).unwrap()
    };
    let scene = material(json!({"diffuseFactor": [0.5, 0.25, 0.125, 0.5], "specularFactor": [0.25, 0.5, 0.75], "glossinessFactor": 0.75}));
    let layers = Layers { metallic: 0.0, roughness: 0.25, ior: 0.0, specular_colour: Vec3::new(0.25, 0.5, 0.75), ..Layers::default() };
    assert_eq!(scene.materials[0], Material::layered("old", Vec3::new(0.5, 0.25, 0.125), layers));

    let scene = material(json!({"diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 1}, "glossinessFactor": 0.5}));
    let layers = scene.materials[0].layers;
    assert_eq!((layers.roughness, layers.metallic, layers.specular_colour), (1.0, 0.0, Vec3::ONE));
    let texels = |used: Option<TextureUse>| scene.textures[used.unwrap().texture].texels.clone();
    assert_eq!(texels(scene.materials[0].base_colour_texture), Texels::Srgb(vec![[0, 0, 0, 200]]));
    assert_eq!(texels(layers.specular_colour_texture), Texels::Srgb(vec![[10, 20, 30, 0], [10, 20, 30, 100]]));
    // 1 - glossiness, of which the factor is a part.
    assert_eq!(texels(layers.metallic_roughness_texture), Texels::Linear(vec![[255, 255, 255, 255], [255, 205, 255, 255]]));
}

/// Each of these extensions says that it must not stand beside specular and glossiness.
#[test]
fn specular_and_glossiness_stand_alone() {
    let gloss = |others: Value| {
        let mut extensions = others;
        extensions["KHR_materials_pbrSpecularGlossiness"] = json!({"specularFactor": [0.25, 0.5, 0.75]});
        load_material(json!({"name": "old", "extensions": extensions}))
    };
    let alone = gloss(json!({}));
    assert!(alone.warnings.is_empty(), "{:?}", alone.warnings);
    let others = [
        ("clearcoat", json!({"clearcoatFactor": 1})),
        ("diffuse_transmission", json!({"diffuseTransmissionFactor": 1})),
        ("dispersion", json!({"dispersion": 1})),
        ("ior", json!({"ior": 2})),
        ("iridescence", json!({"iridescenceFactor": 1})),
        ("anisotropy", json!({"anisotropyStrength": 1})),
        ("sheen", json!({"sheenColorFactor": [1, 1, 1]})),
        ("specular", json!({"specularFactor": 0})),
        ("transmission", json!({"transmissionFactor": 1})),
        ("volume", json!({"thicknessFactor": 1, "attenuationDistance": -1})),
    ];
    for (name, content) in others {
        let scene = gloss(json!({format!("KHR_materials_{name}"): content}));
        assert_eq!(scene.materials, alone.materials, "{name}");
        let expected = format!(
            "ignored: the extension KHR_materials_{name} beside KHR_materials_pbrSpecularGlossiness, where glTF forbids it: material 'old'"
        );
        assert_eq!(scene.warnings, [expected]);
    }
}

/// The fraction of the ior 0 is 1 whatever stands beside it: a specular factor s reflects s of the light along the normal, and the
/// rest goes on.
#[test]
fn surfaces_of_ior_zero_reflect_their_specular_factor() {
    let of_judge = |scene: &Scene, camera: &Camera| {
        let image = Judge::new(scene, u32::MAX).image(camera, 32, 32, 4, 1);
        image.pixels.iter().map(|pixel| pixel.mean.total().x).sum::<f64>() / image.pixels.len() as f64
    };
    // Which makes kernels of its own.
    let gpu = if is_long_run() { device() } else { None };
    let settings = SceneSettings { photons: 1000, rounds: 4, ..by_rounds() };
    let of_device = |gpu: &Gpu, scene: &Scene, camera: &Camera| mean_red(&seen(gpu, scene, &settings, camera, [32, 32]));
    for specular in [1.0f32, 0.25] {
        let mut scene = load_material(json!({"name": "old", "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
            "extensions": {"KHR_materials_ior": {"ior": 0}, "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_specular": {"specularFactor": specular},
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.1, "attenuationColor": [0, 0, 0]}}}));
        assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
        assert_said(&scene.warnings, &["volumes behind the ior 0"]);
        // A sky of 1 before it, a wall of 2 behind it.
        scene.lights = vec![Light { name: "sky".into(), kind: LightKind::Environment { radiance: Vec3::ONE } }];
        scene.materials.push(Material { emission: Vec3::splat(2.0), ..Material::lambert("wall", Vec3::ZERO) });
        let wall = scene.materials.len() - 1;
        scene.meshes.push(Mesh::parallelogram("wall", DVec3::new(-8.0, -8.0, 2.0), 20.0 * DVec3::X, 20.0 * DVec3::Y, wall));
        let camera = Camera::looking_at("ray", DVec3::new(2.1, 3.2, 8.0), DVec3::new(2.1, 3.2, 3.0), DVec3::Y, 0.003);
        let expected = f64::from(specular + 2.0 * (1.0 - specular));
        // Deltas are chosen by chance where there are two.
        let error = 0.5 * f64::from(specular * (1.0 - specular)).sqrt() / 32.0 + 1e-5;
        for found in [Some(of_judge(&scene, &camera)), gpu.as_deref().map(|gpu| of_device(gpu, &scene, &camera))].into_iter().flatten() {
            assert_holds(specular, z_check("radiance", found, expected, error));
        }
    }
}

/// What has the diffuse lobe alone costs no more than a built-in surface; what adds a lobe, a normal or a gap, or takes a side, is layered.
#[test]
fn plain_diffuse_materials_are_lambertian() {
    let no_gloss = json!({"KHR_materials_specular": {"specularFactor": 0}});
    let plain = json!({"doubleSided": true, "extensions": no_gloss, "emissiveFactor": [1, 0, 0],
        "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.3, "baseColorTexture": {"index": 0}}});
    let surface = |material: &Value| load_material(material.clone()).materials[0].surface;
    assert_eq!(surface(&plain), Surface::Lambert);
    // The eye does not see the back of what then has one side.
    assert_eq!(load_material(plain.clone()).without(&[Effect::TwoSided]).materials[0].surface, Surface::Layered);
    for (member, value) in [
        ("doubleSided", json!(false)),
        ("alphaMode", json!("BLEND")),
        ("normalTexture", json!({"index": 0})),
        ("pbrMetallicRoughness", json!({"metallicFactor": 0.5})),
        ("extensions", json!({})),
        ("extensions", json!({"KHR_materials_unlit": {}})),
        ("extensions", json!({"KHR_materials_specular": {"specularFactor": 0}, "KHR_materials_clearcoat": {"clearcoatFactor": 1}})),
        ("extensions", json!({"KHR_materials_specular": {"specularFactor": 0}, "KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1]}})),
        ("extensions", json!({"KHR_materials_specular": {"specularFactor": 0}, "KHR_materials_transmission": {"transmissionFactor": 1}})),
    ] {
        let mut other = plain.clone();
        other[member] = value;
        assert_eq!(surface(&other), Surface::Layered, "{other}");
    }
}

/// A picture is one texture for each way in which it is read.
#[test]
fn pictures_are_shared_where_they_are_read_alike() {
    let mut value =
        with_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}},
        "emissiveTexture": {"index": 1}, "extensions": {"KHR_materials_specular": {"specularTexture": {"index": 2}}}}));
    // Two samplers that say the same, and one that does not.
    value["samplers"] = json!([{"wrapS": 33071}, {"wrapS": 33071, "minFilter": 9729}, {"magFilter": 9728, "wrapS": 33071}]);
    value["textures"] = json!([{"source": 5, "sampler": 0}, {"source": 5, "sampler": 1}, {"source": 5, "sampler": 2}]);
    let scene = load(&value).unwrap();
    let material = &scene.materials[0];
    let place = |used: Option<TextureUse>| used.unwrap().texture;
    let (base, glow) = (place(material.base_colour_texture), place(material.emission_texture));
    let (rough, specular) = (place(material.layers.metallic_roughness_texture), place(material.layers.specular_texture));
    assert_eq!((scene.textures.len(), base, [base, rough, specular].iter().collect::<BTreeSet<_>>().len()), (3, glow, 3));
    assert!(scene.textures.iter().all(|texture| texture.wrap == [Wrap::Clamp, Wrap::Repeat]));
    assert_eq!([base, rough, specular].map(|place| scene.textures[place].filter), [Filter::Bilinear, Filter::Bilinear, Filter::Nearest]);
    let codes = vec![[5, 10, 15, 200]];
    assert_eq!((&scene.textures[base].texels, &scene.textures[rough].texels), (&Texels::Srgb(codes.clone()), &Texels::Linear(codes)));
}

/// Factors outside their range are refused, with the material, the value and the range.
#[test]
fn factors_out_of_range_are_refused() {
    let pbr = |name: &str, value: Value| json!({"name": "odd", "pbrMetallicRoughness": {name: value}});
    let with = |extension: &str, name: &str, value: Value| json!({"name": "odd", "extensions": {format!("KHR_materials_{extension}"): {name: value}}});
    let gloss = "pbrSpecularGlossiness";
    let cases: &[(Value, &[&str])] = &[
        (pbr("metallicFactor", json!(1.5)), &["metallic factor 1.5", "from 0 to 1"]),
        (pbr("roughnessFactor", json!(-0.5)), &["roughness factor -0.5", "from 0 to 1"]),
        (pbr("baseColorFactor", json!([1, 1, 1, 1.25])), &["alpha 1.25", "from 0 to 1"]),
        (pbr("baseColorFactor", json!([1, 1e40, 1, 1])), &["base colour 1 inf 1", "from 0 to 1"]),
        (json!({"name": "odd", "alphaMode": "MASK", "alphaCutoff": -1}), &["alpha cutoff -1", "0 or more"]),
        (with("ior", "ior", json!(0.5)), &["index of refraction 0.5", "must be 0, or from 1"]),
        (with("ior", "ior", json!(-1)), &["index of refraction -1"]),
        (with("transmission", "transmissionFactor", json!(2)), &["transmission factor 2", "from 0 to 1"]),
        (with("volume", "thicknessFactor", json!(-1)), &["thickness -1", "0 or more"]),
        (with("volume", "attenuationDistance", json!(0)), &["attenuation distance 0", "above 0"]),
        (with("volume", "attenuationColor", json!([1, 2, 1])), &["attenuation colour 1 2 1", "from 0 to 1"]),
        (with("specular", "specularFactor", json!(2)), &["specular factor 2", "from 0 to 1"]),
        (with("specular", "specularColorFactor", json!([-1, 0, 0])), &["specular colour -1 0 0", "0 or more"]),
        (with("clearcoat", "clearcoatFactor", json!(2)), &["clear coat factor 2", "from 0 to 1"]),
        (with("clearcoat", "clearcoatRoughnessFactor", json!(2)), &["clear coat roughness 2", "from 0 to 1"]),
        (with("clearcoat", "clearcoatFactor", json!("much")), &["KHR_materials_clearcoat that cannot be read", "much"]),
        (with("clearcoat", "clearcoatTexture", json!({"index": 99})), &["texture 99 of 17"]),
        (with("clearcoat", "clearcoatNormalTexture", json!({"index": 0, "scale": 1e9})), &["normal scale 1e9", "within 1e6"]),
        (with("sheen", "sheenColorFactor", json!([0, 0, 2])), &["sheen colour 0 0 2", "from 0 to 1"]),
        (with("diffuse_transmission", "diffuseTransmissionFactor", json!(2)), &["diffuse transmission factor 2", "from 0 to 1"]),
        (
            with("diffuse_transmission", "diffuseTransmissionColorFactor", json!([0, 2, 0])),
            &["diffuse transmission colour 0 2 0", "from 0 to 1"],
        ),
        (with("anisotropy", "anisotropyStrength", json!(-0.5)), &["anisotropy strength -0.5", "from 0 to 1"]),
        (with("anisotropy", "anisotropyRotation", json!(1e9)), &["anisotropy rotation 1e9", "within 1e6"]),
        (with("iridescence", "iridescenceFactor", json!(2)), &["iridescence factor 2", "from 0 to 1"]),
        (with("iridescence", "iridescenceIor", json!(0.5)), &["film of the index of refraction 0.5", "must be from 1"]),
        (with("iridescence", "iridescenceThicknessMaximum", json!(-1)), &["thickness of its film -1", "0 or more and finite"]),
        (with("dispersion", "dispersion", json!(-1)), &["dispersion -1", "0 or more and finite"]),
        (with("sheen", "sheenRoughnessFactor", json!(-1)), &["sheen roughness -1", "from 0 to 1"]),
        (with(gloss, "glossinessFactor", json!(7)), &["glossiness 7", "from 0 to 1"]),
        (with(gloss, "specularFactor", json!([2, 0, 0])), &["specular colour 2 0 0", "from 0 to 1"]),
        (with(gloss, "diffuseFactor", json!([2, 0, 0, 1])), &["base colour 2 0 0", "from 0 to 1"]),
    ];
    for (material, named) in cases {
        assert_refused(&with_material(material.clone()), &[&["scene.gltf", "material 'odd'"], *named].concat());
    }
}

/// The square with a normal map, changed, and its tangents.
fn bumpy_square(change: impl FnOnce(&mut Value)) -> Mesh {
    let mut value = with_material(json!({"name": "bumpy", "normalTexture": {"index": 0}}));
    change(&mut value);
    let mut scene = load(&value).unwrap();
    let mesh = scene.meshes.remove(0);
    let material = &scene.materials[mesh.material];
    assert_eq!(mesh.tangents.len(), if material.normal_map.is_some() { mesh.triangles.len() } else { 0 });
    assert_eq!(mesh.coat_tangents.len(), if material.layers.coat_normal_map.is_some() { mesh.triangles.len() } else { 0 });
    for (triangle, tangents) in [&mesh.tangents, &mesh.coat_tangents].into_iter().flat_map(|all| mesh.triangles.iter().zip(all)) {
        for (vertex, tangent) in pairs(triangle, tangents) {
            let normal = mesh.normals.get(*vertex as usize).copied().unwrap_or(mesh.normal(0));
            let direction = tangent.truncate();
            assert!(direction.is_normalized() && direction.dot(normal).abs() < 1e-9 && tangent.w.abs() == 1.0, "{tangent}");
        }
    }
    mesh
}

fn assert_all_near(tangents: &[[DVec4; 3]], expected: DVec4) {
    let far = tangents.as_flattened().iter().find(|tangent| tangent.distance(expected) > 1e-6);
    assert!(far.is_none() && !tangents.is_empty(), "{far:?}, not {expected}");
}

pub fn uvs(value: &mut Value, uvs: &[f32]) {
    set_attribute(value, "TEXCOORD_0", &floats(uvs), 5126, uvs.len() / 2, "VEC2");
}

/// Tangents point where u grows. glTF's v runs down the picture: the bitangent, sign * (normal x tangent), points where v falls.
#[test]
fn tangents_follow_texture_coordinates() {
    let upright = [0., 1., 1., 1., 1., 0., 0., 0.];
    let mirrored = [1., 1., 0., 1., 0., 0., 1., 0.];
    let turned = [0., 0., 0., 1., -1., 1., -1., 0.];
    // The square's own coordinates stand upside down.
    assert_all_near(&bumpy_square(|_| ()).tangents, DVec4::new(1.0, 0.0, 0.0, -1.0));
    assert_all_near(&bumpy_square(|value| uvs(value, &upright)).tangents, DVec4::new(1.0, 0.0, 0.0, 1.0));
    assert_all_near(&bumpy_square(|value| uvs(value, &mirrored)).tangents, DVec4::new(-1.0, 0.0, 0.0, -1.0));
    // u falls where y grows, v grows where x does.
    assert_all_near(&bumpy_square(|value| uvs(value, &turned)).tangents, DVec4::new(0.0, -1.0, 0.0, -1.0));

    // Half a picture and its mirror image, which share an edge.
    let halves = bumpy_square(|value| uvs(value, &[0., 1., 1., 1., 1., 0., 2., 1.]));
    assert_all_near(&halves.tangents[..1], DVec4::new(1.0, 0.0, 0.0, 1.0));
    assert_eq!(halves.tangents[1][2].w, -1.0, "{:?}", halves.tangents);

    for (transform, expected) in [
        // A quarter of a turn of the picture: u of the picture is v of the mesh. It is (cos u + sin v, cos v - sin u).
        (json!({"rotation": FRAC_PI_2, "scale": [1, 1]}), DVec4::new(0.0, -1.0, 0.0, 1.0)),
        (json!({"scale": [-1, 1]}), DVec4::new(-1.0, 0.0, 0.0, -1.0)),
        // Read as if it said nothing.
        (json!([]), DVec4::new(1.0, 0.0, 0.0, 1.0)),
    ] {
        let transformed = bumpy_square(|value| {
            uvs(value, &upright);
            value["materials"][0]["normalTexture"]["extensions"] = json!({"KHR_texture_transform": transform});
        });
        assert_all_near(&transformed.tangents, expected);
    }
}

/// Under a mirror the normal keeps to the front, so tangent, bitangent and normal change hands.
#[test]
fn tangents_of_mirrored_and_skewed_nodes_follow_the_surface() {
    let node = |value: &mut Value, scale: [f64; 3]| {
        uvs(value, &[0., 1., 1., 1., 1., 0., 0., 0.]);
        value["nodes"][0]["scale"] = json!(scale);
    };
    for (scale, expected) in [
        ([-1.0, 1.0, 1.0], DVec4::new(-1.0, 0.0, 0.0, -1.0)),
        ([1.0, -3.0, 1.0], DVec4::new(1.0, 0.0, 0.0, -1.0)),
        ([1.0, 1.0, -1.0], DVec4::new(1.0, 0.0, 0.0, -1.0)),
        ([-2.0, -3.0, 1.0], DVec4::new(-1.0, 0.0, 0.0, 1.0)),
    ] {
        let mesh = bumpy_square(|value| node(value, scale));
        assert_all_near(&mesh.tangents, expected);
        let (tangent, normal) = (mesh.tangents[0][0], mesh.normals[0]);
        // It points up the picture, to the mesh's third vertex from its second.
        let bitangent = tangent.w * normal.cross(tangent.truncate());
        assert!(bitangent.dot(mesh.positions[2] - mesh.positions[1]) > 0.0 && mesh.normal(0).dot(normal) > 0.0, "{scale:?}");
        // The file's own come to the same.
        let own = bumpy_square(|value| {
            node(value, scale);
            with_tangents(value, [1.0, 0.0, 0.0, 1.0]);
        });
        assert_all_near(&own.tangents, expected);
    }
}

fn with_tangents(value: &mut Value, tangent: [f32; 4]) {
    set_attribute(value, "TANGENT", &floats(&tangent.repeat(4)), 5126, 4, "VEC4");
}

/// The file's tangents count before what texture coordinates give, with what morph targets add.
#[test]
fn tangents_of_the_file_are_taken() {
    let diagonal = [0.6, 0.8, 0.0, 1.0f32];
    let expected = Vec4::from(diagonal).as_dvec4();
    assert_all_near(&bumpy_square(|value| with_tangents(value, diagonal)).tangents, expected);
    // They are made perpendicular to the normal.
    assert_all_near(&bumpy_square(|value| with_tangents(value, [0.6, 0.8, 3.0, 1.0])).tangents, expected);
    let morphed = bumpy_square(|value| {
        with_tangents(value, diagonal);
        let shift = add_accessor(value, &floats(&[-1.2, 0.0, 0.0].repeat(4)), 5126, 4, "VEC3");
        value["meshes"][0]["primitives"][0]["targets"] = json!([{"TANGENT": shift}]);
        value["meshes"][0]["weights"] = json!([1.0]);
    });
    assert_all_near(&morphed.tangents, DVec4::new(-0.6, 0.8, 0.0, 1.0));
    // A mesh without normals is flat, and its tangents are to be ignored.
    let flat = bumpy_square(|value| {
        with_tangents(value, diagonal);
        value["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("NORMAL");
    });
    assert!(flat.normals.is_empty());
    assert_all_near(&flat.tangents, DVec4::new(1.0, 0.0, 0.0, -1.0));

    let coat = |value: &mut Value, transform: Value| {
        with_tangents(value, diagonal);
        value["materials"][0]["extensions"] = json!({"KHR_materials_clearcoat": {"clearcoatFactor": 1,
            "clearcoatNormalTexture": {"index": 1, "extensions": {"KHR_texture_transform": transform}}}});
    };
    // The coat has them where its coordinates are those of the base, or the base has no normal map.
    assert_all_near(&bumpy_square(|value| coat(value, json!({}))).coat_tangents, expected);
    assert_all_near(&bumpy_square(|value| coat(value, json!({"scale": [-1, 1]}))).coat_tangents, DVec4::new(-1.0, 0.0, 0.0, 1.0));
    let alone = bumpy_square(|value| {
        coat(value, json!({"scale": [-1, 1]}));
        value["materials"][0].as_object_mut().unwrap().remove("normalTexture");
    });
    assert_all_near(&alone.coat_tangents, expected);

    for (tangent, named) in [([f32::NAN, 0.0, 0.0, 1.0], "NaN"), ([0.0, f32::INFINITY, 0.0, 1.0], "inf")] {
        let mut value = with_material(json!({"normalTexture": {"index": 0}}));
        with_tangents(&mut value, tangent);
        assert_refused(&value, &["mesh 'wall'", named]);
    }
}

/// Where there is no tangent any one will do that is perpendicular to the normal.
#[test]
fn tangents_are_never_without_direction() {
    // What is checked is in bumpy_square: one texel for all, texture coordinates on a line, tangents of no length or along the normal.
    bumpy_square(|value| uvs(value, &[0.5; 8]));
    bumpy_square(|value| uvs(value, &[0., 0., 1., 0., 2., 0., 3., 0.]));
    bumpy_square(|value| uvs(value, &[1e6, 0., -1e6, 1e-30, 2e-38, 1e6, 3., 0.]));
    bumpy_square(|value| with_tangents(value, [0.0; 4]));
    bumpy_square(|value| with_tangents(value, [0.0, 0.0, 5.0, 1.0]));
    for scale in [1e-30, 1e30] {
        let scaled = |value: &mut Value| value["nodes"][0] = json!({"mesh": 0, "scale": [scale, scale, scale]});
        assert_all_near(&bumpy_square(scaled).tangents, DVec4::new(1.0, 0.0, 0.0, -1.0));
        let mut positions = floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.].map(|number: f32| number * scale));
        positions.extend(&square_buffer()[48..]);
        let small_or_large = |value: &mut Value| {
            set_buffer(value, &positions);
            value["nodes"][0] = json!({"mesh": 0});
        };
        assert_all_near(&bumpy_square(small_or_large).tangents, DVec4::new(1.0, 0.0, 0.0, -1.0));
    }
}

/// More triangles at one vertex than the crate can group in one stack, or in a time that ends.
#[test]
fn a_vertex_of_many_triangles_has_tangents() {
    let mut value = with_material(json!({"normalTexture": {"index": 0}}));
    let indices = add_accessor(&mut value, &[0, 1, 2].repeat(200_000), 5121, 600_000, "SCALAR");
    value["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    let mesh = load(&value).unwrap().meshes.remove(0);
    assert_eq!(mesh.tangents.len(), 200_000);
    assert_all_near(&mesh.tangents, DVec4::new(1.0, 0.0, 0.0, -1.0));

    // A fan.
    for count in [8u32, 20_000] {
        let ring = (0..=count).map(|k| TAU * f64::from(k) / f64::from(count)).map(|angle| [angle.cos() as f32, angle.sin() as f32]);
        let places: Vec<[f32; 2]> = std::iter::once([0.0; 2]).chain(ring).collect();
        let mut value = with_material(json!({"normalTexture": {"index": 0}}));
        let vertices = places.len();
        let of = |each: &dyn Fn(&[f32; 2]) -> Vec<f32>| floats(&places.iter().flat_map(each).collect::<Vec<_>>());
        let positions = add_accessor(&mut value, &of(&|[x, y]| vec![*x, *y, 0.0]), 5126, vertices, "VEC3");
        let normals = add_accessor(&mut value, &of(&|_| vec![0.0, 0.0, 1.0]), 5126, vertices, "VEC3");
        let uvs = add_accessor(&mut value, &of(&|[x, y]| vec![*x, *y]), 5126, vertices, "VEC2");
        let primitive = json!({"attributes": {"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs}, "material": 0, "mode": 6});
        value["meshes"][0]["primitives"] = json!([primitive]);
        let mesh = load(&value).unwrap().meshes.remove(0);
        assert_eq!(mesh.tangents.len(), count as usize);
        let far = mesh.tangents.as_flattened().iter().find(|tangent| tangent.distance(DVec4::new(1.0, 0.0, 0.0, -1.0)) > 1e-2);
        assert!(far.is_none(), "{far:?}");
    }
}
