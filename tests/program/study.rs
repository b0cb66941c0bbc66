//! `photonmill study`: points against a reference of another method, a page that loads nothing, and a study that goes on
//! where it was cut off.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::common::prelude::*;
use photonmill::measure::compaction::Agreed;
use photonmill::measure::study::axes::Axis;
use photonmill::measure::study::point::Point;
use photonmill::measure::study::{self, Part, Request, Study};
use photonmill::output::destination::Folder;

/// Bounded by rounds alone, so that a slow machine finds the same.
fn request(scene: &str, most_rounds: u32) -> Request {
    let (scene, budget) = (scene.to_owned(), Duration::from_secs(3600));
    Request {
        scene,
        size: 6,
        photons: 2048,
        repeats: 3,
        seed: 1,
        reference_samples: 512,
        budget,
        asked: vec![0.5, 0.3],
        peers: Vec::new(),
        most_rounds,
    }
}

fn run(gpu: &Gpu, folder: &Path, request: Request) -> photonmill::error::Result<Study> {
    let never = AtomicBool::new(false);
    let folder = Folder::open("-o", folder)?;
    let scene = scene(&request.scene);
    let study = study::run(gpu, &scene, request, &folder, &never, &mut |_| {})?;
    study::write(&folder, &study)?;
    Ok(study)
}

/// Points by what they are of: quantity, axis, rounds, curve and command.
fn points_of(study: &Study) -> BTreeMap<(String, String, u32, String, String), &Point> {
    let mut found = BTreeMap::new();
    for (part, comparison) in study.parts.iter().flat_map(|part| part.comparisons.iter().map(move |comparison| (part, comparison))) {
        for (curve, point) in comparison.curves.iter().flat_map(|curve| curve.points.iter().map(move |point| (curve, point))) {
            let axis = format!("{:?}", comparison.axis);
            let before = found.insert((part.quantity.clone(), axis, point.rounds, curve.label.clone(), point.command.clone()), point);
            assert_eq!(before, None, "two points of {}", point.command);
        }
    }
    found
}

/// A study that was cut off and went on has the points of one that was not: those of rounds that were kept of a whole
/// group with the times that they had, and all with the same errors, which no clock disturbs.
fn resumed_check(resumed: &Study, whole: &Study, kept: &[(Axis, Point)]) -> Check {
    let (found, expected) = (points_of(resumed), points_of(whole));
    if let Some(key) = found.keys().find(|key| !expected.contains_key(*key)).or(expected.keys().find(|key| !found.contains_key(*key))) {
        return Err(format!("{key:?} is in one study alone; {} points and {}", found.len(), expected.len()));
    }
    let is_kept = |axis: &str, command: &str| kept.iter().any(|(of, point)| format!("{of:?}") == axis && point.command == command);
    for (key, point) in &found {
        let (quantity, axis, rounds, ..) = key;
        let of_group = |other: &&(String, String, u32, String, String)| (&other.0, &other.1, &other.2) == (quantity, axis, rounds);
        let stands = expected.keys().filter(of_group).all(|(_, axis, _, _, command)| is_kept(axis, command));
        // A number that is read from text may be a rounding off.
        let same = |a: &[f64], b: &[f64], allowed: f64| a.len() == b.len() && pairs(a, b).all(|(a, b)| (a - b).abs() <= allowed * b.abs());
        require(!stands || same(&point.wall_ms, &expected[key].wall_ms, 1e-9), || format!("{key:?} was measured again"))?;
        // Floats are summed in another order each time.
        let allowed = if axis == "Sums" { 1e-3 } else { 1e-9 };
        require(same(&point.squared_errors, &expected[key].squared_errors, allowed), || {
            format!("{key:?} has other errors: {:?} instead of {:?}", point.squared_errors, expected[key].squared_errors)
        })?;
    }
    Ok(())
}

