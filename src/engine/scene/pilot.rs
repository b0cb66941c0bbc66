//! A pilot: a few rounds, which tell how a picture's work is best divided ([`crate::plan::work_division`]). Nothing of it is in the
//! picture, and it depends on no seed.
//!
//! A few pixels come first, spread over the picture and as small as the picture's own. They tell how much each part of the light varies
//! from path to path, from shadow ray to shadow ray, and with the photons. Where the run takes long enough, all pixels follow: they show
//! rare light, and which tiles vary most.

use glam::DVec3;

use super::{SceneFilm, View, light, trial};
use crate::constants::PART_COUNT;
use crate::engine;
use crate::engine::{Control, bias_batches};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::plan::film::BiasPlan;
use crate::plan::radius::RadiusFrom;
use crate::plan::scene::{LightOf, ScenePlan};
use crate::plan::sensor::Sensor;
use crate::plan::work_division::{Division, Free, MOST_PHOTONS, MOST_SAMPLES, MapVariance, Rounds, Variance, best, cost};
use crate::scene::Scene;
use crate::settings::scene::{SAMPLES_PER_BLOCK, SceneSettings};
use crate::settings::stop::{Measure, Stop};
use crate::settings::tile_samples::{MAX_SAMPLES, TILE, TileSamples};

