//! Runs on several devices: whichever does which block, the result is that of one device to the bit. Here all of them are one device,
//! opened several times.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use crate::common::prelude::*;
use photonmill::engine::End;
use photonmill::engine::retry::{Remedy, run_on};
use photonmill::engine::saved::{SavedFilm, SavedRun};
use photonmill::engine::scene::losses::losses;
use photonmill::engine::scene::{self, RunResult, SceneFilm, View, trial};
use photonmill::engine::several_devices::Work;
use photonmill::engine::watch::{Keep, SaveRun};
use photonmill::ledger::Fates;
use photonmill::settings::stop::Stop;

fn settings() -> SceneSettings {
    SceneSettings { photons: 1000, caustic_photons: 700, rounds: 60, shadow_rays: 2, block: Some(2), ..SceneSettings::default() }
}

struct Room {
    scene: Scene,
    geometry: Geometry,
    camera: Camera,
}

/// What goes wrong or slowly on the way.
#[derive(Default)]
struct Trouble {
    /// Devices wait for so long, in turn, whenever they have done something.
    waits: Vec<Duration>,
    /// The device of this number fails after so many rounds.
    fails: Option<(usize, u64)>,
    /// The device of this number has other settings.
    differs: Option<usize>,
    /// The user ends the run after so many rounds.
    cancelled_at: Option<u64>,
    resume: Option<SavedRun>,
}

/// What came of it.
struct Came {
    lit: RunResult,
    given_up: u32,
    saved: Vec<SavedRun>,
}

#[derive(Default)]
struct All(Vec<SavedRun>);

impl SaveRun for All {
    fn save(&mut self, run: &Arc<SavedRun>, _: bool) -> Result<(), Error> {
        self.0.push(SavedRun::clone(run));
        Ok(())
    }
}

impl Room {
    fn new(name: &str) -> Room {
        let scene = scene(name);
        Room { geometry: Geometry::new(&scene).unwrap(), camera: scene.first_camera(), scene }
    }

    fn plan(&self, gpu: &Gpu, settings: &SceneSettings) -> ScenePlan {
        trial::plan(gpu, &self.scene, &self.view(), settings, square_picture(8)).unwrap()
    }

    fn view(&self) -> View<'_> {
        View { geometry: &self.geometry, camera: Some(&self.camera), phases: &[] }
    }

    fn alone(&self, settings: &SceneSettings) -> RunResult {
        let gpu = device().unwrap();
        scene::light(&gpu, &self.view(), self.plan(&gpu, settings), &mut Control::default()).unwrap()
    }

    fn shared(&self, count: usize, settings: &SceneSettings, trouble: Trouble) -> Result<Came, Error> {
        let mut gpus: Vec<Gpu> = (0..count).map(|_| open(Options::default()).unwrap()).collect();
        let plan = self.plan(&gpus[0], settings);
        let (joined, attempts) = (AtomicU32::new(0), AtomicU32::new(0));
        let run = |gpu: &Gpu, stop: Stop, control: &mut Control| {
            let number = joined.fetch_add(1, Ordering::Relaxed) as usize;
            let mut plan = plan.clone();
            plan.settings.stop = stop;
            if trouble.differs == Some(number) {
                plan.settings.seed += 1;
            }
            let fails = trouble.fails.filter(|(device, _)| *device == number && attempts.load(Ordering::Relaxed) == 0);
            let failed = AtomicBool::new(false);
            let of = &mut control.keep;
            let save = of.save.as_mut().map(|save| &mut **save as &mut dyn SaveRun);
            let keep = Keep { scene: of.scene, share: of.share, resume: of.resume.take(), every: of.every, save, dealt: of.dealt.take() };
            let (outer, cancelled) = (&mut control.progress, control.cancelled);
            let mut progress = |progress: &engine::Progress| {
                if let Some(wait) = trouble.waits.get(number) {
                    std::thread::sleep(*wait);
                }
                if fails.is_some_and(|(_, rounds)| progress.done >= rounds) {
                    failed.store(true, Ordering::Relaxed);
                }
                outer(progress);
            };
            // A pause whenever a block is done.
            let control = &mut Control { cancelled: if fails.is_some() { &failed } else { cancelled }, progress: &mut progress, keep };
            let lit = scene::light(gpu, &self.view(), plan, control);
            if failed.load(Ordering::Relaxed) {
                attempts.fetch_add(1, Ordering::Relaxed);
                return Err(Error::Device { call: "vkQueueSubmit2", reason: "the device is lost".into() });
            }
            lit
        };
        let given_up = AtomicU32::new(0);
        let work = Work {
            run: &run,
            film: |film| match film {
                SavedFilm::Scene(film) => film,
                SavedFilm::Room(_) => panic!("a scene was lit"),
            },
            error: &|film: &SceneFilm| film.error(plan.film.confidence),
            losses: &|film: &SceneFilm, fates: &[Fates]| losses(&self.geometry, &plan, fates, film),
            can_go_on: true,
            stop: plan.settings.stop,
            alpha: plan.settings.alpha,
            rounds: plan.settings.rounds,
            rounds_per_block: plan.film.rounds_per_block,
            bounces: plan.settings.bounces,
            photons_per_round: plan.maps().map(|map| u64::from(map.photons)).sum(),
        };
        let failed = &|_: &Gpu, _: &Error, remedy: Remedy| {
            assert_eq!(remedy, Remedy::GivenUp);
            given_up.fetch_add(1, Ordering::Relaxed);
        };
        let (cancelled, mut all) = (AtomicBool::new(false), All::default());
        let mut progress = |progress: &engine::Progress| {
            if trouble.cancelled_at.is_some_and(|rounds| progress.done >= rounds) {
                cancelled.store(true, Ordering::Relaxed);
            }
        };
        let resume = trouble.resume.clone().map(|run| (PathBuf::from("a file"), run));
        let keep = Keep { scene: &self.scene.name, resume, every: Duration::ZERO, save: Some(&mut all), ..Keep::default() };
        let mut control = Control { cancelled: &cancelled, progress: &mut progress, keep };
        let lit = run_on(&mut gpus, &work, failed, &mut control)?;
        Ok(Came { lit, given_up: given_up.into_inner(), saved: all.0 })
    }
}

