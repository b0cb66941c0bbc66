//! Cost and memory over the number of photons and of triangles.

use serde::Serialize;

use super::Lab;
use super::pass::rounds_of;
use super::room::DROPPED;
use super::scene::{self, Job};
use crate::engine::Control;
use crate::engine::room::{self, RunResult};
use crate::error::{Error, Result};
use crate::rng::Rng;
use crate::scene::geometry::Geometry;
use crate::scene::open_box::open_box;
use crate::scene::{Mesh, Scene, built_in};
use crate::settings::scene::SceneSettings;
use crate::settings::{Builder, RoomSettings};
use crate::timings::Spread;

/// A size and what it cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// Photons of the run, or triangles of the scene.
    pub size: u64,
    /// Of the whole run, or of a round of the scene.
    pub passes: Vec<PassTime>,
    pub peak_bytes: u64,
    /// What the plan says beforehand.
    pub stated_bytes: u64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PassTime {
    pub pass: String,
    pub ms: Spread,
}

/// Cost over size of one pass.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Growth {
    pub pass: String,
    /// Of sizes from this one on: smaller ones cost what a launch does.
    pub from: u64,
    /// Time goes with size to this power.
    pub power: Slope,
    /// Root mean square of what that law is off by, relative; and what time = a + b log(size) is off by.
    pub power_off: f64,
    pub logarithm_off: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// What is counted.
    pub over: &'static str,
    pub steps: Vec<Step>,
    pub growth: Vec<Growth>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scale {
    pub series: Vec<Series>,
}

/// Sizes for which no time was left are named in `left_out`.
pub fn measure(lab: &mut Lab, left_out: &mut Vec<String>) -> Result<Scale> {
    let photons = over_photons(lab, left_out)?;
    let triangles = over_triangles(lab, left_out)?;
    let series = vec![Series::new("photons", photons, LAUNCH_SHARE), Series::new("triangles", triangles, 0.0)];
    for step in series.iter().flat_map(|series| &series.steps) {
        assert!(step.peak_bytes <= step.stated_bytes, "{} bytes taken, {} stated", step.peak_bytes, step.stated_bytes);
    }
    Ok(Scale { series })
}

/// Time over that of the smallest size below which a size says more of launches than of photons.
const LAUNCH_SHARE: f64 = 4.0;

impl Series {
    fn new(over: &'static str, steps: Vec<Step>, launch_share: f64) -> Series {
        let names: Vec<&String> = steps.first().map(|step| step.passes.iter().map(|pass| &pass.pass).collect()).unwrap_or_default();
        let growth = names
            .into_iter()
            .filter_map(|name| {
                let points: Vec<(f64, f64)> = steps
                    .iter()
                    .filter_map(|step| {
                        let pass = step.passes.iter().find(|pass| pass.pass == *name)?;
                        Some((step.size as f64, pass.ms.median))
                    })
                    .collect();
                let least = launch_share * points.first()?.1;
                let grown = points.iter().position(|point| point.1 >= least).unwrap_or(0);
                // A line through two points says nothing of its own error.
                let counted = &points[grown.min(points.len().saturating_sub(3))..];
                Some(Growth {
                    pass: name.clone(),
                    from: counted.first()?.0 as u64,
                    power: power_law(counted)?,
                    power_off: power_law_off(counted)?,
                    logarithm_off: logarithm_off(counted)?,
                })
            })
            .collect();
        Series { over, steps, growth }
    }
}

/// Photons of a round, at most.
const ROUND_ON_CARD: u64 = 10_000_000;
const ROUND_ON_CPU: u64 = 1_000_000;
/// Repetitions of a size, as long as they have no more rounds in all.
const REPEATS: u32 = 5;
const MOST_ROUNDS_ON_CARD: u32 = 500;
const MOST_ROUNDS_ON_CPU: u32 = 5;

