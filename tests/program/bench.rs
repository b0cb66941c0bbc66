//! `photonmill bench`: its measurements on the device under test, its report, its refusals.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::common::planted;
use crate::common::prelude::*;
use crate::common::program::assert_says;
use photonmill::measure::bench::experiments;
use photonmill::measure::bench::rates::{self, CopyRate, Rates};
use photonmill::measure::bench::room::{self, Timed};
use photonmill::measure::bench::scale::{Growth, PassTime, Scale, Series, Slope, Step};
use photonmill::measure::bench::scene::{self, Job};
use photonmill::measure::bench::{self, Bench, BenchRequest, Lab, Size, scale, table};
use photonmill::measure::compaction::Agreed;
use photonmill::output::destination::Folder;
use photonmill::timings::Spread;
use serde_json::Value;

/// Rates of no device, for what does not look at them.
fn some_rates() -> Rates {
    let spread = Spread::of(vec![1e9]).unwrap();
    let copies = [64, 8, 1].map(|moved| CopyRate { moved_bytes: moved << 20, rate: spread });
    let [dispatches, float_operations, integer_products, random_reads] = [spread; 4];
    let [spread_atomics, single_atomics, counter_additions] = [spread; 3];
    Rates { dispatches, copies, float_operations, integer_products, random_reads, spread_atomics, single_atomics, counter_additions }
}

/// Runs part of a small bench that nothing cuts off.
fn in_lab<T>(gpu: &Gpu, part: impl FnOnce(&mut Lab) -> T) -> T {
    let deadline = Instant::now() + Duration::from_secs(36_000);
    let cancelled = &AtomicBool::new(false);
    part(&mut Lab { gpu, rates: some_rates(), scene: None, size: Size::Small, deadline, cancelled, report: &mut |_| {} })
}

/// Some experiments, and one more in which it is interrupted: what is complete is kept, and the rest is named.
#[test]
fn a_small_bench_reports_every_pass() {
    let all = experiments::ALL.map(|experiment| experiment.name);
    let few = ["open-box", "table-1", "gather", "compaction"];
    let (names, scene) = of_run::<(&[_], _)>((&few, None), (&all, Some(scene("cornell"))));
    let Some(gpu) = device() else { return };
    let experiments: Vec<_> = names.iter().chain(&["open-box"]).map(|name| experiments::by_name(name).unwrap()).collect();
    let last = format!("[{0}/{0}] ", experiments.len());
    let (command, budget, cancelled) = ("photonmill bench".to_owned(), Duration::from_secs(36_000), AtomicBool::new(false));
    let request = BenchRequest { command, size: Size::Small, experiments, scene, scale: false, budget };
    let mut report_progress = |line: &str| cancelled.store(line.starts_with(&last), Ordering::Relaxed);
    let mut found = bench::run(&gpu, request, &cancelled, &mut report_progress).unwrap();
    assert_eq!(found.left_out, ["the remaining experiments: interrupted"]);
    assert!(found.rates.most_bytes(1e6) >= found.rates.copies[0].rate.median);

    let report: Value = serde_json::from_slice(&found.json()).unwrap();
    assert_eq!(report["device"], gpu.facts().name.as_str());
    assert!(!report["driver"].as_str().unwrap().is_empty());
    for rate in
        ["dispatches", "float_operations", "integer_products", "random_reads", "spread_atomics", "single_atomics", "counter_additions"]
    {
        let rate = &report["rates"][rate];
        let [least, median, most] = ["min", "median", "max"].map(|which| rate[which].as_f64().unwrap());
        assert!(0.0 < least && least <= median && median <= most && most < 1e15, "{rate}");
    }
    let copies = report["rates"]["copies"].as_array().unwrap();
    assert!(copies.iter().all(|copy| copy["median"].as_f64().unwrap() > 0.0 && copy["moved_bytes"].as_u64().unwrap() > 1 << 16));
    let passes = report["passes"].as_array().unwrap();
    assert!(passes.len() > of_run(30, 60), "{} passes", passes.len());
    // How large they are is the clock's affair, and a processor that others use shows less than it can for a while.
    assert!(passes.iter().all(|pass| pass["fraction"].as_f64().is_some_and(|fraction| fraction > 0.0)), "{passes:?}");
    for pass in &found.passes {
        assert!(pass.ms.min > 0.0 && pass.ms.repeats >= 5 && pass.work.is_some(), "{} {}: {:?}", pass.workload, pass.name, pass.ms);
    }
    let text = table::text(&found);
    assert_says(&text, ["build/bounce", "global/gather", "resolve", "B read and written", "open box, naive"]);
    check_builders(&found);
    check_files(&mut found);
}

/// All builders agree on the photons, of which in a closed room s + s^2 + ... are stored where all go on with the chance s.
fn check_builders(found: &Bench) {
    let map = found.compaction.as_ref().unwrap();
    assert_eq!(map.cells.len(), 2 + found.request.scene.iter().count());
    for cell in &map.cells {
        assert!(cell.agreed == Agreed::Photons && cell.builders.is_sorted_by(|a, b| a.ms.median <= b.ms.median), "{cell:?}");
        assert!(cell.gain() >= 1.0, "{cell:?}");
        if cell.scene.is_none() {
            assert_eq!(cell.builders.len(), Builder::ON_GPU.len());
            let s = f64::from(cell.survival);
            let expected = f64::from(cell.photons) * s * (1.0 - s.powi(15)) / (1.0 - s);
            let z = (cell.survivors as f64 - expected) / (f64::from(cell.photons) * 10.0 * s).sqrt();
            assert!(z.abs() < 5.0, "{} stored of {expected}", cell.survivors);
        }
    }
}

