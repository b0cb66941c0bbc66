//! Every builder against the independent f64 model, draw by draw with the paper's generator, and
//! against the exact shares of stored photons with the others.

use crate::common::prelude::*;
use crate::common::reference::{self, Emission, Model, add_power, power_table};
use photonmill::engine::room::RunResult;
use photonmill::engine::room::film::{RoomFilm, estimate_walls};
use photonmill::ledger::Fates;

/// Photons stored at bounces 1 to 15 of the paper's run: rand48, seed 1, 5000 photons. Printed by the
/// independent numpy model `paper_reference.py`, as is every number of the first two tests.
const STORED: [u64; 15] = [2899, 1782, 1093, 650, 395, 255, 158, 102, 66, 46, 27, 17, 11, 6, 4];

/// Mean, smallest and largest power within the radius on the five walls.
type WallPowers = [(f64, f64, f64); 5];

/// As printed: means to four digits after the point, extremes to three.
fn assert_printed(table: &[f64], expected: WallPowers) {
    for (wall, (powers, (mean, least, most))) in pairs(table.chunks(reference::MESH * reference::MESH), expected).enumerate() {
        let close = |a: f64, b: f64, digits: i32| (a - b).abs() <= 0.51 * 10f64.powi(-digits);
        let found = powers.iter().sum::<f64>() / powers.len() as f64;
        let [smallest, largest] = [f64::min, f64::max].map(|of| powers.iter().copied().reduce(of).unwrap());
        assert!(
            close(found, mean, 4) && close(smallest, least, 3) && close(largest, most, 3),
            "wall {wall}: {found}, {smallest} to {largest}, where the numpy model printed {mean}, {least} to {most}"
        );
    }
}

#[test]
fn the_judge_counts_what_the_numpy_model_counts() {
    let model = Model::default();
    let arrivals = model.trace(0);
    assert_eq!(model.hits_per_bounce(&arrivals), [3885, 2348, 1469, 881, 539, 325, 215, 129, 82, 53, 33, 23, 15, 7, 5]);
    assert_eq!(model.stored_per_bounce(&arrivals), STORED);
    let on_wall = |wall: usize| arrivals.iter().filter(|arrival| arrival.stored && arrival.wall == wall).count();
    assert_eq!([0, 1, 2, 3, 4].map(on_wall), [1408, 1495, 1380, 1512, 1716]);

    let two = Model { bounces: 2, ..model };
    assert_eq!(two.stored_per_bounce(&two.trace(0)), STORED[..2]);
}

/// Runs of the builders on the device, if there is one, and of the CPU's.
fn every_builder(gpu: Option<&Gpu>, settings: &RoomSettings) -> Vec<(Builder, RunResult)> {
    let mut results = vec![(Builder::Cpu, run_on_cpu(settings))];
    if let Some(gpu) = gpu {
        results.extend(Builder::ON_GPU.map(|builder| (builder, run(gpu, &RoomSettings { builder, ..settings.clone() }))));
    }
    results
}

/// Share of (photon, texel) pairs whose distance may fall on the other side of the radius in another
/// arithmetic of f32 accuracy; measured 2.2e-6.
const FLIPS: f64 = 2e-5;

/// Power tables texel by texel: a texel may differ by one photon, a share [`FLIPS`] of the pairs in
/// all; beyond that a weight may be off by `tolerance` of its size.
fn same_power(film: &RoomFilm, expected: &[f64], counts: &[f64], tolerance: f64) -> Check {
    require(film.point_count() == expected.len(), || format!("{} points instead of {}", film.point_count(), expected.len()))?;
    let mut flipped = 0;
    for (texel, (&expected, &count)) in pairs(expected, counts).enumerate() {
        let difference = (film.power(texel) - expected).abs();
        // Every photon in reach may be off by the tolerance.
        let rounding = tolerance * count;
        require(difference <= 1.0 + rounding, || format!("texel {texel}: {} instead of {expected}", film.power(texel)))?;
        flipped += usize::from(difference > rounding);
    }
    let allowed = FLIPS * counts.iter().sum::<f64>();
    require(flipped as f64 <= allowed, || format!("{flipped} texels differ where {allowed:.1} may"))?;
    Ok(())
}

/// Weights follow f32 positions and directions that are 1e-7 off (1e-5 for one in a thousand), with a
/// slope of the exponent, and log2 and exp2 that Vulkan grants a few ulp.
const WEIGHT_TOLERANCE: f64 = 2e-5;

