//! The engine: devices and their choice, the start-up check, validation messages, timings.

use crate::common::planted;
use crate::common::prelude::*;
use photonmill::constants::LOOP_LIMIT;
use photonmill::engine::choose_builder::choose_builder;
use photonmill::engine::limits;
use photonmill::gpu::check;
use photonmill::gpu::clock::LEAST_WARM_UP;
use photonmill::timings::{Clock, Row, Timings};

/// Opening a device runs the start-up check on it, with 64-bit sums and with sums of two words.
#[test]
fn the_start_up_check_passes() {
    let Some(gpu) = device() else { return };
    assert!(gpu.facts().lacks.is_empty());
    assert!(gpu.facts().subgroup_size >= 1 && gpu.facts().storage_buffer_range_bytes >= 1 << 27);
    drop(gpu);
    let lesser = device_with(Options { without_int64_atomics: true, without_timestamps: true, ..Options::default() }).unwrap();
    assert!(!lesser.facts().int64_atomics);
    assert_eq!(lesser.facts().timestamp_bits, 0);
}

/// Where subgroup votes in a loop return wrong results, the persistent builder is refused, and nothing takes it by itself.
#[test]
fn no_run_is_persistent_where_lanes_vote_wrong() {
    let healthy = device();
    assert!(healthy.is_none_or(|gpu| gpu.facts().votes_in_loops));
    let replaced = planted::kernels(
        &["start_up_u64", "start_up_two_words"],
        "builder/place.glsl",
        &[("subgroupBallotExclusiveBitCount(survivors);", "(subgroupBallotExclusiveBitCount(survivors) & 0xfffffffeu);")],
    );
    let Some(gpu) = device_with(Options { replaced, ..Options::default() }) else { return };
    assert!(!gpu.facts().votes_in_loops);

    let settings = RoomSettings { photons: 500, ..RoomSettings::default() };
    let choice = choose_builder(&gpu, &open_box(&settings), &settings).unwrap();
    let builders: Vec<Builder> = choice.candidates.iter().map(|candidate| candidate.builder).collect();
    assert!(builders.len() == 5 && !builders.contains(&Builder::Persistent), "{builders:?}");
    let asked = RoomSettings { builder: Builder::Persistent, ..settings };
    let refused = RoomPlan::new(&open_box(&asked), &asked, &limits(gpu.facts())).unwrap_err().to_string();
    assert!(refused.starts_with("`variant` persistent: needs the lanes of a subgroup"), "{refused}");

    let scene = Scene::open("cornell", false).unwrap();
    let plan = |builder| {
        let settings = SceneSettings { builder, ..by_rounds() };
        scene_plan_within(&limits(gpu.facts()), &scene, &settings, square_picture(8))
    };
    assert_eq!(plan(None).unwrap().builder(), Builder::Ballot);
    assert_eq!(plan(Some(Builder::Persistent)).unwrap_err().to_string(), refused);
}

/// Every loop of the kernels stays within what every device counts right; beyond, a device may leave a
/// loop early and must say so here.
#[test]
fn loops_count_right_up_to_the_limit() {
    let Some(gpu) = device() else { return };
    for wanted in [0, 1, 1000, LOOP_LIMIT - 1, LOOP_LIMIT] {
        let count = check::loop_count(&gpu, wanted).unwrap();
        assert_eq!((count.wanted, count.done), (wanted, wanted));
    }
    let long = check::loop_count(&gpu, 200_000).unwrap();
    println!("{}: {} of {} iterations", gpu.facts().name, long.done, long.wanted);
    assert_eq!(long.wanted, 200_000);
    assert!(long.done >= LOOP_LIMIT && long.done <= long.wanted);
}

/// Keeping a card busy before the first round changes no result, counts in no run's memory and counts in no run's time.
#[test]
fn a_warm_up_is_no_part_of_the_run() {
    let Some(plain) = device() else { return };
    let settings = RoomSettings { photons: 999, mesh: 5, bounces: 4, ..RoomSettings::default() };
    let expected = run(&plain, &settings);
    let gpu = device_with(Options { warm_up: true, ..Options::default() }).unwrap();
    gpu.forget_peaks();
    let began = Instant::now();
    let found = run(&gpu, &settings);
    let seconds = began.elapsed().as_secs_f64();
    assert_eq!(found.film.sums, expected.film.sums);
    assert_eq!(gpu.held_memory().peak_device_bytes, found.plan.bytes());
    let of_the_run = found.timings.row("run").and_then(|row| row.wall_ms).unwrap() / 1e3;
    println!("{}: {of_the_run:.4} s of {seconds:.4} s", gpu.facts().name);
    // A software device has no clock that falls.
    assert!(gpu.facts().kind == "cpu" || seconds - of_the_run >= LEAST_WARM_UP.as_secs_f64());
}

