//! A bounce whose survivors keep their order, by prefix sums: reduce, then scan.

use crate::engine::prefix_sum::scan;
use crate::engine::room::Chunk;
use crate::engine::room::resources::{OrderBuffers, RoomResources};
use crate::error::Result;
use crate::gpu::kernels::{ScanMoveRoom, TraceRoomScan};
use crate::gpu::{Buffer, Commands, Extent};
use crate::photon_state::PackedPhotonState;
use crate::records::TracePush;

/// Survivors are counted by work group, the counts summed, and the survivors moved to where they belong.
pub(crate) fn one_bounce<'a>(
    commands: &mut Commands,
    Chunk { resources, plan, .. }: Chunk,
    [paths, next_paths]: [&Buffer<PackedPhotonState>; 2],
    push: &TracePush,
    extent: impl Fn() -> Extent<'a>,
) -> Result<()> {
    let RoomResources { room, photons, origins, counters, tallies, nonfinite_values, order, .. } = resources;
    let Some(OrderBuffers { survivors, sums_of_survivors, weights }) = order else { panic!("the plan has no order to keep") };
    // Groups that no path is left for count none, and so does the place behind the last, which becomes the sum of all.
    commands.clear(survivors);
    commands.dispatch(
        TraceRoomScan { room, paths, next_paths: paths, photons, origins, weights, counters, tallies, survivors, nonfinite_values },
        push,
        extent(),
    )?;
    scan(commands, survivors, sums_of_survivors, survivors.count() as u32, plan.settings.group_size)?;
    commands.dispatch(ScanMoveRoom { paths, next_paths, photons, origins, counters, tallies, survivors, weights }, push, extent())
}
