//! Every buffer of a run on the device, named and sized by the plan.

use crate::constants::{FACE_COUNT, TREE_LEAF};
use crate::engine::nonfinite_values;
use crate::engine::prefix_sum::block_sums;
use crate::engine::tallies;
use crate::error::Result;
use crate::gpu::{Buffer, Commands, Gpu, Memory};
use crate::path::StoredPath;
use crate::photon::{Origin, StoredPhoton};
use crate::plan::RoomPlan;
use crate::plan::memory::{group_count, searches_at_once, tree_count_capacity};
use crate::records::{self, DispatchArgs, Point, Search, Tally};
use crate::scene::room::RoomScene;
use crate::settings::Builder;
use glam::UVec2;

pub struct RoomResources {
    // The scene, written once.
    pub rooms: Buffer<records::Room>,
    pub walls: Buffer<records::Wall>,
    pub lights: Buffer<records::DiscLight>,
    pub points: Buffer<Point>,
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
    /// Points that are searched for at once.
    pub point_count: u32,
    /// Nearest photons of each.
    pub nearest: Buffer<UVec2>,
    pub searches: Buffer<Search>,
    /// 1: some search has not ended.
    pub unfinished: Buffer<u32>,
}

impl RoomResources {
    /// Makes the buffers and records the upload of what never changes.
    pub fn new(gpu: &Gpu, commands: &mut Commands, scene: &RoomScene, plan: &RoomPlan) -> Result<RoomResources> {
        let paths = u64::from(plan.path_array_length());
        let photons = u64::from(plan.photon_capacity);
        let seeds = plan.streams().first_states(plan.path_capacity);
        let sums = plan.points.len() as u64 * u64::from(plan.channel_count);
        let device = Memory::Device;
        let resources = RoomResources {
            rooms: gpu.buffer::<records::Room>("rooms", 1, device)?,
            walls: gpu.buffer::<records::Wall>("walls", scene.faces.len() as u64, device)?,
            lights: gpu.buffer::<records::DiscLight>("lights", scene.lights.len() as u64, device)?,
            points: gpu.buffer::<Point>("points", plan.points.len() as u64, device)?,
            stream_seeds: gpu.buffer::<UVec2>("stream seeds", seeds.len() as u64, device)?,
            paths: [gpu.buffer::<StoredPath>("even paths", paths, device)?, gpu.buffer::<StoredPath>("odd paths", paths, device)?],
            photons: gpu.buffer::<StoredPhoton>("photons", photons, device)?,
            origins: gpu.buffer::<Origin>("origins", u64::from(plan.origin_array_length()), device)?,
            counters: gpu.buffer::<u32>("counters", plan.counter_array_length(), device)?,
            dispatch_args: gpu.buffer::<DispatchArgs>("dispatch args", 1, device)?,
            order: if plan.settings.builder == Builder::Scan { Some(OrderBuffers::new(gpu, plan)?) } else { None },
            tallies: tallies::buffer(gpu, "tallies", plan.settings.bounces)?,
            index: if plan.gathers_by_grid() { Some(IndexBuffers::new(gpu, plan)?) } else { None },
            tree: if plan.gathers_by_tree() { Some(TreeBuffers::new(gpu, plan)?) } else { None },
            film: gpu.buffer::<u64>("film", sums, device)?,
            rounds: if plan.keeps_squares() { Some(RoundBuffers::new(gpu, commands, sums)?) } else { None },
            nonfinite_values: nonfinite_values::buffer(gpu, commands)?,
        };
        commands.upload(&resources.rooms, &[scene.room_record()])?;
        commands.upload(&resources.walls, &scene.wall_records())?;
        commands.upload(&resources.lights, &scene.light_records(&plan.relative_flux))?;
        commands.upload(&resources.points, &plan.points)?;
        commands.upload(&resources.stream_seeds, &seeds)?;
        commands.clear(&resources.film);
        tallies::clear(commands, &resources.tallies);
        Ok(resources)
    }
}