fn assert_same(what: &str, found: &RunResult, expected: &RunResult) {
    assert!(found.film == expected.film, "{what}: another film, of {} rounds, not {}", found.film.rounds, expected.film.rounds);
    assert!(found.fates == expected.fates, "{what}: {}, not {}", found.ledger(), expected.ledger());
    assert_eq!((found.end, found.losses), (expected.end, expected.losses), "{what}");
}

#[test]
fn several_devices_come_to_the_bits_of_one() {
    let Some(_) = device() else { return };
    let millis = |all: &[u64]| all.iter().map(|wait| Duration::from_millis(*wait)).collect::<Vec<_>>();
    let of_error = |error| SceneSettings { stop: Stop { error: Some(error), ..Stop::default() }, rounds: 200, ..settings() };
    let of_photons = SceneSettings { stop: Stop { photons: Some(1700 * 37), ..Stop::default() }, rounds: 200, ..settings() };
    let room = Room::new("cornell-spheres");
    // An error that is reached at a look, photons that end within a block, and all rounds, of which some are no whole block.
    let layouts = [
        ("error", of_error(0.6), 2, vec![]),
        ("error, with one that lags", of_error(0.6), 3, millis(&[30, 0, 5])),
        ("photons", of_photons, 2, millis(&[0, 10])),
        ("rounds", settings(), 3, millis(&[0, 20, 0])),
    ];
    for (what, settings, count, waits) in layouts {
        let expected = room.alone(&settings);
        let came = room.shared(count, &settings, Trouble { waits, ..Trouble::default() }).unwrap();
        assert_same(what, &came.lit, &expected);
        assert_eq!((came.given_up, came.lit.more_devices.len()), (0, count - 1), "{what}");
        let last = came.saved.last().unwrap();
        assert_eq!(last.missing(), last.wanted - came.lit.film.blocks, "{what}");
    }
    let error = room.alone(&of_error(0.6));
    assert!(error.end == End::Error && error.film.blocks < 100, "the error is reached on the way: {:?}", error.end);
}

/// A run of less than two blocks is one device's.
#[test]
fn a_run_of_one_block_is_not_shared() {
    let Some(_) = device() else { return };
    let room = Room::new("cornell");
    for rounds in [1, 2] {
        let settings = SceneSettings { rounds, ..settings() };
        assert_same("one block", &room.shared(2, &settings, Trouble::default()).unwrap().lit, &room.alone(&settings));
    }
}

#[test]
fn a_device_that_fails_is_given_up() {
    let Some(_) = device() else { return };
    let room = Room::new("cornell-spheres");
    let expected = room.alone(&settings());
    for (fails, count) in [((1, 2), 2), ((0, 8), 2), ((2, 2), 3)] {
        // The others leave it enough to do.
        let waits = (0..count).map(|device| Duration::from_millis(if device == fails.0 { 0 } else { 40 })).collect();
        let came = room.shared(count, &settings(), Trouble { fails: Some(fails), waits, ..Trouble::default() }).unwrap();
        assert_same("without one", &came.lit, &expected);
        assert_eq!((came.given_up, came.lit.more_devices.len()), (1, count - 2));
    }
    let Err(error) = room.shared(1, &settings(), Trouble { fails: Some((0, 2)), ..Trouble::default() }) else { panic!("none is left") };
    assert!(matches!(error, Error::Device { .. }), "{error}");
}

