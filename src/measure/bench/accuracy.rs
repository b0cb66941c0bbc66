//! Device time to reach a relative error. The reference comes from the path tracer ([`crate::verify::judge`]). Where that is too
//! noisy for so small an error, the reference is a long run with another seed, whose total light is checked against the
//! path tracer. Pixels that show a light source directly are excluded. In `caustic-sphere` so are pixels that show it
//! through the glass: a few thin lines hundreds of times brighter than the rest would dominate the error. The report also
//! gives the error with those pixels included.

use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};

use super::Lab;
use super::experiment::Found;
use super::scene::{self, Job, named};
use crate::engine::scene::RunResult;
use crate::error::Result;
use crate::measure::study;
use crate::measure::study::axes::{Configuration, Line};
use crate::measure::study::point::{Curve, Point};
use crate::measure::study::reference::Reference;
use crate::measure::study::subject::Subject;
use crate::plan::radius::usual_radius;
use crate::scene::geometry::Geometry;
use crate::scene::{Scene, Surface};
use crate::settings::Builder;
use crate::settings::scene::SceneSettings;
use crate::text::counted;

/// Runs of a point, each with a seed of its own.
const REPEATS: u32 = 3;
/// Seed of the first of them, and of the long run that is their reference.
const FIRST_SEED: u64 = 1;
const LONG_RUN_SEED: u64 = 1 << 20;
const MOST_DOUBLINGS: u32 = 16;
const MOST_ROUNDS: u32 = 1 << 18;
/// What a reference's own error may be, of the error that is looked for.
const REFERENCE_SHARE: f64 = 0.25;

struct Search<'a> {
    subject: &'a Subject,
    reference: Reference,
    /// Relative error.
    wanted: f64,
    /// Time for the curve of one number of photons, and for a long run.
    patience: Duration,
}

/// The shortest time to the error among several settings.
pub fn measure(lab: &mut Lab, name: &str) -> Result<Found> {
    let (mut scene, geometry) = named(name)?;
    // Square, whatever the camera asks for.
    scene.cameras.iter_mut().for_each(|camera| camera.aspect = Some(1.0));
    let (size, samples, wanted, seconds) = lab.choose((8, 1024, 0.5, 2), (32, 1024, 0.05, 20), (256, 256, 0.01, 20));
    let patience = Duration::from_secs(seconds);
    let request = study::Request {
        scene: name.to_owned(),
        size,
        photons: 1 << 12,
        repeats: REPEATS,
        seed: FIRST_SEED,
        reference_samples: samples,
        budget: patience,
        asked: Vec::new(),
        peers: Vec::new(),
        most_rounds: study::MOST_ROUNDS,
    };
    let subjects = Subject::all(lab.gpu, &scene, &request, lab.cancelled, lab.tell)?;
    let subject = &subjects[0];
    (lab.tell)(&format!("{name}: time to {} % relative RMSE", 100.0 * wanted));
    let job = |settings: SceneSettings| Job { name, scene: &scene, geometry: &geometry, size: (size, size), settings };
    let candidates = candidates(lab, name, &geometry);
    let mut search = Search { subject, reference: subject.reference.clone(), wanted, patience };
    let not_straight = search.reference.counts.clone();
    let leaves_out_images = name == "caustic-sphere";
    if leaves_out_images {
        leave_out_lamps(lab, &scene, size, &mut search.reference)?;
    }
    if search.reference.relative_error > REFERENCE_SHARE * wanted {
        let settings = SceneSettings { radius: None, alpha: 2.0 / 3.0, ..candidates[candidates.len() - 1].clone() };
        search.reference = long_run(lab, &job(settings), &search)?;
    }
    let mut best: Option<(f64, SceneSettings, u32)> = None;
    let mut closest = f64::INFINITY;
    for settings in &candidates {
        lab.go_on()?;
        let curve = search.climb(lab, settings)?;
        closest = closest.min(curve.best_error());
        // A first point that is good enough already says that no less was tried, so it counts as it is.
        let crossed = curve.time_to(wanted).map(|time| time.value);
        let at_once = curve.points.first().filter(|point| point.error().value <= wanted).map(|point| point.ms().value);
        if let Some(ms) = crossed.or(at_once).filter(|ms| best.as_ref().is_none_or(|best| *ms < best.0)) {
            best = Some((ms, settings.clone(), curve.points.last().map_or(0, |point| point.rounds)));
        }
    }
    let used = best.as_ref().map_or_else(|| candidates[0].clone(), |best| best.1.clone());
    let timed = scene::time(lab.gpu, &lab.rates, &job(used), lab.cancelled)?;
    let (seconds, how) = match best {
        Some((ms, settings, rounds)) => {
            let mut how = format!("{} % within {}: {}", 100.0 * wanted, counted(rounds, "round"), search.command(&settings, rounds));
            if leaves_out_images {
                let lit = job(settings.clone()).light(lab.gpu, SceneSettings { rounds, ..settings }, lab.cancelled)?;
                let all = Reference { counts: not_straight, ..search.reference.clone() };
                let shown = all.mean_over(|place| f64::from(u8::from(!search.reference.counts[place])));
                let error = (all.squared_error(&lit.film.values()).max(0.0) / all.mean_square()).sqrt();
                how += &format!(
                    "; excludes the {:.2} % of pixels that show the light source through glass (error with them: {:.2} %)",
                    100.0 * shown,
                    100.0 * error
                );
            }
            (1e-3 * ms, how)
        }
        None => (f64::NAN, format!("{} % at {size} x {size} was not reached; the best was {:.2} %", 100.0 * wanted, 100.0 * closest)),
    };
    let how = format!("{how}; reference: {}, own error {:.2} %", search.reference.method, 100.0 * search.reference.relative_error);
    let limit = timed.limit_of_round().map(|ms| seconds * ms / timed.round_ms);
    Ok((timed.passes, vec![(seconds, limit, how)]))
}

