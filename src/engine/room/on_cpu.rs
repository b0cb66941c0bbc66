//! The line on the CPU.

use std::time::Instant;

use pulp::Arch;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::run_state::RunState;
use super::{Replayed, RunResult};
use crate::cpu::trace::{Block, Tracer};
use crate::cpu::{estimate, nearest, splat::Splats, tree::Tree};
use crate::engine::nonfinite_values::{NonfiniteValues, What};
use crate::engine::room::film::RoomFilm;
use crate::engine::{Control, End};
use crate::error::{Error, Result};
use crate::ledger::fate;
use crate::photon::Photon;
use crate::plan::{EmissionRange, Limits, RoomPlan, photons_of};
use crate::records::Tally;
use crate::scene::room::RoomScene;
use crate::settings::{Builder, Gather, RoomSettings, Sums};
use crate::timings::HostClock;

/// Runs on the CPU, on `settings.threads` threads.
pub fn on_cpu(scene: &RoomScene, settings: &RoomSettings, control: &mut Control) -> Result<RunResult> {
    let started = Instant::now();
    let mut clock = HostClock::start("run");
    let plan = plan(scene, settings)?;
    let pool = thread_pool(settings)?;
    let tracer = Tracer::new(scene, &plan);
    let mut film = RoomFilm::new(&plan);
    // What the round under way has left so far.
    let mut sums = vec![0u64; film.sums.len()];
    let mut state = RunState::new(&plan, control, started);
    let mut nonfinite_values = NonfiniteValues::default();
    let last_chunk = plan.chunks_per_round as usize - 1;
    let mut splats = adds_by_splatting(&plan).then(|| pool.install(|| Splats::new(&plan, Arch::new())));
    let mut blocks = Vec::new();
    for round in 0..settings.rounds {
        clock.time("round", |clock| {
            for (chunk, ranges) in plan.chunks().enumerate() {
                let tallies = clock.time("build", |_| {
                    pool.install(|| tracer.trace(round, &ranges, &mut blocks));
                    tallies_of(&blocks, round, &plan, &mut nonfinite_values)
                });
                match &mut splats {
                    Some(splats) => clock.time("gather", |_| pool.install(|| splats.add(&blocks))),
                    None => gather(&pool, scene, &plan, &photons_of_blocks(&blocks), &mut sums, clock),
                }
                state.emitted += u64::from(photons_of(&ranges));
                state.count(&tallies);
                film.emitted = state.emitted;
                if chunk == last_chunk {
                    clock.time("film", |_| {
                        splats.iter_mut().for_each(|splats| pool.install(|| splats.flush(&mut sums)));
                        film.end_round(&mut sums);
                    });
                    state.rounds += 1;
                    if state.wants_film() {
                        state.look(&film, scene, &plan);
                    }
                }
                if state.collect()? {
                    break;
                }
            }
            Ok(())
        })?;
        if state.end.is_some() {
            break;
        }
    }
    if !state.is_whole() {
        splats.iter_mut().for_each(|splats| pool.install(|| splats.flush(&mut sums)));
        film.add_unfinished(sums);
    }
    let end = state.end.unwrap_or(End::Rounds);
    Ok(RunResult {
        nonfinite_values: settings.paranoid.then_some(nonfinite_values),
        film,
        losses: state.losses(),
        fates: state.fates,
        end,
        cancelled: end == End::Cancelled,
        bias: None,
        timings: clock.finish(),
        device: None,
        dispatches: 0,
        submissions: 0,
        plan,
    })
}

/// Adds to `sums` what each point receives, point by point.
fn gather(pool: &ThreadPool, scene: &RoomScene, plan: &RoomPlan, photons: &[Photon], sums: &mut [u64], clock: &mut HostClock) {
    if plan.settings.gather == Gather::Brute {
        return clock.time("gather", |_| pool.install(|| estimate::gather_brute(plan, photons, sums)));
    }
    let tree = clock.time("index", |_| Tree::build(photons));
    clock.time("gather", |_| {
        pool.install(|| match plan.settings.nearest {
            Some(count) => nearest::gather(plan, scene, &tree, count, sums),
            None => estimate::gather_tree(plan, &tree, sums),
        });
    });
}

/// Integers come to the same whichever way they are added. Floats are added one by one, since that is what they are
/// asked for.
fn adds_by_splatting(plan: &RoomPlan) -> bool {
    plan.gathers_by_grid() && plan.settings.sums == Sums::Integer
}

fn plan(scene: &RoomScene, settings: &RoomSettings) -> Result<RoomPlan> {
    let settings = RoomSettings { builder: Builder::Cpu, ..settings.clone() };
    RoomPlan::new(scene, &settings, &Limits::of_host())
}

fn thread_pool(settings: &RoomSettings) -> Result<ThreadPool> {
    let threads = settings.threads;
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| Error::setting("--threads", threads, format!("cannot be started ({error}); ask for fewer")))
}

/// Fates bounce by bounce. What `--paranoid` found is noted.
fn tallies_of(blocks: &[Block], round: u32, plan: &RoomPlan, nonfinite_values: &mut NonfiniteValues) -> Vec<Tally> {
    let mut sums = vec![Tally::default(); plan.settings.bounces as usize];
    for block in blocks {
        for (sum, tally) in sums.iter_mut().zip(&block.tallies) {
            sum.stored += tally.stored;
            sum.absorbed += tally.absorbed;
            sum.escaped += tally.escaped;
            sum.dropped += tally.dropped;
        }
        block.odd.iter().for_each(|photon| nonfinite_values.add(What::Photon, round, *photon));
    }
    sums
}

fn photons_of_blocks(blocks: &[Block]) -> Vec<Photon> {
    blocks.iter().flat_map(|block| block.photons.iter().copied()).collect()
}

/// One photon by itself.
pub fn replay_on_cpu(scene: &RoomScene, settings: &RoomSettings, round: u32, photon: u32) -> Result<Replayed> {
    let plan = plan(scene, settings)?;
    let tracer = Tracer::new(scene, &plan);
    let ranges = [plan.range_of(round, photon)?];
    let start = tracer.emit(round, &ranges)[0];
    let mut nonfinite_values = NonfiniteValues::default();
    let mut blocks = Vec::new();
    tracer.trace(round, &ranges, &mut blocks);
    let tallies = tallies_of(&blocks, round, &plan, &mut nonfinite_values);
    let stored = photons_of_blocks(&blocks);
    Ok(Replayed { start, stored, fate: fate(&tallies), nonfinite_values: settings.paranoid.then_some(nonfinite_values) })
}

/// The photon map of round 0, for comparing builders.
pub fn photons_on_cpu(scene: &RoomScene, settings: &RoomSettings) -> Result<Vec<Photon>> {
    let plan = plan(scene, settings)?;
    let pool = thread_pool(settings)?;
    let tracer = Tracer::new(scene, &plan);
    let mut blocks = Vec::new();
    let of_chunk = |ranges: Vec<EmissionRange>| {
        pool.install(|| tracer.trace(0, &ranges, &mut blocks));
        photons_of_blocks(&blocks)
    };
    Ok(plan.chunks().flat_map(of_chunk).collect())
}
