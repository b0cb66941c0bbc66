//! Sums, estimates and sizes at their ends: more photons than f32 or 32 bits count, light over many decades, the
//! least and the largest radius, one photon and none, and plans around every limit.

use crate::common::known::kept;
use crate::common::prelude::*;
use crate::common::rendered::received_within;
use glam::EulerRot;
use photonmill::cpu::bsdf::phong_lobe;
use photonmill::engine::film::BlockSums;
use photonmill::engine::room::film::{RoomFilm, estimate_walls};
use photonmill::engine::scene::RunResult;
use photonmill::ledger::Fates;
use photonmill::plan::scene::SEGMENT_BOUNCES;
use photonmill::records::Tally;
use photonmill::scene::rectangle::disc_rectangle_area;
use photonmill::settings::MAX_EVENTS;
use photonmill::settings::scene::Kernel;
use photonmill::settings::stop::Stop;

/// Half of an f32's spacing below 1.
const U: f64 = 1.0 / 16_777_216.0;

/// 42 million photons on one texel: f32 would stop counting at 2^24.
#[test]
fn a_texel_counts_beyond_2_to_the_24() {
    let (count, times) = (1 << 20, 40);
    let expected = [0, 0, 0, 0, u64::from(count * times)];
    for without_int64_atomics in [false, true] {
        let Some(gpu) = device_with(Options { without_int64_atomics, ..Options::default() }) else { return };
        let settings =
            RoomSettings { photons: count, chunk: Some(count), bounces: 1, mesh: 1, rng: Rng::Philox, ..RoomSettings::default() };
        let plan = plan_for(&gpu, &open_box(&settings), &settings);
        let found = gathered(&gpu, &plan, &vec![on_back_wall(0.0, 0.0, 0); count as usize], times, None);
        assert_holds(format!("64-bit atomics masked: {without_int64_atomics}"), equal_sums("one texel", &found, &expected));
    }
    let in_f32 = (0..count * times).fold(0.0f32, |sum, _| sum + 1.0);
    assert_complains("a sum in f32", equal_sums("one texel", &[0, 0, 0, 0, in_f32 as u64], &expected));
}

/// Runs that are merged sum by sum: a million million photons are as bright as the five thousand that they repeat.
#[test]
fn a_trillion_photons_merge_into_the_same_light() {
    let settings = RoomSettings { mesh: 16, ..RoomSettings::default() };
    let result = run_on_cpu(&settings);
    let scene = open_box(&settings);
    let one = estimate_walls(&result.film, &scene, &result.plan);
    for times in [200_000u64, 200_000_000] {
        let merged = RoomFilm {
            of_blocks: BlockSums {
                sums: result.film.sums.iter().map(|sum| sum.checked_mul(times).unwrap()).collect(),
                ..result.film.of_blocks.clone()
            },
            emitted: result.film.emitted * times,
            ..result.film.clone()
        };
        for (found, expected) in pairs(estimate_walls(&merged, &scene, &result.plan), &one) {
            for (found, expected) in pairs(&found.irradiance, &expected.irradiance).filter(|(_, expected)| **expected > 0.0) {
                assert_holds(times, relative_check("irradiance", *found, *expected, 8.0 * f64::EPSILON));
                let less = found * (1.0 - U);
                assert_complains("a count kept in f32", relative_check("irradiance", less, *expected, 8.0 * f64::EPSILON));
            }
        }
    }
    // Tallies are 32-bit on the device, and their sums are not.
    let mut fates = Fates::new(1);
    let round = Tally { stored: 3_000_000_000, absorbed: 500_000_000, escaped: 499_999_999, dropped: 1 };
    (0..250).for_each(|_| fates.add(&Fates { emitted: 4_000_000_000, ..Fates::counted(&[round], None) }));
    let ledger = fates.ledger();
    assert!(ledger.closes());
    assert_eq!((ledger.emitted, ledger.stored, ledger.dropped), (1_000_000_000_000, 750_000_000_000, 250));
}

/// Lights of 1e-12 W to 1e12 W: 24 decades of power change no sum, and the light in proportion.
#[test]
fn light_is_linear_in_power_over_24_decades() {
    let of = |light_power: [f64; 2]| {
        let settings = RoomSettings { light_power, mesh: 8, ..RoomSettings::default() };
        let result = run_on_cpu(&settings);
        let walls = estimate_walls(&result.film, &open_box(&settings), &result.plan);
        (result.film.of_blocks.sums, walls.into_iter().flat_map(|wall| wall.irradiance).collect::<Vec<f64>>())
    };
    let (sums, one_watt) = of([1.0, 1.0]);
    assert!(one_watt.iter().all(|irradiance| *irradiance > 0.0));
    for exponent in [-12, -7, 3, 12] {
        let watts = 10f64.powi(exponent);
        let (found, irradiance) = of([watts, watts]);
        assert_holds(exponent, equal_sums("the film", &found, &sums));
        for (found, one) in pairs(&irradiance, &one_watt) {
            assert_holds(exponent, relative_check("irradiance", *found, one * watts, 8.0 * f64::EPSILON));
        }
    }
}

/// Phong weights that differ by many decades, and fluxes of lamps as different as is allowed, mixed in one texel: a sum
/// is off by no more than half a unit of fixed point for each photon.
#[test]
fn mixed_weights_are_summed_to_half_a_unit_each() {
    let settings = RoomSettings {
        shininess: [Some(1e4), None, Some(0.01), Some(5.0), Some(0.0)],
        light_power: [1.0, 1.1e-6],
        mesh: 16,
        ..RoomSettings::default()
    };
    let (map, plan, film) = (photons_on_cpu(&settings), plan_for_host(&settings), run_on_cpu(&settings).film);
    let radius_squared = (settings.radius * settings.radius) as f32;
    let (mut decades, mut worst) = (0.0f64, 0.0f64);
    for (place, point) in plan.points.iter().enumerate() {
        let near = map.iter().filter(|photon| {
            let offset = photon.position - point.position;
            photon.wall == point.wall && offset.x * offset.x + offset.y * offset.y + offset.z * offset.z <= radius_squared
        });
        let (mut flux, mut weight, mut count) = (0.0, 0.0, 0.0);
        for photon in near {
            flux += f64::from(photon.flux);
            weight += f64::from(photon.weight);
            count += 1.0;
            decades = decades.max(if photon.weight > 0.0 { -f64::from(photon.weight).log10() } else { 0.0 });
        }
        let half_units = 0.5 * count / film.scale;
        for (what, found, exact) in [("flux", film.flux(place), flux), ("power", film.power(place), weight)] {
            assert!((found - exact).abs() <= half_units, "{what} of point {place}: {found} where {exact} +- {half_units:e} is right");
            worst = worst.max((found - exact).abs());
        }
    }
    println!("weights over {decades:.1} decades, sums off by {worst:.1e} at most");
    assert!(decades > 12.0, "weights over {decades} decades only");
}

