//! Finds where light from beyond the scene comes in, by rays from points of a trial ([`crate::scene::openings`]).

use super::Round;
use super::points::{add_work, runs};
use crate::error::Result;
use crate::gpu::kernels::TryOpenings;
use crate::gpu::{Commands, Extent, Gpu, Kernel, Memory, Module};
use crate::plan::scene::ScenePlan;
use crate::records::{CausticTarget, OpeningRay, Receiver, TryOpeningsPush};
use crate::rng::words;
use crate::scene::openings::openings;

/// Rays of a trial, as many again from what they meet, and the most of a point.
const RAYS: u32 = 1 << 15;
const MOST_OF_POINT: u32 = 1 << 10;

/// Kernels that it takes.
pub fn modules(plan: &ScenePlan) -> Vec<Module> {
    if plan.openings().is_empty() { Vec::new() } else { vec![TryOpenings::MODULE] }
}

/// Openings that can be seen from these points and round about; they are the scene's from here on.
pub fn find(gpu: &Gpu, commands: &mut Commands, round: Round, points: &[Receiver]) -> Result<Vec<CausticTarget>> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let Round { resources, plan, .. } = round;
    let rays_of_point = (RAYS / points.len() as u32).clamp(1, MOST_OF_POINT);
    let ray_count = rays_of_point * points.len() as u32;
    let receivers = gpu.buffer::<Receiver>("points of the trial", points.len() as u64, Memory::Device)?;
    let opening_rays = gpu.buffer::<OpeningRay>("rays that may leave", 2 * u64::from(ray_count), Memory::Device)?;
    commands.upload(&receivers, points)?;
    for (first_ray, end_ray) in runs(ray_count, plan.pixels_at_once(2)) {
        let nonfinite_values = &resources.nonfinite_values;
        let kernel = TryOpenings { scene: &resources.scene, receivers: &receivers, opening_rays: &opening_rays, nonfinite_values };
        let push = TryOpeningsPush { seed: words(plan.settings.seed), first_ray, end_ray, rays_of_point };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(end_ray - first_ray)))?;
        add_work(commands, plan, 128 * u64::from(end_ray - first_ray))?;
    }
    let found = openings(&commands.read(&opening_rays, 2 * ray_count as usize)?);
    if !found.is_empty() {
        commands.upload(&resources.scene.openings, &found)?;
    }
    Ok(found)
}
