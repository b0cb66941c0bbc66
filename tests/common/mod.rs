//! What the integration tests share: a validated device, runs that nobody cancels, and checks that
//! say what is wrong instead of only that something is.
//!
//! `PHOTONMILL_DEVICE` names the device by index or part of its name. Without any Vulkan device a
//! test fails, unless `PHOTONMILL_NO_GPU=1` says that there is none on purpose.

pub mod aimed;
pub mod bits;
pub mod chi_square;
pub mod densities;
pub mod family;
pub mod known;
pub mod lit;
pub mod planted;
pub mod reference;

use std::ops::Deref;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use glam::UVec2;
use photonmill::gpu::{Commands, Gpu, Options};
use photonmill::photon::{Origin, Photon, StoredPhoton};
use photonmill::plan::{Limits, Plan};
use photonmill::render::{self, Control, Outcome};
use photonmill::resources::Resources;
use photonmill::rng::{self, Rng, Streams};
use photonmill::scene::open_box::open_box;
use photonmill::scene::room::RoomScene;
use photonmill::settings::{Settings, Variant};

/// Devices that no test has at the moment: what one test compiled serves the next.
static IDLE: Mutex<Vec<Gpu>> = Mutex::new(Vec::new());

/// A device under the validation layer, which must not have said a word by the end of the test, nor may anything be held.
pub struct Device {
    /// `None` at the very end.
    gpu: Option<Gpu>,
    serves_others: bool,
}

impl Deref for Device {
    type Target = Gpu;

    fn deref(&self) -> &Gpu {
        self.gpu.as_ref().expect("it is taken at the very end")
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // A test that fails already says why.
        if std::thread::panicking() {
            return;
        }
        self.check_validation().unwrap();
        assert_eq!((self.held_memory().device_bytes, self.held_memory().staging_bytes), (0, 0), "buffers are left");
        if let Some(gpu) = self.gpu.take().filter(|_| self.serves_others) {
            IDLE.lock().unwrap().push(gpu);
        }
    }
}

/// The device of the tests; `None` where `PHOTONMILL_NO_GPU=1` asks to go without.
pub fn device() -> Option<Device> {
    let idle = IDLE.lock().unwrap().pop();
    let gpu = idle.or_else(|| open(Options::default()))?;
    gpu.forget_peaks();
    Some(Device { gpu: Some(gpu), serves_others: true })
}

/// One of its own that nothing was compiled for, with some of its abilities masked off or not.
pub fn device_with(options: Options) -> Option<Device> {
    open(options).map(|gpu| Device { gpu: Some(gpu), serves_others: false })
}

/// The same without the promise that validation stays silent, for tests that make it speak.
pub fn open(options: Options) -> Option<Gpu> {
    if std::env::var("PHOTONMILL_NO_GPU").is_ok_and(|value| value == "1") {
        eprintln!("SKIPPED: PHOTONMILL_NO_GPU=1, so nothing that needs a GPU was tested here");
        return None;
    }
    let options = Options { device: std::env::var("PHOTONMILL_DEVICE").ok(), validate: true, ..options };
    match Gpu::open(&options) {
        Ok(gpu) => Some(gpu),
        Err(error) => panic!("{error}; set PHOTONMILL_NO_GPU=1 to test without a GPU"),
    }
}

/// Runs the open box on a device to its end.
pub fn run(gpu: &Gpu, settings: &Settings) -> Outcome {
    run_scene(gpu, &open_box(settings), settings)
}

/// Runs a scene on a device to its end.
pub fn run_scene(gpu: &Gpu, scene: &RoomScene, settings: &Settings) -> Outcome {
    let never = AtomicBool::new(false);
    let mut control = Control { cancelled: &never, progress: &mut |_| {} };
    let settings = &Settings { paranoid: true, ..settings.clone() };
    sound(render::on_gpu(gpu, scene, settings, &mut control).unwrap_or_else(|error| panic!("{error}\n{settings:?}")))
}

/// Whatever is run here has no value that is infinite or no number.
fn sound(outcome: Outcome) -> Outcome {
    let oddities = outcome.oddities.as_ref().expect("somebody looked");
    assert_eq!(oddities.count, 0, "{}", oddities.text());
    outcome
}

/// Runs the open box on the CPU builder to its end.
pub fn run_on_cpu(settings: &Settings) -> Outcome {
    run_scene_on_cpu(&open_box(settings), settings)
}

/// Runs a scene on the CPU builder to its end.
pub fn run_scene_on_cpu(scene: &RoomScene, settings: &Settings) -> Outcome {
    let never = AtomicBool::new(false);
    let mut control = Control { cancelled: &never, progress: &mut |_| {} };
    let settings = &Settings { paranoid: true, ..settings.clone() };
    sound(render::on_cpu(scene, settings, &mut control).unwrap_or_else(|error| panic!("{error}\n{settings:?}")))
}

/// Photons of round 0 of the open box, as a builder of the device stores them.
pub fn photons(gpu: &Gpu, settings: &Settings) -> Vec<Photon> {
    render::photons_on_gpu(gpu, &open_box(settings), settings).unwrap_or_else(|error| panic!("{error}\n{settings:?}"))
}

/// Builders that are held against closed forms: those that fly in ways of their own. The others store the same photons
/// to the bit (tests/photons.rs).
pub const JUDGED: [Variant; 4] = [Variant::Naive, Variant::Atomic, Variant::Persistent, Variant::Cpu];

/// Photons of a chunk of which an invocation of the persistent builder takes several.
pub const MANY_PHOTONS: u32 = 600_001;

