//! Random numbers at their ends: around the generators' periods and the largest photon numbers, neighbours that
//! must not resemble each other, and directions drawn from the least and the greatest numbers.

use crate::common::draws_from;
use crate::common::evenness_check;
use crate::common::prelude::*;
use photonmill::cpu::emission::emit_from_disc;
use photonmill::cpu::room::intersect_room;
use photonmill::cpu::sampling::{sample_cosine_hemisphere, sample_uniform_hemisphere};
use photonmill::cpu::trace::Tracer;
use photonmill::engine::room::resources::RoomResources;
use photonmill::engine::room::{constants, trace};
use photonmill::photon_state::{self, PhotonState};
use photonmill::plan::EmissionRange;
use photonmill::rng::{Affine48, Streams, owen_scramble, sobol, srand48};

/// Those that imitate chance; Sobol' points are more even than that.
const GENERATORS: [Rng; 3] = [Rng::Rand48, Rng::Mt, Rng::Philox];
/// Half of an f32's spacing below 1.
const U: f64 = 1.0 / 16_777_216.0;
const PERIOD: u64 = 1 << 48;

/// One step of the C library's generator, in whole numbers that cannot wrap.
fn stepped(state: u64) -> u64 {
    ((u128::from(state) * 0x5_DEEC_E66D + 0xB) % u128::from(PERIOD)) as u64
}

/// The sequence has 2^48 states and closes: jumps and steps meet before, at and behind its end.
#[test]
fn rand48_jumps_and_steps_meet_across_2_to_the_48() {
    let start = srand48(1);
    assert_eq!(Affine48::steps(PERIOD).apply(start), start);
    assert_eq!(Affine48::steps(PERIOD - 1).apply(stepped(start)), start);
    // Half a period is none.
    assert_ne!(Affine48::steps(PERIOD / 2).apply(start), start);
    let mut state = Affine48::steps(PERIOD - 1000).apply(start);
    for place in PERIOD - 999..PERIOD + 1000 {
        state = stepped(state);
        assert_eq!(Affine48::steps(place).apply(start), state, "place {place}");
        assert_eq!(Affine48::steps(place % PERIOD).apply(start), state, "place {place}");
    }
    // States whose products leave 64 bits, and the largest.
    for state in [PERIOD - 1, PERIOD - 2, PERIOD / 2, (1 << 32) - 1, 1 << 32, 0] {
        assert_eq!(Affine48::STEP.apply(state), stepped(state), "state {state:x}");
    }
}

/// Each photon's draws are its own part of the one sequence, to the last photon of the longest run that is
/// allowed: 2^31 photons, 2^13 rounds, 16 draws. One round more is refused.
#[test]
fn a_run_draws_the_whole_period_and_no_number_twice() {
    let whole = RoomSettings { photons: 1 << 31, rounds: 1 << 13, bounces: 4, ..RoomSettings::default() };
    assert_eq!(u128::from(whole.total_photons()) * u128::from(whole.draws_per_photon()), u128::from(PERIOD));
    whole.validate().unwrap();
    for beyond in [RoomSettings { rounds: whole.rounds + 1, ..whole.clone() }, RoomSettings { bounces: 5, ..whole.clone() }] {
        assert!(beyond.validate().unwrap_err().to_string().contains("2^48"));
        RoomSettings { rng: Rng::Philox, ..beyond }.validate().unwrap();
    }
    let streams = streams_of(&whole);
    let start = srand48(1);
    // Draw k of photon i in round r stands at place (16 r + k) 2^31 + i + 1; the last one at 2^48.
    let key = streams.key(whole.rounds - 1);
    let last = whole.photons - 1;
    let mut state = Affine48::steps(1).apply(streams.jump(whole.rounds - 1, last).apply(start));
    let leap = Affine48 {
        multiplier: u64::from(key.leap_multiplier.x) | u64::from(key.leap_multiplier.y) << 32,
        increment: u64::from(key.leap_increment.x) | u64::from(key.leap_increment.y) << 32,
    };
    (1..16).for_each(|_| state = leap.apply(state));
    assert_eq!(state, start, "the last draw closes the sequence");

    // The same layout in small, with every place looked at.
    let small = RoomSettings { photons: 25, rounds: 3, bounces: 2, ..whole };
    let mut places: HashSet<u32> = HashSet::new();
    for (round, photon) in (0..3).flat_map(|round| (0..25).map(move |photon| (round, photon))) {
        draws_of(streams_of(&small), round, photon, 2).iter().for_each(|draw| assert!(places.insert(draw.to_bits())));
    }
    assert_eq!(places.len(), 25 * 3 * 10);
}