/// Errors are those of this scene: no photons miss the reference by half, and their noise is no more than half of the
/// light, or as many times that as the root of the photons in reach is smaller.
fn error_check(label: &str, bias: f64, noise: f64) -> Check {
    let times = match label {
        "1/16 of the photons" | "radius 0.00625 m" => 4.0,
        "1/4 of the photons" | "radius 0.0125 m" => 2.0,
        _ => 1.0,
    };
    // More than half of the light is indirect.
    let missed = if label == "without indirect" { 0.7 } else { 0.5 };
    require(bias < missed && noise < 0.5 * times, || format!("a bias of {bias:.3} and a noise of {noise:.3}"))
}

#[test]
fn the_check_of_errors_complains() {
    assert_holds("half", error_check("the base", 0.49, 0.49));
    assert_complains("a bias of half", error_check("the base", 0.51, 0.1));
    assert_complains("a noise of half", error_check("the base", 0.1, 0.51));
    assert_complains("a noise of two", error_check("radius 0.00625 m", 0.1, 2.1));
    assert_complains("no number", error_check("the base", f64::NAN, 0.1));
}

#[test]
fn the_open_box_is_studied_against_radiosity_and_goes_on_where_it_ended() {
    let Some(gpu) = device() else { return };
    let folder = Place::new();
    let first = run(&gpu, folder.path(), request("open-box", 4)).unwrap();
    assert!(first.complete);
    let axes: Vec<Axis> = first.parts.iter().flat_map(|part| part.comparisons.iter().map(|comparison| comparison.axis)).collect();
    for axis in [Axis::Builder, Axis::Photons, Axis::Radius, Axis::Schedule, Axis::Kernel, Axis::Edges, Axis::Bounces, Axis::Randomness] {
        assert!(axes.contains(&axis), "{axis:?} of {axes:?}");
    }
    for axis in [Axis::Nearest, Axis::Sums, Axis::Arithmetic, Axis::Direct, Axis::Gather, Axis::Index, Axis::Effects, Axis::Paper] {
        assert!(axes.contains(&axis), "{axis:?} of {axes:?}");
    }
    for part in &first.parts {
        assert!(part.reference.contains("radiosity") && part.reference_error < 0.01, "{} {}", part.reference, part.reference_error);
        assert!(part.curves().all(|curve| !curve.points.is_empty()), "{}", part.quantity);
        for (curve, point) in part.points() {
            let what = format!("{}: {}", part.quantity, curve.label);
            assert!(point.error().value > 1e-4, "{what}: no error by chance");
            assert_holds(what, error_check(&curve.label, point.bias().value, point.squared_noise.sqrt()));
            assert_eq!(point.squared_errors.len(), 3);
        }
        // More photons, a smaller error.
        let base = part.base().unwrap();
        let (first, last) = (base.points.first().unwrap(), base.points.last().unwrap());
        assert!(base.points.len() < 2 || last.error().value < first.error().value, "{}", part.quantity);
    }
    // The paper's two bounces lack a third of the light, whatever the noise.
    let bounces = first.parts[0].comparisons.iter().find(|comparison| comparison.axis == Axis::Bounces).unwrap();
    let two = bounces.curves.iter().find(|curve| curve.label == "2 bounces").unwrap().points.last().unwrap();
    assert!(two.bias().value > 0.3 && (0.3..0.4).contains(&two.cut_off), "{:?}, {}", two.bias(), two.cut_off);

    let page = folder.text("index.html");
    assert!(page.contains("What accuracy costs in time") && page.contains("<svg") && !page.contains("http"));
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
    // The paper's own points stand on the chart of its box, whose errors its rounds have here.
    assert!(page.contains("GPU in 2008") && page.contains("data:image/png;base64,"));
    let strip = first.parts[0].strip.as_ref().unwrap();
    assert!(!strip.frames.is_empty() && strip.frames.iter().all(|frame| frame.error <= frame.asked && frame.size == (240, 240)));
    assert!(first.parts[2].default.as_ref().is_some_and(|curve| curve.points.len() == 2) && first.parts[0].default.is_none());
    let count = first.parts.iter().flat_map(Part::points).count();
    assert_eq!(folder.text("points.csv").lines().count(), 1 + count);
    assert_eq!(folder.text("points.jsonl").lines().count(), 1 + count);

    // The fastest builders, of photons that all of them agree on.
    let map = first.compaction.as_ref().unwrap();
    assert!(map.cells.len() == 5 && page.contains("Fastest builder by photon count"));
    let chart = folder.text("compaction.svg");
    for cell in &map.cells {
        assert!(cell.agreed == Agreed::Photons && cell.builders.len() == 6, "{cell:?}");
        // Which is the fastest differs from run to run where several nearly are.
        assert!(chart.contains(cell.builders[0].builder.name()), "{cell:?}");
        // Of photons that all go on with the same chance: s + s^2 + ... of them are stored.
        let s = f64::from(cell.survival);
        let expected = f64::from(cell.photons) * s * (1.0 - s.powi(15)) / (1.0 - s);
        let z = (cell.survivors as f64 - expected) / (f64::from(cell.photons) * 10.0 * s).sqrt();
        assert!(z.abs() < 5.0, "{} stored of {expected}", cell.survivors);
        assert!(cell.builders.is_sorted_by(|a, b| a.ms.median <= b.ms.median) && cell.gain() >= 1.0);
    }

    // Cut off in the middle of a line, a quarter before the end: what is whole is kept, and only the rest is measured.
    let whole = folder.text("points.jsonl");
    let kept: Vec<&str> = whole.lines().take(1 + 3 * count / 4).collect();
    folder.write("points.jsonl", kept.join("\n") + "\n[\"builder\",{\"comm");
    let kept = kept.into_iter().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<(Axis, Point)>>();
    let mut second = run(&gpu, folder.path(), request("open-box", 4)).unwrap();
    assert!(second.complete);
    assert_holds("the study that went on", resumed_check(&second, &first, &kept));
    let spoiled = |second: &mut Study, spoil: &dyn Fn(&mut Vec<Point>)| {
        let points = &mut second.parts[0].comparisons[0].curves[0].points;
        let whole = points.clone();
        spoil(points);
        let check = resumed_check(second, &first, &kept);
        second.parts[0].comparisons[0].curves[0].points = whole;
        check
    };
    assert_complains("a point that was lost", spoiled(&mut second, &|points| points.truncate(points.len() - 1)));
    assert_complains("all points of a curve lost", spoiled(&mut second, &Vec::clear));
    assert_complains("a run that was lost", spoiled(&mut second, &|points| points[0].wall_ms.truncate(2)));
    assert_complains("a point measured again", spoiled(&mut second, &|points| points[0].wall_ms[0] *= 1.001));
    assert_complains("another error", spoiled(&mut second, &|points| points[0].squared_errors[0] *= 1.001));
    assert_holds("the study that went on", resumed_check(&second, &first, &kept));

    // Another study does not mix with it.
    let error = run(&gpu, folder.path(), Request { photons: 4096, ..request("open-box", 4) }).unwrap_err().to_string();
    assert!(error.starts_with("-o ") && error.contains("points.jsonl") && !error.contains('\n'), "{error}");
}

