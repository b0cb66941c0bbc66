//! Makes the buffers of the paper's box that `plan::buffers` lists, and uploads the room.

use glam::UVec2;

use crate::engine::planned::Planned;
use crate::error::Result;
use crate::gpu::{Buffer, Commands, Gpu, kernels};
use crate::path::StoredPath;
use crate::photon::{Origin, StoredPhoton};
use crate::plan::RoomPlan;
use crate::records::{DispatchArgs, Search, Tally};
use crate::scene::room::RoomScene;
use crate::settings::Builder;

pub struct RoomResources {
    /// Written once.
    pub room: kernels::Room,
    pub stream_seeds: Buffer<UVec2>,
    // Photons of the chunk under way.
    /// Paths entering even bounces and odd bounces; one element, for a replay, where no bounce hands paths to the next.
    pub paths: [Buffer<StoredPath>; 2],
    pub photons: Buffer<StoredPhoton>,
    /// Which photon each entry of the photon map is; one empty element where nobody asks.
    pub origins: Buffer<Origin>,
    /// Length of the photon map, the paths entering each bounce, and the counters that are taken in turn.
    pub counters: Buffer<u32>,
    pub dispatch_args: Buffer<DispatchArgs>,
    /// What keeps photons in order; `None` where they come as they do.
    pub order: Option<OrderBuffers>,
    /// Ledger of the submission under way; see `tallies`.
    pub tallies: Buffer<Tally>,
    /// The grid; `None` where the gather has another index or none.
    pub index: Option<IndexBuffers>,
    /// The kd-tree; `None` where the gather has another index or none.
    pub tree: Option<TreeBuffers>,
    /// What the round under way has left so far; of a single round, the result.
    pub film: Buffer<u64>,
    /// What all rounds left; `None` of a single one.
    pub rounds: Option<RoundBuffers>,
    pub nonfinite_values: Buffer<u32>,
}

/// Survivors of a bounce, for prefix sums over them.
pub struct OrderBuffers {
    /// Survivors in each work group of paths, then their prefix sums, and the sum of all behind them.
    pub survivors: Buffer<u32>,
    pub block_sums: Vec<Buffer<u32>>,
    /// Weight at the eye of each path's photon; one element where all weigh 1.
    pub weights: Buffer<f32>,
}

/// The rounds that have ended, sum by sum of the film.
pub struct RoundBuffers {
    pub totals: Buffer<u64>,
    /// Lower and upper 64 bits of the sums of squares.
    pub low_squares: Buffer<u64>,
    pub high_squares: Buffer<u64>,
}

pub struct IndexBuffers {
    /// Photons in each cell; after their prefix sums the first photon of each, and behind the last the number of all.
    pub cells: Buffer<u32>,
    /// Place of each entry of the photon map among those of its cell.
    pub ranks: Buffer<u32>,
    /// Sums of blocks of cells, sums of blocks of those, ... down to one.
    pub block_sums: Vec<Buffer<u32>>,
    pub sorted_photons: Buffer<StoredPhoton>,
    /// Candidates of the busiest point.
    pub longest: Buffer<u32>,
}

/// The kd-tree of `glsl/index/tree.glsl`, and what it is built with.
pub struct TreeBuffers {
    /// (order key, entry of the photon map) in the order along the walls' first axis and along their second, and one
    /// to write into, in changing roles.
    pub lists: [Buffer<UVec2>; 3],
    /// Place of each photon in the order along the axis that nodes are split along.
    pub ranks: Buffer<u32>,
    /// Photons of each digit and run, or that go to the left; then their prefix sums.
    pub counts: Buffer<u32>,
    pub block_sums: Vec<Buffer<u32>>,
    /// Sizes of dispatches of an invocation a photon, a run of them, and a share of a prefix sum.
    pub item_args: Buffer<DispatchArgs>,
    pub run_args: Buffer<DispatchArgs>,
    pub scan_args: Buffer<DispatchArgs>,
    /// First photon of each wall, and the number of all.
    pub wall_begins: Buffer<u32>,
    /// Photons of the fullest wall.
    pub longest: Buffer<u32>,
    pub planes: Buffer<f32>,
    pub tree_photons: Buffer<StoredPhoton>,
    /// Which photon each of them is; one empty element where nobody asks.
    pub tree_origins: Buffer<Origin>,
    /// Searches for nearest photons; `None` where the radius alone decides.
    pub searches: Option<SearchBuffers>,
}