/// First of `count` equal classes that a number in [0, 1) may fall into.
fn class(u: f32, count: usize) -> usize {
    (f64::from(u) * count as f64) as usize
}

/// Numbers alone, pairs and triples of a photon's draws fill their classes evenly, and not too evenly.
#[test]
fn draws_are_even_alone_in_pairs_and_in_triples() {
    for rng in GENERATORS {
        let settings = RoomSettings { rng, photons: 20_001, ..RoomSettings::default() };
        let draws: Vec<Vec<f32>> = (0..settings.photons).map(|photon| draws_of(streams_of(&settings), 0, photon, 2)).collect();
        for k in 0..8 {
            let what = |of: &str| format!("{rng:?}, {of} from draw {k}");
            assert_holds(what("numbers"), evenness_check("numbers", draws.iter().map(|u| class(u[k], 100))));
            assert_holds(what("pairs"), evenness_check("pairs", draws.iter().map(|u| 10 * class(u[k], 10) + class(u[k + 1], 10))));
            let triple = |u: &Vec<f32>| 20 * class(u[k], 5) + 4 * class(u[k + 1], 5) + class(u[k + 2], 4);
            assert_holds(what("triples"), evenness_check("triples", draws.iter().map(triple)));
        }
        let steps = (0..20_000).map(|i| class((i as f32 + 0.5) / 20_000.0, 100));
        assert_complains("numbers at even steps", evenness_check("steps", steps));
        assert_complains("numbers a hundredth too small", evenness_check("numbers", draws.iter().map(|u| class(0.99 * u[0], 100))));
    }
}

/// Correlation of two rows of numbers in [0, 1); of independent ones its standard error is 1 / sqrt(n).
fn correlation_check(what: &str, rows: impl Iterator<Item = (f32, f32)>) -> Check {
    mean_check(what, rows.map(|(a, b)| 12.0 * (f64::from(a) - 0.5) * (f64::from(b) - 0.5)), 0.0, 1.0)
}

/// The third difference of four draws of one photon, which is a constant where a power of two leap-frogs
/// rand48: such streams are parabolas.
fn third_difference(u: &[f32]) -> usize {
    let sum = f64::from(u[3]) - 3.0 * f64::from(u[2]) + 3.0 * f64::from(u[1]) - f64::from(u[0]);
    (sum.rem_euclid(1.0) * 100.0) as usize % 100
}

/// Photons side by side: the same draw of each fills its classes like chance, and is independent of the next
/// photon's; draws of one photon follow no parabola.
#[test]
fn neighbouring_photons_do_not_resemble_each_other() {
    for rng in GENERATORS {
        for photons in [5000, 5001] {
            let settings = RoomSettings { rng, photons, ..RoomSettings::default() };
            let draws: Vec<Vec<f32>> = (0..photons).map(|photon| draws_of(streams_of(&settings), 0, photon, 3)).collect();
            for k in 0..13 {
                let what = format!("{rng:?}, {photons} photons, draw {k}");
                assert_holds(&what, evenness_check("photons", draws.iter().map(|u| class(u[k], 100))));
                for lag in [1, 2, 8, 32, 64] {
                    let pairs = draws.iter().zip(&draws[lag..]);
                    assert_holds(format!("{what}, {lag} apart"), correlation_check("draws", pairs.map(|(a, b)| (a[k], b[k]))));
                }
            }
            let differences = draws.iter().flat_map(|u| (0..10).map(|k| third_difference(&u[k..])));
            assert_holds(format!("{rng:?}, {photons} photons"), evenness_check("third differences", differences));
        }
    }
    // What is known to be bad: a power of two of photons, about which a run is warned,
    let even = RoomSettings { photons: 1 << 16, ..RoomSettings::default() };
    assert!(even.warning().is_some() && RoomSettings::default().warning().is_none());
    let parabolas = (0..even.photons).map(|photon| third_difference(&draws_of(streams_of(&even), 0, photon, 1)));
    assert_complains("leaps of a power of two", evenness_check("third differences", parabolas));
    // and a generator started anew with each photon's number.
    let seeded = (0..5000).map(|seed| Affine48::STEP.apply(srand48(seed)) as f64 / PERIOD as f64);
    assert_complains("seeds in a row", evenness_check("first draws", seeded.map(|u| class(u as f32, 100))));
    let row = (0..5000).map(|i| class(i as f32 * 0.618_034 % 1.0, 100) as f32 / 100.0);
    assert_complains("a row against itself", correlation_check("draws", row.map(|u| (u, u))));
}

