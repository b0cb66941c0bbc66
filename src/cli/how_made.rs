//! What a picture's file says of how it was made.

use serde_json::Value;

use super::typed::Typed;
use crate::engine::error::bound::FilmError;
use crate::engine::identity::settings_with_effect;
use crate::engine::room::RunResult as RoomResult;
use crate::engine::saved::SavedRun;
use crate::engine::scene::{RunResult, SceneFilm};
use crate::engine::watch::End;
use crate::output::colour::Format;
use crate::output::metadata::{Metadata, Repeat, devices, errors};
use crate::plan::work_division::Division;
use crate::settings::Builder;
use crate::settings::scene::SceneSettings;
use crate::settings::tile_samples::TileSamples;

/// A picture that was put together from parts of a run.
pub(super) fn of_merge(typed: &Typed, run: &SavedRun, film: &SceneFilm, units: String, format: Format) -> Metadata {
    let confidence = film.plan.confidence;
    let [error, error_bound] = errors(&film.error(confidence).stated(), confidence);
    Metadata {
        photonmill: env!("CARGO_PKG_VERSION").to_owned(),
        devices: run.identity.device.iter().cloned().collect(),
        scene: run.identity.scene.clone(),
        scene_hash: None,
        seed: run.identity.settings.get("seed").and_then(Value::as_u64).unwrap_or_default(),
        rounds: film.rounds,
        degrees_of_freedom: film.error_freedom(),
        error,
        error_bound,
        confidence,
        denoiser: None,
        units,
        command: typed.line(&[("-o", name_in_text(format).to_owned())]),
        settings: run.identity.settings.clone(),
        repeat: Repeat::Not("was put together by merge; repeat the picture of one run that does all of it".to_owned()),
    }
}

/// A picture of the paper's box, which its command line makes again.
pub(super) fn of_room(typed: &Typed, outcome: &RoomResult, error: &FilmError, format: Format) -> Metadata {
    let settings = &outcome.plan.settings;
    let confidence = settings.stop.confidence;
    let [error, error_bound] = errors(error, confidence);
    let builder = outcome.device.is_none().then(|| ("--variant", Builder::Cpu.name().to_owned()));
    let options = [("--rounds", outcome.film.rounds.to_string()), ("-o", name_in_text(format).to_owned())];
    let devices = devices(outcome.device.iter().chain(&outcome.more_devices));
    Metadata {
        photonmill: env!("CARGO_PKG_VERSION").to_owned(),
        devices: if devices.is_empty() { vec!["cpu".to_owned()] } else { devices },
        scene: "open-box".to_owned(),
        scene_hash: None,
        seed: settings.seed,
        rounds: outcome.film.rounds,
        degrees_of_freedom: outcome.film.error_freedom(),
        error,
        error_bound,
        confidence,
        denoiser: None,
        units: match format {
            Format::Png => "the paper's illumination, from 0 to 1 as codes from 0 to 255".to_owned(),
            Format::Exr => "the paper's illumination, not clamped to 1".to_owned(),
        },
        command: typed.line(&builder.into_iter().chain(options).collect::<Vec<_>>()),
        settings: settings_with_effect(settings),
        repeat: match outcome.end {
            End::Rounds | End::Error | End::Photons => Repeat::With {
                command: typed.command.clone(),
                arguments: typed.words(),
                division: Division::of(&SceneSettings::default()),
                tiles: None,
            },
            // A round may be cut short then.
            End::Time | End::Cancelled => {
                Repeat::Not("was ended early, at a moment that no other run meets; run it with --rounds instead".to_owned())
            }
        },
    }
}

/// Under whatever name a picture is written: equal results are equal files.
fn name_in_text(format: Format) -> &'static str {
    if format == Format::Png { "picture.png" } else { "picture.exr" }
}

/// A picture of a scene and its run.
pub(super) struct Made<'a> {
    pub(super) typed: &'a Typed,
    pub(super) lit: &'a RunResult,
    pub(super) scene: &'a str,
    pub(super) scene_hash: String,
    pub(super) is_shard: bool,
    /// The blocks that a resumed run began with have others between them that were not done, up to so many.
    pub(super) blocks_with_gaps: u32,
}

