//! Blocks of rounds: samples that are even over them, errors from their spread, and runs in parts that come to the bits of one.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::common::prelude::*;
use crate::common::rendered::Viewed;
use crate::fuzz::seeds::Saved;
use photonmill::engine::End;
use photonmill::engine::film::{KeptBlock, LatestBlocks};
use photonmill::engine::room;
use photonmill::engine::run::blocks::Share;
use photonmill::engine::run::saved::{SavedFilm, SavedRun};
use photonmill::engine::run::watch::Checkpointing;
use photonmill::engine::scene::{self, RunResult};
use photonmill::error::Result;
use photonmill::ledger::BounceFates;
use photonmill::settings::stop::Stop;

/// What a part of a run is.
#[derive(Default)]
struct Part {
    share: Share,
    resume: Option<SavedRun>,
    /// Cancelled once so many rounds are done.
    most_rounds: Option<u64>,
}

/// Caustics, lamps seen directly and in mirrors, and radii by the trial's photons.
const SCENE: &str = "cornell-spheres";

/// A small picture of the scene, and what of it was saved.
fn kept(gpu: &Gpu, settings: &SceneSettings, part: Part) -> (RunResult, SavedRun) {
    let (result, saved) = try_run(gpu, settings, part);
    (result.unwrap(), saved.expect("a block was done"))
}

/// The same where it may fail, or not a block may be done.
fn try_run(gpu: &Gpu, settings: &SceneSettings, part: Part) -> (Result<RunResult>, Option<SavedRun>) {
    let viewed = Viewed::new(scene(SCENE));
    let plan = viewed.tried(gpu, settings, square_picture(8));
    let (cancelled, mut all) = (AtomicBool::new(false), Saved::default());
    let mut watch = |progress: &engine::Progress| {
        if part.most_rounds.is_some_and(|most| progress.done >= most) {
            cancelled.store(true, Ordering::Relaxed);
        }
    };
    let resume = part.resume.map(|run| (PathBuf::from("a file"), run));
    let checkpointing = Checkpointing { scene: SCENE, share: part.share, resume, every: Duration::ZERO, save: Some(&mut all), dealt: None };
    let result = scene::light(gpu, &viewed.viewpoint(), plan, &mut Control { cancelled: &cancelled, progress: &mut watch, checkpointing });
    (result, all.0.pop())
}

fn small(block: u32, rounds: u32) -> SceneSettings {
    SceneSettings { photons: 2000, caustic_photons: 1000, shadow_rays: 2, block: Some(block), rounds, ..SceneSettings::default() }
}

/// Of rounds of a block, samples and parts.
#[test]
fn parts_of_a_run_come_to_the_bits_of_one() {
    let cases = of_run::<&[_]>(&[(4, 2, 2)], &[(1, 1, 5), (4, 2, 2)]);
    let Some(gpu) = device() else { return };
    for &(block, samples, of) in cases {
        let settings = SceneSettings { samples, ..small(block, 12) };
        let (whole, saved) = kept(&gpu, &settings, Part::default());
        assert_eq!((whole.end, whole.film.rounds, saved.missing()), (End::Rounds, 12, 0));
        assert_eq!((whole.ledger().emitted, &whole.fates), (12 * 3000, &saved.fates));
        let share = |number| kept(&gpu, &settings, Part { share: Share { number, of }, ..Part::default() }).1;
        let parts: Vec<SavedRun> = (0..of).map(share).collect();
        let (last, others) = parts.split_last().unwrap();
        let mut merged = last.clone();
        others.iter().for_each(|part| merged.merge(part).unwrap());
        assert_eq!(merged.done.count() * block, 12);
        assert!(merged == saved, "{of} parts make another film or ledger");
        assert_eq!(merged.to_bytes(), saved.to_bytes());
        assert!(merged.merge(last).is_err(), "a part is added twice");
        // And in two sessions, of which the second reads what the first wrote.
        let (_, half) = kept(&gpu, &SceneSettings { rounds: 4, ..settings.clone() }, Part::default());
        let read = SavedRun::from_bytes(&half.to_bytes()).unwrap();
        assert!(read == half);
        let (on, saved_on) = kept(&gpu, &settings, Part { resume: Some(read), ..Part::default() });
        assert!(on.film == whole.film && on.fates == whole.fates && saved_on == saved, "what went on differs");
        // What is done already is read, and nothing is run.
        let (again, _) = kept(&gpu, &settings, Part { resume: Some(saved.clone()), ..Part::default() });
        assert!(again.film == whole.film && again.film.error(0.95) == whole.film.error(0.95));
    }
}

