//! What a picture's file says of how it was made.

use serde_json::{Value, to_value};

use super::chosen::{Chosen, For};
use super::typed::Typed;
use crate::engine::error_bound::FilmError;
use crate::engine::saved::SavedRun;
use crate::engine::scene::{RunResult, SceneFilm};
use crate::engine::watch::End;
use crate::gpu::DeviceFacts;
use crate::output::colour::{Format, Tone};
use crate::output::metadata::{Metadata, Repeat};
use crate::plan::work_division::Division;
use crate::settings::scene::SceneSettings;
use crate::settings::tile_samples::TileSamples;

/// A picture that was put together from parts of a run.
pub(super) fn of_merge(typed: &Typed, run: &SavedRun, film: &SceneFilm, units: String, format: Format) -> Metadata {
    let confidence = film.plan.confidence;
    let [error, error_bound] = errors(&film.error(confidence), confidence);
    Metadata {
        photonmill: env!("CARGO_PKG_VERSION").to_owned(),
        devices: run.identity.device.iter().cloned().collect(),
        scene: run.identity.scene.clone(),
        scene_hash: None,
        seed: run.identity.settings.get("seed").and_then(Value::as_u64).unwrap_or_default(),
        rounds: film.rounds,
        error,
        error_bound,
        confidence,
        units,
        command: typed.line(&[("-o", name_in_text(format).to_owned())]),
        settings: run.identity.settings.clone().into(),
        repeat: Repeat::Not("was put together by merge; repeat the picture of one run that does all of it".to_owned()),
    }
}

/// Under whatever name a picture is written: equal results are equal files.
fn name_in_text(format: Format) -> &'static str {
    if format == Format::Png { "picture.png" } else { "picture.exr" }
}

/// A picture of a scene and its run.
pub(super) struct Made<'a> {
    pub(super) typed: &'a Typed,
    /// What the options say without a pilot.
    pub(super) asked: &'a SceneSettings,
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

/// What a file's values are.
pub(super) fn units(format: Format, stops: f32, tone: Tone) -> String {
    let tone = match tone {
        Tone::Neutral => "Khronos PBR Neutral",
        Tone::Linear => "linear",
    };
    match format {
        Format::Exr => "radiance, W/m2/sr, linear, Rec. 709 primaries".to_owned(),
        Format::Png => format!("sRGB; exposure {stops:+.2} stops, tone curve {tone}"),
    }
}

/// Of the devices of a run, each kind once.
pub(super) fn devices<'a>(facts: impl Iterator<Item = &'a DeviceFacts>) -> Vec<String> {
    let mut names: Vec<String> = facts.map(|facts| format!("{}, {}", facts.name, facts.driver)).collect();
    names.sort();
    names.dedup();
    names
}

fn known(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

/// Noise, and its bound.
fn errors(error: &FilmError, confidence: f64) -> [Option<f64>; 2] {
    [known(error.noise), known(error.noise).and_then(|_| known(error.bound(confidence)))]
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

    /// Options that say what a pilot chose, so that the command line needs none.
    fn options(&self) -> Vec<(&'static str, String)> {
        let (asked, used) = (Division::of(self.asked), Division::of(&self.lit.plan.settings));
        let Division { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours } = used;
        let of_points = [
            ("--samples", samples),
            ("--shadow-rays", shadow_rays),
            ("--neighbours", neighbours),
            ("--caustic-neighbours", caustic_neighbours),
        ];
        let of_photons = [("--photons", photons), ("--caustic-photons", caustic_photons)];
        // Photons of a file are as many as they are.
        let of_photons = of_photons.into_iter().filter(|_| !self.typed.has("--map"));
        let all = of_points.into_iter().chain(of_photons).filter(|(option, _)| asked != used && !self.typed.has(option));
        all.chain([("--rounds", self.lit.film.rounds)]).map(|(option, value)| (option, value.to_string())).collect()
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
        let device = lit.device.as_ref().map_or("cpu", |facts| facts.kind);
        let made_for = For { scene, scene_hash: scene_hash.clone(), size: lit.plan.sensor.size(), device };
        let chosen = Chosen::new(settings, lit.film.rounds, &made_for);
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
                chosen: to_value(&chosen).expect("settings are numbers and names"),
            },
        };
        Metadata {
            photonmill: env!("CARGO_PKG_VERSION").to_owned(),
            devices: self.devices(),
            scene: scene.to_owned(),
            scene_hash: Some(scene_hash.clone()),
            seed: settings.seed,
            rounds: lit.film.rounds,
            error,
            error_bound,
            confidence,
            units,
            command,
            settings: to_value(settings).expect("settings are numbers and names"),
            repeat,
        }
    }
}
