//! Makes the buffers of a scene that `plan::buffers` lists, and uploads the scene.

use crate::engine::planned::Planned;
use crate::error::Result;
use crate::gpu::{Buffer, Commands, Gpu, kernels};
use crate::photon::MapPhoton;
use crate::plan::scene::ScenePlan;
use crate::records::*;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;

pub struct SceneResources {
    /// Written once; what the plan dropped has one empty element.
    pub scene: kernels::Scene,
    /// Points of all phases; empty for a picture.
    pub receivers: Vec<Buffer<Receiver>>,
    // Photons of the chunk under way.
    pub photons: Option<PhotonBuffers>,
    // What the sensor sees in the round under way.
    pub visible_points: Buffer<VisiblePoint>,
    pub pass_sums: Buffer<u64>,
    /// Camera paths that one dispatch leaves to the next, which leaves its own in the other; and how many.
    pub camera_paths: [Buffer<CameraPath>; 2],
    pub camera_path_counts: Buffer<u32>,
    pub estimates: Buffer<u64>,
    // All rounds.
    pub film_sums: Buffer<u64>,
    pub film_squares: Buffer<u64>,
    /// What is known of pixels that some kind of light has not reached; see `glsl/world/scene/one_hit.glsl`.
    pub one_hits: Buffer<u32>,
    pub part_totals: Buffer<u64>,
    pub anomalies: Buffer<u32>,
    pub nonfinite_values: Buffer<u32>,
}

/// Photons in flight and their map; both maps of a round use the same ones in turn.
pub struct PhotonBuffers {
    /// Paths entering even bounces and odd bounces.
    pub paths: [Buffer<LightPath>; 2],
    pub map: Buffer<MapPhoton>,
    pub sorted_map: Buffer<MapPhoton>,
    /// Length of the map, then the paths entering each bounce.
    pub counters: Buffer<u32>,
    pub dispatch_args: Buffer<DispatchArgs>,
    /// Photons in each bucket; after their prefix sums the first photon of each, and behind the last the number of all.
    pub cells: Buffer<u32>,
    /// Place of each photon among those of its bucket.
    pub ranks: Buffer<u32>,
    pub block_sums: Vec<Buffer<u32>>,
    /// Points with so many candidates that several invocations share them: how many, the most candidates, and each one with its candidates.
    pub crowded: Buffer<u32>,
    /// What keeps photons in order; `None` where they come as they do.
    pub order: Option<OrderBuffers>,
    /// Fates of the submission under way, one tally a bounce: of the global map's photons, and of the
    /// caustic map's.
    pub tallies: [Buffer<Tally>; 2],
    /// Photons stored and what limits cost, of each map.
    pub totals: [Buffer<u32>; 2],
}

/// Survivors of a bounce, for prefix sums over them.
pub struct OrderBuffers {
    pub survivors: Buffer<u32>,
    pub block_sums: Vec<Buffer<u32>>,
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
        let planned = &Planned { gpu, buffers: plan.buffers(geometry) };
        Ok(SceneResources {
            scene: kernels::Scene {
                nodes: planned.filled(commands, "nodes", &geometry.nodes)?,
                triangles: planned.filled(commands, "triangles", &geometry.triangles)?,
                planes: planned.filled(commands, "planes", &geometry.planes)?,
                normals: planned.filled(commands, "normals", &geometry.normals)?,
                uvs: planned.filled(commands, "texture coordinates", &geometry.uvs)?,
                materials: planned.filled(commands, "materials", &geometry.materials)?,
                textures: planned.filled(commands, "textures", &geometry.textures)?,
                texels: planned.filled(commands, "texels", &geometry.texels)?,
                emitters: planned.filled(commands, "emitters", &geometry.emitters)?,
                caustic_targets: planned.filled(commands, "caustic targets", &plan.targets)?,
            },
            receivers: phases.iter().map(|phase| planned.filled(commands, "receivers", phase)).collect::<Result<_>>()?,
            photons: if plan.maps().next().is_some() { Some(PhotonBuffers::new(planned, commands, plan)?) } else { None },
            visible_points: planned.one("visible points")?,
            pass_sums: planned.one("pass sums")?,
            camera_paths: planned.several("camera paths")?,
            camera_path_counts: planned.one("camera path counts")?,
            estimates: planned.one("estimates")?,
            film_sums: planned.zeroed(commands, "film sums")?,
            film_squares: planned.zeroed(commands, "film squares")?,
            one_hits: planned.zeroed(commands, "one hits")?,
            part_totals: planned.zeroed(commands, "part totals")?,
            anomalies: planned.zeroed(commands, "anomalies")?,
            nonfinite_values: planned.zeroed(commands, "nonfinite values")?,
        })
    }
}

impl PhotonBuffers {
    fn new(planned: &Planned, commands: &mut Commands, plan: &ScenePlan) -> Result<PhotonBuffers> {
        Ok(PhotonBuffers {
            paths: [planned.one("even light paths")?, planned.one("odd light paths")?],
            map: planned.one("map")?,
            sorted_map: planned.one("sorted map")?,
            counters: planned.one("counters")?,
            dispatch_args: planned.one("dispatch args")?,
            cells: planned.one("cells")?,
            ranks: planned.one("ranks")?,
            block_sums: planned.all("sums of cells")?,
            crowded: planned.one("crowded points")?,
            order: if plan.builder() == Builder::Scan {
                Some(OrderBuffers { survivors: planned.one("survivors")?, block_sums: planned.all("sums of survivors")? })
            } else {
                None
            },
            tallies: [planned.zeroed(commands, "global tallies")?, planned.zeroed(commands, "caustic tallies")?],
            totals: [planned.zeroed(commands, "global totals")?, planned.zeroed(commands, "caustic totals")?],
        })
    }
}
