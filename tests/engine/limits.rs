//! Limits of a run: no light is lost to them without being counted, and a run ends soon after it is asked to.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use crate::common::prelude::*;
use photonmill::constants::MAX_BOUNCES;
use photonmill::engine::End;
use photonmill::engine::scene::resources::SceneResources;
use photonmill::engine::scene::{self, Round, RunResult, View, trace};
use photonmill::output::scene_report;
use photonmill::plan::radius::{mean_squared_radius, squared_radius};
use photonmill::settings::stop::Stop;
use photonmill::timings::{Clock, Span};

fn settings() -> SceneSettings {
    SceneSettings { photons: 8000, caustic_photons: 8000, rounds: 8, shadow_rays: 1, ..by_rounds() }
}

/// A closed room whose walls all shine.
fn furnace(albedo: f32) -> Scene {
    let mut scene = scene("furnace");
    scene.materials[0].base_colour = Vec3::splat(albedo);
    scene
}

const POINT: [(DVec3, DVec3); 1] = [(DVec3::new(0.5, 0.0, 0.5), DVec3::Y)];

/// Roulette ends paths, and takes nothing: irradiance is pi / (1 - albedo) by every builder.
#[test]
fn bright_rooms_lose_no_light() {
    let Some(gpu) = device() else { return };
    for albedo in [0.95f32, 0.99] {
        let exact = PI / (1.0 - f64::from(albedo));
        for builder in [Builder::Atomic, Builder::Ballot, Builder::Persistent] {
            let what = format!("albedo {albedo}, {}", builder.name());
            let settings = SceneSettings { builder: Some(builder), radius: Some(0.4), alpha: 1.0, ..settings() };
            let lit = received(&gpu, &furnace(albedo), &settings, &POINT);
            let (mean, error) = red(&lit, 0);
            assert!(error < 0.04 * exact, "{what}: {mean} +- {error}");
            assert_holds(&what, z_check(&what, mean, exact, error));
            assert_eq!((lit.fates[0].ledger().cut_off, lit.losses.cut_off), (0, 0.0), "{what}");

            // With the cap that was the default.
            let capped = received(&gpu, &furnace(albedo), &SceneSettings { bounces: 32, ..settings }, &POINT);
            let (mean, error) = red(&capped, 0);
            assert_complains("32 bounces", z_check(&what, mean, exact, error));
            assert!(capped.losses.relative >= 1.0 - mean / exact - 3.0 * error / exact, "{what}: {mean}, {:?}", capped.losses);
        }
    }
}

/// What a cap cuts off is counted in watts, and bounds what it takes from the result.
#[test]
fn what_a_cap_cuts_off_is_counted() {
    let Some(gpu) = device() else { return };
    for (illumination, albedo, bounces) in
        BOTH.into_iter().flat_map(|illumination| [(illumination, 0.5f32, 1), (illumination, 0.5, 6), (illumination, 0.9, 6)])
    {
        let what = format!("{illumination:?}, albedo {albedo}, {bounces} bounces");
        let settings = SceneSettings { illumination, bounces, radius: Some(0.4), alpha: 1.0, ..settings() };
        let lit = received(&gpu, &furnace(albedo), &settings, &POINT);
        let RunResult { losses, fates, .. } = &lit;
        let survivors = f64::from(albedo).powi(bounces as i32);
        let emitted = fates[0].emitted as f64;
        // A binomial deviation of the photons that survive.
        let error = (survivors * (1.0 - survivors) / emitted).sqrt();
        assert_holds(&what, z_check(&what, losses.share(), survivors, error));
        assert_holds(&what, z_check(&what, fates[0].ledger().cut_off as f64 / emitted, survivors, error));
        let exact = PI / (1.0 - f64::from(albedo));
        let lost = 1.0 - mean_red(&lit) / exact;
        assert!(losses.relative >= lost, "{what}: {lost} is lost, at most {} is stated", losses.relative);
    }
}

/// An error that a cap makes impossible is refused, when the run first looks: after 30 rounds.
#[test]
fn an_error_beyond_a_cap_is_refused() {
    let Some(gpu) = device() else { return };
    let stop = Stop { error: Some(0.01), ..Stop::default() };
    let settings = SceneSettings { bounces: 4, photons: 500, rounds: 31, stop, ..settings() };
    let refused = run(&gpu, &furnace(0.9), &settings, &AtomicBool::new(false)).unwrap_err();
    assert!(refused.to_string().starts_with("--error 1%: cannot be reached"), "{refused}");
}

