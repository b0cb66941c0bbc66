//! What the integration tests share: a validated device, runs that nobody cancels, and checks that
//! say what is wrong instead of only that something is.
//!
//! `PHOTONMILL_DEVICE` names the device by index or part of its name. Without any Vulkan device a
//! test fails, unless `PHOTONMILL_NO_GPU=1` says that there is none on purpose.

pub mod aimed;
pub mod bits;
pub mod cases;
pub mod chi_square;
pub mod densities;
pub mod family;
pub mod gltf_file;
pub mod known;
pub mod lamps;
pub mod layered;
pub mod pairwise;
pub mod planted;
pub mod plates;
pub mod prelude;
pub mod program;
pub mod rectangles;
pub mod reference;
pub mod rendered;
pub mod rich_file;
pub mod sheets;
pub mod sources;
pub mod work;

use std::cmp::Ordering;
use std::fmt::Display;
use std::ops::Deref;
use std::sync::Mutex;

use photonmill::engine::nonfinite_values::NonfiniteValues;
use photonmill::engine::room::resources::RoomResources;
use photonmill::engine::room::{self, RunResult, estimate, index};
use photonmill::gpu::Work;
use photonmill::records::RandomKey;
use photonmill::rng::{self, Streams};
use photonmill::scene::room::Wall;

use chi_square::counts_check;
use prelude::*;

/// A device under the validation layer, which must not have said a word by the end of the test, nor may anything be held.
pub struct Device {
    gpu: Option<Gpu>,
    /// What it had done before this test.
    before: Work,
    /// Whether other tests may use it after this one.
    is_shared: bool,
}

/// Devices that no test uses at the moment, with the pipelines that tests have made: a software device compiles for longer than
/// it runs.
static IDLE: Mutex<Vec<Gpu>> = Mutex::new(Vec::new());
/// A device that has made more is not used again: lavapipe holds some nine megabytes of each.
const MOST_PIPELINES: usize = 90;

impl Deref for Device {
    type Target = Gpu;

    fn deref(&self) -> &Gpu {
        self.gpu.as_ref().expect("it goes with the test")
    }
}

impl Device {
    /// From now on runs this SPIR-V in place of the kernels' own, until the test ends.
    pub fn replace(&mut self, replaced: Vec<(String, Vec<u32>)>) {
        self.gpu.as_mut().expect("it goes with the test").replace(replaced);
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        work::of_device(self.before, self.work());
        // A test that fails already says why.
        if std::thread::panicking() {
            return;
        }
        self.check_validation().unwrap();
        assert_eq!((self.held_memory().device_bytes, self.held_memory().staging_bytes), (0, 0), "buffers are left");
        if self.is_shared
            && self.work().pipelines <= MOST_PIPELINES
            && let Some(mut gpu) = self.gpu.take()
        {
            gpu.replace(Vec::new());
            IDLE.lock().unwrap().push(gpu);
        }
    }
}

/// The device of the tests; `None` where `PHOTONMILL_NO_GPU=1` asks to go without. No other test uses it at the same time. It splits
/// work by the plan alone, and so in the same way however busy the machine is.
pub fn device() -> Option<Device> {
    let used = IDLE.lock().unwrap().pop();
    let gpu = used.or_else(|| open(Options { by_plan: true, ..Options::default() }))?;
    Some(Device { before: gpu.work(), gpu: Some(gpu), is_shared: true })
}

/// A device that has made no pipeline yet.
pub fn fresh_device() -> Option<Device> {
    device_with(Options::default())
}

/// The same with some of its abilities masked off.
pub fn device_with(options: Options) -> Option<Device> {
    open(options).map(|gpu| Device { before: Work::default(), gpu: Some(gpu), is_shared: false })
}

/// Whether `PHOTONMILL_NO_GPU=1` asks to go without a device.
pub fn no_gpu() -> bool {
    std::env::var("PHOTONMILL_NO_GPU").is_ok_and(|value| value == "1")
}

/// Whether tests take all of their cases, as `tools/test --long` has it.
pub fn is_long_run() -> bool {
    let is_long = std::env::var_os("PHOTONMILL_LONG").is_some();
    if !is_long {
        work::of_shortened();
    }
    is_long
}

