//! A pilot: a few rounds, which tell how a picture's work is best divided ([`crate::plan::work_division`]). Nothing of it is in the
//! picture, and it depends on no seed.
//!
//! A few pixels come first, spread over the picture and as small as the picture's own. They tell how much each part of the light varies
//! from path to path, from shadow ray to shadow ray, and with the photons. Where the run takes long enough, all pixels follow: they show
//! rare light, and which tiles vary most.

use std::cell::Cell;

use super::{View, pilot_rounds};
use super::pilot_rounds::{PHOTONS, PilotRounds, SAMPLES};
use crate::constants::PART_COUNT;
use crate::engine;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::plan::film::BiasPlan;
use crate::plan::radius::RadiusFrom;
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::plan::work_division::{Division, Free, MOST_PHOTONS, MOST_SAMPLES, MapVariance, Rounds, Variance, best, cost};
use crate::scene::Scene;
use crate::settings::scene::{SAMPLES_PER_BLOCK, SceneSettings};
use crate::settings::stop::Stop;
use crate::settings::tile_samples::{MAX_SAMPLES, TILE, TileSamples};

const MANY_SHADOW_RAYS: u32 = 4;
/// Less is no reason to do otherwise than usual: costs and variances are not known as well.
const LEAST_GAIN: f64 = 1.2;

/// What a pilot has found and chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct Pilot {
    pub before: Division,
    /// With the mean of all pixels' samples.
    pub chosen: Division,
    /// Where these differ: those that all pixels have, and the tiles that have more.
    pub tiles: Option<(u32, TileSamples)>,
    pub rounds: Rounds,
    /// Shares of the squared noise of a round before, of direct light, light over mirrors and glass, caustics and indirect light.
    pub of_parts: [f64; PART_COUNT as usize],
    /// Of the device, milliseconds; 0 where it has no clock.
    pub spent: f64,
}

impl Pilot {
    pub fn set(&self, settings: &SceneSettings) -> SceneSettings {
        let chosen = self.chosen.set(settings);
        match &self.tiles {
            Some((samples, tiles)) => SceneSettings { samples: *samples, tiles: Some(tiles.clone()), ..chosen },
            None => chosen,
        }
    }

    /// How many times as long the settings before take for the same.
    pub fn gain(&self, stop: &Stop) -> f64 {
        self.rounds.loss(self.before, stop) / self.rounds.loss(self.chosen, stop)
    }
}