/// The paths of some photons as they leave their light, by the device.
fn emitted(gpu: &Device, plan: &RoomPlan, round: u32, range: EmissionRange) -> Vec<PhotonState> {
    let scene = open_box(&plan.settings);
    let mut commands = Commands::new(gpu, constants(plan), Instant::now()).unwrap();
    let resources = RoomResources::new(&mut commands, &scene, plan).unwrap();
    trace::emit(&mut commands, &resources, plan, round, &[range]).unwrap();
    let array = commands.read(&resources.paths[0], plan.path_array_length() as usize).unwrap();
    (0..range.count as usize).map(|index| photon_state::unpack(&array, index)).collect()
}

/// The same photons by another builder: the same streams, bit for bit, and places and directions within a few
/// roundings (radius, square root, polynomial, two products).
fn same_start(found: &[PhotonState], expected: &[PhotonState]) -> Check {
    for (a, b) in pairs(found, expected) {
        require((a.photon, a.stream, a.wall) == (b.photon, b.stream, b.wall), || format!("{a:?} instead of {b:?}"))?;
        // Sums carry what is no number, and a maximum would not.
        let off = f64::from((a.position - b.position).abs().element_sum() + (a.direction - b.direction).abs().element_sum());
        require(off <= 8.0 * U, || format!("{a:?} is {off:e} off {b:?}"))?;
    }
    require(found.len() == expected.len(), || format!("{} photons instead of {}", found.len(), expected.len()))
}

/// Numbers that f32 does not distinguish (2^24), the last of the largest round, and rounds so late that 2^47
/// photons lie before them: every photon is one of its own, and both builders start the same ones.
#[test]
fn photons_of_the_largest_numbers_are_their_own() {
    let Some(gpu) = device() else { return };
    for (rng, bounces, round) in [(Rng::Philox, 1, (1 << 16) - 1), (Rng::Rand48, 4, (1 << 13) - 1), (Rng::Mt, 1, 1), (Rng::Sobol, 1, 1)] {
        let settings =
            RoomSettings { rng, bounces, photons: 1 << 31, rounds: round + 1, mesh: 1, chunk: Some(1 << 20), ..RoomSettings::default() };
        let scene = open_box(&settings);
        let plan = plan_for(&gpu, &scene, &settings);
        let tracer = Tracer::new(&scene, &plan);
        let mut starts = HashSet::new();
        for (light, first_photon) in [(0, 0), (0, (1 << 24) - 32), (1, (1 << 31) - 64)] {
            for round in [0, round] {
                let range = EmissionRange { light, first_photon, count: 64 };
                let (found, expected) = (emitted(&gpu, &plan, round, range), tracer.emit(round, &[range]));
                assert_holds(format!("{rng:?}, round {round}, photons from {first_photon}"), same_start(&found, &expected));
                for path in &found {
                    let bits = [path.position.to_array(), path.direction.to_array()].concat().into_iter().map(f32::to_bits);
                    assert!(starts.insert(bits.collect::<Vec<u32>>()), "{rng:?}, round {round}: {path:?} starts twice");
                }
                let next = EmissionRange { first_photon: first_photon ^ 1, ..range };
                assert_complains("the neighbours", same_start(&emitted(&gpu, &plan, round, next), &expected));
            }
        }
    }
}

