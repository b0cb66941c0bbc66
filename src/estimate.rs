//! Density estimation: adds to the film what each point receives from a chunk's photons.

use crate::constants::GATHER_SLICE;
use crate::error::Result;
use crate::gpu::kernels::{CandidateCount, GatherBruteTwoWords, GatherBruteU64, GatherGridTwoWords, GatherGridU64, SliceCount};
use crate::gpu::{Commands, DeviceFacts, Extent, Kernel, Module};
use crate::plan::Plan;
use crate::records::{DispatchSizePush, GatherPush};
use crate::resources::{IndexBuffers, Resources};
use crate::trace::photon_list_capacity;

/// Kernels that the estimate needs.
pub fn modules(plan: &Plan, facts: &DeviceFacts) -> Vec<Module> {
    match (plan.gathers_by_grid(), facts.int64_atomics) {
        (false, true) => vec![GatherBruteU64::MODULE],
        (false, false) => vec![GatherBruteTwoWords::MODULE],
        (true, true) => vec![CandidateCount::MODULE, SliceCount::MODULE, GatherGridU64::MODULE],
        (true, false) => vec![CandidateCount::MODULE, SliceCount::MODULE, GatherGridTwoWords::MODULE],
    }
}

/// Most groups along y that any device must allow.
const MAX_GROUPS_Y: u32 = 65_535;

fn push(plan: &Plan, photon_count: u32) -> GatherPush {
    GatherPush {
        first_point: 0,
        end_point: plan.points.len() as u32,
        first_slice: 0,
        photon_capacity: photon_list_capacity(plan, photon_count),
        radius_squared: (plan.settings.radius * plan.settings.radius) as f32,
        reach: plan.grid.reach,
        film_scale: plan.film_scale() as f32,
        origin: plan.grid.origin.into(),
        cells_per_metre: plan.grid.cells_per_metre,
        cell_count: plan.grid.cell_count.into(),
    }
}

/// Adds a chunk to the film.
pub fn gather(commands: &mut Commands, resources: &Resources, plan: &Plan, photon_count: u32) -> Result<()> {
    commands.scope("gather", |commands| match &resources.index {
        Some(index) => gather_grid(commands, resources, index, plan, photon_count),
        None => gather_brute(commands, resources, plan, photon_count),
    })
}

/// Every point steps through the whole photon list, a slice of it an invocation. The host hands over
/// the commands whenever they amount to a submission's work.
fn gather_brute(commands: &mut Commands, resources: &Resources, plan: &Plan, photon_count: u32) -> Result<()> {
    let Resources { film, points, photons, counters, .. } = resources;
    let whole = push(plan, photon_count);
    let slice_count = whole.photon_capacity.div_ceil(GATHER_SLICE);
    let budget = plan.pair_tests_per_submission;
    let slice = u64::from(GATHER_SLICE);
    // As many points as one slice's budget holds, then as many slices as these points leave room for.
    let points_at_once = (budget / slice).clamp(1, u64::from(whole.end_point)) as u32;
    let slices_at_once = (budget / (u64::from(points_at_once) * slice)).clamp(1, u64::from(MAX_GROUPS_Y)) as u32;
    for first_slice in (0..slice_count).step_by(slices_at_once as usize) {
        for first_point in (0..whole.end_point).step_by(points_at_once as usize) {
            let slices = slices_at_once.min(slice_count - first_slice);
            let end_point = whole.end_point.min(first_point.saturating_add(points_at_once));
            let push = GatherPush { first_point, end_point, first_slice, ..whole };
            let point_count = end_point - first_point;
            let extent = Extent::Groups(point_count.div_ceil(plan.settings.group_size), slices);
            if commands.facts().int64_atomics {
                commands.dispatch(GatherBruteU64 { points, film, photons, counters }, &push, extent)?;
            } else {
                commands.dispatch(GatherBruteTwoWords { points, film, photons, counters }, &push, extent)?;
            }
            commands.add_work(u64::from(slices) * u64::from(point_count) * slice);
            if commands.work() >= budget {
                commands.submit()?;
            }
        }
    }
    Ok(())
}

/// Every point tests the photons of the grid cells in reach.
fn gather_grid(commands: &mut Commands, resources: &Resources, index: &IndexBuffers, plan: &Plan, photon_count: u32) -> Result<()> {
    let Resources { film, points, dispatch_args, .. } = resources;
    let IndexBuffers { cells, sorted_photons, longest, .. } = index;
    let push = push(plan, photon_count);
    commands.fill(longest, 0, 1, 0);
    commands.dispatch(CandidateCount { points, longest, cells }, &push, Extent::Items(u64::from(push.end_point)))?;
    let size =
        DispatchSizePush { counter: 0, capacity: push.end_point, items_per_group: plan.settings.group_size, max_groups: MAX_GROUPS_Y };
    commands.dispatch(SliceCount { longest, dispatch_args }, &size, Extent::Groups(1, 1))?;
    commands.add_work(plan.work.pair_tests(photon_count));
    let extent = Extent::Indirect(dispatch_args);
    if commands.facts().int64_atomics {
        commands.dispatch(GatherGridU64 { points, film, cells, sorted_photons }, &push, extent)
    } else {
        commands.dispatch(GatherGridTwoWords { points, film, cells, sorted_photons }, &push, extent)
    }
}