/// Settings that are tried. Fewer paths from the eye suffice where more rounds are needed for the photons.
fn candidates(lab: &Lab, name: &str, geometry: &Geometry) -> Vec<SceneSettings> {
    let of = |(samples, photons, caustic_photons): (u32, u32, u32), spread: f64| SceneSettings {
        samples,
        shadow_rays: 1,
        photons,
        caustic_photons,
        radius: Some(usual_radius(geometry, spread) * geometry.unit),
        alpha: 1.0,
        builder: Some(Builder::Persistent),
        block: Some(1),
        ..SceneSettings::default()
    };
    let many = match name {
        "caustic-sphere" => {
            vec![of((16, 1 << 14, 1 << 16), 16384.0), of((16, 1 << 14, 1 << 18), 16384.0), of((64, 1 << 16, 1 << 18), 65536.0)]
        }
        _ => vec![of((16, 1 << 19, 1 << 17), 262144.0), of((16, 1 << 20, 1 << 18), 262144.0), of((16, 1 << 20, 1 << 18), 131072.0)],
    };
    let few = |photons| of((4, photons, photons), f64::from(photons));
    lab.choose(vec![few(1 << 12)], vec![few(1 << 12), few(1 << 14)], many)
}

/// Leaves out pixels in which a lamp is seen, straight or in mirrors and glass: those that are not black where everything
/// else is.
fn leave_out_lamps(lab: &Lab, scene: &Scene, size: u32, reference: &mut Reference) -> Result<()> {
    let mut scene = scene.clone();
    for material in scene.materials.iter_mut().filter(|material| matches!(material.surface, Surface::Lambert)) {
        material.base_colour = Vec3::ZERO;
    }
    let geometry = Geometry::new(&scene)?;
    let settings = SceneSettings {
        samples: lab.choose(16, 64, 1024),
        shadow_rays: 1,
        photons: 1,
        caustic_photons: 1,
        rounds: 2,
        block: Some(1),
        ..SceneSettings::default()
    };
    let job = Job { name: "lamps alone", scene: &scene, geometry: &geometry, size: (size, size), settings: settings.clone() };
    let lit = job.light(lab.gpu, settings, lab.cancelled)?;
    let shows: Vec<bool> = (0..lit.film.pixels()).map(|pixel| lit.film.mean(pixel) != DVec3::ZERO).collect();
    for (place, counts) in reference.counts.iter_mut().enumerate() {
        *counts = *counts && !shows[place / 3];
    }
    *reference = reference.clone().with_own_error();
    Ok(())
}

