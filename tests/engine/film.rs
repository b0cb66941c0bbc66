//! Same bits: the film's integer sums do not depend on the builder, the gather, the work groups, the
//! split into dispatches, the run or the device's abilities, and hold exactly what lies in reach. Sums
//! of floats are checked against them.

use crate::common::prelude::*;
use photonmill::cpu;
use photonmill::cpu::tree::Tree;
use photonmill::engine::film::BlockSums;
use photonmill::engine::room;
use photonmill::engine::room::film::RoomFilm;

/// What changes the film's channels and its fixed point. A smaller mesh than the paper's, and no
/// multiple of a work group, keeps the brute gathers short.
fn effects() -> Vec<(&'static str, RoomSettings)> {
    let paper = RoomSettings { mesh: 19, ..RoomSettings::default() };
    let glossy = [Some(2.0), None, Some(0.5), Some(0.01), Some(5.0)];
    vec![
        ("Lambertian walls", paper.clone()),
        ("Phong walls", RoomSettings { shininess: glossy, ..paper.clone() }),
        ("lights of unequal power", RoomSettings { light_power: [3.0, 0.2], ..paper.clone() }),
        ("an odd number of photons", RoomSettings { photons: 4999, rng: Rng::Philox, ..paper.clone() }),
        ("several rounds", RoomSettings { photons: 1201, rounds: 4, shininess: glossy, light_power: [1.0, 2.0], radius: 0.025, ..paper }),
    ]
}

/// Those that differ most: one channel of one round, and two of several.
pub fn few_effects() -> Vec<(&'static str, RoomSettings)> {
    effects().into_iter().step_by(4).collect()
}

pub fn film(gpu: &Gpu, settings: &RoomSettings) -> RoomFilm {
    run(gpu, settings).film
}

pub fn assert_same(what: &str, how: &str, found: &RoomFilm, expected: &RoomFilm) {
    let what = format!("{what}, {how}");
    assert_eq!((found.channel_count, found.scale, found.emitted), (expected.channel_count, expected.scale, expected.emitted), "{what}");
    assert_holds(&what, equal_sums(&what, &found.sums, &expected.sums));
}

#[test]
fn runs_and_builders_and_gathers_give_the_same_bits() {
    let Some(gpu) = device() else { return };
    for (what, settings) in of_run(few_effects(), effects()) {
        let expected = film(&gpu, &settings);
        assert!(expected.sums.iter().filter(|sum| **sum > 0).count() > expected.sums.len() / 2, "{what}: a dark film proves nothing");
        for run in 1..10 {
            assert_same(what, &format!("run {run}"), &film(&gpu, &settings), &expected);
        }
        for builder in Builder::ON_GPU {
            for gather in [Gather::Grid, Gather::Brute] {
                let other = RoomSettings { builder, gather, ..settings.clone() };
                assert_same(what, &format!("{builder:?} {gather:?}"), &film(&gpu, &other), &expected);
            }
        }
    }
}

#[test]
fn work_groups_and_chunks_give_the_same_bits() {
    let Some(gpu) = device() else { return };
    for (what, settings) in of_run(few_effects(), effects()) {
        let expected = film(&gpu, &settings);
        let by = |place: usize| RoomSettings { builder: Builder::ON_GPU[place % Builder::ON_GPU.len()], ..settings.clone() };
        let gathers = [Gather::Grid, Gather::Brute];
        let group_sizes = [32, 64, 256, 512, 1024].into_iter().filter(|size| *size <= gpu.facts().work_group_size).enumerate();
        let groups = group_sizes.map(|(place, group_size)| RoomSettings { group_size, gather: gathers[place % 2], ..by(place) });
        // By the atomic builder, which all these settings have.
        let striped = |(counters, group_size, gather)| RoomSettings { counters: Some(counters), group_size, gather, ..settings.clone() };
        let counters = [(2, 128, Gather::Grid), (8, 64, Gather::Brute), (64, 32, Gather::Grid)].map(striped);
        let chunks = [301, 1024, 4998].into_iter().enumerate().map(|(place, chunk)| RoomSettings { chunk: Some(chunk), ..by(place) });
        for other in groups.chain(counters).chain(chunks) {
            let result = run(&gpu, &other);
            assert!(other.chunk.is_none_or(|chunk| result.plan.chunks_per_round == settings.photons.div_ceil(chunk)), "{what}, {other:?}");
            assert_same(what, &format!("{other:?}"), &result.film, &expected);
        }
    }
}

