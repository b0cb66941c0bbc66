//! What each cluster of lights adds at points of a trial, from which the shares follow that shadow rays choose by
//! ([`crate::plan::light_choice`]).

use glam::Vec4;

use super::Round;
use super::points::in_pieces;
use crate::constants::{DOMAIN_LIGHTS, SEEN, SEEN_BY_GATHER};
use crate::error::Result;
use crate::gpu::kernels::TryLights;
use crate::gpu::{Commands, Extent, Kernel, Memory, Module};
use crate::plan::light_choice::LightChoice;
use crate::plan::scene::ScenePlan;
use crate::records::{Draws, Receiver, TrialRay, TryLightsPush, VisiblePoint};
use crate::rng::words;
use crate::scene::light_tree::LightTree;

/// Shadow rays of a trial, and of a point and a cluster.
const RAYS: u32 = 1 << 18;
const RAYS_OF_PAIR: (u32, u32) = (4, 32);
/// Places at most that light the points.
const PLACES: usize = 1 << 10;

/// Kernels that it takes.
pub(crate) fn modules(plan: &ScenePlan) -> Vec<Module> {
    plan.lights().map(|_| TryLights::MODULE).into_iter().collect()
}

/// The points at which shadow rays are cast: what is asked about, receivers or what a camera sees, and where rays of a final gather
/// end.
pub(crate) fn points(receivers: &[Vec<Receiver>], visible_points: &[VisiblePoint], planes: &[Vec4]) -> Vec<Receiver> {
    let receivers = receivers.iter().flatten();
    let is_picture = receivers.clone().next().is_none();
    let is_asked = |point: &&VisiblePoint| point.arrivals & SEEN != 0 && (is_picture || point.arrivals & SEEN_BY_GATHER != 0);
    let on_surface = |point: &VisiblePoint| {
        let normal = planes[point.plane as usize / 2].truncate() * if point.plane.is_multiple_of(2) { 1.0 } else { -1.0 };
        Receiver { position: point.position, normal, shading_normal: normal }
    };
    receivers.copied().chain(visible_points.iter().filter(is_asked).map(on_surface)).collect()
}

/// What rays of the trial met: from there light comes to its points.
fn places(rays: &[TrialRay]) -> impl Iterator<Item = Receiver> {
    let met = |ray: &&TrialRay| ray.escapes == 0;
    let step = rays.iter().filter(met).count().div_ceil(PLACES).max(1);
    let place = |ray: &TrialRay| Receiver { position: ray.met, normal: ray.normal, shading_normal: ray.normal };
    rays.iter().filter(met).step_by(step).map(place)
}

/// Learns how shadow rays choose lights at these points and round about, and photons at what rays from there met too: a lamp that
/// lights no point lights what lights it.
pub(crate) fn learn(commands: &mut Commands, round: Round, tree: LightTree, asked: &[Receiver], rays: &[TrialRay]) -> Result<LightChoice> {
    let (of_asked, ray_count) = what_clusters_add(commands, round, &tree, asked)?;
    let places: Vec<Receiver> = places(rays).collect();
    let (of_places, _) = what_clusters_add(commands, round, &tree, &places)?;
    Ok(LightChoice::learned(round.geometry, tree, (asked, &of_asked), (&places, &of_places), ray_count))
}

/// Of each point and cluster, by so many shadow rays.
fn what_clusters_add(commands: &mut Commands, round: Round, tree: &LightTree, points: &[Receiver]) -> Result<(Vec<f32>, u32)> {
    if points.is_empty() {
        return Ok((Vec::new(), 1));
    }
    let pair_count = (points.len() * tree.cluster_count) as u32;
    let ray_count = (RAYS / pair_count).clamp(RAYS_OF_PAIR.0, RAYS_OF_PAIR.1);
    let receivers = commands.uploaded("points of the trial", points)?;
    let found = commands.gpu().buffer::<f32>("what lights add", u64::from(pair_count), Memory::Device)?;
    let draws = Draws { seed: words(round.plan.settings.seed), round: 0, domain: DOMAIN_LIGHTS };
    let (most, work) = (round.plan.items_at_once(ray_count), 64 * u64::from(ray_count));
    in_pieces(commands, round.plan, pair_count, most, work, |commands, first_pair, end_pair| {
        let resources = round.resources;
        let kernel =
            TryLights { scene: &resources.scene, receivers: &receivers, found: &found, nonfinite_values: &resources.nonfinite_values };
        let push = TryLightsPush { draws, first_pair, end_pair, cluster_count: tree.cluster_count as u32, ray_count };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(end_pair - first_pair)))
    })?;
    Ok((commands.read(&found, pair_count as usize)?, ray_count))
}
