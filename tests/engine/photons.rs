//! Same photons: whatever stores them, in whatever groups and chunks, the photon map of a seed is the
//! same set, bit for bit on one device, and the CPU builder agrees photon by photon.

use crate::common::MANY_PHOTONS;
use crate::common::pairwise::pairwise;
use crate::common::prelude::*;
use photonmill::engine::room::photons_on_gpu;
use photonmill::rng::{self, Streams};
use photonmill::settings::PhongDirection;

const GENERATORS: [Rng; 4] = [Rng::Rand48, Rng::Mt, Rng::Philox, Rng::Sobol];
/// Around subgroups of 8, 32 and 64, around the work group of 128, and two odd numbers of photons.
const COUNTS: [u32; 12] = [2, 3, 7, 8, 9, 31, 63, 64, 65, 129, 1000, 5001];

/// No photon is stored twice at a bounce, none at a bounce before which it was not stored, none
/// outside the numbers of the round.
fn each_once(found: &[Photon], photon_count: u32, bounces: u32) -> Check {
    let seen: HashSet<(u32, u32)> = found.iter().map(|photon| (photon.photon, photon.bounce)).collect();
    require(seen.len() == found.len(), || format!("{} of {} photons are there twice", found.len() - seen.len(), found.len()))?;
    for &(photon, bounce) in &seen {
        require(photon < photon_count && bounce < bounces, || {
            format!("photon {photon} at bounce {bounce} is none of {photon_count} with {bounces} bounces")
        })?;
        require(bounce == 0 || seen.contains(&(photon, bounce - 1)), || {
            format!("photon {photon} was stored at bounce {bounce} and not before")
        })?;
    }
    Ok(())
}

/// Some builders on the device store what the naive one does; returns it.
fn builders_agree(gpu: &Gpu, builders: &[Builder], settings: &RoomSettings) -> Vec<Photon> {
    let of = |builder| photons(gpu, &RoomSettings { builder, ..settings.clone() });
    let expected = of(Builder::Naive);
    let what = |builder| format!("{:?}", RoomSettings { builder, ..settings.clone() });
    assert_holds(what(Builder::Naive), each_once(&expected, settings.photons, settings.bounces));
    for &builder in builders {
        let found = of(builder);
        assert_holds(what(builder), each_once(&found, settings.photons, settings.bounces));
        assert_holds(what(builder), same_photons(&found, &expected));
    }
    expected
}

#[test]
fn builders_store_the_same_photons_at_every_count() {
    let Some(gpu) = device() else { return };
    for (place, photons) in COUNTS.into_iter().enumerate() {
        let rng = GENERATORS[place % GENERATORS.len()];
        let stored = builders_agree(&gpu, &Builder::ON_GPU, &RoomSettings { photons, rng, ..RoomSettings::default() });
        // Empty maps would agree with each other; a handful of photons may all be absorbed.
        assert!(photons < 63 || stored.len() as u32 > photons, "{rng:?}, {photons} photons stored {}", stored.len());
    }
}

/// So many that an invocation of the persistent builder takes several; and the longest paths that it takes, in a closed
/// white room.
#[test]
fn a_persistent_invocation_takes_photon_after_photon() {
    let Some(gpu) = device() else { return };
    let agreed = |scene: &RoomScene, settings: &RoomSettings| {
        let of = |builder| photons_on_gpu(&gpu, scene, &RoomSettings { builder, ..settings.clone() }).unwrap();
        let found = of(Builder::Persistent);
        assert_holds(format!("{settings:?}"), same_photons(&found, &of(Builder::Atomic)));
        found.len()
    };
    let many = RoomSettings { photons: MANY_PHOTONS, chunk: Some(MANY_PHOTONS), rng: Rng::Mt, ..RoomSettings::default() };
    agreed(&open_box(&many), &many);
    for (rng, bounces) in [(Rng::Philox, 320), (Rng::Sobol, 320), (Rng::Mt, 74)] {
        let endless = RoomSettings { photons: 257, bounces, reflectance: 1.0, rng, ..RoomSettings::default() };
        assert_eq!(agreed(&closed_box(&endless, 1.0), &endless), 257 * bounces as usize, "{rng:?}");
    }
    let longer = RoomSettings { builder: Builder::Persistent, bounces: 321, rng: Rng::Philox, ..RoomSettings::default() };
    let refused = longer.validate().unwrap_err().to_string();
    assert!(refused.starts_with("`bounces` 321: "), "{refused}");
}