/// The same from the CPU builder.
pub fn photons_on_cpu(settings: &Settings) -> Vec<Photon> {
    render::photons_on_cpu(&open_box(settings), settings).unwrap_or_else(|error| panic!("{error}\n{settings:?}"))
}

/// Puts photons into the photon map as if they had been traced.
pub fn upload_photons(commands: &mut Commands, resources: &Resources, plan: &Plan, photons: &[Photon]) {
    let stored: Vec<StoredPhoton> = photons.iter().map(Photon::stored).collect();
    commands.upload(&resources.photons, &stored).unwrap();
    if plan.keeps_origins {
        let origins: Vec<Origin> = photons.iter().map(Photon::origin).collect();
        commands.upload(&resources.origins, &origins).unwrap();
    }
    commands.upload(&resources.counters, &[photons.len() as u32]).unwrap();
}

/// What a device would do with these settings.
pub fn plan_for(gpu: &Gpu, scene: &RoomScene, settings: &Settings) -> Plan {
    Plan::new(scene, settings, &render::limits(gpu.facts())).unwrap()
}

/// What the CPU builder would do with these settings.
pub fn plan_for_host(settings: &Settings) -> Plan {
    Plan::new(&open_box(settings), settings, &Limits::of_host()).unwrap()
}

/// Every draw of a photon: four of its emission, three of each bounce.
pub fn draws_of(streams: Streams, round: u32, photon: u32, bounces: u32) -> Vec<f32> {
    let key = streams.key(round);
    let start = match streams.rng {
        // As if one light emitted every photon.
        Rng::Sobol => UVec2::new(key.photons_before.wrapping_add(photon), 0),
        _ => rng::words(streams.jump(round, photon + 1).apply(rng::srand48(streams.seed as u32))),
    };
    let mut stream = rng::open_stream(streams.rng, &key, photon, start);
    let mut draws = rng::draw_emission(streams.rng, &key, photon, &mut stream).to_vec();
    for bounce in 0..bounces {
        draws.extend(rng::draw_bounce(streams.rng, &key, photon, bounce, &mut stream));
    }
    draws
}

/// The streams that a run draws from.
pub fn streams_of(settings: &Settings) -> Streams {
    Streams { rng: settings.rng, seed: settings.seed, photons: settings.photons, draws_per_photon: settings.draws_per_photon() }
}

/// A relative error against what is allowed.
pub fn relative_check(what: &str, found: f64, expected: f64, allowed: f64) -> Check {
    let error = (found / expected - 1.0).abs();
    // Written so that NaN complains.
    if error <= allowed {
        Ok(())
    } else {
        Err(format!("{what}: {found} where {expected} is right, {error:e} off where {allowed:e} may be"))
    }
}

/// Counts of 100 classes that are equally likely, by chi-square on both sides: 99 degrees of freedom leave
/// (44.7, 183.7) once in a million either way. Too even is as wrong as too uneven.
pub fn evenness_check(what: &str, classes: impl Iterator<Item = usize>) -> Check {
    let mut counts = [0u64; 100];
    classes.for_each(|class| counts[class] += 1);
    let expected = counts.iter().sum::<u64>() as f64 / 100.0;
    let chi_square: f64 = counts.iter().map(|count| (*count as f64 - expected).powi(2) / expected).sum();
    if 44.7 < chi_square && chi_square < 183.7 {
        Ok(())
    } else {
        Err(format!("{what}: chi-square {chi_square:.1} of 99 degrees of freedom"))
    }
}

/// Sorted by photon and bounce, which no two entries of a photon map share.
pub fn in_order(mut photons: Vec<Photon>) -> Vec<Photon> {
    photons.sort_by_key(|photon| (photon.photon, photon.bounce));
    photons
}

/// `Err` holds the complaint.
pub type Check = Result<(), String>;

/// Fails unless `check` complains.
pub fn assert_complains(what: &str, check: Check) {
    if check.is_ok() {
        panic!("the check did not complain about {what}");
    }
}

/// Fails with the check's complaint and what it was about.
pub fn assert_holds(what: impl std::fmt::Display, check: Check) {
    if let Err(complaint) = check {
        panic!("{what}: {complaint}");
    }
}

/// Standard errors that a statistical test allows: a false alarm in 1.7 million checks, and with its
/// fixed seed a test that passes once passes always.
pub const Z_LIMIT: f64 = 5.0;

/// A mean against its expected value.
pub fn z_check(what: &str, measured: f64, expected: f64, standard_error: f64) -> Check {
    let z = (measured - expected) / standard_error;
    // Written so that NaN complains.
    if z.abs() <= Z_LIMIT {
        return Ok(());
    }
    Err(format!("{what}: {measured} where {expected} +- {standard_error:.3e} is right, z = {z:.2}"))
}

/// `count` of `trials` against its probability, by the binomial standard error.
pub fn share_check(what: &str, count: u64, trials: u64, probability: f64) -> Check {
    let share = count as f64 / trials as f64;
    z_check(what, share, probability, (probability * (1.0 - probability) / trials as f64).sqrt())
}

/// Two lists of integers, place by place.
pub fn equal_sums(what: &str, found: &[u64], expected: &[u64]) -> Check {
    if found.len() != expected.len() {
        return Err(format!("{what}: {} sums instead of {}", found.len(), expected.len()));
    }
    let differing: Vec<usize> = (0..found.len()).filter(|&place| found[place] != expected[place]).collect();
    match differing.first() {
        None => Ok(()),
        Some(&first) => Err(format!(
            "{what}: {} of {} sums differ, the first at {first}: {} instead of {}",
            differing.len(),
            found.len(),
            found[first],
            expected[first]
        )),
    }
}
