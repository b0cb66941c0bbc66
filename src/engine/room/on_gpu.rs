//! The line on the GPU.

use std::time::Instant;

use super::run_state::RunState;
use super::{Replayed, RunResult};
use crate::constants::NO_WALL;
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::room::estimate;
use crate::engine::room::film::RoomFilm;
use crate::engine::room::index;
use crate::engine::room::resources::{RoomResources, RoundBuffers};
use crate::engine::room::trace;
use crate::engine::tallies;
use crate::engine::{self, Control, End};
use crate::error::Result;
use crate::gpu::check::strict_math;
use crate::gpu::{Commands, Constants, Gpu};
use crate::ledger::fate;
use crate::path;
use crate::path::StoredPath;
use crate::photon::{Origin, Photon, StoredPhoton};
use crate::plan::{EmissionRange, RoomPlan, photons_of};
use crate::scene::room::RoomScene;
use crate::settings::{Math, RoomSettings};

/// Runs on the GPU.
pub fn on_gpu(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings, control: &mut Control) -> Result<RunResult> {
    let started = Instant::now();
    let plan = RoomPlan::new(scene, settings, &engine::limits(gpu.facts()))?;
    estimate::check_sums(&plan, gpu.facts())?;
    if settings.math == Math::Strict {
        strict_math(gpu)?;
    }
    let mut commands = Commands::new(gpu, constants(&plan), started)?;
    commands.timings().count("run");
    let resources = commands.scope("set-up", |commands| RoomResources::new(gpu, commands, scene, &plan))?;
    prepare(gpu, &plan)?;
    commands.warm_up()?;
    commands.submit()?;

    let mut state = RunState::new(&plan, control, commands.started());
    state.submissions_collected = commands.submission_count();
    for round in 0..settings.rounds {
        commands.scope("round", |commands| {
            for (chunk, ranges) in (1..).zip(plan.chunks()) {
                trace::chunk(commands, &resources, &plan, round, &ranges)?;
                index::build(commands, &resources, &plan, photons_of(&ranges))?;
                estimate::gather(commands, &resources, &plan, photons_of(&ranges))?;
                state.emitted += u64::from(photons_of(&ranges));
                if chunk == plan.chunks_per_round {
                    estimate::end_round(commands, &resources, &plan)?;
                    state.rounds += 1;
                }
                if is_due(commands, &plan, &state) && collect(commands, &resources, scene, &plan, &mut state)? {
                    break;
                }
            }
            Ok(())
        })?;
        if state.end.is_some() {
            break;
        }
    }
    collect(&mut commands, &resources, scene, &plan, &mut state)?;
    let film = read_film(&mut commands, &resources, &plan, &state)?;
    let nonfinite_values = if settings.paranoid { Some(NonfiniteValues::read(&mut commands, &resources.nonfinite_values)?) } else { None };
    gpu.check_validation()?;

    let end = state.end.unwrap_or(End::Rounds);
    Ok(RunResult {
        nonfinite_values,
        film,
        losses: state.losses(),
        fates: state.fates,
        end,
        cancelled: end == End::Cancelled,
        bias: None,
        dispatches: commands.dispatch_count(),
        submissions: commands.submission_count(),
        timings: commands.finish("run"),
        device: Some(gpu.facts().clone()),
        plan,
    })
}

/// Specialization constants of a plan.
pub fn constants(plan: &RoomPlan) -> Constants {
    let settings = &plan.settings;
    Constants::new(settings.group_size)
        .set("RNG", settings.rng.code())
        .set("PARANOID", u32::from(settings.paranoid))
        .set("STRICT_MATH", settings.math.code())
        .set("EMISSION_LAW", settings.emission.code())
        .set("HAS_PHONG", u32::from(settings.has_phong()))
        .set("PHONG_DIRECTION", settings.phong_direction.code())
        .set("HAS_SLOTS", u32::from(plan.has_slots()))
        .set("HAS_ORIGINS", u32::from(plan.keeps_origins))
        .set("COUNTERS", plan.counters)
        .set("LANES", plan.lanes)
        .set("HAS_SLICES", u32::from(plan.slices_candidates))
        .set("CHANNEL_COUNT", plan.channel_count)
        .set("SUMS", settings.sums.code())
}

/// Makes the pipelines of the plan, and only those.
pub(in crate::engine) fn prepare(gpu: &Gpu, plan: &RoomPlan) -> Result<()> {
    let modules = [trace::modules(plan), index::modules(plan), estimate::modules(plan, gpu.facts())].concat();
    gpu.prepare(&modules, &constants(plan))
}

/// Whether the recorded commands should go to the device now.
fn is_due(commands: &Commands, plan: &RoomPlan, state: &RunState) -> bool {
    // Tallies are 32-bit on the device.
    let tallies_full = state.open() + u64::from(plan.path_capacity) > u64::from(u32::MAX);
    let timestamps_short = commands.timestamps_left() < trace::timestamps_per_chunk(plan);
    // A long gather hands commands over by itself, and nobody has looked at the result yet.
    let submitted = commands.submission_count() > state.submissions_collected;
    commands.work() >= plan.pair_tests_per_submission || submitted || timestamps_short || tallies_full || state.may_end()
}

