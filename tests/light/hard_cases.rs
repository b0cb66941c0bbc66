//! Hard cases of geometry: whatever is done to a scene that should not change its light does not, and no light is lost
//! or leaks. `tests/materials/hard_materials.rs`, `tests/engine/random_numbers.rs` and `tests/light/extremes.rs` do the same for materials,
//! random numbers, and for sums, estimates and sizes.
//!
//! The tests at the end check the guide's table of all hard cases (`tests/common/cases.rs` reads it) against the sources and README.

use crate::common::cases::{ABSENT, COUNTS, Case, cases};
use crate::common::known::{self, kept, mean_irradiance, none_returns};
use crate::common::prelude::*;
use crate::common::sources::{read, texts};
use photonmill::engine::scene::RunResult;

/// Short runs of the Cornell box.
pub fn settings() -> SceneSettings {
    kept(SceneSettings { photons: 4000, caustic_photons: 4000, rounds: 2, shadow_rays: 8, ..by_rounds() })
}

/// Of the Cornell box: (position, normal).
pub const POINTS: [(DVec3, DVec3); 3] =
    [(DVec3::new(0.85, 0.0, 0.9), DVec3::Y), (DVec3::new(0.0, 0.4, 0.6), DVec3::X), (DVec3::new(0.7, 0.8, 0.0), DVec3::Z)];

/// The Cornell box and its points elsewhere.
fn cornell_at(way: impl Fn(DVec3) -> DVec3) -> (Scene, Vec<(DVec3, DVec3)>) {
    (moved(scene("cornell"), &way), POINTS.iter().map(|(position, normal)| (way(*position), *normal)).collect())
}

/// A parallelogram of `n` x `n` x 2 triangles in place of one of two.
fn cut(mesh: &Mesh, n: u32) -> Mesh {
    let [o, a, _, b] = mesh.positions[..] else { panic!("{} is no parallelogram", mesh.name) };
    Mesh { material: mesh.material, ..tessellated(&mesh.name, o, a - o, b - o, n) }
}

/// Edges, corners and slivers inside a wall are no edges of its light. Runs have the same seeds, so that all but a few photons take the
/// same paths.
#[test]
fn how_a_wall_is_cut_does_not_change_its_light() {
    let Some(gpu) = device() else { return };
    let of = |scene: &Scene| mean_irradiance(&gpu, scene, &SceneSettings { photons: 20_000, rounds: 8, ..settings() }, &POINTS).mean;
    let expected = of(&scene("cornell"));
    let check = |what: &str, other: fn(&Mesh) -> Mesh| -> Check {
        let mut scene = scene("cornell");
        scene.meshes.iter_mut().take(5).for_each(|mesh| *mesh = other(mesh));
        relative_check(what, of(&scene), expected, 1e-2)
    };
    let sliver = |mesh: &Mesh| {
        let mut mesh = mesh.clone();
        // A vertex a hair from the diagonal: two slivers beside two triangles.
        let middle = 0.5 * (mesh.positions[0] + mesh.positions[2]);
        mesh.positions.push(middle + 1e-5 * (mesh.positions[1] - mesh.positions[3]));
        mesh.triangles = vec![[0, 1, 4], [1, 2, 4], [0, 4, 2], [0, 2, 3]];
        mesh
    };
    let half_turned = |mesh: &Mesh| {
        let mut mesh = cut(mesh, 40);
        mesh.triangles.iter_mut().step_by(2).for_each(|triangle| triangle.swap(1, 2));
        mesh
    };
    let on_the_floor = |mesh: &Mesh| if mesh.name == "floor" { cut(mesh, 224) } else { mesh.clone() };
    assert_holds("fine", check("3200 triangles a wall", |mesh| cut(mesh, 40)));
    assert_holds("finest", check("100 352 triangles a wall", on_the_floor));
    assert_holds("slivers", check("slivers", sliver));
    assert_complains("half of the triangles turned", check("half turned", half_turned));
}