#[test]
fn a_device_without_abilities_gives_the_same_bits() {
    let Some(gpu) = device() else { return };
    for (without_int64_atomics, without_timestamps) in [(true, false), (false, true)] {
        let Some(lesser) = device_with(Options { without_int64_atomics, without_timestamps, ..Options::default() }) else { return };
        assert!(!(without_int64_atomics && lesser.facts().int64_atomics));
        for (what, settings) in effects() {
            let expected = film(&gpu, &settings);
            // Without timestamps the kernels are the same.
            let gathers: &[Gather] = if without_int64_atomics { &[Gather::Grid, Gather::Brute, Gather::KdTree] } else { &[Gather::Grid] };
            for &gather in gathers {
                let result = run(&lesser, &RoomSettings { gather, ..settings.clone() });
                assert_same(what, &format!("64-bit atomics masked: {without_int64_atomics}, {gather:?}"), &result.film, &expected);
                let rows = result.timings.rows();
                assert!(!rows.is_empty());
                if without_timestamps {
                    assert!(rows.iter().all(|row| row.gpu_ms.is_none()), "{rows:?}");
                    assert!(result.timings.row("run").unwrap().wall_ms.is_some());
                } else if lesser.facts().timestamp_bits != 0 {
                    assert!(result.timings.row("round/gather").unwrap().gpu_ms.is_some(), "{rows:?}");
                }
            }
        }
        if without_int64_atomics {
            pairs_are_refused(&lesser);
        }
    }
}

/// Of floats; single ones are not.
fn pairs_are_refused(lesser: &Gpu) {
    // An even number, so that both lights' photons are of the same flux and the sums whole.
    let settings = RoomSettings { photons: 1000, mesh: 8, ..RoomSettings::default() };
    let pairs = RoomSettings { sums: Sums::Compensated, ..settings.clone() };
    let error = room::on_gpu(lesser, &open_box(&pairs), &pairs, &mut Control::default()).unwrap_err();
    let line = error.to_string();
    assert_eq!(error.exit_code(), 2, "{line}");
    assert!(["`sums`", "compensated", "64-bit atomics", "integer or f32"].iter().all(|word| line.contains(word)), "{line}");
    let expected = film(lesser, &settings);
    assert_holds("f32", near(&film(lesser, &RoomSettings { sums: Sums::F32, ..settings }), &expected, |_| 0.0));
}

/// The CPU's gather of some photons: what the device's must equal, to the bit, as both test the same
/// f32 numbers.
pub fn gathered_on_cpu(plan: &RoomPlan, photons: &[Photon]) -> Vec<u64> {
    let mut sums = vec![0; plan.points.len() * plan.channel_count as usize];
    match (plan.settings.gather, plan.settings.nearest) {
        (Gather::KdTree, Some(count)) => {
            cpu::nearest::gather(plan, &open_box(&plan.settings), &Tree::build(photons), count, &mut sums);
        }
        (Gather::KdTree, None) => cpu::estimate::gather_tree(plan, &Tree::build(photons), &mut sums),
        _ => cpu::estimate::gather_brute(plan, photons, &mut sums),
    }
    sums
}

/// The device's gather of photons that are handed to it.
pub fn gathered_on_gpu(gpu: &Gpu, settings: &RoomSettings, photons: &[Photon]) -> Vec<u64> {
    gathered(gpu, &plan_for(gpu, &open_box(settings), settings), photons, 1, None)
}

