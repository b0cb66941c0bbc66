//! Makes the buffers of the paper's box that `plan::buffers` lists, and uploads the room.

use glam::UVec2;

use crate::engine::planned::{Planned, buffers};
use crate::error::Result;
use crate::gpu::{Buffer, Commands, kernels};
use crate::photon::{Origin, StoredPhoton};
use crate::photon_state::PackedPhotonState;
use crate::plan::RoomPlan;
use crate::plan::buffers::{NONFINITE_VALUES, room};
use crate::records::{DispatchArgs, Search, Tally};
use crate::scene::room::RoomScene;
use crate::settings::Builder;

buffers! {
    pub(crate) struct RoomResources(planned: &Planned, commands: &mut Commands, scene: &RoomScene, plan: &RoomPlan) {
        /// Written once.
        room: kernels::Room = kernels::Room {
            rooms: planned.filled(commands, room::ROOMS, &[scene.room_record()])?,
            walls: planned.filled(commands, room::WALLS, &scene.wall_records())?,
            lights: planned.filled(commands, room::LIGHTS, &scene.light_records(&plan.relative_flux))?,
            points: planned.filled(commands, room::POINTS, &plan.points)?,
        },
        stream_seeds: Buffer<UVec2> =
            planned.filled(commands, room::STREAM_SEEDS, &plan.streams().first_states(plan.path_capacity))?,
        // Photons of the chunk under way.
        /// Paths entering even bounces and odd bounces; one element, for a replay, where no bounce hands paths to the next.
        paths: [Buffer<PackedPhotonState>; 2] = planned.several(room::PATHS)?,
        photons: Buffer<StoredPhoton> = planned.one(room::PHOTONS)?,
        /// Which photon each entry of the photon map is; one empty element where nobody asks.
        origins: Buffer<Origin> = planned.one(room::ORIGINS)?,
        /// Length of the photon map, the paths entering each bounce, and the counters that work groups use round-robin.
        counters: Buffer<u32> = planned.one(room::COUNTERS)?,
        dispatch_args: Buffer<DispatchArgs> = planned.one(room::DISPATCH_ARGS)?,
        /// What keeps photons in order; `None` where they come as they do.
        order: Option<OrderBuffers> =
            (plan.settings.builder == Builder::Scan).then(|| OrderBuffers::made(planned)).transpose()?,
        /// Ledger of the submission under way; see `tallies`.
        tallies: Buffer<Tally> = planned.zeroed(commands, room::TALLIES)?,
        /// The same as the latest whole round left it.
        tallies_of_rounds: Buffer<Tally> = planned.zeroed(commands, room::TALLIES_OF_ROUNDS)?,
        /// The grid; `None` where the gather has another index or none.
        index: Option<IndexBuffers> = plan.gathers_by_grid().then(|| IndexBuffers::made(planned)).transpose()?,
        /// The kd-tree; `None` where the gather has another index or none.
        tree: Option<TreeBuffers> = plan.gathers_by_tree().then(|| TreeBuffers::made(planned, plan)).transpose()?,
        /// What the round under way has left so far; of a single round, the result.
        film: Buffer<u64> = planned.zeroed(commands, room::FILM)?,
        /// What all rounds left; `None` of a single one.
        rounds: Option<RoundBuffers> = plan.keeps_squares().then(|| RoundBuffers::made(planned, commands)).transpose()?,
        nonfinite_values: Buffer<u32> = planned.zeroed(commands, NONFINITE_VALUES)?,
    }
}

impl RoomResources {
    /// Makes the buffers and records the upload of what never changes.
    pub(crate) fn new(commands: &mut Commands, scene: &RoomScene, plan: &RoomPlan) -> Result<RoomResources> {
        RoomResources::made(&Planned { gpu: commands.gpu(), buffers: plan.buffers() }, commands, scene, plan)
    }
}

buffers! {
    /// Survivors of a bounce, for prefix sums over them.
    pub(crate) struct OrderBuffers(planned: &Planned) {
        /// Survivors in each work group of paths, then their prefix sums, and the sum of all behind them.
        survivors: Buffer<u32> = planned.one(room::SURVIVORS)?,
        sums_of_survivors: Vec<Buffer<u32>> = planned.all(room::SUMS_OF_SURVIVORS)?,
        /// Weight at the eye of each path's photon; one element where all weigh 1.
        weights: Buffer<f32> = planned.one(room::WEIGHTS)?,
    }
}