fn over_photons(lab: &mut Lab, left_out: &mut Vec<String>) -> Result<Vec<Step>> {
    let decades = if lab.is_cpu() { lab.choose(3..=6, 3..=7, 3..=7) } else { lab.choose(5..=8, 5..=8, 5..=10) };
    let (most, most_rounds) = if lab.is_cpu() { (ROUND_ON_CPU, MOST_ROUNDS_ON_CPU) } else { (ROUND_ON_CARD, MOST_ROUNDS_ON_CARD) };
    let mut steps = Vec::new();
    for size in decades.map(|decade| 10u64.pow(decade)) {
        lab.go_on()?;
        if lab.is_late() {
            left_out.push(format!("{size} photons: no --time left"));
            continue;
        }
        (lab.tell)(&format!("{size} photons"));
        let photons = size.min(most) as u32;
        let settings =
            RoomSettings { builder: Builder::Ballot, photons, rng: Rng::Philox, radius: 0.01, mesh: 16, ..RoomSettings::default() };
        let run = |rounds: u32| -> Result<RunResult> {
            let control = &mut Control::quiet(lab.cancelled);
            let outcome = room::on_gpu(lab.gpu, &open_box(&settings), &RoomSettings { rounds, ..settings.clone() }, control)?;
            if outcome.is_cancelled() { Err(Error::Interrupted) } else { Ok(outcome) }
        };
        let rounds = (size / u64::from(photons)) as u32;
        let all = DROPPED + rounds * (most_rounds / rounds).clamp(1, REPEATS);
        lab.gpu.forget_peaks();
        let outcome = run(all)?;
        let scopes = rounds_of(&outcome.timings, all, DROPPED);
        let pass = |name: &str| {
            let (_, ms) = scopes.iter().find(|(scope, _)| scope == name)?;
            let sums = ms.chunks_exact(rounds as usize).map(|rounds| rounds.iter().sum()).collect();
            Spread::of(sums).map(|ms| PassTime { pass: name.to_owned(), ms })
        };
        steps.push(Step {
            size,
            passes: ["build", "index", "gather"].into_iter().filter_map(pass).collect(),
            peak_bytes: lab.gpu.held_memory().peak_device_bytes,
            stated_bytes: outcome.plan.bytes(),
        });
    }
    Ok(steps)
}

fn over_triangles(lab: &mut Lab, left_out: &mut Vec<String>) -> Result<Vec<Step>> {
    let decades = if lab.is_cpu() { lab.choose(1..=4, 1..=6, 1..=6) } else { 1..=6 };
    let mut steps = Vec::new();
    for size in decades.map(|decade| 10u32.pow(decade)) {
        lab.go_on()?;
        if lab.is_late() {
            left_out.push(format!("{size} triangles: no --time left"));
            continue;
        }
        (lab.tell)(&format!("{size} triangles"));
        let scene = ball_room(size);
        let geometry = Geometry::new(&scene)?;
        let settings = SceneSettings { photons: lab.choose(1 << 12, 1 << 15, 1 << 20), ..SceneSettings::default() };
        let size = (lab.choose(32, 128, 512), lab.choose(32, 128, 512));
        let job = Job { name: "a ball in a room", scene: &scene, geometry: &geometry, size, settings };
        let timed = scene::time(lab.gpu, &lab.rates, &job, lab.cancelled)?;
        steps.push(Step {
            size: geometry.triangles.len() as u64,
            passes: timed
                .passes
                .iter()
                .filter(|pass| ["visible points", "global/trace", "global/index", "global/gather"].contains(&pass.name.as_str()))
                .map(|pass| PassTime { pass: pass.name.clone(), ms: pass.ms })
                .collect(),
            peak_bytes: timed.memory.peak_device_bytes,
            stated_bytes: timed.stated_bytes,
        });
    }
    Ok(steps)
}

/// The Cornell box with a diffuse ball in place of its blocks, of about so many triangles in all: 12, and s (s - 2) of a
/// ball of s meridians.
pub fn ball_room(triangles: u32) -> Scene {
    let mut scene = built_in::by_name("cornell").expect("it is built in");
    scene.name = "a ball in a room".to_owned();
    scene.meshes.retain(|mesh| !mesh.name.ends_with("block"));
    let segments = (1.0 + (1.0 + f64::from(triangles.saturating_sub(12))).sqrt()) / 2.0;
    if triangles > 12 {
        scene.meshes.push(Mesh::sphere("ball", glam::DVec3::new(0.5, 0.35, 0.5), 0.3, 2 * (segments.round() as u32).max(2), 0));
    }
    scene
}

/// A slope and its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Slope {
    pub value: f64,
    pub error: f64,
}

