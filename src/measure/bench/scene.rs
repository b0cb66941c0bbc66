//! Times of a scene of triangles: rounds, pass by pass, beside the least work that each pass needs.

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use rayon::prelude::*;

use super::pass::{Cost, SLOW_OPERATION, Work, bytes, scan_dispatches};
use super::rates::{PHILOX_PRODUCTS, Rates};
use super::room::{Counts, DROPPED, REPEATS, Timed};
use crate::engine::scene::resources::SceneResources;
use crate::engine::scene::{self, Receivers, Round, points, trace};
use crate::engine::{self, Control};
use crate::error::Result;
use crate::gpu::{Commands, Gpu};
use crate::photon::MapPhoton;
use crate::plan::film::BiasPlan;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::records::{PhotonState, VisiblePoint};
use crate::render::{Prepared, PreparedScene};
use crate::scene::built_in;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;
use crate::settings::scene::{Effect, SceneSettings};

/// A built-in scene.
pub(crate) fn named(name: &str) -> PreparedScene {
    PreparedScene::new(built_in::by_name(name).expect("it is built in"))
}

/// A scene, what looks at it, and how.
pub(crate) struct Job<'a> {
    pub name: &'a str,
    pub scene: &'a PreparedScene,
    pub size: (u32, u32),
    pub settings: SceneSettings,
}

impl Job<'_> {
    /// What the first camera sees, and how that is found without a trial round: radii are those by the scene's area.
    pub(crate) fn prepare(&self, gpu: &Gpu, settings: &SceneSettings) -> Result<(Prepared, ScenePlan)> {
        let prepared = self.scene.prepare_with(settings, Receivers::Image(&self.scene.scene.first_camera(), self.size.into()))?;
        let plan = prepared.plan_within(&engine::limits(gpu.facts()))?;
        Ok((prepared, plan))
    }
}

/// What a map of the first round holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Survey {
    /// Entries of the map.
    pub stored: f64,
    /// Entries within the radius of a visible point and on its plane, on average over those that ask.
    pub per_estimate: f64,
    pub asking_points: f64,
}

/// Traces the first round's photons of a map and looks at it from the host: it reads buffers that a run keeps to itself.
pub(crate) fn survey(gpu: &Gpu, job: &Job, map: impl Fn(&ScenePlan) -> Option<&MapPlan>) -> Result<Option<Survey>> {
    let (prepared, plan) = job.prepare(gpu, &job.settings)?;
    let geometry = &*prepared.geometry;
    let Some(map) = map(&plan) else { return Ok(None) };
    let mut commands = Commands::new(gpu, scene::constants(&plan), Instant::now())?;
    let resources = SceneResources::new(&mut commands, geometry, &plan, &[])?;
    let round = Round { resources: &resources, geometry, plan: &plan, number: 0 };
    let buffers = round.photons();
    points::see(&mut commands, round, prepared.camera.as_ref())?;
    let seen = commands.read(&resources.visible_points, plan.visible_points() as usize)?;
    let asking: Vec<VisiblePoint> = seen.into_iter().filter(|point| point.arrivals & map.stored != 0).collect();
    let step = (asking.len() / SAMPLES).max(1);
    let radius_squared = plan.radius(map, 0).powi(2) as f32;
    let (mut stored, mut found) = (0u64, 0u64);
    let mut look = |commands: &mut Commands, _: Option<u32>| {
        let length = commands.read(&buffers.counters, 1)?[0];
        let photons = commands.read(&buffers.map, length as usize)?;
        stored += u64::from(length);
        found += asking
            .par_iter()
            .step_by(step)
            .map(|point| {
                let near =
                    |photon: &&MapPhoton| photon.plane == point.plane && photon.position.distance_squared(point.position) <= radius_squared;
                photons.iter().filter(near).count() as u64
            })
            .sum::<u64>();
        Ok(())
    };
    for chunk in map.chunks() {
        trace::trace(&mut commands, round, map, chunk, &mut look)?;
    }
    let samples = asking.len().div_ceil(step).max(1);
    Ok(Some(Survey { stored: stored as f64, per_estimate: found as f64 / samples as f64, asking_points: asking.len() as f64 }))
}

/// Visible points of a survey.
const SAMPLES: usize = 256;

