//! A pilot: a few rounds, which show how a picture's work is best divided ([`crate::plan::work_division`]). Nothing of it is in the
//! picture, and it depends on no seed.
//!
//! A few pixels come first, spread over the picture and as small as the picture's own. They show how much each part of the light varies
//! from path to path, from shadow ray to shadow ray, and with the photons. Where the run takes long enough, all pixels follow: they show
//! rare light, and which tiles vary most.

use std::cell::Cell;
use std::sync::atomic::AtomicBool;

use super::pilot_rounds::{FEW_SAMPLES, MANY_SAMPLES, OfImage, OfTile, PIXELS_OF_MAP, Parts, PilotRounds, SAMPLES};
use super::{Viewpoint, trial};
use crate::constants::PART_COUNT;
use crate::engine;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::plan::film::BiasPlan;
use crate::plan::radius::{MAX_DEFAULT_RADIUS, RadiusFrom, TrialRadius};
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::plan::sensor::Sensor;
use crate::plan::work_cost::{Cost, Counted, cost, pilot_size};
use crate::plan::work_division::{
    Division, FOUND_BIAS, MOST_PHOTONS, MOST_SAMPLES, MapVariance, Rounds, TunableSettings, USUAL_BIAS, USUAL_UNCERTAINTY, Variance, best,
    of_samples,
};
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
    pub(crate) before: Division,
    /// With the mean of all pixels' samples.
    pub(crate) chosen: Division,
    /// Where these differ: those that all pixels have, and the tiles that have more.
    pub tiles: Option<(u32, TileSamples)>,
    pub(crate) rounds: Rounds,
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

/// Chooses the division of the work of a run with these settings; `None` where it has no goal, too.
pub(crate) fn choose_for(
    gpu: &Gpu,
    scene: &Scene,
    viewpoint: &Viewpoint,
    settings: &SceneSettings,
    sensor: Sensor,
    tunable: TunableSettings,
    cancelled: &AtomicBool,
) -> Result<Option<Pilot>> {
    if tunable == TunableSettings::default() || !settings.stop.has_goal() {
        return Ok(None);
    }
    choose(gpu, scene, viewpoint, &trial::plan(gpu, scene, viewpoint, settings, sensor)?, tunable, cancelled)
}

/// Chooses the division of a picture's work, for whose settings there is a plan. `None` where nothing is to be chosen, or nothing varies.
pub(crate) fn choose(
    gpu: &Gpu,
    scene: &Scene,
    viewpoint: &Viewpoint,
    plan: &ScenePlan,
    tunable: TunableSettings,
    cancelled: &AtomicBool,
) -> Result<Option<Pilot>> {
    let settings = &plan.settings;
    if tunable == TunableSettings::default() {
        return Ok(None);
    }
    let many = if tunable.shadow_rays { MANY_SHADOW_RAYS } else { settings.shadow_rays };
    let kind = gpu.facts().kind;
    let looks = PilotRounds { gpu, scene, viewpoint, run: plan, size: pilot_size(kind), cancelled, spent: Cell::new(0.0) };
    let of_many = looks.of_few(many)?;
    let Some((parts, mut rounds)) = known(&looks, &of_many, None, kind) else { return Ok(None) };
    // Of a run that takes little longer than another look, paths are not distinguished from shadow rays.
    let before = Division::of(settings);
    let usual_choice = best(&rounds, before, tunable, &settings.stop, (MOST_SAMPLES, MOST_PHOTONS));
    let goal = goal_nanoseconds(&rounds, usual_choice, &settings.stop);
    if tunable.shadow_rays && plan.shadow_rays() != 0 && goal > LEAST_LOOKS * looks.cost_of_few(&rounds, many) {
        let of_one = looks.of_few(1)?;
        let Some(found) = known(&looks, &of_many, Some(&of_one), kind) else { return Ok(None) };
        rounds = found.1;
    }
    let choice = Choice::new(&looks, tunable);
    let mut tiles = None;
    // What is to name each pixel knows of no tiles.
    if tunable.samples && !settings.paranoid && matches!(plan.sensor, Sensor::Picture { .. }) {
        let found = choice.look_at_all(&mut rounds)?;
        if let Some((better, found)) = found.and_then(|found| choice.tiles(&rounds, &found)) {
            (rounds, tiles) = (better, Some(found));
        }
    }
    let best = choice.possible(&rounds);
    let is_better = rounds.loss(before, &settings.stop) > LEAST_GAIN * rounds.loss(best, &settings.stop);
    let chosen = if is_better { best } else { before };
    // Of fewer samples a block takes more rounds, of which a short run has few.
    let is_short = rounds.expected(chosen, &settings.stop) < FEW_BLOCKS * SAMPLES_PER_BLOCK;
    let least_samples = if is_short { chosen.samples.min(SAMPLES_PER_BLOCK) } else { 1 };
    let tiles = tiles
        .map(|tiles| tile_samples(chosen.samples, least_samples, &tiles.samples, plan.sensor.size()))
        .filter(|(_, tiles)| tiles.most() > 0);
    Ok(Some(Pilot { before, chosen, tiles, rounds, of_parts: parts, spent: looks.spent.get() }))
}

