//! The rounds of a pilot, and what they tell of how a picture's light varies.

use std::cell::Cell;

use glam::DVec3;

use super::{RunResult, SceneFilm, View, light, trial};
use crate::constants::PART_COUNT;
use crate::engine::{Control, bias_batches};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::plan::scene::{LightOf, ScenePlan};
use crate::plan::sensor::Sensor;
use crate::scene::Scene;
use crate::settings::scene::{SAMPLES_PER_BLOCK, SceneSettings};
use crate::settings::stop::{Measure, Stop};
use crate::settings::tile_samples::TILE;

/// Pixels at most: of so many all that is known is kept.
const PIXELS: f64 = 1024.0;
/// Paths through each, as many as a block of a run has at least: they are even over it, and vary less than if each was alone.
pub const SAMPLES: u32 = SAMPLES_PER_BLOCK;
const ROUNDS: u32 = 16;
/// Of each map, and those within the first radius, which is wider than in a run: the bias stands out.
pub const PHOTONS: u32 = 1 << 12;
const NEIGHBOURS: u32 = 4;
const CAUSTIC_NEIGHBOURS: u32 = 1;
const SEED: u64 = 0x0070_696c_6f74;
/// Pixels that tell enough of a map, whose light varies little from one to the next.
const PIXELS_OF_MAP: f64 = 4096.0;

/// What a round's parts are like: the variance of a path's light, or of a map's, and the light itself, relative to all light.
#[derive(Clone, Copy)]
pub struct Parts {
    pub variance: [f64; PART_COUNT as usize],
    pub light: [f64; PART_COUNT as usize],
    /// What one pixel may have of light that its only path has missed, relative to the light of a pixel.
    pub unseen: f64,
}

/// What all pixels tell, relative to all light.
pub struct OfPicture {
    /// The variance of a path, and that of each tile over their mean.
    pub paths: f64,
    pub tiles: Vec<f64>,
    /// Of the global and of the caustic map: the variance of a round, the light, and the bias of this light, 0 where it is not known.
    pub maps: [[f64; 3]; 2],
}

/// Of a run that is planned.
pub struct PilotRounds<'a> {
    pub gpu: &'a Gpu,
    pub scene: &'a Scene,
    pub view: &'a View<'a>,
    pub run: &'a ScenePlan,
    /// Milliseconds of the device that they took.
    pub spent: Cell<f64>,
}

impl PilotRounds<'_> {
    /// A few pixels, spread over the picture, with a path through each and so many shadow rays.
    pub fn of_few(&self, shadow_rays: u32) -> Result<Parts> {
        let PilotRounds { gpu, scene, view, run, .. } = *self;
        let seed = bias_batches::seed(SEED, 0);
        let settings = SceneSettings { samples: SAMPLES, shadow_rays, rounds: ROUNDS, seed, ..settings(&run.settings) };
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
        let lit = self.light(&view, plan)?;
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

    /// All pixels. `None` where nothing varies.
    pub fn of_all(&self, shadow_rays: u32, rounds: u32) -> Result<Option<OfPicture>> {
        let PilotRounds { gpu, scene, view, run, .. } = *self;
        let maps: Vec<LightOf> = run.maps().map(|map| if map.caustic_only { LightOf::CausticMap } else { LightOf::GlobalMap }).collect();
        let look = |light_of: LightOf, samples: u32| {
            let settings =
                SceneSettings { samples, shadow_rays, rounds, seed: bias_batches::seed(SEED, 1), ..settings(&run.settings) };
            let (sensor, footprint) = match (light_of, run.sensor) {
                (LightOf::GlobalMap | LightOf::CausticMap, Sensor::Picture { width, height }) => fewer(width, height, PIXELS_OF_MAP),
                _ => (run.sensor, 1.0),
            };
            let mut plan = trial::plan(gpu, scene, view, &settings, sensor)?;
            (plan.light_of, plan.footprint) = (light_of, footprint);
            Ok(self.light(view, plan)?.film)
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

    fn light(&self, view: &View, plan: ScenePlan) -> Result<RunResult> {
        let lit = light(self.gpu, view, plan, &mut Control::default())?;
        self.spent.set(self.spent.get() + lit.timings.row("round").and_then(|row| row.gpu_ms).unwrap_or(0.0));
        Ok(lit)
    }
}

/// Settings that all rounds of a pilot have.
pub fn settings(run: &SceneSettings) -> SceneSettings {
    SceneSettings {
        tiles: None,
        photons: PHOTONS,
        caustic_photons: PHOTONS,
        neighbours: NEIGHBOURS,
        caustic_neighbours: CAUSTIC_NEIGHBOURS,
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