/// (slope, intercept, sum of squares left, spread of x) of y over x by least squares.
fn line(points: &[(f64, f64)]) -> Option<(f64, f64, f64, f64)> {
    if points.len() < 3 {
        return None;
    }
    let count = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0 / count, y + point.1 / count));
    let (above, below) =
        points.iter().fold((0.0, 0.0), |(above, below), point| (above + (point.0 - x) * (point.1 - y), below + (point.0 - x).powi(2)));
    let slope = above / below;
    let left = points.iter().map(|point| (point.1 - y - slope * (point.0 - x)).powi(2)).sum();
    Some((slope, y - slope * x, left, below))
}

fn logarithms(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().map(|(size, ms)| (size.ln(), ms.max(f64::MIN_POSITIVE).ln())).collect()
}

/// The power that time goes with.
pub fn power_law(points: &[(f64, f64)]) -> Option<Slope> {
    let (value, _, left, below) = line(&logarithms(points))?;
    Some(Slope { value, error: (left / (points.len() as f64 - 2.0) / below).sqrt() })
}

/// What the power law is off by: root mean square, relative.
fn power_law_off(points: &[(f64, f64)]) -> Option<f64> {
    let (slope, intercept, ..) = line(&logarithms(points))?;
    Some(off(points, |size| (intercept + slope * size.ln()).exp()))
}

/// What time = a + b log(size) is off by.
fn logarithm_off(points: &[(f64, f64)]) -> Option<f64> {
    let (slope, intercept, ..) = line(&points.iter().map(|(size, ms)| (size.ln(), *ms)).collect::<Vec<_>>())?;
    Some(off(points, |size| intercept + slope * size.ln()))
}

fn off(points: &[(f64, f64)], law: impl Fn(f64) -> f64) -> f64 {
    (points.iter().map(|(size, ms)| (law(*size) / ms - 1.0).powi(2)).sum::<f64>() / points.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fits_find_the_laws_that_were_put_in() {
        for exponent in [0.0, 0.5, 1.0, 2.0] {
            let points: Vec<(f64, f64)> = (3..9).map(|decade| 10f64.powi(decade)).map(|size| (size, 7.0 * size.powf(exponent))).collect();
            let found = power_law(&points).unwrap();
            assert!((found.value - exponent).abs() < 1e-9 && found.error < 1e-6, "{exponent}: {found:?}");
            assert!(power_law_off(&points).unwrap() < 1e-6);
        }
        // One per cent of noise, up and down in turn: the slope's stated error holds what it is off by.
        let noisy = |k: i32| (10f64.powi(k), 10f64.powi(k) * if k % 2 == 0 { 1.01 } else { 0.99 });
        let found = power_law(&(3..11).map(noisy).collect::<Vec<_>>()).unwrap();
        assert!((found.value - 1.0).abs() < 3.0 * found.error && (1e-4..1e-2).contains(&found.error), "{found:?}");
        let logarithmic: Vec<(f64, f64)> = (1..7).map(|k| (10f64.powi(k), 2.0 + 3.0 * f64::from(k))).collect();
        assert!(logarithm_off(&logarithmic).unwrap() < 1e-9 && power_law_off(&logarithmic).unwrap() > 0.02);
        assert_eq!(power_law(&[(1.0, 1.0), (2.0, 2.0)]), None, "two points make any line");
    }

    #[test]
    fn launches_do_not_count_as_growth() {
        let step = |decade: u32| {
            let size = 10u64.pow(decade);
            let ms = Spread::of(vec![1.0 + 1e-4 * size as f64]).unwrap();
            Step { size, passes: vec![PassTime { pass: "build".to_owned(), ms }], peak_bytes: 1, stated_bytes: 1 }
        };
        let series = Series::new("photons", (1..9).map(step).collect(), LAUNCH_SHARE);
        assert_eq!(series.growth[0].from, 100_000);
        assert!((series.growth[0].power.value - 1.0).abs() < 0.03, "{:?}", series.growth);
    }

    #[test]
    fn balls_have_about_as_many_triangles_as_are_asked_for() {
        assert_eq!(ball_room(10).triangle_count(), 12);
        for wanted in [100, 1000, 10_000, 250_000] {
            let found = ball_room(wanted).triangle_count();
            assert!((found as f64 / f64::from(wanted)).ln().abs() < 0.25, "{found} instead of {wanted}");
            let scene = ball_room(wanted);
            let ball = scene.meshes.last().unwrap();
            let meridians = (1.0 + (1.0 + ball.triangles.len() as f64).sqrt()).round() as usize;
            assert_eq!(ball.triangles.len(), meridians * (meridians - 2));
        }
    }
}