impl OrderBuffers {
    fn new(gpu: &Gpu, plan: &RoomPlan) -> Result<OrderBuffers> {
        let sums = u64::from(group_count(plan)) + 1;
        let weights = if plan.settings.has_phong() { u64::from(plan.path_capacity) } else { 1 };
        Ok(OrderBuffers {
            survivors: gpu.buffer::<u32>("survivors", sums, Memory::Device)?,
            block_sums: block_sums(gpu, sums, plan.settings.group_size)?,
            weights: gpu.buffer::<f32>("weights", weights, Memory::Device)?,
        })
    }
}

impl RoundBuffers {
    fn new(gpu: &Gpu, commands: &mut Commands, sums: u64) -> Result<RoundBuffers> {
        let buffers = RoundBuffers {
            totals: gpu.buffer::<u64>("film totals", sums, Memory::Device)?,
            low_squares: gpu.buffer::<u64>("low squares", sums, Memory::Device)?,
            high_squares: gpu.buffer::<u64>("high squares", sums, Memory::Device)?,
        };
        for buffer in [&buffers.totals, &buffers.low_squares, &buffers.high_squares] {
            commands.clear(buffer);
        }
        Ok(buffers)
    }
}

impl IndexBuffers {
    fn new(gpu: &Gpu, plan: &RoomPlan) -> Result<IndexBuffers> {
        let cells = u64::from(plan.grid.cells()) + 1;
        Ok(IndexBuffers {
            cells: gpu.buffer::<u32>("cells", cells, Memory::Device)?,
            ranks: gpu.buffer::<u32>("ranks", u64::from(plan.photon_capacity), Memory::Device)?,
            block_sums: block_sums(gpu, cells, plan.settings.group_size)?,
            sorted_photons: gpu.buffer::<StoredPhoton>("sorted photons", u64::from(plan.photon_capacity), Memory::Device)?,
            longest: gpu.buffer::<u32>("longest", 1, Memory::Device)?,
        })
    }
}

impl TreeBuffers {
    fn new(gpu: &Gpu, plan: &RoomPlan) -> Result<TreeBuffers> {
        let photons = u64::from(plan.photon_capacity);
        let counts = u64::from(tree_count_capacity(plan));
        let device = Memory::Device;
        let list = || gpu.buffer::<UVec2>("tree list", photons, device);
        let args = || gpu.buffer::<DispatchArgs>("tree dispatch args", 1, device);
        Ok(TreeBuffers {
            lists: [list()?, list()?, list()?],
            ranks: gpu.buffer::<u32>("tree ranks", photons, device)?,
            counts: gpu.buffer::<u32>("tree counts", counts, device)?,
            block_sums: block_sums(gpu, counts, plan.settings.group_size)?,
            item_args: args()?,
            run_args: args()?,
            scan_args: args()?,
            wall_begins: gpu.buffer::<u32>("wall begins", u64::from(FACE_COUNT) + 1, device)?,
            longest: gpu.buffer::<u32>("longest", 1, device)?,
            planes: gpu.buffer::<f32>("planes", photons / u64::from(TREE_LEAF) + 1, device)?,
            tree_photons: gpu.buffer::<StoredPhoton>("tree photons", photons, device)?,
            tree_origins: gpu.buffer::<Origin>("tree origins", u64::from(plan.origin_array_length()), device)?,
            searches: plan.settings.nearest.map(|nearest| SearchBuffers::new(gpu, plan, nearest)).transpose()?,
        })
    }
}

impl SearchBuffers {
    fn new(gpu: &Gpu, plan: &RoomPlan, nearest: u32) -> Result<SearchBuffers> {
        let at_once = searches_at_once(plan, nearest);
        let device = Memory::Device;
        Ok(SearchBuffers {
            point_count: at_once as u32,
            nearest: gpu.buffer::<UVec2>("nearest photons", at_once * u64::from(nearest), device)?,
            searches: gpu.buffer::<Search>("searches", at_once, device)?,
            unfinished: gpu.buffer::<u32>("unfinished", 1, device)?,
        })
    }
}