/// A disc in its wall and a lamp in its ceiling light nothing of their own plane, however close: the rounding of a
/// grazing cosine is not divided by the distance.
#[test]
fn flat_lamps_light_nothing_of_their_own_plane() {
    let Some(gpu) = device() else { return };
    let direct = SceneSettings { photons: 1, rounds: 40, bounces: 1, shadow_rays: 32, ..settings() };
    let photons = SceneSettings { illumination: Illumination::Photons, bounces: 1, ..settings() };
    let grid = |middle: DVec3, normal: DVec3, width: f64| {
        let (u, v) = normal.any_orthonormal_pair();
        let place = move |k: i32| width * (f64::from(k) / 15.0 - 0.5);
        (0..256).map(|k| (middle + u * place(k % 16) + v * place(k / 16), normal)).collect::<Vec<_>>()
    };
    for law in [EmissionLaw::Uniform, EmissionLaw::Cosine] {
        let mut room = closed_room(0.0);
        room.lights = vec![lamp(disc(DVec3::new(0.5, 0.0, 0.5), DVec3::Y, 0.1, law))];
        for settings in [&direct, &photons] {
            let own = received(&gpu, &room, settings, &grid(DVec3::new(0.5, 0.0, 0.5), DVec3::Y, 0.4));
            assert_eq!(mean_red(&own), 0.0, "{law:?}, {:?}", settings.illumination);
        }
        let opposite = received(&gpu, &room, &direct, &grid(DVec3::new(0.5, 1.0, 0.5), DVec3::NEG_Y, 0.4));
        assert!(mean_red(&opposite) > 0.1, "{law:?}");
    }
    // The lamp is a part of the ceiling, turned so that no coordinate is a round number.
    let turn = DQuat::from_axis_angle(DVec3::new(0.2, 0.7, -0.4).normalize(), 0.8);
    let mut room = closed_room(0.0);
    room.materials.push(emissive(0.0));
    room.meshes.push(Mesh::parallelogram("lamp", DVec3::new(0.3, 1.0, 0.3), DVec3::X * 0.4, DVec3::Z * 0.4, 1));
    let room = moved(room, |at| turn * at);
    let own = grid(turn * DVec3::new(0.5, 1.0, 0.5), turn * DVec3::NEG_Y, 0.8);
    assert_eq!(mean_red(&received(&gpu, &room, &direct, &own)), 0.0);
    let opposite = grid(turn * DVec3::new(0.5, 0.0, 0.5), turn * DVec3::Y, 0.4);
    assert!(mean_red(&received(&gpu, &room, &direct, &opposite)) > 0.1);
}

/// A closed cube of 1 m, seen from inside, without light of its own.
fn closed_room(albedo: f32) -> Scene {
    let mut room = scene("furnace");
    room.materials[0] = matt(albedo);
    room
}

fn none_escapes(what: &str, result: &RunResult) -> Check {
    let traced: u64 = result.fates[0].bounces.iter().map(|bounce| bounce.stored + bounce.absorbed + bounce.escaped).sum();
    let escaped: u64 = result.fates.iter().map(|fates| fates.ledger().escaped).sum();
    require(escaped == 0, || format!("{what}: {escaped} of {} photons and {traced} flights left a closed room", result.fates[0].emitted))
}

/// Floating-point operations of a module that a driver may fuse or reorder, in functions other than `free`: results
/// of arithmetic without the decoration `NoContraction`.
fn contractible(spirv: &[u8], free: &str) -> usize {
    let words: Vec<u32> = spirv.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
    let mut instructions = Vec::new();
    let mut at = 5;
    while at < words.len() {
        let length = (words[at] >> 16) as usize;
        instructions.push((words[at] & 0xffff, &words[at + 1..at + length]));
        at += length;
    }
    let name =
        |of: &[u32]| of[1..].iter().flat_map(|word| word.to_le_bytes()).take_while(|byte| *byte != 0).map(char::from).collect::<String>();
    // OpName is 5, OpDecorate 71, NoContraction 42, OpFunction 54.
    let free: Vec<u32> = instructions.iter().filter(|(op, of)| *op == 5 && name(of).starts_with(free)).map(|(_, of)| of[0]).collect();
    let exact: HashSet<u32> = instructions.iter().filter(|(op, of)| *op == 71 && of[1] == 42).map(|(_, of)| of[0]).collect();
    let mut function = 0;
    let mut count = 0;
    for (op, of) in &instructions {
        if *op == 54 {
            function = of[1];
        }
        // Sums, differences, products and quotients; products of vectors and matrices.
        let is_arithmetic = matches!(op, 129 | 131 | 133 | 136 | 142..=148);
        count += usize::from(is_arithmetic && !free.contains(&function) && !exact.contains(&of[1]));
    }
    count
}

/// Where a driver fused a product and a sum, an edge would have another sign in each of the triangles that share it.
/// Only boxes of the hierarchy, which are widened, may be tested as fast as can be.
#[test]
fn every_operation_is_rounded_by_itself() {
    let Some(gpu) = device() else { return };
    let limits = engine::limits(gpu.facts());
    let mut modules = Vec::new();
    for illumination in BOTH {
        for sensor in [Sensor::Picture { width: 1, height: 1 }, Sensor::Receivers { count: 1 }] {
            let settings = SceneSettings { illumination, ..settings() };
            let (_, plan) = scene_plan(&gpu, &scene("cornell"), &settings, sensor).unwrap();
            modules.extend(engine::scene::modules(&plan, gpu.facts()));
        }
    }
    for builder in Builder::ON_GPU {
        let settings = RoomSettings { builder, ..RoomSettings::default() };
        let plan = RoomPlan::new(&open_box(&settings), &settings, &limits).unwrap();
        modules.extend(engine::room::trace::modules(&plan));
        modules.extend(engine::room::estimate::modules(&plan, gpu.facts()));
    }
    assert!(modules.len() > 20);
    for module in &modules {
        assert_eq!(contractible(module.spirv, "intersect_children("), 0, "{}", module.name);
    }
    // The exception is seen where it is none.
    assert!(modules.iter().any(|module| contractible(module.spirv, "no such function") > 0));
}