/// Times the passes of a scene: [`REPEATS`] rounds of one run, after [`DROPPED`] others. Radii stay. On a
/// card the fastest of `RUNS` counts: its clock may fall for a second or so by what others do on the same machine.
pub(crate) fn time(gpu: &Gpu, rates: &Rates, job: &Job, cancelled: &AtomicBool) -> Result<Timed> {
    let runs = if gpu.facts().kind == "cpu" { 1 } else { RUNS };
    let timed = (0..runs).map(|_| time_once(gpu, rates, job, cancelled)).collect::<Result<Vec<Timed>>>()?;
    Ok(timed.into_iter().min_by(|a, b| a.round_ms.total_cmp(&b.round_ms)).expect("there was a run"))
}

const RUNS: u32 = 3;

fn time_once(gpu: &Gpu, rates: &Rates, job: &Job, cancelled: &AtomicBool) -> Result<Timed> {
    let rounds = DROPPED + REPEATS;
    let (prepared, plan) = job.prepare(gpu, &SceneSettings { alpha: 1.0, rounds, ..job.settings.clone() })?;
    gpu.forget_peaks();
    let result = prepared.light(gpu, plan, &mut Control::quiet(cancelled))?.finished()?;
    let memory = gpu.held_memory();
    let surveys = [survey(gpu, job, |plan| plan.global.as_ref())?, survey(gpu, job, |plan| plan.caustic.as_ref())?];
    let counts = [0, 1].map(|map: usize| Counts::of(&result.fates[map], rounds));
    let triangles = prepared.geometry.triangles.len();
    let model = Model { triangles, plan: &result.plan, counts, surveys };
    let workload = format!("{}, {}, {} triangles", job.name, result.plan.builder().name(), triangles);
    let timed = Timed::of(&result, (rounds, DROPPED), &workload, rates, |pass| model.work(pass), memory);
    Ok(Timed { stated_bytes: result.plan.bytes, ..timed })
}

/// A node of the hierarchy: six planes of eight children, a product and a sum each, and the nearest and farthest of them.
const NODE_OPERATIONS: f64 = 8.0 * 6.0 * 3.0;
const TRIANGLE_OPERATIONS: f64 = 30.0;
/// A point on an emitter and a direction; a surface's frame, a lobe and the roulette.
const EMISSION_OPERATIONS: f64 = 5.0 * SLOW_OPERATION + 40.0;
const SCATTER_OPERATIONS: f64 = 5.0 * SLOW_OPERATION + 40.0;
/// Squared distance, plane and normal of a pair, its share in three channels.
const PAIR_OPERATIONS: f64 = 24.0;
/// Of a shadow ray: a point on a lamp, its distance, two cosines.
const LIGHT_OPERATIONS: f64 = 3.0 * SLOW_OPERATION + 20.0;
/// Of the frame in which walls around a visible point are looked for.
const CUT_OPERATIONS: f64 = 2.0 * SLOW_OPERATION + 20.0;
/// Of a visible point's light at the end of a round: area of the disc and three channels.
const WEIGH_OPERATIONS: f64 = 4.0 * SLOW_OPERATION + 20.0;

struct Model<'a> {
    triangles: usize,
    plan: &'a ScenePlan,
    /// Of the global map and of the caustic map.
    counts: [Counts; 2],
    surveys: [Option<Survey>; 2],
}

