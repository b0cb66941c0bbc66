//! Rays from points of a trial and from what they meet, as light may come to these points.

use super::Round;
use super::points::in_pieces;
use crate::error::Result;
use crate::gpu::kernels::TrialRays;
use crate::gpu::{Commands, Extent, Memory};
use crate::records::{Receiver, TrialRay, TrialRaysPush};
use crate::rng::words;

/// Rays of a trial, as many again from what they meet, and the most of a point.
const RAYS: u32 = 1 << 15;
const MOST_OF_POINT: u32 = 1 << 10;

/// Pairs of a ray from a point, and of the one from what it meets: the same ray again where it meets nothing.
pub(crate) fn cast(commands: &mut Commands, round: Round, points: &[Receiver]) -> Result<Vec<TrialRay>> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let Round { resources, plan, .. } = round;
    let rays_of_point = (RAYS / points.len() as u32).clamp(1, MOST_OF_POINT);
    let ray_count = rays_of_point * points.len() as u32;
    let receivers = commands.uploaded("points of the trial", points)?;
    let trial_rays = commands.gpu().buffer::<TrialRay>("rays of the trial", 2 * u64::from(ray_count), Memory::Device)?;
    in_pieces(commands, plan, ray_count, plan.items_at_once(2), 128, |commands, first_ray, end_ray| {
        let nonfinite_values = &resources.nonfinite_values;
        let kernel = TrialRays { scene: &resources.scene, receivers: &receivers, trial_rays: &trial_rays, nonfinite_values };
        let push = TrialRaysPush { seed: words(plan.settings.seed), first_ray, end_ray, rays_of_point };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(end_ray - first_ray)))
    })?;
    commands.read(&trial_rays, 2 * ray_count as usize)
}