/// Rays that are aimed at places of a closed room, half of them exactly: by a cone below the spacing of f32's directions.
/// A wider cone around it has as much power.
fn aimed_at(places: &[DVec3], from: DVec3) -> Vec<Light> {
    let spots = |place: &DVec3| {
        let direction = (*place - from).normalize();
        [1e-9f32, 3.5e-4].map(|angle| {
            let intensity = Vec3::splat(angle.powi(-2));
            lamp(LightKind::Spot { position: from, direction, intensity, inner_angle: angle, outer_angle: angle })
        })
    };
    places.iter().flat_map(spots).collect()
}

/// Points of a cube's edges and corners.
fn edges_and_corners() -> Vec<DVec3> {
    let mut places: Vec<DVec3> = (0..8).map(|corner| DVec3::from_array([0, 1, 2].map(|axis| f64::from(corner >> axis & 1)))).collect();
    for edge in 0..12 {
        let (axis, side) = (edge / 4, edge % 4);
        for step in 0..24 {
            let mut place = DVec3::ZERO;
            place[axis] = (f64::from(step) + 0.3) / 24.0;
            place[(axis + 1) % 3] = (side & 1) as f64;
            place[(axis + 2) % 3] = (side >> 1) as f64;
            places.push(place);
        }
    }
    places
}

/// Photons whose first flight ends on the edges that triangles share, on edges between walls and in corners: each
/// meets something.
#[test]
fn rays_at_edges_and_corners_meet_a_wall() {
    let Some(gpu) = device() else { return };
    let from = DVec3::new(0.37, 0.52, 0.61);
    // Of walls of 40 x 40 cells, vertices on the diagonal or all over the wall.
    let vertex = |axis: usize, side: u32, i: u32| {
        let mut place = DVec3::splat(f64::from(side));
        place[(axis + 1) % 3] = f64::from(i) / 40.0;
        place[(axis + 2) % 3] = f64::from(if side == 0 { i } else { 7 * i % 40 }) / 40.0;
        place
    };
    let mut places = edges_and_corners();
    places.extend((0..3).flat_map(|axis| (0..80).map(move |k| vertex(axis, k / 40, k % 40))));
    let meet = |cells: u32, way: fn(&mut DVec3)| {
        let mut room = closed_room(0.9);
        room.meshes.iter_mut().for_each(|mesh| *mesh = cut(mesh, cells));
        room.meshes[0].positions.iter_mut().for_each(way);
        room.lights = aimed_at(&places, from);
        none_escapes("edges and corners", &received(&gpu, &room, &kept(flights(200_000, 1)), &[(DVec3::new(0.5, 0.0, 0.5), DVec3::Y)]))
    };
    assert_holds("in one piece", meet(1, |_| {}));
    assert_holds("40 x 40 cells", meet(40, |_| {}));
    // A wall that ends 2^-12 before its neighbour lets photons out.
    assert_complains("a gap of a 4096th", meet(1, |position| position.z = position.z.max(1.0 / 4096.0)));
}

/// Photons that start on walls, some within a rounding of an edge, and photons that were sent into edges and
/// corners: none finds a way out, however often it is scattered.
#[test]
fn photons_on_edges_and_in_corners_stay_in_the_room() {
    let photons = of_run(200_000, 4_000_000);
    let Some(gpu) = device() else { return };
    let point = [(DVec3::new(0.5, 0.0, 0.5), DVec3::Y)];
    let furnace = received(&gpu, &scene("furnace"), &kept(flights(photons, 1)), &point);
    let mut room = closed_room(0.9);
    room.lights = aimed_at(&edges_and_corners(), DVec3::new(0.37, 0.52, 0.61));
    let aimed = received(&gpu, &room, &kept(flights(photons / 4, 8)), &point);
    assert_holds("a furnace", none_escapes("from anywhere on the walls", &furnace));
    assert_holds("a closed room", none_escapes("from edges and corners", &aimed));
}

