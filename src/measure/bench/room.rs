//! Times of the paper's box: rounds of one builder, pass by pass, beside the least work that each pass needs.

use std::sync::atomic::AtomicBool;

use super::pass::{Cost, Pass, SLOW_OPERATION, Work, bytes, rounds_of, scan_dispatches, sum_of_outermost};
use super::rates::{PHILOX_PRODUCTS, Rates};
use crate::engine::Control;
use crate::engine::room::{self, RunResult};
use crate::engine::run;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, HeldMemory};
use crate::ledger::Fates;
use crate::photon::StoredPhoton;
use crate::photon_state::PackedPhotonState;
use crate::plan::RoomPlan;
use crate::plan::buffers::group_count;
use crate::records::Point;
use crate::rng::Rng;
use crate::scene::open_box::open_box;
use crate::settings::{Builder, RoomSettings};
use crate::timings::Spread;

/// What photons did in a round, on average over all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Counts {
    pub emitted: f64,
    /// Paths that entered a bounce.
    pub flights: f64,
    /// Flights that ended on a wall: photon-wall events.
    pub events: f64,
    /// Events that a wall reflected; in a scene of triangles, those after which a path went on.
    pub survivors: f64,
}

impl Counts {
    pub(crate) fn of(fates: &Fates, rounds: u32) -> Counts {
        let sum = |count: &dyn Fn(usize) -> u64| (0..fates.bounces.len()).map(count).sum::<u64>() as f64 / f64::from(rounds.max(1));
        let bounces = &fates.bounces;
        Counts {
            emitted: fates.emitted as f64 / f64::from(rounds.max(1)),
            flights: sum(&|bounce| if bounce == 0 { fates.emitted } else { bounces[bounce - 1].stored }),
            events: sum(&|bounce| bounces[bounce].stored + bounces[bounce].absorbed),
            survivors: sum(&|bounce| bounces[bounce].stored),
        }
    }
}

/// A run under the clock.
pub(crate) struct Timed {
    pub passes: Vec<Pass>,
    pub counts: Counts,
    /// Of a round, all passes together.
    pub round_ms: f64,
    /// Of a round.
    #[cfg_attr(not(test), expect(dead_code, reason = "tests alone read it"))]
    pub dispatches: f64,
    pub memory: HeldMemory,
    pub stated_bytes: u64,
    /// Counters that places were taken from round-robin; 1 but in the paper's atomic builder.
    pub counters: u32,
}

impl Timed {
    /// Of a run's rounds from number `first` on, beside the work that each pass needs.
    pub(crate) fn of<Plan, Film>(
        run: &run::RunResult<Plan, Film>,
        (rounds, first): (u32, u32),
        workload: &str,
        rates: &Rates,
        work: impl Fn(&str) -> Option<Work>,
        memory: HeldMemory,
    ) -> Timed {
        let scopes = rounds_of(&run.timings, rounds, first);
        let pass = |(name, ms): &(String, Vec<f64>)| Some(Pass::new(workload, name, Spread::of(ms.clone())?, work(name), rates));
        Timed {
            passes: scopes.iter().filter_map(pass).collect(),
            counts: Counts::of(&run.fates[0], rounds),
            dispatches: run.dispatches as f64 / f64::from(rounds),
            round_ms: sum_of_outermost(&scopes),
            memory,
            stated_bytes: 0,
            counters: 1,
        }
    }
}

/// Rounds that count.
pub(crate) const REPEATS: u32 = 7;
/// Rounds before them: the first fills caches.
pub(crate) const DROPPED: u32 = 1;

/// Fails where nothing can be timed, or the run was interrupted.
pub(crate) fn check_clock(gpu: &Gpu) -> Result<()> {
    if gpu.facts().timestamp_bits == 0 {
        return Err(Error::setting("--device", &gpu.facts().name, "has no timestamps, so its passes cannot be timed; choose another"));
    }
    Ok(())
}

pub(crate) fn run_once(gpu: &Gpu, settings: &RoomSettings, cancelled: &AtomicBool) -> Result<RunResult> {
    room::on_gpu(gpu, &open_box(settings), settings, &mut Control::quiet(cancelled))?.finished()
}