/// What is said of a picture's study.
fn sentences_of(scene: &str, rounds: u32) -> Option<String> {
    let gpu = device()?;
    let folder = Place::new();
    let study = run(&gpu, folder.path(), request(scene, rounds)).unwrap();
    let part = &study.parts[0];
    assert!(part.reference.contains("path tracing") && part.reference_error < 0.2, "{} {}", part.reference, part.reference_error);
    // What a pilot divides reaches the error that it was asked for, and is shown.
    let default = part.default.as_ref().unwrap();
    for (point, asked) in pairs(&default.points, &[0.5, 0.3]) {
        assert!(point.error().value < 1.1 * asked && point.command.contains("--error"), "{asked}: {:?}", point.error());
    }
    let strip = part.strip.as_ref().unwrap();
    assert!(strip.frames.iter().all(|frame| frame.size == (6, 6) && frame.picture != strip.reference), "{strip:?}");
    let page = folder.text("index.html");
    assert_eq!(page.matches("in false colours").count(), strip.frames.len());
    let without = part.curves().find(|curve| curve.label == "without indirect").unwrap();
    let base = part.base().unwrap();
    assert!(without.best_error() > base.best_error(), "{} {}", without.best_error(), base.best_error());
    let sentences = part.sentences().join("\n");
    assert!(["the bounce limit ends", "the base"].iter().all(|what| sentences.contains(what)), "{sentences}");
    Some(sentences)
}

