//! Every buffer of lighting a scene of triangles, named and sized by the plan.

use bytemuck::Pod;
use glam::UVec2;

use super::film::ANOMALY_WORDS;
use crate::constants::{HIT_KINDS, PART_COUNT};
use crate::engine::nonfinite_values;
use crate::engine::prefix_sum::block_sums;
use crate::engine::tallies;
use crate::engine::totals;
use crate::error::Result;
use crate::gpu::{Buffer, Commands, Gpu, Memory};
use crate::photon::MapPhoton;
use crate::plan::memory::survivor_count;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::records::*;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;
use crate::settings::scene::Effect;

pub struct SceneResources {
    // The scene, written once; what the plan dropped has one empty element.
    pub nodes: Buffer,
    pub triangles: Buffer,
    pub planes: Buffer,
    pub normals: Buffer,
    pub uvs: Buffer,
    pub materials: Buffer,
    pub textures: Buffer,
    pub texels: Buffer,
    pub emitters: Buffer,
    pub caustic_targets: Buffer,
    /// Points of all phases; empty for a picture.
    pub receivers: Vec<Buffer>,
    // Photons of the chunk under way.
    pub photons: Option<PhotonBuffers>,
    // What the sensor sees in the round under way.
    pub visible_points: Buffer,
    pub pass_sums: Buffer,
    /// Camera paths that one dispatch leaves to the next, which leaves its own in the other; and how many.
    pub camera_paths: [Buffer; 2],
    pub camera_path_counts: Buffer,
    pub estimates: Buffer,
    // All rounds.
    pub film_sums: Buffer,
    pub film_squares: Buffer,
    /// What is known of pixels that some kind of light has not reached; see `glsl/world/scene/one_hit.glsl`.
    pub one_hits: Buffer,
    pub part_totals: Buffer,
    pub anomalies: Buffer,
    pub nonfinite_values: Buffer,
}

/// Photons in flight and their map; both maps of a round use the same ones in turn.
pub struct PhotonBuffers {
    /// Paths entering even bounces and odd bounces.
    pub paths: [Buffer; 2],
    pub map: Buffer,
    pub sorted_map: Buffer,
    /// Length of the map, then the paths entering each bounce.
    pub counters: Buffer,
    pub dispatch_args: Buffer,
    /// Photons in each bucket; after their prefix sums the first photon of each, and behind the last the number of all.
    pub cells: Buffer,
    /// Place of each photon among those of its bucket.
    pub ranks: Buffer,
    pub block_sums: Vec<Buffer>,
    /// Points with so many candidates that several invocations share them: how many, the most candidates, and each one with its candidates.
    pub crowded: Buffer,
    /// What keeps photons in order; `None` where they come as they do.
    pub order: Option<OrderBuffers>,
    /// Fates of the submission under way, one tally a bounce: of the global map's photons, and of the
    /// caustic map's.
    pub tallies: [Buffer; 2],
    /// Photons stored and what limits cost, of each map.
    pub totals: [Buffer; 2],
}

/// Survivors of a bounce, for prefix sums over them.
pub struct OrderBuffers {
    pub survivors: Buffer,
    pub block_sums: Vec<Buffer>,
}

