//! The kd-tree: the film that it gives is that of the grid and of brute force, to the bit; and `--nearest` takes the
//! photons that f64 finds by looking at all of them, whatever order they come in.

use crate::common::prelude::*;
use crate::tests::engine::film::{assert_same, few_effects, film, gathered_on_cpu, gathered_on_gpu};
use photonmill::engine::film::BlockSums;
use photonmill::engine::room::film::{RoomFilm, estimate_walls};

fn by_tree(settings: &RoomSettings) -> RoomSettings {
    RoomSettings { gather: Gather::KdTree, ..settings.clone() }
}

/// Settings whose photon map holds a list of photons.
fn room_for(photons: &[Photon], settings: &RoomSettings) -> RoomSettings {
    let photons = (photons.len() as u32).max(2);
    RoomSettings { photons, bounces: 1, chunk: Some(photons), rng: Rng::Philox, ..settings.clone() }
}

/// Photons at random places of all walls, and some on the same coordinate, the same place, and in corners.
fn scattered(count: u32) -> Vec<Photon> {
    (0..count)
        .map(|photon| {
            let words = philox([photon, 0, 0, 0], [1, 2]);
            let along = |word: u32| (word >> 8) as f32 / (1 << 24) as f32 * 0.5 - 0.25;
            let wall = words[0] % 5;
            let axis = wall as usize / 2;
            let mut position = Vec3::ZERO;
            position[axis] = if wall % 2 == 1 { 0.25 } else { -0.25 };
            position[(axis + 1) % 3] = if words[3].is_multiple_of(7) { 0.125 } else { along(words[1]) };
            position[(axis + 2) % 3] = match words[3] % 11 {
                0 => -0.25,
                1 => 0.03,
                _ => along(words[2]),
            };
            let (flux, weight) = (((words[3] >> 8) % 1000 + 1) as f32 / 1000.0, (words[3] >> 20) as f32 / 4096.0);
            Photon { position, wall, flux, weight, photon, bounce: 0 }
        })
        .collect()
}

/// Two channels, so that flux and weight are both seen.
fn two_channels() -> RoomSettings {
    RoomSettings { mesh: 13, shininess: [Some(2.0); 5], ..RoomSettings::default() }
}

#[test]
fn the_tree_gives_the_films_of_brute_force_for_every_number_of_photons() {
    let gpu = device();
    for count in [0, 1, 2, 7, 8, 9, 40, 41, 640, 5000] {
        let map = scattered(count);
        for radius in [0.5 / 65_536.0, 0.003, 0.05, 0.5] {
            let settings = room_for(&map, &RoomSettings { radius, ..two_channels() });
            let expected = gathered_on_cpu(&plan_for_host(&RoomSettings { gather: Gather::Brute, ..settings.clone() }), &map);
            let settings = by_tree(&settings);
            let what = format!("{count} photons, radius {radius}");
            assert_holds(format!("CPU, {what}"), equal_sums("film", &gathered_on_cpu(&plan_for_host(&settings), &map), &expected));
            if let Some(gpu) = &gpu {
                assert_holds(format!("GPU, {what}"), equal_sums("film", &gathered_on_gpu(gpu, &settings, &map), &expected));
            }
        }
    }
}

#[test]
fn builders_and_splits_give_the_bits_of_the_grid() {
    let Some(gpu) = device() else { return };
    for (half, (what, settings)) in few_effects().into_iter().enumerate().skip(of_run(1, 0)) {
        let expected = film(&gpu, &settings);
        assert!(expected.sums.iter().filter(|sum| **sum > 0).count() > expected.sums.len() / 2);
        for (place, builder) in Builder::ON_GPU.into_iter().enumerate().skip(half).step_by(2) {
            let (group_size, chunk, counters) = [(32, None, None), (128, Some(301), Some(4)), (1024, Some(1024), Some(16))][place % 3];
            let group_size = group_size.min(gpu.facts().work_group_size);
            let found = film(&gpu, &RoomSettings { builder, group_size, counters, chunk, ..by_tree(&settings) });
            assert_same(what, &format!("{builder:?}, groups of {group_size}"), &found, &expected);
        }
        let settings = RoomSettings { threads: 2, ..settings };
        assert_same(what, "CPU", &run_on_cpu(&by_tree(&settings)).film, &run_on_cpu(&settings).film);
    }
    // Nothing is stored in a black box, and the whole line still runs.
    for builder in [Builder::Persistent, Builder::Naive].into_iter().take(of_run(1, 2)) {
        let black = by_tree(&RoomSettings { reflectance: 0.0, builder, mesh: 8, ..RoomSettings::default() });
        assert!(film(&gpu, &black).sums.iter().all(|sum| *sum == 0));
        assert!(film(&gpu, &RoomSettings { nearest: Some(5), ..black }).sums.iter().all(|sum| *sum == 0));
    }
}