impl Model<'_> {
    /// A ray that meets one leaf of a hierarchy as full as can be; nodes and triangles are taken to stay in caches.
    fn ray_operations(&self) -> f64 {
        let triangles = self.triangles as f64;
        if !self.plan.simulates(Effect::Bvh) {
            return triangles * TRIANGLE_OPERATIONS;
        }
        (triangles / 3.0).log(8.0).ceil().max(1.0) * NODE_OPERATIONS + TRIANGLE_OPERATIONS
    }

    /// What a pass cannot do without in a round.
    fn work(&self, pass: &str) -> Option<Work> {
        let pixels = f64::from(self.plan.sensor.pixels());
        let samples = pixels * f64::from(self.plan.samples());
        let points = f64::from(self.plan.visible_points());
        let shadow_rays = f64::from(self.plan.shadow_rays());
        let (item, items, cost) = match pass {
            "visible points" => {
                let cost = Cost {
                    bytes: samples * self.plan.bytes_of_path() as f64,
                    float_operations: samples * ((1.0 + shadow_rays) * self.ray_operations() + shadow_rays * LIGHT_OPERATIONS),
                    // Where a path starts, and where its shadow rays end.
                    integer_products: samples * 2.0 * f64::from(PHILOX_PRODUCTS),
                };
                ("samples", samples, cost)
            }
            "flux to radiance" => {
                let bytes = points * self.plan.bytes_of_point() as f64;
                ("points", points, Cost { bytes, float_operations: points * WEIGH_OPERATIONS, ..Cost::default() })
            }
            "resolve" => ("pixels", pixels, Cost { bytes: pixels * self.plan.bytes_of_pixel() as f64, ..Cost::default() }),
            _ => {
                let (map, stage) = pass.split_once('/').unwrap_or((pass, ""));
                return self.work_of_map(self.plan.maps().find(|known| known.name == map)?, stage);
            }
        };
        // At the end of a block differences of two radii are added up, too.
        let ends = if pass == "resolve" && self.plan.film.bias == BiasPlan::Blocks {
            1.0 / f64::from(self.plan.film.rounds_per_block)
        } else {
            0.0
        };
        Some(Work { item, items, dispatches: 1.0 + ends, cost })
    }

    fn work_of_map(&self, map: &MapPlan, stage: &str) -> Option<Work> {
        let which = usize::from(map.caustic_only);
        let (counts, survey) = (self.counts[which], self.surveys[which]?);
        let buckets = f64::from(map.bucket_count);
        let persistent = self.plan.builder() == Builder::Persistent;
        // Where an invocation keeps a photon to its end, no path is written and read again.
        let path = if persistent { 0.0 } else { bytes::<PhotonState>() };
        let trace = Cost {
            bytes: (counts.emitted + counts.flights + counts.survivors) * path + survey.stored * bytes::<MapPhoton>(),
            float_operations: counts.emitted * EMISSION_OPERATIONS
                + counts.flights * self.ray_operations()
                + counts.events * SCATTER_OPERATIONS,
            integer_products: (2.0 * counts.emitted + counts.events) * f64::from(PHILOX_PRODUCTS),
        };
        let stored = survey.stored as u64;
        let of_bytes = |bytes: u64| Cost { bytes: bytes as f64, ..Cost::default() };
        let count = of_bytes(map.bytes_of_counting(stored));
        let scan = of_bytes(map.bytes_of_scanning());
        let sort = of_bytes(map.bytes_of_sorting(stored));
        let found = survey.asking_points * survey.per_estimate;
        let gather = Cost {
            bytes: map.bytes_of_reading(stored) as f64 + survey.asking_points * (bytes::<VisiblePoint>() + 48.0),
            float_operations: found * PAIR_OPERATIONS,
            ..Cost::default()
        };
        // Where walls end each point's disc: the point, four words, and the disc's own plane and frame.
        let cuts = if self.plan.cuts_discs() {
            let points = survey.asking_points;
            Cost { bytes: points * (bytes::<VisiblePoint>() + 16.0), float_operations: points * CUT_OPERATIONS, ..Cost::default() }
        } else {
            Cost::default()
        };
        let cut_dispatches = f64::from(u8::from(self.plan.cuts_discs()));
        let chunks = map.chunks().count() as f64;
        // Emission, and flights with what works out the sizes of all but the first: of the first segment, which all have.
        let flights = chunks * if persistent { 1.0 } else { 2.0 * f64::from(map.segment_bounces) };
        let scans = chunks * scan_dispatches(map.bucket_count, self.plan.settings.group_size);
        let sorts = 3.0 * chunks + scans;
        let gathers = chunks * 3.0;
        let (item, items, dispatches, cost) = match stage {
            "" => ("photons", counts.emitted, cut_dispatches + flights + sorts + gathers, cuts + trace + count + scan + sort + gather),
            "cuts" => ("points", survey.asking_points, cut_dispatches, cuts),
            "trace" => ("events", counts.events, flights, trace),
            "index" => ("photons", survey.stored, sorts, count + scan + sort),
            "index/count" => ("photons", survey.stored, 2.0 * chunks, count),
            "index/scan" => ("cells", buckets, scans, scan),
            "index/sort" => ("photons", survey.stored, chunks, sort),
            "gather" => ("photons found", found, gathers, gather),
            _ => return None,
        };
        Some(Work { item, items, dispatches, cost })
    }
}

/// Radius, metres, at which a map of so many entries spread over a scene's surfaces gives so many an estimate.
pub(crate) fn radius_for(geometry: &Geometry, survey: &Survey, radius: f64, wanted: f64) -> f64 {
    let by_area = (wanted * geometry.area / (PI * survey.stored.max(1.0))).sqrt() * geometry.unit;
    if survey.per_estimate > 0.0 { radius * (wanted / survey.per_estimate).sqrt() } else { by_area }
}
