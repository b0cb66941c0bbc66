//! What a merge of a run's parts says of itself: text for people, JSON for programs.

use std::fmt::Write;

use serde::Serialize;
use serde_json::{Map, Value};

use super::report::{Intervals, Tail, errors, ledger};
use crate::engine::error::bias::Bias;
use crate::engine::error::bound::{ErrorPlaces, FilmError};
use crate::engine::error::unknown::Unknown;
use crate::engine::saved::SavedRun;
use crate::engine::scene::SceneFilm;
use crate::ledger::{Fates, Ledger};
use crate::text::counted;

#[derive(Serialize)]
struct Report<'a> {
    photonmill: &'static str,
    scene: &'a str,
    /// Those that change the result.
    settings: &'a Map<String, Value>,
    rounds: u32,
    blocks: u32,
    /// Blocks that the run was to have.
    blocks_wanted: u32,
    /// Parts of the run that are not in the result, in words.
    missing: &'a [String],
    /// Of the photons of each map.
    ledgers: Vec<Ledger>,
    /// As for a run; null where not known.
    relative_error: f64,
    error_bound: Option<f64>,
    intervals: Intervals,
    total_bound: Option<f64>,
    unknown: &'a Unknown,
    tail: Tail,
    noise_sits: Option<ErrorPlaces>,
    bias: Option<Bias>,
}

pub fn json(run: &SavedRun, film: &SceneFilm, missing: &[String]) -> Vec<u8> {
    let confidence = film.plan.confidence;
    let error = film.error(confidence).stated();
    let report = Report {
        photonmill: env!("CARGO_PKG_VERSION"),
        scene: &run.identity.scene,
        settings: &run.identity.settings,
        rounds: error.rounds,
        blocks: error.blocks,
        blocks_wanted: run.wanted,
        missing,
        ledgers: run.fates.iter().map(Fates::ledger).collect(),
        relative_error: error.noise,
        error_bound: Some(error.bound(confidence)).filter(|bound| bound.is_finite()),
        intervals: Intervals::of(error.blocks, confidence),
        total_bound: Some(error.bound_of_all(confidence, 0.0)).filter(|bound| bound.is_finite()),
        unknown: &error.unknown,
        tail: Tail::of(&error, confidence),
        noise_sits: error.places,
        bias: error.bias,
    };
    serde_json::to_vec_pretty(&report).expect("a report is plain data")
}

/// `film` where its errors can be told without the scene.
pub fn text(run: &SavedRun, files: usize, film: Option<&SceneFilm>) -> String {
    let mut text = String::new();
    let blocks = run.done.count();
    writeln!(
        text,
        "{}: {} from {}, of {} that the run was to have",
        run.identity.scene,
        counted(blocks, "block"),
        counted(files as u64, "file"),
        run.wanted
    )
    .unwrap();
    for fates in run.fates.iter().filter(|fates| fates.emitted > 0) {
        text.push_str(&ledger(&fates.ledger()));
    }
    if let Some(film) = film {
        let FilmError { rounds, ref unknown, .. } = film.error(film.plan.confidence);
        let confidence = film.plan.confidence;
        text.push_str(&errors(&film.error(confidence).stated(), 0.0, (film.plan.measure, confidence), "pixel"));
        text.push_str(&unknown.text("pixel", "W/m2/sr", confidence, rounds));
    }
    text
}