#[test]
fn a_device_that_is_absent_is_named_with_those_present() {
    if device().is_none() {
        return;
    }
    let present = Gpu::list().unwrap();
    assert!(!present.is_empty());
    for wanted in ["no such device", "4096"] {
        let Err(error) = Gpu::open(&Options { device: Some(wanted.to_owned()), ..Options::default() }) else {
            panic!("{wanted} was opened")
        };
        assert!(matches!(error, Error::DeviceAbsent { .. }), "{error}");
        let message = error.to_string();
        assert!(message.contains(wanted) && !message.contains('\n'), "{message}");
        assert!(present.iter().all(|facts| message.contains(&facts.name)), "{message} leaves out one of {present:?}");
        assert_eq!(error.exit_code(), 2);
    }
}

#[test]
fn a_device_opens_by_index_and_by_part_of_its_name() {
    let Some(default) = device() else { return };
    let facts = default.facts();
    // Without the layer nothing is said.
    for (name, validate) in [(facts.index.to_string(), true), (facts.name.clone(), true), (facts.name[..4].to_uppercase(), false)] {
        let Ok(gpu) = Gpu::open(&Options { device: Some(name.clone()), validate, ..Options::default() }) else { panic!("{name}") };
        gpu.check_validation().unwrap();
        if name.len() > 4 || name.parse::<usize>().is_ok() {
            assert_eq!(gpu.facts().name, facts.name);
        }
    }
}

/// A mistake that the layer sees while commands are recorded; they never run.
#[test]
fn a_validation_message_is_an_error() {
    let Some(gpu) = open(Options::default()) else { return };
    gpu.check_validation().unwrap();
    {
        let mut commands = Commands::new(&gpu, Constants::new(128), Instant::now()).unwrap();
        let items = gpu.buffer::<u32>("items", 128, Memory::Device).unwrap();
        // Passes that have ended, in this submission and in one before, are in no message; those that go on are.
        let copy_onto_itself = |commands: &mut Commands| {
            let clear = |commands: &mut Commands| {
                commands.clear(&items);
                Ok(())
            };
            commands.scope("ended", clear)?;
            commands.submit()?;
            commands.scope("ended too", clear)?;
            commands.scope("index", |commands| {
                // No buffer can be copied onto itself.
                commands.copy(&items, &items, 1);
                Ok(())
            })
        };
        commands.scope("round", copy_onto_itself).unwrap();
    }
    let error = gpu.check_validation().unwrap_err();
    assert!(matches!(error, Error::Validation { count: 1.., .. }), "{error}");
    assert!(error.to_string().contains("vkCmdCopyBuffer"), "{error}");
    // As a debugger shows it, which sees the same names and labels.
    assert!(error.to_string().ends_with("(in the pass round/index)"), "{error}");
    // Once said, it stays said.
    assert!(matches!(gpu.check_validation(), Err(Error::Validation { .. })));
}

/// Scopes directly inside another one.
fn children<'a>(rows: &'a [Row], parent: &'a str) -> impl Iterator<Item = &'a Row> {
    rows.iter()
        .filter(move |row| row.name.strip_prefix(parent).and_then(|rest| rest.strip_prefix('/')).is_some_and(|name| !name.contains('/')))
}

/// On each clock a scope lasts as long as those inside it together, or longer, and no time on the
/// device is longer than the host waited for it.
fn nesting_check(rows: &[Row]) -> Check {
    // Timestamps are rounded to nanoseconds, so sums of many may be a little off.
    let slack = |count: u64| 1e-6 * (count as f64 + 2.0);
    for row in rows {
        for (clock, of) in [("device", (|row| row.gpu_ms) as fn(&Row) -> Option<f64>), ("host", |row| row.wall_ms)] {
            let inside: f64 = children(rows, &row.name).filter_map(of).sum();
            let count: u64 = children(rows, &row.name).map(|row| row.count).sum();
            require(of(row).is_none_or(|time| inside <= time + slack(count)), || {
                format!("{} took {:?} ms on the {clock}, what is inside it {inside} ms", row.name, of(row))
            })?;
        }
        require(row.gpu_ms.zip(row.wall_ms).is_none_or(|(gpu, wall)| gpu <= wall), || {
            format!("{} took {:?} ms on the device within {:?} ms", row.name, row.gpu_ms, row.wall_ms)
        })?;
    }
    Ok(())
}

/// How often each scope must have run. The CPU builder takes a photon from its emission to its end before the next, and
/// splats it without an index.
fn count_check(timings: &Timings, settings: &RoomSettings, chunks: u64) -> Check {
    let rounds = u64::from(settings.rounds);
    // Neither does the persistent builder know bounces of all photons.
    let bounces = if matches!(settings.builder, Builder::Cpu | Builder::Persistent) { 0 } else { settings.bounces };
    let mut names = vec!["round".to_owned(), "round/build".to_owned(), "round/gather".to_owned()];
    if bounces != 0 {
        names.push("round/build/emit".to_owned());
    }
    names.extend((1..=bounces).map(|bounce| format!("round/build/bounce {bounce}")));
    if settings.builder != Builder::Cpu && settings.gather == Gather::Grid {
        names.push("round/index".to_owned());
    }
    for name in &names {
        // A round is one, in as many chunks as it takes.
        let expected = if name == "round" { rounds } else { rounds * chunks };
        let count = timings.row(name).map(|row| row.count);
        require(count == Some(expected), || format!("{name} ran {count:?} times instead of {expected}"))?;
    }
    let rows = timings.rows().iter().filter(|row| row.name.contains("bounce")).count();
    require(rows == bounces as usize, || format!("{rows} rows of bounces instead of {bounces}"))
}