/// Sum over all photons of the texels of their wall within the radius, counted photon by photon.
fn texels_in_reach(plan: &RoomPlan, photons: &[Photon]) -> u64 {
    let radius_squared = (plan.settings.radius * plan.settings.radius) as f32;
    let in_reach = |photon: &Photon| {
        let reached = plan.points.iter().filter(|point| {
            let offset = photon.position - point.position;
            // The kernels' order of operations, so that photons on the rim fall to the same side.
            point.wall == photon.wall && offset.x * offset.x + offset.y * offset.y + offset.z * offset.z <= radius_squared
        });
        reached.count() as u64
    };
    photons.iter().map(in_reach).sum()
}

fn mass_check(film: &RoomFilm, plan: &RoomPlan, photons: &[Photon]) -> Check {
    equal_sums("mass", &[film.sums.iter().sum()], &[texels_in_reach(plan, photons)])
}

/// And the sums hold every photon once for each texel in reach.
#[test]
fn device_and_cpu_gather_the_same_photons_to_the_same_bits() {
    let Some(gpu) = device() else { return };
    for (what, settings) in effects().into_iter().filter(|(_, settings)| settings.rounds == 1) {
        let map = photons(&gpu, &settings);
        for radius in [0.5 / 65_536.0, 0.003, 0.025, 0.05, 0.1, 0.5] {
            let settings = RoomSettings { radius, ..settings.clone() };
            let (plan, found) = (plan_for(&gpu, &open_box(&settings), &settings), film(&gpu, &settings));
            let how = format!("{what}, radius {radius}");
            assert_holds(&how, equal_sums("the device's film", &found.sums, &gathered_on_cpu(&plan, &map)));
            if what != "Lambertian walls" {
                continue;
            }
            // One sum a texel, of whole photons.
            assert_eq!((found.channel_count, found.scale), (1, 1.0));
            assert_holds(&how, mass_check(&found, &plan, &map));
            // Where every photon has a texel in reach, and a larger radius has more.
            if (0.02..0.2).contains(&radius) {
                assert_complains("a photon lost", mass_check(&found, &plan, &map[1..]));
                assert_complains("a photon doubled", mass_check(&found, &plan, &[&map[..], &map[..1]].concat()));
                let wider = RoomPlan { settings: RoomSettings { radius: 1.01 * radius, ..settings }, ..plan };
                assert_complains("a radius 1 % too large", mass_check(&found, &wider, &map));
            }
        }
    }
}

/// However many invocations share a point, and whether they share its candidates in slices: every photon counts once.
#[test]
fn lanes_and_slices_change_no_bit() {
    let cases = of_run::<&[_]>(&[(128, 0.5, 3)], &[(32, 0.05, 13), (128, 0.5, 3), (64, 0.003, 31)]);
    let Some(gpu) = device() else { return };
    for &(group_size, radius, mesh) in cases {
        let settings = RoomSettings { group_size, radius, mesh, shininess: [Some(2.0); 5], ..RoomSettings::default() };
        let plan = plan_for(&gpu, &open_box(&settings), &settings);
        let map = photons(&gpu, &settings);
        let expected = gathered_on_cpu(&plan, &map);
        for (lanes, slices_candidates) in [1, 2, 8, 32].into_iter().flat_map(|lanes| [(lanes, false), (lanes, true)]) {
            let plan = RoomPlan { lanes, slices_candidates, ..plan.clone() };
            let what = format!("{lanes} lanes, slices {slices_candidates}, groups of {group_size}, radius {radius}");
            assert_holds(what, equal_sums("film", &gathered(&gpu, &plan, &map, 1, None), &expected));
        }
        // One submission's work a point, so that dispatches are many.
        let plan = RoomPlan { lanes: 32, pair_tests_per_submission: 1, ..plan.clone() };
        assert_holds("a dispatch for every few points", equal_sums("film", &gathered(&gpu, &plan, &map, 1, None), &expected));
    }
}