#[test]
fn the_scanning_builder_keeps_photons_in_their_order() {
    let Some(gpu) = device() else { return };
    for (photon_count, group_size, chunk) in [(65, 64, None), (5001, 128, None), (5000, 32, Some(777))] {
        let settings = RoomSettings { builder: Builder::Scan, photons: photon_count, group_size, chunk, ..RoomSettings::default() };
        let map: Vec<(u32, u32)> = photons(&gpu, &settings).iter().map(|photon| (photon.bounce, photon.photon)).collect();
        // Chunks come one after the other, and each begins with its first bounce.
        let chunks = map.chunk_by(|before, after| before.0 <= after.0);
        assert_eq!(chunks.clone().count() as u32, plan_for(&gpu, &open_box(&settings), &settings).chunks_per_round);
        for (number, chunk) in chunks.enumerate() {
            assert!(chunk.is_sorted(), "{photon_count} photons, groups of {group_size}, chunk {number}");
        }
    }
}

#[test]
fn builders_store_the_same_photons_for_every_effect() {
    let Some(gpu) = device() else { return };
    let emissions = [EmissionLaw::Uniform, EmissionLaw::Cosine];
    let walls = [[None; 5], [Some(2.0), None, Some(0.5), Some(0.0), Some(50.0)]];
    for row in pairwise(&[Builder::ON_GPU.len(), GENERATORS.len(), emissions.len(), walls.len()]) {
        for photons in [65, 1000] {
            let (rng, emission, shininess) = (GENERATORS[row[1]], emissions[row[2]], walls[row[3]]);
            let settings = RoomSettings { photons, rng, emission, shininess, ..RoomSettings::default() };
            builders_agree(&gpu, &[Builder::ON_GPU[row[0]]], &settings);
        }
    }
    let sampled = RoomSettings { phong_direction: PhongDirection::Sampled, shininess: [Some(2.0); 5], ..RoomSettings::default() };
    builders_agree(&gpu, &Builder::ON_GPU, &sampled);
    builders_agree(&gpu, &Builder::ON_GPU, &RoomSettings { light_power: [3.0, 0.5], ..RoomSettings::default() });
}

#[test]
fn group_sizes_and_chunks_change_no_photon() {
    let Some(gpu) = device() else { return };
    let settings = RoomSettings { photons: 1001, ..RoomSettings::default() };
    // One that carries its state in the path, and one that has none.
    let rngs = [Rng::Rand48, Rng::Philox];
    let group_sizes: Vec<u32> = [32, 128, 1024].into_iter().filter(|size| *size <= gpu.facts().work_group_size).collect();
    let chunks = [None, Some(65), Some(1000), Some(5000)];
    let of = |rng| photons(&gpu, &RoomSettings { rng, ..settings.clone() });
    let expected = rngs.map(of);
    let ways = pairwise(&[Builder::ON_GPU.len(), group_sizes.len(), chunks.len(), rngs.len()]).into_iter().map(|row| {
        let (builder, group_size, chunk, rng) = (Builder::ON_GPU[row[0]], group_sizes[row[1]], chunks[row[2]], rngs[row[3]]);
        (row[3], RoomSettings { rng, builder, group_size, chunk, ..settings.clone() })
    });
    let striped = [(2, 32, None), (8, 128, Some(500)), (64, 32, Some(500))].into_iter().flat_map(|(counters, group_size, chunk)| {
        let of = RoomSettings { counters: Some(counters), group_size, chunk, builder: Builder::Atomic, ..settings.clone() };
        [0, 1].map(|place| (place, RoomSettings { rng: rngs[place], ..of.clone() }))
    });
    for (rng, other) in ways.chain(striped) {
        let found = photons(&gpu, &other);
        assert_holds(format!("{other:?}"), each_once(&found, settings.photons, settings.bounces));
        assert_holds(format!("{other:?}"), same_photons(&found, &expected[rng]));
    }
}

#[test]
fn two_naive_bounces_are_the_first_two_of_fifteen() {
    let Some(gpu) = device() else { return };
    for rng in GENERATORS {
        let settings = RoomSettings { rng, ..RoomSettings::default() };
        let naive = photons(&gpu, &RoomSettings { builder: Builder::Naive, bounces: 2, ..settings.clone() });
        let mut modified = photons(&gpu, &settings);
        assert!(modified.iter().any(|photon| photon.bounce >= 10), "{rng:?}");
        modified.retain(|photon| photon.bounce < 2);
        assert_holds(format!("{rng:?}"), same_photons(&naive, &modified));
    }
}

/// How two maps of the same photons differ where rounding may differ.
#[derive(Debug)]
struct Disagreement {
    /// Photons with another fate: another wall, or stored by one builder alone.
    flipped: usize,
    /// Metres, of the pairs that remain, sorted.
    distances: Vec<f64>,
    /// Of the Phong weights, sorted.
    weights: Vec<f64>,
}

