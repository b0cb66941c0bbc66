//! Runs on several devices: whichever does which block, the result is that of one device to the bit. Here all of them are one device,
//! opened several times.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use crate::common::prelude::*;
use crate::common::rendered::Viewed;
use crate::fuzz::seeds::Saved;
use photonmill::engine::End;
use photonmill::engine::run::retry::{Remedy, run_on};
use photonmill::engine::run::saved::SavedRun;
use photonmill::engine::run::watch::{Checkpointing, SaveRun};
use photonmill::engine::scene::{self, RunResult};
use photonmill::settings::stop::Stop;

fn settings() -> SceneSettings {
    SceneSettings { photons: 1000, rounds: 24, shadow_rays: 2, block: Some(2), ..SceneSettings::default() }
}

/// Devices that no test uses at the moment, with the pipelines that they have made.
static IDLE: Mutex<Vec<Gpu>> = Mutex::new(Vec::new());

/// For a test that is stuck to fail in the end.
const MOST_WAIT: Duration = Duration::from_secs(120);

/// What goes wrong or slowly on the way.
#[derive(Default)]
struct Trouble {
    /// Devices wait for so long, in turn, whenever they have done something.
    waits: Vec<Duration>,
    /// The device of this number fails after so many rounds, which the others leave to it.
    fails: Option<(usize, u64)>,
    /// The device of this number has other settings.
    differs: Option<usize>,
    /// The user ends the run after so many rounds.
    cancelled_at: Option<u64>,
    resume: Option<SavedRun>,
}

/// What came of it.
struct Came {
    result: RunResult,
    given_up: u32,
    saved: Vec<SavedRun>,
}

fn room() -> Viewed {
    Viewed::new(scene("cornell"))
}

const PICTURE: Sensor = Sensor::Picture { width: 8, height: 8 };

fn alone(room: &Viewed, settings: &SceneSettings) -> RunResult {
    let gpu = device().unwrap();
    room.run(&gpu, room.tried(&gpu, settings, PICTURE))
}

fn shared(room: &Viewed, count: usize, settings: &SceneSettings, trouble: Trouble) -> Result<Came, Error> {
    let idle = || IDLE.lock().unwrap().pop();
    let mut gpus: Vec<Gpu> = (0..count).map(|_| idle().unwrap_or_else(|| open(Options::default()).unwrap())).collect();
    let plan = room.tried(&gpus[0], settings, PICTURE);
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
        let of = &mut control.checkpointing;
        let save = of.save.as_mut().map(|save| &mut **save as &mut dyn SaveRun);
        let checkpointing =
            Checkpointing { scene: of.scene, share: of.share, resume: of.resume.take(), every: of.every, save, dealt: of.dealt.take() };
        let (outer, cancelled) = (&mut control.progress, control.cancelled);
        let mut progress = |progress: &engine::Progress| {
            if let Some(wait) = trouble.waits.get(number) {
                std::thread::sleep(*wait);
            }
            let began = Instant::now();
            while trouble.fails.is_some() && fails.is_none() && attempts.load(Ordering::Relaxed) == 0 && began.elapsed() < MOST_WAIT {
                std::thread::sleep(Duration::from_millis(1));
            }
            if fails.is_some_and(|(_, rounds)| progress.done >= rounds) {
                failed.store(true, Ordering::Relaxed);
            }
            outer(progress);
        };
        // A pause whenever a block is done.
        let control = &mut Control { cancelled: if fails.is_some() { &failed } else { cancelled }, progress: &mut progress, checkpointing };
        let result = scene::light(gpu, &room.viewpoint(), plan, control);
        if failed.load(Ordering::Relaxed) {
            attempts.fetch_add(1, Ordering::Relaxed);
            return Err(Error::Device { call: "vkQueueSubmit2", reason: "the device is lost".into() });
        }
        result
    };
    let given_up = AtomicU32::new(0);
    let failed = &|_: &Gpu, _: &Error, remedy: Remedy| {
        assert_eq!(remedy, Remedy::GivenUp);
        given_up.fetch_add(1, Ordering::Relaxed);
    };
    let (cancelled, mut all) = (AtomicBool::new(false), Saved::default());
    let mut progress = |progress: &engine::Progress| {
        if trouble.cancelled_at.is_some_and(|rounds| progress.done >= rounds) {
            cancelled.store(true, Ordering::Relaxed);
        }
    };
    let resume = trouble.resume.clone().map(|run| (PathBuf::from("a file"), run));
    let checkpointing =
        Checkpointing { scene: &room.scene.name, resume, every: Duration::ZERO, save: Some(&mut all), ..Checkpointing::default() };
    let mut control = Control { cancelled: &cancelled, progress: &mut progress, checkpointing };
    let result = run_on(&mut gpus, &scene::task(&room.geometry, &plan), &run, failed, &mut control);
    gpus.iter().for_each(|gpu| gpu.check_validation().unwrap());
    IDLE.lock().unwrap().append(&mut gpus);
    Ok(Came { result: result?, given_up: given_up.into_inner(), saved: all.0 })
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
    let of_error = SceneSettings { stop: Stop { error: Some(1.0), ..Stop::default() }, rounds: 200, ..settings() };
    let of_photons = SceneSettings { stop: Stop { photons: Some(1000 * 13), ..Stop::default() }, rounds: 200, ..settings() };
    let room = room();
    // An error that is reached at a look, on two devices and with one that lags; photons that end within a block; all rounds; and fewer
    // than two blocks, which are one device's.
    let layouts = [
        (End::Error, of_error, vec![(2, vec![]), (3, millis(&[30, 0, 5]))]),
        (End::Photons, of_photons, vec![(2, millis(&[0, 10]))]),
        (End::Rounds, settings(), vec![(3, millis(&[0, 20, 0]))]),
        (End::Rounds, SceneSettings { rounds: 2, ..settings() }, vec![(2, vec![])]),
    ];
    for (end, settings, runs) in layouts {
        let expected = alone(&room, &settings);
        assert!(expected.end == end && (end != End::Error || expected.film.blocks < 100), "{:?} instead of {end:?}", expected.end);
        for (count, waits) in runs {
            let came = shared(&room, count, &settings, Trouble { waits, ..Trouble::default() }).unwrap();
            assert_same(&format!("{end:?}, {count} devices"), &came.result, &expected);
            let others = if expected.film.rounds > 2 { count - 1 } else { 0 };
            assert_eq!((came.given_up, came.result.more_devices.len()), (0, others), "{end:?}");
            if others > 0 {
                let last = came.saved.last().unwrap();
                assert_eq!(last.missing(), last.wanted - came.result.film.blocks, "{end:?}");
            }
        }
    }
}

