//! The bias of a run's radii, from batches of its own kind.

use std::sync::atomic::AtomicBool;

use super::{End, View, light};
use crate::engine;
use crate::engine::Control;
use crate::engine::bias::{self, Bias};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::plan::radius::RADIUS_RANGE;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::scene::Scene;
use crate::settings::scene::SceneSettings;
use crate::settings::stop::Stop;

/// The bias of all light at the plan's radii of the first round times `factor`, kept through so many rounds a batch;
/// `None` if it was cancelled. Radii as small as is allowed are taken for larger ones that leave room below them. Light that no map has is the same at every radius, and has no bias.
pub fn measure(
    gpu: &Gpu,
    scene: &Scene,
    view: &View,
    plan: &ScenePlan,
    (factor, rounds): (f64, u32),
    cancelled: &AtomicBool,
) -> Result<Option<Bias>> {
    if plan.maps().next().is_none() {
        return Ok(Some(Bias::none(plan.settings.stop.confidence)));
    }
    if plan.bias_is_unknown() {
        return Ok(Some(Bias::unknown(plan.settings.stop.confidence)));
    }
    let room = plan.maps().map(|map| crate::settings::ROOM_BELOW * RADIUS_RANGE.0 / map.radius).fold(0.0, f64::max);
    let factor = factor.max(room);
    bias::extrapolate(plan.settings.stop.confidence, rounds, |smaller, number| {
        batch(gpu, scene, view, plan, (factor * smaller, rounds, number), cancelled)
    })
}

/// Radiance or irradiance of a batch, three channels a pixel, at the first round's radii times a factor.
pub fn batch(
    gpu: &Gpu,
    scene: &Scene,
    view: &View,
    plan: &ScenePlan,
    (factor, rounds, number): (f64, u32, u32),
    cancelled: &AtomicBool,
) -> Result<Option<Vec<f64>>> {
    let metres = |map: &MapPlan| factor * map.radius * view.geometry.unit;
    let settings = SceneSettings {
        rounds,
        alpha: 1.0,
        seed: bias::seed(plan.settings.seed, number),
        radius: plan.global.as_ref().map(metres),
        caustic_radius: plan.caustic.as_ref().map(metres),
        stop: Stop { confidence: plan.settings.stop.confidence, ..Stop::default() },
        ..plan.settings.clone()
    };
    let plan = ScenePlan::new(scene, view.geometry, &settings, plan.sensor, &engine::limits(gpu.facts()))?;
    let lit = light(gpu, view, plan, &mut Control { cancelled, progress: &mut |_| {} })?;
    let values = (0..lit.film.pixels()).flat_map(|pixel| lit.film.mean(pixel, &lit.plan).to_array()).collect();
    Ok((lit.end != End::Cancelled).then_some(values))
}
