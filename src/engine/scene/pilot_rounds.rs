//! The rounds of a pilot, and what they say of how a picture's light varies.

use std::cell::Cell;
use std::sync::atomic::AtomicBool;

use glam::DVec3;

use super::film::GLOBAL_PHOTON;
use super::trial::few_points;
use super::{RunResult, SceneFilm, Viewpoint, light};
use crate::constants::PART_COUNT;
use crate::engine::error::bias_batches;
use crate::engine::{self, Control};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::ledger::Fates;
use crate::plan::radius::over_usual;
use crate::plan::scene::{LightOf, ScenePlan};
use crate::plan::sensor::Sensor;
use crate::plan::work_cost::{Counted, PilotSize};
use crate::plan::work_division::{Division, Rounds};
use crate::scene::Scene;
use crate::settings::scene::{CAUSTIC_NEIGHBOURS, NEIGHBOURS, SAMPLES_PER_BLOCK, SceneSettings};
use crate::settings::stop::{Measure, Stop};
use crate::settings::tile_samples::TILE;

/// Paths through each, as many as a block of a run has at least: they are even over it, and vary less than if each was alone.
pub(crate) const SAMPLES: u32 = SAMPLES_PER_BLOCK;
const SEED: u64 = 0x0070_696c_6f74;
/// Pixels that show enough of a map, whose light varies little from one to the next; and paths through each, to show what varies from path
/// to path from what varies with the photons.
pub(crate) const PIXELS_OF_MAP: u32 = 4096;
pub(crate) const FEW_SAMPLES: u32 = 1;
pub(crate) const MANY_SAMPLES: u32 = 8;

/// Paths of a pixel that look a map up at places of their own show as much as so many photons, and lie evenly.
const MOST_POWER: f64 = 1.35;
/// A longer run knows its bias better for its noise than these rounds.
const STEADIER: f64 = 0.6;

/// What a round's parts are like: the variance of a path's light, or of a map's, and the light itself, relative to all light.
#[derive(Clone, Copy)]
pub(crate) struct Parts {
    pub variance: [f64; PART_COUNT as usize],
    pub light: [f64; PART_COUNT as usize],
    /// What one pixel may have of light that its only path has missed, relative to the light of a pixel.
    pub unseen: f64,
    /// Where no photon of the global map has reached any pixel: the bound of the light that it may give all the same, times photons.
    pub unreached: f64,
    pub counted: Counted,
    /// With so many a path.
    pub shadow_rays: u32,
}

/// What all pixels show, relative to all light.
pub(crate) struct OfImage {
    /// The variance of a path, and that of each tile over their mean.
    pub paths: f64,
    pub tiles: Vec<OfTile>,
    /// The global and the caustic map.
    pub maps: [OfMap; 2],
}

#[derive(Clone, Copy, Default)]
pub(crate) struct OfTile {
    /// Over the mean of all tiles.
    pub variance: f64,
    /// The share of its pixels that show surfaces: paths that meet none cost little.
    pub met: f64,
}

#[derive(Clone, Copy, Default)]
pub(crate) struct OfMap {
    /// The variance of a round with one path a pixel, and by which power of the paths it falls.
    pub of_round: f64,
    pub sample_power: f64,
    pub light: f64,
    /// The bias of this light; and how well its square is known, and this over the variance.
    pub bias: f64,
    pub uncertainty: f64,
    pub over_noise: Option<f64>,
}

/// Of a run that is planned.
pub(crate) struct PilotRounds<'a> {
    pub gpu: &'a Gpu,
    pub scene: &'a Scene,
    pub viewpoint: &'a Viewpoint<'a>,
    pub run: &'a ScenePlan,
    pub size: PilotSize,
    pub cancelled: &'a AtomicBool,
    /// Milliseconds of the device that they took.
    pub spent: Cell<f64>,
}