/// Faint surfaces beside bright ones are right to half a unit of the film.
#[test]
fn faint_light_is_right_to_half_a_film_unit() {
    let Some(gpu) = device() else { return };
    let settings = kept(SceneSettings { photons: 1, rounds: 2, shadow_rays: 1, ..by_rounds() });
    for exponent in [0, -3, -6, -9, -12] {
        let mut plane = scene("sky-over-plane");
        let albedo = 10f32.powi(exponent);
        plane.materials[0].base_colour = Vec3::splat(albedo);
        let camera = Camera::looking_at("above", DVec3::Y * 1.5, DVec3::ZERO, DVec3::Z, 0.1);
        let result = seen(&gpu, &plane, &settings, &camera, [8, 8]);
        let (found, expected) = (mean_red(&result), f64::from(albedo));
        let half_unit = 0.5 / result.plan.film.scale;
        println!("albedo 1e{exponent}: {found:e}, {:.1e} off, half a unit is {half_unit:.1e}", (found - expected).abs());
        // A sky is sampled by the cosine: every ray sees the same, but for some roundings of f32.
        assert!((found - expected).abs() <= half_unit + 16.0 * U * expected, "{found:e} where {expected:e} is right");
    }
}

/// 1000 +- 0.1 over a million rounds: the difference of two squares that agree in eight digits.
#[test]
fn standard_errors_survive_a_mean_far_above_them() {
    let furnace = scene("furnace");
    let settings = SceneSettings { rounds: 1_000_000, ..by_rounds() };
    let plan = scene_plan_within(&Limits::of_host(), &furnace, &settings, square_picture(1)).unwrap();
    let mut light = BlockSums { sums: vec![0], squares: vec![0], ..BlockSums::default() };
    // As f32 would have it: nothing is left of the variance, or it is negative.
    let (mut sum, mut sum_of_squares) = (0.0f32, 0.0f32);
    for value in [999.9f64, 1000.1].repeat(settings.rounds as usize / 2) {
        light.end_block(1, &[(value * plan.film.scale).round() as u64]);
        sum += value as f32;
        sum_of_squares += value as f32 * value as f32;
    }
    let rounds = f64::from(light.rounds);
    let [mean, error] = [light.sums[0] as f64, light.variance(0).sqrt()].map(|of_sum| of_sum / rounds / plan.film.scale);
    let exact = 0.1 / (rounds - 1.0).sqrt();
    assert_holds("mean", relative_check("mean", mean, 1000.0, 1e-6));
    assert_holds("error", relative_check("standard error", error, exact, 1e-3));
    let n = settings.rounds as f32;
    let naive = (f64::from(sum_of_squares / n - (sum / n) * (sum / n)) / rounds).sqrt();
    assert_complains("sums in f32", relative_check("standard error", naive, exact, 1e-3));
}

/// The most events that 64-bit sums hold, and one more.
#[test]
fn film_sums_are_refused_before_they_could_overflow() {
    let most = RoomSettings { photons: 1 << 31, bounces: 1 << 4, rounds: 1 << 12, rng: Rng::Philox, ..RoomSettings::default() };
    assert_eq!(most.total_photons() * u64::from(most.bounces), MAX_EVENTS);
    most.validate().unwrap();
    let host = Limits::of_host();
    let plan = RoomPlan::new(&open_box(&most), &RoomSettings { mesh: 1, shininess: [Some(2.0); 5], ..most.clone() }, &host).unwrap();
    // Photons of weight 1 only, in every texel at every bounce.
    assert!(u128::from(MAX_EVENTS) << plan.film_shift <= 1 << 63);
    for settings in [RoomSettings { rounds: most.rounds + 1, ..most.clone() }, RoomSettings { bounces: most.bounces + 1, ..most }] {
        let error = settings.validate().unwrap_err().to_string();
        assert!(error.contains("film"), "{error}");
    }
}

/// max(cosine, 0)^shininess at the paper's exponents and beyond, from the last number below 1 down to 0.
#[test]
fn phong_weights_are_powers_of_the_cosine() {
    let mut worst = [0.0f64; 6];
    for (place, shininess) in [0.0f32, 0.01, 0.5, 2.0, 5.0, 1e4].into_iter().enumerate() {
        for step in 0..200_000u32 {
            // Half of them close to 1, where a power of ten thousand lives.
            let cosine = if step % 2 == 0 { step as f32 / 200_000.0 } else { 1.0 - (step as f32 / 200_000.0).powi(4) * 0.01 };
            let exact = if cosine > 0.0 { f64::from(cosine).powf(f64::from(shininess)) } else { 0.0 };
            let found = f64::from(phong_lobe(cosine, shininess));
            if exact < f64::from(f32::MIN_POSITIVE) {
                assert!(found <= f64::from(f32::MIN_POSITIVE), "{cosine}^{shininess}: {found}");
                continue;
            }
            worst[place] = worst[place].max((found / exact - 1.0).abs());
            // Below 1e-20 a relative error weighs nothing.
            if exact > 1e-20 {
                assert_holds(shininess, relative_check(&format!("{cosine}^{shininess}"), found, exact, 5e-5));
            }
        }
        for away in [0.0, -0.0, -f32::MIN_POSITIVE, -0.5, -1.0] {
            assert_eq!(phong_lobe(away, shininess), 0.0, "cosine {away}");
        }
        assert_eq!(phong_lobe(1.0, shininess), 1.0);
        assert_eq!(phong_lobe(f32::MIN_POSITIVE, 0.0), 1.0);
    }
    println!("relative errors at shininess 0, 0.01, 0.5, 2, 5, 1e4: {worst:?}");
    assert_complains("an exponent 1 % too large", relative_check("0.5^2.02", 0.5f64.powf(2.02), 0.25, 5e-5));
}