/// A mean against its closed form, by the standard deviation of a single value.
fn mean_check(what: &str, values: impl Iterator<Item = f64>, expected: f64, deviation: f64) -> Check {
    let (sum, count) = values.fold((0.0, 0.0f64), |(sum, count), value| (sum + value, count + 1.0));
    z_check(what, sum / count, expected, deviation / count.sqrt())
}

/// The least and the greatest numbers that a generator gives, and those at which sine and cosine change places:
/// every direction is a unit vector that does not point into its wall, and every flight ends inside the room.
#[test]
fn grazing_and_straight_directions_end_in_the_room() {
    let ends = [0.0f32, f32::EPSILON / 2.0, 0.125, 0.25, 0.5, 0.75, 0.875, 1.0 - f32::EPSILON / 2.0];
    for u in ends {
        for azimuth in ends {
            for direction in [sample_cosine_hemisphere(u, azimuth), sample_uniform_hemisphere(u, azimuth)] {
                let length = direction.as_dvec3().length();
                assert!((length - 1.0).abs() <= 4.0 * U && direction.z >= 0.0, "{u}, {azimuth}: {direction}");
            }
        }
    }
    let settings = RoomSettings::default();
    let scene = open_box(&settings);
    let (room, walls) = (scene.room_record(), scene.wall_records());
    let (min, max) = (scene.min_corner.as_vec3(), scene.max_corner.as_vec3());
    let mut flights = 0;
    let mut fly = |position: Vec3, direction: Vec3, wall: u32| {
        let hit = intersect_room(&room, position, direction, wall);
        let inside = hit.position.cmpge(min).all() && hit.position.cmple(max).all();
        assert!(inside && hit.wall != wall, "from {position} on wall {wall} along {direction}: {hit:?}");
        flights += 1;
        hit
    };
    for light in scene.light_records(&[1.0, 1.0]) {
        for law in [EmissionLaw::Uniform, EmissionLaw::Cosine] {
            for place in 0..ends.len().pow(4) {
                let u = [0, 1, 2, 3].map(|k| ends[place / ends.len().pow(k) % ends.len()]);
                let (position, direction) = emit_from_disc(&light, &walls[light.wall as usize], law, u);
                fly(position, direction, light.wall);
            }
        }
    }
    // From every edge and corner of every wall, along every axis and diagonal that leaves it.
    for (face, wall) in walls.iter().enumerate() {
        for corner in 0..27 {
            let third = |axis: usize| [min, 0.5 * (min + max), max][corner / 3usize.pow(axis as u32) % 3][axis];
            let mut position = Vec3::from_array([0, 1, 2].map(third));
            position[face / 2] = if face % 2 == 1 { max[face / 2] } else { min[face / 2] };
            for way in 0..27 {
                let direction = Vec3::from_array([0, 1, 2].map(|axis| [-1.0, 0.0, 1.0][way / 3usize.pow(axis) % 3]));
                if direction.dot(wall.normal) >= 0.0 && direction != Vec3::ZERO {
                    let hit = fly(position, direction.normalize(), face as u32);
                    assert!(hit.position.is_finite());
                }
            }
        }
    }
    assert!(flights > 2 * 2 * 4096, "{flights} flights");
}

/// Photons enough for a birthday among 24 bits many times over: not two share all their numbers.
#[test]
#[ignore = "sixteen million streams take a minute"]
fn sixteen_million_photons_are_all_different() {
    for rng in [Rng::Philox, Rng::Mt] {
        let streams = Streams { rng, seed: 3, photons: 1 << 24, draws_per_photon: 49 };
        let mut starts: Vec<[u32; 4]> = (0..1 << 24)
            .map(|photon| {
                let draws = draws_of(streams, 0, photon, 0);
                [0, 1, 2, 3].map(|k| (f64::from(draws[k]) / U) as u32)
            })
            .collect();
        starts.sort_unstable();
        assert!(starts.windows(2).all(|pair| pair[0] != pair[1]), "{rng:?}");
    }
}

/// Draws of a light's sample of Sobol' points: four of its emission, three of each bounce.
fn sobol_draws(seed: u64, light: u32, sample: u32, bounces: u32) -> Vec<f32> {
    let key = Streams { rng: Rng::Sobol, seed, photons: 1, draws_per_photon: 0 }.key(0);
    draws_from(Rng::Sobol, &key, 0, UVec2::new(sample, light), bounces)
}

