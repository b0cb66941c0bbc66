//! How close the settings that a pilot chooses come to the best of a search: time of the device until a run's own error, noise and bias
//! together, is small enough.
//!
//! The search tries points that lie evenly over all settings (Halton 1960), and then what differs from the best so far by a factor of 2
//! in one of them.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::Lab;
use crate::engine::scene::{self, View, pilot, trial};
use crate::engine::{Control, End, Progress};
use crate::error::Result;
use crate::plan::sensor::Sensor;
use crate::plan::work_division::{Division, Free};
use crate::scene::geometry::Geometry;
use crate::scene::{Light, LightKind, Scene, daylight};
use crate::settings::scene::{MAX_ROUNDS, SceneSettings};
use crate::settings::stop::Stop;

/// Settings that are tried, and how many of them lie evenly.
const TRIES: u32 = 64;
const EVEN_TRIES: u32 = 32;
/// Exponents of 2: paths, shadow rays, photons of both maps, and those within the first radius of both.
const RANGES: [[u32; 2]; 6] = [[0, 7], [0, 3], [13, 21], [13, 21], [2, 8], [0, 7]];
const PRIMES: [u32; 6] = [2, 3, 5, 7, 11, 13];
/// Longer than the best so far: nothing is better that takes so many times its time.
const LONGER: f64 = 1.5;
/// More is not near the best.
const NEAR: f64 = 1.5;
/// Sun of scenes without any light: degrees of its azimuth and elevation.
const SUN: [f64; 2] = [135.0, 40.0];

/// A scene, with each error.
#[derive(Debug, Clone, Serialize)]
pub struct Tuned {
    pub scene: String,
    pub size: (u32, u32),
    pub goals: Vec<Goal>,
    pub tried: Vec<Tried>,
}

#[derive(Debug, Clone, Serialize)]
pub struct Goal {
    pub error: f64,
    /// Of all that were tried.
    pub best: Option<(f64, Division)>,
    pub chosen: Chosen,
}

/// Milliseconds of the device until each error; `None` where the time was up before.
#[derive(Debug, Clone, Serialize)]
pub struct Tried {
    pub settings: Division,
    pub ms: Vec<Option<f64>>,
}

/// What a run without settings has taken, milliseconds of the device.
#[derive(Debug, Clone, Serialize)]
pub struct Chosen {
    pub settings: Division,
    pub ms: Option<f64>,
    pub pilot_ms: f64,
    /// What the pilot said the run would take.
    pub expected_ms: Option<f64>,
}

impl Goal {
    /// Time without settings, that of the pilot included, over the best that is known.
    pub fn ratio(&self) -> Option<f64> {
        let (best, _) = self.best?;
        Some((self.chosen.ms? + self.chosen.pilot_ms) / best)
    }

    /// Time of the run over what was expected.
    pub fn surprise(&self) -> Option<f64> {
        Some(self.chosen.ms? / self.chosen.expected_ms?)
    }
}

struct Search<'a> {
    scene: &'a Scene,
    geometry: Geometry,
    sensor: Sensor,
    goals: Vec<f64>,
    patience: Duration,
}