/// A radius is inclusive, and in units of texels every number is exact, so that ties are ties.
#[test]
fn a_photon_on_the_rim_counts() {
    let gpu = device();
    let pitch = 0.5 / 64.0;
    let (centre, corner) = (on_back_wall(0.5 * pitch, 0.5 * pitch, 0), on_back_wall(0.0, 0.0, 0));
    // Twelve texels lie exactly 5 away (5 + 0 and 3 + 4), and would be missed by a strict test: 69.
    for (radius_in_texels, photon, expected) in [(5.0, centre, 81), (6.4, centre, 129), (3.2, centre, 37), (6.4, corner, 124)] {
        let settings = RoomSettings { radius: radius_in_texels * f64::from(pitch), ..RoomSettings::default() };
        let on_cpu = gathered_on_cpu(&plan_for_host(&settings), &[photon]);
        assert_eq!(on_cpu.iter().sum::<u64>(), expected, "radius of {radius_in_texels} texels");
        for gather in [Gather::Grid, Gather::Brute] {
            let Some(gpu) = &gpu else { continue };
            let on_gpu = gathered_on_gpu(gpu, &RoomSettings { gather, ..settings.clone() }, &[photon]);
            assert_holds(format!("{gather:?}"), equal_sums("one photon", &on_gpu, &on_cpu));
        }
    }
}

/// An empty map is dark; a single photon is one count within the radius and nothing outside, also in
/// the corner cells of the grid.
#[test]
fn an_empty_map_and_a_map_of_one() {
    let Some(gpu) = device() else { return };
    for gather in [Gather::Grid, Gather::Brute] {
        let settings = RoomSettings { gather, ..RoomSettings::default() };
        assert!(gathered_on_gpu(&gpu, &settings, &[]).iter().all(|sum| *sum == 0));
        let plan = plan_for(&gpu, &open_box(&settings), &settings);
        for (x, y) in [(0.25, 0.25), (-0.25, -0.25), (0.25, -0.25), (0.1, 0.25), (0.0, 0.0)] {
            let photon = on_back_wall(x, y, 0);
            let found = gathered_on_gpu(&gpu, &settings, &[photon]);
            assert_holds(format!("{gather:?}"), equal_sums("one photon", &found, &gathered_on_cpu(&plan, &[photon])));
            assert_eq!(found.iter().sum::<u64>(), texels_in_reach(&plan, &[photon]));
            assert!(found.iter().all(|sum| *sum <= 1) && found[..4 * 4096].iter().all(|sum| *sum == 0), "other walls stay dark");
        }
    }
    // Nothing is stored in a black box, and the whole line still runs.
    for builder in Builder::ON_GPU {
        let black = film(&gpu, &RoomSettings { reflectance: 0.0, builder, ..RoomSettings::default() });
        assert!(black.sums.iter().all(|sum| *sum == 0));
    }
}

/// A photon list far beyond the 65 535 iterations after which lavapipe leaves its loops.
#[test]
fn long_photon_lists_are_gathered_to_the_end() {
    let Some(gpu) = device() else { return };
    // Few points keep the brute gather short; what is long is the list.
    let many = RoomSettings { photons: 200_000, chunk: Some(200_000), rng: Rng::Philox, ..RoomSettings::default() };
    let settings = RoomSettings { mesh: 8, builder: Builder::Ballot, ..many };
    let map = photons(&gpu, &settings);
    assert!(map.len() > 290_000);
    let plan = plan_for(&gpu, &open_box(&settings), &settings);
    let expected = gathered_on_cpu(&plan, &map);
    for gather in [Gather::Brute, Gather::Grid] {
        let result = run(&gpu, &RoomSettings { gather, ..settings.clone() });
        assert_eq!(result.plan.photon_capacity, plan.photon_capacity);
        assert_holds(format!("{gather:?}"), equal_sums("200 000 photons", &result.film.sums, &expected));
    }
    // Every photon within reach of every point of its wall: a list of 60 000 for each, in many slices.
    let settings = RoomSettings { radius: 0.5, mesh: 2, ..settings };
    let plan = plan_for(&gpu, &open_box(&settings), &settings);
    let expected = gathered_on_cpu(&plan, &map);
    for (gather, builder) in [(Gather::Brute, Builder::Ballot), (Gather::Grid, Builder::Ballot), (Gather::Brute, Builder::Naive)] {
        let found = film(&gpu, &RoomSettings { gather, builder, ..settings.clone() });
        assert_holds(format!("{gather:?} {builder:?}, wide"), equal_sums("200 000 photons", &found.sums, &expected));
    }
    let cut_short = gathered_on_cpu(&plan, &map[..65_535]);
    let with_more = |more: u64| [&[expected[0] + more][..], &expected[1..]].concat();
    for (what, spoiled) in [("a list cut short", cut_short), ("one count more", with_more(1)), ("a carry too many", with_more(1 << 32))] {
        assert_complains(what, equal_sums("200 000 photons", &spoiled, &expected));
    }
}

