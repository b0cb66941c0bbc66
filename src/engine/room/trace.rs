//! Photons of a chunk, without a word from the host: emission, then bounce after bounce of all paths; or photon by photon.

mod in_order;

use crate::constants::{MAX_GROUPS, PATHS_TOGETHER};
use crate::engine::room::Chunk;
use crate::engine::room::resources::RoomResources;
use crate::error::Result;
use crate::gpu::kernels::{
    EmitRoom, EndBounce, FillGaps, ScanAdd, ScanBlocks, ScanMoveRoom, TracePersistentRoom, TraceRoomAtomic, TraceRoomBallot,
    TraceRoomGroup, TraceRoomNaive, TraceRoomScan,
};
use crate::gpu::{Commands, Extent, Kernel, Module};
use crate::plan::{EmissionRange, RoomPlan, photons_of};
use crate::records::{EmitPush, EndBouncePush, FillGapsPush, PhotonRange, TracePersistentPush, TracePush};
use crate::rng::words;
use crate::settings::Builder;
use crate::timings::Handled;

/// Kernels that tracing needs.
pub(crate) fn modules(plan: &RoomPlan) -> Vec<Module> {
    match plan.settings.builder {
        Builder::Naive => vec![EmitRoom::MODULE, TraceRoomNaive::MODULE],
        Builder::Atomic if plan.counters > 1 => vec![EmitRoom::MODULE, TraceRoomAtomic::MODULE, FillGaps::MODULE, EndBounce::MODULE],
        Builder::Atomic => vec![EmitRoom::MODULE, TraceRoomAtomic::MODULE, EndBounce::MODULE],
        Builder::Ballot => vec![EmitRoom::MODULE, TraceRoomBallot::MODULE, EndBounce::MODULE],
        Builder::Group => vec![EmitRoom::MODULE, TraceRoomGroup::MODULE, EndBounce::MODULE],
        Builder::Scan => {
            vec![EmitRoom::MODULE, TraceRoomScan::MODULE, ScanBlocks::MODULE, ScanAdd::MODULE, ScanMoveRoom::MODULE, EndBounce::MODULE]
        }
        Builder::Persistent => vec![TracePersistentRoom::MODULE],
        Builder::Cpu => panic!("the CPU builder has no kernels"),
    }
}

/// Traces the photons of a chunk into the photon map and adds their fates to the tallies.
pub(crate) fn chunk(
    commands: &mut Commands,
    resources: &RoomResources,
    plan: &RoomPlan,
    round: u32,
    ranges: &[EmissionRange],
) -> Result<()> {
    let photon_count = photons_of(ranges);
    let chunk = Chunk { resources, plan, photon_count };
    commands.scope("build", |commands| {
        commands.fill(&resources.counters, 0, plan.counter_array_length(), 0);
        commands.fill(&resources.counters, 1, 1, photon_count);
        commands.add_work(plan.work.tracing(photon_count));
        commands.count(Handled { photons: photon_count.into(), ..Handled::default() });
        if plan.settings.builder == Builder::Persistent {
            return trace_persistent(commands, chunk, round, ranges);
        }
        commands.scope("emit", |commands| emit(commands, resources, plan, round, ranges))?;
        for bounce in 0..plan.settings.bounces {
            if commands.timestamps_left() < TIMESTAMP_RESERVE {
                commands.submit()?;
            }
            let name = format!("bounce {}", bounce + 1);
            commands.scope(&name, |commands| one_bounce(commands, chunk, round, bounce))?;
        }
        Ok(())
    })
}

/// Writes the paths of a chunk as lights emit them, light after light.
pub(crate) fn emit(
    commands: &mut Commands,
    resources: &RoomResources,
    plan: &RoomPlan,
    round: u32,
    ranges: &[EmissionRange],
) -> Result<()> {
    let RoomResources { room, stream_seeds, paths: [paths, _], nonfinite_values, .. } = resources;
    let mut path_offset = 0;
    for range in ranges {
        let push = EmitPush {
            key: plan.streams().key(round),
            range: photon_range(plan, round, range),
            path_offset,
            path_capacity: plan.path_array_length(),
        };
        commands.dispatch(
            EmitRoom { room, stream_seeds, next_paths: paths, nonfinite_values },
            &push,
            Extent::Items(u64::from(range.count)),
        )?;
        path_offset += range.count;
    }
    Ok(())
}

