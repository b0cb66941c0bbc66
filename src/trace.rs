//! Photons of a chunk: emission, then bounce after bounce without a word from the host.

use crate::error::Result;
use crate::gpu::kernels::{DispatchSize, Emit, TraceAtomic, TraceBallot, TraceSlots};
use crate::gpu::{Commands, Extent, Kernel, Module};
use crate::plan::{EmissionRange, Plan, photons_of};
use crate::records::{DispatchSizePush, EmitPush, TracePush};
use crate::resources::Resources;
use crate::rng::words;
use crate::settings::Variant;

/// How survivors are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compaction {
    /// A slot each, stored or not: no atomics, but every thread lives through every bounce and the
    /// map holds `bounces` entries a photon.
    Slots,
    /// Two atomics a survivor: only living paths have threads, at the price of contention.
    Atomic,
    /// Two atomics a subgroup.
    Ballot,
}

impl Compaction {
    pub fn of(variant: Variant) -> Compaction {
        match variant {
            Variant::Naive => Compaction::Slots,
            Variant::Atomic => Compaction::Atomic,
            Variant::Ballot => Compaction::Ballot,
            Variant::Cpu => panic!("the CPU builder has no kernels"),
        }
    }

    fn module(self) -> Module {
        match self {
            Compaction::Slots => TraceSlots::MODULE,
            Compaction::Atomic => TraceAtomic::MODULE,
            Compaction::Ballot => TraceBallot::MODULE,
        }
    }
}

/// Kernels that tracing needs.
pub fn modules(plan: &Plan) -> Vec<Module> {
    let compaction = Compaction::of(plan.settings.variant);
    let mut modules = vec![Emit::MODULE, compaction.module()];
    if compaction != Compaction::Slots {
        modules.push(DispatchSize::MODULE);
    }
    modules
}

/// Groups along x that an indirect dispatch may ask for: what every device allows.
pub const INDIRECT_GROUPS_X: u32 = 65_535;

/// Traces the photons of a chunk into the photon map and adds their fates to the tallies.
pub fn chunk(commands: &mut Commands, resources: &Resources, plan: &Plan, round: u32, ranges: &[EmissionRange]) -> Result<()> {
    let photon_count = photons_of(ranges);
    commands.scope("build", |commands| {
        commands.fill(&resources.counters, 0, u64::from(plan.settings.bounces) + 2, 0);
        commands.fill(&resources.counters, 1, 1, photon_count);
        commands.add_work(plan.work.tracing(photon_count));
        commands.scope("emit", |commands| emit(commands, resources, plan, round, ranges))?;
        for bounce in 0..plan.settings.bounces {
            if commands.timestamps_left() < TIMESTAMP_RESERVE {
                commands.submit()?;
            }
            let name = format!("bounce {}", bounce + 1);
            commands.scope(&name, |commands| one_bounce(commands, resources, plan, round, bounce, photon_count))?;
        }
        Ok(())
    })
}

/// Writes the paths of a chunk as they leave their lights, light after light.
pub fn emit(commands: &mut Commands, resources: &Resources, plan: &Plan, round: u32, ranges: &[EmissionRange]) -> Result<()> {
    let Resources { lights, walls, stream_seeds, paths: [paths, _], oddities, .. } = resources;
    let streams = plan.streams();
    let mut path_offset = 0;
    for range in ranges {
        let jump = streams.jump(round, range.first_photon);
        let push = EmitPush {
            key: streams.key(round),
            light: range.light,
            first_photon: range.first_photon,
            photon_count: range.count,
            path_offset,
            first_sample: plan.first_sample(round, range),
            jump_multiplier: words(jump.multiplier),
            jump_increment: words(jump.increment),
        };
        commands.dispatch(Emit { lights, walls, stream_seeds, paths, oddities }, &push, Extent::Items(u64::from(range.count)))?;
        path_offset += range.count;
    }
    Ok(())
}

/// Timestamps that must be left for the scopes that are open and those that follow the bounces.
const TIMESTAMP_RESERVE: u32 = 64;

/// Timestamps after which a chunk need not submit on its own account.
pub fn timestamps_per_chunk(plan: &Plan) -> u32 {
    (6 * plan.settings.bounces + TIMESTAMP_RESERVE).min(4 * TIMESTAMP_RESERVE)
}

/// Entries of the photon map that a chunk uses: all slots, or as many as there is room for.
pub fn photon_list_capacity(plan: &Plan, photon_count: u32) -> u32 {
    if plan.has_slots() { photon_count * plan.settings.bounces } else { plan.photon_capacity }
}

fn one_bounce(commands: &mut Commands, resources: &Resources, plan: &Plan, round: u32, bounce: u32, photon_count: u32) -> Result<()> {
    let compaction = Compaction::of(plan.settings.variant);
    let push = TracePush {
        key: plan.streams().key(round),
        bounce,
        path_capacity: plan.path_capacity,
        photon_capacity: photon_list_capacity(plan, photon_count),
        eye: plan.settings.eye.into(),
    };
    // Every photon enters bounce 0, and the naive builder looks at every slot each time. After that
    // only the device knows how many paths are left.
    let extent = if bounce == 0 || compaction == Compaction::Slots {
        Extent::Items(u64::from(photon_count))
    } else {
        let size = DispatchSizePush {
            counter: 1 + bounce,
            capacity: plan.path_capacity,
            items_per_group: plan.settings.group_size,
            max_groups: INDIRECT_GROUPS_X,
        };
        let kernel = DispatchSize { counters: &resources.counters, dispatch_args: &resources.dispatch_args };
        commands.dispatch(kernel, &size, Extent::Groups(1, 1))?;
        Extent::Indirect(&resources.dispatch_args)
    };
    let [even, odd] = &resources.paths;
    let (paths, next_paths) = if bounce.is_multiple_of(2) { (even, odd) } else { (odd, even) };
    let Resources { rooms, walls, photons, counters, tallies, oddities, .. } = resources;
    match compaction {
        Compaction::Slots => {
            commands.dispatch(TraceSlots { rooms, walls, paths, next_paths, photons, counters, tallies, oddities }, &push, extent)
        }
        Compaction::Atomic => {
            commands.dispatch(TraceAtomic { rooms, walls, paths, next_paths, photons, counters, tallies, oddities }, &push, extent)
        }
        Compaction::Ballot => {
            commands.dispatch(TraceBallot { rooms, walls, paths, next_paths, photons, counters, tallies, oddities }, &push, extent)
        }
    }
}
