//! A pilot: a few rounds of a few pixels, which tell how a picture's work is best divided ([`crate::plan::work_division`]). Nothing of it
//! is in the picture, and it depends on no seed.
//!
//! Its pixels are spread over the picture and as small as the picture's own. They tell how much each part of the light varies from path to
//! path, from shadow ray to shadow ray, and with the photons.

use super::{View, light};
use crate::constants::PART_COUNT;
use crate::engine;
use crate::engine::{Control, bias_batches};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::plan::work_division::{Division, Terms, best, cost};
use crate::scene::Scene;
use crate::settings::scene::{SAMPLES_PER_BLOCK, SceneSettings};
use crate::settings::stop::{Measure, Stop};

/// Pixels at most: of so many all that is known is kept.
const PIXELS: f64 = 1024.0;
/// As many as a block of a run has at least: they are even over it, and vary less than if each was alone.
const SAMPLES: u32 = SAMPLES_PER_BLOCK;
const ROUNDS: u32 = 16;
/// Of each map.
const PHOTONS: u32 = 1 << 12;
const MANY_SHADOW_RAYS: u32 = 4;
const SEED: u64 = 0x0070_696c_6f74;
/// Blocks that a run has at least: its error is looked at first after so many.
const LEAST_BLOCKS: u32 = 16;
/// Less is no reason to do otherwise than usual: costs and variances are not known as well.
const LEAST_GAIN: f64 = 1.2;

/// What is to be chosen, as nobody has set it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Free {
    pub samples: bool,
    pub shadow_rays: bool,
}

/// What a pilot has found and chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct Pilot {
    pub before: Division,
    pub chosen: Division,
    /// Of a round: squared noise relative to the mean, by what it falls with, and nanoseconds.
    pub variance: Terms,
    pub cost: Terms,
    /// Shares of the squared noise before, of direct light, light over mirrors and glass, caustics and indirect light.
    pub of_parts: [f64; PART_COUNT as usize],
}

impl Pilot {
    /// How many times the work the error would take that the settings before have.
    pub fn gain(&self) -> f64 {
        let product = |division| self.variance.variance(division) * self.cost.cost(division);
        product(self.before) / product(self.chosen)
    }

    /// Rounds after which the noise is so large, and their nanoseconds.
    pub fn until(&self, noise: f64) -> (f64, f64) {
        let rounds = (self.variance.variance(self.chosen) / (noise * noise)).max(least_rounds(self.chosen));
        (rounds, rounds * self.cost.cost(self.chosen))
    }
}