fn photon_range(plan: &RoomPlan, round: u32, range: &EmissionRange) -> PhotonRange {
    let jump = plan.streams().jump(round, range.first_photon);
    PhotonRange {
        light: range.light,
        first_photon: range.first_photon,
        count: range.count,
        first_sample: plan.first_sample(round, range),
        jump_multiplier: words(jump.multiplier),
        jump_increment: words(jump.increment),
    }
}

/// Traces every photon from its light to its end.
fn trace_persistent(commands: &mut Commands, Chunk { resources, plan, .. }: Chunk, round: u32, ranges: &[EmissionRange]) -> Result<()> {
    let RoomResources { room, stream_seeds, photons, origins, counters, tallies, nonfinite_values, .. } = resources;
    for range in ranges.iter().flat_map(|range| range.parts(plan.photons_per_dispatch())) {
        let push = TracePersistentPush {
            key: plan.streams().key(round),
            range: photon_range(plan, round, &range),
            stride: plan.persistence.invocations(range.count),
            bounces: plan.settings.bounces,
            photon_capacity: plan.photon_capacity,
            eye: plan.settings.eye.into(),
        };
        let kernel = TracePersistentRoom { room, stream_seeds, photons, origins, counters, tallies, nonfinite_values };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(push.stride)))?;
    }
    Ok(())
}

/// Timestamps that must be left for the scopes that are open and those that follow the bounces.
const TIMESTAMP_RESERVE: u32 = 64;

/// Timestamps after which a chunk need not submit on its own account.
pub(crate) fn timestamps_per_chunk(plan: &RoomPlan) -> u32 {
    (6 * plan.settings.bounces + TIMESTAMP_RESERVE).min(4 * TIMESTAMP_RESERVE)
}

/// Paths that an invocation takes through a bounce.
fn paths_each(builder: Builder) -> u32 {
    match builder {
        Builder::Ballot | Builder::Group => PATHS_TOGETHER,
        _ => 1,
    }
}

fn one_bounce(commands: &mut Commands, chunk: Chunk, round: u32, bounce: u32) -> Result<()> {
    let Chunk { resources, plan, photon_count } = chunk;
    let builder = plan.settings.builder;
    let push = TracePush {
        key: plan.streams().key(round),
        bounce,
        bounces: plan.settings.bounces,
        path_capacity: plan.path_capacity,
        photon_capacity: chunk.photon_list_capacity(),
        eye: plan.settings.eye.into(),
    };
    // Every photon enters bounce 0, and the naive builder looks at every slot each time. After that
    // only the device knows how many paths are left.
    let extent = || {
        if bounce == 0 || builder == Builder::Naive {
            Extent::Items(u64::from(photon_count.div_ceil(paths_each(builder))))
        } else {
            Extent::Indirect(&resources.dispatch_args)
        }
    };
    let [even, odd] = &resources.paths;
    let (paths, next_paths) = if bounce.is_multiple_of(2) { (even, odd) } else { (odd, even) };
    let RoomResources { room, photons, origins, counters, tallies, nonfinite_values, .. } = resources;
    macro_rules! trace {
        ($kernel:ident) => {
            commands.dispatch($kernel { room, paths, next_paths, photons, origins, counters, tallies, nonfinite_values }, &push, extent())
        };
    }
    match builder {
        Builder::Naive => trace!(TraceRoomNaive),
        Builder::Atomic => trace!(TraceRoomAtomic),
        Builder::Ballot => trace!(TraceRoomBallot),
        Builder::Group => trace!(TraceRoomGroup),
        Builder::Scan => in_order::one_bounce(commands, chunk, [paths, next_paths], &push, extent),
        Builder::Persistent | Builder::Cpu => panic!("{} has no bounces of all paths", builder.name()),
    }?;
    if builder == Builder::Naive {
        return Ok(());
    }
    if plan.counters > 1 {
        let TracePush { bounces, path_capacity, photon_capacity, .. } = push;
        let gaps = FillGapsPush { bounce, bounces, path_capacity, photon_capacity };
        commands.dispatch(FillGaps { counters, photons, next_paths }, &gaps, Extent::Groups(1, 1))?;
    }
    let end = EndBouncePush {
        bounce,
        photon_capacity: push.photon_capacity,
        items_per_group: plan.settings.group_size * paths_each(builder),
        max_groups: MAX_GROUPS,
    };
    commands.dispatch(EndBounce { counters, dispatch_args: &resources.dispatch_args }, &end, Extent::Groups(1, 1))
}