/// What a division is chosen from.
struct Choice<'a> {
    looks: &'a PilotRounds<'a>,
    before: Division,
    tunable: TunableSettings,
    /// As many photons as are traced at once.
    most_photons: u32,
}

impl<'a> Choice<'a> {
    fn new(looks: &'a PilotRounds<'a>, tunable: TunableSettings) -> Choice<'a> {
        let before = Division::of(&looks.run.settings);
        let all = Division { photons: MOST_PHOTONS, caustic_photons: MOST_PHOTONS, ..before };
        let at_once = |plan: ScenePlan| plan.maps().map(|map| map.chunk_photons).min().unwrap_or(before.photons);
        Choice { looks, before, tunable, most_photons: plan_of(looks, all).map_or(before.photons, at_once) }
    }

    fn stop(&self) -> &Stop {
        &self.looks.run.settings.stop
    }

    fn best(&self, rounds: &Rounds, most_samples: u32) -> Division {
        best(rounds, self.before, self.tunable, self.stop(), (most_samples, self.most_photons))
    }

    fn least_loss(&self, rounds: &Rounds) -> f64 {
        rounds.loss(self.best(rounds, MOST_SAMPLES), self.stop())
    }

    /// The best division of which the device's buffers hold all samples.
    fn possible(&self, rounds: &Rounds) -> Division {
        let mut most_samples = MOST_SAMPLES;
        loop {
            let chosen = self.best(rounds, most_samples);
            if chosen == self.before || plan_of(self.looks, chosen).is_ok() {
                return chosen;
            }
            most_samples = chosen.samples.min(most_samples) / 2;
            if most_samples == 0 {
                return self.before;
            }
        }
    }

    /// Looks at all pixels, as long as the run is worth it, and says what each tile has shown. The more a run takes, the more of its pilot is
    /// worth its while: that is known better each time. Each look takes its time to begin.
    fn look_at_all(&self, rounds: &mut Rounds) -> Result<Option<Vec<OfTile>>> {
        let mut found = None;
        let mut least = PICTURE_ROUNDS;
        while least <= MOST_PICTURE_ROUNDS {
            let first = self.best(rounds, MOST_SAMPLES);
            let fits = picture_rounds(self.looks.run, first, rounds, self.looks.size.photons);
            // What few pixels have shown may be far off.
            let (times, most) = if found.is_none() { (LEAST_PICTURE, FIRST_PICTURE_ROUNDS) } else { (1.0, MOST_PICTURE_ROUNDS) };
            if fits * times < f64::from(least) {
                break;
            }
            let count = (fits.min(f64::from(most)) as u32).max(least);
            let Some(seen) = self.looks.of_all(first.shadow_rays, count)? else { break };
            learn(&mut rounds.variance, &seen, first.shadow_rays);
            found = Some(seen.tiles);
            least = 4 * count;
        }
        Ok(found)
    }

    /// Rounds with samples by tiles, where that is worth its while. Few samples anywhere may miss rare light, so that the best of several
    /// least shares is taken.
    fn tiles(&self, even: &Rounds, found: &[OfTile]) -> Option<(Rounds, Tiles)> {
        let run = self.looks.run;
        let columns = run.sensor.size().0.div_ceil(TILE) as usize;
        let tried = LEAST_SHARES.map(|least| {
            let tiles = Tiles::of(found, columns, least);
            let rounds = tiles.rounds(even, run.constant("HAS_SPECULAR_CHAINS") != 0);
            (self.least_loss(&rounds), (rounds, tiles))
        });
        let enough = LEAST_TILES * self.least_loss(even);
        let better = tried.into_iter().filter(|(loss, _)| *loss < enough);
        better.min_by(|one, other| one.0.total_cmp(&other.0)).map(|(_, better)| better)
    }
}

