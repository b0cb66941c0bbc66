//! What a run costs in counts, which no clock disturbs: dispatches, submissions, pipelines, events and bytes of a few
//! small runs beside the numbers that they had. Whoever changes one of them on purpose writes the new one here.

use crate::common::prelude::*;
use crate::common::rendered::{Viewed, light};
use photonmill::measure::bench::room::{self, Counts};
use photonmill::records::CameraPath;

/// Counts of a run: dispatches, submissions, events of all photons, bytes on the device, and bytes that the build moves.
#[derive(Debug, PartialEq)]
struct Cost {
    dispatches: u64,
    submissions: u64,
    events: u64,
    /// These show if a record has grown: a plan has buffers of all of them.
    device_bytes: u64,
    /// Over the events, rounded.
    build_bytes_per_event: u64,
}

/// 1000 photons, 4 bounces, 2 rounds, 5 x 8 x 8 texels over the grid.
fn of_the_box(builder: Builder, counters: Option<u32>) -> Cost {
    let cost =
        |dispatches, build_bytes_per_event| Cost { dispatches, submissions: 4, events: 3530, device_bytes: 597_980, build_bytes_per_event };
    match builder {
        // A round: two lights, four bounces, five of the index, the gather, the film.
        Builder::Naive => cost(2 * 13, 254),
        // And one after each bounce, which counts it, and one before the index, whose size only the device knows.
        // And one more a bounce that marks gaps.
        Builder::Atomic if counters.is_some() => Cost { device_bytes: 604_764, ..cost(2 * 22, 131) },
        Builder::Atomic | Builder::Ballot | Builder::Group => cost(2 * 18, 131),
        // In place, a prefix sum of one level, moved together, counted: four a bounce.
        Builder::Scan => Cost { device_bytes: 598_024, ..cost(2 * 26, 212) },
        // The lights', and no path is stored.
        Builder::Persistent => Cost { device_bytes: 502_076, ..cost(2 * 10, 12) },
        Builder::Cpu => panic!("it is none of the device's"),
    }
}

#[test]
fn the_box_costs_what_it_did() {
    let Some(gpu) = device() else { return };
    for (builder, counters) in Builder::ON_GPU.map(|builder| (builder, None)).into_iter().chain([(Builder::Atomic, Some(4))]) {
        // Strict, so that every device traces the same photons to the bit.
        let strict = RoomSettings { mesh: 8, rng: Rng::Philox, math: Math::Strict, ..RoomSettings::default() };
        let settings = RoomSettings { builder, counters, photons: 1000, bounces: 4, rounds: 2, ..strict };
        let result = run(&gpu, &settings);
        let counts = Counts::of(&result.fates[0], settings.rounds);
        let work = |pass| room::work(pass, &result.plan, &counts, 0.0).unwrap();
        let build = work("build");
        // The roofline's own counts are those of the run.
        let dispatches: f64 = ["build", "index", "gather", "film"].map(|pass| work(pass).dispatches).iter().sum();
        assert_eq!(dispatches * f64::from(settings.rounds), result.dispatches as f64, "{}", builder.name());
        let found = Cost {
            dispatches: result.dispatches,
            submissions: result.submissions,
            events: (counts.events * f64::from(settings.rounds)).round() as u64,
            device_bytes: result.plan.bytes(),
            build_bytes_per_event: (build.cost.bytes / build.items).round() as u64,
        };
        assert_eq!(found, of_the_box(builder, counters), "{}", builder.name());
    }
}

fn small_scene(gpu: &Gpu) -> (Viewed, ScenePlan) {
    let spheres = Viewed::new(scene("cornell-spheres"));
    let settings =
        SceneSettings { photons: 1000, caustic_photons: 500, bounces: 5, rounds: 2, math: Math::Strict, paranoid: true, ..by_rounds() };
    let plan = spheres.planned(gpu, &settings, Sensor::Picture { width: 16, height: 12 });
    (spheres, plan)
}

/// Bytes of a plan without its camera paths, of which there are more where one dispatch may leave some under way.
fn bytes_without_paths(plan: &ScenePlan) -> u64 {
    plan.bytes - 2 * plan.camera_path_capacity().max(1) * size_of::<CameraPath>() as u64
}

/// In the short run it is planned alone.
#[test]
fn a_scene_costs_what_it_did() {
    // No other test has made pipelines on it.
    let Some(gpu) = (if is_long_run() { device_with(Options { by_plan: true, ..Options::default() }) } else { device() }) else { return };
    let (spheres, plan) = small_scene(&gpu);
    assert_eq!(bytes_without_paths(&plan), 4_532_412);
    if is_long_run() {
        let result = light(&gpu, &spheres.viewpoint(), plan);
        let events = [0, 1].map(|map: usize| Counts::of(&result.fates[map], 1).events as u64);
        // Where one dispatch may leave camera paths under way, the host looks how many, each round.
        let submissions = if result.plan.chains_go_on() { 7 } else { 4 };
        assert_eq!((result.dispatches, result.submissions, result.pipelines, events), (88, submissions, 14, [3483, 2439]));
    }
}
