//! The box on the GPU.

use std::time::Instant;

use super::RunResult;
use crate::constants::{KEPT_BLOCKS, TALLY_COPIES};
use crate::engine;
use crate::engine::film::{KeptBlock, wide};
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::room::film::RoomFilm;
use crate::engine::room::resources::{RoomResources, RoundBuffers};
use crate::engine::room::{Chunk, estimate, index, trace};
use crate::engine::run::saved::WorldFilm;
use crate::engine::run::watch::Lazy;
use crate::engine::run::{self, RunState, Task, World};
use crate::engine::{Control, tallies};
use crate::error::Result;
use crate::gpu::{Commands, Constants, Gpu, Module};
use crate::ledger::Fates;
use crate::plan::latest_blocks::kept_count;
use crate::plan::{RoomPlan, photons_of};
use crate::scene::room::RoomScene;
use crate::settings::RoomSettings;

pub(crate) struct RoomOnGpu<'a> {
    pub(super) plan: &'a RoomPlan,
    pub(super) resources: RoomResources,
}

/// Runs on the GPU.
pub(crate) fn on_gpu(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings, control: &mut Control) -> Result<RunResult> {
    let started = Instant::now();
    let plan = RoomPlan { is_kept: control.checkpointing.is_used(), ..RoomPlan::new(scene, settings, &engine::limits(gpu.facts()))? };
    let identity = super::identity(&mut control.checkpointing, scene, &plan, Some(gpu.facts()))?;
    estimate::check_sums(&plan, gpu.facts())?;
    let mut commands = run::commands(gpu, &modules(&plan, gpu), constants(&plan), settings.math, started)?;
    let resources = commands.scope("set-up", |commands| RoomResources::new(commands, scene, &plan))?;
    commands.warm_up()?;
    commands.submit()?;
    if let Some((_, saved)) = &control.checkpointing.resume {
        restore(&mut commands, &resources, &plan, RoomFilm::of(&saved.film))?;
    }
    let world = RoomOnGpu { plan: &plan, resources };
    run::run(world, commands, &plan, Task { identity, ..super::task(scene, &plan) }, control)
}

impl<'a> World for RoomOnGpu<'a> {
    type Recorder = Commands<'a>;
    type Film = RoomFilm;

    fn trace(&mut self, commands: &mut Commands<'a>, state: &mut RunState<RoomFilm>, chunk: u32) -> Result<()> {
        let RoomOnGpu { resources, plan, .. } = self;
        let ranges = plan.chunk(chunk);
        trace::chunk(commands, resources, plan, state.round(), &ranges)?;
        let traced = Chunk { resources, plan, photon_count: photons_of(&ranges) };
        index::build(commands, traced)?;
        estimate::gather(commands, traced)?;
        state.hand_out(0, traced.photon_count);
        if chunk + 1 == plan.chunks_per_round { estimate::end_round(commands, resources, plan, state.round()) } else { Ok(()) }
    }

    fn is_full(&self, commands: &Commands<'a>) -> bool {
        commands.is_full(self.plan.pair_tests_per_submission) || commands.timestamps_left() < trace::timestamps_per_chunk(self.plan)
    }

    fn end_block(&mut self, commands: &mut Commands<'a>, _: &RunState<RoomFilm>) -> Result<()> {
        // Of whole rounds alone nothing else is ever read.
        if self.plan.chunks_per_round > 1 {
            let RoomResources { tallies, tallies_of_rounds, .. } = &self.resources;
            commands.copy(tallies, tallies_of_rounds, tallies.count());
        }
        Ok(())
    }

    fn collect(&mut self, commands: &mut Commands<'a>, state: &mut RunState<RoomFilm>) -> Result<()> {
        let RoomResources { tallies, tallies_of_rounds, .. } = &self.resources;
        let copies = (self.plan.settings.bounces * TALLY_COPIES) as usize;
        let of_rounds = commands.copy_out(tallies_of_rounds, if self.plan.chunks_per_round > 1 { copies } else { 0 })?;
        let all = commands.read(tallies, copies)?;
        commands.clear(tallies);
        let all = Fates::counted(&tallies::sums(&all), None);
        let of_rounds = of_rounds.take();
        let of_rounds = if of_rounds.is_empty() { all.clone() } else { Fates::counted(&tallies::sums(&of_rounds), None) };
        state.count(0, all, of_rounds);
        Ok(())
    }