/// Times the passes of a builder: [`REPEATS`] rounds of one run, after [`DROPPED`] others.
pub(crate) fn time(gpu: &Gpu, rates: &Rates, settings: &RoomSettings, cancelled: &AtomicBool) -> Result<Timed> {
    let rounds = DROPPED + REPEATS;
    gpu.forget_peaks();
    let result = run_once(gpu, &RoomSettings { rounds, ..settings.clone() }, cancelled)?;
    Ok(timed(gpu, rates, &result, rounds, DROPPED))
}

/// Times a run as it is, all rounds; a first one is dropped.
pub(crate) fn time_run(gpu: &Gpu, rates: &Rates, settings: &RoomSettings, cancelled: &AtomicBool) -> Result<Timed> {
    run_once(gpu, settings, cancelled)?;
    gpu.forget_peaks();
    let result = run_once(gpu, settings, cancelled)?;
    Ok(timed(gpu, rates, &result, settings.rounds, 0))
}

fn timed(gpu: &Gpu, rates: &Rates, result: &RunResult, rounds: u32, first: u32) -> Timed {
    let plan = &result.plan;
    let counts = Counts::of(&result.fates[0], rounds);
    let found = photons_per_point(result) / f64::from(rounds);
    let work = |pass: &str| work(pass, plan, &counts, found);
    let timed = Timed::of(result, (rounds, first), &workload(plan), rates, work, gpu.held_memory());
    Timed { stated_bytes: plan.bytes(), counters: plan.counters, ..timed }
}

fn workload(plan: &RoomPlan) -> String {
    let RoomSettings { builder, photons, bounces, radius, .. } = &plan.settings;
    let counters = if plan.counters > 1 { format!(" by {} counters", plan.counters) } else { String::new() };
    format!("open box, {}{counters}, {photons} photons, {bounces} bounces, radius {radius} m", builder.name())
}

/// Photons within the radius of a point, of all rounds: without Phong weights the first sum of a point counts them.
fn photons_per_point(result: &RunResult) -> f64 {
    let plan = &result.plan;
    let sums = result.film.sums.iter().step_by(plan.channel_count as usize);
    sums.map(|sum| *sum as f64).sum::<f64>() / plan.film_scale() / plan.points.len() as f64
}

/// A point and the photon's position on a disc, a direction (two roots, sine and cosine), its turn into the wall's frame.
const EMISSION_OPERATIONS: f64 = 5.0 * SLOW_OPERATION + 40.0;
/// Three planes, the point on the nearest, the roulette, a direction, its turn into the wall's frame.
const FLIGHT_OPERATIONS: f64 = 7.0 * SLOW_OPERATION + 32.0;
/// Squared distance, two comparisons, a sum.
const PAIR_OPERATIONS: f64 = 11.0;
/// A photon's place among those of its cell.
const RANK_BYTES: f64 = 4.0;
/// Of rand48: one product to 64 bits and two to 32 a draw.
const RAND48_PRODUCTS: f64 = 3.0;

/// Products of random numbers of `draws` draws that lie in one block.
fn products(rng: Rng, draws: f64) -> f64 {
    match rng {
        Rng::Philox => f64::from(PHILOX_PRODUCTS),
        Rng::Rand48 => RAND48_PRODUCTS * draws,
        // Mostly shifts; not counted.
        Rng::Mt | Rng::Sobol => 0.0,
    }
}