/// Runs what is recorded, looks at the error where that is due, collects the fates, and says whether to stop.
fn collect(commands: &mut Commands, resources: &RoomResources, scene: &RoomScene, plan: &RoomPlan, state: &mut RunState) -> Result<bool> {
    if state.open() == 0 {
        return Ok(state.end.is_some());
    }
    let tallies = tallies::read(commands, &resources.tallies, plan.settings.bounces)?;
    tallies::clear(commands, &resources.tallies);
    state.count(&tallies);
    if state.wants_film() {
        let film = read_film(commands, resources, plan, state)?;
        state.look(&film, scene, plan);
    }
    state.submissions_collected = commands.submission_count();
    state.collect()
}

/// What all photons handed out so far have left.
fn read_film(commands: &mut Commands, resources: &RoomResources, plan: &RoomPlan, state: &RunState) -> Result<RoomFilm> {
    let mut film = RoomFilm { emitted: state.emitted, rounds: state.rounds, ..RoomFilm::new(plan) };
    let count = film.sums.len();
    let Some(RoundBuffers { totals, low_squares, high_squares }) = &resources.rounds else {
        film.sums = commands.read::<u64>(&resources.film, count)?;
        return Ok(film);
    };
    film.sums = commands.read::<u64>(totals, count)?;
    let (low, high) = (commands.read::<u64>(low_squares, count)?, commands.read::<u64>(high_squares, count)?);
    film.squares = low.into_iter().zip(high).map(|(low, high)| u128::from(low) | u128::from(high) << 64).collect();
    if !state.is_whole() {
        film.add_unfinished(commands.read::<u64>(&resources.film, count)?);
    }
    Ok(film)
}

/// The photon map of round 0, for comparing builders.
pub fn photons_on_gpu(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> Result<Vec<Photon>> {
    let plan = RoomPlan { keeps_origins: true, ..RoomPlan::new(scene, settings, &engine::limits(gpu.facts()))? };
    let mut commands = Commands::new(gpu, constants(&plan), Instant::now())?;
    let resources = RoomResources::new(gpu, &mut commands, scene, &plan)?;
    let mut photons = Vec::new();
    for ranges in plan.chunks() {
        photons.extend(stored(&mut commands, &resources, scene, &plan, 0, &ranges)?);
    }
    gpu.check_validation()?;
    Ok(photons)
}

/// One photon by itself. A photon is (seed, round, number), so it takes the same path alone as among millions.
pub fn replay_on_gpu(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings, round: u32, photon: u32) -> Result<Replayed> {
    let whole = RoomPlan::new(scene, settings, &engine::limits(gpu.facts()))?;
    let plan = RoomPlan { keeps_origins: true, counters: 1, path_capacity: 1, photon_capacity: settings.bounces, ..whole };
    if settings.math == Math::Strict {
        strict_math(gpu)?;
    }
    let ranges = [plan.range_of(round, photon)?];
    let mut commands = Commands::new(gpu, constants(&plan), Instant::now())?;
    let resources = RoomResources::new(gpu, &mut commands, scene, &plan)?;
    trace::emit(&mut commands, &resources, &plan, round, &ranges)?;
    let start = path::unpack(&commands.read::<StoredPath>(&resources.paths[0], 1)?, 0);
    let stored = stored(&mut commands, &resources, scene, &plan, round, &ranges)?;
    let tallies = tallies::read(&mut commands, &resources.tallies, settings.bounces)?;
    let nonfinite_values = if settings.paranoid { Some(NonfiniteValues::read(&mut commands, &resources.nonfinite_values)?) } else { None };
    gpu.check_validation()?;
    Ok(Replayed { start, stored, fate: fate(&tallies), nonfinite_values })
}

/// What a chunk leaves in the photon map.
fn stored(
    commands: &mut Commands,
    resources: &RoomResources,
    scene: &RoomScene,
    plan: &RoomPlan,
    round: u32,
    ranges: &[EmissionRange],
) -> Result<Vec<Photon>> {
    trace::chunk(commands, resources, plan, round, ranges)?;
    let capacity = trace::photon_list_capacity(plan, photons_of(ranges));
    let length = if plan.has_slots() { capacity } else { commands.read::<u32>(&resources.counters, 1)?[0].min(capacity) };
    let photons = commands.read::<StoredPhoton>(&resources.photons, length as usize)?;
    let origins = commands.read::<Origin>(&resources.origins, length as usize)?;
    let room = scene.room_record();
    let stored = photons.into_iter().zip(origins).map(|(photon, origin)| photon.photon(origin, &room));
    Ok(stored.filter(|photon| photon.wall != NO_WALL).collect())
}
