//! Scenes that stand far from the origin, as exports of buildings and maps do: to 0.1 mm they are what they are near it, and what is not
//! is said.

use crate::common::gltf_file::{floats, set_buffer, square, square_buffer};
use crate::common::prelude::*;
use crate::common::rich_file::{add, animated, instanced};
use photonmill::scene::Reading;
use serde_json::{Value, json};

/// Metres: a place of the UTM grid, north along z.
const SITE: [f64; 3] = [500_123.37, 0.0, 4_649_776.22];

fn load(value: &Value, at: Option<f64>) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, value.to_string()).unwrap();
    Scene::open_with(path.to_str().unwrap(), Reading { radiometric: false, at }, &mut |_, _| {}).unwrap()
}

/// The square's scene with these nodes, the first of which have no parent.
fn with_nodes(roots: usize, nodes: Vec<Value>) -> Value {
    let mut value = square();
    value["scenes"][0]["nodes"] = (0..roots).collect();
    value["nodes"] = nodes.into();
    value
}

fn site(by: [f64; 3]) -> Value {
    json!([SITE[0] + by[0], SITE[1] + by[1], SITE[2] + by[2]])
}

/// What is said of the scene and of its geometry.
fn warnings(scene: &Scene) -> String {
    [scene.warnings.clone(), Geometry::new(scene).unwrap().warnings(scene)].concat().join("\n")
}

/// Most that a corner is off, through the numbers that kernels see.
fn most_off(scene: &Scene, corner: impl Fn(usize, usize) -> DVec3) -> f64 {
    let geometry = Geometry::new(scene).unwrap();
    let of_mesh = |(place, mesh): (usize, &Mesh)| {
        let off = |(vertex, position): (usize, &DVec3)| geometry.to_world(geometry.to_local(*position)).distance(corner(place, vertex));
        mesh.positions.iter().enumerate().map(off).fold(0.0, f64::max)
    };
    scene.meshes.iter().enumerate().map(of_mesh).fold(0.0, f64::max)
}

const CORNERS: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];

/// Posts 40 cm apart came out 50 cm apart. One is below a turned and scaled node, one has a matrix, one lies below two nodes whose
/// translations take each other away.
#[test]
fn nodes_stand_where_the_file_says() {
    let apart = [0.4, 0.8, 1.2, 1.6];
    let matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, SITE[0], 0.0, SITE[2] + apart[1], 1.0];
    // From z up to y up, as seven digits have it.
    let turned = json!({"children": [5], "rotation": [-0.70710681, 0, 0, 0.70710681], "scale": [2, 2, 2]});
    let below = json!({"mesh": 0, "rotation": [0.70710681, 0, 0, 0.70710681], "scale": [0.5, 0.5, 0.5],
        "translation": [0.5 * SITE[0], -0.5 * (SITE[2] + apart[2]), 0]});
    let value = with_nodes(
        5,
        vec![
            json!({"mesh": 0, "translation": site([0.0; 3])}),
            json!({"mesh": 0, "translation": site([0.0, 0.0, apart[0]])}),
            json!({"mesh": 0, "matrix": matrix}),
            turned,
            json!({"translation": [-1e7, 0, 0.1], "children": [6]}),
            below,
            json!({"mesh": 0, "translation": site([1e7, 0.0, apart[3] - 0.1])}),
        ],
    );
    let scene = load(&value, None);
    assert_eq!(scene.meshes.len(), 5);
    let place = |mesh: usize| DVec3::from(SITE) + DVec3::Z * (mesh as f64 * 0.4);
    let off = most_off(&scene, |mesh, vertex| place(mesh) + CORNERS[vertex]);
    assert!(off < 1e-6, "{off}");
    assert_eq!(warnings(&scene), "");
}

/// Light came in between the walls.
#[test]
fn a_room_of_six_panels_is_closed() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // Walls of 1.2 x 1.2 m around a cube of one metre.
    let panel = |rotation: [f64; 4], at: [f64; 3]| {
        let middle = DQuat::from_array(rotation) * DVec3::new(0.6, 0.6, 0.0);
        let place = DVec3::from(at) * 0.5 - middle;
        json!({"mesh": 0, "rotation": rotation, "scale": [1.2, 1.2, 1], "translation": site(place.to_array())})
    };
    let (flat, up, aside) = ([0.0, 0.0, 0.0, 1.0], [half, 0.0, 0.0, half], [0.0, half, 0.0, half]);
    let room = |round: bool| {
        let sides = [-1.0, 1.0]
            .into_iter()
            .flat_map(|side| [panel(flat, [0.0, 0.0, side]), panel(up, [0.0, side, 0.0]), panel(aside, [side, 0.0, 0.0])]);
        let rounded = |mut node: Value| {
            let places: Vec<f64> =
                node["translation"].as_array().unwrap().iter().map(|of| f64::from(of.as_f64().unwrap() as f32)).collect();
            if round {
                node["translation"] = json!(places);
            }
            node
        };
        load(&with_nodes(6, sides.map(rounded).collect()), None)
    };
    let leaks = |scene: &Scene| {
        let middle = DVec3::from(SITE);
        (0..500)
            .filter(|k| {
                let z = 1.0 - (*k as f64 + 0.5) / 250.0;
                let azimuth = *k as f64 * 2.399_963;
                let flat = (1.0 - z * z).sqrt();
                scene.distance_along(middle, DVec3::new(flat * azimuth.cos(), flat * azimuth.sin(), z)).is_none_or(|metres| metres > 0.9)
            })
            .count()
    };
    assert_eq!(leaks(&room(false)), 0);
    assert!(leaks(&room(true)) > 20, "places in single precision would not leak: {}", leaks(&room(true)));
}