/// A scene; one without any light under a clear sky.
pub fn measure(lab: &mut Lab, scene: &Scene) -> Result<Tuned> {
    let mut scene = scene.clone();
    if !scene.is_lit() {
        let [azimuth, elevation] = SUN;
        let lights = [LightKind::Sky(Arc::new(daylight::sky(azimuth, elevation))), daylight::sun(azimuth, elevation)];
        scene.lights.extend(lights.map(|kind| Light { name: "sky".into(), kind }));
    }
    let (side, goals, seconds) = lab.choose((16, vec![0.5], 1), (96, vec![0.2, 0.1, 0.05], 30), (256, vec![0.05, 0.02, 0.01], 2));
    let sensor = Sensor::Picture { width: side, height: side };
    let search = Search { scene: &scene, geometry: Geometry::new(&scene)?, sensor, goals, patience: Duration::from_secs(seconds) };
    let mut tried: Vec<Tried> = Vec::new();
    let mut known = HashSet::new();
    let mut longest = search.patience;
    let tries = lab.choose(TRIES / 16, TRIES, TRIES);
    for number in 0..tries {
        lab.go_on()?;
        if lab.is_late() {
            break;
        }
        let next = if number < tries * EVEN_TRIES / TRIES {
            Some(evenly(number))
        } else {
            // The best for each error in turn.
            (0..search.goals.len()).map(|goal| (number as usize + goal) % search.goals.len()).find_map(|goal| {
                let (_, best) = best(&tried, goal)?;
                beside(best).find(|settings| !known.contains(settings))
            })
        };
        let Some(settings) = next else { break };
        known.insert(settings);
        (lab.tell)(&format!("{}: {} of {tries} settings", scene.name, number + 1));
        let began = Instant::now();
        let found = search.run(lab, &settings.set(&SceneSettings::default()), longest)?;
        if found.last().is_some_and(Option::is_some) {
            longest = longest.min(began.elapsed().mul_f64(LONGER));
        }
        tried.push(Tried { settings, ms: found });
    }
    let goals = (0..search.goals.len())
        .map(|goal| {
            (lab.tell)(&format!("{}: {} % without settings", scene.name, 100.0 * search.goals[goal]));
            Ok(Goal { error: search.goals[goal], best: best(&tried, goal), chosen: search.choose(lab, goal)? })
        })
        .collect::<Result<_>>()?;
    Ok(Tuned { scene: scene.name.clone(), size: (side, side), goals, tried })
}

fn best(tried: &[Tried], goal: usize) -> Option<(f64, Division)> {
    let found = tried.iter().filter_map(|tried| Some((tried.ms[goal]?, tried.settings)));
    found.min_by(|one, other| one.0.total_cmp(&other.0))
}

/// A point that lies evenly among all others.
fn evenly(number: u32) -> Division {
    let exponents: Vec<u32> = RANGES
        .into_iter()
        .zip(PRIMES)
        .map(|([least, most], prime)| least + (radical_inverse(number + 1, prime) * f64::from(most - least + 1)) as u32)
        .collect();
    division(&exponents)
}

fn division(exponents: &[u32]) -> Division {
    let [samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours] =
        std::array::from_fn(|place| 1 << exponents[place]);
    Division { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours }
}

/// What differs in one of all settings by a factor of 2.
fn beside(best: Division) -> impl Iterator<Item = Division> {
    let Division { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours } = best;
    let exponents = [samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours].map(u32::ilog2);
    // Samples and photons change more than the others.
    let order = [0, 2, 3, 4, 5, 1];
    order.into_iter().flat_map(move |place| {
        let moved = |to: u32| {
            let mut exponents = exponents;
            exponents[place] = to;
            division(&exponents)
        };
        let less = exponents[place].checked_sub(1).map(moved);
        let more = Some(exponents[place] + 1).filter(|more| *more <= RANGES[place][1] + 1).map(moved);
        less.into_iter().chain(more)
    })
}

/// Digits of a number, mirrored at the point.
fn radical_inverse(mut number: u32, base: u32) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while number > 0 {
        digit /= f64::from(base);
        value += digit * f64::from(number % base);
        number /= base;
    }
    value
}