/// Directions that leave by the cosine and an eye straight above: E[w] = 2 / (n + 2), and E[w^2] by the same with
/// 2 n. On the device, the photons without weight are those whose mirror direction points away from the eye,
/// whatever the exponent.
#[test]
fn phong_weights_have_their_mean_and_vanish_behind() {
    let count = 400_000u32;
    // Numbers in [0, 1), drawn as photons draw them.
    let streams = streams_of(&RoomSettings { rng: Rng::Philox, photons: count, ..RoomSettings::default() });
    let draws: Vec<f32> = (0..count).map(|photon| draws_of(streams, 0, photon, 0)[0]).collect();
    for shininess in [0.0f32, 0.01, 0.5, 2.0, 5.0, 1e4] {
        let n = f64::from(shininess);
        let (mean, square) = (2.0 / (n + 2.0), 2.0 / (2.0 * n + 2.0));
        let sum: f64 = draws.iter().map(|u| f64::from(phong_lobe(u.sqrt(), shininess))).sum();
        let error = ((square - mean * mean) / f64::from(count)).sqrt().max(U);
        assert_holds(shininess, z_check("mean weight", sum / f64::from(count), mean, error));
        if shininess > 0.0 {
            assert_complains("1 / (n + 1)", z_check("mean weight", sum / f64::from(count), 1.0 / (n + 1.0), error));
        }
    }
    let Some(gpu) = device() else { return };
    let weights = |shininess: f32| {
        let settings = RoomSettings { shininess: [Some(shininess); 5], photons: 20_001, ..RoomSettings::default() };
        let map = in_order(photons(&gpu, &settings));
        assert!(map.iter().all(|photon| (0.0..=1.0).contains(&photon.weight)), "shininess {shininess}");
        map.iter().map(|photon| photon.weight).collect::<Vec<f32>>()
    };
    let ones = weights(0.0);
    assert!(ones.iter().all(|weight| *weight == 0.0 || *weight == 1.0), "a power of 0 is 1 where there is light");
    let dark = ones.iter().filter(|weight| **weight == 0.0).count();
    assert!(dark > 1000, "only {dark} photons point away");
    for shininess in [0.01, 0.5, 2.0, 5.0] {
        let same = pairs(&ones, weights(shininess)).all(|(one, weight)| (*one == 0.0) == (weight == 0.0));
        assert!(same, "shininess {shininess} has other photons without weight");
    }
    let narrow = weights(1e4);
    assert!(pairs(&ones, &narrow).all(|(one, weight)| weight <= one) && narrow.iter().any(|weight| *weight > 0.0));
}

/// From a photon's own place there is no direction to the eye, and from an eye in the wall's plane none but along it.
#[test]
fn an_eye_on_a_photon_sees_no_weight_and_no_nan() {
    let settings = RoomSettings { shininess: [Some(2.0); 5], ..RoomSettings::default() };
    let all = photons_on_cpu(&settings);
    for place in [0, all.len() / 2, all.len() - 1] {
        let eye = all[place].position.to_array();
        let settings = RoomSettings { eye, ..settings.clone() };
        let map = photons_on_cpu(&settings);
        assert_eq!(map[place].weight, 0.0);
        assert!(map.iter().all(|photon| (0.0..=1.0).contains(&photon.weight)));
        let Some(gpu) = device() else { continue };
        let on_device = in_order(photons(&gpu, &settings));
        assert!(on_device.iter().all(|photon| (0.0..=1.0).contains(&photon.weight)));
    }
}

/// Photons stored in a closed room are rho / (1 - rho) each on average, with the variance rho / (1 - rho)^2.
#[test]
fn a_thousand_bounces_store_a_geometric_series() {
    let gpu = device();
    for (albedo, bounces, photons) in [(0.75f32, 200, 100_001), (0.99, 2000, 10_001), (0.999, 9000, 1001)] {
        let settings = RoomSettings { reflectance: albedo, bounces, photons, mesh: 1, rng: Rng::Philox, ..RoomSettings::default() };
        let scene = closed_box(&settings, albedo);
        let mut ledgers = vec![("cpu", run_scene_on_cpu(&scene, &settings).ledger())];
        if let Some(gpu) = gpu.as_ref().filter(|_| bounces <= 2000) {
            ledgers.push(("device", run_scene(gpu, &scene, &settings).ledger()));
        }
        let rho = f64::from(albedo);
        let (mean, deviation) = (rho / (1.0 - rho), rho.sqrt() / (1.0 - rho));
        // What the cap takes: rho^(bounces + 1) / (1 - rho), far below the noise.
        let error = deviation / f64::from(photons).sqrt();
        assert!(rho.powi(bounces as i32 + 1) / (1.0 - rho) < 0.5 * error);
        for (builder, ledger) in ledgers {
            let found = ledger.stored as f64 / f64::from(photons);
            println!("{builder}, albedo {albedo}: {found} stored a photon, {mean} expected, z = {:.2}", (found - mean) / error);
            assert_eq!((ledger.escaped, ledger.dropped), (0, 0));
            assert_holds(builder, z_check("stored a photon", found, mean, error));
            assert_complains("five bounces", z_check("stored a photon", mean * (1.0 - rho.powi(5)), mean, error));
        }
    }
}

