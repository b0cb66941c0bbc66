//! A picture: its values, and its file.

use std::path::Path;
use std::sync::Arc;

use super::Run;
use crate::engine::identity::settings_with_effect;
use crate::error::Result;
use crate::output::colour::{Format, Tone};
use crate::output::destination::{Destination, write_all};
use crate::output::metadata::{Metadata, Repeat, devices, errors};
use crate::output::show::{Layer, Show, Surface, surfaces, units};
use crate::scene::{Camera, Scene};

/// Row by row from the top, W/m2/sr.
pub struct Picture {
    pub run: Run,
    pub scene: Arc<Scene>,
    pub camera: Camera,
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// SHA-256 of the scene as kernels read it.
    pub scene_hash: String,
}

/// How a picture is written.
#[derive(Debug, Clone)]
pub struct Style {
    /// Of a PNG, stops; `None`: what makes the mean middle grey.
    pub exposure: Option<f32>,
    /// Of a PNG.
    pub tone: Tone,
    /// Of an EXR, beside the light.
    pub layers: Vec<Layer>,
}

impl Default for Style {
    fn default() -> Style {
        Style { exposure: None, tone: Tone::default(), layers: Layer::ALL.into() }
    }
}

impl Picture {
    /// Writes a `.png` for the eye, or an `.exr` of linear radiance with layers, as the file's name ends.
    pub fn save(&self, path: impl AsRef<Path>, style: &Style) -> Result<()> {
        let path = path.as_ref();
        let format = Format::of("-o", path)?;
        let destination = Destination::open("-o", path)?;
        write_all([(destination, self.encode(format, style))])
    }

    /// The content of such a file.
    pub fn encode(&self, format: Format, style: &Style) -> Vec<u8> {
        let Style { exposure, tone, ref layers } = *style;
        let show = Show { size: self.size, exposure, tone, layers: layers.clone(), denoised: None };
        let metadata = |stops: f32| self.metadata(units(format, stops, tone));
        match format {
            Format::Png => show.png(&self.run.film, metadata).0,
            Format::Exr => {
                let surfaces = if show.shows_surfaces() { self.surfaces() } else { Vec::new() };
                show.exr(&self.run.film, &surfaces, Some(&metadata(0.0)))
            }
        }
    }

    /// What each pixel sees first.
    pub fn surfaces(&self) -> Vec<Surface> {
        surfaces(&self.scene.without(&self.run.plan.settings.without), &self.camera, self.size)
    }

    fn metadata(&self, units: String) -> Metadata {
        let settings = &self.run.plan.settings;
        let confidence = settings.stop.confidence;
        let [error, error_bound] = errors(&self.run.error(), confidence);
        Metadata {
            denoiser: None,
            photonmill: env!("CARGO_PKG_VERSION").to_owned(),
            devices: devices(self.run.device.iter().chain(&self.run.more_devices)),
            scene: self.scene.name.clone(),
            scene_hash: Some(self.scene_hash.clone()),
            seed: settings.seed,
            rounds: self.run.film.rounds,
            degrees_of_freedom: self.run.film.error_freedom(),
            error,
            error_bound,
            confidence,
            units,
            command: "none, as it was made by a call of the library".to_owned(),
            settings: settings_with_effect(settings),
            repeat: Repeat::Not("was made by a call of the library and not by a command; repeat the call".to_owned()),
        }
    }
}