/// What a test takes in the short run, or in the long one.
pub fn of_run<T>(short: T, long: T) -> T {
    if is_long_run() { long } else { short }
}

/// The same without the promise that validation stays silent, for tests that make it speak.
pub fn open(options: Options) -> Option<Gpu> {
    if no_gpu() {
        eprintln!("SKIPPED: PHOTONMILL_NO_GPU=1, so nothing that needs a GPU was tested here");
        work::of_skipped();
        return None;
    }
    let options = Options { device: std::env::var("PHOTONMILL_DEVICE").ok(), validate: true, ..options };
    match Gpu::open(&options) {
        Ok(gpu) => Some(gpu),
        Err(error) => panic!("{error}; set PHOTONMILL_NO_GPU=1 to test without a GPU"),
    }
}

/// Runs the open box on a device to its end.
pub fn run(gpu: &Gpu, settings: &RoomSettings) -> RunResult {
    run_scene(gpu, &open_box(settings), settings)
}

/// Runs a scene on a device to its end.
pub fn run_scene(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> RunResult {
    sound(settings, |settings, control| room::on_gpu(gpu, scene, settings, control))
}

/// What a run comes to, where it may fail: with `paranoid` no value may be infinite or no number.
pub fn room_result_of(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> Result<RunResult, Complaint> {
    let result = room::on_gpu(gpu, scene, settings, &mut Control::default())?;
    result.nonfinite_values.as_ref().map_or(Ok(()), nothing_odd)?;
    Ok(result)
}

pub fn nothing_odd(nonfinite_values: &NonfiniteValues) -> Check<Complaint> {
    Kind::NoNumber.unless(nonfinite_values.count == 0, || nonfinite_values.text())
}

/// Whatever is run here comes to an end, and has no value that is infinite or no number.
fn sound(settings: &RoomSettings, run: impl FnOnce(&RoomSettings, &mut Control) -> Result<RunResult, Error>) -> RunResult {
    let settings = RoomSettings { paranoid: true, ..settings.clone() };
    let result = run(&settings, &mut Control::default()).unwrap_or_else(|error| panic!("{error}\n{settings:?}"));
    assert_holds("the run", nothing_odd(result.nonfinite_values.as_ref().expect("somebody looked")));
    result
}

/// Runs the open box on the CPU builder to its end.
pub fn run_on_cpu(settings: &RoomSettings) -> RunResult {
    run_scene_on_cpu(&open_box(settings), settings)
}

/// The paper's box with its opening closed by a sixth wall.
pub fn closed_box(settings: &RoomSettings, albedo: f32) -> RoomScene {
    let mut scene = open_box(settings);
    scene.faces[5] = Some(Wall { name: "front", albedo, shininess: None });
    scene
}

/// Runs a scene on the CPU builder to its end.
pub fn run_scene_on_cpu(scene: &RoomScene, settings: &RoomSettings) -> RunResult {
    sound(settings, |settings, control| room::on_cpu(scene, settings, control))
}

/// Photons of round 0 of the open box, as a builder of the device stores them.
pub fn photons(gpu: &Gpu, settings: &RoomSettings) -> Vec<Photon> {
    room::photons_on_gpu(gpu, &open_box(settings), settings).unwrap_or_else(|error| panic!("{error}\n{settings:?}"))
}

/// One photon on the back wall, where x and y lie along the wall, of all the flux and weight that one may have.
pub fn on_back_wall(x: f32, y: f32, photon: u32) -> Photon {
    Photon { position: Vec3::new(x, y, -0.25), wall: 4, flux: 1.0, weight: 1.0, photon, bounce: 0 }
}

/// Builders whose photons are checked against closed forms: one of the device, as all of those store the same photons to the
/// bit (tests/engine/photons.rs), and the CPU's.
pub const JUDGED: [Builder; 2] = [Builder::Atomic, Builder::Cpu];

/// Photons of a chunk of which an invocation of the persistent builder takes several.
pub const MANY_PHOTONS: u32 = 600_001;

/// The same from the CPU builder.
pub fn photons_on_cpu(settings: &RoomSettings) -> Vec<Photon> {
    room::photons_on_cpu(&open_box(settings), settings).unwrap_or_else(|error| panic!("{error}\n{settings:?}"))
}

/// What the device gathers of photons that are handed to it, so many times over, onto film sums or an empty film.
pub fn gathered(gpu: &Gpu, plan: &RoomPlan, photons: &[Photon], times: u32, film: Option<&[u64]>) -> Vec<u64> {
    assert!(photons.len() <= plan.photon_capacity as usize);
    let scene = open_box(&plan.settings);
    let mut commands = Commands::new(gpu, room::constants(plan), Instant::now()).unwrap();
    let resources = RoomResources::new(&mut commands, &scene, plan).unwrap();
    // As if they had been traced.
    let stored: Vec<StoredPhoton> = photons.iter().map(Photon::stored).collect();
    commands.upload(&resources.photons, &stored).unwrap();
    if plan.keeps_origins {
        let origins: Vec<Origin> = photons.iter().map(Photon::origin).collect();
        commands.upload(&resources.origins, &origins).unwrap();
    }
    commands.upload(&resources.counters, &[photons.len() as u32]).unwrap();
    film.into_iter().for_each(|sums| commands.upload(&resources.film, sums).unwrap());
    let chunk = room::Chunk { resources: &resources, plan, photon_count: plan.settings.photons };
    index::build(&mut commands, chunk).unwrap();
    (0..times).for_each(|_| estimate::gather(&mut commands, chunk).unwrap());
    commands.read(&resources.film, plan.points.len() * plan.channel_count as usize).unwrap()
}

/// What a device would do with these settings.
pub fn plan_for(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> RoomPlan {
    RoomPlan::new(scene, settings, &engine::limits(gpu.facts())).unwrap()
}

/// What the CPU builder would do with these settings.
pub fn plan_for_host(settings: &RoomSettings) -> RoomPlan {
    RoomPlan::new(&open_box(settings), settings, &Limits::of_host()).unwrap()
}

/// Every draw of a photon: four of its emission, three of each bounce.
pub fn draws_of(streams: Streams, round: u32, photon: u32, bounces: u32) -> Vec<f32> {
    let key = streams.key(round);
    let start = match streams.rng {
        // As if one light emitted every photon.
        Rng::Sobol => UVec2::new(key.photons_before.wrapping_add(photon), 0),
        _ => rng::words(streams.jump(round, photon + 1).apply(rng::srand48(streams.seed as u32))),
    };
    draws_from(streams.rng, &key, photon, start, bounces)
}

/// The same of a stream that starts here.
pub fn draws_from(rng: Rng, key: &RandomKey, photon: u32, start: UVec2, bounces: u32) -> Vec<f32> {
    let mut stream = rng::open_stream(rng, key, photon, start);
    let mut draws = rng::draw_emission(rng, key, photon, &mut stream).to_vec();
    (0..bounces).for_each(|bounce| draws.extend(rng::draw_bounce(rng, key, photon, bounce, &mut stream)));
    draws
}

/// The streams that a run draws from.
pub fn streams_of(settings: &RoomSettings) -> Streams {
    Streams { rng: settings.rng, seed: settings.seed, photons: settings.photons, draws_per_photon: settings.draws_per_photon() }
}

/// Complains unless this holds, as no comparison with NaN does.
pub fn require<T: Into<String>>(holds: bool, complaint: impl FnOnce() -> T) -> Check {
    if holds { Ok(()) } else { Err(complaint().into()) }
}

/// A relative error against what is allowed.
pub fn relative_check(what: &str, found: f64, expected: f64, allowed: f64) -> Check {
    let error = (found / expected - 1.0).abs();
    require(error <= allowed, || format!("{what}: {found} where {expected} is right, {error:e} off where {allowed:e} may be"))
}

/// Counts of 100 classes that are equally likely, by chi-square on both sides: too even is as wrong as too uneven.
pub fn evenness_check(what: &str, classes: impl Iterator<Item = usize>) -> Check {
    let mut counts = [0u64; 100];
    classes.for_each(|class| counts[class] += 1);
    counts_check(what, &counts, &[0.01; 100])
}

/// Sorted by photon and bounce, which no two entries of a photon map share.
pub fn in_order(mut photons: Vec<Photon>) -> Vec<Photon> {
    photons.sort_by_key(|photon| (photon.photon, photon.bounce));
    photons
}

/// `Err` holds the complaint: a sentence, or a [`Complaint`] where `tests/engine/planted_faults.rs` asks for its kind.
pub type Check<C = String> = Result<(), C>;

/// What a check has found wrong. A planted fault must be noticed as what it is: what merely breaks a run would leave
/// every check that needs the run without an answer, and is no sign that the check can fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nothing could be checked: the run ended with an error, or left nothing at all. No fault is noticed by this.
    Broken,
    /// Photons had no fate, or two.
    LedgerOpen,
    /// Other photons are stored than are right: fewer, more, or as many.
    OtherPhotons,
    PhotonsLost,
    PhotonsAdded,
    /// Sums are others than are right: all of those too small, all too large, or some of each.
    OtherSums,
    SumsTooSmall,
    SumsTooLarge,
    /// A fingerprint of sums is not the one written down.
    OtherBits,
    /// An estimate lies below what is right by more than its error, or above.
    TooDark,
    TooBright,
    /// An estimate varies by more than it may.
    TooNoisy,
    /// Light is where none can be.
    Leak,
    /// A picture of a texture shows another texel.
    WrongTexel,
    /// A value is infinite or no number.
    NoNumber,
    /// Arithmetic is not rounded as IEEE 754 says.
    Misrounded,
    /// Builders under the clock stored different photons.
    BuildersDisagree,
}

impl Kind {
    /// Whether this is what was to be noticed, or a special case of it. What was not written holds whatever was there
    /// before, so that of some faults no device says in which way photons or sums are others.
    fn is(self, wanted: Kind) -> bool {
        let general = match self {
            Kind::PhotonsLost | Kind::PhotonsAdded => Kind::OtherPhotons,
            Kind::SumsTooSmall | Kind::SumsTooLarge => Kind::OtherSums,
            kind => kind,
        };
        self != Kind::Broken && (wanted == self || wanted == general)
    }

    /// Complains of this unless it holds, as no comparison with NaN does.
    pub fn unless(self, holds: bool, complaint: impl FnOnce() -> String) -> Check<Complaint> {
        require(holds, complaint).map_err(|text| Complaint::new(self, text))
    }
}

/// What a check found wrong, and the sentence about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Complaint {
    pub kind: Kind,
    pub text: String,
}

impl Complaint {
    pub fn new(kind: Kind, text: impl Into<String>) -> Complaint {
        Complaint { kind, text: text.into() }
    }
}

impl Display for Complaint {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{:?}: {}", self.kind, self.text)
    }
}