/// Each of so many classes once.
fn one_in_each(what: &str, count: usize, classes: impl Iterator<Item = usize>) -> Check {
    let distinct = classes.collect::<HashSet<usize>>().len();
    require(distinct == count, || format!("{distinct} of {count} {what} are hit"))
}

/// One of 2^k points in each of 2^k equal boxes, whatever their shape: a (0, k, 2)-net. So either coordinate has one in each of 2^k
/// intervals.
fn one_in_each_box(points: &[(f32, f32)]) -> Check {
    let count = points.len();
    (0..=count.ilog2()).map(|log| 1usize << log).try_for_each(|columns| {
        let rows = count / columns;
        let classes = points.iter().map(|(x, y)| class(*x, columns) * rows + class(*y, rows));
        one_in_each(&format!("{columns} x {rows} boxes"), count, classes)
    })
}

/// Every aligned run of 2^k samples has one in each interval in every dimension, and one in each box in the
/// first two of every block, whatever seed and light.
#[test]
fn sobol_points_stratify_every_aligned_run() {
    for (seed, light, k, first) in [
        (1, 0, 0, 7),
        (1, 1, 1, 6),
        (2, 0, 4, 48),
        (0, 0, 8, 0),
        (u64::MAX, 1, 10, 5 << 10),
        (3, 1, 13, 1 << 31),
        (4, 0, 12, u32::MAX << 12),
    ] {
        let what = |of: String| format!("seed {seed}, light {light}, 2^{k} samples from {first}, {of}");
        let draws: Vec<Vec<f32>> = (0..1 << k).map(|i| sobol_draws(seed, light, first + i, 4)).collect();
        for draw in 0..draws[0].len() {
            let classes = draws.iter().map(|u| class(u[draw], draws.len()));
            assert_holds(what(format!("draw {draw}")), one_in_each("intervals", draws.len(), classes));
        }
        for block in [0, 4, 7, 10, 13] {
            let points: Vec<(f32, f32)> = draws.iter().map(|u| (u[block], u[block + 1])).collect();
            assert_holds(what(format!("draws from {block}")), one_in_each_box(&points));
        }
    }
}

/// A point of the sequence, dimension by dimension.
fn sobol_point(index: u32) -> [u32; 4] {
    sobol([index]).map(|[word]| word)
}

/// Points by a spoiled generator: a scrambling of indices and of numbers, and of the Sobol' words between.
fn spoiled_points(shuffle: fn(u32, u32) -> u32, words: fn(u32) -> [u32; 4], scramble: fn(u32, u32) -> u32) -> Vec<(f32, f32)> {
    let unit = |word: u32| (word >> 8) as f32 / 16_777_216.0;
    (0..1024)
        .map(|i| words(shuffle(i, 0x9e37_79b9)))
        .map(|word| (unit(scramble(word[0], 0x7f4a_7c15)), unit(scramble(word[1], 0xf39c_c060))))
        .collect()
}

#[test]
fn the_checks_complain_about_spoiled_sobol_points() {
    assert_holds("the generator itself", one_in_each_box(&spoiled_points(owen_scramble, sobol_point, owen_scramble)));
    // Low bits decide over high ones.
    let upside_down: fn(u32, u32) -> u32 = |x, seed| owen_scramble(x.reverse_bits(), seed).reverse_bits();
    assert_complains("a scrambling that is not nested", one_in_each_box(&spoiled_points(owen_scramble, sobol_point, upside_down)));
    assert_complains("a shuffle that is not nested", one_in_each_box(&spoiled_points(u32::wrapping_mul, sobol_point, owen_scramble)));
    assert_complains("two dimensions alike", one_in_each_box(&spoiled_points(owen_scramble, |i| [i.reverse_bits(); 4], owen_scramble)));
    let swapped: fn(u32) -> [u32; 4] = |i| [sobol_point(i)[2], sobol_point(i)[3], 0, 0];
    assert_complains("the dimensions that are no (0, 2)-sequence", one_in_each_box(&spoiled_points(owen_scramble, swapped, owen_scramble)));
    let late: Vec<(f32, f32)> = (1..1025).map(|i| sobol_draws(1, 0, i, 0)).map(|u| (u[0], u[1])).collect();
    assert_complains("a run that is not aligned", one_in_each_box(&late));
    let philox = streams_of(&RoomSettings { rng: Rng::Philox, ..RoomSettings::default() });
    let chance: Vec<(f32, f32)> = (0..1024).map(|i| draws_of(philox, 0, i, 0)).map(|u| (u[0], u[1])).collect();
    assert_complains("chance", one_in_each_box(&chance));
}