#[test]
fn photons_leave_a_surface_once_and_for_all() {
    let Some(gpu) = device() else { return };
    let tilts = [DQuat::IDENTITY, DQuat::from_axis_angle(DVec3::new(0.3, 0.5, -0.8).normalize(), 1.1), DQuat::from_rotation_z(1e-4)];
    let places = [(1.0, DVec3::ZERO), (1e-3, DVec3::new(0.1, -0.2, 0.3)), (1e4, DVec3::ZERO), (1.0, DVec3::new(1e4, -2e4, 5e3))];
    for (number, tilt) in tilts.into_iter().enumerate() {
        for (k, (size, place)) in places.into_iter().enumerate() {
            let cells = [1, 40][(number + k) % 2];
            let mut plane = scene("sun-over-plane");
            plane.materials[0].base_colour = Vec3::ONE;
            plane.meshes[0] = cut(&plane.meshes[0], cells);
            plane.meshes[0].positions.iter_mut().for_each(|position| *position = tilt * *position * size + place);
            plane.lights = vec![lamp(sun(tilt * DVec3::new(0.3, -1.0, 0.2)))];
            let settings = SceneSettings { radius: None, ..kept(flights(40_000, 2)) };
            let result = received(&gpu, &plane, &settings, &[(place, tilt * DVec3::Y)]);
            let what = format!("tilt {number}, {cells} x {cells} cells, size {size} at {place}");
            assert_holds(&what, none_returns(&what, &result));
        }
    }
    for segments in [8, 64] {
        let mesh = Mesh { normals: Vec::new(), ..Mesh::sphere("ball", DVec3::new(0.2, 0.7, -0.4), 0.9, segments, 0) };
        let mut ball = scene_of(vec![mesh], vec![matt(1.0)], vec![sun(DVec3::new(0.3, -1.0, 0.2))]);
        let result = received(&gpu, &ball, &kept(flights(40_000, 2)), &[(DVec3::new(0.2, 1.6, -0.4), DVec3::Y)]);
        assert_holds(segments, none_returns(&format!("ball of {segments} segments"), &result));
        // A bowl sees itself.
        ball.meshes[0].triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        ball.lights = vec![lamp(point(DVec3::new(0.2, 0.7, -0.4)))];
        let result = received(&gpu, &ball, &kept(flights(40_000, 2)), &[(DVec3::new(0.2, -0.2, -0.4), DVec3::Y)]);
        assert_complains("the inside of a ball", none_returns("bowl", &result));
    }
}

/// Two rooms side by side, the left one lit. `walls` are what stands between.
fn lit_and_dark_room(walls: Vec<Mesh>) -> Scene {
    let mut rooms = closed_room(0.7);
    rooms.materials.push(Material { two_sided: true, ..matt(0.7) });
    rooms.lights = vec![lamp(point(DVec3::new(0.2, 0.6, 0.4)))];
    rooms.meshes.extend(walls);
    rooms
}

/// A wall of 2^-12 of the room's width, and a sheet of no thickness at all: one side as bright as can be, the other
/// black, to the last bit.
#[test]
fn thin_walls_and_sheets_let_no_light_through() {
    let Some(gpu) = device() else { return };
    let half = DVec3::X * 0.5;
    let thin = DVec3::X * (0.5 + 1.0 / 4096.0);
    let (y, z) = (DVec3::Y, DVec3::Z);
    let [lit_side, dark_side] = [(half, z, y), (thin, y, z)].map(|(origin, u, v)| Mesh::parallelogram("wall", origin, u, v, 0));
    let sheet = lit_and_dark_room(vec![Mesh { material: 1, ..lit_side.clone() }]);
    let two_walls = lit_and_dark_room(vec![lit_side, dark_side]);
    let no_wall = lit_and_dark_room(vec![]);
    let points = [(half, DVec3::NEG_X), (thin, DVec3::X), (DVec3::new(0.99, 0.0, 0.4), y), (DVec3::X, DVec3::NEG_X)]
        .map(|(at, normal)| (at + DVec3::new(0.0, 0.5, 0.5) * (y + z - normal.abs()), normal));
    let check = |what: &str, result: &RunResult| -> Check {
        let means = means(result);
        assert!(means[0].x > 0.1, "{what}: the lit side has {}", means[0]);
        match means[1..].iter().find(|mean| **mean != DVec3::ZERO) {
            None => Ok(()),
            Some(mean) => Err(format!("{what}: {mean} W/m2 in the dark room")),
        }
    };
    for illumination in BOTH {
        let settings = SceneSettings { illumination, photons: 20_000, rounds: 4, radius: Some(0.3), alpha: 1.0, ..kept(by_rounds()) };
        for (what, rooms) in [("a 4096th", &two_walls), ("a sheet", &sheet)] {
            let place = |at: DVec3| if rooms.meshes.len() == 7 && at.x == thin.x { at.with_x(0.5) } else { at };
            let points = points.map(|(at, normal)| (place(at), normal));
            let what = format!("{what}, {illumination:?}");
            assert_holds(&what, check(&what, &received(&gpu, rooms, &settings, &points)));
        }
        assert_complains("no wall", check("no wall", &received(&gpu, &no_wall, &settings, &points)));
    }
}

