//! Scenes that stand far from the origin, as exports of buildings and maps do: to 0.1 mm they are what they are near it, and what is not
//! is said.

use super::gltf::{assert_said, load, load_at, load_whole, skinned_square, uvs, with_material};
use crate::common::gltf_file::{add_accessor, floats, push, set_buffer, square, square_buffer};
use crate::common::prelude::*;
use crate::common::rich_file::{animated, instanced};
use serde_json::{Value, json};

/// Metres: a place of the UTM grid, north along z.
const SITE: [f64; 3] = [500_123.37, 0.0, 4_649_776.22];

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
fn warnings(scene: &Scene) -> Vec<String> {
    [scene.warnings.clone(), Geometry::new(scene).unwrap().warnings(scene)].concat()
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
    let scene = load(&value).unwrap();
    assert_eq!(scene.meshes.len(), 5);
    let place = |mesh: usize| DVec3::from(SITE) + DVec3::Z * (mesh as f64 * 0.4);
    let off = most_off(&scene, |mesh, vertex| place(mesh) + CORNERS[vertex]);
    assert!(off < 1e-6, "{off}");
    assert_eq!(warnings(&scene), Vec::<String>::new());
}

/// Light came in between the walls.
#[test]
fn a_room_of_six_panels_is_closed() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // Walls of 1.2 x 1.2 m around a cube of one metre.
    let panel = |rotation: [f64; 4], at: DVec3, is_rounded: bool| {
        let middle = DQuat::from_array(rotation) * DVec3::new(0.6, 0.6, 0.0);
        let place = DVec3::from(SITE) + (at * 0.5 - middle);
        let place = if is_rounded { place.as_vec3().as_dvec3() } else { place };
        json!({"mesh": 0, "rotation": rotation, "scale": [1.2, 1.2, 1], "translation": place.to_array()})
    };
    let ways = [([0.0, 0.0, 0.0, 1.0], DVec3::Z), ([half, 0.0, 0.0, half], DVec3::Y), ([0.0, half, 0.0, half], DVec3::X)];
    let room = |is_rounded: bool| {
        let sides = ways.into_iter().flat_map(|(rotation, side)| [-side, side].map(|at| panel(rotation, at, is_rounded)));
        load(&with_nodes(6, sides.collect())).unwrap()
    };
    let leaks = |scene: &Scene| {
        let way = |k: f64| {
            let z = 1.0 - (k + 0.5) / 250.0;
            DQuat::from_rotation_z(2.399_963 * k) * DVec3::new((1.0 - z * z).sqrt(), 0.0, z)
        };
        let escapes = |way: &DVec3| scene.distance_along(DVec3::from(SITE), *way).is_none_or(|metres| metres > 0.9);
        (0..500).map(f64::from).map(way).filter(escapes).count()
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
    let scene = load(&value).unwrap();
    let near = |found: DVec3, by: [f64; 3]| assert!(found.distance(DVec3::from(SITE) + DVec3::from(by)) < 1e-6, "{found}");
    near(scene.cameras[0].eye, [0.1, 0.2, 0.3]);
    let LightKind::Point { position, .. } = scene.lights[0].kind else { panic!() };
    near(position, [0.4, 0.5, 0.6]);
    let LightKind::Spot { position, .. } = scene.lights[2].kind else { panic!() };
    near(position, [0.7, 0.8, 0.9]);
    assert_eq!(warnings(&scene), Vec::<String>::new());
}

