//! The box on the CPU.

use pulp::Arch;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::RunResult;
use crate::cpu::trace::{Block, Tracer};
use crate::cpu::{estimate, nearest, splat::Splats, tree::Tree};
use crate::engine::Control;
use crate::engine::nonfinite_values::{NonfiniteValues, What};
use crate::engine::room::film::RoomFilm;
use crate::engine::run::saved::WorldFilm;
use crate::engine::run::watch::Lazy;
use crate::engine::run::{self, RunState, Task, World};
use crate::error::{Error, Result};
use crate::ledger::Fates;
use crate::photon::Photon;
use crate::plan::{Limits, RoomPlan, photons_of};
use crate::records::Tally;
use crate::scene::room::RoomScene;
use crate::settings::{Builder, Gather, RoomSettings, Sums};
use crate::timings::HostClock;

struct RoomOnCpu<'a> {
    scene: &'a RoomScene,
    plan: &'a RoomPlan,
    pool: ThreadPool,
    tracer: Tracer<'a>,
    blocks: Vec<Block>,
    /// Fates of the latest chunk.
    tallies: Vec<Tally>,
    /// The same where that chunk ended its round.
    of_rounds: Fates,
    /// `None` where points gather.
    splats: Option<Splats<'a>>,
    /// What the round under way has left so far.
    sums: Vec<u64>,
    film: RoomFilm,
    nonfinite_values: NonfiniteValues,
}

/// Runs on the CPU, on `settings.threads` threads.
pub(crate) fn on_cpu(scene: &RoomScene, settings: &RoomSettings, control: &mut Control) -> Result<RunResult> {
    let clock = HostClock::start("run");
    let plan = &RoomPlan { is_kept: control.checkpointing.is_used(), ..plan(scene, settings)? };
    let identity = super::identity(&mut control.checkpointing, scene, plan, None)?;
    let pool = thread_pool(settings)?;
    let film = control.checkpointing.resume.as_ref().map_or_else(|| RoomFilm::new(plan), |(_, saved)| RoomFilm::of(&saved.film).clone());
    let world = RoomOnCpu {
        tracer: Tracer::new(scene, plan),
        blocks: Vec::new(),
        tallies: Vec::new(),
        of_rounds: Fates::new(plan.settings.bounces),
        splats: adds_by_splatting(plan).then(|| pool.install(|| Splats::new(plan, Arch::new()))),
        sums: vec![0; film.sums.len()],
        film,
        nonfinite_values: NonfiniteValues::default(),
        scene,
        plan,
        pool,
    };
    run::run(world, clock, plan, Task { identity, ..super::task(scene, plan) }, control)
}

impl World for RoomOnCpu<'_> {
    type Recorder = HostClock;
    type Film = RoomFilm;

    fn trace(&mut self, clock: &mut HostClock, state: &mut RunState<RoomFilm>, chunk: u32) -> Result<()> {
        let ranges = self.plan.chunk(chunk);
        clock.time("build", |_| {
            let round = state.round();
            self.pool.install(|| self.tracer.trace(round, &ranges, &mut self.blocks));
            self.tallies = tallies_of(&self.blocks, state.round(), self.plan, &mut self.nonfinite_values);
        });
        match &mut self.splats {
            Some(splats) => clock.time("gather", |_| self.pool.install(|| splats.add(&self.blocks))),
            None => self.gather(clock),
        }
        state.hand_out(0, photons_of(&ranges));
        if chunk + 1 == self.plan.chunks_per_round {
            clock.time("film", |_| {
                self.flush();
                self.film.end_round(state.round(), &mut self.sums);
            });
        }
        Ok(())
    }

    fn end_block(&mut self, _: &mut HostClock, _: &RunState<RoomFilm>) -> Result<()> {
        self.of_rounds = Fates::counted(&self.tallies, None);
        Ok(())
    }

    fn is_full(&self, _: &HostClock) -> bool {
        true
    }

    fn collect(&mut self, _: &mut HostClock, state: &mut RunState<RoomFilm>) -> Result<()> {
        let all = Fates::counted(&self.tallies, None);
        state.count(0, all.clone(), std::mem::replace(&mut self.of_rounds, Fates::new(self.plan.settings.bounces)));
        Ok(())
    }

    fn film(&mut self, _: &mut HostClock, state: &RunState<RoomFilm>) -> Result<Lazy<RoomFilm>> {
        let mut film = RoomFilm { emitted: state.emitted(), ..self.film.clone() };
        if state.rounds() == 0 {
            self.flush();
            film.sums.copy_from_slice(&self.sums);
        }
        Ok(Box::new(|| film))
    }

    fn nonfinite_values(&mut self, _: &mut HostClock) -> Result<Option<NonfiniteValues>> {
        Ok(self.plan.settings.paranoid.then(|| self.nonfinite_values.clone()))
    }
}

impl RoomOnCpu<'_> {
    /// Adds to the sums what each point receives, point by point.
    fn gather(&mut self, clock: &mut HostClock) {
        let RoomOnCpu { scene, plan, pool, blocks, sums, .. } = self;
        let photons = photons_of_blocks(blocks);
        if plan.settings.gather == Gather::Brute {
            return clock.time("gather", |_| pool.install(|| estimate::gather_brute(plan, &photons, sums)));
        }
        let tree = clock.time("index", |_| Tree::build(&photons));
        clock.time("gather", |_| {
            pool.install(|| match plan.settings.nearest {
                Some(count) => nearest::gather(plan, scene, &tree, count, sums),
                None => estimate::gather_tree(plan, &tree, sums),
            });
        });
    }

    /// Adds to the sums what splats hold.
    fn flush(&mut self) {
        let RoomOnCpu { pool, splats, sums, .. } = self;
        splats.iter_mut().for_each(|splats| pool.install(|| splats.flush(sums)));
    }
}

/// Integers come to the same whichever way they are added. Floats are added one by one, since that is what they are
/// asked for.
fn adds_by_splatting(plan: &RoomPlan) -> bool {
    plan.gathers_by_grid() && plan.settings.sums == Sums::Integer
}

/// What the CPU does with these settings.
pub(super) fn plan(scene: &RoomScene, settings: &RoomSettings) -> Result<RoomPlan> {
    let settings = RoomSettings { builder: Builder::Cpu, ..settings.clone() };
    RoomPlan::new(scene, &settings, &Limits::of_host())
}

pub(super) fn thread_pool(settings: &RoomSettings) -> Result<ThreadPool> {
    let threads = settings.threads;
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| Error::setting("threads", threads, format!("cannot be started ({error}); ask for fewer")))
}

/// Fates bounce by bounce. What `--paranoid` found is noted.
pub(super) fn tallies_of(blocks: &[Block], round: u32, plan: &RoomPlan, nonfinite_values: &mut NonfiniteValues) -> Vec<Tally> {
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

pub(super) fn photons_of_blocks(blocks: &[Block]) -> Vec<Photon> {
    blocks.iter().flat_map(|block| block.photons.iter().copied()).collect()
}
