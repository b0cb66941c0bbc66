//! Cost and memory over the number of photons and of triangles.

use std::ops::RangeInclusive;

use serde::Serialize;

use super::Lab;
use super::pass::rounds_of;
use super::room::{self, DROPPED};
use super::scene::{self, Job};
use crate::error::Result;
use crate::measure::line_fit::LineFit;
use crate::render::{Observer, PreparedScene};
use crate::rng::Rng;
use crate::scene::{Mesh, Scene, built_in};
use crate::settings::scene::SceneSettings;
use crate::settings::{Builder, RoomSettings};
use crate::timings::Spread;

/// A size and what it cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Step {
    /// Photons of the run, or triangles of the scene.
    pub size: u64,
    /// Of the whole run, or of a round of the scene.
    pub passes: Vec<PassTime>,
    pub peak_bytes: u64,
    /// What the plan says beforehand.
    pub stated_bytes: u64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct PassTime {
    pub pass: String,
    pub ms: Spread,
}

/// Cost over size of one pass.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Growth {
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
pub(crate) struct Series {
    /// What is counted.
    pub over: &'static str,
    pub steps: Vec<Step>,
    pub growth: Vec<Growth>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Scale {
    pub series: Vec<Series>,
}

/// Sizes for which no time was left are named in `left_out`.
pub(crate) fn measure(lab: &mut Lab, left_out: &mut Vec<String>) -> Result<Scale> {
    let photons = if lab.is_cpu() { lab.choose(3..=6, 3..=7, 3..=7) } else { lab.choose(5..=8, 5..=8, 5..=10) };
    let triangles = if lab.is_cpu() { lab.choose(1..=4, 1..=6, 1..=6) } else { 1..=6 };
    let photons = steps(lab, left_out, "photons", photons, of_photons)?;
    let triangles = steps(lab, left_out, "triangles", triangles, of_triangles)?;
    let series = vec![Series::new("photons", photons, LAUNCH_SHARE), Series::new("triangles", triangles, 0.0)];
    for step in series.iter().flat_map(|series| &series.steps) {
        assert!(step.peak_bytes <= step.stated_bytes, "{} bytes taken, {} stated", step.peak_bytes, step.stated_bytes);
    }
    Ok(Scale { series })
}

/// One for each power of ten.
fn steps(
    lab: &mut Lab,
    left_out: &mut Vec<String>,
    over: &str,
    decades: RangeInclusive<u32>,
    measure: fn(&Lab, u64) -> Result<Step>,
) -> Result<Vec<Step>> {
    let mut steps = Vec::new();
    for size in decades.map(|decade| 10u64.pow(decade)) {
        lab.go_on()?;
        if lab.is_late() {
            left_out.push(format!("{size} {over}: no --time left"));
            continue;
        }
        (lab.report)(&format!("{size} {over}"));
        steps.push(measure(lab, size)?);
    }
    Ok(steps)
}

/// Time over that of the smallest size below which a size says more of launches than of photons.
const LAUNCH_SHARE: f64 = 4.0;

impl Series {
    fn new(over: &'static str, steps: Vec<Step>, launch_share: f64) -> Series {
        let passes = steps.first().map_or(&[][..], |step| &step.passes);
        let growth = passes.iter().filter_map(|PassTime { pass, .. }| {
            let times = times_of(&steps, pass);
            let least = launch_share * times.first()?.1;
            let grown = times.iter().position(|(_, ms)| *ms >= least).unwrap_or(0);
            Growth::of(pass, &times[grown.min(times.len().saturating_sub(LEAST_POINTS))..])
        });
        Series { over, growth: growth.collect(), steps }
    }
}

/// Sizes and milliseconds of a pass.
pub(crate) fn times_of(steps: &[Step], pass: &str) -> Vec<(f64, f64)> {
    let time = |step: &Step| Some((step.size as f64, step.passes.iter().find(|known| known.pass == pass)?.ms.median));
    steps.iter().filter_map(time).collect()
}

/// A line through two points says nothing of its own error.
const LEAST_POINTS: usize = 3;

impl Growth {
    /// By sizes and milliseconds; `None` of too few.
    fn of(pass: &str, times: &[(f64, f64)]) -> Option<Growth> {
        let power = LineFit::of_logarithms(times)?;
        let logarithm = LineFit::of(&times.iter().map(|(size, ms)| (size.ln(), *ms)).collect::<Vec<_>>())?;
        let off = |law: &dyn Fn(f64) -> f64| {
            let squares = times.iter().map(|(size, ms)| (law(*size) / ms - 1.0).powi(2));
            (squares.sum::<f64>() / times.len() as f64).sqrt()
        };
        (times.len() >= LEAST_POINTS).then(|| Growth {
            pass: pass.to_owned(),
            from: times[0].0 as u64,
            power: Slope { value: power.slope, error: power.slope_error },
            power_off: off(&|size| power.at(size.ln()).exp()),
            logarithm_off: off(&|size| logarithm.at(size.ln())),
        })
    }
}

/// Photons of a round, at most.
const ROUND_ON_CARD: u64 = 10_000_000;
const ROUND_ON_CPU: u64 = 1_000_000;
/// Repetitions of a size, as long as they have no more rounds in all.
const REPEATS: u32 = 5;
const MOST_ROUNDS_ON_CARD: u32 = 500;
const MOST_ROUNDS_ON_CPU: u32 = 5;

fn of_photons(lab: &Lab, size: u64) -> Result<Step> {
    let (most, most_rounds) = if lab.is_cpu() { (ROUND_ON_CPU, MOST_ROUNDS_ON_CPU) } else { (ROUND_ON_CARD, MOST_ROUNDS_ON_CARD) };
    let photons = size.min(most) as u32;
    let rounds = (size / u64::from(photons)) as u32;
    let all = DROPPED + rounds * (most_rounds / rounds).clamp(1, REPEATS);
    let settings = RoomSettings {
        builder: Builder::Ballot,
        photons,
        rounds: all,
        rng: Rng::Philox,
        radius: 0.01,
        mesh: 16,
        ..RoomSettings::default()
    };
    lab.gpu.forget_peaks();
    let result = room::run_once(lab.gpu, &settings, lab.cancelled)?;
    let scopes = rounds_of(&result.timings, all, DROPPED);
    let pass = |name: &str| {
        let (_, ms) = scopes.iter().find(|(scope, _)| scope == name)?;
        let sums = ms.chunks_exact(rounds as usize).map(|rounds| rounds.iter().sum()).collect();
        Spread::of(sums).map(|ms| PassTime { pass: name.to_owned(), ms })
    };
    Ok(Step {
        size,
        passes: ["build", "index", "gather"].into_iter().filter_map(pass).collect(),
        peak_bytes: lab.gpu.held_memory().peak_device_bytes,
        stated_bytes: result.plan.bytes(),
    })
}

fn of_triangles(lab: &Lab, size: u64) -> Result<Step> {
    let scene = PreparedScene::new(ball_room(size as u32));
    let settings = SceneSettings { photons: lab.choose(1 << 12, 1 << 15, 1 << 20), block: Some(1), ..SceneSettings::default() };
    let job = Job { name: BALL_ROOM, scene: &scene, size: lab.image_size(), settings };
    let timed = scene::time(lab.gpu, &lab.rates, &job, lab.cancelled)?;
    let shown = ["visible points", "global/trace", "global/index", "global/gather"];
    let passes = timed.passes.iter().filter(|pass| shown.contains(&pass.name.as_str()));
    Ok(Step {
        size: scene.geometry(&Observer::default())?.triangles.len() as u64,
        passes: passes.map(|pass| PassTime { pass: pass.name.clone(), ms: pass.ms }).collect(),
        peak_bytes: timed.memory.peak_device_bytes,
        stated_bytes: timed.stated_bytes,
    })
}

pub(crate) const BALL_ROOM: &str = "a ball in a room";

/// The Cornell box with a diffuse ball in place of its blocks, of about so many triangles in all: 12, and s (s - 2) of a
/// ball of s meridians.
pub(crate) fn ball_room(triangles: u32) -> Scene {
    let mut scene = built_in::by_name("cornell").expect("it is built in");
    scene.name = BALL_ROOM.to_owned();
    scene.meshes.retain(|mesh| !mesh.name.ends_with("block"));
    let segments = (1.0 + (1.0 + f64::from(triangles.saturating_sub(12))).sqrt()) / 2.0;
    if triangles > 12 {
        scene.meshes.push(Mesh::sphere("ball", glam::DVec3::new(0.5, 0.35, 0.5), 0.3, 2 * (segments.round() as u32).max(2), 0));
    }
    scene
}

/// A slope and its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Slope {
    pub value: f64,
    pub error: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fits_find_the_laws_that_were_put_in() {
        let decades = |from: i32, to: i32| (from..to).map(|decade| 10f64.powi(decade));
        let growth = |times: &[(f64, f64)]| Growth::of("build", times);
        for exponent in [0.0, 0.5, 1.0, 2.0] {
            let found = growth(&decades(3, 9).map(|size| (size, 7.0 * size.powf(exponent))).collect::<Vec<_>>()).unwrap();
            assert!((found.power.value - exponent).abs() < 1e-9 && found.power.error < 1e-6, "{exponent}: {found:?}");
            assert!(found.power_off < 1e-6);
        }
        // One per cent of noise, up and down in turn: the slope's stated error holds what it is off by.
        let noisy = |(k, size): (usize, f64)| (size, size * if k % 2 == 0 { 0.99 } else { 1.01 });
        let found = growth(&decades(3, 11).enumerate().map(noisy).collect::<Vec<_>>()).unwrap().power;
        assert!((found.value - 1.0).abs() < 3.0 * found.error && (1e-4..1e-2).contains(&found.error), "{found:?}");
        let logarithmic = growth(&decades(1, 7).map(|size| (size, 2.0 + 3.0 * size.log10())).collect::<Vec<_>>()).unwrap();
        assert!(logarithmic.logarithm_off < 1e-9 && logarithmic.power_off > 0.02);
        assert_eq!(growth(&[(1.0, 1.0), (2.0, 2.0)]), None, "two points make any line");
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
            let scene = ball_room(wanted);
            let found = scene.triangle_count();
            assert!((found as f64 / f64::from(wanted)).ln().abs() < 0.25, "{found} instead of {wanted}");
            let ball = scene.meshes.last().unwrap();
            let meridians = (1.0 + (1.0 + ball.triangles.len() as f64).sqrt()).round() as usize;
            assert_eq!(ball.triangles.len(), meridians * (meridians - 2));
        }
    }
}