/// Chooses the division of a picture's work, for whose settings there is a plan. `None` where nothing is to be chosen, or nothing varies.
pub fn choose(gpu: &Gpu, scene: &Scene, view: &View, plan: &ScenePlan, free: Free) -> Result<Option<Pilot>> {
    let settings = &plan.settings;
    if free == Free::default() {
        return Ok(None);
    }
    let casts_shadow_rays = free.shadow_rays && plan.shadow_rays() != 0;
    let many = if free.shadow_rays { MANY_SHADOW_RAYS } else { settings.shadow_rays };
    let looks = PilotRounds { gpu, scene, view, run: plan, spent: Cell::new(0.0) };
    let of_many = looks.of_few(many)?;
    let of_one = if casts_shadow_rays { looks.of_few(1)? } else { of_many };
    // What is seen, straight or over mirrors and glass, is found anew by each path; light from maps varies with the photons.
    let of_paths = |part: usize| match casts_shadow_rays {
        true => Variance::of_paths(of_one.variance[part], of_many.variance[part], many),
        false => Variance { path: of_many.variance[part], ..Variance::default() },
    };
    let at = Division::of(&pilot_rounds::settings(settings));
    let of_map = |part: usize, caustic_only: bool| {
        let Some(map) = plan.maps().find(|map| map.caustic_only == caustic_only) else { return MapVariance::default() };
        let found = 0.5 * (of_one.variance[part] + of_many.variance[part]);
        MapVariance {
            of_round: found,
            at: if caustic_only { at.caustic() } else { at.global() },
            share: of_many.light[part],
            bias: None,
            is_radius_set: map.radius_from == RadiusFrom::User,
        }
    };
    let (direct, specular, caustic, global) = (of_paths(0), of_paths(1), of_map(2, true), of_map(3, false));
    let variance = Variance { path: direct.path + specular.path, shadow_ray: direct.shadow_ray + specular.shadow_ray, global, caustic };
    let before = Division::of(settings);
    let varies = |of: Variance| of.path + of.shadow_ray / f64::from(before.shadow_rays);
    let parts = [varies(direct), varies(specular), caustic.of_first_round(before.caustic()), global.of_first_round(before.global())];
    let all: f64 = parts.iter().sum();
    if all <= 0.0 || !all.is_finite() {
        return Ok(None);
    }
    let cost = cost(plan, view.geometry.triangles.len(), gpu.facts().kind);
    let counts_bias = plan.film.bias == BiasPlan::Blocks;
    let pixels = f64::from(plan.sensor.pixels());
    let unseen = of_many.unseen / pixels.sqrt();
    let mut rounds = Rounds { variance, cost, pixels, alpha: settings.alpha, counts_bias, unseen };
    let limits = engine::limits(gpu.facts());
    let plan_of =
        |division: Division| ScenePlan::with_trial(scene, view.geometry, &division.set(settings), plan.sensor, &limits, plan.trial.clone());
    let is_possible = |division: Division| division == before || plan_of(division).is_ok();
    // As many photons as are traced at once.
    let most = Division { photons: MOST_PHOTONS, caustic_photons: MOST_PHOTONS, ..before };
    let at_once = plan_of(most).map_or(before.photons, |plan| plan.maps().map(|map| map.chunk_photons).min().unwrap_or(before.photons));
    let mut tiles = None;
    // What is to name each pixel knows of no tiles.
    if free.samples
        && !settings.paranoid
        && let Sensor::Picture { width, .. } = plan.sensor
    {
        let mut found = None;
        // The more a run takes, the more of its pilot is worth its while: that is known better each time. Each look takes its time to begin.
        let mut least = PICTURE_ROUNDS;
        while least <= MOST_PICTURE_ROUNDS {
            let first = best(&rounds, before, free, &settings.stop, (MOST_SAMPLES, at_once));
            let fits = picture_rounds(plan, first, &rounds);
            if fits * if found.is_none() { LEAST_PICTURE } else { 1.0 } < f64::from(least) {
                break;
            }
            let count = (fits.min(f64::from(MOST_PICTURE_ROUNDS)) as u32).max(least);
            let Some(seen) = looks.of_all(first.shadow_rays, count)? else { break };
            let known = &mut rounds.variance;
            known.shadow_ray = known.shadow_ray.min(seen.paths * f64::from(first.shadow_rays));
            known.path = seen.paths - known.shadow_ray / f64::from(first.shadow_rays);
            for (map, of_light) in [&mut known.global, &mut known.caustic].into_iter().zip(seen.maps) {
                let [variance, share, bias] = of_light;
                (map.of_round, map.share, map.bias) = (variance, share, (bias > 0.0).then_some(bias));
            }
            found = Some(seen.tiles);
            least = 4 * count;
        }
        // Where samples go by the root of the variance, the mean variance is the square of the mean root (Neyman 1934).
        let shares = found.map_or_else(Vec::new, |tiles| smooth(&tiles, width.div_ceil(TILE) as usize));
        let roots: Vec<f64> = shares.iter().map(|share| share.sqrt()).collect();
        let root = roots.iter().sum::<f64>() / roots.len() as f64;
        if root * root < LEAST_TILES {
            rounds.variance.path *= root * root;
            rounds.variance.shadow_ray *= root * root;
            tiles = Some(roots.into_iter().map(|own| own / root).collect::<Vec<f64>>());
        }
    }
    let mut most_samples = MOST_SAMPLES;
    let mut chosen = best(&rounds, before, free, &settings.stop, (most_samples, at_once));
    // More samples than the device's buffers hold.
    while !is_possible(chosen) {
        most_samples = chosen.samples.min(most_samples) / 2;
        chosen = if most_samples == 0 { before } else { best(&rounds, before, free, &settings.stop, (most_samples, at_once)) };
    }
    if rounds.loss(before, &settings.stop) <= LEAST_GAIN * rounds.loss(chosen, &settings.stop) {
        chosen = before;
    }
    let size = plan.sensor.size();
    // Of fewer samples a block takes more rounds, of which a short run has few.
    let is_short = rounds.expected(chosen, &settings.stop) < FEW_BLOCKS * SAMPLES_PER_BLOCK;
    let least_samples = if is_short { chosen.samples.min(SAMPLES_PER_BLOCK) } else { 1 };
    let tiles = tiles.map(|tiles| tile_samples(chosen.samples, least_samples, &tiles, size)).filter(|(_, tiles)| tiles.most() > 0);
    Ok(Some(Pilot { before, chosen, tiles, rounds, of_parts: parts.map(|part| part / all), spent: looks.spent.get() }))
}

