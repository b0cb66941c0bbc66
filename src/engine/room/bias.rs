//! The bias of the paper's radius, from batches of the run's own kind.

use std::sync::atomic::AtomicBool;

use super::{RunResult, on_cpu, on_gpu};
use crate::engine::Control;
use crate::engine::bias::{self, Bias};
use crate::engine::room::film::estimate_walls;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::room::RoomScene;
use crate::settings::stop::Stop;
use crate::settings::{MIN_RADIUS, ROOM_BELOW, RoomSettings};

/// The bias of irradiance with so many rounds a batch, on a device or, without one, on the CPU; `None` if it was
/// cancelled. A radius as small as is allowed is taken for a larger one that leaves room below it.
pub fn measure_bias(
    gpu: Option<&Gpu>,
    scene: &RoomScene,
    settings: &RoomSettings,
    rounds: u32,
    cancelled: &AtomicBool,
) -> Result<Option<Bias>> {
    let settings = &RoomSettings { radius: settings.radius.max(ROOM_BELOW * MIN_RADIUS), ..settings.clone() };
    bias::extrapolate(settings.stop.confidence, rounds, |factor, number| {
        bias_batch(gpu, scene, settings, (factor, rounds, number), cancelled)
    })
}

/// Irradiance of a batch, texel by texel, at the radius times a factor.
pub fn bias_batch(
    gpu: Option<&Gpu>,
    scene: &RoomScene,
    settings: &RoomSettings,
    (factor, rounds, number): (f64, u32, u32),
    cancelled: &AtomicBool,
) -> Result<Option<Vec<f64>>> {
    let settings = RoomSettings {
        rounds,
        radius: factor * settings.radius,
        seed: bias::seed(settings.seed, number),
        stop: Stop { confidence: settings.stop.confidence, ..Stop::default() },
        ..settings.clone()
    };
    let mut control = Control { cancelled, progress: &mut |_| {} };
    let outcome: RunResult = match gpu {
        Some(gpu) => on_gpu(gpu, scene, &settings, &mut control)?,
        None => on_cpu(scene, &settings, &mut control)?,
    };
    // A wall that reflects nothing stores nothing.
    let known = |irradiance: f64| if irradiance.is_finite() { irradiance } else { 0.0 };
    let walls = estimate_walls(&outcome.film, scene, &outcome.plan);
    Ok((!outcome.cancelled).then(|| walls.into_iter().flat_map(|wall| wall.irradiance).map(known).collect()))
}
