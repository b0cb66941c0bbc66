//! Limits of a run: no light is lost to them without being counted, and a run ends soon after it is asked to.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use crate::common::prelude::*;
use photonmill::constants::MAX_BOUNCES;
use photonmill::engine::End;
use photonmill::engine::scene::resources::SceneResources;
use photonmill::engine::scene::{self, Round, RunResult, Viewpoint, trace};
use photonmill::output::scene_report;
use photonmill::plan::radius::{mean_squared_radius, of_round, squared_radius};
use photonmill::settings::stop::Stop;
use photonmill::timings::Span;

fn settings() -> SceneSettings {
    SceneSettings { photons: 8000, caustic_photons: 8000, rounds: 8, shadow_rays: 1, ..by_rounds() }
}

/// A closed room whose walls all emit.
fn furnace(albedo: f32) -> Scene {
    let mut scene = scene("furnace");
    scene.materials[0].base_colour = Vec3::splat(albedo);
    scene
}

const POINT: [(DVec3, DVec3); 1] = [(DVec3::new(0.5, 0.0, 0.5), DVec3::Y)];

/// Roulette ends paths, and takes nothing: irradiance is pi / (1 - albedo). Finds 20 % with 5 standard errors; the cap of 32 bounces that
/// was the default took 28 %.
#[test]
fn bright_rooms_lose_no_light() {
    let rooms = [(0.95, Builder::Persistent), (0.95, Builder::Ballot), (0.99, Builder::Persistent)];
    let Some(gpu) = device() else { return };
    for &(albedo, builder) in &rooms[..of_run(1, 3)] {
        let exact = PI / (1.0 - f64::from(albedo));
        let what = format!("albedo {albedo}, {}", builder.name());
        let settings = SceneSettings { builder: Some(builder), radius: Some(0.4), alpha: 1.0, ..settings() };
        let result = received(&gpu, &furnace(albedo), &settings, &POINT);
        let (mean, error) = red(&result, 0);
        assert!(error < 0.04 * exact, "{what}: {mean} +- {error}");
        assert_holds(&what, z_check(&what, mean, exact, error));
        assert_eq!((result.fates[0].ledger().cut_off, result.losses.cut_off), (0, 0.0), "{what}");

        let capped = received(&gpu, &furnace(albedo), &SceneSettings { bounces: 32, ..settings }, &POINT);
        let (mean, error) = red(&capped, 0);
        assert_complains("32 bounces", z_check(&what, mean, exact, error));
        assert!(capped.losses.relative >= 1.0 - mean / exact - 3.0 * error / exact, "{what}: {mean}, {:?}", capped.losses);
    }
}

/// What a cap cuts off is counted in watts, and bounds what it takes from the result.
#[test]
fn what_a_cap_cuts_off_is_counted() {
    let cases = [(Illumination::Split, 0.5, 1), (Illumination::Split, 0.9, 6), (Illumination::Photons, 0.5, 6)];
    let Some(gpu) = device() else { return };
    for &(illumination, albedo, bounces) in &cases[..of_run(2, 3)] {
        let what = format!("{illumination:?}, albedo {albedo}, {bounces} bounces");
        let settings = SceneSettings { illumination, bounces, radius: Some(0.4), alpha: 1.0, ..settings() };
        let result = received(&gpu, &furnace(albedo), &settings, &POINT);
        let RunResult { losses, fates, .. } = &result;
        let survivors = f64::from(albedo).powi(bounces as i32);
        let emitted = fates[0].emitted as f64;
        // A binomial deviation of the photons that survive.
        let error = (survivors * (1.0 - survivors) / emitted).sqrt();
        assert_holds(&what, z_check(&what, losses.share(), survivors, error));
        assert_holds(&what, z_check(&what, fates[0].ledger().cut_off as f64 / emitted, survivors, error));
        let exact = PI / (1.0 - f64::from(albedo));
        let lost = 1.0 - mean_red(&result) / exact;
        assert!(losses.relative >= lost, "{what}: {lost} is lost, at most {} is stated", losses.relative);
    }
}

/// An error that a cap makes impossible is refused, when the run first looks: after 30 rounds. Which cap it is, is said: bounces, or
/// shading normals that lean far.
#[test]
fn an_error_beyond_a_cap_is_refused() {
    let Some(gpu) = device() else { return };
    let mut leaning = furnace(0.5);
    for wall in &mut leaning.meshes {
        let [a, b, _] = wall.corners(0);
        wall.normals = vec![(wall.normal(0) + 3.0 * (b - a).normalize()).normalize(); wall.positions.len()];
    }
    for (scene, bounces, error, why) in [(furnace(0.9), 4, 0.01, "after 4 bounces"), (leaning, 64, 0.001, "shading normals")] {
        let stop = Stop { error: Some(error), ..Stop::default() };
        let settings = SceneSettings { bounces, photons: 500, rounds: 31, stop, ..settings() };
        let refused = run(&gpu, &scene, &settings, 16, &AtomicBool::new(false)).map(|result| result.losses).unwrap_err().to_string();
        assert!(refused.starts_with("`error` ") && refused.contains("cannot be reached") && refused.contains(why), "{refused}");
    }
}