/// What a pass in the paper's room cannot do without in a round.
///
/// `found` photons lie within the radius of a point; `None` for what nobody has counted.
pub(crate) fn work(pass: &str, plan: &RoomPlan, counts: &Counts, found: f64) -> Option<Work> {
    let settings = &plan.settings;
    let slots = counts.emitted * f64::from(settings.bounces);
    let (cells, points) = (f64::from(plan.grid.cells()), plan.points.len() as f64);
    // Entries of the map that the index reads: the naive builder's with the empty ones.
    let entries = if plan.has_slots() { slots } else { counts.survivors };
    // Where an invocation keeps a photon to its end, no path is written and read again.
    let path = if settings.builder == Builder::Persistent { 0.0 } else { bytes::<PackedPhotonState>() };
    let emit = Cost {
        bytes: counts.emitted * (path + if settings.rng == Rng::Rand48 { 8.0 } else { 0.0 }),
        float_operations: counts.emitted * EMISSION_OPERATIONS,
        integer_products: counts.emitted * products(settings.rng, 4.0),
    };
    let bounces = Cost {
        bytes: match settings.builder {
            // Every slot is read and written at every bounce, alive or not; after the last one nobody asks for paths.
            Builder::Naive => slots * (path + bytes::<StoredPhoton>()) + (slots - counts.emitted) * path,
            // Survivors' paths are written where they were read, and read again once their places are known; of the dead
            // only the word is read that says so.
            Builder::Scan => {
                counts.flights * (path + 16.0)
                    + counts.survivors * (2.0 * path - 16.0 + bytes::<StoredPhoton>())
                    + (counts.flights - counts.emitted) * path
            }
            _ => counts.flights * path + counts.survivors * bytes::<StoredPhoton>() + (counts.flights - counts.emitted) * path,
        },
        float_operations: counts.flights * FLIGHT_OPERATIONS,
        integer_products: counts.flights * products(settings.rng, 3.0),
    };
    // Each entry's place in its cell is written, and read for sorting.
    let count = Cost { bytes: entries * (bytes::<StoredPhoton>() + RANK_BYTES) + cells * 4.0, ..Cost::default() };
    // Each level is read and written, and once more with the sums of the level above; the upper levels are small.
    let scan = Cost { bytes: cells * 16.0, ..Cost::default() };
    let sort =
        Cost { bytes: entries * (bytes::<StoredPhoton>() + RANK_BYTES) + counts.survivors * bytes::<StoredPhoton>(), ..Cost::default() };
    let gather = Cost {
        bytes: counts.survivors * bytes::<StoredPhoton>() + points * (bytes::<Point>() + 16.0 * f64::from(plan.channel_count)),
        float_operations: points * found * PAIR_OPERATIONS,
        ..Cost::default()
    };
    let film = Cost { bytes: points * f64::from(plan.channel_count) * 64.0, ..Cost::default() };
    let work = |item, items, dispatches, cost| Some(Work { item, items, dispatches, cost });
    // Before each dispatch whose size only the device knows, one that works it out.
    let sized = |dispatches: f64| if plan.has_slots() { 0.0 } else { dispatches };
    let chunks = f64::from(plan.chunks_per_round);
    let emits = chunks * plan.light_photons.len() as f64;
    let bounce_count = f64::from(settings.bounces);
    let scans_of = |items: u32| scan_dispatches(items, settings.group_size);
    let flights = match settings.builder {
        Builder::Persistent => 0.0,
        Builder::Naive => chunks * bounce_count,
        // In place, moved together in order, and counted.
        Builder::Scan => chunks * bounce_count * (3.0 + scans_of(group_count(plan))),
        // Stored where they belong, gaps marked where there are any, and counted.
        _ => chunks * bounce_count * if plan.counters > 1 { 3.0 } else { 2.0 },
    };
    let scans = chunks * scans_of(plan.grid.cells());
    let counting = chunks * (1.0 + sized(1.0));
    let slicing = if plan.slices_candidates { 2.0 } else { 0.0 };
    match pass {
        "build" => work("events", counts.events, emits + flights, emit + bounces),
        "build/emit" => work("photons", counts.emitted, emits, emit),
        "build/bounce" => work("events", counts.events, flights, bounces),
        "index" if plan.gathers_by_grid() => work("photons", counts.survivors, counting + scans + chunks, count + scan + sort),
        "index/count" => work("photons", counts.survivors, counting, count),
        "index/scan" => work("cells", cells, scans, scan),
        "index/sort" if plan.gathers_by_grid() => work("photons", counts.survivors, chunks, sort),
        "gather" => work("photons found", points * found, chunks * (1.0 + slicing), gather),
        "film" => work("sums", points * f64::from(plan.channel_count), 1.0, film),
        _ => None,
    }
}