/// The plan of the run with this division.
fn plan_of(looks: &PilotRounds, division: Division) -> Result<ScenePlan> {
    let PilotRounds { gpu, scene, viewpoint, run, .. } = looks;
    let limits = engine::limits(gpu.facts());
    ScenePlan::with_trial(scene, viewpoint.geometry, &division.set(&run.settings), run.sensor, &limits, run.trial.clone())
}

/// Takes over what all pixels have shown with so many shadow rays.
fn learn(known: &mut Variance, seen: &OfImage, shadow_rays: u32) {
    let of_rays = of_samples(shadow_rays);
    known.shadow_ray = known.shadow_ray.min(seen.paths / of_rays);
    known.path = seen.paths - known.shadow_ray * of_rays;
    for (which, (map, found)) in [&mut known.global, &mut known.caustic].into_iter().zip(&seen.maps).enumerate() {
        if map.at.photons == 0 {
            continue;
        }
        (map.of_round, map.sample_power, map.share) = (found.of_round, found.sample_power, found.light);
        // Little is found of it in few rounds.
        map.uncertainty = found.over_noise.map_or(USUAL_UNCERTAINTY, |found| (found * USUAL_UNCERTAINTY).sqrt());
        map.bias = USUAL_BIAS[which];
        map.learn_bias(found.bias, found.uncertainty, FOUND_BIAS[which]);
    }
}

/// What a few pixels show with many shadow rays, and with one: the parts of the noise, as shares of its square, and rounds. `None` where
/// nothing varies.
fn known(looks: &PilotRounds, of_many: &Parts, of_one: Option<&Parts>, kind: &str) -> Option<([f64; PART_COUNT as usize], Rounds)> {
    let plan = looks.run;
    let before = Division::of(&plan.settings);
    let (at, many) = (Division::of(&looks.settings()), of_many.shadow_rays);
    // What is seen, straight or over mirrors and glass, is found anew by each path; light from maps varies with the photons.
    let of_paths = |part: usize| match of_one {
        Some(of_one) => Variance::of_paths(RARE * of_one.variance[part], RARE * of_many.variance[part], many),
        // Of direct light about half.
        None if part == 0 && plan.shadow_rays() != 0 => {
            let half = 0.5 * RARE * of_many.variance[part];
            Variance { path: half, shadow_ray: half / of_samples(many), ..Variance::default() }
        }
        None => Variance { path: RARE * of_many.variance[part], ..Variance::default() },
    };
    let of_map = |part: usize, caustic_only: bool| {
        let Some(map) = plan.maps().find(|map| map.caustic_only == caustic_only) else { return MapVariance::default() };
        let sample_power = USUAL_POWERS[usize::from(caustic_only)];
        MapVariance {
            of_round: of_one.map_or(of_many.variance[part], |of_one| 0.5 * (of_one.variance[part] + of_many.variance[part]))
                * RARE
                * f64::from(SAMPLES).powf(sample_power),
            sample_power,
            at: if caustic_only { at.caustic() } else { at.global() },
            share: of_many.light[part],
            bias: USUAL_BIAS[usize::from(caustic_only)],
            uncertainty: USUAL_UNCERTAINTY,
            widest: (map.radius_from != RadiusFrom::User).then(|| widest(plan, map)),
        }
    };
    let (direct, specular, caustic, global) = (of_paths(0), of_paths(1), of_map(2, true), of_map(3, false));
    let variance = Variance { path: direct.path + specular.path, shadow_ray: direct.shadow_ray + specular.shadow_ray, global, caustic };
    let varies = |of: Variance| of.path + of.shadow_ray * of_samples(before.shadow_rays);
    let parts = [varies(direct), varies(specular), caustic.of_first_round(before.caustic(), 1), global.of_first_round(before.global(), 1)];
    let all: f64 = parts.iter().sum();
    if all <= 0.0 || !all.is_finite() {
        return None;
    }
    let nodes_of_ray = of_one.map_or(0.0, |of_one| (of_many.counted.nodes - of_one.counted.nodes) / f64::from(many.max(2) - 1));
    let counted = Counted { nodes: of_many.counted.nodes - f64::from(many) * nodes_of_ray, nodes_of_ray, ..of_many.counted };
    let rounds = Rounds {
        variance,
        cost: cost(plan, &counted, kind),
        alpha: plan.settings.alpha,
        counts_bias: plan.film.bias == BiasPlan::Blocks,
        unseen: of_many.unseen / f64::from(plan.sensor.pixels()).sqrt(),
        unreached: of_many.unreached * global.squared_radius(at.global()),
        least_samples: 1.0,
    };
    Some((parts.map(|part| part / all), rounds))
}