fn same_sums(what: &str, found: &RunResult, expected: &RunResult) -> Check {
    if found.film == expected.film && found.fates == expected.fates { Ok(()) } else { Err(format!("{what}: other light or other fates")) }
}

/// From a millionth to a million times its size no decision and no bit of the light of the Cornell box with every kind of light changes.
/// Lengths go with the size, intensities with its square.
#[test]
fn every_power_of_two_is_the_same_light_to_the_bit() {
    let step = of_run(5, 1);
    let Some(gpu) = device() else { return };
    let of = |k: i32, settings: &SceneSettings| {
        let factor = 2f64.powi(k);
        let (mut scene, points) = cornell_at(|at| at * factor);
        scene.lights = every_kind_of_light(factor, 0.7, EmissionLaw::Uniform);
        let radius = settings.radius.map(|radius| radius * factor);
        received(&gpu, &scene, &SceneSettings { radius, ..settings.clone() }, &points)
    };
    let settings = SceneSettings { photons: 1500, caustic_photons: 1500, shadow_rays: 4, radius: Some(0.1), ..settings() };
    let expected = of(0, &settings);
    assert!(mean_red(&expected) > 0.5);
    for k in (-20..=20).step_by(step) {
        assert_holds(k, same_sums(&format!("scaled by 2^{k}"), &of(k, &settings), &expected));
    }
    let wider = of(0, &SceneSettings { radius: Some(0.1 * (1.0 + 1e-6)), ..settings });
    assert_complains("a radius a millionth larger", same_sums("radius", &wider, &expected));
}

/// The paper's box at every such size: the photons of both builders go with it.
#[test]
fn the_open_box_of_any_power_of_two_stores_the_same_photons() {
    let step = of_run(5, 1);
    let gpu = device();
    for builder in [Builder::Cpu, Builder::Naive, Builder::Ballot] {
        let settings = RoomSettings { builder, photons: 1001, shininess: [Some(2.0); 5], ..RoomSettings::default() };
        let of = |k: i32| {
            let factor = 2f64.powi(k);
            let mut scene = open_box(&settings);
            scene.min_corner *= factor;
            scene.max_corner *= factor;
            scene.lights.iter_mut().for_each(|light| light.radius *= factor);
            let settings = RoomSettings { eye: settings.eye.map(|place| place * factor as f32), ..settings.clone() };
            let photons = match (builder, &gpu) {
                (Builder::Cpu, _) => engine::room::photons_on_cpu(&scene, &settings),
                (_, Some(gpu)) => engine::room::photons_on_gpu(gpu, &scene, &settings),
                (_, None) => return Vec::new(),
            };
            let mut photons = in_order(photons.unwrap());
            photons.iter_mut().for_each(|photon| photon.position /= factor as f32);
            photons
        };
        let expected = of(0);
        assert!(gpu.is_none() || expected.len() > 1001);
        (-20..=20).step_by(step).for_each(|k| assert_eq!(of(k), expected, "{builder:?}, 2^{k}"));
    }
}

/// A scene whose coordinates are whole multiples of 2^-20 m, moved by ten thousand times its size: every number of
/// it is still exact, and so is the light.
#[test]
fn ten_thousand_sizes_away_the_light_is_the_same_to_the_bit() {
    let Some(gpu) = device() else { return };
    let settings = SceneSettings { photons: 1500, caustic_photons: 1500, ..settings() };
    let of = |way: DVec3| {
        let (scene, points) = cornell_at(|at| (at * 1_048_576.0).round() / 1_048_576.0 + way);
        received(&gpu, &scene, &settings, &points)
    };
    let expected = of(DVec3::ZERO);
    for way in [DVec3::new(1e4, -2e4, 5e3), DVec3::new(-1e4, 0.0, 1e4), DVec3::splat(1_048_576.0)] {
        assert_holds(way, same_sums("moved", &of(way), &expected));
    }
    let other = received(&gpu, &scene("cornell"), &SceneSettings { seed: 2, ..settings.clone() }, &POINTS);
    assert_complains("a light in another place", same_sums("moved", &other, &expected));
}