#[test]
fn cameras_and_lamps_stand_where_the_file_says() {
    let mut value = square();
    for (node, by) in [(0, [0.0; 3]), (1, [0.1, 0.2, 0.3]), (2, [0.4, 0.5, 0.6]), (4, [0.7, 0.8, 0.9])] {
        value["nodes"][node]["translation"] = site(by);
    }
    let scene = load(&value, None);
    let near = |found: DVec3, by: [f64; 3]| assert!(found.distance(DVec3::from(SITE) + DVec3::from(by)) < 1e-6, "{found}");
    near(scene.cameras[0].eye, [0.1, 0.2, 0.3]);
    let LightKind::Point { position, .. } = scene.lights[0].kind else { panic!() };
    near(position, [0.4, 0.5, 0.6]);
    let LightKind::Spot { position, .. } = scene.lights[2].kind else { panic!() };
    near(position, [0.7, 0.8, 0.9]);
    assert_eq!(warnings(&scene), "");
}

#[test]
fn poses_and_skins_stand_where_the_file_says() {
    // The animation moves the square below a node that is far away, and turns it.
    let mut value = animated();
    value["nodes"].as_array_mut().unwrap().push(json!({"translation": SITE, "children": [0]}));
    value["scenes"][0]["nodes"] = json!([6]);
    let scene = load(&value, Some(3.0));
    let corner = scene.meshes[0].positions[0];
    assert!(corner.distance(DVec3::from(SITE) + DVec3::new(10.0, 10.0, 0.0)) < 1e-6, "{corner}");
    assert!(!warnings(&scene).contains("glTF's buffers"), "{}", warnings(&scene));
    // What has no keys of its own stays as it is at rest.
    let mut value = animated();
    value["nodes"][5]["translation"] = json!(SITE);
    assert!(load(&value, Some(3.0)).meshes[1].positions[0].distance(DVec3::from(SITE)) < 1e-6);

    let (mut value, mut buffer) = (square(), square_buffer());
    let joints = add(&mut value, &mut buffer, &[0; 16], 5121, 4, "VEC4");
    let weights = add(&mut value, &mut buffer, &floats(&[1.0, 0.0, 0.0, 0.0].repeat(4)), 5126, 4, "VEC4");
    set_buffer(&mut value, &buffer);
    value["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(joints);
    value["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    value["skins"] = json!([{"joints": [5]}]);
    value["nodes"][0]["skin"] = json!(0);
    value["nodes"].as_array_mut().unwrap().push(json!({"name": "hip", "translation": SITE}));
    value["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(5));
    let scene = load(&value, None);
    assert!(scene.meshes[0].positions[2].distance(DVec3::from(SITE) + CORNERS[2]) < 1e-6);
    assert!(!warnings(&scene).contains("glTF's buffers"), "{}", warnings(&scene));
    // Matrices in a buffer are in single precision.
    let mut bind = [1.0f32, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    (bind[12], bind[14]) = (-SITE[0] as f32, -SITE[2] as f32);
    let matrices = add(&mut value, &mut buffer, &floats(&bind), 5126, 1, "MAT4");
    set_buffer(&mut value, &buffer);
    value["skins"][0]["inverseBindMatrices"] = json!(matrices);
    let said = load(&value, None).warnings.join("\n");
    assert!(said.contains("single precision (skin 0)") && said.contains("0.25 m"), "{said}");
}

/// Numbers of buffers are in single precision whatever is done: half a metre apart at that distance.
#[test]
fn what_single_precision_has_moved_is_said() {
    let far = |by: f32| (SITE[2] as f32 + by).to_le_bytes();
    let mut bytes = square_buffer();
    for vertex in 0..4 {
        bytes[12 * vertex + 8..12 * vertex + 12].copy_from_slice(&far(0.5 * vertex as f32));
    }
    let mut value = square();
    set_buffer(&mut value, &bytes);
    let said = load(&value, None).warnings.join("\n");
    assert!(said.contains("up to 0.50 m") && said.contains("mesh 'wall'") && said.contains("translation of a node"), "{said}");
    // Few binary digits, as people type, were not rounded.
    let mut bytes = square_buffer();
    bytes[8..12].copy_from_slice(&5000f32.to_le_bytes());
    set_buffer(&mut value, &bytes);
    assert_eq!(load(&value, None).warnings, Vec::<String>::new());

    for (mut value, at, list, what) in
        [(instanced(), None, "TRANSLATION", "instances of node 'wall'"), (animated(), Some(3.0), "output", "the animation of node 'wall'")]
    {
        let accessor = match list {
            "output" => value["animations"][0]["samplers"][0][list].as_u64(),
            _ => value["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"][list].as_u64(),
        };
        assert!(!load(&value, at).warnings.join("\n").contains("single precision"));
        let buffer = value["buffers"][0]["uri"].as_str().unwrap().split_once(',').unwrap().1.to_owned();
        let mut buffer = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, buffer).unwrap();
        let view = value["accessors"][accessor.unwrap() as usize]["bufferView"].as_u64().unwrap() as usize;
        let start = value["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
        buffer[start..start + 4].copy_from_slice(&far(0.5));
        set_buffer(&mut value, &buffer);
        let said = load(&value, at).warnings.join("\n");
        assert!(said.contains("single precision") && said.contains(what), "{said}");
    }
}

/// Kernels have single precision: of a scene of 100 km, and of what looks at it from afar, digits are lost.
#[test]
fn what_is_too_wide_for_single_precision_is_said() {
    let scene = load(&with_nodes(2, vec![json!({"mesh": 0}), json!({"name": "far", "mesh": 0, "translation": [123_456.7, 0, 0.1]})]), None);
    let said = warnings(&scene);
    assert!(said.contains("m wide, and single precision moves places in it by up to") && said.contains("far"), "{said}");

    let scene = load(&square(), None);
    let geometry = Geometry::new(&scene).unwrap();
    let said = geometry.place_warning("the camera", [DVec3::new(100_000.123, 3.3, 0.1)]).unwrap();
    assert!(said.starts_with("the camera: off by up to") && said.contains("mm"), "{said}");
    assert_eq!(geometry.place_warning("the camera", [DVec3::new(300.3, 0.1, 7.7)]), None);
    let mut scene = scene;
    scene
        .lights
        .push(Light { name: "light 'star'".into(), kind: LightKind::Point { position: DVec3::splat(1e6 / 3.0), intensity: Vec3::ONE } });
    let said = warnings(&scene);
    assert!(said.contains("light 'star': off by up to"), "{said}");
}

/// Planar maps of metres in a grid: the place in the picture is that after whole turns.
#[test]
fn far_texture_coordinates_keep_their_place_in_the_picture() {
    let far = [2_093_567.0f32, -4_649_776.5];
    let with = |by: [f32; 2], extra: Value| {
        let mut bytes = square_buffer();
        for vertex in 0..4 {
            for (axis, by) in by.iter().enumerate() {
                let place = 96 + 8 * vertex + 4 * axis;
                let near = f32::from_le_bytes(bytes[place..place + 4].try_into().unwrap());
                bytes[place..place + 4].copy_from_slice(&(near + by).to_le_bytes());
            }
        }
        let mut value = square();
        set_buffer(&mut value, &bytes);
        let png = crate::common::gltf_file::encoded(&image::RgbImage::new(2, 2), image::ImageFormat::Png);
        value["images"] = json!([{"uri": crate::common::gltf_file::data_uri("image/png", &png)}]);
        value["textures"] = json!([{"source": 0}]);
        value["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
        value["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({"index": 0, "extensions": extra});
        value["materials"][0]["normalTexture"] = json!({"index": 0, "extensions": extra});
        load(&value, None)
    };
    let geometry = |scene: &Scene| Geometry::new(scene).unwrap();
    let (found, near) = (with(far, json!({})), with([1.0, 0.5], json!({})));
    assert_eq!(found.warnings, Vec::<String>::new());
    let fraction = |uv: Vec2| uv - uv.floor();
    let (far_uvs, near_uvs) = (geometry(&found), geometry(&near));
    for (far, near) in far_uvs.uvs.iter().zip(&near_uvs.uvs) {
        assert!(far.base_a.abs().max_element() < 4.0, "{}", far.base_a);
        assert_eq!([far.base_a, far.base_b, far.base_c].map(fraction), [near.base_a, near.base_b, near.base_c].map(fraction));
        assert_eq!(far.base_b - far.base_a, near.base_b - near.base_a);
    }
    for (far, near) in far_uvs.triangle_layers.iter().zip(&near_uvs.triangle_layers) {
        assert!(far.first_a.abs().max_element() < 4.0, "{}", far.first_a);
        assert_eq!(far.first_b - far.first_a, near.first_b - near.first_a);
        assert_eq!(far.tangent_a, near.tangent_a);
    }
}

/// What no texture uses may be anything; what one uses must be numbers.
#[test]
fn only_texture_coordinates_that_are_used_are_checked() {
    let mut bytes = square_buffer();
    bytes[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    let mut value = square();
    set_buffer(&mut value, &bytes);
    let said = load(&value, None).warnings.join("\n");
    assert!(said.contains("texture coordinates that no texture uses and that cannot be read: mesh 'wall'"), "{said}");
}