impl Search<'_> {
    /// Milliseconds of the device until each error.
    fn run(&self, lab: &Lab, settings: &SceneSettings, longest: Duration) -> Result<Vec<Option<f64>>> {
        let stop = Stop { error: self.goals.last().copied(), seconds: Some(longest.as_secs_f64()), ..Stop::default() };
        self.until(lab, &SceneSettings { stop, rounds: MAX_ROUNDS, ..settings.clone() }, &self.goals)
    }

    fn until(&self, lab: &Lab, settings: &SceneSettings, errors: &[f64]) -> Result<Vec<Option<f64>>> {
        let camera = self.scene.first_camera();
        let view = View { geometry: &self.geometry, camera: Some(&camera), phases: &[] };
        let plan = trial::plan(lab.gpu, self.scene, &view, settings, self.sensor)?;
        let mut rounds: Vec<Option<u64>> = vec![None; errors.len()];
        let mut look = |progress: &Progress| {
            let Some(error) = progress.error else { return };
            for (_, rounds) in errors.iter().zip(&mut rounds).filter(|(wanted, _)| error <= **wanted) {
                *rounds = rounds.or(Some(progress.done));
            }
        };
        let mut control = Control { cancelled: lab.cancelled, progress: &mut look, ..Control::default() };
        let lit = scene::light(lab.gpu, &view, plan, &mut control)?.finished()?;
        if lit.end == End::Error {
            rounds.iter_mut().for_each(|of_error| *of_error = of_error.or(Some(lit.film.rounds.into())));
        }
        let ms_of_round = lit.timings.row("round").and_then(|row| Some(row.gpu_ms? / row.count as f64)).unwrap_or(f64::NAN);
        Ok(rounds.into_iter().map(|rounds| Some(rounds? as f64 * ms_of_round)).collect())
    }

    /// Without settings.
    fn choose(&self, lab: &Lab, goal: usize) -> Result<Chosen> {
        let error = self.goals[goal];
        let stop = Stop { error: Some(error), seconds: Some(3.0 * self.patience.as_secs_f64()), ..Stop::default() };
        // What there is to choose of a run with a goal, whatever its time.
        let usual = SceneSettings { stop: Stop { seconds: None, ..stop }, rounds: MAX_ROUNDS, ..SceneSettings::default() };
        let camera = self.scene.first_camera();
        let view = View { geometry: &self.geometry, camera: Some(&camera), phases: &[] };
        let plan = trial::plan(lab.gpu, self.scene, &view, &usual, self.sensor)?;
        let pilot = pilot::choose(lab.gpu, self.scene, &view, &plan, Free::ALL, lab.cancelled)?;
        let settings = pilot.as_ref().map_or_else(|| usual.clone(), |pilot| pilot.set(&usual));
        let found = self.until(lab, &SceneSettings { stop, ..settings }, &[error])?;
        Ok(Chosen {
            settings: pilot.as_ref().map_or(Division::of(&usual), |pilot| pilot.chosen),
            ms: found[0],
            pilot_ms: pilot.as_ref().map_or(0.0, |pilot| pilot.spent),
            expected_ms: pilot.map(|pilot| 1e-6 * pilot.rounds.until(pilot.chosen, error).1),
        })
    }
}

/// A line for each scene and error, and how many are near the best.
pub fn text(tuned: &[Tuned]) -> String {
    let mut text = format!(
        "{:<20} {:>6} {:>10} {:>10} {:>10} {:>7} {:>10}  best of those tried, and what was chosen: paths, shadow rays, global photons / within the first radius, caustic ones\n",
        "scene", "error", "best, ms", "chosen, ms", "pilot, ms", "ratio", "expected"
    );
    let ms = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.1}"));
    let ratio = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
    let words = |division: Division| {
        let Division { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours } = division;
        format!("{samples} {shadow_rays} {photons}/{neighbours} {caustic_photons}/{caustic_neighbours}")
    };
    for Tuned { scene, goals, .. } in tuned {
        for goal in goals {
            let Goal { error, best, chosen } = goal;
            text += &format!(
                "{scene:<20} {:>5} % {:>10} {:>10} {:>10.1} {:>7} {:>10}  {}; {}\n",
                100.0 * error,
                ms(best.map(|(ms, _)| ms)),
                ms(chosen.ms),
                chosen.pilot_ms,
                ratio(goal.ratio()),
                ms(chosen.expected_ms),
                best.map_or("-".to_owned(), |(_, best)| words(best)),
                words(chosen.settings)
            );
        }
    }
    let all = || tuned.iter().flat_map(|tuned| &tuned.goals);
    let reached = all().filter(|goal| goal.best.is_some()).count();
    let near = all().filter(|goal| goal.ratio().is_some_and(|ratio| ratio <= NEAR)).count();
    let ended = all().filter(|goal| goal.surprise().is_some()).count();
    let foreseen = all().filter_map(Goal::surprise).filter(|of| (1.0 / NEAR..=NEAR).contains(of)).count();
    text + &format!(
        "{near} of {reached} errors within {NEAR} times the best time, the pilot's own included; {foreseen} of {ended} times within a factor of {NEAR} of what was expected\n"
    )
}