/// Along an axis, from and within the planes of walls, where a box of a hierarchy is flat and a slope infinite:
/// a tree finds what the list of all triangles finds.
#[test]
fn axis_parallel_rays_meet_the_same_by_tree_and_list() {
    let Some(gpu) = device() else { return };
    let mut room = scene("cornell");
    room.materials.iter_mut().for_each(|material| material.emission = Vec3::ZERO);
    room.lights = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]).map(|way| lamp(sun(way))).collect();
    let flush = [(DVec3::new(0.5, 0.0, 0.5), DVec3::Y), (DVec3::new(0.0, 0.5, 0.5), DVec3::X)];
    room.lights.extend(flush.map(|(centre, normal)| lamp(disc(centre, normal, 0.3, EmissionLaw::Uniform))));
    let result_of = |by_tree: bool, room: &Scene| {
        // Without aim suns have the kernels of other lights.
        let mut settings = SceneSettings { illumination: Illumination::Photons, photons: 60_000, bounces: 4, aim: false, ..settings() };
        if !by_tree {
            settings.with.retain(|effect| *effect != Effect::Bvh);
            settings.without = vec![Effect::Bvh];
        }
        received(&gpu, room, &settings, &POINTS)
    };
    let (tree, list) = (result_of(true, &room), result_of(false, &room));
    assert!(tree.plan.simulates(Effect::Bvh) && !list.plan.simulates(Effect::Bvh) && mean_red(&list) > 0.0);
    assert_holds("tree", same_sums("tree", &tree, &list));
    room.meshes.remove(6);
    assert_complains("a block less", same_sums("a block less", &result_of(true, &room), &list));
}

#[test]
fn sheets_in_one_plane_are_met_alike_by_tree_and_list() {
    let Some(gpu) = device() else { return };
    assert_holds("the sheets", known::sheets_in_one_plane(&gpu));
}

/// Triangles without area, triangles given twice, and the order in which triangles are given change no bit.
#[test]
fn flat_doubled_and_reordered_triangles_change_no_bit() {
    let Some(gpu) = device() else { return };
    // A lamp that is no mesh: numbers choose it alike in whatever order triangles come.
    let mut plain = scene("cornell");
    plain.materials.iter_mut().for_each(|material| material.emission = Vec3::ZERO);
    plain.lights = vec![lamp(point(DVec3::new(0.4, 0.8, 0.6)))];
    let of = |spoil: &dyn Fn(&mut Mesh)| {
        let mut scene = plain.clone();
        scene.meshes.iter_mut().for_each(spoil);
        (Geometry::new(&scene).unwrap().left_out, received(&gpu, &scene, &settings(), &POINTS))
    };
    let meshes = plain.meshes.len();
    let (none, expected) = of(&|_| {});
    assert_eq!(none, 0);
    let (flat, found) = of(&|mesh| {
        // A point, a line, and one whose third corner is 1e-25 off its first.
        mesh.positions.push(mesh.positions[0] + DVec3::splat(1e-25));
        let last = mesh.positions.len() as u32 - 1;
        mesh.triangles.extend([[0, 0, 0], [0, 1, 1], [0, 1, last]]);
    });
    assert_eq!(flat, 3 * meshes);
    assert_holds("flat triangles", same_sums("flat triangles", &found, &expected));
    let triangles: usize = plain.triangle_count();
    let (doubled, found) = of(&|mesh| mesh.triangles.extend(mesh.triangles.clone().iter().map(|[a, b, c]| [*b, *c, *a])));
    assert_eq!(doubled, triangles);
    assert_holds("every triangle twice", same_sums("every triangle twice", &found, &expected));
    let (_, found) = of(&|mesh| mesh.triangles.reverse());
    assert_holds("the other order", same_sums("the other order", &found, &expected));
    let (_, found) = of(&|mesh| mesh.positions[0] += DVec3::splat(1e-3));
    assert_complains("a corner a millimetre off", same_sums("a corner", &found, &expected));
}

/// A surface that is given twice, once for each side and with a material each, is seen from both.
#[test]
fn two_sheets_at_one_place_show_each_its_own_side() {
    let Some(gpu) = device() else { return };
    let mut sheets = scene("sun-over-plane");
    sheets.materials = vec![matt(0.8), matt(0.4)];
    let (u, v) = (DVec3::X * 4.0, DVec3::Z * 4.0);
    // Turned, so that no coordinate is a round number.
    let tilt = DQuat::from_axis_angle(DVec3::new(0.3, 0.5, -0.8).normalize(), 1.1);
    let sheet = |name, a: DVec3, b: DVec3, material| Mesh::parallelogram(name, tilt * (-0.5 * (u + v)), tilt * a, tilt * b, material);
    let faces = [sheet("above", v, u, 0), sheet("below", u, v, 1)];
    sheets.lights = [DVec3::NEG_Y, DVec3::Y].map(|way| lamp(sun(tilt * way))).into();
    let settings = SceneSettings { part: Part::Direct, ..settings() };
    for order in [[0, 1], [1, 0]] {
        sheets.meshes = order.map(|face| faces[face].clone()).into();
        for (side, albedo) in [(1.0, 0.8), (-1.0, 0.4)] {
            let (eye, target) = (tilt * DVec3::new(0.3, side * 1.5, 0.4), tilt * DVec3::new(0.1, 0.0, 0.2));
            // Each sun is chosen by half of the rays, stratified.
            for seen in radiances(&gpu, &sheets, &settings, eye, target, 8) {
                assert_holds(format!("order {order:?}, side {side}"), relative_check("radiance", seen, albedo / PI, 1e-4));
            }
        }
    }
}

