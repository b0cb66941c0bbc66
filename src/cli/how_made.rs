//! What a picture's file says of how it was made.

use serde_json::Value;

use super::typed::Typed;
use crate::engine::error_bound::FilmError;
use crate::engine::identity::settings_with_effect;
use crate::engine::room::RunResult as RoomResult;
use crate::engine::saved::SavedRun;
use crate::engine::scene::SceneFilm;
use crate::engine::watch::End;
use crate::output::colour::Format;
use crate::output::metadata::{Metadata, Repeat, devices, errors};
use crate::plan::work_division::Division;
use crate::render::image::name_in_text;
use crate::settings::Builder;
use crate::settings::scene::SceneSettings;

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