/// A run that goes on looks at its error where one without a break does, at once if it was saved there.
#[test]
fn what_goes_on_ends_at_the_same_look() {
    let Some(gpu) = device() else { return };
    let wanted = Stop { error: Some(0.9), ..Stop::default() };
    let settings = SceneSettings { stop: wanted, ..small(1, 400) };
    let (whole, saved) = kept(&gpu, &settings, Part::default());
    assert!(whole.end == End::Error && (18..400).contains(&whole.film.blocks), "{:?} after {}", whole.end, whole.film.blocks);
    // After 17 blocks, which is no look, and as many as it took.
    for blocks in [17, whole.film.blocks] {
        let (_, part) = kept(&gpu, &small(1, blocks), Part::default());
        let (on, saved_on) = kept(&gpu, &settings, Part { resume: Some(part), ..Part::default() });
        assert!(on.end == End::Error && on.film == whole.film && on.fates == whole.fates, "from {blocks}: {} blocks", on.film.blocks);
        assert!(saved_on.film == saved.film && saved_on.done == saved.done);
    }
}

/// Pictures without a trial, with kernels that fit all of them, which changes no bit (`tests/light/transport.rs`).
fn shared(settings: SceneSettings) -> SceneSettings {
    let with =
        vec![Effect::Direct, Effect::Indirect, Effect::MeshLights, Effect::DiscLights, Effect::Environment, Effect::Bvh, Effect::TwoSided];
    SceneSettings { with, aim: false, ..settings }
}

/// What a file may hold that is in order by itself, and that no run of its settings has saved.
fn forged(saved: &SavedRun) -> Vec<(&'static str, SavedRun)> {
    let with = |forge: &dyn Fn(&mut SavedRun)| {
        let mut forged = saved.clone();
        forge(&mut forged);
        SavedRun::from_bytes(&forged.to_bytes()).expect("it is in order by itself")
    };
    vec![
        ("no fates", with(&|saved| saved.fates.clear())),
        ("fates of more bounces", with(&|saved| saved.fates[0].bounces.insert(0, BounceFates::default()))),
        ("fates of more maps", with(&|saved| saved.fates.push(saved.fates[0].clone()))),
        (
            "kept blocks of fewer values",
            with(&|saved| match &mut saved.film {
                SavedFilm::Room(film) => film.latest = shorter(&film.latest),
                SavedFilm::Scene(film) => film.latest = shorter(&film.latest),
            }),
        ),
        (
            "another film",
            with(&|saved| match &mut saved.film {
                SavedFilm::Room(film) => {
                    film.of_blocks.sums.truncate(film.channel_count as usize);
                    film.of_blocks.squares.truncate(film.channel_count as usize);
                }
                SavedFilm::Scene(film) => film.part_totals.truncate(1),
            }),
        ),
    ]
}

fn shorter(latest: &LatestBlocks) -> LatestBlocks {
    let mut shorter = LatestBlocks::default();
    for block in latest.iter() {
        shorter.push(KeptBlock { values: block.values[1..].to_vec(), ..block.clone() });
    }
    shorter
}

#[track_caller]
fn assert_refused<T>(what: &str, ran: Result<T>) {
    let Err(error) = ran else { panic!("a run went on with {what}") };
    let line = error.to_string();
    assert!(line.starts_with("`resume` a file: contradicts itself") && !line.contains('\n'), "{what}: {line}");
}

#[test]
fn parts_of_the_box_come_to_the_bits_of_one() {
    let gpu = device();
    let settings =
        RoomSettings { photons: 501, rounds: 9, mesh: 8, rng: Rng::Philox, shininess: [Some(2.0); 5], ..RoomSettings::default() };
    let try_run = |gpu: Option<&Gpu>, rounds, share, resume| -> Result<SavedRun> {
        let mut all = Saved::default();
        let resume = Option::map(resume, |run| (PathBuf::from("a file"), run));
        let checkpointing = Checkpointing { scene: "open-box", share, resume, every: Duration::ZERO, save: Some(&mut all), dealt: None };
        let settings = RoomSettings { rounds, ..settings.clone() };
        room::run(gpu, &open_box(&settings), &settings, &mut Control { checkpointing, ..Control::default() })?;
        Ok(all.0.pop().unwrap())
    };
    let run = |gpu, rounds, share, resume| try_run(gpu, rounds, share, resume).unwrap();
    for gpu in [None, gpu.as_deref()] {
        let whole = run(gpu, 9, Share::default(), None);
        let mut merged = run(gpu, 9, Share { number: 2, of: 3 }, None);
        (0..2).for_each(|number| merged.merge(&run(gpu, 9, Share { number, of: 3 }, None)).unwrap());
        assert!(merged == whole && merged.to_bytes() == whole.to_bytes());
        let half = SavedRun::from_bytes(&run(gpu, 4, Share::default(), None).to_bytes()).unwrap();
        for (what, run) in forged(&half) {
            assert_refused(what, try_run(gpu, 9, Share::default(), Some(run)));
        }
        assert!(run(gpu, 9, Share::default(), Some(half)) == whole);
    }
}

