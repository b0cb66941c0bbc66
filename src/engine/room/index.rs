//! The index of a chunk's photons: counted by grid cell, prefix sums, sorted into cell order; or a kd-tree ([`tree`]).

pub(crate) mod tree;

use crate::engine::prefix_sum::scan;
use crate::engine::room::Chunk;
use crate::engine::room::resources::{IndexBuffers, RoomResources};
use crate::error::Result;
use crate::gpu::kernels::{CellCount, CellScatter, DispatchSize, ScanAdd, ScanBlocks};
use crate::gpu::{Commands, Extent, Kernel, Module};
use crate::plan::RoomPlan;
use crate::records::DispatchSizePush;

/// Kernels that the index needs.
pub(crate) fn modules(plan: &RoomPlan) -> Vec<Module> {
    if plan.gathers_by_tree() {
        return tree::modules();
    }
    if !plan.gathers_by_grid() {
        return Vec::new();
    }
    vec![CellCount::MODULE, ScanBlocks::MODULE, ScanAdd::MODULE, CellScatter::MODULE, DispatchSize::MODULE]
}

/// Sorts the photon map into cell order, or into the leaves of a kd-tree.
///
/// Does nothing where the plan has no index.
pub(crate) fn build(commands: &mut Commands, chunk: Chunk) -> Result<()> {
    let Chunk { resources, plan, .. } = chunk;
    if let Some(buffers) = &resources.tree {
        return commands.scope("index", |commands| tree::build(commands, chunk, buffers));
    }
    let RoomResources { room, photons, counters, dispatch_args, index: Some(index), .. } = resources else { return Ok(()) };
    let IndexBuffers { cells, ranks, sums_of_cells, sorted_photons, .. } = index;
    let push = plan.grid.index_push(chunk.photon_list_capacity());
    let extent = || if plan.has_slots() { Extent::Items(u64::from(push.photon_capacity)) } else { Extent::Indirect(dispatch_args) };
    commands.scope("index", |commands| {
        commands.scope("count", |commands| {
            commands.clear(cells);
            if !plan.has_slots() {
                let size = DispatchSizePush::new(0, push.photon_capacity, plan.settings.group_size);
                commands.dispatch(DispatchSize { counters, dispatch_args }, &size, Extent::Groups(1, 1))?;
            }
            commands.dispatch(CellCount { room, photons, counters, cells, ranks }, &push, extent())
        })?;
        commands.scope("scan", |commands| scan(commands, cells, sums_of_cells, plan.grid.cells() + 1, plan.settings.group_size))?;
        commands.scope("sort", |commands| {
            commands.dispatch(CellScatter { room, photons, counters, cells, sorted_photons, ranks }, &push, extent())
        })
    })
}

/// Counts work, and hands the commands over once they amount to a submission.
pub(crate) fn add_work(commands: &mut Commands, plan: &RoomPlan, pair_tests: u64) -> Result<()> {
    commands.add_work(pair_tests);
    if commands.is_due(plan.pair_tests_per_submission) { commands.submit() } else { Ok(()) }
}