#[test]
fn poses_and_skins_stand_where_the_file_says() {
    // The animation moves the square below a node that is far away, and turns it.
    let mut value = animated();
    let parent = push(&mut value["nodes"], json!({"translation": SITE, "children": [0]}));
    value["scenes"][0]["nodes"] = json!([parent]);
    let scene = load_at(&value, Some(3.0)).unwrap();
    let corner = scene.meshes[0].positions[0];
    assert!(corner.distance(DVec3::from(SITE) + DVec3::new(10.0, 10.0, 0.0)) < 1e-6, "{corner}");
    assert!(!warnings(&scene).concat().contains("glTF's buffers"), "{:?}", warnings(&scene));
    // What has no keys of its own stays as it is at rest.
    let mut value = animated();
    value["nodes"][5]["translation"] = json!(SITE);
    assert!(load_at(&value, Some(3.0)).unwrap().meshes[1].positions[0].distance(DVec3::from(SITE)) < 1e-6);

    let mut value = skinned_square();
    value["skins"] = json!([{"joints": [5, 6]}]);
    value["nodes"][5]["translation"] = json!(SITE);
    let scene = load(&value).unwrap();
    // The second joint is 2 m away from the first.
    for (vertex, joint) in [(1, DVec3::ZERO), (2, 2.0 * DVec3::Z)] {
        assert!(scene.meshes[0].positions[vertex].distance(DVec3::from(SITE) + joint + CORNERS[vertex]) < 1e-6);
    }
    assert!(!warnings(&scene).concat().contains("glTF's buffers"), "{:?}", warnings(&scene));
    // Matrices in a buffer are in single precision.
    let mut bind = [1.0f32, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    (bind[12], bind[14]) = (-SITE[0] as f32, -SITE[2] as f32);
    let matrices = add_accessor(&mut value, &floats(&bind.repeat(2)), 5126, 2, "MAT4");
    value["skins"][0]["inverseBindMatrices"] = json!(matrices);
    assert_said(&load(&value).unwrap().warnings, &["single precision (skin 0)", "0.25 m"]);
}

/// Numbers of buffers are in single precision whatever is done: half a metre apart at that distance.
#[test]
fn what_single_precision_has_moved_is_said() {
    let mut bytes = square_buffer();
    for vertex in 0..4 {
        let z = SITE[2] as f32 + 0.5 * vertex as f32;
        bytes[12 * vertex + 8..12 * vertex + 12].copy_from_slice(&z.to_le_bytes());
    }
    let mut value = square();
    set_buffer(&mut value, &bytes);
    assert_said(&load(&value).unwrap().warnings, &["up to 0.50 m", "mesh 'wall'", "translation of a node"]);
    // Few binary digits, as people type, were not rounded.
    let mut bytes = square_buffer();
    bytes[8..12].copy_from_slice(&5000f32.to_le_bytes());
    set_buffer(&mut value, &bytes);
    load_whole(&value);

    let places = floats(&[SITE[2] as f32 + 0.5, 0., 0., 5., 0., 0., 0., 7., 0.]);
    for (mut value, at, list, what) in [
        (instanced(), None, "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/TRANSLATION", "instances of node 'wall'"),
        (animated(), Some(3.0), "/animations/0/samplers/0/output", "the animation of node 'wall'"),
    ] {
        assert!(!load_at(&value, at).unwrap().warnings.concat().contains("single precision"));
        let far_places = add_accessor(&mut value, &places, 5126, 3, "VEC3");
        *value.pointer_mut(list).unwrap() = json!(far_places);
        assert_said(&load_at(&value, at).unwrap().warnings, &["single precision", what]);
    }
}

/// Kernels have single precision: of a scene of 100 km, and of what looks at it from afar, digits are lost.
#[test]
fn what_is_too_wide_for_single_precision_is_said() {
    let nodes = vec![json!({"mesh": 0}), json!({"name": "far", "mesh": 0, "translation": [123_456.7, 0, 0.1]})];
    let scene = load(&with_nodes(2, nodes)).unwrap();
    assert_said(&warnings(&scene), &["m wide, and single precision moves places in it by up to", "far"]);

    let mut scene = load(&square()).unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let said = geometry.place_warning("the camera", [DVec3::new(100_000.123, 3.3, 0.1)]).unwrap();
    assert!(said.starts_with("the camera: off by up to") && said.contains("mm"), "{said}");
    assert_eq!(geometry.place_warning("the camera", [DVec3::new(300.3, 0.1, 7.7)]), None);
    scene.lights.push(Light { name: "light 'star'".into(), kind: point(DVec3::splat(1e6 / 3.0)) });
    assert_said(&warnings(&scene), &["light 'star': off by up to"]);
}

/// Planar maps of metres in a grid: the place in the picture is that after whole turns.
#[test]
fn far_texture_coordinates_keep_their_place_in_the_picture() {
    let far = [2_093_567.0f32, -4_649_776.5];
    let with = |[u, v]: [f32; 2]| {
        let pbr = json!({"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}});
        let mut value = with_material(json!({"pbrMetallicRoughness": pbr, "normalTexture": {"index": 0}}));
        uvs(&mut value, &[u, v, u + 1.0, v, u + 1.0, v + 1.0, u, v + 1.0]);
        Geometry::new(&load_whole(&value)).unwrap()
    };
    let fraction = |uv: Vec2| uv - uv.floor();
    let (far_uvs, near_uvs) = (with(far), with([1.0, 0.5]));
    for (far, near) in pairs(&far_uvs.uvs, &near_uvs.uvs) {
        assert!(far.base_a.abs().max_element() < 4.0, "{}", far.base_a);
        assert_eq!([far.base_a, far.base_b, far.base_c].map(fraction), [near.base_a, near.base_b, near.base_c].map(fraction));
        assert_eq!(far.base_b - far.base_a, near.base_b - near.base_a);
    }
    for (far, near) in pairs(&far_uvs.triangle_layers, &near_uvs.triangle_layers) {
        assert!(far.first_a.abs().max_element() < 4.0, "{}", far.first_a);
        assert_eq!(far.first_b - far.first_a, near.first_b - near.first_a);
        assert_eq!(far.tangent_a, near.tangent_a);
    }
}

/// What no texture uses may be anything; what one uses must be numbers.
#[test]
fn only_texture_coordinates_that_are_used_are_checked() {
    let mut value = square();
    uvs(&mut value, &[f32::NAN, 0., 1., 0., 1., 1., 0., 1.]);
    let said = load(&value).unwrap().warnings;
    assert_said(&said, &["texture coordinates that no texture uses and that cannot be read: mesh 'wall'"]);
}