buffers! {
    /// The rounds that have ended, sum by sum of the film.
    pub(crate) struct RoundBuffers(planned: &Planned, commands: &mut Commands) {
        film_totals: Buffer<u64> = planned.zeroed(commands, room::FILM_TOTALS)?,
        /// Lower and upper 64 bits of the sums of squares.
        low_squares: Buffer<u64> = planned.zeroed(commands, room::LOW_SQUARES)?,
        high_squares: Buffer<u64> = planned.zeroed(commands, room::HIGH_SQUARES)?,
        latest_blocks: Buffer<f32> = planned.zeroed(commands, room::LATEST_BLOCKS)?,
    }
}

buffers! {
    pub(crate) struct IndexBuffers(planned: &Planned) {
        /// Photons in each cell; after their prefix sums the first photon of each, and behind the last the number of all.
        cells: Buffer<u32> = planned.one(room::CELLS)?,
        /// Place of each entry of the photon map among those of its cell.
        ranks: Buffer<u32> = planned.one(room::RANKS)?,
        /// Sums of blocks of cells, sums of blocks of those, ... down to one.
        sums_of_cells: Vec<Buffer<u32>> = planned.all(room::SUMS_OF_CELLS)?,
        sorted_photons: Buffer<StoredPhoton> = planned.one(room::SORTED_PHOTONS)?,
        /// Candidates of the busiest point.
        longest: Buffer<u32> = planned.one(room::LONGEST)?,
    }
}

buffers! {
    /// The kd-tree of `glsl/index/tree.glsl`, and what it is built with.
    pub(crate) struct TreeBuffers(planned: &Planned, plan: &RoomPlan) {
        /// (order key, entry of the photon map) in the order along the walls' first axis and along their second, and one
        /// to write into, in changing roles.
        tree_lists: [Buffer<UVec2>; 3] = planned.several(room::TREE_LISTS)?,
        /// Place of each photon in the order along the axis that nodes are split along.
        tree_ranks: Buffer<u32> = planned.one(room::TREE_RANKS)?,
        /// Photons of each digit and run, or that go to the left; then their prefix sums.
        tree_counts: Buffer<u32> = planned.one(room::TREE_COUNTS)?,
        sums_of_tree_counts: Vec<Buffer<u32>> = planned.all(room::SUMS_OF_TREE_COUNTS)?,
        /// Sizes of dispatches of an invocation a photon, a run of them, and a share of a prefix sum.
        item_args: Buffer<DispatchArgs> = planned.one(room::ITEM_ARGS)?,
        run_args: Buffer<DispatchArgs> = planned.one(room::RUN_ARGS)?,
        scan_args: Buffer<DispatchArgs> = planned.one(room::SCAN_ARGS)?,
        /// First photon of each wall, and the number of all.
        wall_begins: Buffer<u32> = planned.one(room::WALL_BEGINS)?,
        /// Photons of the fullest wall.
        longest: Buffer<u32> = planned.one(room::LONGEST)?,
        planes: Buffer<f32> = planned.one(room::PLANES)?,
        tree_photons: Buffer<StoredPhoton> = planned.one(room::TREE_PHOTONS)?,
        /// Which photon each of them is; one empty element where nobody asks.
        tree_origins: Buffer<Origin> = planned.one(room::TREE_ORIGINS)?,
        /// Searches for nearest photons; `None` where the radius alone decides.
        searches: Option<SearchBuffers> = plan.settings.nearest.map(|_| SearchBuffers::made(planned)).transpose()?,
    }
}

buffers! {
    pub(crate) struct SearchBuffers(planned: &Planned) {
        /// Nearest photons of each point that is searched for.
        nearest_photons: Buffer<UVec2> = planned.one(room::NEAREST_PHOTONS)?,
        /// As many as go on at once.
        searches: Buffer<Search> = planned.one(room::SEARCHES)?,
        /// 1: some search has not ended.
        unfinished: Buffer<u32> = planned.one(room::UNFINISHED)?,
    }
}
