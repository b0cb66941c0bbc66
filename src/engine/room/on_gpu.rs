//! The box on the GPU.

use std::cell::OnceCell;
use std::time::Instant;

use super::RunResult;
use crate::engine;
use crate::engine::error_bound::FilmError;
use crate::engine::film::{RoundSums, wide};
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::room::film::RoomFilm;
use crate::engine::room::resources::{RoomResources, RoundBuffers};
use crate::engine::room::{estimate, index, trace};
use crate::engine::run::{self, RunState, World};
use crate::engine::{Control, tallies};
use crate::error::Result;
use crate::gpu::{Commands, Constants, Gpu, Module};
use crate::ledger::{Fates, Losses};
use crate::plan::{RoomPlan, photons_of};
use crate::scene::room::RoomScene;
use crate::settings::RoomSettings;

struct RoomOnGpu<'a> {
    scene: &'a RoomScene,
    plan: &'a RoomPlan,
    resources: RoomResources,
    weights: OnceCell<Vec<f64>>,
}

/// Runs on the GPU.
pub fn on_gpu(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings, control: &mut Control) -> Result<RunResult> {
    let started = Instant::now();
    let plan = RoomPlan::new(scene, settings, &engine::limits(gpu.facts()))?;
    estimate::check_sums(&plan, gpu.facts())?;
    let (mut commands, pipelines_before) = run::commands(gpu, &modules(&plan, gpu), constants(&plan), settings.math, started)?;
    let resources = commands.scope("set-up", |commands| RoomResources::new(gpu, commands, scene, &plan))?;
    commands.warm_up()?;
    commands.submit()?;
    let world = RoomOnGpu { scene, plan: &plan, resources, weights: OnceCell::new() };
    run::run(world, commands, &plan, super::task(&plan, Some((gpu, pipelines_before))), control)
}

impl<'a> World for RoomOnGpu<'a> {
    type Recorder = Commands<'a>;
    type Film = RoomFilm;

    fn trace(&mut self, commands: &mut Commands<'a>, state: &mut RunState, chunk: u32) -> Result<()> {
        let RoomOnGpu { resources, plan, .. } = self;
        let ranges = plan.chunk(chunk);
        trace::chunk(commands, resources, plan, state.rounds, &ranges)?;
        index::build(commands, resources, plan, photons_of(&ranges))?;
        estimate::gather(commands, resources, plan, photons_of(&ranges))?;
        state.hand_out(0, photons_of(&ranges));
        if chunk + 1 == plan.chunks_per_round { estimate::end_round(commands, resources, plan, state.rounds) } else { Ok(()) }
    }

    fn is_full(&self, commands: &Commands<'a>) -> bool {
        commands.work() >= self.plan.pair_tests_per_submission || commands.timestamps_left() < trace::timestamps_per_chunk(self.plan)
    }

    fn collect(&mut self, commands: &mut Commands<'a>, state: &mut RunState) -> Result<()> {
        let tallies = tallies::read(commands, &self.resources.tallies, self.plan.settings.bounces)?;
        tallies::clear(commands, &self.resources.tallies);
        state.count(0, &tallies);
        Ok(())
    }

    fn film(&mut self, commands: &mut Commands<'a>, state: &RunState) -> Result<RoomFilm> {
        let RoomOnGpu { resources, plan, .. } = self;
        let mut film = RoomFilm { emitted: state.emitted, ..RoomFilm::new(plan) };
        let count = film.sums.len();
        let Some(RoundBuffers { totals, low_squares, high_squares, latest_rounds }) = &resources.rounds else {
            film.of_rounds = RoundSums { rounds: state.rounds, sums: commands.read(&resources.film, count)?, ..RoundSums::default() };
            return Ok(film);
        };
        let sums = commands.copy_out(totals, count)?;
        let (low, high) = (commands.copy_out(low_squares, count)?, commands.copy_out(high_squares, count)?);
        let latest = commands.copy_out(latest_rounds, film.latest.len())?;
        commands.submit()?;
        let squares = low.take().into_iter().zip(high.take()).map(|(low, high)| wide(low, high)).collect();
        film.of_rounds = RoundSums { rounds: state.rounds, sums: sums.take(), squares, latest: latest.take() };
        if !state.is_whole() {
            film.add_unfinished(commands.read(&resources.film, count)?);
        }
        Ok(film)
    }

    fn error(&self, film: &RoomFilm) -> FilmError {
        super::error(film, self.scene, self.plan, &self.weights)
    }

    fn losses(&self, _: &RoomFilm, fates: &[Fates]) -> Losses {
        super::losses(self.plan, fates)
    }

    fn nonfinite_values(&mut self, commands: &mut Commands<'a>) -> Result<Option<NonfiniteValues>> {
        NonfiniteValues::found(commands, &self.resources.nonfinite_values, self.plan.settings.paranoid)
    }
}

/// Specialization constants of a plan.
pub fn constants(plan: &RoomPlan) -> Constants {
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