/// The kind of an error of the program: most mean that nothing was checked.
impl From<Error> for Complaint {
    fn from(error: Error) -> Complaint {
        let kind = match error {
            Error::LedgerOpen { .. } => Kind::LedgerOpen,
            _ => Kind::Broken,
        };
        Complaint::new(kind, error.to_string())
    }
}

/// Fails unless `check` complains.
#[track_caller]
pub fn assert_complains(what: &str, check: Result<(), impl Display>) {
    if check.is_ok() {
        panic!("the check did not complain about {what}");
    }
}

/// Whether `check` complains of just this.
pub fn noticed_as(kind: Kind, what: &str, check: Check<Complaint>) -> Check {
    match check {
        Err(complaint) if complaint.kind.is(kind) => Ok(()),
        Err(complaint) => Err(format!("{what} is to be noticed as {kind:?}, and the check complained of something else: {complaint}")),
        Ok(()) => Err(format!("the check did not complain about {what}")),
    }
}

/// Fails unless it does.
#[track_caller]
pub fn assert_complains_of(kind: Kind, what: &str, check: Check<Complaint>) {
    if let Err(complaint) = noticed_as(kind, what, check) {
        panic!("{complaint}");
    }
}

/// Fails with the check's complaint and what it was about.
#[track_caller]
pub fn assert_holds(what: impl Display, check: Result<(), impl Display>) {
    if let Err(complaint) = check {
        panic!("{what}: {complaint}");
    }
}

