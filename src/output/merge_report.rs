//! What a merge of a run's parts says of itself: text for people, JSON for programs.

use serde::Serialize;
use serde_json::{Map, Value};

use super::report::{Errors, errors, ledger};
use crate::engine::error::bound::FilmError;
use crate::engine::run::saved::SavedRun;
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
    #[serde(flatten)]
    errors: Errors<'a>,
}

pub(crate) fn json(run: &SavedRun, film: &SceneFilm, missing: &[String]) -> Vec<u8> {
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
        errors: Errors::of(&error, confidence, 0.0),
    };
    serde_json::to_vec_pretty(&report).expect("a report is plain data")
}

/// `film` where its errors are known without the scene.
pub(crate) fn text(run: &SavedRun, files: usize, film: Option<&SceneFilm>) -> String {
    let SavedRun { identity, wanted, .. } = run;
    let (blocks, files) = (counted(run.done.count(), "block"), counted(files as u64, "file"));
    let mut text = format!("{}: {blocks} from {files}, of {wanted} that the run was to have\n", identity.scene);
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
