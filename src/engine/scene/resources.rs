//! Makes the buffers of a scene that `plan::buffers` lists, and uploads the scene.

use super::film_buffers::FilmBuffers;
use crate::engine::planned::{Planned, buffers};
use crate::error::Result;
use crate::gpu::{Buffer, Commands, kernels};
use crate::photon::MapPhoton;
use crate::plan::buffers::{NONFINITE_VALUES, scene};
use crate::plan::light_choice::LightChoice;
use crate::plan::scene::ScenePlan;
use crate::records::*;
use crate::scene::albedo;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;
use crate::settings::scene::Effect;

buffers! {
    pub(crate) struct SceneResources(
        planned: &Planned, commands: &mut Commands, geometry: &Geometry, plan: &ScenePlan, phases: &[Vec<Receiver>]
    ) {
        /// Written once; what the plan dropped has one empty element.
        scene: kernels::Scene = {
            let [texels, texels_1, texels_2, texels_3] = planned.filled_parts(commands, scene::TEXELS, geometry.texel_parts())?;
            kernels::Scene {
            nodes: planned.filled(commands, scene::NODES, &geometry.nodes)?,
            triangles: planned.filled(commands, scene::TRIANGLES, &geometry.triangles)?,
            planes: planned.filled(commands, scene::PLANES, &geometry.plane_words())?,
            normals: planned.filled(commands, scene::NORMALS, &geometry.normals)?,
            uvs: planned.filled(commands, scene::UVS, &geometry.uvs)?,
            vertex_colours: planned.filled(commands, scene::VERTEX_COLOURS, &geometry.colours)?,
            materials: planned.filled(commands, scene::MATERIALS, &geometry.materials)?,
            layered_materials: planned.filled(commands, scene::LAYERED_MATERIALS, &geometry.layered_materials)?,
            triangle_layers: planned.filled(commands, scene::TRIANGLE_LAYERS, &geometry.triangle_layers)?,
            albedos: planned.filled(commands, scene::ALBEDOS, if plan.simulates(Effect::Layers) { &albedo::TABLE } else { &[] })?,
            textures: planned.filled(commands, scene::TEXTURES, &geometry.textures)?,
            texels,
            texels_1,
            texels_2,
            texels_3,
            emitters: planned.filled(commands, scene::EMITTERS, plan.lights().map_or(&geometry.emitters, |lights| &lights.emitters))?,
            caustic_targets: planned.filled(commands, scene::CAUSTIC_TARGETS, &plan.targets)?,
            light_nodes: planned.filled(commands, scene::LIGHT_NODES, plan.lights().map_or(&[], |lights| &lights.nodes))?,
            light_regions: planned.filled(commands, scene::LIGHT_REGIONS, plan.lights().map_or(&[], |lights| &lights.regions))?,
            openings: planned.filled(commands, scene::OPENINGS, &plan.openings())?,
            light_shares: planned.filled(commands, scene::LIGHT_SHARES, &plan.lights().map_or_else(Vec::new, LightChoice::words))?,
            }
        },
        /// Points of all phases; empty for a picture.
        receivers: Vec<Buffer<Receiver>> =
            phases.iter().map(|phase| planned.filled(commands, scene::RECEIVERS, phase)).collect::<Result<_>>()?,
        // Photons of the chunk under way.
        photons: Option<PhotonBuffers> = plan.maps().next().map(|_| PhotonBuffers::made(planned, commands, plan)).transpose()?,
        // What the sensor sees in the round under way.
        visible_points: Buffer<VisiblePoint> = planned.one(scene::VISIBLE_POINTS)?,
        /// Written once.
        extra_samples: Buffer<u32> = planned.filled(commands, scene::EXTRA_SAMPLES, &plan.extra_samples.table)?,
        rough_lobes: Buffer<RoughLobes> = planned.one(scene::ROUGH_LOBES)?,
        rough_covers: Buffer<RoughCover> = planned.one(scene::ROUGH_COVERS)?,
        pass_sums: Buffer<u64> = planned.one(scene::PASS_SUMS)?,
        /// Camera paths that one dispatch leaves to the next, which leaves its own in the other; and how many.
        camera_paths: [Buffer<CameraPath>; 2] = planned.several(scene::CAMERA_PATHS)?,
        camera_path_counts: Buffer<u32> = planned.one(scene::CAMERA_PATH_COUNTS)?,
        estimates: Buffer<u64> = planned.one(scene::ESTIMATES)?,
        /// Found in the first round.
        radius_classes: Buffer<u32> = planned.one(scene::RADIUS_CLASSES)?,
        clearances: Buffer<f32> = planned.one(scene::CLEARANCES)?,
        /// Of the round under way.
        disc_cuts: Buffer<[u32; 4]> = planned.one(scene::DISC_CUTS)?,
        /// Within a smaller radius.
        near_sums: Buffer<u64> = planned.one(scene::NEAR_SUMS)?,
        film: FilmBuffers = FilmBuffers::made(planned, commands)?,
        nonfinite_values: Buffer<u32> = planned.zeroed(commands, NONFINITE_VALUES)?,
    }
}