/// 1e9 photons in one run: the share that the first flight stores, to 8e-5 of a closed form.
#[test]
#[ignore = "a billion photons take minutes on a software device"]
fn a_billion_photons_have_the_exact_share() {
    let Some(gpu) = device() else { return };
    let settings =
        RoomSettings { photons: 1_000_000_000, bounces: 1, mesh: 1, rng: Rng::Philox, builder: Builder::Ballot, ..RoomSettings::default() };
    let fates = &run(&gpu, &settings).fates[0];
    assert_eq!(fates.emitted, 1_000_000_000);
    assert_holds("first bounce", share_check("stored", fates.bounces[0].stored, fates.emitted, 0.586_425_3));
}

fn over_plane(kind: LightKind) -> Scene {
    let mut plane = scene("point-over-plane");
    plane.lights = vec![lamp(kind)];
    plane
}

/// One photon of 1 W within the radius: 1 / (pi r^2) there, nothing elsewhere, whatever kernel is flat.
#[test]
fn a_map_of_one_photon_is_one_disc() {
    let Some(gpu) = device() else { return };
    let close = disc(DVec3::Y * 1e-3, DVec3::NEG_Y, 1e-3, EmissionLaw::Cosine);
    for radius in [0.05, 0.2, 1.0] {
        let points = [(DVec3::ZERO, DVec3::Y), (DVec3::X * 1.9, DVec3::Y), (DVec3::ZERO, DVec3::NEG_Y)];
        let result = received(&gpu, &over_plane(close.clone()), &kept(mapped(1, 1, 1, radius)), &points);
        let expected = 1.0 / (PI * radius * radius);
        // The area is known to 2^-24 of the squared radius, and some roundings of f32 follow.
        let check = |expected: f64| relative_check("one photon", red(&result, 0).0, expected, 16.0 * U);
        assert_holds(radius, check(expected));
        assert_eq!([result.film.mean(1), result.film.mean(2)], [DVec3::ZERO; 2], "radius {radius}");
        assert_complains("a radius 1 % too large", check(expected / 1.0201));
    }
}

fn furnace_settings(radius: f64) -> SceneSettings {
    kept(mapped(10_000, 2, 60, radius))
}

/// Weight functions integrate to 1, and none looks beyond its radius: a furnace is as bright by each, from all of the scene, twice
/// over, down to a two-hundredth of the distance between photons, at edges and in corners too. Notices 6 % where the radius is large.
#[test]
fn every_kernel_of_every_radius_integrates_to_one() {
    let rows: [(Kernel, &[f64]); 3] = [
        (Kernel::Box, &[2.0, 0.3, 0.002, 1.0, 0.01][..of_run(3, 5)]),
        (Kernel::Cone, &[2.0, 0.1]),
        (Kernel::Epanechnikov, &[2.0, 0.1][..of_run(1, 2)]),
    ];
    let Some(gpu) = device() else { return };
    let middle = |k: usize| (DVec3::new((k % 8) as f64 / 8.0 + 0.06, 0.0, (k / 8) as f64 / 8.0 + 0.06), DVec3::Y);
    let edges = |k: usize| (DVec3::new(if k.is_multiple_of(2) { 1e-4 } else { 1.0 - 1e-4 }, 0.0, k as f64 / 64.0 + 1e-3), DVec3::Y);
    let mut family = Family::default();
    for (kernel, radius) in rows.iter().flat_map(|(kernel, radii)| radii.iter().map(move |radius| (*kernel, *radius))) {
        // Points see other photons by small radii, and the same by large ones, for which a few points show as much.
        let is_small = radius < 0.05;
        let (photons, step) = if is_small { (15_000, 1) } else { (6000, 3) };
        let places = || (0..64).step_by(step);
        let points: Vec<_> = places().map(middle).chain(places().map(edges)).collect();
        let count = points.len() / 2;
        let settings = SceneSettings { kernel, photons, rounds: 16, ..furnace_settings(radius) };
        let result = received(&gpu, &scene("furnace"), &settings, &points);
        for (what, of) in [("middle", 0..count), ("edges", count..2 * count)] {
            let found: Vec<(f64, f64)> = of.map(|point| red(&result, point)).collect();
            let mean = found.iter().map(|(mean, _)| mean).sum::<f64>() / count as f64;
            let error =
                if is_small { found.iter().map(|(_, error)| error * error).sum::<f64>().sqrt() } else { found.iter().map(|of| of.1).sum() };
            let size = if radius < 1.0 { "" } else { "wide " };
            family.expect_estimate(format!("{kernel:?}, {size}radius {radius}, {what}"), mean, error / count as f64, 16, TAU);
        }
    }
    family.assert_detects(0.06, |what| what.contains("wide"));
    family.assert_detects(0.5, |what| !what.contains("0.002"));
}

/// Outside of what positions allow a radius is refused.
#[test]
fn radii_beyond_what_positions_allow_are_refused() {
    let Some(gpu) = device() else { return };
    let furnace = scene("furnace");
    let plan = |radius: f64| scene_plan(&gpu, &furnace, &furnace_settings(radius), Sensor::Receivers { count: 1 });
    let least = 1.0 / 32_768.0;
    assert!(plan(2.0).is_ok() && plan(least).is_ok());
    for radius in [2.0f64.next_up(), least.next_down(), 1e-23, f64::MIN_POSITIVE, 1e30, f64::NAN, f64::INFINITY, 0.0, -0.1] {
        assert!(plan(radius).unwrap_err().to_string().starts_with("`radius`"), "{radius}");
    }
    // Where no photon is in reach of any point there is nothing, and no division by it.
    let result = received(&gpu, &furnace, &furnace_settings(least), &[(DVec3::new(0.5, 0.0, 0.5), DVec3::Y)]);
    assert!(result.film.mean(0).is_finite());
}

