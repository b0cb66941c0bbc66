//! What a pilot has chosen, as a file: `--save-settings` and `--settings`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Serialize};

use super::complain;
use crate::error::{Error, Result};
use crate::output::destination::{Destination, write_all};
use crate::output::metadata::Metadata;
use crate::plan::work_division::Division;
use crate::settings::scene::SceneSettings;
use crate::settings::tile_samples::TileSamples;
use crate::text::refusal;

#[derive(Args)]
pub(super) struct ChosenArgs {
    /// Take what a pilot has chosen from a file of --save-settings, and run no pilot; options that are given go before it
    #[arg(long, value_name = "FILE", help_heading = "Light transport")]
    settings: Option<PathBuf>,
}

/// The first line of a file says what it is.
const FORMAT: &str = "photonmill settings 1";
/// No file of settings is longer.
const MOST_BYTES: u64 = 1 << 20;

/// What was chosen, and for what.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Chosen {
    format: String,
    version: String,
    scene: String,
    /// Hash of the scene as kernels read it.
    scene_hash: String,
    /// Pixels.
    size: [u32; 2],
    /// Class of the device.
    device: String,
    pub(super) settings: Division,
    /// Tiles with more samples than all pixels have.
    tiles: Option<TileSamples>,
    /// Rounds that the goal was expected to take, whole blocks.
    pub(super) rounds: u32,
}

/// For what something was chosen, or is used.
pub(super) struct For<'a> {
    pub(super) scene: &'a str,
    pub(super) scene_hash: String,
    pub(super) size: (u32, u32),
    pub(super) device: &'a str,
}

impl ChosenArgs {
    /// Files that are read.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        self.settings.iter().map(PathBuf::as_path)
    }

    pub(super) fn is_given(&self) -> bool {
        self.settings.is_some()
    }

    pub(super) fn open(&self) -> Result<Option<Chosen>> {
        self.settings.as_deref().map(Chosen::open).transpose()
    }
}

impl Chosen {
    pub(super) fn new(settings: &SceneSettings, rounds: u32, chosen_for: &For) -> Chosen {
        Chosen {
            format: FORMAT.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            scene: chosen_for.scene.into(),
            scene_hash: chosen_for.scene_hash.clone(),
            size: [chosen_for.size.0, chosen_for.size.1],
            device: chosen_for.device.into(),
            settings: Division::of(settings),
            tiles: settings.tiles.clone(),
            rounds,
        }
    }

    /// What a request starts from.
    pub(super) fn settings(&self) -> SceneSettings {
        SceneSettings { tiles: self.tiles.clone(), rounds: self.rounds, ..self.settings.set(&SceneSettings::default()) }
    }

    fn open(path: &Path) -> Result<Chosen> {
        let refused = |reason: String| Error::setting("--settings", path.display(), reason);
        let unreadable = |error: std::io::Error| refused(format!("cannot be read ({}); name a file of --save-settings", refusal(&error)));
        let is_long = std::fs::metadata(path).map_err(unreadable)?.len() > MOST_BYTES;
        let text = if is_long { Vec::new() } else { std::fs::read(path).map_err(unreadable)? };
        let other =
            |reason: &dyn std::fmt::Display| refused(format!("is no file of --save-settings of this version ({reason}); make a new one"));
        let chosen: Chosen = serde_json::from_slice(&text).map_err(|error| other(&error))?;
        if chosen.format != FORMAT {
            return Err(other(&format!("its format is not '{FORMAT}'")));
        }
        chosen.validate().map_err(|error| other(&error))?;
        Ok(chosen)
    }

    fn validate(&self) -> Result<()> {
        self.settings().validate()
    }

    /// What a picture's file says of its rounds; fails where that is nothing that a run can do.
    pub(super) fn of_picture(made: &Metadata, settings: Division, tiles: Option<TileSamples>) -> Result<Chosen> {
        let chosen = Chosen {
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
        chosen.validate()?;
        Ok(chosen)
    }

    pub(super) fn write(&self, destination: Destination) -> Result<()> {
        let mut text = serde_json::to_vec_pretty(self).expect("settings are numbers and names");
        text.push(b'\n');
        write_all([(destination, text)])
    }

    /// Warns where it was chosen for something else.
    pub(super) fn compare(&self, used_for: &For) {
        let size = |size: [u32; 2]| format!("{} x {} pixels", size[0], size[1]);
        let own = [used_for.size.0, used_for.size.1];
        let other = if self.scene_hash != used_for.scene_hash {
            format!("{}, which was another scene or was edited since", self.scene)
        } else if self.size != own {
            size(self.size)
        } else if self.device != used_for.device {
            format!("a device of class {}", self.device)
        } else {
            return;
        };
        complain(&format!("warning: --settings: chosen for {other}; other settings may be better here"));
    }
}