/// Rounds are other photons each: what the second one adds is not what the first one did.
#[test]
fn a_run_is_the_sum_of_rounds_that_differ() {
    let Some(gpu) = device() else { return };
    for rng in [Rng::Rand48, Rng::Mt, Rng::Philox, Rng::Sobol] {
        let of = |rounds| film(&gpu, &RoomSettings { rng, rounds, ..RoomSettings::preset(Preset::Modified) });
        let (one, two, three) = (of(1), of(2), of(3));
        assert_eq!(three.emitted, 15_000);
        let added = |more: &RoomFilm, less: &RoomFilm| {
            pairs(&more.sums, &less.sums).map(|(more, less)| more.checked_sub(*less).unwrap()).collect::<Vec<u64>>()
        };
        let (second, third) = (added(&two, &one), added(&three, &two));
        for (what, found, other) in [
            ("second like the first", &second, &one.sums),
            ("third like the second", &third, &second),
            ("third like the first", &third, &one.sums),
        ] {
            assert_complains(&format!("{rng:?}: a round that repeats, {what}"), equal_sums("round", found, other));
        }
        // And each is as bright as the others but for noise: a round stores 7512 +- 141 photons, and
        // the film counts each some 115 times.
        let mass = |sums: &[u64]| sums.iter().sum::<u64>() as f64;
        for (what, sums) in [("second", &second), ("third", &third)] {
            let ratio = mass(sums) / mass(&one.sums);
            assert!((ratio - 1.0).abs() < 0.15, "{rng:?}: the {what} round is {ratio} of the first");
        }
    }
}

/// Many points with all photons in reach: the gather is cut into several dispatches and submissions,
/// and nothing is lost or added twice at the cuts.
#[test]
fn a_gather_that_is_cut_into_parts_is_whole() {
    let Some(gpu) = device() else { return };
    let settings = RoomSettings { photons: 301, mesh: 200, radius: 0.5, group_size: 32, rng: Rng::Philox, ..RoomSettings::default() };
    let grid = run(&gpu, &settings);
    let brute = run(&gpu, &RoomSettings { gather: Gather::Brute, ..settings.clone() });
    assert_holds("grid and brute", equal_sums("200 x 200 texels", &grid.film.sums, &brute.film.sums));
    let tests = grid.plan.points.len() as u64 * grid.plan.work.tests_per_point(settings.photons);
    let submissions_needed = tests / grid.plan.pair_tests_per_submission;
    assert!(grid.submissions > submissions_needed, "{} submissions for the work of {submissions_needed}", grid.submissions);
    if gpu.facts().kind == "cpu" {
        assert!(submissions_needed > 2, "the test must cut: {submissions_needed}");
    }
}

/// Sums in fixed-point units against others, within `allowed`.
fn near(found: &RoomFilm, expected: &RoomFilm, allowed: impl Fn(f64) -> f64) -> Check {
    assert_eq!(found.sums.len(), expected.sums.len());
    for sum in 0..found.sums.len() {
        let (a, b) = (found.units(sum), expected.units(sum));
        require((a - b).abs() <= allowed(b), || format!("sum {sum} is {a} where {b} +- {} is right", allowed(b)))?;
    }
    Ok(())
}