/// Settings with kernels that fit every scene of mirrors, which changes no bit (`tests/light/transport.rs`).
fn of_mirrors() -> SceneSettings {
    let with = vec![Effect::Indirect, Effect::SpecularChains, Effect::MeshLights, Effect::PointLights];
    SceneSettings { with, illumination: Illumination::Photons, ..settings() }
}

/// Perfect mirrors, a hundred of them before the lamp at the end of the shaft.
#[test]
fn long_chains_of_mirrors_end_at_what_they_show() {
    let Some(gpu) = device() else { return };
    let length = 50.0;
    let mut meshes = shaft(0.0, length, 0);
    meshes.push(level(length, [1.0; 2], false, 1));
    let scene = scene_of(meshes, vec![mirror(1.0), emissive(0.0)], vec![]);
    // Two metres across for each one along: a hundred reflections.
    let camera = Camera::looking_at("ray", DVec3::new(0.0, 0.01, 0.1), DVec3::new(0.49, 0.255, 0.1), DVec3::Y, 1e-4);
    let result = seen(&gpu, &scene, &SceneSettings { rounds: 2, photons: 10, ..of_mirrors() }, &camera, [4, 4]);
    let mean = mean_red(&result);
    assert!((mean - 1.0).abs() < 1e-5, "{mean}");
    assert_eq!(result.losses.camera_paths, 0);
}

/// Where nothing ends a path, the hard end does, and counts everything.
#[test]
fn light_trapped_for_ever_is_counted() {
    let Some(gpu) = device() else { return };
    let mut meshes = shaft(0.0, 1.0, 0);
    meshes.extend([level(0.0, [1.0; 2], true, 0), level(1.0, [1.0; 2], false, 0)]);
    let lamp = LightKind::Point { position: DVec3::new(0.1, 0.4, 0.2), intensity: Vec3::ONE };
    let scene = scene_of(meshes, vec![mirror(1.0), matt(0.5), glass(1.5)], vec![lamp]);
    let camera = Camera::looking_at("ray", DVec3::new(0.0, 0.5, 0.1), DVec3::new(0.4, 0.8, 0.2), DVec3::Y, 0.5);
    let result = seen(&gpu, &scene, &SceneSettings { rounds: 1, photons: 40, ..of_mirrors() }, &camera, [2, 1]);
    // Roulette ends what the eye sees there.
    assert_eq!(result.losses.camera_paths, 0);
    let ledger = result.fates[0].ledger();
    assert_eq!((ledger.emitted, ledger.cut_off), (40, 40));
    // Each went as far as any may.
    let survived = result.fates[0].bounces.iter().map(|bounce| bounce.stored).sum::<u64>();
    assert_eq!(survived, 40 * u64::from(MAX_BOUNCES));
    assert!((result.losses.cut_off / result.losses.emitted - 1.0).abs() < 1e-5, "{:?}", result.losses);
}

/// The ledger's photons stored are those that lie in the map.
#[test]
fn photons_stored_are_the_length_of_the_map() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell-spheres");
    let ways = BOTH
        .into_iter()
        .take(of_run(1, 2))
        .flat_map(|illumination| [Builder::Ballot, Builder::Persistent].map(|builder| (illumination, builder)));
    for (illumination, builder) in ways {
        let settings = SceneSettings { builder: Some(builder), illumination, photons: 3000, rounds: 1, chunk: Some(700), ..settings() };
        let result = run(&gpu, &scene, &settings, 8, &AtomicBool::new(false)).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let mut commands = Commands::new(&gpu, scene::constants(&result.plan), Instant::now()).unwrap();
        let resources = SceneResources::new(&mut commands, &geometry, &result.plan, &[]).unwrap();
        let buffers = resources.photons.as_ref().unwrap();
        let round = Round { resources: &resources, geometry: &geometry, plan: &result.plan, number: 0 };
        for map in result.plan.maps() {
            let mut stored = 0;
            for chunk in map.chunks() {
                let mut count = |commands: &mut Commands, _: Option<u32>| {
                    stored += u64::from(commands.read(&buffers.counters, 1)?[0]);
                    Ok(())
                };
                trace::trace(&mut commands, round, map, chunk, &mut count).unwrap();
            }
            let fates = &result.fates[usize::from(map.caustic_only)];
            assert!(stored > 100, "{builder:?}, {illumination:?}, {}: {stored}", map.name);
            assert_eq!(fates.ledger().stored, stored, "{builder:?}, {illumination:?}, {}", map.name);
        }
    }
}

