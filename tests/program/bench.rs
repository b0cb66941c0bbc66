//! `photonmill bench`: its measurements on the device under test, its report, its refusals.

use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use crate::common::planted;
use crate::common::prelude::*;
use photonmill::measure::bench::experiment::Experiment;
use photonmill::measure::bench::rates::{self, Rates};
use photonmill::measure::bench::room::{self, Timed};
use photonmill::measure::bench::scene::{self, Job};
use photonmill::measure::bench::targets::TARGETS;
use photonmill::measure::bench::{self, Bench, Request, Size, table};
use photonmill::output::destination::Folder;
use serde_json::Value;

/// Measurements of one device do not disturb each other.
static DEVICE: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    DEVICE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Rates of the device, measured once.
fn rates_of(gpu: &Gpu) -> &'static Rates {
    static RATES: OnceLock<Rates> = OnceLock::new();
    RATES.get_or_init(|| rates::measure(gpu, Size::Small).unwrap())
}

/// A small bench, by a request that `change` made of the usual one; nothing without a device.
fn bench(experiments: &[Experiment], change: impl Fn(&mut Request), cancelled: bool) -> Option<(Device, Bench)> {
    let _alone = alone();
    let gpu = device()?;
    let (command, scene, budget) = ("photonmill bench".to_owned(), scene("cornell-spheres"), Duration::from_secs(36_000));
    let mut request = Request { command, size: Size::Small, experiments: experiments.to_vec(), scenes: vec![scene], scale: false, budget };
    change(&mut request);
    let found = bench::run(&gpu, request, &AtomicBool::new(cancelled), &mut |_| {}).unwrap();
    Some((gpu, found))
}

/// Every number below a key.
fn numbers(value: &Value, key: &str, found: &mut Vec<f64>) {
    match value {
        Value::Object(fields) => fields.iter().for_each(|(name, field)| match field.as_f64() {
            Some(number) if name == key => found.push(number),
            _ => numbers(field, key, found),
        }),
        Value::Array(items) => items.iter().for_each(|item| numbers(item, key, found)),
        _ => {}
    }
}

#[test]
fn a_small_bench_reports_every_pass_and_target() {
    let Some((gpu, found)) = bench(&Experiment::USUAL, |_| {}, false) else { return };
    let report: Value = serde_json::from_slice(&found.json()).unwrap();
    assert_eq!(report["device"], gpu.facts().name.as_str());
    assert!(!report["driver"].as_str().unwrap().is_empty() && report["left_out"].as_array().unwrap().is_empty(), "{}", report["left_out"]);
    for rate in
        ["dispatches", "float_operations", "integer_products", "random_reads", "spread_atomics", "single_atomics", "counter_additions"]
    {
        let rate = &report["rates"][rate];
        let [least, median, most] = ["min", "median", "max"].map(|which| rate[which].as_f64().unwrap());
        assert!(0.0 < least && least <= median && median <= most && most < 1e15, "{rate}");
    }
    let copies = report["rates"]["copies"].as_array().unwrap();
    assert!(copies.iter().all(|copy| copy["median"].as_f64().unwrap() > 1e7 && copy["moved_bytes"].as_u64().unwrap() > 1 << 16));
    assert_eq!(report["targets"].as_array().unwrap().len(), TARGETS.len());
    for target in &found.targets {
        // Nothing is judged at another size than the target's.
        assert_eq!(target.met, None, "{}", target.target.work);
        // On a busy processor an error may take longer than anybody waits for it.
        assert!(target.found > 0.0 || target.how.contains("was not reached"), "{}: {}", target.target.work, target.how);
    }
    let mut fractions = Vec::new();
    numbers(&report, "fraction", &mut fractions);
    assert!(fractions.len() > 60, "{} passes", fractions.len());
    // How large they are is the clock's affair, and a processor that others use shows less than it can for a while.
    assert!(fractions.iter().all(|fraction| fraction.is_finite() && *fraction > 0.0), "{fractions:?}");
    for pass in &found.passes {
        assert!(pass.ms.min > 0.0 && pass.ms.repeats >= 5 && pass.work.is_some(), "{} {}: {:?}", pass.workload, pass.name, pass.ms);
    }
    let text = table::text(&found);
    for line in ["build/bounce", "global/gather", "resolve", "B read and written", "open box, naive", "H200 only"] {
        assert!(text.contains(line), "{line} is not in\n{text}");
    }
}

/// A few settings are tried, and what a pilot chooses stands beside the best of them.
#[test]
fn tuning_compares_what_a_pilot_chooses_with_a_search() {
    let Some((_, found)) = bench(&[Experiment::Tuning], |_| {}, false) else { return };
    let [tuned] = &found.tuning[..] else { panic!("{:?}", found.tuning) };
    assert!(tuned.scene == "cornell-spheres" && (2..=4).contains(&tuned.tried.len()) && tuned.goals.len() == 1, "{tuned:?}");
    let settings: Vec<_> = tuned.tried.iter().map(|tried| tried.settings).collect();
    assert!(settings.iter().all(|one| settings.iter().filter(|other| *other == one).count() == 1), "{settings:?}");
    let [goal] = &tuned.goals[..] else { unreachable!() };
    assert!(goal.chosen.pilot_ms > 0.0 && goal.chosen.ms.is_some_and(|ms| ms > 0.0), "{goal:?}");
    let best = tuned.tried.iter().filter_map(|tried| tried.ms[0]).reduce(f64::min);
    assert_eq!(goal.best.map(|(ms, _)| ms), best);
    let line = table::text(&found).lines().find(|line| line.starts_with("cornell-spheres")).unwrap().to_owned();
    assert!(line.contains(&format!("{:.1}", goal.chosen.pilot_ms)), "{line}");
}