/// More photons in reach than lavapipe loops.
#[test]
fn long_lists_are_gathered_to_the_end() {
    let Some(gpu) = device() else { return };
    let map: Vec<Photon> =
        scattered(80_000).into_iter().map(|photon| Photon { wall: 4, position: photon.position.with_z(-0.25), ..photon }).collect();
    let settings = room_for(&map, &RoomSettings { radius: 0.5, mesh: 3, ..by_tree(&two_channels()) });
    let expected = gathered_on_cpu(&plan_for_host(&RoomSettings { gather: Gather::Brute, ..settings.clone() }), &map);
    let found = gathered_on_gpu(&gpu, &settings, &map);
    assert_holds("80 000 photons", equal_sums("film", &found, &expected));
    let cut_short = gathered_on_cpu(&plan_for_host(&settings), &map[..65_535]);
    assert_complains("a list that ends early", equal_sums("film", &cut_short, &expected));
}

/// Flux of the nearest photons scaled to the disc of the radius, from the description alone: all photons of the wall
/// sorted by their distance in f64.
fn expected_flux(plan: &RoomPlan, photons: &[Photon], nearest: usize, point: usize) -> [f64; 2] {
    let settings = &plan.settings;
    let scene = open_box(settings);
    let (position, wall) = (plan.points[point].position.as_dvec3(), plan.points[point].wall);
    let mut near: Vec<(f64, &Photon)> = photons
        .iter()
        .filter(|photon| photon.wall == wall)
        .map(|photon| (photon.position.as_dvec3().distance(position), photon))
        .filter(|(distance, _)| *distance <= settings.radius)
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1.photon, a.1.bounce).cmp(&(b.1.photon, b.1.bounce))));
    let mut factor = 1.0;
    if near.len() >= nearest {
        let rectangle = scene.rectangle(wall as usize);
        let inside: DVec3 = position - rectangle.origin;
        let (s, t) = (inside.dot(rectangle.u) / rectangle.u.length_squared(), inside.dot(rectangle.v) / rectangle.v.length_squared());
        let farthest = near[nearest - 1].0.max(settings.radius / 1024.0);
        factor = rectangle.covered_area(s, t, settings.radius) / rectangle.covered_area(s, t, farthest);
        near.truncate(nearest - 1);
    }
    [near.iter().map(|(_, photon)| f64::from(photon.flux)).sum(), near.iter().map(|(_, photon)| f64::from(photon.weight)).sum::<f64>()]
        .map(|sum| sum * factor)
}

fn nearest_check(plan: &RoomPlan, photons: &[Photon], nearest: usize, sums: &[u64]) -> Check {
    for point in 0..plan.points.len() {
        for (channel, expected) in expected_flux(plan, photons, nearest, point).into_iter().enumerate() {
            let found = sums[point * 2 + channel] as f64 / plan.film_scale();
            let is_right = (found - expected).abs() <= 1e-5 * expected + 1.0 / plan.film_scale();
            require(is_right, || format!("point {point}, channel {channel}: {found} instead of {expected}"))?;
        }
    }
    Ok(())
}

#[test]
fn the_nearest_photons_are_those_that_f64_finds() {
    let gpu = device();
    for (count, radius) in [(0, 0.05), (1, 0.5), (3, 0.5), (30, 0.5), (1000, 0.05), (1000, 0.5), (6000, 0.2)] {
        let map = scattered(count);
        for nearest in [2, 3, 10, 64, 1000] {
            let settings = RoomSettings { nearest: Some(nearest), radius, mesh: 5, ..by_tree(&two_channels()) };
            let settings = room_for(&map, &settings);
            let plan = plan_for_host(&settings);
            let what = format!("{nearest} of {count} photons, radius {radius}");
            let on_cpu = gathered_on_cpu(&plan, &map);
            assert_holds(format!("CPU, {what}"), nearest_check(&plan, &map, nearest as usize, &on_cpu));
            if count == 1000 && radius == 0.5 && (10..100).contains(&nearest) {
                assert_complains("one photon more", nearest_check(&plan, &map, nearest as usize + 1, &on_cpu));
                assert_complains("photons missing", nearest_check(&plan, &map[10..], nearest as usize, &on_cpu));
            }
            if let Some(gpu) = &gpu {
                for math in [Math::Fast, Math::Strict] {
                    let found = gathered_on_gpu(gpu, &RoomSettings { math, ..settings.clone() }, &map);
                    assert_holds(format!("GPU, {math:?}, {what}"), nearest_check(&plan, &map, nearest as usize, &found));
                    if math == Math::Strict {
                        assert_holds(format!("GPU, {what}"), equal_sums("film", &found, &on_cpu));
                    }
                }
            }
        }
    }
}