/// Without correction an estimate at an edge is dark by the share of the disc beyond it, a half on the edge and
/// three quarters in a corner; with it, by nothing. The same photons show both.
#[test]
fn edges_and_corners_are_dark_by_what_lies_beyond_them() {
    let Some(gpu) = device() else { return };
    let radius = 0.2;
    let at = |x: f64, z: f64| (DVec3::new(x * radius, 0.0, z * radius), DVec3::Y);
    let places = [(0.0, 2.5), (0.25, 2.5), (0.5, 2.5), (0.75, 2.5), (1.0, 2.5), (2.5, 2.5), (0.0, 0.0), (0.5, 0.5), (0.8, 0.8), (0.3, 0.9)];
    let points: Vec<_> = places.iter().map(|(x, z)| at(*x, *z)).collect();
    let result_of =
        |edge_correction| received(&gpu, &scene("furnace"), &SceneSettings { edge_correction, ..furnace_settings(radius) }, &points);
    let (with, without) = (result_of(true), result_of(false));
    let mut worst = 0.0f64;
    for (place, (x, z)) in places.iter().enumerate() {
        let share = disc_rectangle_area(1.0, [-x, 5.0 - x], [-z, 5.0 - z]) / PI;
        let ratio = red(&without, place).0 / red(&with, place).0;
        worst = worst.max((ratio / share - 1.0).abs());
        // Where a wall ends a disc, its last ten-thousandth is left out, with its photons.
        assert_holds(format!("{x}, {z} radii from the walls"), relative_check("share", ratio, share, 3e-4));
        assert_complains("a share 0.1 % larger", relative_check("share", 1.001 * ratio, share, 3e-4));
    }
    println!("covered shares off by {worst:.1e} at most");
}

/// What a device could hold at most: buffers are ranges of 32 bits.
fn vast() -> Limits {
    Limits {
        buffer_bytes: u64::MAX / 4,
        memory_bytes: u64::MAX / 4,
        pair_tests_per_submission: u64::MAX / 1024,
        busy_invocations: 1 << 17,
        loop_iterations: 1 << 14,
        lanes: 32,
        ..Limits::of_host()
    }
}

/// photons * bounces beyond 2^32: every chunk's slots are numbered within 32 bits, whatever is asked, and the split
/// comes where the next photon's would not be.
#[test]
fn slots_of_a_chunk_are_numbered_in_32_bits() {
    let one_chunk = RoomSettings { photons: 1 << 31, chunk: Some(1 << 31), rng: Rng::Philox, ..RoomSettings::default() };
    let planned = |settings: &RoomSettings, limits: &Limits| RoomPlan::new(&open_box(settings), settings, limits);
    let plan = |photons: u32, bounces: u32, limits: &Limits| {
        let naive = RoomSettings { builder: Builder::Naive, mesh: 1, ..one_chunk.clone() };
        planned(&RoomSettings { photons, bounces, ..naive }, limits).unwrap()
    };
    let check = |plan: &RoomPlan, limits: &Limits| {
        let slots = u64::from(plan.path_capacity) * u64::from(plan.settings.bounces);
        assert!(slots <= u64::from(u32::MAX) && u64::from(plan.photon_capacity) == slots, "{slots} slots");
        assert!(slots * size_of::<StoredPhoton>() as u64 <= limits.buffer_bytes);
        assert!(u64::from(plan.path_capacity) * u64::from(plan.chunks_per_round) >= u64::from(plan.settings.photons));
    };
    for bounces in [1, 2, 15, 1000, 10_000] {
        for photons in [2, 300_000_000, (1 << 31) - 1, 1 << 31] {
            check(&plan(photons, bounces, &vast()), &vast());
        }
    }
    // Gaps of several counters reach up to the end of a work group.
    for (counters, group_size) in [(None, 32), (None, 1024), (Some(64), 1024), (Some(2), 128)] {
        for (bounces, limits) in [(1, vast()), (15, vast()), (10_000, vast()), (15, Limits { buffer_bytes: 1 << 32, ..vast() })] {
            let limits = Limits { counters: 8, ..limits };
            let plan = planned(&RoomSettings { bounces, group_size, counters, ..one_chunk.clone() }, &limits).unwrap();
            check(&plan, &limits);
            let is_wanted = counters.is_some() || plan.path_capacity >= 1 << 21;
            assert_eq!(plan.counters > 1, is_wanted, "{bounces} bounces, {counters:?} counters");
            assert!(!is_wanted || plan.path_capacity.is_multiple_of(group_size), "{bounces} bounces, groups of {group_size}");
        }
    }
    // 2^32 - 1 slots of 15 bounces; a chunk keeps room for a photon more of each of the two lights.
    let most = u32::MAX / 15 - 2;
    assert_eq!((most, plan(most, 15, &vast()).chunks_per_round), (286_331_151, 1));
    assert_eq!(plan(most + 1, 15, &vast()).chunks_per_round, 2);
    // And where a buffer of 2^27 bytes ends: 559 240 photons of 15 slots of 16 bytes.
    let small = Limits { buffer_bytes: 1 << 27, ..vast() };
    let most = (1 << 27) / 16 / 15 - 2;
    assert_eq!((most, plan(most, 15, &small).chunks_per_round), (559_238, 1));
    assert_eq!(plan(most + 1, 15, &small).chunks_per_round, 2);
    check(&plan(1 << 31, 15, &small), &small);
    // Room for fewer than two photons is an error that names the bounces.
    let none = Limits { buffer_bytes: 3 * 16 * 15, ..vast() };
    let settings = RoomSettings { mesh: 1, ..RoomSettings::default() };
    assert!(planned(&settings, &none).unwrap_err().to_string().starts_with("`bounces`"));
}

