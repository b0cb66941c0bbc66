//! How a case is measured: independent runs of a scene, of which the spread is the error.

use glam::DVec3;

use super::Estimate;
use crate::engine::scene::Receivers;
use crate::engine::{self, Control};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::render::PreparedScene;
use crate::scene::{Camera, Scene};
use crate::settings::scene::SceneSettings;

/// Independent runs of a case.
pub(crate) const SEEDS: u64 = 16;

/// Mean and standard error of the mean of independent values.
pub(crate) fn estimate_of(values: &[f64]) -> Estimate {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    Estimate { mean, standard_error: (variance / count).sqrt() }
}

/// Mean over all pixels or points and over seeds; the error is of the seeds' spread, since points share
/// photons. Scenes are grey: the red channel stands for all.
fn light(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, receivers: Receivers) -> Result<Estimate> {
    let mut prepared = PreparedScene::new(scene.clone()).prepare_with(settings, receivers)?;
    let limits = engine::limits(gpu.facts());
    let means: Vec<f64> = (1..=SEEDS)
        .map(|seed| {
            prepared.inputs.settings.seed = seed;
            // Radii that no case gives are those by the scene's area: a trial round would make kernels of its own.
            let result = prepared.light(gpu, prepared.plan_within(&limits)?, &mut Control::default())?;
            let sum: f64 = result.film.means().map(|mean| mean.x).sum();
            // What is no number makes the case fail instead of counting as dark.
            Ok(if result.film.anomalies[..3] == [0, 0, 0] { sum / result.film.pixels() as f64 } else { f64::NAN })
        })
        .collect::<Result<_>>()?;
    Ok(estimate_of(&means))
}

/// Irradiance at points (position, normal), W/m2.
pub(crate) fn irradiance(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)]) -> Result<Estimate> {
    light(gpu, scene, settings, Receivers::Points(points))
}

/// Radiance along one ray, W/m2/sr, seen through a picture of a narrow view.
pub(crate) fn radiance(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, eye: DVec3, receivers: DVec3) -> Result<Estimate> {
    mean_radiance(gpu, scene, settings, &Camera::looking_at("ray", eye, receivers, DVec3::Y, 0.003))
}

/// Radiance over a camera's picture, W/m2/sr.
pub(crate) fn mean_radiance(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, camera: &Camera) -> Result<Estimate> {
    light(gpu, scene, settings, Receivers::Image(camera, [24, 24]))
}