/// Perfect mirrors, a hundred of them before the lamp at the end of the shaft.
#[test]
fn long_chains_of_mirrors_end_at_what_they_show() {
    let Some(gpu) = device() else { return };
    let length = 50.0;
    let mut meshes = shaft(0.0, length, 0);
    meshes.push(level(length, [1.0; 2], false, 1));
    let scene = scene_of(meshes, vec![mirror(1.0), shining(0.0)], vec![]);
    // Two metres across for each one along: a hundred reflections.
    let camera = Camera::looking_at("ray", DVec3::new(0.0, 0.01, 0.1), DVec3::new(0.49, 0.255, 0.1), DVec3::Y, 1e-4);
    let lit = seen(&gpu, &scene, &SceneSettings { rounds: 2, photons: 10, caustic_photons: 10, ..settings() }, &camera, [4, 4]);
    let mean = mean_red(&lit);
    assert!((mean - 1.0).abs() < 1e-5, "{mean}");
    assert_eq!(lit.losses.camera_paths, 0);
}

/// Where nothing ends a path, the hard end does, and counts everything.
#[test]
fn light_trapped_for_ever_is_counted() {
    let Some(gpu) = device() else { return };
    let mut meshes = shaft(0.0, 1.0, 0);
    meshes.extend([level(0.0, [1.0; 2], true, 0), level(1.0, [1.0; 2], false, 0)]);
    let lamp = LightKind::Point { position: DVec3::new(0.1, 0.4, 0.2), intensity: Vec3::ONE };
    let scene = scene_of(meshes, vec![mirror(1.0), matt(0.5), glass(1.5)], vec![lamp]);
    let settings = SceneSettings { rounds: 1, photons: 40, illumination: Illumination::Photons, ..settings() };
    let camera = Camera::looking_at("ray", DVec3::new(0.0, 0.5, 0.1), DVec3::new(0.4, 0.8, 0.2), DVec3::Y, 0.5);
    let lit = seen(&gpu, &scene, &SceneSettings { with: vec![Effect::Indirect], ..settings }, &camera, [2, 1]);
    // Roulette ends what the eye sees there.
    assert_eq!(lit.losses.camera_paths, 0);
    let ledger = lit.fates[0].ledger();
    assert_eq!((ledger.emitted, ledger.cut_off), (40, 40));
    // Each went as far as any may.
    let survived = lit.fates[0].bounces.iter().map(|bounce| bounce.stored).sum::<u64>();
    assert_eq!(survived, 40 * u64::from(MAX_BOUNCES));
    assert!((lit.losses.cut_off / lit.losses.emitted - 1.0).abs() < 1e-5, "{:?}", lit.losses);
}

/// The ledger's photons stored are those that lie in the map.
#[test]
fn photons_stored_are_the_length_of_the_map() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell-spheres");
    for (builder, illumination) in [Builder::Ballot, Builder::Persistent].into_iter().flat_map(|builder| BOTH.map(|light| (builder, light)))
    {
        let settings = SceneSettings { builder: Some(builder), illumination, photons: 3000, rounds: 1, chunk: Some(700), ..settings() };
        let lit = run(&gpu, &scene, &settings, &AtomicBool::new(false)).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let mut commands = Commands::new(&gpu, scene::constants(&lit.plan), Instant::now()).unwrap();
        let resources = SceneResources::new(&gpu, &mut commands, &geometry, &lit.plan, &[]).unwrap();
        let buffers = resources.photons.as_ref().unwrap();
        let round = Round { resources: &resources, geometry: &geometry, plan: &lit.plan, number: 0 };
        for map in lit.plan.maps() {
            let mut stored = 0;
            for chunk in map.chunks() {
                let mut count = |commands: &mut Commands, _: Option<u32>| {
                    stored += u64::from(commands.read(&buffers.counters, 1)?[0]);
                    Ok(())
                };
                trace::trace(&mut commands, round, buffers, map, chunk, &mut count).unwrap();
            }
            let fates = &lit.fates[usize::from(map.caustic_only)];
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
        for round in 0..5000u32 {
            let found = squared_radius(alpha, round);
            assert!((found / squared - 1.0).abs() < 1e-9, "alpha {alpha}, round {round}: {found}, {squared}");
            sum += squared;
            let mean = mean_squared_radius(alpha, round + 1);
            assert!((mean * f64::from(round + 1) / sum - 1.0).abs() < 1e-9, "alpha {alpha}, mean of {}", round + 1);
            squared *= (f64::from(round + 1) + alpha) / (f64::from(round + 1) + 1.0);
        }
    }
    // Of so many late rounds, sums over all before them would take a day.
    assert!((0..10_000_000).map(|k| squared_radius(0.5, u32::MAX - k)).sum::<f64>() > 0.0);
}

fn run(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, cancelled: &AtomicBool) -> Result<RunResult, Error> {
    let (geometry, plan) = scene_plan(gpu, scene, settings, square_picture(64))?;
    let view = View { geometry: &geometry, camera: Some(&scene.first_camera()), phases: &[] };
    scene::light(gpu, &view, plan, &mut Control { cancelled, progress: &mut |_| {}, ..Control::default() })
}