#[test]
fn timings_nest_and_count() {
    let many_rounds_of = of_run::<&[_]>(&[Builder::Ballot], &Builder::ON_GPU);
    let Some(gpu) = device() else { return };
    for builder in Builder::ON_GPU {
        // 120 bounces of many rounds take more timestamps than one submission has.
        for (rounds, bounces, chunk, gather) in
            [(1, 15, None, Gather::Grid), (7, 2, Some(1000), Gather::Brute), (40, 120, None, Gather::Grid)]
        {
            if rounds == 40 && !many_rounds_of.contains(&builder) {
                continue;
            }
            let small = RoomSettings { mesh: 16, photons: 2001, rng: Rng::Philox, ..RoomSettings::default() };
            let settings = RoomSettings { builder, rounds, bounces, chunk, gather, ..small };
            let result = run(&gpu, &settings);
            let what = format!("{builder:?}, {rounds} rounds");
            assert_holds(&what, count_check(&result.timings, &settings, u64::from(result.plan.chunks_per_round)));
            assert_holds(&what, nesting_check(result.timings.rows()));
            assert!(result.submissions >= 1 && result.dispatches > u64::from(rounds));
            if gpu.facts().timestamp_bits != 0 {
                for name in ["round", "round/build", "round/gather"] {
                    assert!(result.timings.row(name).unwrap().gpu_ms.is_some_and(|ms| ms > 0.0), "{what}: {name}");
                }
            }
            let wall = result.timings.row("run").unwrap().wall_ms.unwrap();
            let top = result.timings.rows().iter().filter(|row| !row.name.contains('/') && row.name != "run");
            let waited: f64 = top.filter_map(|row| row.wall_ms).sum();
            assert!(waited <= wall, "{what}: waited {waited} ms of {wall}");
            // Spans of the trace file add up to the rows.
            let spans = result.timings.spans().iter().filter(|span| span.clock == Clock::Gpu && *span.name == *"round");
            let spans: f64 = spans.map(|span| span.duration.as_secs_f64() * 1e3).sum();
            let row = result.timings.row("round").unwrap().gpu_ms.unwrap_or(0.0);
            assert!((spans - row).abs() <= 1e-6 * row.max(1.0), "{spans} and {row}");
        }
    }
}

/// A run makes no pipeline that its plan has no use for, and a second one none at all.
#[test]
fn a_run_makes_the_pipelines_of_its_plan_once() {
    let Some(gpu) = fresh_device() else { return };
    let settings = RoomSettings { builder: Builder::Naive, gather: Gather::Brute, mesh: 8, ..RoomSettings::default() };
    let before = gpu.work().pipelines;
    run(&gpu, &settings);
    // Emission, one bounce, one gather.
    assert_eq!(gpu.work().pipelines - before, 3);
    run(&gpu, &settings);
    assert_eq!(gpu.work().pipelines - before, 3);
}

/// Scopes nest and are counted, and both checks complain about what is off.
#[test]
fn the_cpu_builder_is_timed_on_the_host() {
    let settings = RoomSettings { builder: Builder::Cpu, rounds: 3, chunk: Some(1500), mesh: 16, ..RoomSettings::default() };
    let result = run_on_cpu(&settings);
    let (timings, chunks) = (&result.timings, u64::from(result.plan.chunks_per_round));
    assert_holds("cpu", count_check(timings, &settings, chunks));
    assert_holds("cpu", nesting_check(timings.rows()));
    assert!(timings.rows().iter().all(|row| row.gpu_ms.is_none() && row.wall_ms.is_some()));
    assert!(result.device.is_none());

    let spoiled = |name: &str, spoil: fn(&mut Row)| {
        let mut rows = timings.rows().to_vec();
        rows.iter_mut().filter(|row| row.name == name).for_each(spoil);
        rows
    };
    assert_complains("a scope longer than its parent", nesting_check(&spoiled("round/build", |row| row.wall_ms = Some(1e9))));
    assert_complains("a scope shorter than what it holds", nesting_check(&spoiled("round", |row| row.wall_ms = Some(0.0))));
    assert_complains("a device faster than time", nesting_check(&spoiled("round/build", |row| row.gpu_ms = Some(1e9))));

    let mut twice = timings.clone();
    twice.count("round/build");
    assert_complains("a build counted twice", count_check(&twice, &settings, chunks));
    let mut extra = timings.clone();
    extra.count("round/build/bounce 1");
    assert_complains("a bounce too many", count_check(&extra, &settings, chunks));
    assert_complains("a round left out", count_check(timings, &RoomSettings { rounds: 4, ..settings.clone() }, chunks));
}
