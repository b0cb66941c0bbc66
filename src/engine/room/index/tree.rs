//! The kd-tree over a chunk's photons, built on the device. The layout is that of `glsl/index/tree.glsl`.
//!
//! Photons are sorted once along each of their wall's two axes (radix sort, wall first). From the root down, the
//! median of a node along one axis is then the middle of its list, and the list along the other axis is parted
//! stably by it: no node is sorted twice (Procopiuc, Agarwal, Arge and Vitter 2003; Brown 2015). How many photons
//! there are only the device knows, so dispatches are sized there, and heights that the tree does not reach are
//! passed over there.

use glam::UVec2;

use super::add_work;
use crate::constants::{TREE_DIGITS, TREE_LEAF};
use crate::engine::prefix_sum::scan_part;
use crate::engine::room::Chunk;
use crate::engine::room::resources::{RoomResources, TreeBuffers};
use crate::error::Result;
use crate::gpu::kernels::{
    ScanAdd, ScanBlocks, TreeCount, TreeKeys, TreeLeaves, TreeOrder, TreeRanks, TreeSides, TreeSizes, TreeSplit, TreeWalls,
};
use crate::gpu::{Buffer, Commands, Extent, Kernel, Module};
use crate::records::{DispatchSizePush, TreePush};

/// Kernels that the tree needs.
pub(crate) fn modules() -> Vec<Module> {
    vec![
        TreeSizes::MODULE,
        TreeKeys::MODULE,
        TreeCount::MODULE,
        ScanBlocks::MODULE,
        ScanAdd::MODULE,
        TreeOrder::MODULE,
        TreeWalls::MODULE,
        TreeRanks::MODULE,
        TreeSides::MODULE,
        TreeSplit::MODULE,
        TreeLeaves::MODULE,
    ]
}

/// Timestamps that must be left before a pass, where every dispatch takes two.
const TIMESTAMP_RESERVE: u32 = 64;

/// What all steps share.
#[derive(Clone, Copy)]
struct Step<'a> {
    chunk: Chunk<'a>,
    tree: &'a TreeBuffers,
}

/// Builds the tree of a chunk's photons.
pub(super) fn build(commands: &mut Commands, chunk: Chunk, tree: &TreeBuffers) -> Result<()> {
    let RoomResources { photons, origins, counters, .. } = chunk.resources;
    let TreeBuffers { tree_lists, wall_begins, item_args, run_args, scan_args, tree_photons, tree_origins, .. } = tree;
    let capacity = chunk.photon_list_capacity();
    let push = TreePush { photon_capacity: capacity, axis: 0, digit: 0, height: 0 };
    let one = Extent::Groups(1, 1);
    let size = DispatchSizePush::new(0, capacity, chunk.plan.settings.group_size);
    commands.dispatch(TreeSizes { photons, counters, item_args, run_args, scan_args }, &size, one)?;
    let step = Step { chunk, tree };
    commands.scope("sort", |commands| {
        // The last pass ends in the first list, then in the second.
        sort(commands, step, &TreePush { axis: 0, ..push }, [&tree_lists[1], &tree_lists[0]])?;
        sort(commands, step, &TreePush { axis: 1, ..push }, [&tree_lists[2], &tree_lists[1]])
    })?;
    commands.scope("split", |commands| {
        let (mut along, mut spare) = ([&tree_lists[0], &tree_lists[1]], &tree_lists[2]);
        for height in (1..=heights(capacity)).rev() {
            let push = TreePush { height, ..push };
            let axis = (height % 2) as usize;
            split(commands, step, &push, [along[axis], along[1 - axis]], spare)?;
            std::mem::swap(&mut along[1 - axis], &mut spare);
            make_room(commands, step)?;
        }
        let leaves = TreeLeaves { photons, origins, wall_begins, keys: along[0], tree_photons, tree_origins };
        commands.dispatch(leaves, &(), Extent::Indirect(item_args))
    })
}

/// Heights of nodes of two leaves and more that `capacity` photons on one wall may need.
fn heights(capacity: u32) -> u32 {
    capacity.div_ceil(TREE_LEAF).max(1).next_power_of_two().ilog2()
}

fn make_room(commands: &mut Commands, Step { chunk: Chunk { plan, photon_count, .. }, .. }: Step) -> Result<()> {
    if commands.timestamps_left() < TIMESTAMP_RESERVE {
        commands.submit()?;
    }
    add_work(commands, plan, plan.work.tree_pass(photon_count))
}

/// Sorts the photons by wall and along an axis; starts in the first list and ends in the second.
fn sort(commands: &mut Commands, step: Step, push: &TreePush, [mut keys, mut next_keys]: [&Buffer<UVec2>; 2]) -> Result<()> {
    let Step { chunk, tree } = step;
    let RoomResources { photons, counters, .. } = chunk.resources;
    let TreeBuffers { tree_counts, item_args, run_args, wall_begins, longest, .. } = tree;
    commands.dispatch(TreeKeys { photons, counters, keys }, push, Extent::Indirect(item_args))?;
    for digit in 0..=TREE_DIGITS {
        let push = TreePush { digit, ..*push };
        commands.dispatch(TreeCount { photons, counters, keys, tree_counts }, &push, Extent::Indirect(run_args))?;
        sum_counts(commands, step)?;
        if digit == TREE_DIGITS {
            commands.dispatch(TreeWalls { photons, counters, keys, tree_counts, wall_begins, longest }, &push, Extent::Groups(1, 1))?;
        }
        commands.dispatch(TreeOrder { photons, counters, keys, tree_counts, next_keys }, &push, Extent::Indirect(run_args))?;
        std::mem::swap(&mut keys, &mut next_keys);
        make_room(commands, step)?;
    }
    Ok(())
}

fn sum_counts(commands: &mut Commands, Step { chunk, tree }: Step) -> Result<()> {
    let threads = || Extent::Indirect(&tree.scan_args);
    scan_part(
        commands,
        &tree.tree_counts,
        &tree.sums_of_tree_counts,
        tree.tree_counts.count() as u32,
        chunk.plan.settings.group_size,
        &threads,
    )
}

/// Splits the nodes of a height at the middle of the order along one axis; parts the order along the other into
/// another list.
fn split(
    commands: &mut Commands,
    step: Step,
    push: &TreePush,
    [along, across]: [&Buffer<UVec2>; 2],
    next_keys: &Buffer<UVec2>,
) -> Result<()> {
    let TreeBuffers { wall_begins, longest, tree_ranks, tree_counts, planes, item_args, .. } = step.tree;
    let photons = || Extent::Indirect(item_args);
    commands.dispatch(TreeRanks { wall_begins, longest, keys: along, tree_ranks, planes }, push, photons())?;
    commands.dispatch(TreeSides { wall_begins, longest, keys: across, tree_ranks, tree_counts }, push, photons())?;
    sum_counts(commands, step)?;
    commands.dispatch(TreeSplit { wall_begins, longest, keys: across, tree_ranks, tree_counts, next_keys }, push, photons())
}