/// Pixels at most: of so many all that is known is kept.
const PIXELS: f64 = 1024.0;
/// Paths through each, as many as a block of a run has at least: they are even over it, and vary less than if each was alone.
const SAMPLES: u32 = SAMPLES_PER_BLOCK;
const ROUNDS: u32 = 16;
/// Of each map, and those within the first radius, which is wider than in a run: the bias stands out.
const PHOTONS: u32 = 1 << 12;
const NEIGHBOURS: u32 = 4;
const MANY_SHADOW_RAYS: u32 = 4;
const SEED: u64 = 0x0070_696c_6f74;
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
    let of_many = parts(gpu, scene, view, plan, many)?;
    let of_one = if casts_shadow_rays { parts(gpu, scene, view, plan, 1)? } else { of_many };
    // What is seen, straight or over mirrors and glass, is found anew by each path; light from maps varies with the photons.
    let of_paths = |part: usize| match casts_shadow_rays {
        true => Variance::of_paths(of_one.variance[part], of_many.variance[part], many),
        false => Variance { path: of_many.variance[part], ..Variance::default() },
    };
    let of_map = |part: usize, caustic_only: bool| {
        let Some(map) = plan.maps().find(|map| map.caustic_only == caustic_only) else { return MapVariance::default() };
        let found = 0.5 * (of_one.variance[part] + of_many.variance[part]);
        MapVariance {
            of_round: found,
            photons: PHOTONS,
            neighbours: NEIGHBOURS,
            share: of_many.light[part],
            bias: None,
            is_radius_set: map.radius_from == RadiusFrom::User,
        }
    };
    let (direct, specular, caustic, global) = (of_paths(0), of_paths(1), of_map(2, true), of_map(3, false));
    let variance = Variance { path: direct.path + specular.path, shadow_ray: direct.shadow_ray + specular.shadow_ray, global, caustic };
    let before = Division::of(settings);
    let of_before = |map: &MapVariance, photons: u32| map.of_first_round(photons, before.neighbours);
    let varies = |of: Variance| of.path + of.shadow_ray / f64::from(before.shadow_rays);
    let parts = [varies(direct), varies(specular), of_before(&caustic, before.caustic_photons), of_before(&global, before.photons)];
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
        // The more a run takes, the more of its pilot is worth its while: that is known better each time.
        let mut count = PICTURE_ROUNDS;
        loop {
            let first = best(&rounds, before, free, &settings.stop, (MOST_SAMPLES, at_once));
            let fits = picture_rounds(plan, first, &rounds) * if found.is_none() { LEAST_PICTURE } else { 1.0 };
            if fits < f64::from(count) || count > MOST_PICTURE_ROUNDS {
                break;
            }
            let Some(seen) = of_picture(gpu, scene, view, plan, first.shadow_rays, count)? else { break };
            let known = &mut rounds.variance;
            known.shadow_ray = known.shadow_ray.min(seen.paths * f64::from(first.shadow_rays));
            known.path = seen.paths - known.shadow_ray / f64::from(first.shadow_rays);
            for (map, of_light) in [&mut known.global, &mut known.caustic].into_iter().zip(seen.maps) {
                let [variance, share, bias] = of_light;
                (map.of_round, map.share, map.bias) = (variance, share, (bias > 0.0).then_some(bias));
            }
            found = Some(seen.tiles);
            count *= 4;
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
    Ok(Some(Pilot { before, chosen, tiles, rounds, of_parts: parts.map(|part| part / all) }))
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

/// Pixels that tell enough of a map, whose light varies little from one to the next.
const PIXELS_OF_MAP: f64 = 4096.0;

/// What all pixels tell, relative to all light.
struct OfPicture {
    /// The variance of a path, and that of each tile over their mean.
    paths: f64,
    tiles: Vec<f64>,
    /// Of the global and of the caustic map: the variance of a round, the light, and the bias of this light, 0 where it is not known.
    maps: [[f64; 3]; 2],
}

/// Rounds of all pixels that are worth their while in a run so far as it is known.
fn picture_rounds(run: &ScenePlan, first: Division, rounds: &Rounds) -> f64 {
    let stop = &run.settings.stop;
    let seconds = stop.seconds.map_or(f64::INFINITY, |most| 1e9 * most);
    let goal = stop.error.map_or(f64::INFINITY, |error| rounds.until(first, error).1).min(seconds);
    let maps = run.maps().count() as f64;
    let paths = (f64::from(SAMPLES) + maps) * (rounds.cost.paths + f64::from(first.shadow_rays) * rounds.cost.shadow_rays);
    PICTURE_SHARE * goal / (paths + maps * f64::from(PHOTONS) * rounds.cost.photon)
}

/// `None` where nothing varies.
fn of_picture(gpu: &Gpu, scene: &Scene, view: &View, run: &ScenePlan, shadow_rays: u32, rounds: u32) -> Result<Option<OfPicture>> {
    let maps: Vec<LightOf> = run.maps().map(|map| if map.caustic_only { LightOf::CausticMap } else { LightOf::GlobalMap }).collect();
    let look = |light_of: LightOf, samples: u32| {
        let settings = SceneSettings { samples, shadow_rays, rounds, seed: bias_batches::seed(SEED, 1), ..pilot_settings(&run.settings) };
        let (sensor, footprint) = match (light_of, run.sensor) {
            (LightOf::GlobalMap | LightOf::CausticMap, Sensor::Picture { width, height }) => fewer(width, height, PIXELS_OF_MAP),
            _ => (run.sensor, 1.0),
        };
        let mut plan = trial::plan(gpu, scene, view, &settings, sensor)?;
        (plan.light_of, plan.footprint) = (light_of, footprint);
        Ok(light(gpu, view, plan, &mut Control::default())?.film)
    };
    let mean = |film: &SceneFilm| film.surface_means().map(DVec3::element_sum).sum::<f64>() / film.pixels() as f64;
    // Of a round's light.
    let square = |film: &SceneFilm| {
        let all = (0..film.pixels()).map(|pixel| film.surface_error(pixel).length_squared()).sum::<f64>();
        all / film.pixels() as f64 * f64::from(film.rounds)
    };
    let of_paths = look(LightOf::Paths, SAMPLES)?;
    let mut of_maps = [[0.0; 3]; 2];
    for map in maps {
        let film = look(map, 1)?;
        let bias = film.error(run.settings.stop.confidence).bias.filter(|bias| bias.lower > 0.0).map_or(0.0, |bias| bias.relative);
        of_maps[usize::from(map == LightOf::CausticMap)] = [square(&film), mean(&film), bias];
    }
    let all = mean(&of_paths) + of_maps[0][1] + of_maps[1][1];
    if all <= 0.0 {
        return Ok(None);
    }
    let (width, height) = run.sensor.size();
    let columns = width.div_ceil(TILE);
    let mut tiles = vec![(0.0, 0u32); (columns * height.div_ceil(TILE)) as usize];
    for pixel in 0..of_paths.pixels() {
        let (x, y) = (pixel as u32 % width, pixel as u32 / width);
        let (variance, count) = &mut tiles[(y / TILE * columns + x / TILE) as usize];
        *variance += of_paths.surface_error(pixel).length_squared();
        *count += 1;
    }
    let sum = tiles.iter().map(|(variance, _)| variance).sum::<f64>() / of_paths.pixels() as f64;
    if sum == 0.0 {
        return Ok(None);
    }
    // The mean of three channels.
    let relative = |square: f64| 3.0 * square / (all * all);
    Ok(Some(OfPicture {
        paths: f64::from(SAMPLES) * relative(square(&of_paths)),
        tiles: tiles.into_iter().map(|(variance, count)| variance / f64::from(count) / sum).collect(),
        maps: of_maps.map(|[variance, light, bias]| [relative(variance), light / all, bias]),
    }))
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

/// What a round's parts are like: the variance of a path's light, or of a map's, and the light itself, relative to all light.
#[derive(Clone, Copy)]
struct Parts {
    variance: [f64; PART_COUNT as usize],
    light: [f64; PART_COUNT as usize],
    /// What one pixel may have of light that its only path has missed, relative to the light of a pixel.
    unseen: f64,
}

/// Settings that all rounds of a pilot have.
fn pilot_settings(run: &SceneSettings) -> SceneSettings {
    SceneSettings {
        tiles: None,
        photons: PHOTONS,
        caustic_photons: PHOTONS,
        neighbours: NEIGHBOURS,
        block: Some(1),
        // The radii stay those of the first round.
        alpha: 1.0,
        stop: Stop { measure: Measure::Rmse, ..Stop::default() },
        ..run.clone()
    }
}

/// About so many pixels at most, spread over a picture, and the side of each over that between two.
fn fewer(width: u32, height: u32, pixels: f64) -> (Sensor, f64) {
    let smaller = (pixels / (f64::from(width) * f64::from(height))).sqrt().min(1.0);
    let length = |length: u32| ((f64::from(length) * smaller) as u32).max(1);
    (Sensor::Picture { width: length(width), height: length(height) }, f64::from(length(width)) / f64::from(width))
}

/// Of a path through each pixel with so many shadow rays.
fn parts(gpu: &Gpu, scene: &Scene, view: &View, run: &ScenePlan, shadow_rays: u32) -> Result<Parts> {
    let seed = bias_batches::seed(SEED, 0);
    let settings = SceneSettings { samples: SAMPLES, shadow_rays, rounds: ROUNDS, seed, ..pilot_settings(&run.settings) };
    let (sensor, phases, footprint) = match run.sensor {
        Sensor::Picture { width, height } => {
            let (sensor, footprint) = fewer(width, height, PIXELS);
            (sensor, Vec::new(), footprint)
        }
        Sensor::Receivers { .. } => {
            let all = &view.phases[0];
            let some: Vec<_> = all.iter().step_by(all.len().div_ceil(PIXELS as usize)).copied().collect();
            (Sensor::Receivers { count: some.len() as u32 }, vec![some], 1.0)
        }
    };
    let view = View { phases: &phases, ..*view };
    let mut plan = trial::plan(gpu, scene, &view, &settings, sensor)?;
    plan.footprint = footprint;
    let samples = plan.samples();
    let lit = light(gpu, &view, plan, &mut Control::default())?;
    let error = lit.film.error(settings.stop.confidence);
    let of_round = error.noise * error.noise * f64::from(lit.film.rounds);
    let [direct, specular, caustic, indirect] = error.places.map_or([0.0; PART_COUNT as usize], |places| places.of_parts);
    let of_path = f64::from(samples) * of_round;
    let of_unseen = f64::from(samples) * f64::from(lit.film.rounds) * (lit.film.pixels() as f64).sqrt();
    let light: Vec<f64> = lit.film.part_totals.iter().map(|total| *total as f64).collect();
    // Without lamps and sky that are seen straight.
    let surfaces = lit.film.of_surfaces.as_ref().unwrap_or(&lit.film.of_blocks);
    let all = surfaces.sums.iter().map(|sum| *sum as f64).sum::<f64>().max(1.0);
    Ok(Parts {
        variance: [direct * of_path, specular * of_path, caustic * of_round, indirect * of_round],
        light: std::array::from_fn(|part| light[part] / all),
        unseen: error.unseen * of_unseen,
    })
}