/// Nanoseconds that a run is to take.
fn goal_nanoseconds(rounds: &Rounds, division: Division, stop: &Stop) -> f64 {
    let seconds = stop.seconds.map_or(f64::INFINITY, |most| 1e9 * most);
    stop.error.map_or(f64::INFINITY, |error| rounds.until(division, error).1).min(seconds)
}

/// By which powers of a pixel's paths the variance of the global and the caustic map falls, where it was not measured.
const USUAL_POWERS: [f64; 2] = [0.0, 1.0];
/// Few pixels seldom show rare light: the variance over what most of them find.
const RARE: f64 = 1.4;
/// A run takes at least so many times as long as another look at a few pixels, or there is none.
const LEAST_LOOKS: f64 = 4.0;

/// Blocks that a run may do with, which wants some more than its first look takes.
const FEW_BLOCKS: u32 = 32;
/// Less than this of the time must be left for tiles to be worth their while.
const LEAST_TILES: f64 = 0.93;
/// Of the mean samples, what each tile may have at least.
const LEAST_SHARES: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// How many times as long paths are in tiles that vary more, over mirrors and glass.
const OF_CHAINS: f64 = 1.25;
/// Of the mean cost of a path, what one costs at least: it must be sent, whatever it meets.
const LEAST_COST: f64 = 0.1;
/// Rounds of a look at all pixels with each kind of light: the fewest, the most of the first look, and the most of any.
const PICTURE_ROUNDS: u32 = 4;
const FIRST_PICTURE_ROUNDS: u32 = 8;
const MOST_PICTURE_ROUNDS: u32 = 64;
/// The share of the run that they may take. The first look may take several times as much, as few pixels may have shown too little of the run.
const PICTURE_SHARE: f64 = 0.05;
const LEAST_PICTURE: f64 = 6.0;
/// Of the mean, what a tile is taken to have that showed nothing.
const HIDDEN: f64 = 0.1;

/// Rounds of all pixels that are worth their while in a run so far as it is known.
fn picture_rounds(run: &ScenePlan, first: Division, rounds: &Rounds, pilot_photons: u32) -> f64 {
    let goal = goal_nanoseconds(rounds, first, &run.settings.stop);
    let Cost { round, paths, shadow_rays, photons, .. } = rounds.cost;
    let a_path = paths + f64::from(first.shadow_rays) * shadow_rays;
    let of_pixels = round + f64::from(SAMPLES) * a_path;
    let of_maps = |map: &MapPlan| {
        let share = (f64::from(PIXELS_OF_MAP) / f64::from(run.sensor.pixels())).min(1.0);
        let photons = f64::from(pilot_photons) * photons[usize::from(map.caustic_only)];
        2.0 * (round + photons) + f64::from(FEW_SAMPLES + MANY_SAMPLES) * share * a_path
    };
    PICTURE_SHARE * goal / (of_pixels + run.maps().map(of_maps).sum::<f64>())
}

/// Samples of each tile over the mean of all.
struct Tiles {
    samples: Vec<f64>,
    /// The mean variance and the mean cost of a path over what these are where all have the same.
    variance: f64,
    cost: f64,
}

