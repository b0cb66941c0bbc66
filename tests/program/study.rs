//! `photonmill study`: points against a reference of another method, a page that loads nothing, and a study that goes on
//! where it was cut off.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::common::prelude::*;
use photonmill::measure::study::axes::{Axis, Configuration};
use photonmill::measure::study::case::StudyCase;
use photonmill::measure::study::point::Point;
use photonmill::measure::study::strip::strip;
use photonmill::measure::study::{self, Part, Study, StudyRequest};
use photonmill::output::destination::Folder;

/// Bounded by rounds alone, so that a slow machine finds the same.
fn request(scene: &str, most_rounds: u32) -> StudyRequest {
    let (scene, budget) = (scene.to_owned(), Duration::from_secs(360_000));
    StudyRequest {
        scene_options: Vec::new(),
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

/// A study that is interrupted where it says a word that ends so; a whole one for a word that is never said.
fn run(gpu: &Gpu, folder: &Path, request: StudyRequest, end: &str) -> photonmill::error::Result<Study> {
    let cancelled = AtomicBool::new(false);
    let folder = Folder::open("-o", folder)?;
    let scene = scene(&request.scene);
    let mut report = |line: &str| {
        cancelled.fetch_or(line.ends_with(end), Ordering::Relaxed);
    };
    let study = study::run(gpu, &scene, request, &folder, &cancelled, &mut report)?;
    study::write(&folder, &study)?;
    Ok(study)
}

static UNCANCELLED: AtomicBool = AtomicBool::new(false);
/// What no study says.
const NEVER: &str = "never";

/// What a study measures of a scene, without measuring it.
fn case(gpu: &Gpu, request: &StudyRequest) -> StudyCase {
    StudyCase::all(gpu, &scene(&request.scene), request, &UNCANCELLED, &mut |_| {}).unwrap().remove(0)
}

/// A point of one choice among all.
fn point_of(gpu: &Gpu, case: &StudyCase, request: &StudyRequest, label: &str) -> Point {
    let mut choices = case.groups.iter().flat_map(|group| &group.configurations);
    let choice: &Configuration = choices.find(|choice| choice.label.starts_with(label)).unwrap_or_else(|| panic!("no {label}"));
    let run = |k: u32| case.run(gpu, choice, request.most_rounds, request.seed + u64::from(k), &UNCANCELLED).unwrap();
    let shots: Vec<_> = (0..request.repeats).map(|k| (run(k), Duration::ZERO)).collect();
    Point::of(&shots, &case.reference, case.command(choice, request.most_rounds, request.seed), request.most_rounds)
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

/// Until the box as triangles, of which every choice makes kernels of its own.
#[test]
fn the_open_box_is_studied_against_radiosity_and_goes_on_where_it_ended() {
    let Some((study, page)) = study_the_open_box(": default settings, to an error of 20, 10, 5, 2 and 1 %") else { return };
    assert!(!study.complete && page.contains("Incomplete") && study.parts[2].comparisons.is_empty());
}

#[test]
#[ignore = "long: every choice in the open box, minutes of compiling"]
fn the_whole_open_box_is_studied() {
    let Some((study, page)) = study_the_open_box(NEVER) else { return };
    assert!(study.complete && page.contains("Fastest builder by photon count") && !page.contains("Incomplete"));
    let of_triangles: Vec<Axis> = study.parts[2].comparisons.iter().map(|comparison| comparison.axis).collect();
    for axis in [Axis::Builder, Axis::Schedule, Axis::Kernel, Axis::Direct, Axis::Gather, Axis::Effects] {
        assert!(of_triangles.contains(&axis), "{axis:?} of {of_triangles:?}");
    }
    let strip = study.parts[0].strip.as_ref().unwrap();
    assert!(!strip.frames.is_empty() && strip.frames.iter().all(|frame| frame.error <= frame.asked && frame.size == (240, 240)));
    assert!(page.contains("data:image/png;base64,"));
    assert!(study.parts[2].default.as_ref().is_some_and(|curve| curve.points.len() == 2) && study.parts[0].default.is_none());
}

/// A study of the open box and its page, checked, after it was cut off and went on.
fn study_the_open_box(end: &str) -> Option<(Study, String)> {
    let gpu = device()?;
    let folder = Place::new();
    let request = || request("open-box", 4);
    let first = run(&gpu, folder.path(), request(), end).unwrap();
    let axes: Vec<Axis> = first.parts.iter().flat_map(|part| part.comparisons.iter().map(|comparison| comparison.axis)).collect();
    let of_light = [Axis::Builder, Axis::Photons, Axis::Radius, Axis::Nearest, Axis::Edges, Axis::Bounces, Axis::Randomness];
    for axis in of_light.into_iter().chain([Axis::Sums, Axis::Arithmetic, Axis::Index, Axis::Paper]) {
        assert!(axes.contains(&axis), "{axis:?} of {axes:?}");
    }
    for part in first.parts.iter().filter(|part| !part.comparisons.is_empty()) {
        assert!(part.reference.contains("radiosity") && part.reference_error < 0.01, "{} {}", part.reference, part.reference_error);
        assert!(part.curves().all(|(_, curve)| !curve.points.is_empty()), "{}", part.quantity);
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
    assert!(page.contains("GPU in 2008"));
    let count = first.parts.iter().flat_map(Part::points).count();
    assert_eq!(folder.text("points.csv").lines().count(), 1 + count);
    assert_eq!(folder.text("points.jsonl").lines().count(), 1 + count);

    // Cut off in the middle of a line, a quarter before the end: what is whole is kept, and only the rest is measured.
    let whole = folder.text("points.jsonl");
    let kept: Vec<&str> = whole.lines().take(1 + 3 * count / 4).collect();
    folder.write("points.jsonl", kept.join("\n") + "\n[\"builder\",{\"comm");
    let kept = kept.into_iter().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<(Axis, Point)>>();
    let mut second = run(&gpu, folder.path(), request(), end).unwrap();
    assert_eq!(second.complete, first.complete);
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
    let error = run(&gpu, folder.path(), StudyRequest { photons: 4096, ..request() }, end).unwrap_err().to_string();
    assert!(error.starts_with("-o ") && error.contains("points.jsonl") && !error.contains('\n'), "{error}");
    Some((first, page))
}

/// A picture's study, checked, with its page; interrupted where it says a word that ends so.
fn study_a_picture(scene: &str, end: &str) -> Option<(Study, String)> {
    let gpu = device()?;
    let folder = Place::new();
    let request = || request(scene, 4);
    let mut study = run(&gpu, folder.path(), request(), end).unwrap();
    let case = case(&gpu, &request());
    if study.parts[0].strip.is_none() {
        study.parts[0].strip = strip(&gpu, &case, &study.parts[0], &request(), &UNCANCELLED).unwrap();
        study::write(&Folder::open("-o", folder.path()).unwrap(), &study).unwrap();
    }
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
    assert!(!strip.frames.is_empty() && page.matches("in false colours").count() == strip.frames.len());
    let base = part.base().unwrap();
    let without = point_of(&gpu, &case, &request(), "without indirect");
    assert!(without.error().value > base.best_error(), "{} {}", without.error().value, base.best_error());
    assert!(part.sentences().join("\n").contains("the base"), "{:?}", part.sentences());
    Some((study, page))
}

/// Default settings and one axis, as the others make kernels of their own. What was measured before it was interrupted is kept.
#[test]
#[ignore = "long: a study of each kind, where the short run has the open box"]
fn a_picture_is_studied_against_path_tracing() {
    let Some((study, page)) = study_a_picture("cornell", ": photons per round") else { return };
    let [builder, photons] = &study.parts[0].comparisons[..] else { panic!("{:?}", study.parts[0].comparisons) };
    assert!(builder.curves.iter().all(|curve| !curve.points.is_empty()) && photons.curves.iter().all(|curve| curve.points.is_empty()));
    assert!(!study.complete && page.contains("Incomplete"));
}

#[test]
#[ignore = "long: every choice in two scenes, minutes of compiling"]
fn whole_pictures_are_studied_against_path_tracing() {
    for scene in ["cornell", "cornell-spheres"] {
        let Some((study, _)) = study_a_picture(scene, NEVER) else { return };
        let sentences = study.parts[0].sentences().join("\n");
        assert!(study.complete && sentences.contains("the bounce limit ends"), "{sentences}");
        assert!(scene != "cornell" || sentences.contains("with a bias of"), "{sentences}");
    }
}

const FROM_PHOTONS: (&str, f64) = ("direct light from photons", 0.5);

/// Choices with the most that their errors may be.
/// Photons on a floor below a disc; a factor forgotten would be no noise.
#[test]
fn floors_are_studied_against_their_closed_form() {
    let names = &["disc-over-plane", "furnace"][..of_run(1, 2)];
    let choices = &[FROM_PHOTONS, ("persistent, shrinking radius", 0.6)][..of_run(1, 2)];
    let Some(gpu) = device() else { return };
    for name in names {
        let request = request(name, 4);
        let case = case(&gpu, &request);
        assert!(case.reference.method.contains("closed form"), "{name}");
        // Few photons are noisy, and right on average.
        for (label, most) in choices {
            let point = point_of(&gpu, &case, &request, label);
            let (error, bias) = (point.error(), point.bias());
            assert!(error.value < *most && bias.value < 0.2, "{name}, {label}: {error:?}, bias {bias:?}");
        }
    }
}

/// A spot light and a prism: no path from the eye finds such light, so photonmill judges itself, and says so.
#[test]
#[ignore = "long: kernels of a prism, and of its long run"]
fn light_that_no_path_finds_is_studied_against_a_long_run() {
    let Some(gpu) = device() else { return };
    let reference = case(&gpu, &StudyRequest { budget: Duration::from_secs(4), ..request("prism", 1) }).reference;
    assert!(reference.method.contains("a long run of photonmill itself"), "{}", reference.method);
    // How long a second is depends on who else uses the processor.
    assert!(reference.relative_error > 0.0 && reference.values.iter().any(|value| *value > 0.0), "{reference:?}");
}
