//! Every buffer of a run on the device, named and sized by the plan.

use crate::constants::SCAN_ITEMS;
use crate::error::Result;
use crate::gpu::{Buffer, Commands, Gpu, Memory};
use crate::oddities;
use crate::plan::Plan;
use crate::records::{self, DispatchArgs, Path, Photon, Point, SortedPhoton, Tally};
use crate::scene::room::RoomScene;
use glam::UVec2;

pub struct Resources {
    // The scene, written once.
    pub rooms: Buffer,
    pub walls: Buffer,
    pub lights: Buffer,
    pub points: Buffer,
    pub stream_seeds: Buffer,
    // Photons of the chunk under way.
    /// Paths entering even bounces and odd bounces.
    pub paths: [Buffer; 2],
    pub photons: Buffer,
    /// Length of the photon map, then the paths entering each bounce.
    pub counters: Buffer,
    pub dispatch_args: Buffer,
    // Ledger of the submission under way, one tally a bounce.
    pub tallies: Buffer,
    /// The index; `None` where the gather is brute.
    pub index: Option<IndexBuffers>,
    pub film: Buffer,
    pub oddities: Buffer,
}

pub struct IndexBuffers {
    /// Photons in each cell; after sorting, one past the last photon of each cell.
    pub cells: Buffer,
    /// Sums of blocks of cells, sums of blocks of those, ... down to one.
    pub block_sums: Vec<Buffer>,
    pub sorted_photons: Buffer,
    /// Candidates of the busiest point.
    pub longest: Buffer,
}

impl Resources {
    /// Makes the buffers and records the upload of what never changes.
    pub fn new(gpu: &Gpu, commands: &mut Commands, scene: &RoomScene, plan: &Plan) -> Result<Resources> {
        let bounces = u64::from(plan.settings.bounces);
        let paths = u64::from(plan.path_capacity);
        let photons = u64::from(plan.photon_capacity);
        let seeds = plan.streams().first_states(plan.path_capacity);
        let sums = plan.points.len() as u64 * u64::from(plan.channel_count);
        let device = Memory::Device;
        let resources = Resources {
            rooms: gpu.buffer::<records::Room>("rooms", 1, device)?,
            walls: gpu.buffer::<records::Wall>("walls", scene.faces.len() as u64, device)?,
            lights: gpu.buffer::<records::DiscLight>("lights", scene.lights.len() as u64, device)?,
            points: gpu.buffer::<Point>("points", plan.points.len() as u64, device)?,
            stream_seeds: gpu.buffer::<UVec2>("stream seeds", seeds.len() as u64, device)?,
            paths: [gpu.buffer::<Path>("even paths", paths, device)?, gpu.buffer::<Path>("odd paths", paths, device)?],
            photons: gpu.buffer::<Photon>("photons", photons, device)?,
            counters: gpu.buffer::<u32>("counters", bounces + 2, device)?,
            dispatch_args: gpu.buffer::<DispatchArgs>("dispatch args", 1, device)?,
            tallies: gpu.buffer::<Tally>("tallies", bounces, device)?,
            index: if plan.gathers_by_grid() { Some(IndexBuffers::new(gpu, plan)?) } else { None },
            film: gpu.buffer::<u64>("film", sums, device)?,
            oddities: oddities::buffer(gpu, commands)?,
        };
        commands.upload(&resources.rooms, &[scene.room_record()])?;
        commands.upload(&resources.walls, &scene.wall_records())?;
        commands.upload(&resources.lights, &scene.light_records(&plan.relative_flux))?;
        commands.upload(&resources.points, &plan.points)?;
        commands.upload(&resources.stream_seeds, &seeds)?;
        commands.fill(&resources.film, 0, 2 * sums, 0);
        commands.fill(&resources.tallies, 0, 4 * bounces, 0);
        Ok(resources)
    }
}

impl IndexBuffers {
    fn new(gpu: &Gpu, plan: &Plan) -> Result<IndexBuffers> {
        let cells = u64::from(plan.grid.cells());
        Ok(IndexBuffers {
            cells: gpu.buffer::<u32>("cells", cells, Memory::Device)?,
            block_sums: block_sums(gpu, cells, plan.settings.group_size)?,
            sorted_photons: gpu.buffer::<SortedPhoton>("sorted photons", u64::from(plan.photon_capacity), Memory::Device)?,
            longest: gpu.buffer::<u32>("longest", 1, Memory::Device)?,
        })
    }
}

/// One buffer a level of a prefix sum over `items`: block sums of the level below, down to one block.
pub fn block_sums(gpu: &Gpu, items: u64, group_size: u32) -> Result<Vec<Buffer>> {
    let block = u64::from(group_size * SCAN_ITEMS);
    let mut levels = Vec::new();
    let mut count = items;
    loop {
        count = count.div_ceil(block).max(1);
        levels.push(gpu.buffer::<u32>("block sums", count, Memory::Device)?);
        if count == 1 {
            return Ok(levels);
        }
    }
}
