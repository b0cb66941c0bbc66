//! What each cluster of lights adds at points of a trial, from which the shares follow that shadow rays choose by
//! ([`crate::plan::light_choice`]).

use glam::Vec4;

use super::Round;
use super::points::{add_work, runs};
use crate::constants::{DOMAIN_LIGHTS, SEEN, SEEN_BY_GATHER};
use crate::error::Result;
use crate::gpu::kernels::TryLights;
use crate::gpu::{Commands, Extent, Gpu, Kernel, Memory, Module};
use crate::plan::light_choice::LightChoice;
use crate::plan::scene::ScenePlan;
use crate::records::{Draws, Receiver, TryLightsPush, VisiblePoint};
use crate::rng::words;
use crate::scene::light_tree::LightTree;

/// Shadow rays of a trial, and of a point and a cluster.
const RAYS: u32 = 1 << 18;
const RAYS_OF_PAIR: (u32, u32) = (4, 32);

/// Kernels that it takes.
pub fn modules(plan: &ScenePlan) -> Vec<Module> {
    plan.lights().map(|_| TryLights::MODULE).into_iter().collect()
}

/// The points at which shadow rays are cast: what is asked about, receivers or what a camera sees, and where rays of a final gather
/// end.
pub fn points(receivers: &[Vec<Receiver>], visible_points: &[VisiblePoint], planes: &[Vec4]) -> Vec<Receiver> {
    let receivers = receivers.iter().flatten();
    let is_picture = receivers.clone().next().is_none();
    let is_asked = |point: &&VisiblePoint| point.arrivals & SEEN != 0 && (is_picture || point.arrivals & SEEN_BY_GATHER != 0);
    let on_surface = |point: &VisiblePoint| {
        let normal = planes[point.plane as usize / 2].truncate() * if point.plane.is_multiple_of(2) { 1.0 } else { -1.0 };
        Receiver { position: point.position, normal, shading_normal: normal }
    };
    receivers.copied().chain(visible_points.iter().filter(is_asked).map(on_surface)).collect()
}

/// Learns how to choose lights at these points and round about.
pub fn learn(gpu: &Gpu, commands: &mut Commands, round: Round, tree: LightTree, points: &[Receiver]) -> Result<LightChoice> {
    if points.is_empty() {
        return Ok(LightChoice::by_power(round.geometry, tree));
    }
    let pair_count = (points.len() * tree.cluster_count) as u32;
    let ray_count = (RAYS / pair_count).clamp(RAYS_OF_PAIR.0, RAYS_OF_PAIR.1);
    let receivers = gpu.buffer::<Receiver>("points of the trial", points.len() as u64, Memory::Device)?;
    let found = gpu.buffer::<f32>("what lights add", u64::from(pair_count), Memory::Device)?;
    commands.upload(&receivers, points)?;
    let draws = Draws { seed: words(round.plan.settings.seed), round: 0, domain: DOMAIN_LIGHTS };
    for (first_pair, end_pair) in runs(pair_count, round.plan.pixels_at_once(ray_count)) {
        let resources = round.resources;
        let kernel =
            TryLights { scene: &resources.scene, receivers: &receivers, found: &found, nonfinite_values: &resources.nonfinite_values };
        let push = TryLightsPush { draws, first_pair, end_pair, ray_count };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(end_pair - first_pair)))?;
        add_work(commands, round.plan, 64 * u64::from(end_pair - first_pair) * u64::from(ray_count))?;
    }
    let found = commands.read(&found, pair_count as usize)?;
    Ok(LightChoice::learned(round.geometry, tree, points, &found, ray_count))
}
