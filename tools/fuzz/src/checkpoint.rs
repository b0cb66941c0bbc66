//! Bytes of one saved run or of two -> read -> used as `merge` and `--resume` do: a run of use, or one line that says why not.

use std::sync::LazyLock;

use super::change::Random;
use super::mutation::{self, MutateBytes};
use super::sealed::{Run, mutate, two_files};
use super::{refused, seeds};
use photonmill::engine::run::saved::{SavedFilm, SavedRun};
use photonmill::engine::scene::SceneFilm;
use photonmill::output::colour::Tone;
use photonmill::output::merge_report;
use photonmill::output::metadata::{KEY, Metadata, Repeat, errors};
use photonmill::output::show::{Layer, Show};
use photonmill::plan::sensor::Sensor;
use serde_json::Value;

static SEEDS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(seeds::runs);

pub fn run(input: &[u8]) {
    let runs: Vec<SavedRun> = two_files::<Run>(input).into_iter().filter_map(read).collect();
    runs.iter().for_each(use_run);
    if let [run, other] = runs.as_slice()
        && run.identity.differs_from(&other.identity).is_none()
    {
        let mut both = run.clone();
        if both.merge(other).is_ok() {
            use_run(&both);
        }
    }
}

fn read(file: &[u8]) -> Option<SavedRun> {
    let refused = |line: String| assert!(!line.is_empty() && line.lines().count() == 1, "{line:?}");
    SavedRun::from_bytes(file).map_err(refused).ok()
}

/// Writes, reports and shows a run as `merge` does, and goes on with it where it is of the paper's box.
pub(crate) fn use_run(run: &SavedRun) {
    let bytes = run.to_bytes();
    assert_eq!(bytes, SavedRun::from_bytes(&bytes).expect("what was written can be read").to_bytes());
    let _ = (run.missing(), run.emitted());
    let SavedFilm::Scene(film) = &run.film else {
        assert!(!merge_report::text(run, 1, None).is_empty());
        return seeds::part_of_box(run.share, Some(run.clone())).map_or_else(|error| drop(refused(&error)), drop);
    };
    assert!(!merge_report::text(run, 1, Some(film)).is_empty());
    let report: Value = serde_json::from_slice(&merge_report::json(run, film, &[])).expect("a report is JSON");
    for pixel in 0..film.pixels() {
        let _ = (film.mean(pixel), film.standard_error(pixel));
    }
    if let Some(Sensor::Picture { width, height }) = run.sensor {
        let show = Show {
            size: (width, height),
            exposure: None,
            tone: Tone::default(),
            white_balance: None,
            layers: Layer::ALL.into(),
            denoised: None,
        };
        let metadata = metadata(run, film, report[KEY].as_str().expect("a report says which version wrote it"));
        for file in [show.exr(film, &[], Some(&metadata)), show.png(film, |_| metadata.clone()).0] {
            assert_eq!(Metadata::read(&file).as_ref(), Ok(&metadata), "a picture says how it was made");
        }
        show.errors(film);
    }
}

/// What `merge` writes into its pictures, as far as it comes from the run.
fn metadata(run: &SavedRun, film: &SceneFilm, version: &str) -> Metadata {
    let confidence = film.plan.confidence;
    let [error, error_bound] = errors(&film.error(confidence), confidence);
    Metadata {
        photonmill: version.to_owned(),
        devices: run.identity.device.iter().cloned().collect(),
        scene: run.identity.scene.clone(),
        scene_hash: None,
        seed: run.identity.settings.get("seed").and_then(Value::as_u64).unwrap_or_default(),
        rounds: film.rounds,
        error,
        error_bound,
        confidence,
        degrees_of_freedom: film.error_freedom(),
        denoiser: None,
        units: String::new(),
        command: String::new(),
        settings: run.identity.settings.clone(),
        repeat: Repeat::Not(String::new()),
    }
}

pub fn change(data: &mut [u8], size: usize, max_size: usize, seed: u32, mutate_bytes: MutateBytes) -> usize {
    let mut random = Random(u64::from(seed));
    let files = two_files::<Run>(&data[..size]);
    // Where there is no second file, now and then a seed becomes one.
    let which = usize::from(random.below(if files[1].is_empty() { 4 } else { 2 }) == 1);
    let new = mutate::<Run>(files[which], &SEEDS, &mut random, mutate_bytes).map(|new| {
        let mut files = files.map(<[u8]>::to_vec);
        files[which] = new;
        files.concat()
    });
    mutation::put(new, data, size, max_size, mutate_bytes)
}