/// What floats may be off integers by: each of n photons rounds an integer sum by half a unit, and a float
/// by 2^-24 of the sum; two floats lose 2^-44 between them.
fn rounding(sums: Sums, photons: f64, is_whole: bool) -> impl Fn(f64) -> f64 {
    let share = if sums == Sums::F32 { photons / f64::from(1 << 24) } else { 1.0 / f64::from(1 << 22).powi(2) };
    // Whole photons below 2^24 are exact in any order.
    move |sum| if is_whole { 0.0 } else { 0.5 * photons + share * sum }
}

#[test]
fn floats_and_integers_agree_within_rounding() {
    let Some(gpu) = device() else { return };
    for (what, settings) in effects() {
        let expected = film(&gpu, &settings);
        // That one sum holds, at most.
        let photons = (expected.emitted * u64::from(settings.bounces)) as f64;
        let is_whole = expected.channel_count == 1;
        // The host's film is of its own photons, of which some lie on the other side of a rim.
        let host = run_on_cpu(&settings).film;
        for sums in [Sums::F32, Sums::Compensated] {
            let on_cpu = run_on_cpu(&RoomSettings { sums, threads: 2, ..settings.clone() }).film;
            assert_holds(format!("{what}, cpu, {sums:?}"), near(&on_cpu, &host, rounding(sums, photons, is_whole)));
            for gather in [Gather::Grid, Gather::Brute] {
                let found = film(&gpu, &RoomSettings { sums, gather, ..settings.clone() });
                assert_eq!((found.kind, found.scale), (sums, expected.scale));
                assert_holds(format!("{what}, {gather:?}, {sums:?}"), near(&found, &expected, rounding(sums, photons, is_whole)));
                let mut spoiled = found.clone();
                let brightest = (0..found.sums.len()).max_by(|a, b| found.units(*a).total_cmp(&found.units(*b))).unwrap();
                spoiled.sums[brightest] = u64::from((1.01 * found.units(brightest) as f32).to_bits());
                assert_complains("a sum 1 % too large", near(&spoiled, &expected, rounding(sums, photons, is_whole)));
                let integers = RoomFilm { kind: Sums::Integer, ..found };
                assert_complains("bits taken for integers", near(&integers, &expected, rounding(sums, photons, is_whole)));
            }
        }
    }
}

/// Many invocations add to the same few sums at once, and none is lost.
#[test]
fn additions_of_floats_that_meet_are_all_counted() {
    let Some(gpu) = device() else { return };
    let settings = RoomSettings { photons: 200_000, rng: Rng::Philox, mesh: 2, radius: 0.5, group_size: 32, ..RoomSettings::default() };
    let expected = film(&gpu, &settings);
    assert!((0..expected.sums.len()).all(|sum| (10_000.0..1e7).contains(&expected.units(sum))));
    for sums in [Sums::F32, Sums::Compensated] {
        for gather in [Gather::Grid, Gather::Brute] {
            let found = film(&gpu, &RoomSettings { sums, gather, ..settings.clone() });
            assert_holds(format!("{gather:?}, {sums:?}"), near(&found, &expected, |_| 0.0));
        }
    }
}

/// Ten photons, gathered one by one, as a film counts them that already holds `start` photons on every texel.
fn ten_counted_on(gpu: Option<&Gpu>, sums: Sums, gather: Gather, start: f32) -> f64 {
    let settings = RoomSettings { sums, gather, mesh: 1, radius: 0.5, ..RoomSettings::default() };
    let bits = if sums == Sums::Integer { start as u64 } else { u64::from(start.to_bits()) };
    let photon = [on_back_wall(0.0, 0.0, 0)];
    let plan = gpu.map_or_else(|| plan_for_host(&settings), |gpu| plan_for(gpu, &open_box(&settings), &settings));
    let mut sums = vec![bits; plan.points.len()];
    match gpu {
        None => (0..10).for_each(|_| cpu::estimate::gather_brute(&plan, &photon, &mut sums)),
        Some(gpu) => sums = gathered(gpu, &plan, &photon, 10, Some(&sums)),
    }
    let film = RoomFilm { of_blocks: BlockSums { sums, ..BlockSums::default() }, ..RoomFilm::new(&plan) };
    film.units(plan.points.len() - 1) - f64::from(start)
}