/// The same for maps of scenes of triangles.
#[test]
fn maps_of_a_chunk_are_numbered_in_32_bits() {
    let furnace = scene("furnace");
    // A storage buffer's range is a 32-bit number of bytes.
    for buffer_bytes in [1 << 27, u64::from(u32::MAX)] {
        let limits = Limits { buffer_bytes, ..vast() };
        for bounces in [1, 2, 15, 10_000] {
            for photons in [1, 300_000_000, 1 << 31] {
                let settings = SceneSettings { photons, bounces, illumination: Illumination::Photons, ..by_rounds() };
                let plan = scene_plan_within(&limits, &furnace, &settings, Sensor::Receivers { count: 1 }).unwrap();
                let map = plan.global.as_ref().unwrap();
                // More bounces go in segments.
                let landings = u64::from(map.chunk_photons) * u64::from(bounces.min(SEGMENT_BOUNCES));
                assert!(u64::from(map.capacity) == landings && landings <= u64::from(u32::MAX), "{landings} landings");
                assert!(landings * size_of::<MapPhoton>() as u64 <= buffer_bytes);
                let covered: u64 = map.chunks().map(|(_, count)| u64::from(count)).sum();
                assert_eq!(covered, u64::from(photons));
                let (first, count) = map.chunks().last().unwrap();
                assert_eq!(u64::from(first) + u64::from(count), u64::from(photons));
            }
        }
    }
    // Pictures up to what a buffer holds, and one row more.
    let limits = Limits { buffer_bytes: 1 << 27, ..vast() };
    let settings = SceneSettings { photons: 1, ..by_rounds() };
    let size = |width, height| scene_plan_within(&limits, &furnace, &settings, Sensor::Picture { width, height });
    assert!(size(1, 1).is_ok() && size(65_536, 1).is_ok());
    // Film sums and estimates take 48 bytes per pixel.
    let rows = (1 << 27) / 48 / 1024;
    assert!(size(1024, rows).is_ok());
    assert!(size(1024, rows + 1).unwrap_err().to_string().starts_with("`size`"));
}

/// One group more than a row of 65 535 of them: photons of the second row fly, land and are looked up too.
#[test]
fn photons_of_a_second_row_of_groups_reach_the_map() {
    let Some(gpu) = device() else { return };
    let photons = 65_535 * 32 + 33;
    let settings = SceneSettings { group_size: 32, ..mapped(photons, 1, 1, 0.01) };
    let points = [(DVec3::new(0.5, 0.0, 0.5), DVec3::Y), (DVec3::new(0.5, 0.5, 0.0), DVec3::Z)];
    // A software device counts less memory than it has.
    let limits = Limits { memory_bytes: 1 << 33, ..engine::limits(gpu.facts()) };
    let result_of = |settings: &SceneSettings| received_within(&gpu, &scene("furnace"), settings, &points, &limits);
    let whole = result_of(&settings);
    assert_eq!(whole.plan.global.as_ref().unwrap().chunk_photons, photons, "the photons do not fit one dispatch here");
    let split = result_of(&SceneSettings { chunk: Some(1_000_003), ..settings.clone() });
    assert_eq!((&whole.film, &whole.fates), (&split.film, &split.fates));
    let first = &whole.fates[0].bounces[0];
    assert_eq!(first.stored + first.absorbed + first.escaped, u64::from(photons));
}

/// Pictures of one pixel, of odd sides and of one long row, by usual and large work groups.
/// Direct light needs no photons, and several samples for light in a picture's only pixel.
#[test]
fn pictures_of_any_shape_are_whole() {
    let Some(gpu) = device() else { return };
    let cornell = scene("cornell");
    let camera = cornell.cameras[0].clone();
    for (part, samples) in [(Part::Direct, 16), (Part::All, 1)].into_iter().take(of_run(1, 2)) {
        for size in [[1, 1], [63, 65], [4097, 1], [1, 129]] {
            let of = |group_size| {
                let settings = SceneSettings { group_size, photons: 2000, rounds: 1, shadow_rays: 1, part, samples, ..by_rounds() };
                seen(&gpu, &cornell, &settings, &camera, size).film
            };
            let expected = of(128);
            assert_eq!(expected.pixels() as u32, size[0] * size[1]);
            let lit_pixels = expected.sums.chunks(3).filter(|pixel| pixel.iter().any(|sum| *sum > 0)).count();
            // The camera sees past the room on a wide picture, and nothing but the room on a square one.
            assert!(lit_pixels > 0 && (size[0] > 1000 || lit_pixels > expected.pixels() / 2), "{size:?}: {lit_pixels} pixels are lit");
            assert!(of(1024) == expected, "{size:?}, work groups of 1024");
        }
    }
}

/// Sums of a run with every gather stay numbers and closed at once: the smallest and the largest of everything that
/// the paper's box takes.
#[test]
fn the_ends_of_every_setting_give_numbers() {
    let gpu = device();
    let base = RoomSettings { photons: 2, mesh: 3, rng: Rng::Philox, ..RoomSettings::default() };
    let ends = [
        ("least photons", base.clone()),
        ("least lamps", RoomSettings { light_radius: f64::MIN_POSITIVE, photons: 101, ..base.clone() }),
        ("largest lamps", RoomSettings { light_radius: 0.25, photons: 101, ..base.clone() }),
        ("least radius", RoomSettings { radius: 0.5 / 65_536.0, photons: 101, ..base.clone() }),
        ("largest radius", RoomSettings { radius: 0.5, photons: 101, ..base.clone() }),
        ("far eye", RoomSettings { eye: [1e15, -1e15, 1e15], shininess: [Some(5.0); 5], photons: 101, ..base.clone() }),
        ("eye in a corner", RoomSettings { eye: [-0.25; 3], shininess: [Some(1e4); 5], photons: 101, ..base.clone() }),
        ("largest exponent", RoomSettings { shininess: [Some(f32::MAX); 5], photons: 101, ..base.clone() }),
        ("least exponent", RoomSettings { shininess: [Some(f32::MIN_POSITIVE); 5], photons: 101, ..base.clone() }),
        ("white walls", RoomSettings { reflectance: 1.0, bounces: 300, photons: 101, ..base.clone() }),
        ("black walls", RoomSettings { reflectance: 0.0, photons: 101, ..base }),
    ];
    for (what, settings) in ends {
        for gather in [Gather::Grid, Gather::Brute] {
            let settings = RoomSettings { gather, ..settings.clone() };
            let mut results = vec![run_on_cpu(&settings)];
            results.extend(gpu.as_ref().map(|gpu| run(gpu, &settings)));
            for result in results {
                assert!(result.ledger().closes(), "{what}");
                for wall in estimate_walls(&result.film, &open_box(&settings), &result.plan) {
                    let values = wall.illumination.iter().chain(&wall.radiosity);
                    assert!(values.clone().all(|value| value.is_finite() && *value >= 0.0), "{what}, {gather:?}: {}", wall.name);
                    // Black walls have no radiosity to divide by an albedo of nothing.
                    if settings.reflectance > 0.0 {
                        assert!(wall.irradiance.iter().all(|value| value.is_finite()), "{what}, {gather:?}: {}", wall.name);
                    }
                }
            }
        }
    }
}