/// The model itself gathers what the numpy model does.
#[test]
fn every_builder_stores_and_gathers_what_the_model_does() {
    let gpu = device();
    let phong = |shininess| RoomSettings { shininess: [Some(shininess); 5], ..RoomSettings::default() };
    let three_rounds = RoomSettings { rounds: 3, ..RoomSettings::preset(Preset::Rounds) };
    // With means of min(illumination, 1) on the five walls where the numpy model prints them.
    let runs = [
        (RoomSettings::preset(Preset::Naive), None),
        (RoomSettings::preset(Preset::Modified), Some([0.4510, 0.4839, 0.4481, 0.4884, 0.5560])),
        (phong(2.0), Some([0.1105, 0.0932, 0.1057, 0.0972, 0.2628])),
        (phong(0.5), None),
        (phong(0.01), None),
        (phong(5.0), None),
        (three_rounds, None),
    ];
    let powers: [WallPowers; 7] = [
        [(25.2280, 2.0, 64.0), (26.8435, 3.0, 60.0), (23.8416, 1.0, 58.0), (27.6904, 1.0, 68.0), (32.8901, 1.0, 68.0)],
        [(40.5923, 2.0, 87.0), (43.5544, 5.0, 86.0), (40.3311, 3.0, 84.0), (43.9578, 4.0, 92.0), (50.0378, 9.0, 91.0)],
        [(9.9478, 1.194, 24.505), (8.3880, 0.557, 23.103), (9.5132, 0.248, 25.867), (8.7488, 1.036, 23.006), (23.6533, 1.880, 55.124)],
        [(20.6275, 1.749, 51.907), (19.9596, 1.977, 50.940), (19.9034, 1.393, 44.996), (20.3406, 2.741, 50.657), (39.3002, 5.394, 76.383)],
        [(30.7586, 1.995, 75.354), (31.8622, 3.938, 75.338), (29.3753, 2.949, 73.094), (31.7865, 3.970, 86.948), (49.4759, 7.957, 90.642)],
        [(4.7114, 0.425, 16.657), (3.4463, 0.166, 9.470), (4.1808, 0.013, 13.052), (3.5316, 0.119, 11.227), (12.8142, 0.228, 43.669)],
        [(3.4818, 0.043, 13.590), (2.6827, 0.0, 11.378), (3.3148, 0.020, 11.921), (2.7139, 0.033, 8.995), (10.8910, 0.254, 43.452)],
    ];
    for ((settings, printed), powers) in pairs(runs, powers) {
        let shininess = settings.shininess[0].map(f64::from);
        let model = Model { shininess, bounces: settings.bounces as usize, ..Model::default() };
        let (mut expected, mut counts) = (vec![0.0; 5 * 64 * 64], vec![0.0; 5 * 64 * 64]);
        let mut per_bounce = vec![0; settings.bounces as usize];
        for round in 0..settings.rounds as usize {
            let arrivals = model.trace(round);
            add_power(&mut expected, &arrivals, settings.radius);
            let unweighted: Vec<_> = arrivals.iter().map(|arrival| reference::Arrival { weight: 1.0, ..*arrival }).collect();
            add_power(&mut counts, &unweighted, settings.radius);
            let stored = model.stored_per_bounce(&arrivals);
            if round == 2 {
                assert_eq!(stored, [3003, 1798, 1122, 662, 396, 254, 153, 95, 58, 41, 22, 10, 8, 5, 3]);
            }
            pairs(&mut per_bounce, stored).for_each(|(sum, stored)| *sum += stored);
        }
        assert_printed(&expected, powers);
        let tolerance = if shininess.is_some() { WEIGHT_TOLERANCE } else { 0.0 };
        for (builder, result) in every_builder(gpu.as_deref(), &settings) {
            let what = format!("{builder:?}, {} bounces, {} rounds, shininess {shininess:?}", settings.bounces, settings.rounds);
            let stored: Vec<u64> = result.fates[0].bounces.iter().map(|bounce| bounce.stored).collect();
            assert_eq!(stored, per_bounce, "{what}");
            assert_eq!(result.ledger().stored, per_bounce.iter().sum::<u64>(), "{what}");
            assert_holds(&what, same_power(&result.film, &expected, &counts, tolerance));
            // The paper's illumination is that power over full light of all rounds, and may exceed 1.
            let full_light = settings.full_light * f64::from(settings.rounds);
            let walls = estimate_walls(&result.film, &open_box(&settings), &result.plan);
            let illumination: Vec<f64> = walls.iter().flat_map(|wall| wall.illumination.clone()).collect();
            for (texel, illumination) in illumination.iter().enumerate() {
                assert!((illumination - result.film.power(texel) / full_light).abs() <= 1e-12, "{what}");
            }
            for (wall, printed) in illumination.chunks(64 * 64).zip(printed.into_iter().flatten()) {
                let mean = wall.iter().map(|illumination| illumination.min(1.0)).sum::<f64>() / wall.len() as f64;
                // Half a digit of the print, and a few flipped counts of 1/90 among 4096 texels.
                assert!((mean - printed).abs() < 7e-5, "{what}: {mean} instead of {printed}");
            }
        }
    }
}

