//! Memory stays within what the plan says beforehand, and is that to the byte.

use crate::common::prelude::*;
use crate::common::rendered;
use photonmill::engine::scene::Viewpoint;
use photonmill::plan::buffers::{PlannedBuffer, bytes_of};

/// Device memory against what a plan lists.
fn check(what: &str, taken: u64, stated: u64, buffers: &[PlannedBuffer]) -> Check {
    if taken == stated { Ok(()) } else { Err(format!("{what}: {taken} bytes taken, {stated} stated: {buffers:?}")) }
}

/// Bytes that buffers took at most while `body` ran.
fn taken<T>(gpu: &Gpu, body: impl FnOnce() -> T) -> (u64, T) {
    gpu.forget_peaks();
    assert_eq!(gpu.held_memory().device_bytes, 0, "something is held between runs");
    let result = body();
    (gpu.held_memory().peak_device_bytes, result)
}

fn small() -> RoomSettings {
    RoomSettings { photons: 999, mesh: 5, bounces: 4, ..RoomSettings::default() }
}

#[test]
fn the_papers_line_takes_what_its_plan_says() {
    let Some(gpu) = device() else { return };
    let mut cases = vec![
        RoomSettings { gather: Gather::Brute, ..small() },
        RoomSettings { gather: Gather::KdTree, ..small() },
        RoomSettings { gather: Gather::KdTree, nearest: Some(7), rng: Rng::Philox, ..small() },
        RoomSettings { rounds: 3, chunk: Some(100), ..small() },
        RoomSettings { rounds: 2, sums: Sums::F32, rng: Rng::Philox, ..small() },
        RoomSettings { radius: 0.004, ..small() },
        RoomSettings { photons: 999, mesh: 5, rounds: 2, ..RoomSettings::preset(Preset::Rounds) },
        RoomSettings { counters: Some(4), ..small() },
        // Weights at the eye, which only the builder that keeps order holds apart from their photons.
        RoomSettings { builder: Builder::Scan, shininess: [Some(2.0); 5], ..small() },
    ];
    cases.extend(Builder::ON_GPU.map(|builder| RoomSettings { builder, ..small() }));
    for settings in cases {
        let (bytes, result) = taken(&gpu, || run(&gpu, &settings));
        let buffers = result.plan.buffers();
        assert_holds(format!("{settings:?}"), check("the paper's room", bytes, result.plan.bytes(), &buffers));
        // A plan that forgot any one of its buffers would be found out by what the engine takes.
        for forgotten in 0..buffers.len() {
            let mut others = buffers.clone();
            let PlannedBuffer { name, .. } = others.remove(forgotten);
            assert_complains(name, check("the paper's room", bytes, bytes_of(&others), &others));
        }
    }
}

#[test]
fn scenes_take_what_their_plan_says() {
    let Some(gpu) = device() else { return };
    let small = SceneSettings { photons: 777, caustic_photons: 555, bounces: 5, rounds: 2, chunk: Some(500), ..by_rounds() };
    let gathers = SceneSettings { final_gather: true, ..small.clone() };
    let all_from_photons = SceneSettings { illumination: Illumination::Photons, ..small.clone() };
    let picture = Sensor::Picture { width: 7, height: 5 };
    // Each kind of buffer in one of them: what the maps, lobes and lights of a scene need, and what each way to light it does.
    let mut cases = vec![("cornell-spheres", small.clone(), picture, 0), ("sky-over-plane", small, Sensor::Receivers { count: 9 }, 2)];
    if is_long_run() {
        cases.extend([("cornell-spheres", gathers, picture, 0), ("open-box-phong", all_from_photons, picture, 0)]);
    }
    for (name, settings, sensor, phases) in cases {
        let scene = scene(name);
        let (geometry, plan) = scene_plan(&gpu, &scene, &settings, sensor).unwrap();
        let stated = plan.bytes_of(phases.max(1));
        let receivers = vec![vec![Default::default(); 9]; phases];
        let camera = scene.cameras.first().filter(|_| phases == 0);
        let (bytes, _) = taken(&gpu, || rendered::run(&gpu, &Viewpoint { geometry: &geometry, camera, phases: &receivers }, plan));
        assert_holds(name, check("a scene", bytes, stated, &[]));
    }
}