/// A spot's light falls off by one law down to half angles of a thousandth of a degree: on its axis and between its cones,
/// from shadow rays against the closed form, and as a power that photons bring.
#[test]
fn narrow_spots_emit_as_wide_ones() {
    let Some(gpu) = device() else { return };
    let position = DVec3::new(0.25, 1.0, -0.5);
    let (down, aslant) = (("straight down", DVec3::NEG_Y), ("aslant", DVec3::new(0.3, -1.0, 0.2).normalize()));
    for (what, direction, angles) in [(down.0, down.1, &[10.0, 0.1, 0.001][..]), (aslant.0, aslant.1, &[1.0, 0.05, 0.01, 0.001][..])] {
        for &degrees in angles {
            let outer_angle = f64::to_radians(degrees) as f32;
            let (inner, outer) = (0.5 * f64::from(outer_angle), f64::from(outer_angle));
            let inner_angle = inner as f32;
            let spot = over_plane(LightKind::Spot { position, direction, intensity: Vec3::ONE, inner_angle, outer_angle });
            let versine = |angle: f64| 2.0 * (0.5 * angle).sin().powi(2);
            let falloff = |angle: f64| ((versine(outer) - versine(angle)) / (versine(outer) - versine(inner))).clamp(0.0, 1.0).powi(2);
            // Where rays at an angle from the axis meet the plane, and the irradiance there.
            let across = direction.any_orthonormal_vector();
            let place = |angle: f64| {
                let way = angle.cos() * direction + angle.sin() * across;
                let distance = -1.0 / way.y;
                (position + distance * way, -way.y / distance.powi(2) * falloff(angle))
            };
            let shares = [0.0, 0.25, 0.45, 0.6, 0.75, 0.9, 1.1];
            let places = shares.map(|share| place(share * outer));
            let settings = kept(SceneSettings { rounds: 2, part: Part::Direct, ..by_rounds() });
            let result = received(&gpu, &spot, &settings, &places.map(|(point, _)| (point, DVec3::Y)));
            // Single precision knows a direction to 1e-7 radians.
            let tolerance = 2e-5 + 1e-7 * 8.0 / outer;
            for (k, (_, exact)) in places.iter().enumerate() {
                let found = red(&result, k).0;
                println!("{what}, {degrees} degrees, at {} of them: {found:.6}, {exact:.6} is right", shares[k]);
                assert!((found - exact).abs() <= tolerance, "{what}, {degrees} degrees, at {} of them: {found}, not {exact}", shares[k]);
            }

            // Within its whole disc, a photon map holds the spot's power.
            let radius = 1.2 * place(outer).0.distance(place(0.0).0).max(2e-4);
            let result = received(&gpu, &spot, &kept(mapped(1000, 2, 1, radius)), &[(place(0.0).0, DVec3::Y)]);
            let exact = 2.0 * PI * (versine(inner) + (versine(outer) - versine(inner)) / 3.0) / (PI * radius * radius);
            assert_holds(format!("{what}, {degrees} degrees"), relative_check("power", red(&result, 0).0, exact, 1e-5));
        }
    }
}

/// Points on a floor that touches emissive walls, at distances around what single precision distinguishes.
#[test]
fn walls_light_the_points_that_touch_them() {
    let Some(gpu) = device() else { return };
    let distances = [0.0, 1e-8, 1e-7, 1e-6, 3e-6, 1e-5, 1e-4];
    for textured in [false, true].into_iter().take(of_run(1, 2)) {
        let mut family = Family::default();
        let mut check = |what: &str, scene: &Scene, points: &[(DVec3, DVec3)], expected: &dyn Fn(DVec3) -> f64| {
            // With textures, one set of kernels for both scenes.
            let with = if textured { vec![Effect::Textures] } else { vec![] };
            let settings = kept(SceneSettings { rounds: 16, shadow_rays: 64, part: Part::Direct, with, ..by_rounds() });
            let result = received(&gpu, scene, &settings, points);
            for (k, (point, _)) in points.iter().enumerate() {
                let ((found, error), exact) = (red(&result, k), expected(*point));
                println!("{what}, {point}: {found:.4} +- {error:.4}, {exact:.4} is right");
                family.expect_estimate(format!("{what}, {point}"), found, error.max(2e-3 * exact), settings.rounds, exact);
            }
        };
        let on = |place: fn(f64) -> DVec3, normal: DVec3| distances.map(|distance| (place(distance), normal));
        // Every point of a furnace sees emissive walls wherever it looks.
        let furnace = scene("furnace");
        check("beside a wall", &furnace, &on(|d| DVec3::new(d, 0.0, 0.37), DVec3::Y), &|_| PI);
        check("in a corner", &furnace, &on(|d| DVec3::new(d, 0.0, d), DVec3::Y), &|_| PI);
        check("in an edge", &furnace, &on(|d| DVec3::new(1.0 - d, 0.6, 1.0), DVec3::NEG_Z), &|_| PI);

        // One wall, aslant to all axes.
        let turn = DQuat::from_euler(EulerRot::XYZ, 0.3, 0.7, -0.4);
        let lamp = Material { emission: Vec3::ONE, emission_texture: textured.then(|| TextureUse::of(0, 0)), ..matt(0.0) };
        let wall = Mesh::parallelogram("wall", DVec3::ZERO, turn * DVec3::Y, turn * DVec3::Z, 1);
        let floor = Mesh::parallelogram("floor", turn * DVec3::NEG_X, turn * DVec3::Z, turn * (DVec3::X * 2.0), 0);
        let textures = if textured { vec![texture(1, vec![Vec3::ONE], [Wrap::Clamp; 2])] } else { vec![] };
        let room = Scene { textures, ..scene_of(vec![wall, floor], vec![matt(0.0), lamp], vec![]) };
        let points = distances.map(|distance| (turn * DVec3::new(distance, 0.0, 0.4), turn * DVec3::Y));
        let exact = |point: DVec3| {
            let distance = (turn.inverse() * point).x.abs();
            // From a foot of the wall, one of its sides on either hand (Howell, configuration B-3).
            let half = |width: f64| width.atan2(distance) - distance / distance.hypot(1.0) * width.atan2(distance.hypot(1.0));
            0.5 * (half(0.4) + half(0.6))
        };
        check("a wall aslant", &room, &points, &exact);
        family.assert_detects(0.2, |_| true);
    }
}