/// A block that is cut short leaves nothing, unless it is all there is.
#[test]
fn a_block_cut_short_leaves_nothing() {
    let Some(gpu) = device() else { return };
    let (cut, saved) = kept(&gpu, &small(4, 64), Part { most_rounds: Some(10), ..Part::default() });
    assert_eq!(cut.end, End::Cancelled);
    let (blocks, photons) = (cut.film.blocks, 3000);
    assert!((2..16).contains(&blocks) && cut.film.rounds == 4 * blocks, "{blocks}");
    let (whole, _) = kept(&gpu, &small(4, 4 * blocks), Part::default());
    assert!(cut.film == whole.film && cut.fates == whole.fates && saved.fates == whole.fates);
    assert!(cut.ledger().closes() && cut.ledger().emitted == u64::from(4 * blocks) * photons);
    assert!(cut.left_out.is_multiple_of(photons) && cut.left_out < 4 * photons, "{}", cut.left_out);
    // Fewer rounds than a block has are all there is.
    let [few, more] = [3, 4].map(|rounds| try_run(&gpu, &small(4, rounds), Part::default()).0.unwrap());
    assert_eq!((few.end, few.film.rounds, few.film.blocks, few.left_out), (End::Rounds, 3, 0, 0));
    assert!(few.film.relative_error().is_infinite() && mean_red(&few) > 0.0);
    assert!((mean_red(&few) / mean_red(&more) - 1.0).abs() < 0.2);
}

/// Positions in a pixel are even over a block: pixels on the edge of a lamp have a smaller error than of rounds by themselves.
#[test]
fn samples_are_even_over_a_block() {
    let Some(gpu) = device() else { return };
    let lamp = Scene { name: "a lamp".into(), ..scene_of(vec![level(0.0, [1.0; 2], true, 0)], vec![emissive(1.0)], vec![]) };
    // The edges cross pixels at odd places.
    let camera = Camera::looking_at("above", DVec3::new(0.013, 2.0, 0.007), DVec3::new(0.013, 0.0, 0.007), DVec3::Z, 0.93);
    let of = |block: u32, rounds: u32, seed| {
        let settings = SceneSettings { rounds, seed, block: Some(block), photons: 1, ..SceneSettings::default() };
        means(&seen(&gpu, &lamp, &shared(settings), &camera, [16; 2]))
    };
    // Its own error is 1/32 of what a block's is.
    let truth = of(16, 512, 99);
    let square_error = |block: u32| {
        let squares = |seed| pairs(of(block, 16, seed), &truth).map(|(found, truth)| (found.x - truth.x).powi(2)).sum::<f64>();
        (1..5).map(squares).sum::<f64>()
    };
    let [by_rounds, even] = [1, 16].map(square_error);
    println!("mean square error of a lamp's edges, 16 rounds by themselves over a block of 16: {:.2}", by_rounds / even);
    // Of n even samples the variance falls as n^-1.5 at an edge, of independent ones as n^-1.
    assert!(by_rounds > 3.0 * even && even > 0.0, "{by_rounds} and {even}");
}

/// Stated errors are those of block sums: as large as the spread of whole runs. Over the rounds instead of the blocks, the variance would
/// be a quarter.
#[test]
fn the_spread_of_blocks_is_the_error() {
    let Some(gpu) = device() else { return };
    let cornell = scene("cornell");
    let of = |seed| {
        let settings = SceneSettings { seed, photons: 300, shadow_rays: 1, alpha: 1.0, radius: Some(0.2), ..small(4, 64) };
        seen(&gpu, &cornell, &shared(settings), &cornell.first_camera(), [8; 2])
    };
    let runs: Vec<RunResult> = (1..13).map(of).collect();
    let (mut spread, mut stated) = (0.0, 0.0);
    for pixel in 0..64 {
        let values: Vec<f64> = runs.iter().map(|result| result.film.surface_mean(pixel).x).collect();
        spread += 12.0 * mean_and_error(&values).1.powi(2);
        stated += runs.iter().map(|result| result.film.surface_error(pixel).x.powi(2)).sum::<f64>() / 12.0;
    }
    println!("stated variance over that of runs {:.3}", stated / spread);
    assert!((0.75..1.33).contains(&(stated / spread)), "{stated} and {spread}");
    assert!(runs.iter().all(|result| result.film.blocks == 16));
}