/// Over seeds and over lights, each draw of one sample is any number, and any pair of draws any pair; blocks of a
/// sample know nothing of each other.
#[test]
fn sobol_scrambles_are_uniform_and_independent() {
    for (sample, light) in [(0, 0), (1, 1), (77, 0), (1 << 31, 1)] {
        let draws: Vec<Vec<f32>> = (0..20_000).map(|seed| sobol_draws(seed, light, sample, 2)).collect();
        for k in 0..10 {
            let what = format!("sample {sample}, draw {k}");
            assert_holds(&what, evenness_check("numbers", draws.iter().map(|u| class(u[k], 100))));
            for other in 0..k {
                let pair = |u: &Vec<f32>| 10 * class(u[k], 10) + class(u[other], 10);
                assert_holds(format!("{what} with {other}"), evenness_check("pairs", draws.iter().map(pair)));
            }
        }
    }
    let samples = |seed, light| (0..20_000).map(move |sample| sobol_draws(seed, light, sample, 2)).collect::<Vec<_>>();
    let (draws, other_seed, other_light) = (samples(1, 0), samples(2, 0), samples(1, 1));
    // The same dimension of two blocks, seeds, lights. Shuffled runs may meet more evenly than chance would.
    let pairs = |a: &[Vec<f32>], j: usize, b: &[Vec<f32>], k: usize| {
        let mut counts = [0u32; 100];
        a.iter().zip(b).for_each(|(a, b)| counts[10 * class(a[j], 10) + class(b[k], 10)] += 1);
        let chi_square: f64 = counts.iter().map(|count| (f64::from(*count) - 200.0).powi(2) / 200.0).sum();
        require(chi_square <= 183.7, || format!("pairs: chi-square {chi_square:.1} of 99 degrees of freedom"))?;
        correlation_check("draws", a.iter().zip(b).map(|(a, b)| (a[j], b[k])))
    };
    for dimension in 0..3 {
        assert_holds("emission and bounce", pairs(&draws, dimension, &draws, 4 + dimension));
        assert_holds("two bounces", pairs(&draws, 4 + dimension, &draws, 7 + dimension));
        assert_holds("two seeds", pairs(&draws, dimension, &other_seed, dimension));
        assert_holds("two lights", pairs(&draws, dimension, &other_light, dimension));
    }
    assert_complains("a block that repeats", pairs(&draws, 0, &draws, 0));
    let mirrored: Vec<Vec<f32>> = draws.iter().map(|u| vec![1.0 - U as f32 - u[0]]).collect();
    assert_complains("a scramble that only mirrors", pairs(&draws, 0, &mirrored, 0));
}

/// Mean of a function with kinks and products over the first `count` of some points.
fn mean_of(count: u32, draws: impl Fn(u32) -> Vec<f32>) -> f64 {
    let value = |u: Vec<f32>| f64::from(u[0] * u[1] * u[4]) + f64::from(u[2]).sqrt() + f64::from(u8::from(u[4] + u[5] < 0.5));
    (0..count).map(|sample| value(draws(sample))).sum::<f64>() / f64::from(count)
}

