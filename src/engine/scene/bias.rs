//! The bias of a run's radii, from batches of its own kind.

use std::sync::atomic::AtomicBool;

use super::{Viewpoint, light};
use crate::engine;
use crate::engine::error::bias::Bias;
use crate::engine::error::bias_batches::{Batch, Batches};
use crate::engine::{Control, End};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::plan::film::BiasPlan;
use crate::plan::radius::{RADIUS_RANGE, RadiusFrom, Trial};
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::scene::Scene;
use crate::settings::ROOM_BELOW;
use crate::settings::scene::SceneSettings;
use crate::settings::stop::Stop;

/// Refuses an error of a scene whose bias is unknown, and that nothing else would end.
pub(crate) fn check(stop: &Stop, bias: BiasPlan) -> Result<()> {
    let ends_otherwise = stop.seconds.is_some() || stop.photons.is_some();
    let Some(wanted) = stop.error.filter(|_| bias == BiasPlan::Nothing && !ends_otherwise) else { return Ok(()) };
    let allowed = format!(
        "cannot be reached: the bias is unknown, because {}; leave out what makes the scene so wide, give a `radius`, or add `time`",
        Bias::UNKNOWN
    );
    Err(Error::setting("error", format!("{}%", 100.0 * wanted), allowed))
}

/// The bias of all light at the plan's radii of the first round times `factor`, kept through so many rounds a batch;
/// `None` if it was cancelled. Radii as small as is allowed are taken for larger ones that leave room below them. Light that no map has is the same at every radius, and has no bias.
pub(crate) fn measure(
    gpu: &Gpu,
    scene: &Scene,
    viewpoint: &Viewpoint,
    plan: &ScenePlan,
    (factor, rounds): (f64, u32),
    cancelled: &AtomicBool,
) -> Result<Option<Bias>> {
    let confidence = plan.settings.stop.confidence;
    if plan.maps().next().is_none() {
        return Ok(Some(Bias::none(confidence)));
    }
    if plan.bias_is_unknown() {
        return Ok(Some(Bias::unknown(confidence)));
    }
    let room = plan.maps().map(|map| ROOM_BELOW * RADIUS_RANGE.0 / map.radius).fold(0.0, f64::max);
    let factor = factor.max(room);
    Batches { seed: plan.settings.seed, measure: plan.settings.stop.measure, confidence, rounds, cancelled }
        .measure(|of, control| batch(gpu, scene, viewpoint, plan, &Batch { factor: factor * of.factor, ..*of }, control))
}

/// Radiance or irradiance of a batch, three channels a pixel, at the first round's radii times a factor.
pub(crate) fn batch(
    gpu: &Gpu,
    scene: &Scene,
    viewpoint: &Viewpoint,
    plan: &ScenePlan,
    &Batch { factor, rounds, seed, stop }: &Batch,
    control: &mut Control,
) -> Result<(End, Vec<f64>)> {
    let given = |map: &MapPlan| (map.radius_from != RadiusFrom::Trial).then_some(factor * map.radius * viewpoint.geometry.unit);
    let settings = SceneSettings {
        rounds,
        block: Some(1),
        alpha: 1.0,
        seed,
        radius: plan.global.as_ref().and_then(given),
        caustic_radius: plan.caustic.as_ref().and_then(given),
        stop,
        ..plan.settings.clone()
    };
    // Radii of the trial's keep their classes.
    let trial = plan.trial.as_ref().map(|trial| Trial { factor: Some(factor), ..trial.clone() });
    let plan = ScenePlan::with_trial(scene, viewpoint.geometry, &settings, plan.sensor, &engine::limits(gpu.facts()), trial)?;
    let result = light(gpu, viewpoint, plan, control)?;
    Ok((result.end, result.film.surface_means().flat_map(|mean| mean.to_array()).collect()))
}