/// Chooses samples and shadow rays of a picture for which there is a plan. `None` where nothing is to be chosen, or nothing varies.
pub fn choose(gpu: &Gpu, scene: &Scene, view: &View, plan: &ScenePlan, free: Free) -> Result<Option<Pilot>> {
    let settings = &plan.settings;
    let is_picture = matches!(plan.sensor, Sensor::Picture { .. });
    if !is_picture || !(free.samples || free.shadow_rays) {
        return Ok(None);
    }
    let casts_shadow_rays = free.shadow_rays && plan.shadow_rays() != 0;
    let many = if free.shadow_rays { MANY_SHADOW_RAYS } else { settings.shadow_rays };
    let of_many = parts(gpu, scene, view, plan, many)?;
    let of_one = if casts_shadow_rays { parts(gpu, scene, view, plan, 1)? } else { of_many };
    // What is seen, straight or over mirrors and glass, is found anew by each path; light from maps varies with the photons.
    let of_path = |part: usize| match casts_shadow_rays {
        true => Terms::of_variances(of_one[part], of_many[part], many),
        false => Terms { path: of_many[part], ..Terms::default() },
    };
    let of_map = |part: usize, caustic_only: bool| {
        let map = plan.maps().find(|map| map.caustic_only == caustic_only);
        let found = 0.5 * (of_one[part] + of_many[part]);
        map.map_or(0.0, |map| found * f64::from(PHOTONS.min(map.photons)) / f64::from(map.photons))
    };
    let (direct, specular, maps) = (of_path(0), of_path(1), [of_map(2, true), of_map(3, false)]);
    let variance =
        Terms { fixed: maps.iter().sum(), path: direct.path + specular.path, shadow_ray: direct.shadow_ray + specular.shadow_ray };
    let before = Division { samples: settings.samples, shadow_rays: settings.shadow_rays };
    let all = variance.variance(before);
    if all <= 0.0 || !all.is_finite() {
        return Ok(None);
    }
    let cost = cost(plan, gpu.facts().kind);
    let limits = engine::limits(gpu.facts());
    // In pieces no smaller than before.
    let is_possible = |division: Division| {
        let settings = with(settings, division);
        let divided = ScenePlan::with_trial(scene, view.geometry, &settings, plan.sensor, &limits, plan.trial.clone());
        let chunks = |plan: &ScenePlan| plan.maps().map(|map| map.chunk_photons).collect::<Vec<_>>();
        divided.is_ok_and(|divided| chunks(&divided) == chunks(plan))
    };
    let allowed = |division: Division| {
        let Division { samples, shadow_rays } = division;
        let is_free = (free.samples || samples == before.samples) && (free.shadow_rays || shadow_rays == before.shadow_rays);
        // A run of fewer rounds would not know its error.
        let is_needed = settings.stop.error.is_none_or(|error| variance.variance(division) >= least_rounds(division) * error * error);
        let is_in_time = settings.stop.seconds.is_none_or(|seconds| least_rounds(division) * cost.cost(division) <= 1e9 * seconds);
        is_free && (is_needed && is_in_time || samples == 1 && shadow_rays <= before.shadow_rays)
    };
    let product = |division| variance.variance(division) * cost.cost(division);
    let mut most_samples = u32::MAX;
    loop {
        let Some(mut chosen) = best(&variance, &cost, |division| allowed(division) && division.samples <= most_samples) else {
            return Ok(None);
        };
        if product(before) <= LEAST_GAIN * product(chosen) && allowed(before) {
            chosen = before;
        }
        if chosen == before || is_possible(chosen) {
            let of_parts = [direct.variance(before), specular.variance(before), maps[0], maps[1]].map(|part| part / all);
            return Ok(Some(Pilot { before, chosen, variance, cost, of_parts }));
        }
        // More than the device's buffers hold.
        most_samples = chosen.samples / 2;
    }
}

/// Rounds of so many blocks.
fn least_rounds(division: Division) -> f64 {
    f64::from(LEAST_BLOCKS * (SAMPLES_PER_BLOCK / division.samples).max(1))
}

pub fn with(settings: &SceneSettings, division: Division) -> SceneSettings {
    SceneSettings { samples: division.samples, shadow_rays: division.shadow_rays, ..settings.clone() }
}

/// The variance of each part of a round's light, of a path through each pixel with so many shadow rays, relative to the square of all light.
fn parts(gpu: &Gpu, scene: &Scene, view: &View, run: &ScenePlan, shadow_rays: u32) -> Result<[f64; PART_COUNT as usize]> {
    let settings = SceneSettings {
        samples: SAMPLES,
        shadow_rays,
        photons: PHOTONS.min(run.settings.photons),
        caustic_photons: PHOTONS.min(run.settings.caustic_photons),
        rounds: ROUNDS,
        block: Some(1),
        seed: bias_batches::seed(SEED, 0),
        // The radii stay those of the first round.
        alpha: 1.0,
        stop: Stop { measure: Measure::Rmse, ..Stop::default() },
        ..run.settings.clone()
    };
    let (width, height) = run.sensor.size();
    let smaller = (PIXELS / (f64::from(width) * f64::from(height))).sqrt().min(1.0);
    let length = |length: u32| ((f64::from(length) * smaller) as u32).max(1);
    let sensor = Sensor::Picture { width: length(width), height: length(height) };
    let limits = engine::limits(gpu.facts());
    let mut plan = ScenePlan::with_trial(scene, view.geometry, &settings, sensor, &limits, run.trial.clone())?;
    plan.footprint = f64::from(length(width)) / f64::from(width);
    let lit = light(gpu, view, plan, &mut Control::default())?;
    let error = lit.film.error(settings.stop.confidence);
    let of_round = error.noise * error.noise * f64::from(lit.film.rounds);
    let [direct, specular, caustic, indirect] = error.places.map_or([0.0; PART_COUNT as usize], |places| places.of_parts);
    let of_path = f64::from(SAMPLES) * of_round;
    Ok([direct * of_path, specular * of_path, caustic * of_round, indirect * of_round])
}
