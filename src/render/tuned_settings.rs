//! What a pilot has chosen, as a file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::output::destination::{Destination, write_all};
use crate::output::metadata::Metadata;
use crate::plan::work_division::Division;
use crate::settings::scene::SceneSettings;
use crate::settings::tile_samples::TileSamples;
use crate::text::refusal;

/// The first line of a file says what it is.
const FORMAT: &str = "photonmill settings 1";
/// No file of settings is longer.
const MOST_BYTES: u64 = 1 << 20;

/// What was chosen, and for what.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TunedSettings {
    format: String,
    version: String,
    scene: String,
    /// Hash of the scene as kernels read it.
    scene_hash: String,
    /// Pixels.
    size: [u32; 2],
    /// Class of the device.
    device: String,
    pub settings: Division,
    /// Tiles with more samples than all pixels have.
    tiles: Option<TileSamples>,
    /// Rounds that the goal was expected to take, whole blocks.
    pub rounds: u32,
}

/// For what something was chosen, or is used.
pub(crate) struct TunedFor<'a> {
    pub scene: &'a str,
    pub scene_hash: String,
    pub size: (u32, u32),
    pub device: &'a str,
}

impl TunedSettings {
    pub(crate) fn new(settings: &SceneSettings, rounds: u32, tuned_for: &TunedFor) -> TunedSettings {
        TunedSettings {
            format: FORMAT.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            scene: tuned_for.scene.into(),
            scene_hash: tuned_for.scene_hash.clone(),
            size: [tuned_for.size.0, tuned_for.size.1],
            device: tuned_for.device.into(),
            settings: Division::of(settings),
            tiles: settings.tiles.clone(),
            rounds,
        }
    }

    /// What a request starts from.
    pub fn settings(&self) -> SceneSettings {
        SceneSettings { tiles: self.tiles.clone(), rounds: self.rounds, ..self.settings.set(&SceneSettings::default()) }
    }

    pub fn open(path: &Path) -> Result<TunedSettings> {
        let refused = |reason: String| Error::setting("settings", path.display(), reason);
        let unreadable = |error: std::io::Error| refused(format!("cannot be read ({}); name a file of `save_settings`", refusal(&error)));
        let is_long = std::fs::metadata(path).map_err(unreadable)?.len() > MOST_BYTES;
        let text = if is_long { Vec::new() } else { std::fs::read(path).map_err(unreadable)? };
        let other =
            |reason: &dyn std::fmt::Display| refused(format!("is no file of `save_settings` of this version ({reason}); make a new one"));
        let tuned: TunedSettings = serde_json::from_slice(&text).map_err(|error| other(&error))?;
        if tuned.format != FORMAT {
            return Err(other(&format!("its format is not '{FORMAT}'")));
        }
        tuned.validate().map_err(|error| other(&error))?;
        Ok(tuned)
    }

    fn validate(&self) -> Result<()> {
        self.settings().validate()
    }

    /// What a picture's file says of its rounds; fails where that is nothing that a run can do.
    pub(crate) fn of_picture(made: &Metadata, settings: Division, tiles: Option<TileSamples>) -> Result<TunedSettings> {
        let tuned = TunedSettings {
            format: FORMAT.into(),
            version: made.photonmill.clone(),
            scene: made.scene.clone(),
            scene_hash: made.scene_hash.clone().unwrap_or_default(),
            size: [0; 2],
            device: String::new(),
            settings,
            tiles,
            rounds: made.rounds,
        };
        tuned.validate()?;
        Ok(tuned)
    }

    pub(crate) fn write(&self, destination: Destination) -> Result<()> {
        let mut text = serde_json::to_vec_pretty(self).expect("settings are numbers and names");
        text.push(b'\n');
        write_all([(destination, text)])
    }

    /// What is to be said where it was chosen for something else.
    pub(crate) fn difference(&self, used_for: &TunedFor) -> Option<String> {
        let size = |size: [u32; 2]| format!("{} x {} pixels", size[0], size[1]);
        let own = [used_for.size.0, used_for.size.1];
        let other = if self.scene_hash != used_for.scene_hash {
            format!("{}, which was another scene or was edited since", self.scene)
        } else if self.size != own {
            size(self.size)
        } else if self.device != used_for.device {
            format!("a device of class {}", self.device)
        } else {
            return None;
        };
        Some(format!("`settings`: chosen for {other}; other settings may be better here"))
    }
}