/// Rounds that would take many minutes end in their middle when they are asked to.
/// The result of a run that would go on for hours if nothing ended it: after a minute it is cancelled, which fails.
fn ended_by_itself(run: impl FnOnce(&AtomicBool) -> photonmill::error::Result<RunResult>) -> RunResult {
    let cancelled = &AtomicBool::new(false);
    let (ended, end) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            if end.recv_timeout(Duration::from_secs(60)) == Err(RecvTimeoutError::Timeout) {
                cancelled.store(true, Ordering::Relaxed);
            }
        });
        let result = run(cancelled);
        drop(ended);
        result.unwrap()
    })
}

#[test]
fn long_rounds_end_soon_after_they_are_asked_to() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell-spheres");
    let long = SceneSettings { photons: 1 << 31, caustic_photons: 1 << 20, rounds: 4, ..settings() };
    // Pipelines are made before the time is taken.
    run(&gpu, &scene, &SceneSettings { photons: 1000, caustic_photons: 1000, rounds: 1, ..long.clone() }, &AtomicBool::new(false)).unwrap();
    let cancelled = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let asker = scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(700));
            cancelled.store(true, Ordering::Relaxed);
        });
        let refused = run(&gpu, &scene, &long, &cancelled).unwrap_err();
        assert!(matches!(refused, Error::Interrupted), "{refused}");
        asker.join().unwrap();
    });

    // Radii of so many photons would find next to none of those that there is time for.
    let wide = |of: &SceneSettings| SceneSettings { radius: Some(0.05), caustic_radius: Some(0.02), ..of.clone() };
    // In its first round a run ends with the photons that it has.
    let wanted = Duration::from_millis(1500);
    let stop = Stop { seconds: Some(wanted.as_secs_f64()), ..Stop::default() };
    let lit = ended_by_itself(|cancelled| run(&gpu, &scene, &SceneSettings { stop, ..wide(&long) }, cancelled));
    assert_eq!((lit.end, lit.film.rounds), (End::Time, 1));
    assert!(lit.fates[0].emitted < u64::from(long.photons) && lit.fates[1].emitted > 0);
    let report = scene_report::text("cornell-spheres", &lit, "pixel", false);
    assert!(report.contains("time was up in the first round") && report.contains("use fewer --photons"), "{report}");
    // It ended long before the last chunk of photons.
    let chunks = lit.plan.global.as_ref().unwrap().chunks().count();
    assert!(chunks > 100 && lit.fates[0].emitted < u64::from(long.photons) / 4, "{} photons, {chunks} chunks", lit.fates[0].emitted);
    // Fewer photons are no less light.
    let reference = SceneSettings { photons: 50_000, rounds: 2, ..wide(&settings()) };
    let reference = run(&gpu, &scene, &reference, &AtomicBool::new(false)).unwrap();
    let (found, expected) = (mean_red(&lit), mean_red(&reference));
    assert!((found / expected - 1.0).abs() < 0.05, "{found}, {expected}");
}

/// A gather over wide radii, which nobody could know to be slow, is cut into pieces as its time becomes known.
#[test]
fn no_dispatch_takes_long() {
    let Some(gpu) = open(Options { time_dispatches: true, ..Options::default() }) else { return };
    if gpu.facts().timestamp_bits == 0 {
        return;
    }
    let is_cpu = gpu.facts().kind == "cpu";
    let photons = if is_cpu { 60_000 } else { 10_000_000 };
    let wide = SceneSettings { photons, caustic_photons: 2000, rounds: 3, radius: Some(0.4), ..settings() };
    let size = if is_cpu { 64 } else { 512 };
    let of = scene("cornell-spheres");
    let (geometry, plan) = scene_plan(&gpu, &of, &wide, square_picture(size)).unwrap();
    let kernels: Vec<&str> = scene::modules(&plan, gpu.facts()).iter().map(|module| module.name).collect();
    let view = View { geometry: &geometry, camera: Some(&of.first_camera()), phases: &[] };
    let lit = scene::light(&gpu, &view, plan, &mut Control::default()).unwrap();
    let is_dispatch = |span: &&Span| span.clock == Clock::Gpu && kernels.iter().any(|kernel| span.name.ends_with(&format!("/{kernel}")));
    let dispatches: Vec<&Span> = lit.timings.spans().iter().filter(is_dispatch).collect();
    let gathers = dispatches.iter().filter(|span| span.name.contains("/gather/gather_visible_points"));
    let (count, total) = gathers.fold((0, Duration::ZERO), |(count, total), span| (count + 1, total + span.duration));
    // Of 50 ms; where others use the device too, as other tests do, times are not its own.
    let most = Duration::from_millis(200);
    assert!(total > 10 * most && count > 20, "{total:?} in {count} pieces show nothing");
    // What is slow in which part of the picture is known to a slow device from the second round on.
    let first_round = dispatches.iter().find(|span| span.name.ends_with("/resolve")).unwrap().start;
    let slowest = dispatches.iter().filter(|span| !is_cpu || span.start > first_round).max_by_key(|span| span.duration).unwrap();
    assert!(slowest.duration < most, "{}: {:?}", slowest.name, slowest.duration);
}