/// Estimates from any number of points are right on the mean over seeds, and far closer than chance.
#[test]
fn sobol_estimates_are_unbiased_and_closer_than_chance() {
    let cases = [(1, 0.9), (13, 1.3), (200, 2.5), (256, 2.5)];
    let expected = 0.125 + 2.0 / 3.0 + 0.125;
    let by_seed = |count, draws: &dyn Fn(u64, u32) -> Vec<f32>| -> (f64, f64) {
        let means: Vec<f64> = (0..2000).map(|seed| mean_of(count, |sample| draws(seed, sample))).collect();
        let mean = means.iter().sum::<f64>() / 2000.0;
        (mean, (means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 1999.0).sqrt())
    };
    let philox = RoomSettings { rng: Rng::Philox, ..RoomSettings::default() };
    for &(count, gain) in &cases[..of_run(3, 4)] {
        let (mean, deviation) = by_seed(count, &|seed, sample| sobol_draws(seed, 0, sample, 1));
        assert_holds(format!("{count} points"), z_check("mean", mean, expected, deviation / 2000f64.sqrt()));
        let chance = by_seed(count, &|seed, sample| draws_of(Streams { seed, ..streams_of(&philox) }, 0, sample, 1)).1;
        println!("{count} points: standard deviation {deviation:.2e}, by chance {chance:.2e}, {:.1} times", chance / deviation);
        assert!(chance > gain * deviation, "{count} points: {deviation} against {chance} by chance");
        let plain = |sample: u32| {
            let point = sobol_point(sample).map(|word| (word >> 8) as f32 / 16_777_216.0);
            [point, point].concat()
        };
        let unscrambled = mean_of(count, plain);
        assert_complains("points without scrambling", z_check("mean", unscrambled, expected, deviation / 2000f64.sqrt()));
    }
}

/// Photons of real runs of the open box: with Sobol' points as many on the mean meet a wall at first and are stored at each
/// bounce, and at first their number differs far less from seed to seed.
#[test]
fn sobol_photons_are_as_many_with_less_noise() {
    // Probability that the first flight ends on a wall, in closed form, and of being stored at bounces 1 to 5, by
    // radiosity; and how much smaller a variance than chance's is asked. All draws of a first flight are of one block of
    // points. Those of a bounce are shuffled anew, so that it is chance which of them meet the 78 % that are on a wall:
    // of stored photons 0.78 * 0.22 * 0.75 * 0.25 remains of a variance of 0.59 * 0.41, a share of 1 in 7.5.
    const KNOWN: [(&str, f64, f64); 6] = [
        ("on a wall", 0.781_900_4, 20.0),
        ("stored at bounce 1", 0.586_425_3, 3.5),
        ("stored at bounce 2", 0.354_047_5, 1.0),
        ("stored at bounce 3", 0.217_227_2, 0.5),
        ("stored at bounce 4", 0.133_102_6, 0.5),
        ("stored at bounce 5", 0.081_816_5, 0.5),
    ];
    let (photons, seeds) = (1 << 15, 24u32);
    let runs = |rng| -> Vec<Vec<f64>> {
        let run = |seed| {
            let settings = RoomSettings { rng, seed, photons, bounces: 5, mesh: 1, threads: 2, ..RoomSettings::default() };
            let fates = &run_on_cpu(&settings).fates[0];
            let stored = fates.bounces.iter().map(|bounce| bounce.stored);
            [fates.bounces[0].stored + fates.bounces[0].absorbed].into_iter().chain(stored).map(|count| count as f64).collect()
        };
        (1..=u64::from(seeds)).map(run).collect()
    };
    let trials = f64::from(photons);
    let check = |runs: &[Vec<f64>]| -> Check {
        for (place, (what, probability, least)) in KNOWN.iter().enumerate() {
            let mean = runs.iter().map(|run| run[place]).sum::<f64>() / f64::from(seeds);
            let variance = runs.iter().map(|run| (run[place] - mean).powi(2)).sum::<f64>() / f64::from(seeds - 1);
            let chance = trials * probability * (1.0 - probability);
            println!("{what}: {mean:.1} photons, {:.1} times less variance than by chance", chance / variance);
            // With the error that chance would have: the points' own is smaller.
            z_check(what, mean, trials * probability, (chance / f64::from(seeds)).sqrt())?;
            require(chance >= least * variance, || {
                format!("{what}: {:.1} times less variance than by chance, where {least} are asked", chance / variance)
            })?;
        }
        Ok(())
    };
    let sobol = runs(Rng::Sobol);
    assert_holds("Sobol' points", check(&sobol));
    assert_complains("chance", check(&runs(Rng::Philox)));
    let fewer: Vec<Vec<f64>> = sobol.iter().map(|run| run.iter().map(|count| 0.99 * count).collect()).collect();
    assert_complains("one per cent less", check(&fewer));
}