impl Disagreement {
    fn between(found: &[Photon], expected: &[Photon]) -> Disagreement {
        let mut by_key: HashMap<(u32, u32), Photon> = found.iter().map(|photon| ((photon.photon, photon.bounce), *photon)).collect();
        let mut flipped = HashSet::new();
        let (mut distances, mut weights) = (Vec::new(), Vec::new());
        for photon in expected {
            match by_key.remove(&(photon.photon, photon.bounce)) {
                Some(twin) if twin.wall == photon.wall && twin.flux == photon.flux => {
                    distances.push(f64::from(twin.position.distance(photon.position)));
                    weights.push(f64::from((twin.weight - photon.weight).abs()));
                }
                _ => {
                    flipped.insert(photon.photon);
                }
            }
        }
        flipped.extend(by_key.keys().map(|(photon, _)| *photon));
        distances.sort_by(f64::total_cmp);
        weights.sort_by(f64::total_cmp);
        Disagreement { flipped: flipped.len(), distances, weights }
    }

    /// The bounds for the same random words in two arithmetics of f32 accuracy: other fates for at
    /// most 1e-5 of the photons; positions 7e-8 m apart in the median, 1.1e-5 at 99.9 % and 2e-3 at
    /// most (grazing paths) between one of them and f64, so twice that between the two.
    fn check(&self, photon_count: u32) -> Check {
        let at = |sorted: &[f64], share: f64| sorted.get((sorted.len() as f64 * share) as usize).copied().unwrap_or(0.0);
        let worst = |sorted: &[f64]| sorted.last().copied().unwrap_or(0.0);
        let allowed_flips = f64::from(photon_count) * 1e-5;
        let bounds = [
            ("photons with another fate", self.flipped as f64, allowed_flips),
            ("median distance", at(&self.distances, 0.5), 1.4e-7),
            ("distance at 99.9 %", at(&self.distances, 0.999), 2.2e-5),
            ("largest distance", worst(&self.distances), 4e-3),
            // A weight is a function of position and direction with a slope of about its exponent.
            ("median difference of weights", at(&self.weights, 0.5), 1e-5),
            ("difference of weights at 99.9 %", at(&self.weights, 0.999), 1e-3),
        ];
        let within =
            |(what, value, bound): (&str, f64, f64)| require(value <= bound, || format!("{what}: {value} where {bound} is allowed"));
        bounds.into_iter().try_for_each(within)
    }
}

/// And with itself, in chunks.
#[test]
fn the_cpu_builder_agrees_photon_by_photon() {
    let gpu = device();
    for (place, rng) in GENERATORS.into_iter().enumerate() {
        let (emission, shininess) = [(EmissionLaw::Uniform, [None; 5]), (EmissionLaw::Cosine, [Some(2.0); 5])][place % 2];
        let settings = RoomSettings { photons: 100_001, rng, emission, shininess, threads: 2, ..RoomSettings::default() };
        let expected = photons_on_cpu(&settings);
        assert_holds(format!("{rng:?}"), each_once(&expected, settings.photons, settings.bounces));
        let in_chunks = photons_on_cpu(&RoomSettings { chunk: Some(640), threads: 3, ..settings.clone() });
        assert_holds(format!("{rng:?}, in chunks"), same_photons(&in_chunks, &expected));
        let Some(gpu) = &gpu else { continue };
        let disagreement = Disagreement::between(&photons(gpu, &settings), &expected);
        assert!(disagreement.distances.len() > 145_000);
        let [distance, weight] = [&disagreement.distances, &disagreement.weights].map(|sorted| sorted.last().unwrap());
        println!("{rng:?}, {emission:?}: {} flipped, distance up to {distance:e}, weights up to {weight:e}", disagreement.flipped);
        assert_holds(format!("{rng:?}, {emission:?}"), disagreement.check(settings.photons));
    }
}

#[test]
fn no_two_photons_draw_the_same_numbers() {
    for rng in GENERATORS {
        let settings = RoomSettings { rng, photons: 10_001, rounds: 3, ..RoomSettings::default() };
        let streams = streams_of(&settings);
        let bits = |draws: &[f32]| draws.iter().map(|draw| draw.to_bits()).collect::<Vec<u32>>();
        let (mut emissions, mut bounces) = (HashSet::new(), HashSet::new());
        let mut before = vec![0; 4];
        for (round, photon) in (0..settings.rounds).flat_map(|round| (0..settings.photons).map(move |photon| (round, photon))) {
            let what = format!("{rng:?}, round {round}, photon {photon}");
            // Those of some are enough.
            let draws = draws_of(streams, round, photon, if photon < 3001 { settings.bounces } else { 0 });
            assert!(draws.iter().all(|draw| (0.0..1.0).contains(draw)), "{what}: {draws:?}");
            let emission = bits(&draws[..4]);
            // Four draws of 24 bits hold no birthday among 30 003 photons but with chance 1e-20.
            assert!(emissions.insert(emission.clone()), "{what} repeats {emission:?}");
            let repeated = emission.iter().zip(&before).filter(|(now, then)| now == then).count();
            assert!(repeated < 2, "{what} repeats {repeated} draws of its neighbour");
            before = emission;
            for (bounce, draws) in draws[4..].chunks(3).enumerate() {
                // 135 045 triples of 24 bits each: a birthday has chance 2e-12.
                assert!(bounces.insert(bits(draws)), "{what}, bounce {bounce} repeats {draws:?}");
            }
        }
        // Another seed is another run.
        assert!(!emissions.contains(&bits(&draws_of(Streams { seed: 2, ..streams }, 0, 0, 0))), "{rng:?}");
    }
}