/// Pairs of two lists that must be equally long: `zip` alone would leave out what one of them has lost.
#[track_caller]
pub fn pairs<A, B>(a: impl IntoIterator<Item = A>, b: impl IntoIterator<Item = B>) -> impl Iterator<Item = (A, B)> {
    let (a, b): (Vec<A>, Vec<B>) = (a.into_iter().collect(), b.into_iter().collect());
    assert_eq!(a.len(), b.len(), "one list is longer than the other");
    a.into_iter().zip(b)
}

/// Standard errors that a statistical test allows: a false alarm in 1.7 million checks, and with its
/// fixed seed a test that passes once passes always.
pub const Z_LIMIT: f64 = 5.0;

/// A mean against its expected value.
pub fn z_check(what: &str, measured: f64, expected: f64, standard_error: f64) -> Check {
    estimate_check(what, measured, expected, standard_error).map_err(|complaint| complaint.text)
}

/// The same, and in which way it is off.
pub fn estimate_check(what: &str, measured: f64, expected: f64, standard_error: f64) -> Check<Complaint> {
    let z = (measured - expected) / standard_error;
    let kind = match z {
        z if z.abs() > Z_LIMIT && measured == 0.0 => Kind::Broken,
        z if z < -Z_LIMIT => Kind::TooDark,
        z if z > Z_LIMIT => Kind::TooBright,
        z if z.is_nan() => Kind::NoNumber,
        _ => return Ok(()),
    };
    Err(Complaint::new(kind, format!("{what}: {measured} where {expected} +- {standard_error:.3e} is right, z = {z:.2}")))
}