/// A black room with a lamp of 1 W/m2/sr and 2^-k m in its middle, and a point straight below it.
fn room_with_lamp(k: i32) -> (Scene, (DVec3, DVec3)) {
    let edge = 2f64.powi(-k);
    let mut room = closed_room(0.0);
    room.materials.push(emissive(0.0));
    let corner = DVec3::splat(0.5);
    let positions = vec![corner, corner + DVec3::X * edge, corner + DVec3::Z * edge];
    room.meshes.push(Mesh { name: "lamp".into(), positions, triangles: vec![[0, 1, 2]], material: 1, ..Mesh::default() });
    (room, (DVec3::new(0.5 + edge / 3.0, 0.0, 0.5 + edge / 3.0), DVec3::Y))
}

/// Lamps ever smaller are as bright as points of their power, by photons and by shadow rays.
#[test]
fn small_lamps_emit_by_their_area() {
    let Some(gpu) = device() else { return };
    for k in [3, 4, 6, 8, 12, 16, 22] {
        let (room, below) = room_with_lamp(k);
        let area = 0.5 * 4f64.powi(-k);
        // L A cos cos / d^2, and what the lamp's extent takes from it: 2 E[r^2] / d^2 of it, E[r^2] = edge^2 / 9.
        let (expected, extent) = (area / 0.25, 8.0 / 9.0 * 4f64.powi(-k));
        let direct = SceneSettings { photons: 1, rounds: 16, bounces: 1, shadow_rays: 32, ..settings() };
        let found = mean_irradiance(&gpu, &room, &direct, &[below]);
        println!("lamp of 2^-{k} m: shadow rays see {:.4} of its light", found.mean / expected);
        let error = found.standard_error.max((extent + 1e-4) * expected);
        assert_holds(format!("2^-{k}"), z_check("shadow rays", found.mean, expected, error));
        let mapped = mean_irradiance(&gpu, &room, &kept(mapped(10_000, 16, 1, 0.1)), &[below]);
        // A disc of radius h below sees A / h^2 (1 - 1 / (1 + (h / d)^2)).
        let mean = area * (1.0 - 1.0 / (1.0 + 0.04)) / 0.01;
        assert_holds(format!("2^-{k}"), z_check("photons", mapped.mean, mean, mapped.standard_error.hypot(extent * mean)));
    }
}

/// A triangle whose normal any device may take for nothing, the square of its length being below the least normal
/// number of f32, 2^-126, is left out; any other sends its photons into the room.
#[test]
fn the_smallest_lamps_emit_into_the_room_or_are_left_out() {
    let Some(gpu) = device() else { return };
    for k in [22, 26, 30, 31, 32, 33, 35, 37, 38, 40, 60, 74] {
        let (room, below) = room_with_lamp(k);
        assert_eq!(Geometry::new(&room).unwrap().left_out, usize::from(4 * k > 126), "a lamp of 2^-{k}");
        let result = received(&gpu, &room, &kept(flights(5000, 1)), &[below]);
        assert_holds(k, none_escapes(&format!("a lamp of 2^-{k}"), &result));
    }
}

/// Eyes on a surface, in a corner and in the plane of a wall see numbers.
#[test]
fn an_eye_on_a_surface_sees_numbers() {
    let Some(gpu) = device() else { return };
    let cornell = scene("cornell");
    let settings = SceneSettings { photons: 500, rounds: 1, ..settings() };
    for (eye, target) in [
        (DVec3::new(0.5, 0.0, 0.9), DVec3::new(0.5, 0.5, 0.0)),
        (DVec3::ZERO, DVec3::ONE),
        (DVec3::new(0.5, 0.0, 0.9), DVec3::new(0.5, 0.0, 0.0)),
        (DVec3::new(0.5, 0.0, 0.9), DVec3::new(0.5, -1.0, 0.9)),
    ] {
        let camera = Camera::looking_at("eye", eye, target, DVec3::Y, 1.0);
        // The device counts values that are no number, and there are none.
        let result = seen(&gpu, &cornell, &settings, &camera, [16, 16]);
        assert!(mean_red(&result).is_finite(), "{eye} to {target}");
    }
}