/// Which one fails after how many rounds, and how many there are.
#[test]
fn a_device_that_fails_is_given_up() {
    let cases = of_run::<&[_]>(&[((0, 8), 2)], &[((0, 8), 2), ((2, 2), 3)]);
    let Some(_) = device() else { return };
    let room = room();
    let expected = alone(&room, &settings());
    for &(fails, count) in cases {
        let came = shared(&room, count, &settings(), Trouble { fails: Some(fails), ..Trouble::default() }).unwrap();
        assert_same("without one", &came.result, &expected);
        assert_eq!((came.given_up, came.result.more_devices.len()), (1, count - 2));
    }
    let Err(error) = shared(&room, 1, &settings(), Trouble { fails: Some((0, 2)), ..Trouble::default() }) else { panic!("none is left") };
    assert!(matches!(error, Error::Device { .. }), "{error}");
}

/// What was done when a run was ended goes on, on one device or several, to the same end.
#[test]
fn what_was_ended_early_goes_on() {
    let Some(_) = device() else { return };
    let room = room();
    let expected = alone(&room, &settings());
    let waits = vec![Duration::from_millis(20); 2];
    let early = shared(&room, 2, &settings(), Trouble { waits, cancelled_at: Some(10), ..Trouble::default() }).unwrap();
    assert_eq!(early.result.end, End::Cancelled);
    let saved = early.saved.last().unwrap();
    assert!(early.result.film.blocks == saved.done.count() && early.result.film.blocks < 12 && early.result.film.blocks > 0);
    // From its end, and from what was saved on the way, which on a busy machine may be the same.
    for (count, from) in [(3, saved), (2, &early.saved[early.saved.len() / 2])] {
        let on = shared(&room, count, &settings(), Trouble { resume: Some(from.clone()), ..Trouble::default() }).unwrap();
        assert_same("gone on", &on.result, &expected);
    }
}

/// When the time is up, no block before the last is missing.
#[test]
fn a_time_ends_it_behind_whole_blocks() {
    let Some(_) = device() else { return };
    let room = room();
    let timed = SceneSettings { rounds: 4000, stop: Stop { seconds: Some(0.3), ..Stop::default() }, ..settings() };
    let came = shared(&room, 2, &timed, Trouble::default()).unwrap();
    let blocks = came.result.film.blocks;
    assert!(came.result.end == End::Time && (1..2000).contains(&blocks), "{:?} after {blocks} blocks", came.result.end);
    assert_eq!((came.saved.last().unwrap().done.end(), came.result.left_out), (blocks, 0));
    let expected = alone(&room, &SceneSettings { rounds: 2 * blocks, ..settings() });
    assert!(came.result.film.sums == expected.film.sums && came.result.fates == expected.fates);
}

#[test]
fn devices_that_compute_otherwise_are_refused() {
    let Some(_) = device() else { return };
    let Err(error) = shared(&room(), 2, &settings(), Trouble { differs: Some(1), ..Trouble::default() }) else { panic!("taken together") };
    let line = error.to_string();
    assert!(line.starts_with("`devices` ") && line.contains("cannot take part") && line.contains("seed"), "{line}");
}

#[test]
fn the_program_shares_a_run() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let number = std::env::var("PHOTONMILL_DEVICE").unwrap_or_else(|_| "0".into());
    let (alone, shared) = (format!("--device {number}"), format!("--devices {number},{number}"));
    let same = |one: &str, two: &str| assert!(std::fs::read(place.at(one)).unwrap() == std::fs::read(place.at(two)).unwrap(), "{two}");
    let scene = "render cornell-spheres --photons 500 --rounds 8 --block 1 --size 8x8 -q";
    place.succeed(&format!("{scene} {alone} -o one.exr --error-image e1.exr --json one.json"));
    place.succeed(&format!("{scene} {shared} -o two.exr --error-image e2.exr --json two.json --checkpoint two.pms"));
    place.succeed(&format!("{scene} {alone} -o on.exr --resume two.pms"));
    same("one.exr", "two.exr");
    same("e1.exr", "e2.exr");
    same("one.exr", "on.exr");
    let [one, two] = ["one.json", "two.json"].map(|name| place.json(name));
    assert!(one["ledgers"] == two["ledgers"] && one["relative_error"] == two["relative_error"], "{two}");
    assert!(two["more_devices"].as_array().unwrap().len() == 1 && two["blocks"] == 8, "{two}");
    // The paper's box too.
    let of_box = "--photons 501 --rounds 40 --mesh 8 --error 40% -q";
    place.succeed(&format!("{of_box} {alone} -o one.exr --json one.json"));
    place.succeed(&format!("{of_box} {shared} -o two.exr --json two.json"));
    same("one.exr", "two.exr");
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
