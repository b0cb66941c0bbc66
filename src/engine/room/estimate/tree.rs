//! Density estimation over the kd-tree: with all photons within the radius, or with the nearest of them.

use super::{adds_in_one_word, in_pieces, push_for_all_points};
use crate::constants::GATHER_SLICE;
use crate::engine::room::Chunk;
use crate::engine::room::index::add_work;
use crate::engine::room::resources::{RoomResources, SearchBuffers, TreeBuffers};
use crate::error::Result;
use crate::gpu::kernels::{GatherTreeTwoWords, GatherTreeU64, NearestTwoWords, NearestU64, SliceCount};
use crate::gpu::{Commands, DeviceFacts, Extent, Kernel, Module, dispatch_by_sums};
use crate::plan::RoomPlan;
use crate::records::{DispatchSizePush, GatherPush, NearestPush};

/// Kernels that the estimate needs.
pub(super) fn modules(plan: &RoomPlan, facts: &DeviceFacts) -> Vec<Module> {
    match (plan.settings.nearest, adds_in_one_word(plan, facts)) {
        (None, true) => vec![SliceCount::MODULE, GatherTreeU64::MODULE],
        (None, false) => vec![SliceCount::MODULE, GatherTreeTwoWords::MODULE],
        (Some(_), true) => vec![NearestU64::MODULE],
        (Some(_), false) => vec![NearestTwoWords::MODULE],
    }
}

pub(super) fn gather(commands: &mut Commands, chunk: Chunk, tree: &TreeBuffers) -> Result<()> {
    match (&tree.searches, chunk.plan.settings.nearest) {
        (Some(searches), Some(nearest)) => gather_nearest(commands, chunk, tree, searches, nearest),
        _ => gather_radius(commands, chunk, tree),
    }
}

/// Every point tests the photons of the leaves in reach, a slice of its wall's leaves an invocation.
fn gather_radius(commands: &mut Commands, chunk: Chunk, tree: &TreeBuffers) -> Result<()> {
    let Chunk { resources, plan, photon_count } = chunk;
    let RoomResources { film, room, dispatch_args, .. } = resources;
    let TreeBuffers { wall_begins, planes, tree_photons, longest, .. } = tree;
    let whole = push_for_all_points(chunk);
    let tests_per_point = plan.work.tests_per_point(photon_count);
    in_pieces(commands, plan, tests_per_point, 1, |commands, first_point, end_point| {
        let size = DispatchSizePush::new(0, end_point - first_point, plan.settings.group_size);
        commands.dispatch(SliceCount { longest, dispatch_args }, &size, Extent::Groups(1, 1))?;
        let push = GatherPush { first_point, end_point, ..whole };
        let extent = Extent::Indirect(dispatch_args);
        let in_one_word = adds_in_one_word(plan, commands.facts());
        dispatch_by_sums!(
            commands,
            in_one_word,
            [GatherTreeU64, GatherTreeTwoWords] { room, film, wall_begins, planes, tree_photons },
            &push,
            extent
        )?;
        add_work(commands, plan, u64::from(end_point - first_point) * tests_per_point)
    })
}

/// Every point searches for its nearest photons, all of them its own invocation's. How long a search is depends on
/// how the photons lie; each dispatch does a bounded part of it, and the host asks whether any is left.
fn gather_nearest(
    commands: &mut Commands,
    Chunk { resources, plan, photon_count }: Chunk,
    tree: &TreeBuffers,
    buffers: &SearchBuffers,
    nearest_count: u32,
) -> Result<()> {
    let RoomResources { film, room, .. } = resources;
    let TreeBuffers { wall_begins, planes, tree_photons, tree_origins, .. } = tree;
    let SearchBuffers { nearest_photons, searches, unfinished, .. } = buffers;
    let tests_per_point = plan.work.tests_per_point(photon_count).min(u64::from(GATHER_SLICE));
    let in_one_word = adds_in_one_word(plan, commands.facts());
    in_pieces(commands, plan, tests_per_point, 1, |commands, first, last| {
        for first_point in (first..last).step_by(searches.count() as usize) {
            let end_point = last.min(first_point + searches.count() as u32);
            let mut push = NearestPush {
                first_point,
                end_point,
                nearest: nearest_count,
                is_first: 1,
                radius_squared: (plan.settings.radius * plan.settings.radius) as f32,
                film_shift: plan.film_shift,
            };
            loop {
                commands.fill(unfinished, 0, 1, 0);
                commands.add_work(u64::from(end_point - first_point) * tests_per_point);
                let extent = Extent::Items(u64::from(end_point - first_point));
                dispatch_by_sums!(
                    commands,
                    in_one_word,
                    [NearestU64, NearestTwoWords] {
                        room, film, wall_begins, planes, tree_photons, tree_origins, nearest_photons, searches, unfinished
                    },
                    &push,
                    extent
                )?;
                if commands.read(unfinished, 1)? == [0] {
                    break;
                }
                push.is_first = 0;
            }
        }
        Ok(())
    })
}