/// The blocks up to the last one of a resumed run that lacks some of them; 0 where it lacks none.
pub(super) fn blocks_with_gaps(resumed: Option<&SavedRun>) -> u32 {
    resumed.map(|run| run.done.end()).filter(|end| resumed.is_some_and(|run| run.done.count() < *end)).unwrap_or(0)
}

impl Made<'_> {
    /// Why the picture cannot be made again, if it cannot.
    fn obstacle(&self) -> Option<&'static str> {
        let Made { lit, is_shard, blocks_with_gaps, .. } = *self;
        let per_round: u64 = lit.plan.maps().map(|map| u64::from(map.photons)).sum();
        let is_early = matches!(lit.end, End::Time | End::Cancelled);
        if is_shard {
            Some("holds a shard of a run; repeat the picture of all shards, from the run without --shard")
        } else if lit.film.rounds == 1 && is_early && lit.ledger().emitted < per_round {
            Some("was cut short within its first round, at a moment that no other run meets; render it with --rounds instead")
        } else if blocks_with_gaps > lit.film.blocks || (is_early && !lit.more_devices.is_empty()) {
            Some("may hold blocks of rounds with others missing between them; render it with --rounds instead")
        } else {
            None
        }
    }

    /// Options that say what each round did, where that is not what it does without them.
    fn options(&self) -> Vec<(&'static str, String)> {
        let usual = Division::of(&SceneSettings::default());
        let used = Division::of(&self.lit.plan.settings);
        // Photons of a file are as many as they are.
        let traces = !self.typed.has("--map");
        let options = [
            ("--photons", used.photons, used.photons != usual.photons && traces),
            ("--caustic-photons", used.caustic_photons, used.caustic_photons != used.photons && traces),
            ("--samples", used.samples, used.samples != usual.samples),
            ("--shadow-rays", used.shadow_rays, used.shadow_rays != usual.shadow_rays),
            ("--neighbours", used.neighbours, used.neighbours != usual.neighbours),
            ("--caustic-neighbours", used.caustic_neighbours, used.caustic_neighbours != (used.neighbours / 4).max(1)),
            ("--rounds", self.lit.film.rounds, true),
        ];
        options.into_iter().filter(|(.., is_needed)| *is_needed).map(|(option, value, _)| (option, value.to_string())).collect()
    }

    pub(super) fn devices(&self) -> Vec<String> {
        devices(self.lit.device.iter().chain(&self.lit.more_devices))
    }

    pub(super) fn metadata(&self, units: String, format: Format) -> Metadata {
        let output = name_in_text(format);
        let Made { typed, lit, scene, ref scene_hash, .. } = *self;
        let settings = &lit.plan.settings;
        let confidence = settings.stop.confidence;
        let [error, error_bound] = errors(&lit.error(), confidence);
        let is_even = settings.tiles.as_ref().is_none_or(|tiles: &TileSamples| tiles.most() == 0);
        let command = match is_even {
            true => typed.line(&[&self.options()[..], &[("-o", output.to_owned())]].concat()),
            // No option says which tiles have more samples.
            false => format!("photonmill repeat {output}"),
        };
        let repeat = match self.obstacle() {
            Some(reason) => Repeat::Not(reason.to_owned()),
            None => Repeat::With {
                command: typed.command.clone(),
                arguments: typed.words(),
                division: Division::of(settings),
                tiles: settings.tiles.clone(),
            },
        };
        Metadata {
            photonmill: env!("CARGO_PKG_VERSION").to_owned(),
            devices: self.devices(),
            scene: scene.to_owned(),
            scene_hash: Some(scene_hash.clone()),
            seed: settings.seed,
            rounds: lit.film.rounds,
            degrees_of_freedom: lit.film.error_freedom(),
            error,
            error_bound,
            confidence,
            denoiser: None,
            units,
            command,
            settings: settings_with_effect(settings),
            repeat,
        }
    }
}