/// Launches that the roofline counts are those of the run, of every outermost pass.
#[test]
fn the_roofline_counts_every_dispatch() {
    let _alone = alone();
    let Some(gpu) = counting_device() else { return };
    let never = AtomicBool::new(false);
    let rates = rates_of(&gpu);
    let check = |what: &str, timed: &Timed| {
        let outermost = timed.passes.iter().filter(|pass| !pass.name.contains('/'));
        let counted: f64 = outermost.map(|pass| pass.work.unwrap_or_else(|| panic!("{what}: {}", pass.name)).dispatches).sum();
        assert_eq!(counted, timed.dispatches, "{what}");
    };
    for builder in Builder::ON_GPU {
        let settings = RoomSettings { builder, photons: 600, mesh: 4, bounces: 3, chunk: Some(300), ..RoomSettings::default() };
        check(builder.name(), &room::time(&gpu, rates, &settings, &never).unwrap());
    }
    let scene = scene("cornell-spheres");
    let geometry = Geometry::new(&scene).unwrap();
    for illumination in BOTH {
        let settings = SceneSettings { photons: 600, caustic_photons: 500, bounces: 3, chunk: Some(400), illumination, ..by_rounds() };
        let job = Job { name: "cornell-spheres", scene: &scene, geometry: &geometry, size: (8, 8), settings };
        check("cornell-spheres", &scene::time(&gpu, rates, &job, &never).unwrap());
    }
}

/// What is measured is checked: a kernel that leaves work out, or does another, gives no rate.
#[test]
fn measurements_that_come_out_wrong_are_refused() {
    let _alone = alone();
    let Some(gpu) = device() else { return };
    let right = rates_of(&gpu);
    assert!(right.most_bytes(1e6) >= right.copies[0].rate.median);
    for (kernel, from, to, what) in [
        ("measure_copy", "copies[index] = blocks[index];", "copies[index] = uvec4(index);", "copied blocks"),
        ("measure_copy", "if (index < push.item_count)", "if (index < push.item_count / 2)", "copied blocks"),
        ("measure_float", "step < push.step_count", "step < push.step_count / 2", "sums and products"),
        ("measure_integer", "step < push.step_count", "step < min(push.step_count, 7)", "products of integers"),
        ("measure_gather", "measured_place(index * push.step_count + step)", "(index * push.step_count + step)", "copied blocks"),
        ("measure_atomic", "step < push.step_count", "step < push.step_count - 1", "atomic additions"),
    ] {
        let replaced = planted::kernels(&[kernel], &format!("check/{kernel}.comp"), &[(from, to)]);
        let gpu = device_with(Options { replaced, ..Options::default() }).expect("it was there before");
        let error = rates::measure(&gpu, Size::Small).expect_err(kernel).to_string();
        assert!(error.contains(what) && error.contains("wrongly"), "{kernel}: {error}");
    }
}

#[test]
fn cost_follows_photons_and_memory_the_plan() {
    let Some((_, found)) = bench(&[], |request| request.scale = true, false) else { return };
    let place = Place::new();
    bench::write(&Folder::open("--out", place.path()).unwrap(), &found).unwrap();
    let [photons, triangles] = found.scale.as_ref().unwrap().series.as_slice() else { panic!("two series") };
    for step in photons.steps.iter().chain(&triangles.steps) {
        assert_eq!(step.peak_bytes, step.stated_bytes, "{}", step.size);
    }
    // What the powers are depends on who else uses the processor.
    for (series, pass) in [(photons, "build"), (triangles, "global/trace")] {
        let growth = series.growth.iter().find(|growth| growth.pass == pass).unwrap_or_else(|| panic!("no {pass}"));
        assert!(growth.power.value.is_finite() && growth.power.error >= 0.0, "{pass}: {:?}", growth.power);
    }
    for file in ["index.html", "bench.json", "bench.txt", "scale-photons.svg", "scale-triangles.svg"] {
        let content = place.text(file);
        assert!(content.len() > 500, "{file}: {content}");
    }
}

#[test]
fn a_cancelled_bench_says_so() {
    let Some((_, found)) = bench(&[Experiment::OpenBox], |_| {}, true) else { return };
    assert!(found.passes.is_empty() && found.left_out.iter().any(|line| line.contains("interrupted")), "{:?}", found.left_out);
}

#[test]
fn time_that_is_spent_leaves_experiments_out() {
    let Some((_, found)) = bench(&[Experiment::Mesh], |request| request.budget = Duration::ZERO, false) else { return };
    assert_eq!(found.left_out, ["mesh: no --time left"]);
}

#[test]
fn the_program_writes_its_report() {
    let _alone = alone();
    let Some(gpu) = device() else { return };
    let place = Place::new();
    place.succeed("bench --size small --only open-box,table-1 --json a.json");
    let report = place.json("a.json");
    assert_eq!(report["device"], gpu.facts().name.as_str());
    assert!(report["request"]["command"].as_str().unwrap().contains("--only open-box,table-1"));
    place.assert_refused([
        ("bench --only box", ["must be one of open-box, builders"]),
        ("bench --time 0s", ["must be from 1s"]),
        ("bench --json absent/a.json", ["there is no folder"]),
    ]);
}