/// Photons on rings, so that many are equally far, and many at the same place; they differ in flux, so it matters
/// which are taken.
#[test]
fn ties_are_broken_by_the_photons_number_in_any_order() {
    let gpu = device();
    let pitch = 0.5 / 8.0;
    let map: Vec<Photon> = (0..900)
        .map(|photon| {
            // On the texels' own lattice every distance is exact.
            let (x, y) = ((photon % 5) as f32 - 2.0, (photon / 5 % 5) as f32 - 2.0);
            let (flux, weight) = ((photon % 97 + 1) as f32 / 97.0, 1.0 / (photon % 13 + 1) as f32);
            Photon { flux, weight, bounce: photon % 3, ..on_back_wall((x + 0.5) * pitch, (y + 0.5) * pitch, photon / 3) }
        })
        .collect();
    let reversed: Vec<Photon> = map.iter().rev().copied().collect();
    let mut shuffled = map.clone();
    shuffled.sort_by_key(|photon| philox([photon.photon, photon.bounce, 0, 0], [3, 4])[0]);
    for nearest in [2, 5, 37, 100, 901] {
        let settings = RoomSettings { nearest: Some(nearest), radius: 0.2, mesh: 8, math: Math::Strict, ..by_tree(&two_channels()) };
        let settings = room_for(&map, &settings);
        let plan = plan_for_host(&settings);
        let expected = gathered_on_cpu(&plan, &map);
        assert_holds(format!("nearest {nearest}"), nearest_check(&plan, &map, nearest as usize, &expected));
        for order in [&map, &reversed, &shuffled] {
            assert_holds("CPU", equal_sums("film", &gathered_on_cpu(&plan, order), &expected));
            if let Some(gpu) = &gpu {
                assert_holds("GPU", equal_sums("film", &gathered_on_gpu(gpu, &settings, order), &expected));
            }
        }
    }
    let renumbered: Vec<Photon> = map.iter().map(|photon| Photon { photon: 1000 - photon.photon, ..*photon }).collect();
    let plan = plan_for_host(&room_for(&map, &RoomSettings { nearest: Some(20), radius: 0.2, mesh: 8, ..by_tree(&two_channels()) }));
    assert_complains("other numbers", equal_sums("film", &gathered_on_cpu(&plan, &renumbered), &gathered_on_cpu(&plan, &map)));
}

/// Photons that are all equally far cannot be passed over, and a search takes more steps than a dispatch may.
#[test]
fn a_search_goes_on_for_as_long_as_it_takes() {
    let Some(gpu) = device() else { return };
    let at = |photon: u32| Photon { flux: (photon % 7 + 1) as f32 / 7.0, ..on_back_wall(0.01, 0.02, photon) };
    let map: Vec<Photon> = (0..70_000).rev().map(at).collect();
    for nearest in [2, 1024] {
        let settings = RoomSettings { nearest: Some(nearest), radius: 0.5, mesh: 2, math: Math::Strict, ..by_tree(&two_channels()) };
        let settings = room_for(&map, &settings);
        let expected = gathered_on_cpu(&plan_for_host(&settings), &map);
        assert!(expected.iter().any(|sum| *sum > 0));
        assert_holds(format!("nearest {nearest}"), equal_sums("film", &gathered_on_gpu(&gpu, &settings, &map), &expected));
    }
}