/// The files of a bench, with a scale as it might have been found.
fn check_files(found: &mut Bench) {
    let step = |size: u64| {
        let ms = Spread::of(vec![1e-3 * size as f64]).unwrap();
        Step { size, passes: vec![PassTime { pass: "build".to_owned(), ms }], peak_bytes: size, stated_bytes: size }
    };
    let power = Slope { value: 1.0, error: 0.01 };
    let growth = Growth { pass: "build".to_owned(), from: 1000, power, power_off: 0.0, logarithm_off: 1.0 };
    let series = |over| Series { over, steps: [1000, 10_000, 100_000].map(step).into(), growth: vec![growth.clone()] };
    found.scale = Some(Scale { series: ["photons", "triangles"].map(series).into() });
    let place = Place::new();
    bench::write(&Folder::open("--out", place.path()).unwrap(), found).unwrap();
    for file in ["index.html", "bench.json", "bench.txt", "compaction.svg", "scale-photons.svg", "scale-triangles.svg"] {
        let content = place.text(file);
        assert!(content.len() > 500, "{file}: {content}");
    }
}

/// Launches that the roofline counts are those of the run, of every outermost pass; and memory is what the plan says.
#[test]
fn the_roofline_counts_every_dispatch() {
    let Some(gpu) = device() else { return };
    let (never, rates) = (AtomicBool::new(false), &some_rates());
    let check = |what: &str, timed: &Timed| {
        let outermost = timed.passes.iter().filter(|pass| !pass.name.contains('/'));
        let counted: f64 = outermost.map(|pass| pass.work.unwrap_or_else(|| panic!("{what}: {}", pass.name)).dispatches).sum();
        assert_eq!(counted, timed.dispatches, "{what}");
        assert_eq!(timed.memory.peak_device_bytes, timed.stated_bytes, "{what}");
    };
    for builder in Builder::ON_GPU {
        let settings = RoomSettings { builder, photons: 600, mesh: 4, bounces: 3, chunk: Some(300), ..RoomSettings::default() };
        check(builder.name(), &room::time(&gpu, rates, &settings, &never).unwrap());
    }
    let scene = scene::named("cornell-spheres");
    for illumination in BOTH {
        let settings = SceneSettings { photons: 600, caustic_photons: 500, bounces: 3, chunk: Some(400), illumination, ..by_rounds() };
        let job = Job { name: "cornell-spheres", scene: &scene, size: (8, 8), settings };
        check("cornell-spheres", &scene::time(&gpu, rates, &job, &never).unwrap());
    }
}

/// What is measured is checked: a kernel that leaves work out, or does another, gives no rate.
/// Those that are measured first.
#[test]
fn measurements_that_come_out_wrong_are_refused() {
    let rows = [
        ("measure_float", "step < push.step_count", "step < push.step_count / 2", "sums and products"),
        ("measure_integer", "step < push.step_count", "step < min(push.step_count, 7)", "products of integers"),
        ("measure_copy", "if (index < push.item_count)", "if (index < push.item_count / 2)", "copied blocks"),
        ("measure_copy", "copies[index] = blocks[index];", "copies[index] = uvec4(index);", "copied blocks"),
        ("measure_gather", "measured_place(index * push.step_count + step)", "(index * push.step_count + step)", "copied blocks"),
        ("measure_atomic", "step < push.step_count", "step < push.step_count - 1", "atomic additions"),
    ];
    for (kernel, from, to, what) in &rows[..of_run(3, 6)] {
        let replaced = planted::kernels(&[kernel], &format!("check/{kernel}.comp"), &[(from, to)]);
        let Some(gpu) = device_with(Options { replaced, ..Options::default() }) else { return };
        let error = rates::measure(&gpu, Size::Small).expect_err(kernel).to_string();
        assert!(error.contains(what) && error.contains("wrongly"), "{kernel}: {error}");
    }
}

/// Short forms: memory and work of small runs in [`the_roofline_counts_every_dispatch`], growth in the tests of `scale` itself.
#[test]
#[ignore = "long: a million photons a round"]
fn cost_follows_photons_and_memory_the_plan() {
    let Some(gpu) = device() else { return };
    let mut left_out = Vec::new();
    let found = in_lab(&gpu, |lab| scale::measure(lab, &mut left_out)).unwrap();
    let [photons, triangles] = &found.series[..] else { panic!("two series") };
    for step in photons.steps.iter().chain(&triangles.steps) {
        assert_eq!(step.peak_bytes, step.stated_bytes, "{}", step.size);
    }
    // What the powers are depends on who else uses the processor.
    for (series, pass) in [(photons, "build"), (triangles, "global/trace")] {
        let growth = series.growth.iter().find(|growth| growth.pass == pass).unwrap_or_else(|| panic!("no {pass}"));
        assert!(growth.power.value.is_finite() && growth.power.error >= 0.0, "{pass}: {:?}", growth.power);
    }
    assert!(left_out.is_empty(), "{left_out:?}");
}

/// An experiment that no time is left for is named: on a software device the limits alone take more than a second.
#[test]
fn the_program_writes_its_report() {
    let Some(gpu) = device() else { return };
    let place = Place::new();
    place.succeed("bench --size small --only open-box --time 1s --json a.json");
    let report = place.json("a.json");
    assert_eq!(report["device"], gpu.facts().name.as_str());
    assert!(report["request"]["command"].as_str().unwrap().contains("--only open-box"));
    let was_late = report["left_out"] == serde_json::json!(["open-box: no --time left"]);
    assert_eq!(report["passes"].as_array().unwrap().is_empty(), was_late, "{report}");
    place.assert_refused([("bench --only box", ["must be one of open-box, builders"])]);
}
