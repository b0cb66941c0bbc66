//! The line on the CPU.

use std::time::Instant;

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::book::Book;
use super::stop::End;
use super::{Control, Outcome, Replayed};
use crate::cpu::trace::Tracer;
use crate::cpu::{estimate, index::Index, nearest, tree::Tree};
use crate::error::{Error, Result};
use crate::film::Film;
use crate::ledger::fate;
use crate::oddities::{Oddities, What};
use crate::plan::{EmissionRange, Limits, Plan, photons_of};
use crate::records::{Path, Photon, Tally};
use crate::scene::room::RoomScene;
use crate::settings::{Settings, Variant};
use crate::timings::HostClock;

/// Runs on the CPU, on `settings.threads` threads.
pub fn on_cpu(scene: &RoomScene, settings: &Settings, control: &mut Control) -> Result<Outcome> {
    let started = Instant::now();
    let mut clock = HostClock::start("run");
    let plan = plan(scene, settings)?;
    let pool = thread_pool(settings)?;
    let tracer = Tracer::new(scene, &plan);
    let mut film = Film::new(&plan);
    // What the round under way has left so far.
    let mut sums = vec![0u64; film.sums.len()];
    let mut book = Book::new(&plan, control, started);
    let mut oddities = Oddities::default();
    let last_chunk = plan.chunks_per_round as usize - 1;
    for round in 0..settings.rounds {
        clock.time("round", |clock| {
            for (chunk, ranges) in plan.chunks().enumerate() {
                let (photons, tallies) = clock.time("build", |clock| trace(&pool, &tracer, &plan, round, &ranges, clock, &mut oddities));
                if plan.gathers_by_grid() {
                    let index = clock.time("index", |_| Index::build(plan.grid, &photons));
                    clock.time("gather", |_| pool.install(|| estimate::gather_grid(&plan, &index, &mut sums)));
                } else if plan.gathers_by_tree() {
                    let tree = clock.time("index", |_| Tree::build(&photons));
                    clock.time("gather", |_| {
                        pool.install(|| match settings.nearest {
                            Some(count) => nearest::gather(&plan, scene, &tree, count, &mut sums),
                            None => estimate::gather_tree(&plan, &tree, &mut sums),
                        });
                    });
                } else {
                    clock.time("gather", |_| pool.install(|| estimate::gather_brute(&plan, &photons, &mut sums)));
                }
                book.emitted += u64::from(photons_of(&ranges));
                film.emitted = book.emitted;
                if chunk == last_chunk {
                    clock.time("film", |_| film.end_round(&mut sums));
                    book.rounds += 1;
                    if book.wants_film() {
                        book.look(&film, scene, &plan);
                    }
                }
                if book.settle(&tallies)? {
                    break;
                }
            }
            Ok(())
        })?;
        if book.end.is_some() {
            break;
        }
    }
    if !book.is_whole() {
        film.add_unfinished(sums);
    }
    let end = book.end.unwrap_or(End::Rounds);
    Ok(Outcome {
        oddities: settings.paranoid.then_some(oddities),
        film,
        fates: book.fates,
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

/// Notes what no path and no photon may hold.
fn look_at(paths: &[Path], photons: &[Photon], round: u32, oddities: &mut Oddities) {
    let odd_paths = paths.iter().filter(|path| !(path.position.is_finite() && path.direction.is_finite() && path.flux.is_finite()));
    let odd_photons =
        photons.iter().filter(|photon| !(photon.position.is_finite() && photon.weight.is_finite() && photon.flux.is_finite()));
    for photon in odd_paths.map(|path| path.photon).chain(odd_photons.map(|photon| photon.photon)) {
        oddities.add(What::Photon, round, photon);
    }
}

fn plan(scene: &RoomScene, settings: &Settings) -> Result<Plan> {
    let settings = Settings { variant: Variant::Cpu, ..settings.clone() };
    Plan::new(scene, &settings, &Limits::of_host())
}

fn thread_pool(settings: &Settings) -> Result<ThreadPool> {
    let threads = settings.threads;
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| Error::setting("--threads", threads, format!("cannot be started ({error}); ask for fewer")))
}

/// Photons of a chunk and the fates of its paths, bounce by bounce.
fn trace(
    pool: &ThreadPool,
    tracer: &Tracer,
    plan: &Plan,
    round: u32,
    ranges: &[EmissionRange],
    clock: &mut HostClock,
    oddities: &mut Oddities,
) -> (Vec<Photon>, Vec<Tally>) {
    let mut paths = clock.time("emit", |_| tracer.emit(round, ranges));
    if plan.settings.paranoid {
        look_at(&paths, &[], round, oddities);
    }
    let mut photons = Vec::new();
    let mut tallies = Vec::new();
    for bounce in 0..plan.settings.bounces {
        let bounced = clock.time(&format!("bounce {}", bounce + 1), |_| pool.install(|| tracer.bounce(&paths, round, bounce)));
        if plan.settings.paranoid {
            look_at(&bounced.paths, &bounced.photons, round, oddities);
        }
        photons.extend(bounced.photons);
        tallies.push(bounced.tally);
        paths = bounced.paths;
    }
    (photons, tallies)
}

/// One photon by itself.
pub fn replay_on_cpu(scene: &RoomScene, settings: &Settings, round: u32, photon: u32) -> Result<Replayed> {
    let plan = plan(scene, settings)?;
    let tracer = Tracer::new(scene, &plan);
    let ranges = [plan.range_of(round, photon)?];
    let start = tracer.emit(round, &ranges)[0];
    let mut oddities = Oddities::default();
    let (stored, tallies) = trace(&thread_pool(settings)?, &tracer, &plan, round, &ranges, &mut HostClock::start("run"), &mut oddities);
    Ok(Replayed { start, stored, fate: fate(&tallies), oddities: settings.paranoid.then_some(oddities) })
}

/// The photon map of round 0, for comparing builders.
pub fn photons_on_cpu(scene: &RoomScene, settings: &Settings) -> Result<Vec<Photon>> {
    let mut clock = HostClock::start("run");
    let plan = plan(scene, settings)?;
    let pool = thread_pool(settings)?;
    let tracer = Tracer::new(scene, &plan);
    Ok(plan.chunks().flat_map(|ranges| trace(&pool, &tracer, &plan, 0, &ranges, &mut clock, &mut Oddities::default()).0).collect())
}