impl PilotRounds<'_> {
    /// A few pixels, spread over the picture, with a path through each and so many shadow rays.
    pub(super) fn of_few(&self, shadow_rays: u32) -> Result<Parts> {
        let PilotRounds { viewpoint, run, .. } = *self;
        let seed = bias_batches::seed(SEED, 0);
        let settings = SceneSettings { samples: SAMPLES, shadow_rays, rounds: self.size.rounds, seed, ..self.settings() };
        let (sensor, phases) = few_points(viewpoint, run.sensor, self.size.pixels);
        let viewpoint = Viewpoint { phases: &phases, ..*viewpoint };
        let plan = self.plan(&viewpoint, &settings, sensor)?;
        let samples = plan.samples();
        let paths = f64::from(plan.paths()) * f64::from(self.size.rounds);
        let result = self.light(&viewpoint, plan)?;
        let error = result.film.error(settings.stop.confidence);
        let of_round = error.noise * error.noise * f64::from(result.film.rounds);
        let [direct, specular, caustic, indirect] = error.places.map_or([0.0; PART_COUNT as usize], |places| places.of_parts);
        let of_path = f64::from(samples) * of_round;
        let of_unseen = f64::from(samples) * f64::from(result.film.rounds) * (result.film.pixels() as f64).sqrt();
        let is_dark = error.unknown.absent.contains(&GLOBAL_PHOTON) && error.unknown.relative.is_finite();
        let photons = f64::from(result.film.rounds) * f64::from(settings.photons);
        let unreached = if is_dark { error.unknown.relative * photons } else { 0.0 };
        let light: Vec<f64> = result.film.part_totals.iter().map(|total| *total as f64).collect();
        // Without lamps and sky that are seen straight.
        let surfaces = result.film.of_surfaces.as_ref().unwrap_or(&result.film.of_blocks);
        let all = surfaces.sums.iter().map(|sum| *sum as f64).sum::<f64>().max(1.0);
        let [nodes, triangles] = result.film.visited().map(|count| count as f64 / paths);
        Ok(Parts {
            variance: [direct * of_path, specular * of_path, caustic * of_round, indirect * of_round],
            light: std::array::from_fn(|part| light[part] / all),
            unseen: error.unseen * of_unseen,
            unreached,
            shadow_rays,
            counted: Counted { nodes, nodes_of_ray: 0.0, triangles, flights: [0, 1].map(|map| flights(&result.fates[map])) },
        })
    }

    /// Nanoseconds of a look at few pixels.
    pub(super) fn cost_of_few(&self, rounds: &Rounds, shadow_rays: u32) -> f64 {
        let share = (f64::from(self.size.pixels) / f64::from(self.run.sensor.pixels())).min(1.0);
        let at = Division { shadow_rays, samples: SAMPLES, ..Division::of(&self.settings()) };
        let [paths, global, caustic] = rounds.costs(at);
        f64::from(self.size.rounds) * (rounds.cost.round + share * paths + global + caustic)
    }

    /// All pixels. `None` where nothing varies.
    pub(super) fn of_all(&self, shadow_rays: u32, rounds: u32) -> Result<Option<OfImage>> {
        let PilotRounds { viewpoint, run, .. } = *self;
        let look = |light_of: LightOf, samples: u32| {
            let settings = SceneSettings { samples, shadow_rays, rounds, seed: bias_batches::seed(SEED, 1), ..self.settings() };
            let sensor = if light_of == LightOf::Paths { run.sensor } else { few_points(viewpoint, run.sensor, PIXELS_OF_MAP).0 };
            let plan = ScenePlan { light_of, ..self.plan(viewpoint, &settings, sensor)? };
            Ok(self.light(viewpoint, plan)?.film)
        };
        let mean = |film: &SceneFilm| film.surface_means().map(DVec3::element_sum).sum::<f64>() / film.pixels() as f64;
        // Of a round's light.
        let square = |film: &SceneFilm| {
            let all = (0..film.pixels()).map(|pixel| film.surface_error(pixel).length_squared()).sum::<f64>();
            all / film.pixels() as f64 * f64::from(film.rounds)
        };
        let of_paths = look(LightOf::Paths, SAMPLES)?;
        let mut maps = [OfMap::default(); 2];
        for map in run.maps() {
            let light_of = if map.caustic_only { LightOf::CausticMap } else { LightOf::GlobalMap };
            let [few, many] = [look(light_of, FEW_SAMPLES)?, look(light_of, MANY_SAMPLES)?];
            let squares = [square(&few), square(&many)];
            let power = (squares[0] / squares[1]).log2() / f64::from(MANY_SAMPLES).log2();
            let error = many.error(run.settings.stop.confidence);
            let uncertainty = error.bias.map_or(f64::INFINITY, |bias| bias.uncertainty());
            maps[usize::from(map.caustic_only)] = OfMap {
                of_round: squares[0],
                sample_power: if power.is_finite() { power.clamp(0.0, MOST_POWER) } else { 0.0 },
                light: mean(&many),
                bias: error.bias.map_or(0.0, |bias| bias.relative),
                uncertainty,
                over_noise: Some(STEADIER * uncertainty / (error.noise * error.noise)).filter(|over| over.is_finite()),
            };
        }
        let all = mean(&of_paths) + maps[0].light + maps[1].light;
        if all <= 0.0 {
            return Ok(None);
        }
        let (width, height) = run.sensor.size();
        let columns = width.div_ceil(TILE);
        let mut tiles = vec![(0.0, 0u32, 0u32); (columns * height.div_ceil(TILE)) as usize];
        for (pixel, light) in of_paths.surface_means().enumerate() {
            let (x, y) = (pixel as u32 % width, pixel as u32 / width);
            let (variance, met, count) = &mut tiles[(y / TILE * columns + x / TILE) as usize];
            *variance += of_paths.surface_error(pixel).length_squared();
            *met += u32::from(light != DVec3::ZERO);
            *count += 1;
        }
        let sum = tiles.iter().map(|(variance, ..)| variance).sum::<f64>() / of_paths.pixels() as f64;
        if sum == 0.0 {
            return Ok(None);
        }
        // The mean of three channels, and of pixels that show surfaces.
        let of_surfaces = of_paths.pixels_of_surfaces() / of_paths.pixels() as f64;
        let relative = |square: f64| 3.0 * of_surfaces * square / (all * all);
        let of_tile = |(variance, met, count): (f64, u32, u32)| OfTile {
            variance: variance / f64::from(count) / sum,
            met: f64::from(met) / f64::from(count),
        };
        Ok(Some(OfImage {
            paths: f64::from(SAMPLES) * relative(square(&of_paths)),
            tiles: tiles.into_iter().map(of_tile).collect(),
            maps: maps.map(|map| OfMap { of_round: relative(map.of_round), light: map.light / all, ..map }),
        }))
    }

    /// Settings that all rounds have, whatever the run's photons are.
    pub(super) fn settings(&self) -> SceneSettings {
        let neighbours = |usual: u32| (f64::from(usual) * self.size.neighbours) as u32;
        SceneSettings {
            tiles: None,
            photons: self.size.photons,
            caustic_photons: self.size.photons,
            neighbours: neighbours(NEIGHBOURS),
            caustic_neighbours: neighbours(CAUSTIC_NEIGHBOURS),
            block: Some(1),
            // The radii stay those of the first round.
            alpha: 1.0,
            stop: Stop { measure: Measure::Rmse, ..Stop::default() },
            ..self.run.settings.clone()
        }
    }

    /// With what the run's own trial has found. Pixels keep their size, however far apart they are.
    fn plan(&self, viewpoint: &Viewpoint, settings: &SceneSettings, sensor: Sensor) -> Result<ScenePlan> {
        let of_run = &self.run.settings;
        let apart = |neighbours: u32, photons: u32, caustic_only: bool| over_usual(neighbours, caustic_only) / f64::from(photons);
        let times = [
            apart(settings.neighbours, settings.photons, false) / apart(of_run.neighbours, of_run.photons, false),
            apart(settings.caustic_neighbours, settings.caustic_photons, true)
                / apart(of_run.caustic_neighbours, of_run.caustic_photons, true),
        ];
        let trial = self.run.trial.as_ref().map(|trial| trial.scaled(times.map(f64::sqrt)));
        let plan = ScenePlan::with_trial(self.scene, viewpoint.geometry, settings, sensor, &engine::limits(self.gpu.facts()), trial)?;
        let columns = |sensor: Sensor| f64::from(sensor.size().0.max(1));
        Ok(ScenePlan { footprint: columns(sensor) / columns(self.run.sensor), ..plan })
    }

    fn light(&self, viewpoint: &Viewpoint, plan: ScenePlan) -> Result<RunResult> {
        let result = light(self.gpu, viewpoint, plan, &mut Control::quiet(self.cancelled))?.finished()?;
        self.spent.set(self.spent.get() + result.timings.row("round").and_then(|row| row.gpu_ms).unwrap_or(0.0));
        Ok(result)
    }
}

/// From one surface to the next, of each photon.
fn flights(fates: &Fates) -> f64 {
    let count: u64 = fates.bounces.iter().map(|bounce| bounce.stored + bounce.absorbed + bounce.escaped + bounce.dropped).sum();
    count as f64 / fates.emitted.max(1) as f64
}