    fn film(&mut self, commands: &mut Commands<'a>, state: &RunState<RoomFilm>) -> Result<Lazy<RoomFilm>> {
        let RoomOnGpu { resources, plan, .. } = self;
        let mut film = RoomFilm { emitted: state.emitted(), ..RoomFilm::new(plan) };
        let count = film.sums.len();
        film.rounds = state.rounds();
        film.blocks = state.rounds();
        let Some(RoundBuffers { film_totals, low_squares, high_squares, latest_blocks }) =
            resources.rounds.as_ref().filter(|_| state.rounds() > 0)
        else {
            film.sums = commands.read(&resources.film, count)?;
            return Ok(Box::new(|| film));
        };
        let sums = commands.copy_out(film_totals, count)?;
        let (low, high) = (commands.copy_out(low_squares, count)?, commands.copy_out(high_squares, count)?);
        let values = commands.copy_out(latest_blocks, latest_blocks.count() as usize)?;
        commands.submit()?;
        film.sums = sums.take();
        film.squares = low.take().into_iter().zip(high.take()).map(|(low, high)| wide(low, high)).collect();
        let (values, kept) = (values.take(), kept_count(plan.points.len()));
        for (slot, number) in &state.kept {
            film.latest.push(KeptBlock { number: *number, values: values[*slot as usize * kept..][..kept].to_vec() });
        }
        Ok(Box::new(|| film))
    }

    fn nonfinite_values(&mut self, commands: &mut Commands<'a>) -> Result<Option<NonfiniteValues>> {
        NonfiniteValues::found(commands, &self.resources.nonfinite_values, self.plan.settings.paranoid)
    }
}

/// Goes on with a film.
fn restore(commands: &mut Commands, resources: &RoomResources, plan: &RoomPlan, film: &RoomFilm) -> Result<()> {
    let RoundBuffers { film_totals, low_squares, high_squares, latest_blocks } =
        resources.rounds.as_ref().expect("a plan that is kept has them");
    commands.upload(film_totals, &film.sums)?;
    commands.upload(low_squares, &film.squares.iter().map(|square| *square as u64).collect::<Vec<u64>>())?;
    commands.upload(high_squares, &film.squares.iter().map(|square| (*square >> 64) as u64).collect::<Vec<u64>>())?;
    let kept = kept_count(plan.points.len());
    let mut values = vec![0.0; latest_blocks.count() as usize];
    for block in film.latest.iter() {
        values[(block.number % KEPT_BLOCKS) as usize * kept..][..kept].copy_from_slice(&block.values);
    }
    commands.upload(latest_blocks, &values)?;
    commands.submit()
}

/// Specialization constants of a plan.
pub(crate) fn constants(plan: &RoomPlan) -> Constants {
    let settings = &plan.settings;
    Constants::new(settings.group_size)
        .set("RNG", settings.rng as u32)
        .set("PARANOID", u32::from(settings.paranoid))
        .set("STRICT_MATH", settings.math as u32)
        .set("EMISSION_LAW", settings.emission as u32)
        .set("HAS_PHONG", u32::from(settings.has_phong()))
        .set("PHONG_DIRECTION", settings.phong_direction as u32)
        .set("HAS_SLOTS", u32::from(plan.has_slots()))
        .set("HAS_ORIGINS", u32::from(plan.keeps_origins))
        .set("COUNTERS", plan.counters)
        .set("LANES", plan.lanes)
        .set("HAS_SLICES", u32::from(plan.slices_candidates))
        .set("CHANNEL_COUNT", plan.channel_count)
        .set("SUMS", settings.sums as u32)
}

/// Kernels that the plan needs, and no others.
pub(in crate::engine) fn modules(plan: &RoomPlan, gpu: &Gpu) -> Vec<Module> {
    [trace::modules(plan), index::modules(plan), estimate::modules(plan, gpu.facts())].concat()
}