/// What was done when a run was ended goes on, on one device or several, to the same end.
#[test]
fn what_was_ended_early_goes_on() {
    let Some(_) = device() else { return };
    let room = Room::new("cornell-spheres");
    let expected = room.alone(&settings());
    let early = room.shared(2, &settings(), Trouble { cancelled_at: Some(20), ..Trouble::default() }).unwrap();
    assert_eq!(early.lit.end, End::Cancelled);
    let saved = early.saved.last().unwrap().clone();
    assert!(early.lit.film.blocks == saved.done.count() && early.lit.film.blocks < 30 && early.lit.film.blocks > 0);
    let on = room.shared(3, &settings(), Trouble { resume: Some(saved), ..Trouble::default() }).unwrap();
    assert_same("gone on", &on.lit, &expected);
    // From anything that was saved on the way.
    let all = room.shared(2, &settings(), Trouble::default()).unwrap().saved;
    assert!(all.len() > 3, "{} saved", all.len());
    let on = room.shared(2, &settings(), Trouble { resume: Some(all[all.len() / 2].clone()), ..Trouble::default() }).unwrap();
    assert_same("gone on", &on.lit, &expected);
}

/// When the time is up, no block before the last is missing.
#[test]
fn a_time_ends_it_behind_whole_blocks() {
    let Some(_) = device() else { return };
    let room = Room::new("cornell-spheres");
    let timed = SceneSettings { rounds: 4000, stop: Stop { seconds: Some(0.6), ..Stop::default() }, ..settings() };
    let came = room.shared(2, &timed, Trouble::default()).unwrap();
    let blocks = came.lit.film.blocks;
    assert!(came.lit.end == End::Time && (1..2000).contains(&blocks), "{:?} after {blocks} blocks", came.lit.end);
    assert_eq!((came.saved.last().unwrap().done.end(), came.lit.left_out), (blocks, 0));
    let expected = room.alone(&SceneSettings { rounds: 2 * blocks, ..settings() });
    assert!(came.lit.film.sums == expected.film.sums && came.lit.fates == expected.fates);
}

#[test]
fn devices_that_compute_otherwise_are_refused() {
    let Some(_) = device() else { return };
    let room = Room::new("cornell");
    let Err(error) = room.shared(2, &settings(), Trouble { differs: Some(1), ..Trouble::default() }) else { panic!("taken together") };
    let line = error.to_string();
    assert!(line.starts_with("--devices ") && line.contains("cannot take part") && line.contains("seed"), "{line}");
}

#[test]
fn the_program_shares_a_run() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let number = std::env::var("PHOTONMILL_DEVICE").unwrap_or_else(|_| "0".into());
    let options = "--photons 500 --rounds 24 --block 1 --size 8x8 -q";
    place.succeed(&format!("render cornell-spheres -o one.exr --error-image e1.exr --json one.json {options} --device {number}"));
    place.succeed(&format!(
        "render cornell-spheres -o two.exr --error-image e2.exr --json two.json --checkpoint two.pms {options} --devices {number},{number}"
    ));
    for (one, two) in [("one.exr", "two.exr"), ("e1.exr", "e2.exr")] {
        assert!(std::fs::read(place.at(one)).unwrap() == std::fs::read(place.at(two)).unwrap(), "{two}");
    }
    let [one, two] = ["one.json", "two.json"].map(|name| place.json(name));
    assert_eq!((one["ledgers"].clone(), one["relative_error"].clone()), (two["ledgers"].clone(), two["relative_error"].clone()));
    assert_eq!((two["more_devices"].as_array().unwrap().len(), two["blocks"].clone()), (1, 24.into()));
    place.succeed(&format!("render cornell-spheres -o on.exr --resume two.pms {options} --devices {number},{number}"));
    assert!(std::fs::read(place.at("one.exr")).unwrap() == std::fs::read(place.at("on.exr")).unwrap());
    // The paper's box too.
    let options = "--photons 501 --rounds 40 --mesh 8 --error 40% -q";
    place.succeed(&format!("-o one.exr --json one.json {options} --device {number}"));
    place.succeed(&format!("-o two.exr --json two.json {options} --devices {number},{number}"));
    assert!(std::fs::read(place.at("one.exr")).unwrap() == std::fs::read(place.at("two.exr")).unwrap());
    let [one, two] = ["one.json", "two.json"].map(|name| place.json(name));
    assert!(one["rounds"].as_u64().unwrap() < 40 && one["end"] == "error", "{}", one["rounds"]);
    for field in ["ledger", "relative_error", "rounds", "end", "losses"] {
        assert!(!one[field].is_null() && one[field] == two[field], "{field}: {}, {}", one[field], two[field]);
    }
    place.assert_refused([
        ("--devices 0 --variant cpu", ["--devices", "on", "no effect with --variant cpu"]),
        ("--devices 0,0 --rounds 9 --sums f32 -q", ["--devices", "--sums", "integers"]),
        ("render cornell -o a.png -q --devices some", ["--devices", "some", "must be `all`, or numbers"]),
        ("render cornell -o a.png -q --devices 0,,1", ["--devices", "0,,1", "must be `all`, or numbers"]),
        ("render cornell -o a.png -q --devices 99", ["--device", "99", "available"]),
        ("render cornell -o a.png -q --devices 0 --device 0", ["--devices", "--device", "cannot be used with"]),
    ]);
}