/// Outputs of MT19937 as its authors wrote it: 624 words seeded, all of them twisted, then tempered.
fn twister(seed: u32, count: usize) -> Vec<u32> {
    let mut words = vec![seed];
    for i in 1..624u32 {
        let last = words[i as usize - 1];
        words.push(1_812_433_253u32.wrapping_mul(last ^ (last >> 30)).wrapping_add(i));
    }
    for i in 0..624 {
        let mixed = (words[i] & 0x8000_0000) | (words[(i + 1) % 624] & 0x7fff_ffff);
        words[i] = words[(i + 397) % 624] ^ (mixed >> 1) ^ if mixed % 2 == 1 { 0x9908_b0df } else { 0 };
    }
    let temper = |mut y: u32| {
        y ^= y >> 11;
        y ^= (y << 7) & 0x9d2c_5680;
        y ^= (y << 15) & 0xefc6_0000;
        y ^ (y >> 18)
    };
    words.iter().take(count).map(|word| temper(*word)).collect()
}

#[test]
fn a_photons_draws_are_its_twisters_outputs_in_order() {
    assert_eq!(twister(5489, 3), [3_499_211_612, 581_869_302, 3_890_346_734]);
    let settings = RoomSettings { rng: Rng::Mt, bounces: rng::MT_MAX_BOUNCES, photons: 501, rounds: 2, ..RoomSettings::default() };
    let streams = streams_of(&settings);
    for (round, photon) in [(0, 0), (0, 1), (0, 500), (1, 0), (1, 77)] {
        // The first of the two words that a stream keeps is the first of the twister, its seed.
        let seed = rng::open_stream(Rng::Mt, &streams.key(round), photon, UVec2::ZERO).x;
        let draws = draws_of(streams, round, photon, settings.bounces);
        let expected: Vec<f32> = twister(seed, draws.len()).iter().map(|word| (word >> 8) as f32 / 16_777_216.0).collect();
        assert_eq!(draws, expected, "round {round}, photon {photon}");
    }
}

/// What is spoiled, and how it differs; whether photons are there twice or without the bounce before, and whether more than rounding
/// differs; and how to spoil it.
type Spoil = (&'static str, Kind, [bool; 2], fn(&mut Vec<Photon>));

#[test]
fn the_checks_complain_about_spoiled_maps() {
    let settings = RoomSettings::default();
    let map = photons_on_cpu(&settings);
    let once = |map: &[Photon], photons| each_once(map, photons, settings.bounces);
    let near = |found: &[Photon]| Disagreement::between(found, &map).check(settings.photons);
    assert_holds("the map itself", same_photons(&map, &map));
    assert_holds("the map itself", near(&map));
    let spoils: [Spoil; 8] = [
        ("a lost photon", Kind::PhotonsLost, [false, true], |map| map.truncate(map.len() - 1)),
        ("a doubled one", Kind::PhotonsAdded, [true, false], |map| map.push(map[100])),
        ("one in place of another", Kind::OtherPhotons, [true, true], |map| map[100] = map[101]),
        ("one ulp", Kind::OtherPhotons, [false; 2], |map| map[100].position.x = f32::from_bits(map[100].position.x.to_bits() + 1)),
        ("a weight", Kind::OtherPhotons, [false; 2], |map| map[100].weight *= 1.01),
        ("photons without their second bounce", Kind::PhotonsLost, [true, true], |map| map.retain(|photon| photon.bounce != 1)),
        ("a wall", Kind::OtherPhotons, [false, true], |map| map[100].wall ^= 1),
        ("a scale of 1e-5", Kind::OtherPhotons, [false, true], |map| map.iter_mut().for_each(|photon| photon.position *= 1.0 + 1e-5)),
    ];
    for (what, kind, [is_wrong, is_far], spoil) in spoils {
        let mut spoiled = map.clone();
        spoil(&mut spoiled);
        assert_complains_of(kind, what, same_photons(&spoiled, &map));
        if is_wrong {
            assert_complains(what, once(&spoiled, settings.photons));
        }
        if is_far {
            assert_complains(what, near(&spoiled));
        }
    }
    assert_complains("a photon beyond the round", once(&map, settings.photons - 1));
}
