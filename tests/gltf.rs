//! Scenes from glTF: what a file says is what the scene holds, what it cannot be used for is refused
//! in one line, and no mutated file makes the loader panic.

use crate::common::gltf_file::{data_uri, encoded, floats, set_buffer, square, square_buffer};
use crate::common::prelude::*;
use image::{ImageFormat, RgbImage};
use serde_json::{Value, json};

struct File {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

fn file(name: &str, content: &[u8]) -> File {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    File { _folder: folder, path }
}

fn open(name: &str, content: &[u8]) -> Result<Scene, Error> {
    Scene::open(file(name, content).path.to_str().unwrap(), false)
}

fn load(value: &Value) -> Result<Scene, Error> {
    open("scene.gltf", value.to_string().as_bytes())
}

/// The same scene as a binary file.
fn glb(mut value: Value) -> Vec<u8> {
    let mut binary = square_buffer();
    value["buffers"][0].as_object_mut().unwrap().remove("uri");
    let mut text = value.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let chunk = |kind: &[u8; 4], content: &[u8]| [&(content.len() as u32).to_le_bytes(), kind.as_slice(), content].concat();
    let chunks = [chunk(b"JSON", &text), chunk(b"BIN\0", &binary)].concat();
    [b"glTF".as_slice(), &2u32.to_le_bytes(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}

#[test]
fn a_file_says_what_the_scene_holds() {
    for scene in [load(&square()).unwrap(), open("scene.glb", &glb(square())).unwrap()] {
        let [mesh] = scene.meshes.as_slice() else { panic!("{:?}", scene.meshes) };
        assert_eq!(mesh.name, "wall");
        assert_eq!(mesh.positions[2], DVec3::new(3.0, 4.0, 3.0));
        assert_eq!((mesh.normals[0], mesh.normal(0), mesh.area(0)), (DVec3::Z, DVec3::Z, 2.0));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        let material = &scene.materials[mesh.material];
        assert_eq!((material.surface, material.base_colour), (Surface::Lambert, Vec3::new(0.5, 0.25, 0.125)));
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
    let radiometric = Scene::open(file("a.glb", &glb(square())).path.to_str().unwrap(), true).unwrap();
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
    let png = encoded(&picture, ImageFormat::Png);
    let mut value = square();
    with_image(&mut value, &data_uri("image/png", &png));
    let scene = load(&value).unwrap();
    let texture = &scene.textures[scene.materials[0].base_colour_texture.unwrap().texture];
    assert_eq!((texture.width, texture.height), (2, 1));
    assert!((texture.texels.at(0).truncate() - Vec3::new(1.0, 0.0, 0.502_886)).abs().max_element() < 1e-5, "{:?}", texture.texels);

    value["images"] = json!([{"name": "paint", "uri": data_uri("image/png", &png[..30])}]);
    assert_refused(&value, &["texture image 'paint'", "cannot be decoded"]);
}

#[test]
fn what_is_left_out_is_named_once() {
    let mut value = square();
    value["materials"][0]["alphaMode"] = json!("BLEND");
    value["materials"].as_array_mut().unwrap().push(json!({"alphaMode": "MASK"}));
    value["animations"] = json!([{"channels": [], "samplers": []}]);
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_materials_clearcoat"));
    value["cameras"][0] = json!({"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1}});
    value["meshes"][0]["primitives"][0]["attributes"]["COLOR_1"] = json!(1);
    let scene = load(&value).unwrap();
    let [warning] = scene.warnings.as_slice() else { panic!("{:?}", scene.warnings) };
    let wanted = [
        "transparency by alpha: material 'glow', material 'material 1'",
        "animations",
        "KHR_materials_clearcoat",
        "orthographic cameras: camera 'eye'",
        "second sets of vertex colours: mesh 'wall'",
    ];
    for words in wanted {
        assert_eq!(warning.matches(words).count(), 1, "{words}: {warning}");
    }

    // Of many names the first few.
    let materials: Vec<Value> = (0..40).map(|k| json!({"name": format!("m{k:02}"), "alphaMode": "BLEND"})).collect();
    let mut value = square();
    value["materials"] = json!(materials);
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
                assert!(scene.warnings.iter().any(|warning| warning.contains("vertical view")), "{angle}: {:?}", scene.warnings);
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
    let wanted = "1 triangle without area left out (mesh 'wall')";
    assert!(scene.warnings.iter().any(|warning| warning.contains(wanted)), "{:?}", scene.warnings);
}

fn assert_refused(value: &Value, named: &[&str]) {
    assert_refusal(load(value), named);
}

fn assert_refusal(result: Result<Scene, Error>, named: &[&str]) {
    let error = result.expect_err(&format!("must be refused for {named:?}"));
    assert_eq!(error.exit_code(), 2, "{error}");
    let line = error.to_string();
    assert_eq!(line.lines().count(), 1, "{line}");
    for word in named {
        assert!(line.contains(word), "must name {word:?}: {line}");
    }
}

/// A picture on the square.
fn with_image(value: &mut Value, uri: &str) {
    value["images"] = json!([{"uri": uri}]);
    value["textures"] = json!([{"source": 0}]);
    value["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
}

#[test]
fn what_cannot_be_used_is_refused_with_file_and_object() {
    type Spoil = fn(&mut Value);
    let cases: &[(Spoil, &[&str])] = &[
        (|v| v["bufferViews"][0]["byteOffset"] = json!(1_000_000), &["scene.gltf", "mesh 'wall'", "buffer view 0"]),
        (|v| v["bufferViews"][0]["byteLength"] = json!(40), &["mesh 'wall'", "runs past"]),
        (|v| v["accessors"][0]["count"] = json!(400_000_000), &["mesh 'wall'", "runs past"]),
        (|v| v["accessors"][0].as_object_mut().unwrap().remove("bufferView").map_or((), drop), &["scene.gltf"]),
        (|v| v["accessors"][1]["count"] = json!(3), &["mesh 'wall'", "3 normals for 4 vertices"]),
        (|v| v["accessors"][3]["componentType"] = json!(5126), &["mesh 'wall'", "indices"]),
        (|v| v["buffers"][0]["byteLength"] = json!(10_000), &["buffer 0", "140 bytes", "10000"]),
        (|v| v["buffers"][0]["uri"] = json!("absent.bin"), &["buffer 0", "absent.bin", "cannot be read"]),
        (|v| with_image(v, "absent.png"), &["scene.gltf", "texture image 0", "absent.png", "no such file"]),
        (|v| v["buffers"][0]["uri"] = json!("%zz"), &["buffer 0", "%zz"]),
        (|v| v["buffers"][0]["uri"] = json!("https://example.com/a.bin"), &["buffer 0", "only files beside this one"]),
        (|v| v["buffers"][0]["uri"] = json!("data:x;base64,@@@"), &["buffer 0", "not base64"]),
        (|v| v["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([2, 0, 0, 1]), &["material 'glow'", "from 0 to 1"]),
        (|v| v["materials"][0]["emissiveFactor"] = json!([-1, 0, 0]), &["material 'glow'", "emits"]),
        (|v| v["nodes"][0]["scale"] = json!([1e300, 1, 1]), &["'wall'", "finite"]),
        (|v| v["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = json!(-1), &["light 'bulb'", "0 or more"]),
        (|v| v["extensions"]["KHR_lights_punctual"]["lights"][2]["spot"]["outerConeAngle"] = json!(0.1), &["light", "cones"]),
        (|v| v["scenes"][0]["nodes"] = json!([1]), &["no triangle"]),
        (|v| v["meshes"][0]["primitives"][0]["mode"] = json!(1), &["no triangle"]),
        (|v| v["meshes"][0]["primitives"][0]["material"] = json!(7), &["scene.gltf"]),
        (|v| v["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]), &["scene.gltf", "KHR_draco_mesh_compression"]),
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
    let whole = glb(square());
    assert_refusal(open("a.glb", &whole[..whole.len() / 2]), &["a.glb"]);
    assert_refusal(open("a.glb", &[]), &["a.glb"]);
    assert_refusal(open("a.gltf", b"{"), &["a.gltf"]);
    assert_refusal(Scene::open("absent.glb", false), &["absent.glb", "cannot be read"]);
    assert_refusal(Scene::open("cornel", false), &["SCENE cornel", "cornell-spheres"]);
}

/// Adds an accessor of numbers in a buffer of its own, and returns its number.
fn add_accessor(value: &mut Value, bytes: &[u8], component: u32, count: usize, kind: &str) -> usize {
    let add = |list: &mut Value, item: Value| {
        let list = list.as_array_mut().unwrap();
        list.push(item);
        list.len() - 1
    };
    let uri = data_uri("application/octet-stream", bytes);
    let buffer = add(&mut value["buffers"], json!({"byteLength": bytes.len(), "uri": uri}));
    let view = add(&mut value["bufferViews"], json!({"buffer": buffer, "byteOffset": 0, "byteLength": bytes.len()}));
    add(&mut value["accessors"], json!({"bufferView": view, "componentType": component, "count": count, "type": kind}))
}

/// The square as the skin of two joints, of which the second has the vertices 2 and 3. In the bind pose their matrices
/// are none.
fn skinned_square() -> Value {
    let mut value = square();
    let moved = |by: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, by, 1.0f32];
    let matrices = add_accessor(&mut value, &floats(&[moved(-7.0), moved(-9.0)].concat()), 5126, 2, "MAT4");
    let joints = add_accessor(&mut value, &[0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], 5121, 4, "VEC4");
    let weights = add_accessor(&mut value, &floats(&[1.0, 0.0, 0.0, 0.0].repeat(4)), 5126, 4, "VEC4");
    value["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(joints);
    value["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    value["skins"] = json!([{"inverseBindMatrices": matrices, "joints": [5, 6]}]);
    value["nodes"][0]["skin"] = json!(0);
    value["nodes"]
        .as_array_mut()
        .unwrap()
        .extend([json!({"name": "hip", "translation": [0, 0, 7], "children": [6]}), json!({"name": "knee", "translation": [0, 0, 2]})]);
    value["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(5));
    value
}

#[test]
fn a_skinned_mesh_follows_its_joints_and_not_its_node() {
    let bind = load(&skinned_square()).unwrap();
    let corners = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
    assert_eq!(bind.meshes[0].positions, corners);
    assert_eq!((bind.meshes[0].normals[0], bind.meshes[0].area(0)), (DVec3::Z, 0.5));
    assert!(bind.warnings.is_empty(), "{:?}", bind.warnings);

    // A joint moved takes its vertices along; a joint below it is moved with it.
    let mut posed = skinned_square();
    posed["nodes"][6]["translation"] = json!([0, 3, 2]);
    assert_eq!(
        load(&posed).unwrap().meshes[0].positions,
        [corners[0], corners[1], corners[2] + 3.0 * DVec3::Y, corners[3] + 3.0 * DVec3::Y]
    );
    posed["nodes"][5]["scale"] = json!([-1, 1, 1]);
    let mirrored = load(&posed).unwrap();
    assert_eq!((mirrored.meshes[0].positions[1], mirrored.meshes[0].normal(0)), (-DVec3::X, DVec3::Z));

    for path in ["/nodes/0/skin", "/skins/0/joints/1", "/skins/0/inverseBindMatrices"] {
        let mut value = skinned_square();
        *value.pointer_mut(path).unwrap() = json!(99);
        assert_refused(&value, &["scene.gltf"]);
    }
    let mut value = skinned_square();
    value["skins"][0]["joints"] = json!([5]);
    assert_refused(&value, &["mesh 'wall'", "joint 1 of 1"]);
    let mut value = skinned_square();
    value["scenes"][0]["nodes"].as_array_mut().unwrap().pop();
    assert_refused(&value, &["skin 0", "node 'hip'", "not in the scene"]);
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
        let scene = load(value).unwrap();
        assert_eq!(scene.warnings, Vec::<String>::new());
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

    let few = add_accessor(&mut value, &floats(&[0.0; 9]), 5126, 3, "VEC3");
    value["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": few}, {}]);
    assert_refused(&value, &["mesh 'wall'", "3 positions in a morph target for 4 vertices"]);
}

/// Integers stand for themselves, or for parts of their range.
/// Most files have their metalness in a texture, and a factor of 1.
#[test]
fn metalness_and_roughness_of_textures_count_by_their_mean() {
    for (codes, expected) in [
        ([[0, 255, 0], [0, 255, 0]], Surface::Lambert),
        ([[255, 0, 255], [0, 0, 200]], Surface::Mirror),
        // Alpha is a quarter.
        ([[0, 255, 255], [7, 0, 255]], Surface::Glossy { exponent: 30.0 }),
    ] {
        let picture = RgbImage::from_fn(2, 1, |i, _| image::Rgb(codes[i as usize]));
        let mut value = square();
        with_image(&mut value, &data_uri("image/png", &encoded(&picture, ImageFormat::Png)));
        value["materials"][0]["pbrMetallicRoughness"] = json!({"metallicRoughnessTexture": {"index": 0}});
        let scene = load(&value).unwrap();
        assert_eq!(scene.materials[0].surface, expected);
        assert!(scene.textures.is_empty() && scene.warnings[0].contains("taken as their mean"), "{:?}", scene.warnings);
    }
    // A picture that cannot be read is no reason to refuse a file that needs it for this alone.
    let mut value = square();
    with_image(&mut value, &data_uri("image/png", b"no picture"));
    value["materials"][0]["pbrMetallicRoughness"] = json!({"metallicRoughnessTexture": {"index": 0}, "metallicFactor": 0.25});
    let scene = load(&value).unwrap();
    assert_eq!(scene.materials[0].surface, Surface::Lambert);
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.contains("textures that cannot be read (the factors alone count)") && !warning.contains("mean"), "{warning}");
}

/// A surface without its coat is a surface still.
#[test]
fn what_a_file_needs_for_looks_alone_is_left_out_by_name() {
    let mut value = square();
    for extension in ["KHR_materials_clearcoat", "KHR_materials_iridescence"] {
        value["extensionsUsed"].as_array_mut().unwrap().push(json!(extension));
    }
    value["extensionsRequired"] = json!(["KHR_materials_iridescence"]);
    let scene = load(&value).unwrap();
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.contains("the extension KHR_materials_clearcoat; the extension KHR_materials_iridescence"), "{warning}");
}

#[test]
fn quantized_meshes_are_read() {
    let mut value = square();
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_mesh_quantization"));
    value["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let shorts = |numbers: &[i16]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    // Each vertex takes a multiple of four bytes.
    let positions = add_accessor(&mut value, &shorts(&[0, 0, 0, 0, 300, 0, 0, 0, 300, 300, 0, 0, 0, 300, -5, 0]), 5122, 4, "VEC3");
    value["bufferViews"][4]["byteStride"] = json!(8);
    let uvs = add_accessor(&mut value, &shorts(&[0, 0, -1, 0, -1, -1, 0, -1]), 5123, 4, "VEC2");
    value["accessors"][uvs]["normalized"] = json!(true);
    value["accessors"][positions]["min"] = json!([0, 0, -5]);
    value["accessors"][positions]["max"] = json!([300, 300, 0]);
    value["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(positions);
    value["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uvs);
    value["nodes"][0]["scale"] = json!([0.01, 0.01, 0.01]);
    let mesh = load(&value).unwrap().meshes.remove(0);
    assert!((mesh.positions[3] - DVec3::new(1.0, 5.0, 2.95)).length() < 1e-7, "{:?}", mesh.positions);
    assert_eq!(mesh.uvs[0], [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(DVec2::from));
}

#[test]
fn vertex_colours_are_read() {
    let mut value = square();
    let bytes = [[255, 0, 51, 0], [0, 255, 0, 0], [0, 0, 255, 255], [255; 4]].concat();
    let colours = add_accessor(&mut value, &bytes, 5121, 4, "VEC4");
    value["accessors"][colours]["normalized"] = json!(true);
    value["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colours);
    let scene = load(&value).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    assert_eq!(scene.meshes[0].colours, [DVec3::new(1.0, 0.0, 0.2f32.into()), DVec3::Y, DVec3::Z, DVec3::ONE]);

    let mut bright = value.clone();
    let colours = add_accessor(&mut bright, &floats(&[0.5, 0.5, 1.5].repeat(4)), 5126, 4, "VEC3");
    bright["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colours);
    assert_refused(&bright, &["mesh 'wall'", "vertex colour 0.5 0.5 1.5", "from 0 to 1"]);
    let few = add_accessor(&mut value, &floats(&[0.5; 9]), 5126, 3, "VEC3");
    value["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(few);
    assert_refused(&value, &["mesh 'wall'", "3 vertex colours for 4 vertices"]);
}

/// The specification's matrices: scaled, then turned, then moved; another set may be named.
#[test]
fn texture_coordinates_are_transformed() {
    let png = encoded(&RgbImage::new(2, 2), ImageFormat::Png);
    let mut value = square();
    with_image(&mut value, &data_uri("image/png", &png));
    value["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_texture_transform"));
    value["extensionsRequired"] = json!(["KHR_texture_transform"]);
    let transform = json!({"offset": [0.5, 0.25], "rotation": FRAC_PI_2, "scale": [2.0, 3.0], "texCoord": 1});
    value["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = json!({"KHR_texture_transform": transform});
    let scene = load(&value).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
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

#[test]
fn a_mark_of_the_byte_order_is_passed_over() {
    let text = square().to_string();
    let scene = open("scene.gltf", &[b"\xef\xbb\xbf".as_slice(), text.as_bytes()].concat()).unwrap();
    assert_eq!(scene.triangle_count(), 2);
}

/// What the extension would say is missing without it: the complaint is about the extension, with what to do.
#[test]
fn extensions_that_are_needed_and_not_read_are_one_line() {
    for (extension, remedy) in [
        ("KHR_draco_mesh_compression", "untick Data > Compression"),
        ("EXT_meshopt_compression", "gltfpack: without -c"),
        ("KHR_texture_basisu", "PNG or JPEG"),
        ("EXT_unheard_of", "export it without"),
    ] {
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
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("inside");
    std::fs::create_dir_all(inside.join("below")).unwrap();
    for place in ["outside.bin", "inside/beside it.bin", "inside/below/it.bin"] {
        std::fs::write(folder.path().join(place), square_buffer()).unwrap();
    }
    let path = inside.join("scene.gltf");
    let open = |uri: &str| {
        let mut value = square();
        value["buffers"][0]["uri"] = json!(uri);
        std::fs::write(&path, value.to_string()).unwrap();
        Scene::open(path.to_str().unwrap(), false)
    };
    for uri in ["beside%20it.bin", "below/it.bin", "./below/../below/it.bin"] {
        assert_eq!(open(uri).unwrap().triangle_count(), 2, "{uri}");
    }
    let absolute = folder.path().join("outside.bin").to_str().unwrap().to_owned();
    for uri in [absolute.as_str(), "../outside.bin", "%2e%2e/outside.bin", "below/../../outside.bin", "../inside/below/it.bin"] {
        assert_refusal(open(uri), &["buffer 0", uri, "outside the scene's folder"]);
    }
    assert_refusal(open(&format!("file://{absolute}")), &["buffer 0", "only files beside this one"]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(folder.path(), inside.join("link")).unwrap();
        assert_refusal(open("link/outside.bin"), &["buffer 0", "outside the scene's folder"]);
    }
}

/// What is being done is reported, in order, with shares from 0 to 1.
#[test]
fn loading_reports_its_stages() {
    let mut value = square();
    let png = encoded(&RgbImage::new(2, 2), ImageFormat::Png);
    with_image(&mut value, &data_uri("image/png", &png));
    value["materials"][0]["emissiveTexture"] = json!({"index": 0});
    let file = file("scene.gltf", value.to_string().as_bytes());
    let mut stages = Vec::new();
    let mut report = |stage: &'static str, done: f64| {
        assert!((0.0..=1.0).contains(&done), "{stage}: {done}");
        if stages.last() != Some(&stage) {
            stages.push(stage);
        }
    };
    let scene = Scene::open_with(file.path.to_str().unwrap(), false, &mut report).unwrap();
    Geometry::new_with(&scene, &mut report).unwrap();
    let wanted = "reading the file, decoding textures, reading meshes, preparing triangles, looking for overlaps, \
        building the hierarchy, preparing triangles, packing textures, collecting lights";
    assert_eq!(stages.join(", "), wanted);
}

/// Nodes within themselves, and deeper than any hierarchy.
#[test]
fn endless_hierarchies_end() {
    let mut value = square();
    value["nodes"][0]["children"] = json!([0]);
    assert_refused(&value, &["'wall'"]);
}

/// Bytes changed, cut and repeated at random, JSON values replaced: the loader answers, and quickly.
#[test]
fn no_mutated_file_makes_the_loader_panic() {
    let whole = glb(square());
    let text = square().to_string().into_bytes();
    let mut state = 1u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as usize) % below.max(1)
    };
    let mut refused = 0;
    for case in 0..4000 {
        let (name, seed) = if case % 2 == 0 { ("a.glb", &whole) } else { ("a.gltf", &text) };
        let mut bytes = seed.clone();
        for _ in 0..=random(6) {
            let place = random(bytes.len());
            match random(5) {
                0 => bytes[place] ^= 1 << random(8),
                1 => bytes[place] = random(256) as u8,
                2 => bytes.truncate(place.max(1)),
                3 => bytes[place] = b"0123456789-eE.[]{},:"[random(20)],
                _ => {
                    let end = (place + random(16)).min(bytes.len());
                    let part = bytes[place..end].to_vec();
                    bytes.splice(place..place, part);
                }
            }
        }
        refused += usize::from(open(name, &bytes).is_err());
    }
    assert!(refused > 1000, "the mutations must matter: {refused} of 4000 were refused");
}

/// What Blender's own exporter writes (tools/make_blender_scene.py).
#[test]
fn a_blender_file_loads() {
    let scene = Scene::open(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/blender.glb"), false).unwrap();
    let material_of = |mesh: &str| {
        let mesh = scene.meshes.iter().find(|candidate| candidate.name.starts_with(mesh)).unwrap_or_else(|| panic!("no mesh {mesh}"));
        &scene.materials[mesh.material]
    };
    assert_eq!(material_of("mirror").surface, Surface::Mirror);
    let Surface::Dielectric { ior } = material_of("glass").surface else { panic!("{:?}", material_of("glass")) };
    assert!((ior - 1.45).abs() < 1e-6, "{ior}");
    assert!(material_of("tiles").base_colour_texture.is_some());
    assert!((material_of("panel").emission - Vec3::new(12.0, 9.6, 7.2)).abs().max_element() < 1e-4, "{:?}", material_of("panel"));
    assert_eq!(scene.cameras[0].name, "eye");
    // Blender's z is up; glTF's and ours is y.
    assert!((scene.cameras[0].eye - DVec3::new(0.0, 1.8, 5.0)).length() < 1e-5, "{:?}", scene.cameras);
    let kinds: Vec<&LightKind> = scene.lights.iter().map(|light| &light.kind).collect();
    assert!(kinds.iter().any(|kind| matches!(kind, LightKind::Point { .. })), "{kinds:?}");
    assert!(kinds.iter().any(|kind| matches!(kind, LightKind::Spot { .. })), "{kinds:?}");
    assert!(kinds.iter().any(|kind| matches!(kind, LightKind::Directional { .. })), "{kinds:?}");
    assert_eq!(scene.triangle_count(), 3 * 2 + 2 * (32 * 16 * 2 - 2 * 32));
}