pub struct SearchBuffers {
    /// Nearest photons of each point that is searched for.
    pub nearest: Buffer<UVec2>,
    /// As many as go on at once.
    pub searches: Buffer<Search>,
    /// 1: some search has not ended.
    pub unfinished: Buffer<u32>,
}

impl RoomResources {
    /// Makes the buffers and records the upload of what never changes.
    pub fn new(gpu: &Gpu, commands: &mut Commands, scene: &RoomScene, plan: &RoomPlan) -> Result<RoomResources> {
        let planned = &Planned { gpu, buffers: plan.buffers() };
        Ok(RoomResources {
            room: kernels::Room {
                rooms: planned.filled(commands, "rooms", &[scene.room_record()])?,
                walls: planned.filled(commands, "walls", &scene.wall_records())?,
                lights: planned.filled(commands, "lights", &scene.light_records(&plan.relative_flux))?,
                points: planned.filled(commands, "points", &plan.points)?,
            },
            stream_seeds: planned.filled(commands, "stream seeds", &plan.streams().first_states(plan.path_capacity))?,
            paths: [planned.one("even paths")?, planned.one("odd paths")?],
            photons: planned.one("photons")?,
            origins: planned.one("origins")?,
            counters: planned.one("counters")?,
            dispatch_args: planned.one("dispatch args")?,
            order: if plan.settings.builder == Builder::Scan { Some(OrderBuffers::new(planned)?) } else { None },
            tallies: planned.zeroed(commands, "tallies")?,
            index: if plan.gathers_by_grid() { Some(IndexBuffers::new(planned)?) } else { None },
            tree: if plan.gathers_by_tree() { Some(TreeBuffers::new(planned, plan)?) } else { None },
            film: planned.zeroed(commands, "film")?,
            rounds: if plan.keeps_squares() { Some(RoundBuffers::new(planned, commands)?) } else { None },
            nonfinite_values: planned.zeroed(commands, "nonfinite values")?,
        })
    }
}

impl OrderBuffers {
    fn new(planned: &Planned) -> Result<OrderBuffers> {
        Ok(OrderBuffers {
            survivors: planned.one("survivors")?,
            block_sums: planned.all("sums of survivors")?,
            weights: planned.one("weights")?,
        })
    }
}

impl RoundBuffers {
    fn new(planned: &Planned, commands: &mut Commands) -> Result<RoundBuffers> {
        Ok(RoundBuffers {
            totals: planned.zeroed(commands, "film totals")?,
            low_squares: planned.zeroed(commands, "low squares")?,
            high_squares: planned.zeroed(commands, "high squares")?,
        })
    }
}

impl IndexBuffers {
    fn new(planned: &Planned) -> Result<IndexBuffers> {
        Ok(IndexBuffers {
            cells: planned.one("cells")?,
            ranks: planned.one("ranks")?,
            block_sums: planned.all("sums of cells")?,
            sorted_photons: planned.one("sorted photons")?,
            longest: planned.one("longest")?,
        })
    }
}

impl TreeBuffers {
    fn new(planned: &Planned, plan: &RoomPlan) -> Result<TreeBuffers> {
        Ok(TreeBuffers {
            lists: planned.several("tree list")?,
            ranks: planned.one("tree ranks")?,
            counts: planned.one("tree counts")?,
            block_sums: planned.all("sums of tree counts")?,
            item_args: planned.one("item args")?,
            run_args: planned.one("run args")?,
            scan_args: planned.one("scan args")?,
            wall_begins: planned.one("wall begins")?,
            longest: planned.one("longest")?,
            planes: planned.one("planes")?,
            tree_photons: planned.one("tree photons")?,
            tree_origins: planned.one("tree origins")?,
            searches: if plan.settings.nearest.is_some() { Some(SearchBuffers::new(planned)?) } else { None },
        })
    }
}

impl SearchBuffers {
    fn new(planned: &Planned) -> Result<SearchBuffers> {
        Ok(SearchBuffers {
            nearest: planned.one("nearest photons")?,
            searches: planned.one("searches")?,
            unfinished: planned.one("unfinished")?,
        })
    }
}
