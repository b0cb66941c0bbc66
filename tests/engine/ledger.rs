//! The photon ledger: emitted = absorbed + escaped + cut off + dropped, in integers, with nothing
//! dropped, and the same for every builder.

use crate::common::pairwise::pairwise;
use crate::common::prelude::*;
use photonmill::ledger::{BounceFates, Fates};

/// Every path that entered a bounce has one fate there, and who was stored enters the next.
fn closes(fates: &Fates, emitted: u64) -> Check {
    require(fates.emitted == emitted, || format!("{} photons emitted instead of {emitted}", fates.emitted))?;
    let mut entering = emitted;
    for (bounce, BounceFates { stored, absorbed, escaped, dropped }) in fates.bounces.iter().enumerate() {
        require(stored + absorbed + escaped + dropped == entering, || {
            format!("bounce {}: {entering} paths had {stored} + {absorbed} + {escaped} + {dropped} fates", bounce + 1)
        })?;
        require(*dropped == 0, || format!("bounce {}: {dropped} photons dropped", bounce + 1))?;
        entering = *stored;
    }
    let ledger = fates.ledger();
    let sum = ledger.absorbed + ledger.escaped + ledger.cut_off + ledger.dropped;
    require(ledger.closes() && sum == emitted && ledger.cut_off == entering, || format!("{ledger:?} does not close"))?;
    require(ledger.stored == fates.bounces.iter().map(|bounce| bounce.stored).sum::<u64>(), || {
        format!("{ledger:?} does not hold what the bounces stored")
    })?;
    Ok(())
}

