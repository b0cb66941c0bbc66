//! `photonmill study`: points against a reference of another method, a page that loads nothing, and a study that goes on
//! where it was cut off.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use crate::common::{device, lit};
use photonmill::compaction::Agreed;
use photonmill::gpu::Gpu;
use photonmill::output::destination::Folder;
use photonmill::study::axes::Axis;
use photonmill::study::{self, Part, Request, Study};

/// Bounded by rounds alone, so that a slow machine finds the same.
fn request(scene: &str, most_rounds: u32) -> Request {
    Request {
        scene: scene.to_owned(),
        size: 6,
        photons: 2048,
        repeats: 3,
        seed: 1,
        reference_samples: 512,
        budget: Duration::from_secs(3600),
        most_rounds,
    }
}

fn run(gpu: &Gpu, folder: &Path, request: Request) -> photonmill::error::Result<Study> {
    let never = AtomicBool::new(false);
    let folder = Folder::open("--out", folder)?;
    let scene = lit::scene(&request.scene);
    let study = study::run(gpu, &scene, request, &folder, &never, &mut |_| {})?;
    study::write(&folder, &study)?;
    Ok(study)
}

fn axes_of(study: &Study) -> Vec<Axis> {
    study.parts.iter().flat_map(|part| part.comparisons.iter().map(|comparison| comparison.axis)).collect()
}

#[test]
fn the_open_box_is_studied_against_radiosity_and_goes_on_where_it_ended() {
    let Some(gpu) = device() else { return };
    let folder = tempfile::tempdir().unwrap();
    let first = run(&gpu, folder.path(), request("open-box", 2)).unwrap();
    assert!(first.complete);
    let axes = axes_of(&first);
    for axis in [
        Axis::Builder,
        Axis::Photons,
        Axis::Radius,
        Axis::Schedule,
        Axis::Kernel,
        Axis::Edges,
        Axis::Bounces,
        Axis::Randomness,
        Axis::Nearest,
        Axis::Sums,
    ] {
        assert!(axes.contains(&axis), "{axis:?} of {axes:?}");
    }
    for axis in [Axis::Arithmetic, Axis::Direct, Axis::Gather, Axis::Index, Axis::Effects, Axis::Paper] {
        assert!(axes.contains(&axis), "{axis:?} of {axes:?}");
    }
    for part in &first.parts {
        assert!(part.reference.contains("radiosity") && part.reference_error < 0.01, "{} {}", part.reference, part.reference_error);
        for curve in part.curves() {
            assert!(!curve.points.is_empty(), "{}: {}", part.quantity, curve.label);
            // Errors are those of this scene: photons neither miss the reference by half nor hit it by chance.
            for point in &curve.points {
                let error = point.error().value;
                assert!(error > 1e-4 && error < 4.0, "{}: {}: {error}", part.quantity, curve.label);
                assert_eq!(point.squared_errors.len(), 3);
            }
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

    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let page = read("index.html");
    assert!(page.contains("What accuracy costs in time") && page.contains("<svg") && !page.contains("http"));
    let count: usize = first.parts.iter().flat_map(Part::curves).map(|curve| curve.points.len()).sum();
    assert_eq!(read("points.csv").lines().count(), 1 + count);
    assert_eq!(read("points.jsonl").lines().count(), 1 + count);

    // The fastest builders, of photons that all of them agree on.
    let map = first.compaction.as_ref().unwrap();
    assert!(map.cells.len() == 5 && page.contains("Fastest builder by photon count") && read("compaction.svg").contains("persistent"));
    for cell in &map.cells {
        assert!(cell.agreed == Agreed::Photons && cell.builders.len() == 6, "{cell:?}");
        // Of photons that all go on with the same chance: s + s^2 + ... of them are stored.
        let s = f64::from(cell.survival);
        let expected = f64::from(cell.photons) * s * (1.0 - s.powi(15)) / (1.0 - s);
        let z = (cell.stored as f64 - expected) / (f64::from(cell.photons) * 10.0 * s).sqrt();
        assert!(z.abs() < 5.0, "{} stored of {expected}", cell.stored);
        assert!(cell.builders.is_sorted_by(|a, b| a.ms.median <= b.ms.median) && cell.gain() >= 1.0);
    }

    // Cut off in the middle of a line: what is whole is kept, and only the rest is measured.
    let whole = read("points.jsonl");
    let kept: Vec<&str> = whole.lines().take(1 + count / 2).collect();
    std::fs::write(folder.path().join("points.jsonl"), kept.join("\n") + "\n[\"builder\",{\"comm").unwrap();
    let second = run(&gpu, folder.path(), request("open-box", 2)).unwrap();
    assert!(second.complete);
    let points = |study: &Study| study.parts[0].comparisons[0].curves.iter().flat_map(|curve| curve.points.clone()).collect::<Vec<_>>();
    for (kept, measured) in points(&second).iter().zip(&points(&first)) {
        // A number that is read from text may be a rounding off.
        let same = kept.wall_ms.iter().zip(&measured.wall_ms).all(|(a, b)| (a - b).abs() < 1e-9 * b);
        assert!(same && kept.command == measured.command, "measured again: {kept:?} {measured:?}");
    }

    // Another study does not mix with it.
    let error = run(&gpu, folder.path(), Request { photons: 4096, ..request("open-box", 2) }).unwrap_err().to_string();
    assert!(error.starts_with("--out ") && error.contains("points.jsonl") && !error.contains('\n'), "{error}");
}

/// What is said of a picture's study.
fn sentences_of(scene: &str, rounds: u32) -> Option<String> {
    let gpu = device()?;
    let folder = tempfile::tempdir().unwrap();
    let study = run(&gpu, folder.path(), request(scene, rounds)).unwrap();
    let part = &study.parts[0];
    assert!(part.reference.contains("path tracing") && part.reference_error < 0.2, "{} {}", part.reference, part.reference_error);
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
        let folder = tempfile::tempdir().unwrap();
        let study = run(&gpu, folder.path(), request(name, 2)).unwrap();
        let part = &study.parts[0];
        assert!(part.reference.contains("closed form"), "{name}");
        let photons = part.curves().find(|curve| curve.label == "direct light from photons").unwrap().points.last().unwrap();
        assert!(photons.error().value < 0.5 && photons.bias().value < 0.2, "{name}: {:?}, bias {:?}", photons.error(), photons.bias());
        let base = part.base().unwrap().points.last().unwrap();
        // Few photons are noisy, and right on average.
        assert!(base.error().value < 0.6 && base.bias().value < 0.2, "{name}: {:?}, bias {:?}", base.error(), base.bias());
    }
}

#[test]
fn a_study_that_is_cancelled_keeps_what_it_has() {
    let Some(gpu) = device() else { return };
    let folder = tempfile::tempdir().unwrap();
    let cancelled = AtomicBool::new(false);
    let mut told = 0;
    let scene = lit::scene("open-box");
    let out = Folder::open("--out", folder.path()).unwrap();
    let study = study::run(&gpu, &scene, request("open-box", 2), &out, &cancelled, &mut |_| {
        told += 1;
        // At the third comparison.
        if told == 4 {
            cancelled.store(true, std::sync::atomic::Ordering::Relaxed);
        }
    })
    .unwrap();
    assert!(!study.complete);
    assert_eq!(study.parts[0].comparisons.len(), 3);
    assert!(study.parts[0].comparisons[1].curves.iter().all(|curve| !curve.points.is_empty()));
    study::write(&out, &study).unwrap();
    assert!(std::fs::read_to_string(folder.path().join("index.html")).unwrap().contains("Incomplete"));
}