#[test]
fn builders_and_the_cpu_take_the_same_nearest_photons() {
    let Some(gpu) = device() else { return };
    let lesser = device_with(Options { without_int64_atomics: true, ..Options::default() }).unwrap();
    let glossy = [Some(2.0), None, Some(0.5), Some(0.01), Some(5.0)];
    for (nearest, rounds) in [(6, 2), (40, 1)].into_iter().take(of_run(1, 2)) {
        let uneven = RoomSettings { mesh: 33, shininess: glossy, light_power: [3.0, 0.2], ..RoomSettings::default() };
        let settings = RoomSettings { nearest: Some(nearest), rounds, math: Math::Strict, threads: 2, ..by_tree(&uneven) };
        let expected = run_on_cpu(&settings).film;
        for (place, builder) in Builder::ON_GPU.into_iter().enumerate().skip(rounds as usize % 2).step_by(2) {
            let other = RoomSettings { builder, group_size: [128, 32, 64][place % 3], ..settings.clone() };
            assert_same(&format!("{nearest} nearest"), other.builder.name(), &film(&gpu, &other), &expected);
        }
        assert_same(&format!("{nearest} nearest"), "32 bits", &film(&lesser, &settings), &expected);
        if !is_long_run() {
            continue;
        }
        let one_channel = RoomSettings { shininess: [None; 5], light_power: [1.0; 2], ..settings };
        let (found, expected) = (film(&gpu, &one_channel), run_on_cpu(&one_channel).film);
        assert_eq!(found.channel_count, 1);
        assert_same("one channel", "", &found, &expected);
    }
}

/// Evenly spread photons of unknown number (Poisson): the estimate is right on average, near edges and where the
/// radius ends the search too; the flux of all K would be K / (K - 1) times as much.
#[test]
fn the_estimate_has_no_bias() {
    for (nearest, radius) in [(4, 0.5), (10, 0.06), (10, 0.5), (60, 0.2)] {
        let settings = by_tree(&RoomSettings { nearest: Some(nearest), radius, mesh: 3, photons: 4000, ..RoomSettings::default() });
        let plan = RoomPlan { settings: RoomSettings { bounces: 1, ..settings.clone() }, ..plan_for_host(&settings) };
        let scene = open_box(&plan.settings);
        let rounds = 400;
        // By wall and round: mean of radiosity of its texels, corners, edges and middle.
        let means: Vec<f64> = (0..rounds)
            .map(|round| {
                // Photons of a larger sheet, of which the wall is a random sample: 2000 of a wall on average.
                let place = |photon: u32| {
                    let words = philox([photon, round, 0, 0], [5, 6]);
                    let along = |word: u32| (f64::from(word) / 2f64.powi(32) * 1.0 - 0.5) as f32;
                    on_back_wall(along(words[0]), along(words[1]), photon)
                };
                let map: Vec<Photon> =
                    (0..4000).map(place).filter(|photon| photon.position.truncate().abs().max_element() <= 0.25).collect();
                let of_blocks = BlockSums { sums: gathered_on_cpu(&plan, &map), ..BlockSums::default() };
                let film = RoomFilm { of_blocks, emitted: u64::from(settings.photons), ..RoomFilm::new(&plan) };
                let back = estimate_walls(&film, &scene, &plan).pop().unwrap();
                // 4000 photons a square metre at 2 W in all.
                back.radiosity.iter().sum::<f64>() / 9.0 / 2.0
            })
            .collect();
        let (mean, error) = mean_and_error(&means);
        assert!(error < 0.02, "{error}");
        assert_holds(format!("{nearest} nearest, radius {radius}"), z_check("light", mean, 1.0, error));
        assert_complains("the K-th photon counted", z_check("light", mean * f64::from(nearest) / f64::from(nearest - 1), 1.0, error));
    }
}

#[test]
fn plans_keep_a_round_together() {
    let settings = RoomSettings { photons: 300_000, rng: Rng::Philox, ..by_tree(&RoomSettings::default()) };
    let limits = Limits { pair_tests_per_submission: 1 << 25, ..Limits::of_host() };
    let plan = RoomPlan::new(&open_box(&settings), &settings, &limits).unwrap();
    assert!(plan.chunks_per_round > 1);
    let settings = RoomSettings { nearest: Some(10), ..settings };
    assert_eq!(RoomPlan::new(&open_box(&settings), &settings, &limits).unwrap().chunks_per_round, 1);
    let small = Limits { memory_bytes: 1 << 20, ..limits };
    let error = RoomPlan::new(&open_box(&settings), &settings, &small).unwrap_err().to_string();
    assert!(error.starts_with("`nearest` 10: searches the 300000 photons of a round at once"), "{error}");
}
