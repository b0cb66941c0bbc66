//! Makes the buffers of a scene that `plan::buffers` lists, and uploads the scene.

use super::film_buffers::FilmBuffers;
use crate::engine::planned::{Planned, buffers};
use crate::error::Result;
use crate::gpu::{Buffer, Commands, Gpu, kernels};
use crate::photon::MapPhoton;
use crate::plan::light_choice::LightChoice;
use crate::plan::scene::ScenePlan;
use crate::records::*;
use crate::scene::albedo;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;
use crate::settings::scene::Effect;

buffers! {
    pub struct SceneResources(
        planned: &Planned, commands: &mut Commands, geometry: &Geometry, plan: &ScenePlan, phases: &[Vec<Receiver>]
    ) {
        /// Written once; what the plan dropped has one empty element.
        scene: kernels::Scene = {
            let [texels, texels_1, texels_2, texels_3] = planned.filled_parts(commands, "texels", geometry.texel_parts())?;
            kernels::Scene {
            nodes: planned.filled(commands, "nodes", &geometry.nodes)?,
            triangles: planned.filled(commands, "triangles", &geometry.triangles)?,
            planes: planned.filled(commands, "planes", &geometry.plane_words())?,
            normals: planned.filled(commands, "normals", &geometry.normals)?,
            uvs: planned.filled(commands, "texture coordinates", &geometry.uvs)?,
            colours: planned.filled(commands, "vertex colours", &geometry.colours)?,
            materials: planned.filled(commands, "materials", &geometry.materials)?,
            layered_materials: planned.filled(commands, "layered materials", &geometry.layered_materials)?,
            triangle_layers: planned.filled(commands, "layers of triangles", &geometry.triangle_layers)?,
            albedos: planned.filled(commands, "albedos", if plan.keeps(Effect::Layers) { &albedo::TABLE } else { &[] })?,
            textures: planned.filled(commands, "textures", &geometry.textures)?,
            texels,
            texels_1,
            texels_2,
            texels_3,
            emitters: planned.filled(commands, "emitters", plan.lights().map_or(&geometry.emitters, |lights| &lights.emitters))?,
            caustic_targets: planned.filled(commands, "caustic targets", &plan.targets)?,
            light_nodes: planned.filled(commands, "light nodes", plan.lights().map_or(&[], |lights| &lights.nodes))?,
            light_regions: planned.filled(commands, "light regions", plan.lights().map_or(&[], |lights| &lights.regions))?,
            openings: planned.filled(commands, "openings", &plan.openings())?,
            light_shares: planned.filled(commands, "light shares", &plan.lights().map_or_else(Vec::new, LightChoice::words))?,
            }
        },
        /// Points of all phases; empty for a picture.
        receivers: Vec<Buffer<Receiver>> =
            phases.iter().map(|phase| planned.filled(commands, "receivers", phase)).collect::<Result<_>>()?,
        // Photons of the chunk under way.
        photons: Option<PhotonBuffers> = plan.maps().next().map(|_| PhotonBuffers::made(planned, commands, plan)).transpose()?,
        // What the sensor sees in the round under way.
        visible_points: Buffer<VisiblePoint> = planned.one("visible points")?,
        /// Written once.
        extra_samples: Buffer<u32> = planned.filled(commands, "extra samples", &plan.extra_samples.table)?,
        matt_lobes: Buffer<MattLobes> = planned.one("matt lobes")?,
        matt_covers: Buffer<MattCover> = planned.one("matt covers")?,
        pass_sums: Buffer<u64> = planned.one("pass sums")?,
        /// Camera paths that one dispatch leaves to the next, which leaves its own in the other; and how many.
        camera_paths: [Buffer<CameraPath>; 2] = planned.several("camera paths")?,
        camera_path_counts: Buffer<u32> = planned.one("camera path counts")?,
        estimates: Buffer<u64> = planned.one("estimates")?,
        /// Found in the first round.
        radius_classes: Buffer<u32> = planned.one("radius classes")?,
        clearances: Buffer<f32> = planned.one("clearances")?,
        /// Of the round under way.
        disc_cuts: Buffer<[u32; 4]> = planned.one("disc cuts")?,
        /// Within a smaller radius.
        near_sums: Buffer<u64> = planned.one("near sums")?,
        film: FilmBuffers = FilmBuffers::made(planned, commands)?,
        nonfinite_values: Buffer<u32> = planned.zeroed(commands, "nonfinite values")?,
    }
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
        SceneResources::made(&Planned { gpu, buffers: plan.buffers(geometry) }, commands, geometry, plan, phases)
    }
}

buffers! {
    /// Photons in flight and their map; both maps of a round use the same ones in turn.
    pub struct PhotonBuffers(planned: &Planned, commands: &mut Commands, plan: &ScenePlan) {
        /// Paths entering even bounces and odd bounces.
        paths: [Buffer<LightPath>; 2] = [planned.one("even light paths")?, planned.one("odd light paths")?],
        map: Buffer<MapPhoton> = planned.one("map")?,
        sorted_map: Buffer<MapPhoton> = planned.one("sorted map")?,
        /// Length of the map, then the paths entering each bounce.
        counters: Buffer<u32> = planned.one("counters")?,
        dispatch_args: Buffer<DispatchArgs> = planned.one("dispatch args")?,
        /// Photons in each bucket; after their prefix sums the first photon of each, and behind the last the number of all.
        cells: Buffer<u32> = planned.one("cells")?,
        /// Place of each photon among those of its bucket.
        ranks: Buffer<u32> = planned.one("ranks")?,
        block_sums: Vec<Buffer<u32>> = planned.all("sums of cells")?,
        /// Points with so many candidates that several invocations share them: how many, the most candidates, and each one
        /// with its candidates.
        crowded: Buffer<u32> = planned.one("crowded points")?,
        /// What keeps photons in order; `None` where they come as they do.
        order: Option<OrderBuffers> = (plan.builder() == Builder::Scan).then(|| OrderBuffers::made(planned)).transpose()?,
        /// Fates of the submission under way, one tally a bounce: of the global map's photons, and of the
        /// caustic map's.
        tallies: [Buffer<Tally>; 2] = [planned.zeroed(commands, "global tallies")?, planned.zeroed(commands, "caustic tallies")?],
        /// Photons stored and what limits cost, of each map.
        totals: [Buffer<u32>; 2] = [planned.zeroed(commands, "global totals")?, planned.zeroed(commands, "caustic totals")?],
        /// Both as the latest whole block left them.
        tallies_of_blocks: [Buffer<Tally>; 2] = [planned.zeroed(commands, "global tallies of blocks")?, planned.zeroed(commands, "caustic tallies of blocks")?],
        totals_of_blocks: [Buffer<u32>; 2] = [planned.zeroed(commands, "global totals of blocks")?, planned.zeroed(commands, "caustic totals of blocks")?],
    }
}

buffers! {
    /// Survivors of a bounce, for prefix sums over them.
    pub struct OrderBuffers(planned: &Planned) {
        survivors: Buffer<u32> = planned.one("survivors")?,
        block_sums: Vec<Buffer<u32>> = planned.all("sums of survivors")?,
    }
}
