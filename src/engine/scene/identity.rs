//! What a run on a scene computes: the scene as the kernels read it, who looks at it, and what the trial found.

use super::Viewpoint;
use crate::engine::run::identity::{Hash, Identity};
use crate::gpu::DeviceFacts;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::scene::geometry::Geometry;

/// Specialization constants that change no bit of a block.
const WITHOUT_EFFECT: [&str; 4] = ["HAS_SLOTS", "HAS_PARTS", "CHAIN_STEPS", "PARANOID"];

pub(crate) fn identity(scene: &str, viewpoint: &Viewpoint, plan: &ScenePlan, map: Option<&str>, facts: &DeviceFacts) -> Identity {
    Identity::new(scene, content(viewpoint, plan, map), &plan.settings, found(plan), Some(facts), plan.settings.math)
}

/// Of a scene as the kernels read it.
fn add_scene(hash: &mut Hash, geometry: &Geometry) {
    let Geometry { centre, unit, nodes, triangles, planes, normals, uvs, colours, materials, .. } = geometry;
    let Geometry { layered_materials, triangle_layers, textures, texels, emitters, flux_unit, power, .. } = geometry;
    hash.add_text(&format!("{centre:?} {unit:?} {flux_unit:?} {power:?}"));
    hash.add(nodes);
    hash.add(triangles);
    hash.add(planes);
    hash.add(normals);
    hash.add(uvs);
    hash.add(colours);
    hash.add(materials);
    hash.add(layered_materials);
    hash.add(triangle_layers);
    hash.add(textures);
    hash.add(texels);
    hash.add(emitters);
}

pub(crate) fn scene_hash(geometry: &Geometry) -> String {
    let mut hash = Hash::default();
    add_scene(&mut hash, geometry);
    hash.finish()
}

fn content(viewpoint: &Viewpoint, plan: &ScenePlan, map: Option<&str>) -> Hash {
    let mut hash = Hash::default();
    add_scene(&mut hash, viewpoint.geometry);
    hash.add_text(&format!("{:?} {:?}", plan.sensor, viewpoint.camera));
    map.iter().for_each(|map| hash.add_text(map));
    viewpoint.phases.iter().for_each(|phase| hash.add(phase));
    hash
}

fn found(plan: &ScenePlan) -> Hash {
    let mut hash = Hash::default();
    let constants: Vec<_> = plan.constants.iter().filter(|(name, _)| !WITHOUT_EFFECT.contains(name)).collect();
    hash.add_text(&format!("{constants:?} {:?} {:?} {:?}", plan.work(), plan.film.scale, plan.film.limit));
    for MapPlan { name, photons, bounces, stored, radius, classes, flux_gain, flux_scale, through_openings, .. } in plan.maps() {
        hash.add_text(&format!(
            "{name} {photons} {bounces} {stored} {radius:?} {classes:?} {flux_gain:?} {flux_scale:?} {through_openings}"
        ));
    }
    hash.add(&plan.targets);
    hash.add(&plan.openings());
    if let Some(lights) = plan.lights() {
        hash.add(&lights.nodes);
        hash.add(&lights.regions);
        hash.add(&lights.shares);
        hash.add(&lights.emitters);
    }
    hash
}