/// So many photons are the last that an f32 counts.
const FULL: f32 = 16_777_216.0;

/// Ten photons more than 2^24, and than so many that the lost part alone would have stopped, are ten more in a pair.
pub fn pairs_count_on(gpu: &Gpu) -> Check<Complaint> {
    for (gather, start) in [Gather::Brute, Gather::Grid].into_iter().flat_map(|gather| [FULL, 1024.0 * FULL].map(|start| (gather, start))) {
        let counted = ten_counted_on(Some(gpu), Sums::Compensated, gather, start);
        let kind = match counted {
            10.0 => continue,
            less if less < 10.0 => Kind::SumsTooSmall,
            _ => Kind::SumsTooLarge,
        };
        return Err(Complaint::new(kind, format!("{gather:?}: {counted} photons instead of 10 from {start} on")));
    }
    Ok(())
}

/// One photon more is nothing to an f32 of 2^24 of them; pairs and integers count on, pairs also where the
/// lost part alone would have stopped.
#[test]
fn f32_stops_counting_where_integers_and_pairs_go_on() {
    let gpu = device();
    for builder in [None, gpu.as_deref()].into_iter().take(if gpu.is_some() { 2 } else { 1 }) {
        for gather in [Gather::Brute, Gather::Grid] {
            let of = |sums, start: f32| ten_counted_on(builder, sums, gather, start);
            for start in [0.0, FULL - 4.0, FULL, 2.0 * FULL, 1024.0 * FULL] {
                for sums in [Sums::Integer, Sums::Compensated] {
                    assert_eq!(of(sums, start), 10.0, "{gather:?}, {sums:?} from {start}");
                }
            }
            assert_eq!(of(Sums::F32, 0.0), 10.0);
            assert_eq!(of(Sums::F32, FULL - 4.0), 4.0, "{gather:?}: f32 ends at 2^24");
            assert_eq!(of(Sums::F32, 1024.0 * FULL), 0.0);
        }
    }
}

/// Largest relative error of a film against integers.
fn relative_error(found: &RoomFilm, expected: &RoomFilm) -> f64 {
    let error = |sum| (found.units(sum) / expected.units(sum) - 1.0).abs();
    (0..found.sums.len()).filter(|sum| expected.units(*sum) > 0.0).map(error).fold(0.0, f64::max)
}

/// What f32 costs: 300 000 weights on each of five texels, added one by one, and on a device slice by slice.
#[test]
fn the_error_of_f32_sums_is_measured() {
    let gpu = if is_long_run() { device() } else { None };
    let gpu = gpu.as_deref();
    let weights = RoomSettings { shininess: [Some(2.0); 5], light_power: [3.0, 0.7], ..RoomSettings::default() };
    let settings = RoomSettings { photons: 1_000_000, rng: Rng::Philox, mesh: 1, radius: 0.5, threads: 2, ..weights };
    let films = |sums| {
        let settings = RoomSettings { sums, ..settings.clone() };
        [Some(run_on_cpu(&settings).film), gpu.map(|gpu| film(gpu, &settings))]
    };
    let [integer, f32, compensated] = [Sums::Integer, Sums::F32, Sums::Compensated].map(films);
    for (k, builder) in ["cpu, one by one", "device, slices first"].into_iter().enumerate() {
        let Some(integer) = &integer[k] else { continue };
        let [f32_error, pair_error] = [&f32, &compensated].map(|film| relative_error(film[k].as_ref().unwrap(), integer));
        println!("{builder}: f32 off by {f32_error:.1e}, pairs by {pair_error:.1e}");
        // The integers round each photon to 2^-23, which is all that they and the pairs differ by.
        assert!(pair_error < 1e-7, "{builder}: {pair_error}");
        assert!(f32_error > 10.0 * pair_error && f32_error < 1e-2, "{builder}: {f32_error}");
    }
}
