//! The index of a map: photons counted by bucket of their cell, prefix sums, and sorted into the buckets' order.

use super::Round;
use super::resources::PhotonBuffers;
use crate::engine::prefix_sum::scan;
use crate::error::Result;
use crate::gpu::kernels::{DispatchSize, MapCount, MapScatter, ScanAdd, ScanBlocks};
use crate::gpu::{Commands, Extent, Kernel, Module};
use crate::plan::scene::MapPlan;
use crate::records::{CellPush, DispatchSizePush};
use crate::timings::Handled;

/// Kernels that the index needs.
pub(crate) fn modules() -> Vec<Module> {
    vec![MapCount::MODULE, MapScatter::MODULE, ScanBlocks::MODULE, ScanAdd::MODULE, DispatchSize::MODULE]
}

/// The grid of a map for points of this radius and smaller ones: cells as wide, its corner a little outside of the scene.
pub(crate) fn cells(round: Round, map: &MapPlan, radius: f32) -> CellPush {
    CellPush {
        origin: round.geometry.bounds.0 - 4.0 * radius,
        cells_per_unit: 1.0 / radius,
        bucket_mask: map.bucket_count - 1,
        photon_capacity: map.capacity,
        counts_stored: 1,
    }
}

/// Sorts the map, which holds so many photons where that is known, by the buckets of its cells.
pub(crate) fn build(commands: &mut Commands, round: Round, map_plan: &MapPlan, cells_push: &CellPush, stored: Option<u32>) -> Result<()> {
    let stored = stored.map_or(0, u64::from);
    let handle = |commands: &mut Commands, stored, bytes| commands.count(Handled { stored, bytes, ..Handled::default() });
    handle(commands, stored, 0);
    let plan = round.plan;
    let PhotonBuffers { map, sorted_map, counters, cells, ranks, sums_of_cells, dispatch_args, totals, .. } = round.photons();
    let totals = &totals[usize::from(map_plan.caustic_only)];
    let buckets = cells_push.bucket_mask + 1;
    commands.scope("count", |commands| {
        // The fill counts itself.
        handle(commands, stored, map_plan.bytes_of_counting(stored) - 4 * u64::from(buckets));
        commands.fill(cells, 0, u64::from(buckets) + 1, 0);
        let push = DispatchSizePush::new(0, cells_push.photon_capacity, plan.settings.group_size);
        commands.dispatch(DispatchSize { counters, dispatch_args }, &push, Extent::Groups(1, 1))?;
        commands.dispatch(MapCount { map, counters, cells, ranks }, cells_push, Extent::Indirect(dispatch_args))
    })?;
    commands.scope("scan", |commands| {
        handle(commands, 0, map_plan.bytes_of_scanning());
        scan(commands, cells, sums_of_cells, buckets + 1, plan.settings.group_size)
    })?;
    commands.scope("sort", |commands| {
        handle(commands, stored, map_plan.bytes_of_sorting(stored));
        commands.dispatch(MapScatter { map, counters, cells, sorted_map, ranks, totals }, cells_push, Extent::Indirect(dispatch_args))
    })
}