/// Channels that are dim beside another are as bright as their share of it: light of a tinted lamp, and light that a
/// tinted wall reflects. The same photons carry all channels, so only rounding distinguishes them.
#[test]
fn channels_a_millionth_as_bright_are_right() {
    let Some(gpu) = device() else { return };
    let tint = Vec3::new(1.0, 8e-6, 3e-7);
    let mut lamp = scene("furnace");
    lamp.materials.iter_mut().for_each(|material| material.emission *= tint);
    let floor = Material::lambert("tinted", 0.5 * tint);
    let down =
        LightKind::Spot { position: DVec3::Y * 0.5, direction: DVec3::NEG_Y, intensity: Vec3::ONE, inner_angle: 0.5, outer_angle: 1.0 };
    let wall = scene_of(vec![level(0.0, [1.0; 2], true, 0), level(1.0, [1.0; 2], false, 1)], vec![floor, matt(0.0)], vec![down]);
    let photons = kept(SceneSettings { photons: 20_000, bounces: 4, rounds: 8, radius: Some(0.4), ..by_rounds() });
    let settings = |illumination, part| SceneSettings { illumination, part, ..photons.clone() };
    let of_lamp = (lamp, settings(Illumination::Photons, Part::All), DVec3::splat(0.5));
    let of_wall = (wall, settings(Illumination::Split, Part::Indirect), DVec3::Y * 0.5);
    for (what, (scene, settings, middle)) in [("a lamp", of_lamp), ("a wall", of_wall)] {
        let points: Vec<_> =
            grid(0.5, DVec3::NEG_Y, 3).into_iter().map(|(point, normal)| (middle + 0.8 * point + DVec3::Y * 0.1, normal)).collect();
        let runs: Vec<_> = (1..7).map(|seed| received(&gpu, &scene, &SceneSettings { seed, ..settings.clone() }, &points)).collect();
        // Of a point too few photons may be seen for a channel to be right, but not without its error saying so.
        let off = |result: &RunResult, point: usize, channel: usize| {
            let (mean, error) = (result.film.mean(point), result.film.stated_error(point));
            (mean[channel] - mean.x * f64::from(tint[channel])).abs() / error[channel]
        };
        let most_off =
            runs.iter().flat_map(|result| (0..points.len()).flat_map(move |point| [1, 2].map(|channel| off(result, point, channel))));
        let most_off = most_off.fold(0.0, f64::max);
        assert!(most_off < 3.0, "{what}: {most_off} stated errors beside the bright channel");
        let sums: Vec<DVec3> = runs.iter().map(|result| means(result).iter().sum()).collect();
        for channel in [1, 2] {
            let shares: Vec<f64> = sums.iter().map(|sum| sum[channel] / (sum.x * f64::from(tint[channel]))).collect();
            let (share, error) = mean_and_error(&shares);
            println!("{what}, channel {channel}: {share:.4} +- {error:.4} of what is right");
            assert!(error < 0.02, "{what}: {share} +- {error}");
            assert_holds(format!("{what}, channel {channel}"), z_check("share", share, 1.0, error.max(1e-6)));
        }
    }
}

/// The same in a picture, where a channel lies below the film's unit: also if the run ends after a few rounds, which hardly ever
/// see it.
#[test]
fn channels_below_the_films_unit_are_right() {
    let Some(gpu) = device() else { return };
    let tint = DVec3::new(1.0, 2e-7, 3e-8);
    let mut plane = scene("sky-over-plane");
    plane.materials[0].base_colour = tint.as_vec3();
    let camera = Camera::looking_at("above", DVec3::Y * 1.5, DVec3::ZERO, DVec3::Z, 0.1);
    for (rounds, done) in [(64, 64), (1 << 20, 4)] {
        let stop = Stop { photons: Some(u64::from(done)), ..Stop::default() };
        let settings = SceneSettings { photons: 1, rounds, shadow_rays: 1, samples: 1, stop, ..kept(by_rounds()) };
        let result = seen(&gpu, &plane, &settings, &camera, [16, 16]);
        assert_eq!(result.film.rounds, done);
        let pixels = result.film.pixels();
        for channel in 0..3 {
            let (exact, means) = (tint[channel], means(&result));
            let errors: Vec<f64> = (0..pixels).map(|pixel| result.film.standard_error(pixel)[channel]).collect();
            let found = means.iter().map(|mean| mean[channel]).sum::<f64>() / pixels as f64;
            let error = errors.iter().map(|error| error.powi(2)).sum::<f64>().sqrt() / pixels as f64;
            println!("channel {channel}: {found:e} +- {error:e}, {exact:e} is right, a unit is {:e}", 1.0 / result.plan.film.scale);
            assert!(rounds > done || error < 0.05 * exact);
            assert_holds(channel, z_check("radiance", found, exact, error.max(1e-6 * exact)));
            let off = means.iter().zip(&errors).map(|(mean, error)| (mean[channel] - exact).abs() / error.max(1e-6 * exact));
            let most_off = off.fold(0.0, f64::max);
            assert!(most_off < 6.0, "channel {channel}: a pixel is {most_off} stated errors off");
        }
    }
}