#[test]
fn a_picture_is_studied_against_path_tracing() {
    let Some(sentences) = sentences_of("cornell", 4) else { return };
    assert!(sentences.contains("with a bias of"), "{sentences}");
}

#[test]
#[ignore = "a minute on a software device"]
fn a_picture_with_caustics_is_studied_against_path_tracing() {
    sentences_of("cornell-spheres", 2);
}

/// Photons on a floor below a point and a disc; a factor forgotten would be no noise.
#[test]
fn floors_are_studied_against_their_closed_form() {
    let Some(gpu) = device() else { return };
    for name in ["disc-over-plane", "furnace"] {
        let folder = Place::new();
        let (out, cancelled) = (Folder::open("-o", folder.path()).unwrap(), AtomicBool::new(false));
        // All that is asked below was measured before the final gather, and making the kernels of the rest would take as long again.
        let mut tell = |line: &str| {
            if line.ends_with(": final gather") {
                cancelled.store(true, Ordering::Relaxed);
            }
        };
        let study = study::run(&gpu, &scene(name), request(name, 2), &out, &cancelled, &mut tell).unwrap();
        let part = &study.parts[0];
        assert!(part.reference.contains("closed form"), "{name}");
        let photons = part.curves().find(|curve| curve.label == "direct light from photons").unwrap().points.last().unwrap();
        assert!(photons.error().value < 0.5 && photons.bias().value < 0.2, "{name}: {:?}, bias {:?}", photons.error(), photons.bias());
        let base = part.base().unwrap().points.last().unwrap();
        // Few photons are noisy, and right on average.
        assert!(base.error().value < 0.6 && base.bias().value < 0.2, "{name}: {:?}, bias {:?}", base.error(), base.bias());
    }
}

/// A spot light and a prism: no path from the eye finds such light, so photonmill judges itself, and says so.
#[test]
fn light_that_no_path_finds_is_studied_against_a_long_run() {
    let Some(gpu) = device() else { return };
    let folder = Place::new();
    let (out, cancelled) = (Folder::open("-o", folder.path()).unwrap(), AtomicBool::new(false));
    let mut tell = |line: &str| cancelled.store(cancelled.load(Ordering::Relaxed) || line.starts_with('['), Ordering::Relaxed);
    let request = Request { budget: Duration::from_secs(12), asked: vec![0.6], ..request("prism", 1) };
    let study = study::run(&gpu, &scene("prism"), request, &out, &cancelled, &mut tell).unwrap();
    let part = &study.parts[0];
    assert!(part.reference.contains("a long run of photonmill itself"), "{}", part.reference);
    // Wider than high, as the camera.
    assert!(part.reference_error > 0.0 && part.reference_error < 1.0 && part.least_error > 0.0, "{}", part.reference_error);
}

#[test]
fn a_study_that_is_cancelled_keeps_what_it_has() {
    let Some(gpu) = device() else { return };
    let folder = Place::new();
    let cancelled = AtomicBool::new(false);
    let mut told = 0;
    let scene = scene("open-box");
    let out = Folder::open("-o", folder.path()).unwrap();
    let study = study::run(&gpu, &scene, request("open-box", 4), &out, &cancelled, &mut |_| {
        told += 1;
        // At the third comparison.
        if told == 4 {
            cancelled.store(true, Ordering::Relaxed);
        }
    })
    .unwrap();
    assert!(!study.complete);
    assert_eq!(study.parts[0].comparisons.len(), 3);
    assert!(study.parts[0].comparisons[1].curves.iter().all(|curve| !curve.points.is_empty()));
    study::write(&out, &study).unwrap();
    assert!(folder.text("index.html").contains("Incomplete"));
}