#[test]
fn the_check_of_power_complains() {
    let result = run_on_cpu(&RoomSettings::default());
    let film = &result.film;
    let arrivals = Model::default().trace(0);
    let expected = power_table(&arrivals, 0.05);
    assert_holds("the run itself", same_power(film, &expected, &expected, 0.0));
    let one = *arrivals.iter().find(|arrival| arrival.stored && arrival.bounce == 1).unwrap();
    let without_one: Vec<_> = arrivals.iter().filter(|arrival| **arrival != one).copied().collect();
    let doubled: Vec<_> = arrivals.iter().chain([&one]).copied().collect();
    for (what, spoiled) in [
        ("a photon lost", power_table(&without_one, 0.05)),
        ("a photon doubled", power_table(&doubled, 0.05)),
        ("a radius 1 % too large", power_table(&arrivals, 0.0505)),
        ("another seed", power_table(&Model { seed: 2, ..Model::default() }.trace(0), 0.05)),
        ("cosine emission", power_table(&Model { emission: Emission::Cosine, ..Model::default() }.trace(0), 0.05)),
        ("a gain of 1 %", expected.iter().map(|power| power * 1.01).collect()),
    ] {
        assert_complains(what, same_power(film, &spoiled, &spoiled, 0.0));
    }
    let brighter = |gain: f64| expected.iter().map(|power| power * gain).collect::<Vec<f64>>();
    assert_complains("a weight 0.01 % off", same_power(film, &brighter(1.0001), &expected, WEIGHT_TOLERANCE));
}

/// Photons stored at bounce k for each one emitted: 0.75^k times the probability that flight k ends on
/// a wall, from a radiosity recursion with exact form factors (error below 5e-7), confirmed by 1e9
/// simulated photons. (bounce, uniform emission, cosine emission).
const SHARES: [(usize, f64, f64); 11] = [
    (1, 0.586_425_3, 0.607_142_8),
    (2, 0.354_047_5, 0.363_597_9),
    (3, 0.217_227_2, 0.221_502_8),
    (4, 0.133_102_6, 0.135_508_8),
    (5, 0.081_816_5, 0.083_171_9),
    (6, 0.050_300_1, 0.051_108_9),
    (7, 0.030_946_6, 0.031_431_6),
    (8, 0.019_042_4, 0.019_337_5),
    (10, 0.007_213_5, 0.007_323_8),
    (12, 0.002_733_2, 0.002_774_8),
    (15, 0.000_637_5, 0.000_647_2),
];

fn has_shares(fates: &Fates, emission: EmissionLaw) -> Check {
    for (bounce, uniform, cosine) in SHARES {
        let probability = if emission == EmissionLaw::Uniform { uniform } else { cosine };
        share_check(&format!("stored at bounce {bounce}"), fates.bounces[bounce - 1].stored, fates.emitted, probability)?;
    }
    Ok(())
}

/// Of a million photons it finds 0.4 % more at the first bounce with 5 standard errors, and 1.7 % at the fifth.
#[test]
fn a_million_photons_have_the_exact_shares() {
    let Some(gpu) = device() else { return };
    let photons = of_run(1_000_000, 10_000_000);
    let [uniform, cosine] = [EmissionLaw::Uniform, EmissionLaw::Cosine];
    for (rng, emission, other) in [(Rng::Philox, cosine, uniform), (Rng::Mt, uniform, cosine)] {
        // One point a wall: only the fates are asked for.
        let settings = RoomSettings { rng, emission, photons, builder: Builder::Ballot, mesh: 1, ..RoomSettings::default() };
        let fates = run(&gpu, &settings).fates[0].clone();
        assert_eq!(fates.emitted, u64::from(photons));
        assert_holds(format!("{rng:?} {emission:?}"), has_shares(&fates, emission));
        assert_complains("the other law of emission", has_shares(&fates, other));
        let mut gained = fates.clone();
        gained.bounces[0].stored = gained.bounces[0].stored * 101 / 100;
        assert_complains("1 % more photons", has_shares(&gained, emission));
    }
}