/// README and the pages of the guide.
pub fn readme_and_guide() -> Vec<String> {
    [vec![read("README.md")], texts("src/guide", &[".md"])].concat()
}

/// Every case of the catalogue stands in the table once; every test that it names is a test; and nothing of what a case
/// that cannot occur would need stands in the program.
fn table_check(cases: &[Case], tests: &[String], program: &[String]) -> Check {
    let all: Vec<String> = COUNTS.iter().flat_map(|(group, count)| (1..=*count).map(move |number| format!("{group}{number}"))).collect();
    if let Some(case) = all.iter().find(|number| cases.iter().filter(|case| case.number == **number).count() != 1) {
        return Err(format!("{case} does not stand in the table once"));
    }
    require(cases.len() == all.len(), || format!("{} cases instead of {}", cases.len(), all.len()))?;
    let is_test = |name: &String| {
        let head = format!("fn {name}()");
        tests.iter().any(|source| {
            let mut places = source.match_indices(&head);
            places.any(|(at, _)| source[..at].trim_end().lines().rev().take(2).any(|line| line.trim() == "#[test]"))
        })
    };
    for Case { number, tests } in cases {
        let absent = ABSENT.iter().find(|(absent, _)| absent == number);
        require(absent.is_some() == tests.is_empty(), || format!("{number}: nothing shows it, or it is said not to occur"))?;
        if let Some(name) = tests.iter().find(|name| !is_test(name)) {
            return Err(format!("{number}: {name} is no test"));
        }
        let mut words = absent.iter().flat_map(|(_, words)| *words);
        if let Some(word) = words.find(|word| program.iter().any(|text| text.to_lowercase().contains(**word))) {
            return Err(format!("{number} is said not to occur here, and a source has {word:?}: it needs a test"));
        }
    }
    Ok(())
}

#[test]
fn the_table_names_every_case_and_tests_that_exist() {
    let tests = [texts("src", &[".rs"]), texts("tests", &[".rs"])].concat();
    let program = [texts("src", &[".rs"]), texts("glsl", &[".glsl", ".comp"])].concat();
    let cases = cases();
    let check = |cases: &[Case]| table_check(cases, &tests, &program);
    assert_holds("the table", check(&cases));
    assert_complains("a case less", check(&cases[1..]));
    assert_complains("a case twice", check(&[&cases[..], &cases[..1]].concat()));
    let shown_by = |tests: &[&str]| {
        let first = Case { tests: tests.iter().map(|name| String::from(*name)).collect(), ..cases[0].clone() };
        [&[first], &cases[1..]].concat()
    };
    assert_complains("a test that is none", check(&shown_by(&["table_check"])));
    assert_complains("a test that was renamed", check(&shown_by(&["photons_leave_a_surface_for_good"])));
    assert_complains("no test", check(&shown_by(&[])));
    assert_complains("what has come to be there", table_check(&cases, &tests, &["float discriminant = b * b - c;".into()]));
}

/// Whoever says how many cases there are has the table's number, and the page with the table how many of them cannot occur.
fn counts_check(texts: &[String], cases: &[Case]) -> Check {
    let shown = cases.iter().filter(|case| !case.tests.is_empty()).count();
    let says = format!("{} known failures of renderers: {shown} with the tests that show that they do not occur here, and ", cases.len())
        + &format!("{} that cannot occur", cases.len() - shown);
    let plain = texts.join(" ").split_whitespace().collect::<Vec<_>>().join(" ");
    let words: Vec<&str> = plain.split(' ').collect();
    // Whatever stands behind them.
    let are_cases = |words: &[&str]| ["known failures", "hard cases"].iter().any(|what| words.join(" ").starts_with(what));
    let counted = words.windows(3).filter(|three| are_cases(&three[1..]));
    let wrong = counted.filter_map(|three| three[0].parse::<usize>().ok()).find(|count| *count != cases.len());
    require(wrong.is_none() && plain.contains(&says), || format!("{wrong:?} cases, or no sentence with {says:?}"))
}

#[test]
fn readme_and_guide_count_the_hard_cases() {
    let written = readme_and_guide();
    assert_holds("README and the guide", counts_check(&written, &cases()));
    assert_complains("a table of one case less", counts_check(&written, &cases()[1..]));
    assert_complains("no sentence at all", counts_check(&["Hard cases are many.".to_owned()], &cases()));
    let of_old = "It lists 97 known failures: 88 with tests, and 9 that cannot apply.".to_owned();
    assert_complains("a number of old", counts_check(&[&written[..], &[of_old]].concat(), &cases()));
}