/// Emission that is seen directly is no part of the error, and neither is how much of the picture shows it.
#[test]
fn errors_are_of_what_surfaces_scatter() {
    let Some(gpu) = device() else { return };
    let cornell = scene("cornell");
    let bright = |factor: f32| {
        let mut room = cornell.clone();
        // The back of the lamp would light nothing, so only what is seen of it grows.
        room.materials.iter_mut().for_each(|material| material.emission *= factor);
        room
    };
    let error = |scene: &Scene, camera: &Camera, size| {
        let result = seen(&gpu, scene, &shared(small(1, 32)), camera, size);
        (result.film.error(0.95).noise, result)
    };
    let camera = cornell.first_camera();
    let (usual, result) = error(&cornell, &camera, [16; 2]);
    assert!((error(&bright(4.0), &camera, [16; 2]).0 / usual - 1.0).abs() < 1e-3, "scale");
    // The lamp is in the picture, and its pixels are no light of surfaces.
    let shows_lamp = (0..result.film.pixels()).any(|pixel| result.film.mean(pixel).x > 2.0 * result.film.surface_mean(pixel).x);
    assert!(shows_lamp);
    // Sky around the same surfaces: four times as many pixels, all black or lit by themselves.
    let plane = |half: f64| Camera::looking_at("above", DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, DVec3::Z, half);
    let mut floor = scene("disc-over-plane");
    floor.lights.push(Light { name: "sky".into(), kind: LightKind::Environment { radiance: Vec3::splat(50.0) } });
    let floor = Scene { meshes: vec![level(0.0, [1.0; 2], true, 0)], materials: vec![matt(0.5)], lights: floor.lights, ..floor };
    let [near, far] = [(0.66, 12), (1.2, 24)].map(|(angle, size)| error(&floor, &plane(angle), [size; 2]));
    let share = |result: &RunResult| result.film.surface_means().filter(|mean| mean.x > 0.0).count();
    println!("error {:.4} of {} pixels, {:.4} of {}", near.0, share(&near.1), far.0, share(&far.1));
    assert!((far.0 / near.0 - 1.0).abs() < 0.35, "{} and {}", near.0, far.0);
}

/// A checkpoint that is damaged anywhere is refused, and nothing panics; nor does a run go on with anything that its settings do not ask
/// for.
#[test]
fn damaged_files_are_refused() {
    let Some(gpu) = device() else { return };
    let (_, saved) = kept(&gpu, &small(1, 4), Part::default());
    let bytes = saved.to_bytes();
    assert!(SavedRun::from_bytes(&bytes).unwrap() == saved);
    for length in [0, 5, 16, 23, 24, 100, bytes.len() / 2, bytes.len() - 1] {
        assert!(SavedRun::from_bytes(&bytes[..length]).is_err(), "{length} bytes");
    }
    let mut place = 7;
    while place < bytes.len() {
        let mut damaged = bytes.clone();
        damaged[place] ^= 0x10;
        assert!(SavedRun::from_bytes(&damaged).is_err(), "byte {place}");
        place += 1 + place / 3;
    }
    // Files whose checksum is right, and whose header lies.
    let SavedFilm::Scene(film) = &saved.film else { panic!("a scene's film") };
    type Lie = fn(&mut SavedRun);
    let lies: [Lie; 5] = [
        |run| run.fates[0].emitted += 1,
        |run| run.sensor = Some(square_picture(3)),
        |run| run.share = Share { number: 4, of: 3 },
        |run| run.done.insert(17),
        // More than any run has: to count what is missing would take minutes.
        |run| run.wanted = u32::MAX,
    ];
    for (number, lie) in lies.iter().enumerate() {
        let mut lying = saved.clone();
        lie(&mut lying);
        assert!(SavedRun::from_bytes(&lying.to_bytes()).is_err(), "lie {number}");
    }
    assert_eq!(film.blocks, 4);
    for (what, run) in forged(&saved) {
        assert_refused(what, try_run(&gpu, &small(1, 8), Part { resume: Some(run), ..Part::default() }).0);
    }
}

/// The film's unit follows from the scene alone, so that any run can go on.
#[test]
fn the_films_unit_is_the_same_in_short_and_long_runs() {
    let spheres = scene("cornell-spheres");
    let unit = |rounds| {
        let settings = SceneSettings { rounds, ..by_rounds() };
        scene_plan_within(&Limits::of_host(), &spheres, &settings, square_picture(4)).unwrap().film.scale
    };
    assert_eq!(unit(1), unit(1 << 16));
    let shift = |rounds| {
        let settings = RoomSettings { rounds, shininess: [Some(2.0); 5], ..RoomSettings::default() };
        plan_for_host(&settings).film_shift
    };
    assert_eq!(shift(1), shift(100_000));
}