/// Blocks that a run may do with, which wants some more than its first look takes.
const FEW_BLOCKS: u32 = 32;
/// Less than this of the variance must be left for tiles to be worth their while.
const LEAST_TILES: f64 = 0.8;
/// Rounds of all pixels with each kind of light: at first and at most, and the share of the run that these may take, at first several times
/// as much, as few pixels may have told too little of the run.
const PICTURE_ROUNDS: u32 = 4;
const MOST_PICTURE_ROUNDS: u32 = 64;
const PICTURE_SHARE: f64 = 0.05;
const LEAST_PICTURE: f64 = 4.0;
/// Of the mean variance, what a tile is taken to have that showed none.
const HIDDEN_VARIANCE: f64 = 0.1;

/// Rounds of all pixels that are worth their while in a run so far as it is known.
fn picture_rounds(run: &ScenePlan, first: Division, rounds: &Rounds) -> f64 {
    let stop = &run.settings.stop;
    let seconds = stop.seconds.map_or(f64::INFINITY, |most| 1e9 * most);
    let goal = stop.error.map_or(f64::INFINITY, |error| rounds.until(first, error).1).min(seconds);
    let maps = run.maps().count() as f64;
    let paths = (f64::from(SAMPLES) + maps) * (rounds.cost.paths + f64::from(first.shadow_rays) * rounds.cost.shadow_rays);
    PICTURE_SHARE * goal / (paths + maps * f64::from(PHOTONS) * rounds.cost.photon)
}

/// A tile's variance is little known, and rare light beside it is rare in it too: the mean of it and its neighbours.
fn smooth(shares: &[f64], columns: usize) -> Vec<f64> {
    let rows = shares.len() / columns;
    let near = |place: usize, count: usize| place.saturating_sub(1)..(place + 2).min(count);
    let at = |x: usize, y: usize| {
        let found: Vec<f64> = near(y, rows).flat_map(|y| near(x, columns).map(move |x| shares[y * columns + x])).collect();
        HIDDEN_VARIANCE + (1.0 - HIDDEN_VARIANCE) * found.iter().sum::<f64>() / found.len() as f64
    };
    (0..shares.len()).map(|tile| at(tile % columns, tile / columns)).collect()
}

/// Samples of all pixels, and how often they double in each tile, for a mean of so many and what each tile is to have of that.
fn tile_samples(mean: u32, least_samples: u32, shares: &[f64], size: (u32, u32)) -> (u32, TileSamples) {
    let least = shares.iter().copied().fold(f64::INFINITY, f64::min) * f64::from(mean);
    let samples = least.log2().round().exp2().clamp(f64::from(least_samples), f64::from(MAX_SAMPLES)) as u32;
    let most = f64::from((MAX_SAMPLES / samples).ilog2().min(9));
    let doublings = |share: &f64| (share * f64::from(mean) / f64::from(samples)).log2().round().clamp(0.0, most) as u32;
    (samples, TileSamples::new(&shares.iter().map(doublings).collect::<Vec<u32>>(), size))
}