/// A run long enough that its own noise is a small share of the error wanted, or as long as patience lasts.
fn long_run(lab: &Lab, job: &Job, search: &Search) -> Result<Reference> {
    let began = Instant::now();
    let mut rounds = 16;
    loop {
        let settings = SceneSettings { rounds, seed: LONG_RUN_SEED, ..job.settings.clone() };
        let mut reference = of_film(&job.light(lab.gpu, settings, lab.cancelled)?, &search.reference);
        let is_good = reference.relative_error <= REFERENCE_SHARE * search.wanted;
        // The next would take four times as long as all before it together.
        if is_good || 5 * began.elapsed() > 4 * search.patience || rounds >= MOST_ROUNDS {
            reference.method = format!("a run of {rounds} rounds with another seed, {}", beside(&reference, &search.reference));
            return Ok(reference);
        }
        rounds *= 4;
    }
}

/// What a run found, with its own standard errors, at the places that count for the judge.
fn of_film(lit: &RunResult, judge: &Reference) -> Reference {
    let pixels = 0..lit.film.pixels();
    let reference = Reference {
        method: String::new(),
        values: lit.film.values(),
        standard_errors: pixels.flat_map(|pixel| lit.film.standard_error(pixel).to_array()).collect(),
        counts: judge.counts.clone(),
        relative_error: 0.0,
    };
    reference.with_own_error()
}

/// How a long run differs from the judge. Of caustics of small lamps, paths know their own error badly.
fn beside(reference: &Reference, judge: &Reference) -> String {
    let total = judge.mean_over(|place| judge.values[place]);
    let places = judge.counts.iter().filter(|counts| **counts).count() as f64;
    let noise = (judge.mean_over(|place| judge.standard_errors[place].powi(2)) / places).sqrt();
    let both = |place: usize| judge.standard_errors[place].powi(2) + reference.standard_errors[place].powi(2);
    let apart = judge.mean_over(|place| (reference.values[place] - judge.values[place]).powi(2) - both(place));
    format!(
        "total light {:.4} of path tracing's (+- {:.4}), pixels differ by {:.2} % beyond noise",
        reference.mean_over(|place| reference.values[place]) / total,
        noise / total,
        100.0 * (apart.max(0.0) / judge.mean_square()).sqrt()
    )
}

fn configuration(settings: &SceneSettings) -> Configuration {
    Configuration { label: format!("{} photons per round", settings.photons), line: Line::Scene(settings.clone()) }
}

impl Search<'_> {
    /// What repeats a run.
    fn command(&self, settings: &SceneSettings, rounds: u32) -> String {
        self.subject.command(&configuration(settings), rounds, FIRST_SEED)
    }

    /// Points at rounds that double, until the error is below what is wanted or patience ends.
    fn climb(&self, lab: &Lab, settings: &SceneSettings) -> Result<Curve> {
        let configuration = configuration(settings);
        let mut curve = Curve::new(&configuration.label);
        let run = |rounds, seed| self.subject.run(lab.gpu, &configuration, rounds, seed, lab.cancelled);
        // A run that is dropped: it makes pipelines.
        run(8, FIRST_SEED)?;
        let began = Instant::now();
        for rounds in (0..=MOST_DOUBLINGS).map(|doublings| 1 << doublings) {
            let mut shots = Vec::new();
            for seed in (FIRST_SEED..).take(REPEATS as usize) {
                let began = Instant::now();
                shots.push((run(rounds, seed)?, began.elapsed()));
            }
            let point = Point::of(&shots, &self.reference, self.subject.command(&configuration, rounds, FIRST_SEED), rounds);
            let (is_good, next) = (point.error().value <= self.wanted, 2 * point.spent());
            curve.points.push(point);
            if is_good || began.elapsed() + next > self.patience || lab.is_late() {
                break;
            }
        }
        Ok(curve)
    }
}