/// Radii by their closed form are those of the recurrence, at once for any round.
#[test]
fn radii_take_no_sum_over_earlier_rounds() {
    for alpha in [0.1, 0.5, 2.0 / 3.0, 0.99, 1.0] {
        let (mut squared, mut sum) = (1.0, 0.0);
        for round in 0..10_000u32 {
            let found = of_round(1.0, alpha, round).powi(2);
            assert!((found / squared - 1.0).abs() < 1e-9, "alpha {alpha}, round {round}: {found}, {squared}");
            sum += squared;
            let mean = mean_squared_radius(alpha, round + 1);
            assert!((mean * f64::from(round + 1) / sum - 1.0).abs() < 1e-9, "alpha {alpha}, mean of {}", round + 1);
            squared *= (f64::from(round + 1) + alpha) / (f64::from(round + 1) + 1.0);
        }
    }
    // Of so many late rounds, sums over all before them would take a day.
    assert!((0..100_000).map(|k| squared_radius(0.5, u32::MAX - k)).sum::<f64>() > 0.0);
}

fn run(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, size: u32, cancelled: &AtomicBool) -> Result<RunResult, Error> {
    let (geometry, plan) = scene_plan(gpu, scene, settings, square_picture(size))?;
    let viewpoint = Viewpoint { geometry: &geometry, camera: Some(&scene.first_camera()), phases: &[] };
    scene::light(gpu, &viewpoint, plan, &mut Control { cancelled, progress: &mut |_| {}, ..Control::default() })
}

/// What becomes of a run that is cancelled after so long, if nothing else has ended it.
fn cancelled_after<T>(time: Duration, run: impl FnOnce(&AtomicBool) -> T) -> T {
    let cancelled = &AtomicBool::new(false);
    let (ended, end) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            if end.recv_timeout(time) == Err(RecvTimeoutError::Timeout) {
                cancelled.store(true, Ordering::Relaxed);
            }
        });
        let result = run(cancelled);
        drop(ended);
        result
    })
}

/// Rounds that would take hours end in their middle when they are asked to.
#[test]
fn long_rounds_end_soon_after_they_are_asked_to() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell-spheres");
    // Radii of so many photons would find next to none of those that there is time for.
    let of = |photons, rounds, seconds| {
        let stop = Stop { seconds, ..Stop::default() };
        let radii = SceneSettings { radius: Some(0.05), caustic_radius: Some(0.02), ..settings() };
        SceneSettings { photons, caustic_photons: photons.min(1 << 20), rounds, stop, ..radii }
    };
    let result_of = |settings: &SceneSettings, cancelled: &AtomicBool| run(&gpu, &scene, settings, 16, cancelled);
    // Pipelines are made before the time is taken.
    let reference = result_of(&of(50_000, 2, None), &AtomicBool::new(false)).unwrap();
    let refused = cancelled_after(Duration::from_millis(300), |cancelled| result_of(&of(1 << 31, 4, None), cancelled)).unwrap_err();
    assert!(matches!(refused, Error::Interrupted), "{refused}");

    // In its first round a run ends with the photons that it has.
    let long = of(1 << 31, 4, Some(1.0));
    let result = cancelled_after(Duration::from_secs(600), |cancelled| result_of(&long, cancelled)).unwrap();
    assert_eq!((result.end, result.film.rounds), (End::Time, 1));
    let photons = result.fates[0].emitted;
    assert!(photons < u64::from(long.photons) && result.fates[1].emitted > 0);
    let report = scene_report::text("cornell-spheres", &result, "pixel", false);
    assert!(report.contains("time was up in the first round") && report.contains("use fewer `photons`"), "{report}");
    // It ended long before the last chunk of photons.
    let chunks = result.plan.global.as_ref().unwrap().chunks().count();
    assert!(chunks > 100 && photons < u64::from(long.photons) / 4, "{photons} photons, {chunks} chunks");
    // Fewer photons are no less light.
    let (found, expected) = (mean_red(&result), mean_red(&reference));
    println!("{photons} photons: {found} where {expected} is right");
    assert!((found / expected - 1.0).abs() < 0.05, "{found}, {expected}");
}

/// A gather over wide radii, which nobody could know to be slow, is cut into pieces as its time becomes known. (Of how long a piece takes
/// `gpu/pace.rs` has a test that drives the clock. A busy machine is slow, and has more pieces.)
#[test]
fn no_dispatch_takes_long() {
    let Some(gpu) = open(Options { time_dispatches: true, ..Options::default() }) else { return };
    if gpu.facts().timestamp_bits == 0 {
        return;
    }
    let (photons, size) = if gpu.facts().kind == "cpu" { (60_000, 48) } else { (10_000_000, 512) };
    let wide = SceneSettings { photons, rounds: 2, radius: Some(0.4), ..settings() };
    let result = run(&gpu, &scene("cornell"), &wide, size, &AtomicBool::new(false)).unwrap();
    let first_round = result.timings.spans().iter().find(|span| span.name.ends_with("/resolve")).unwrap().start;
    let is_gather = |span: &&Span| span.start > first_round && span.name.contains("/gather/gather_visible_points");
    let gathers = result.timings.spans().iter().filter(is_gather).count();
    // Two for each piece, and one piece of a gather that takes no time.
    println!("{gathers} gathers in the second round");
    assert!(gathers > 6, "{gathers}");
}
