//! The bias of the paper's radius, from batches of the run's own kind.

use crate::settings::stop::Stop;
use std::sync::atomic::AtomicBool;

use crate::engine::error::bias::Bias;
use crate::engine::error::bias_batches::Batches;
use crate::engine::room::film::estimate_walls;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::room::RoomScene;
use crate::settings::{MIN_RADIUS, ROOM_BELOW, RoomSettings};

/// The bias of irradiance with so many rounds a batch, on a device or, without one, on the CPU; `None` if it was
/// cancelled. A radius as small as is allowed is taken for a larger one that leaves room below it.
pub(crate) fn measure_bias(
    gpu: Option<&Gpu>,
    scene: &RoomScene,
    settings: &RoomSettings,
    rounds: u32,
    cancelled: &AtomicBool,
) -> Result<Option<Bias>> {
    let radius = settings.radius.max(ROOM_BELOW * MIN_RADIUS);
    let Stop { measure, confidence, .. } = settings.stop;
    let batches = Batches { seed: settings.seed, measure, confidence, rounds, cancelled };
    batches.measure(|batch, control| {
        let settings =
            RoomSettings { rounds: batch.rounds, radius: batch.factor * radius, seed: batch.seed, stop: batch.stop, ..settings.clone() };
        let found = super::run(gpu, scene, &settings, control)?;
        // A wall that reflects nothing stores nothing.
        let known = |irradiance: f64| if irradiance.is_finite() { irradiance } else { 0.0 };
        let walls = estimate_walls(&found.film, scene, &found.plan);
        Ok((found.end, walls.into_iter().flat_map(|wall| wall.irradiance).map(known).collect()))
    })
}