impl Tiles {
    /// Samples go by the root of variance over cost (Neyman 1934), and each tile has this share of their mean at least.
    fn of(tiles: &[OfTile], columns: usize, least: f64) -> Tiles {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let variances = smooth(&tiles.iter().map(|tile| tile.variance).collect::<Vec<f64>>(), columns);
        let met = smooth(&tiles.iter().map(|tile| tile.met).collect::<Vec<f64>>(), columns);
        let all = mean(&met);
        let costs: Vec<f64> = met.iter().map(|met| LEAST_COST + (1.0 - LEAST_COST) * met / all).collect();
        let roots: Vec<f64> = variances.iter().zip(&costs).map(|(variance, cost)| (variance / cost).sqrt()).collect();
        let root = mean(&roots);
        let samples: Vec<f64> = roots.iter().map(|own| (own / root).max(least)).collect();
        let of_all = mean(&samples);
        let samples: Vec<f64> = samples.iter().map(|own| own / of_all).collect();
        let variance = mean(&variances.iter().zip(&samples).map(|(variance, samples)| variance / samples).collect::<Vec<f64>>());
        let cost = mean(&costs.iter().zip(&samples).map(|(cost, samples)| cost * samples).collect::<Vec<f64>>());
        Tiles { samples, variance, cost }
    }

    /// What rounds are with these, of what they are without.
    fn rounds(&self, even: &Rounds, has_chains: bool) -> Rounds {
        let mut rounds = *even;
        rounds.variance.path *= self.variance;
        rounds.variance.shadow_ray *= self.variance;
        for map in [&mut rounds.variance.global, &mut rounds.variance.caustic] {
            map.of_round *= self.variance.powf(map.sample_power.min(1.0));
        }
        rounds.cost.paths *= self.cost * if has_chains { OF_CHAINS } else { 1.0 };
        rounds.cost.shadow_rays *= self.cost;
        rounds.least_samples = self.samples.iter().copied().fold(1.0, f64::min);
        rounds
    }
}

/// What a tile shows is little known, and rare light beside it is rare in it too: the mean of it and its neighbours.
fn smooth(values: &[f64], columns: usize) -> Vec<f64> {
    let rows = values.len() / columns;
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let near = |place: usize, count: usize| place.saturating_sub(1)..(place + 2).min(count);
    let at = |x: usize, y: usize| {
        let found: Vec<f64> = near(y, rows).flat_map(|y| near(x, columns).map(move |x| values[y * columns + x])).collect();
        HIDDEN * mean + (1.0 - HIDDEN) * found.iter().sum::<f64>() / found.len() as f64
    };
    (0..values.len()).map(|tile| at(tile % columns, tile / columns)).collect()
}

/// The square of the widest first radius of a map over that of the usual photons and neighbours.
fn widest(plan: &ScenePlan, map: &MapPlan) -> f64 {
    let reach = plan.trial.as_ref().map_or(TrialRadius::default(), |trial| trial.reach[usize::from(map.caustic_only)]);
    // Without a trial the scene's area gives them.
    let (wanted, widest) = if reach.wanted > 0.0 { (reach.wanted, reach.widest) } else { (map.radius, MAX_DEFAULT_RADIUS) };
    let before = Division::of(&plan.settings);
    let of = if map.caustic_only { before.caustic() } else { before.global() };
    (widest.min(MAX_DEFAULT_RADIUS) / wanted).powi(2) * of.over_usual()
}

/// Samples of all pixels, and how often they double in each tile, for a mean of so many and what each tile is to have of that.
fn tile_samples(mean: u32, least_samples: u32, shares: &[f64], size: (u32, u32)) -> (u32, TileSamples) {
    let least = shares.iter().copied().fold(f64::INFINITY, f64::min) * f64::from(mean);
    let samples = least.log2().round().exp2().clamp(f64::from(least_samples), f64::from(MAX_SAMPLES)) as u32;
    let most = f64::from((MAX_SAMPLES / samples).ilog2().min(9));
    let doublings = |share: &f64| (share * f64::from(mean) / f64::from(samples)).log2().round().clamp(0.0, most) as u32;
    (samples, TileSamples::new(&shares.iter().map(doublings).collect::<Vec<u32>>(), size))
}
