//! Density estimates of the paper's box: adds to the film what each point receives from a chunk's photons, and ends a round.

pub(crate) mod tree;

use crate::constants::{GATHER_SLICE, MAX_GROUPS};
use crate::engine::room::Chunk;
use crate::engine::room::index::add_work;
use crate::engine::room::resources::{IndexBuffers, RoomResources, RoundBuffers};
use crate::error::{Result, require};
use crate::gpu::kernels::{CandidateCount, EndRound, GatherBruteTwoWords, GatherBruteU64, GatherGridTwoWords, GatherGridU64, SliceCount};
use crate::gpu::{Commands, DeviceFacts, Extent, Kernel, Module, dispatch_by_sums};
use crate::plan::RoomPlan;
use crate::records::{DispatchSizePush, EndRoundPush, GatherPush};
use crate::settings::Sums;

/// Refuses sums that a device cannot make.
pub(crate) fn check_sums(plan: &RoomPlan, facts: &DeviceFacts) -> Result<()> {
    let can_add = plan.settings.sums != Sums::Compensated || facts.int64_atomics;
    let why = format!("needs 64-bit atomics, which {} lacks; use `sums` integer or f32", facts.name);
    require(can_add, "sums", "compensated", why)
}

/// Whether kernels see a film sum as one 64-bit word: a float has a 32-bit word of its own.
fn adds_in_one_word(plan: &RoomPlan, facts: &DeviceFacts) -> bool {
    match plan.settings.sums {
        Sums::Integer => facts.int64_atomics,
        Sums::F32 => false,
        Sums::Compensated => true,
    }
}

/// Kernels that the estimate needs.
pub(crate) fn modules(plan: &RoomPlan, facts: &DeviceFacts) -> Vec<Module> {
    let mut modules = match (plan.gathers_by_tree(), plan.gathers_by_grid(), adds_in_one_word(plan, facts)) {
        (true, ..) => tree::modules(plan, facts),
        (_, false, true) => vec![GatherBruteU64::MODULE],
        (_, false, false) => vec![GatherBruteTwoWords::MODULE],
        (_, true, true) => vec![GatherGridU64::MODULE],
        (_, true, false) => vec![GatherGridTwoWords::MODULE],
    };
    if plan.gathers_by_grid() && plan.slices_candidates {
        modules.extend([CandidateCount::MODULE, SliceCount::MODULE]);
    }
    if plan.keeps_squares() {
        modules.push(EndRound::MODULE);
    }
    modules
}

/// A gather of all points; its dispatches each cover a part.
fn push_for_all_points(chunk: Chunk) -> GatherPush {
    let plan = chunk.plan;
    GatherPush {
        first_point: 0,
        end_point: plan.points.len() as u32,
        first_slice: 0,
        photon_capacity: chunk.photon_list_capacity(),
        radius_squared: (plan.settings.radius * plan.settings.radius) as f32,
        reach: plan.grid.reach,
        film_scale: plan.film_scale() as f32,
        origin: plan.grid.origin.into(),
        cells_per_metre: plan.grid.cells_per_metre,
        cell_count: plan.grid.cell_count.into(),
    }
}

/// Records all points in pieces, none so long that its dispatch would keep the device busy for long or exceed the groups that it
/// allows along x. `lanes` invocations share a point.
fn in_pieces(
    commands: &mut Commands,
    plan: &RoomPlan,
    tests_per_point: u64,
    lanes: u32,
    mut record: impl FnMut(&mut Commands, u32, u32) -> Result<()>,
) -> Result<()> {
    let (group_size, lanes) = (u64::from(plan.settings.group_size), u64::from(lanes));
    // Invocations are numbered in 32 bits.
    let most_groups = u64::from(commands.facts().work_group_count_x).min(u64::from(u32::MAX) / group_size);
    let (mut first, points) = (0, plan.points.len() as u64);
    while first < points {
        let groups = commands.paced(plan.pair_tests_per_submission) / tests_per_point.max(1) * lanes / group_size;
        let end = points.min(first + (groups.clamp(1, most_groups) * group_size / lanes).max(1));
        record(commands, first as u32, end as u32)?;
        first = end;
    }
    Ok(())
}