impl SceneResources {
    /// Makes the buffers and records the upload of what never changes. `phases` are sets of receivers
    /// of equal length; none for a picture.
    pub fn new(
        gpu: &Gpu,
        commands: &mut Commands,
        geometry: &Geometry,
        plan: &ScenePlan,
        phases: &[Vec<Receiver>],
    ) -> Result<SceneResources> {
        fn filled<T: Pod>(gpu: &Gpu, commands: &mut Commands, name: &str, content: &[T], kept: bool) -> Result<Buffer> {
            let content = if kept { content } else { &[] };
            let buffer = gpu.buffer::<T>(name, content.len() as u64, Memory::Device)?;
            commands.upload(&buffer, content)?;
            Ok(buffer)
        }
        let pixels = u64::from(plan.sensor.pixels());
        let points = u64::from(plan.visible_points());
        let estimates = 3 * points * u64::from(plan.arrival_sets);
        let device = Memory::Device;
        let textured = plan.keeps(Effect::Textures);
        let resources = SceneResources {
            nodes: filled(gpu, commands, "nodes", &geometry.nodes, plan.keeps(Effect::Bvh))?,
            triangles: filled(gpu, commands, "triangles", &geometry.triangles, true)?,
            planes: filled(gpu, commands, "planes", &geometry.planes, true)?,
            normals: filled(gpu, commands, "normals", &geometry.normals, plan.keeps(Effect::SmoothNormals))?,
            uvs: filled(gpu, commands, "uvs", &geometry.uvs, textured)?,
            materials: filled(gpu, commands, "materials", &geometry.materials, true)?,
            textures: filled(gpu, commands, "textures", &geometry.textures, textured)?,
            texels: filled::<UVec2>(gpu, commands, "texels", &geometry.texels, textured)?,
            emitters: filled(gpu, commands, "emitters", &geometry.emitters, true)?,
            caustic_targets: filled(gpu, commands, "caustic targets", &plan.targets, true)?,
            receivers: phases.iter().map(|phase| filled(gpu, commands, "receivers", phase, true)).collect::<Result<_>>()?,
            photons: if plan.maps().next().is_some() { Some(PhotonBuffers::new(gpu, commands, plan)?) } else { None },
            visible_points: gpu.buffer::<VisiblePoint>("visible points", points, device)?,
            pass_sums: gpu.buffer::<u64>("pass sums", 3 * pixels * u64::from(plan.samples()), device)?,
            camera_paths: [
                gpu.buffer::<CameraPath>("even camera paths", plan.camera_path_capacity(), device)?,
                gpu.buffer::<CameraPath>("odd camera paths", plan.camera_path_capacity(), device)?,
            ],
            camera_path_counts: gpu.buffer::<u32>("camera path counts", 1, device)?,
            estimates: gpu.buffer::<u64>("estimates", estimates, device)?,
            film_sums: gpu.buffer::<u64>("film sums", 3 * pixels, device)?,
            film_squares: gpu.buffer::<u64>("film squares", 6 * pixels, device)?,
            one_hits: gpu.buffer::<u32>("one hits", u64::from(HIT_KINDS) * pixels, device)?,
            part_totals: gpu.buffer::<u64>("part totals", u64::from(PART_COUNT), device)?,
            anomalies: gpu.buffer::<u32>("anomalies", ANOMALY_WORDS as u64, device)?,
            nonfinite_values: nonfinite_values::buffer(gpu, commands)?,
        };
        commands.fill(&resources.film_sums, 0, 6 * pixels, 0);
        commands.fill(&resources.film_squares, 0, 12 * pixels, 0);
        commands.fill(&resources.one_hits, 0, u64::from(HIT_KINDS) * pixels, 0);
        commands.fill(&resources.part_totals, 0, 2 * u64::from(PART_COUNT), 0);
        commands.fill(&resources.anomalies, 0, ANOMALY_WORDS as u64, 0);
        Ok(resources)
    }
}

impl PhotonBuffers {
    fn new(gpu: &Gpu, commands: &mut Commands, plan: &ScenePlan) -> Result<PhotonBuffers> {
        let most = |size: fn(&MapPlan) -> u32| plan.maps().map(size).max().map_or(0, u64::from);
        let device = Memory::Device;
        let (paths, capacity, buckets) = (most(|map| map.path_array_length), most(|map| map.capacity), most(|map| map.bucket_count));
        let counters = plan.maps().map(MapPlan::counter_count).max().unwrap_or(2);
        let rows = plan.tally_rows();
        let buffers = PhotonBuffers {
            paths: [
                gpu.buffer::<LightPath>("even light paths", paths, device)?,
                gpu.buffer::<LightPath>("odd light paths", paths, device)?,
            ],
            map: gpu.buffer::<MapPhoton>("map", capacity, device)?,
            sorted_map: gpu.buffer::<MapPhoton>("sorted map", capacity, device)?,
            counters: gpu.buffer::<u32>("counters", counters, device)?,
            dispatch_args: gpu.buffer::<DispatchArgs>("dispatch args", 1, device)?,
            cells: gpu.buffer::<u32>("cells", buckets + 1, device)?,
            ranks: gpu.buffer::<u32>("ranks", capacity, device)?,
            block_sums: block_sums(gpu, buckets + 1, plan.settings.group_size)?,
            crowded: gpu.buffer::<u32>("crowded points", 2 + 2 * u64::from(plan.points_at_once()), device)?,
            order: if plan.builder() == Builder::Scan {
                let survivors = u64::from(survivor_count(plan, most(|map| map.chunk_photons) as u32));
                Some(OrderBuffers {
                    survivors: gpu.buffer::<u32>("survivors", survivors, device)?,
                    block_sums: block_sums(gpu, survivors, plan.settings.group_size)?,
                })
            } else {
                None
            },
            tallies: [tallies::buffer(gpu, "global tallies", rows)?, tallies::buffer(gpu, "caustic tallies", rows)?],
            totals: [totals::buffer(gpu, "global totals")?, totals::buffer(gpu, "caustic totals")?],
        };
        buffers.tallies.iter().for_each(|tallies| tallies::clear(commands, tallies));
        buffers.totals.iter().for_each(|totals| totals::clear(commands, totals));
        Ok(buffers)
    }
}