impl SceneResources {
    /// Makes the buffers and records the upload of what never changes. `phases` are sets of receivers
    /// of equal length; none for a picture.
    pub(crate) fn new(commands: &mut Commands, geometry: &Geometry, plan: &ScenePlan, phases: &[Vec<Receiver>]) -> Result<SceneResources> {
        SceneResources::made(&Planned { gpu: commands.gpu(), buffers: plan.buffers(geometry) }, commands, geometry, plan, phases)
    }
}

buffers! {
    /// Photons in flight and their map; both maps of a round use the same ones in turn.
    pub(crate) struct PhotonBuffers(planned: &Planned, commands: &mut Commands, plan: &ScenePlan) {
        /// Paths entering even bounces and odd bounces.
        paths: [Buffer<PhotonState>; 2] = planned.several(scene::PATHS)?,
        map: Buffer<MapPhoton> = planned.one(scene::MAP)?,
        sorted_map: Buffer<MapPhoton> = planned.one(scene::SORTED_MAP)?,
        /// Length of the map, then the paths entering each bounce.
        counters: Buffer<u32> = planned.one(scene::COUNTERS)?,
        dispatch_args: Buffer<DispatchArgs> = planned.one(scene::DISPATCH_ARGS)?,
        /// Photons in each bucket; after their prefix sums the first photon of each, and behind the last the number of all.
        cells: Buffer<u32> = planned.one(scene::CELLS)?,
        /// Place of each photon among those of its bucket.
        ranks: Buffer<u32> = planned.one(scene::RANKS)?,
        sums_of_cells: Vec<Buffer<u32>> = planned.all(scene::SUMS_OF_CELLS)?,
        /// Points with so many candidates that several invocations share them: how many, the most candidates, and each one
        /// with its candidates.
        dense_points: Buffer<u32> = planned.one(scene::DENSE_POINTS)?,
        /// What keeps photons in order; `None` where they come as they do.
        order: Option<OrderBuffers> = (plan.builder() == Builder::Scan).then(|| OrderBuffers::made(planned)).transpose()?,
        /// Fates of the submission under way, one tally a bounce: of the global map's photons, and of the
        /// caustic map's.
        tallies: [Buffer<Tally>; 2] = planned.several_zeroed(commands, scene::TALLIES)?,
        /// Photons stored and what limits cost, of each map.
        totals: [Buffer<u32>; 2] = planned.several_zeroed(commands, scene::TOTALS)?,
        /// Both as the latest whole block left them.
        tallies_of_blocks: [Buffer<Tally>; 2] = planned.several_zeroed(commands, scene::TALLIES_OF_BLOCKS)?,
        totals_of_blocks: [Buffer<u32>; 2] = planned.several_zeroed(commands, scene::TOTALS_OF_BLOCKS)?,
    }
}

buffers! {
    /// Survivors of a bounce, for prefix sums over them.
    pub(crate) struct OrderBuffers(planned: &Planned) {
        survivors: Buffer<u32> = planned.one(scene::SURVIVORS)?,
        sums_of_survivors: Vec<Buffer<u32>> = planned.all(scene::SUMS_OF_SURVIVORS)?,
    }
}