/// Adds a chunk to the film.
pub(crate) fn gather(commands: &mut Commands, chunk: Chunk) -> Result<()> {
    commands.scope("gather", |commands| match (&chunk.resources.tree, &chunk.resources.index) {
        (Some(tree), _) => tree::gather(commands, chunk, tree),
        (None, Some(index)) => gather_grid(commands, chunk, index),
        (None, None) => gather_brute(commands, chunk),
    })
}

/// Every point steps through the whole photon list, a slice of it an invocation.
fn gather_brute(commands: &mut Commands, chunk: Chunk) -> Result<()> {
    let Chunk { resources, plan, .. } = chunk;
    let RoomResources { film, room, photons, counters, .. } = resources;
    let whole = push_for_all_points(chunk);
    let slice_count = whole.photon_capacity.div_ceil(GATHER_SLICE);
    let tests_per_point = u64::from(GATHER_SLICE);
    in_pieces(commands, plan, tests_per_point, 1, |commands, first_point, end_point| {
        let point_count = end_point - first_point;
        let tests_per_slice = u64::from(point_count) * tests_per_point;
        let slices_at_once = (commands.paced(plan.pair_tests_per_submission) / tests_per_slice).clamp(1, u64::from(MAX_GROUPS)) as u32;
        for first_slice in (0..slice_count).step_by(slices_at_once as usize) {
            let slices = slices_at_once.min(slice_count - first_slice);
            let push = GatherPush { first_point, end_point, first_slice, ..whole };
            let extent = Extent::Groups(point_count.div_ceil(plan.settings.group_size), slices);
            let in_one_word = adds_in_one_word(plan, commands.facts());
            dispatch_by_sums!(commands, in_one_word, [GatherBruteU64, GatherBruteTwoWords] { room, film, photons, counters }, &push, extent)?;
            add_work(commands, plan, u64::from(slices) * tests_per_slice)?;
        }
        Ok(())
    })
}

/// Every point tests the photons of the grid cells in reach.
fn gather_grid(commands: &mut Commands, chunk: Chunk, index: &IndexBuffers) -> Result<()> {
    let Chunk { resources, plan, photon_count } = chunk;
    let RoomResources { film, room, dispatch_args, .. } = resources;
    let IndexBuffers { cells, sorted_photons, longest, .. } = index;
    let whole = push_for_all_points(chunk);
    if plan.slices_candidates {
        commands.fill(longest, 0, 1, 0);
        commands.dispatch(CandidateCount { room, longest, cells }, &whole, Extent::Items(u64::from(whole.end_point)))?;
    }
    let tests_per_point = plan.work.tests_per_point(photon_count);
    let group_size = plan.settings.group_size;
    in_pieces(commands, plan, tests_per_point, plan.lanes, |commands, first_point, end_point| {
        let capacity = (end_point - first_point) * plan.lanes;
        let extent = if plan.slices_candidates {
            let size = DispatchSizePush::new(0, capacity, group_size);
            commands.dispatch(SliceCount { longest, dispatch_args }, &size, Extent::Groups(1, 1))?;
            Extent::Indirect(dispatch_args)
        } else {
            Extent::Groups(capacity.div_ceil(group_size), 1)
        };
        let push = GatherPush { first_point, end_point, ..whole };
        let in_one_word = adds_in_one_word(plan, commands.facts());
        dispatch_by_sums!(commands, in_one_word, [GatherGridU64, GatherGridTwoWords] { room, film, cells, sorted_photons }, &push, extent)?;
        add_work(commands, plan, u64::from(end_point - first_point) * tests_per_point)
    })
}

/// Moves what a round left on the film to the sums and squares of all rounds, of which there are several.
pub(crate) fn end_round(commands: &mut Commands, resources: &RoomResources, plan: &RoomPlan, round: u32) -> Result<()> {
    let RoomResources { film, rounds: Some(RoundBuffers { film_totals, low_squares, high_squares, latest_blocks }), .. } = resources else {
        return Ok(());
    };
    let push = EndRoundPush { sum_count: plan.points.len() as u32 * plan.channel_count, channel_count: plan.channel_count, round };
    let kernel = EndRound { film, film_totals, low_squares, high_squares, latest_blocks };
    commands.scope("film", |commands| commands.dispatch(kernel, &push, Extent::Items(u64::from(push.sum_count))))
}