/// The fates of a run's photons, if its ledger closes.
pub fn closed_fates(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> Result<Fates, Complaint> {
    let fates = room_result_of(gpu, scene, settings)?.fates[0].clone();
    closes(&fates, settings.total_photons()).map_err(|text| Complaint::new(Kind::LedgerOpen, text))?;
    Ok(fates)
}

/// The fates of the device's builders and of the CPU's, all alike and all closed. A photon whose fate
/// hangs on the last bit is rarer than one in 1e5, and these runs are smaller.
fn fates(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> Fates {
    let total = settings.total_photons();
    let expected = run_scene_on_cpu(scene, settings).fates[0].clone();
    assert_holds(format!("cpu\n{settings:?}"), closes(&expected, total));
    for builder in Builder::ON_GPU {
        let settings = RoomSettings { builder, paranoid: true, ..settings.clone() };
        let found = closed_fates(gpu, scene, &settings).unwrap_or_else(|complaint| panic!("{settings:?}: {complaint}"));
        assert_eq!(found, expected, "{settings:?}");
    }
    expected
}

/// Small meshes: the film is not what is asked here.
fn small() -> RoomSettings {
    RoomSettings { mesh: 4, ..RoomSettings::default() }
}

#[test]
fn every_builder_closes_the_ledger_alike() {
    let Some(gpu) = device() else { return };
    let (reflectances, all_bounces, counts) = ([0.0, 0.75, 1.0], [1, 2, 15, 200], [(2, None), (501, None), (5000, Some(1701))]);
    for row in pairwise(&[reflectances.len(), all_bounces.len(), counts.len()]) {
        let (reflectance, bounces, (photons, chunk)) = (reflectances[row[0]], all_bounces[row[1]], counts[row[2]]);
        let settings = RoomSettings { photons, reflectance, bounces, chunk, ..small() };
        let ledger = fates(&gpu, &open_box(&settings), &settings).ledger();
        assert_eq!(ledger.emitted, u64::from(photons));
        assert!(reflectance < 1.0 || ledger.absorbed == 0, "white walls absorb nothing: {ledger:?}");
        assert!(reflectance > 0.0 || (ledger.stored, ledger.cut_off) == (0, 0), "black walls store nothing: {ledger:?}");
    }
}

#[test]
fn generators_rounds_and_lights_close_it_too() {
    let Some(gpu) = device() else { return };
    for rng in [Rng::Rand48, Rng::Mt, Rng::Philox] {
        let settings = RoomSettings { rng, photons: 333, rounds: 7, light_power: [1.0, 0.01], emission: EmissionLaw::Cosine, ..small() };
        fates(&gpu, &open_box(&settings), &settings);
        let one_at_a_time = RoomSettings { chunk: Some(2), photons: 21, rounds: 2, ..settings };
        fates(&gpu, &open_box(&one_at_a_time), &one_at_a_time);
    }
}

/// Everything that hits a black wall is absorbed, the rest escapes: the share is the probability that
/// the first flight ends on a wall, in closed form 0.7819004 (uniform) and 0.8095237 (cosine).
#[test]
fn black_walls_absorb_the_first_flights_hits() {
    let Some(gpu) = device() else { return };
    for (emission, probability) in [(EmissionLaw::Uniform, 0.781_900_4), (EmissionLaw::Cosine, 0.809_523_7)] {
        let settings = RoomSettings { emission, reflectance: 0.0, bounces: 3, photons: 500_001, rng: Rng::Philox, ..small() };
        let ledger = run(&gpu, &settings).ledger();
        assert_eq!((ledger.stored, ledger.cut_off), (0, 0));
        let what = format!("{emission:?}: share of first flights that end on a wall");
        assert_holds(&what, share_check(&what, ledger.absorbed, ledger.emitted, probability));
        assert_complains("one percent more", share_check(&what, ledger.absorbed * 101 / 100, ledger.emitted, probability));
    }
}

/// With a sixth wall instead of the opening nobody escapes, and white walls store every photon at
/// every bounce: photons * bounces in all.
#[test]
fn a_closed_white_room_stores_everything() {
    let Some(gpu) = device() else { return };
    let settings = RoomSettings { reflectance: 1.0, photons: 777, ..small() };
    let mut scene = closed_box(&settings, 1.0);
    let white = fates(&gpu, &scene, &settings).ledger();
    assert_eq!((white.stored, white.cut_off), (777 * 15, 777));
    assert_eq!((white.absorbed, white.escaped), (0, 0));

    // Half-grey: each bounce stores half of what the last one did, so 1 - 2^-15 in all.
    let grey = RoomSettings { reflectance: 0.5, photons: 100_001, rng: Rng::Philox, ..settings };
    scene.faces.iter_mut().flatten().for_each(|wall| wall.albedo = 0.5);
    let found = fates(&gpu, &scene, &grey);
    assert_eq!(found.ledger().escaped, 0);
    for (bounce, fates) in found.bounces.iter().enumerate() {
        let what = format!("stored at bounce {}", bounce + 1);
        assert_holds(&what, share_check(&what, fates.stored, found.emitted, 0.5f64.powi(bounce as i32 + 1)));
    }
}

/// The naive map has `photons * bounces` slots, so a large round must split where a buffer ends, and
/// no photon may notice.
#[test]
fn a_round_larger_than_a_buffer_splits_and_drops_nothing() {
    let Some(gpu) = device() else { return };
    let largest = gpu.facts().storage_buffer_range_bytes.min(gpu.facts().allocation_bytes);
    // Photons whose map with all bounces is just larger than one buffer of lavapipe, 128 MiB.
    let photons = 600_001;
    let settings = RoomSettings { photons, rng: Rng::Philox, ..small() };
    let expected = run_on_cpu(&RoomSettings { threads: 2, ..settings.clone() }).fates[0].clone();
    for builder in Builder::ON_GPU {
        let result = run(&gpu, &RoomSettings { builder, ..settings.clone() });
        if largest < size_of::<StoredPhoton>() as u64 * 15 * u64::from(photons) {
            assert!(result.plan.chunks_per_round > 1, "{builder:?}");
        }
        assert_holds(format!("{builder:?}"), closes(&result.fates[0], u64::from(photons)));
        let flips: u64 = pairs(&result.fates[0].bounces, &expected.bounces).map(|(a, b)| a.stored.abs_diff(b.stored)).sum();
        assert!(flips <= 3, "{builder:?}: {flips} stored photons more or less than the CPU's");
    }
}

/// What is spoiled, and how.
type Spoil = (&'static str, fn(&mut Fates));

#[test]
fn the_check_complains_about_lost_and_doubled_photons() {
    let settings = small();
    let fates = run_on_cpu(&settings).fates[0].clone();
    assert_holds("the run itself", closes(&fates, 5000));
    let spoils: [Spoil; 5] = [
        ("a stored photon lost", |fates| fates.bounces[3].stored -= 1),
        ("an absorbed photon counted twice", |fates| fates.bounces[0].absorbed += 1),
        ("an escape booked at the next bounce", |fates| {
            fates.bounces[0].escaped -= 1;
            fates.bounces[1].escaped += 1;
        }),
        ("a photon dropped", |fates| {
            fates.bounces[14].absorbed -= 1;
            fates.bounces[14].dropped += 1;
        }),
        ("a photon emitted twice", |fates| fates.emitted += 1),
    ];
    for (what, spoil) in spoils {
        let mut spoiled = fates.clone();
        spoil(&mut spoiled);
        assert_complains(what, closes(&spoiled, 5000));
    }
}