/// The same of each channel.
pub fn colour_check(what: &str, measured: DVec3, expected: DVec3, standard_error: DVec3) -> Check<Complaint> {
    (0..3).try_for_each(|k| estimate_check(&format!("{what}, channel {k}"), measured[k], expected[k], standard_error[k]))
}

/// `count` of `trials` against its probability, by the binomial standard error.
pub fn share_check(what: &str, count: u64, trials: u64, probability: f64) -> Check {
    let share = count as f64 / trials as f64;
    z_check(what, share, probability, (probability * (1.0 - probability) / trials as f64).sqrt())
}

/// Two lists of integers, place by place.
pub fn equal_sums(what: &str, found: &[u64], expected: &[u64]) -> Check {
    same_sums(what, found, expected).map_err(|complaint| complaint.text)
}

/// The same, and in which way they are off.
pub fn same_sums(what: &str, found: &[u64], expected: &[u64]) -> Check<Complaint> {
    Kind::Broken.unless(found.len() == expected.len(), || format!("{what}: {} sums instead of {}", found.len(), expected.len()))?;
    let differing: Vec<usize> = (0..found.len()).filter(|&place| found[place] != expected[place]).collect();
    let Some(&first) = differing.first() else { return Ok(()) };
    let larger = differing.iter().filter(|place| found[**place] > expected[**place]).count();
    let kind = match larger {
        0 if found.iter().all(|sum| *sum == 0) => Kind::Broken,
        0 => Kind::SumsTooSmall,
        all if all == differing.len() => Kind::SumsTooLarge,
        _ => Kind::OtherSums,
    };
    let (count, of) = (differing.len(), found.len());
    let text = format!("{what}: {count} of {of} sums differ, the first at {first}: {} instead of {}", found[first], expected[first]);
    Err(Complaint::new(kind, text))
}

/// Two photon maps as sets, bit for bit.
pub fn same_photons(found: &[Photon], expected: &[Photon]) -> Check<Complaint> {
    let (found, expected) = (in_order(found.to_vec()), in_order(expected.to_vec()));
    let kind = match found.len().cmp(&expected.len()) {
        Ordering::Less if found.is_empty() => Kind::Broken,
        Ordering::Less => Kind::PhotonsLost,
        Ordering::Greater => Kind::PhotonsAdded,
        Ordering::Equal => Kind::OtherPhotons,
    };
    kind.unless(kind == Kind::OtherPhotons, || format!("{} photons instead of {}", found.len(), expected.len()))?;
    let differing: Vec<_> = found.iter().zip(&expected).filter(|(a, b)| bytemuck::bytes_of(*a) != bytemuck::bytes_of(*b)).collect();
    let text = || format!("{} photons differ, the first {:?} instead of {:?}", differing.len(), differing[0].0, differing[0].1);
    kind.unless(differing.is_empty(), text)
}
