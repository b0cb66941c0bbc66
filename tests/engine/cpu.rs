//! The CPU builder: the same photons and the same film whatever the threads and whatever the vectors; and splatting adds
//! to each texel what brute force finds there, to the bit.

use crate::common::prelude::*;
use photonmill::constants::NO_WALL;
use photonmill::cpu::estimate::gather_brute;
use photonmill::cpu::splat::Splats;
use photonmill::cpu::trace::{Block, Tracer};
use photonmill::records::Tally;
use photonmill::settings::PhongDirection;
use pulp::Arch;
use rayon::ThreadPoolBuilder;

/// Those that this machine has; plain code is the first.
fn kinds_of_vectors() -> Vec<Arch> {
    let mut kinds = vec![Arch::Scalar];
    #[cfg(target_arch = "x86_64")]
    {
        kinds.extend(pulp::x86::V3::try_new().map(Arch::V3));
        kinds.extend(pulp::x86::V4::try_new().map(Arch::V4));
    }
    #[cfg(target_arch = "aarch64")]
    kinds.extend(pulp::aarch64::Neon::try_new().map(Arch::Neon));
    kinds
}

/// Each of them, with so many threads.
fn vectors_and_threads() -> impl Iterator<Item = (Arch, usize)> {
    kinds_of_vectors().into_iter().flat_map(|vectors| [1, 3].map(|threads| (vectors, threads)))
}

/// A block's photons and fates.
type Traced = (Vec<Photon>, Vec<Tally>);

/// Of round 1, block by block.
fn traced(scene: &RoomScene, plan: &RoomPlan, vectors: Arch, threads: usize) -> Vec<Traced> {
    let tracer = Tracer::with_vectors(scene, plan, vectors);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let mut blocks = Vec::new();
    // Once before, so that the memory is not new.
    pool.install(|| tracer.trace(0, &plan.chunk(0), &mut blocks));
    pool.install(|| tracer.trace(1, &plan.chunk(0), &mut blocks));
    blocks.into_iter().map(|block| (block.photons, block.tallies)).collect()
}

fn same_blocks(found: &[Traced], expected: &[Traced]) -> Check {
    let same = |(a, b): (&Traced, &Traced)| bytemuck::cast_slice::<_, u32>(&a.0) == bytemuck::cast_slice::<_, u32>(&b.0) && a.1 == b.1;
    require(found.len() == expected.len(), || format!("{} blocks instead of {}", found.len(), expected.len()))?;
    let differing = pairs(found, expected).position(|blocks| !same(blocks));
    differing.map_or(Ok(()), |place| Err(format!("block {place} of {} differs", expected.len())))
}

#[test]
fn neither_threads_nor_vectors_change_a_photon() {
    println!("{:?}", kinds_of_vectors());
    for rng in [Rng::Rand48, Rng::Mt, Rng::Philox, Rng::Sobol] {
        for (emission, shininess) in
            [(EmissionLaw::Uniform, [None; 5]), (EmissionLaw::Cosine, [Some(2.0), None, Some(0.5), Some(0.0), Some(50.0)])]
        {
            for photons in [2, 33, 513, 10_007] {
                let phong_direction = if photons % 2 == 0 { PhongDirection::Mirror } else { PhongDirection::Sampled };
                let walls = RoomSettings { shininess, phong_direction, ..RoomSettings::default() };
                let lights = RoomSettings { emission, light_power: [3.0, 0.5], ..walls };
                let settings = RoomSettings { photons, rounds: 2, rng, chunk: Some(photons), ..lights };
                let (scene, plan) = (open_box(&settings), plan_for_host(&settings));
                let expected = traced(&scene, &plan, Arch::Scalar, 1);
                assert!(photons < 500 || expected.iter().map(|(photons, _)| photons.len()).sum::<usize>() > photons as usize);
                for (vectors, threads) in vectors_and_threads() {
                    let found = traced(&scene, &plan, vectors, threads);
                    let what = format!("{rng:?}, {emission:?}, {photons} photons, {vectors:?}, {threads} threads");
                    assert_holds(&what, same_blocks(&found, &expected));
                    if photons == 513 {
                        let mut spoiled = found.clone();
                        let x = &mut spoiled[1].0[3].position.x;
                        *x = f32::from_bits(x.to_bits() ^ 1);
                        assert_complains("one bit", same_blocks(&spoiled, &expected));
                        let mut spoiled = found;
                        spoiled[0].1[2].escaped += 1;
                        assert_complains("one fate", same_blocks(&spoiled, &expected));
                    }
                }
            }
        }
    }
}

#[test]
fn threads_change_no_bit_of_a_film() {
    let two = || RoomSettings { photons: 5001, rounds: 2, ..RoomSettings::default() };
    for (what, settings) in [
        ("one channel", RoomSettings { photons: 20_001, rounds: 3, rng: Rng::Philox, ..RoomSettings::default() }),
        ("two channels", RoomSettings { shininess: [Some(2.0); 5], light_power: [2.0, 1.0], mesh: 37, ..two() }),
        ("chunks", RoomSettings { chunk: Some(700), radius: 0.3, ..two() }),
        ("floats", RoomSettings { sums: Sums::F32, ..two() }),
    ] {
        let expected = run_on_cpu(&RoomSettings { threads: 1, ..settings.clone() });
        for threads in [2, 3, 8] {
            let found = run_on_cpu(&RoomSettings { threads, ..settings.clone() });
            assert_eq!(found.film, expected.film, "{what}, {threads} threads");
            assert_eq!(found.fates, expected.fates, "{what}, {threads} threads");
        }
        assert!(expected.film.sums.iter().any(|sum| *sum > 0));
        if what == "chunks" {
            assert_eq!(run_on_cpu(&RoomSettings { gather: Gather::Brute, ..settings }).film, expected.film, "by brute force");
        }
    }
}

fn splatted(plan: &RoomPlan, photons: &[Photon], vectors: Arch, threads: usize) -> Vec<u64> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let mut sums = vec![0; plan.points.len() * plan.channel_count as usize];
    pool.install(|| {
        let mut splats = Splats::new(plan, vectors);
        let blocks: Vec<Block> = photons.chunks(100).map(|photons| Block { photons: photons.to_vec(), ..Block::default() }).collect();
        // In two parts, of which the first is flushed by itself.
        let (first, rest) = blocks.split_at(blocks.len() / 3);
        splats.add(first);
        splats.flush(&mut sums);
        rest.chunks(2).for_each(|blocks| splats.add(blocks));
        splats.flush(&mut sums);
        // Nothing is left.
        splats.flush(&mut sums);
    });
    sums
}

/// Photons all over a room, a step of f32 beside the rims of texels, beyond the walls, and no photons at all.
fn photons_around(plan: &RoomPlan, scene: &RoomScene, count: u32) -> Vec<Photon> {
    let radius = plan.settings.radius as f32;
    (0..count)
        .map(|photon| {
            let words = philox([photon, 0, 0, 0], [5, 6]);
            let unit = |word: u32| (word >> 8) as f32 / (1 << 24) as f32;
            let point = plan.points[words[0] as usize % plan.points.len()];
            let (own, wall) = (point.wall as usize / 2, point.wall);
            let (s, t) = ((own + 1) % 3, (own + 2) % 3);
            let mut position = point.position;
            match photon % 8 {
                // Anywhere on the wall, or a little off its edges.
                0..4 => {
                    for axis in [s, t] {
                        let (min, max) = (scene.min_corner[axis] as f32, scene.max_corner[axis] as f32);
                        position[axis] = min + (1.2 * unit(words[axis]) - 0.1) * (max - min);
                    }
                }
                // As far from a texel as the radius is, give or take the last bits, along an axis or a diagonal.
                4 | 5 => {
                    let angle = if photon % 16 < 8 { std::f32::consts::FRAC_PI_2 * (words[1] % 4) as f32 } else { 6.3 * unit(words[1]) };
                    position[s] += radius * angle.cos();
                    position[t] += radius * angle.sin();
                    position[s] = f32::from_bits(position[s].to_bits().wrapping_add(words[2] % 5).wrapping_sub(2));
                }
                // On a texel, and off its plane.
                6 => position[own] += radius * (unit(words[1]) - 0.5) * 2.2,
                _ => match words[1] % 5 {
                    0 => position = Vec3::NAN,
                    1 => position[s] = f32::NAN,
                    2 => position[t] = f32::INFINITY,
                    3 => position[s] = -1e30,
                    _ => return Photon { wall: NO_WALL, ..Photon::default() },
                },
            }
            Photon { position, wall, flux: 1.0 - 0.9 * unit(words[3]), weight: unit(words[2]), photon, bounce: 0 }
        })
        .collect()
}

fn slab(settings: &RoomSettings) -> RoomScene {
    let cube = open_box(settings);
    RoomScene { min_corner: DVec3::new(-0.25, -1.0, 3.0), max_corner: DVec3::new(0.25, 1.5, 3.1), ..cube }
}

#[test]
fn splats_are_the_sums_of_brute_force() {
    for (mesh, radius, count) in [
        (1, 0.5, 300),
        (2, 0.3, 300),
        (3, 0.05, 300),
        (16, 0.5, 300),
        (17, 1e-5, 1000),
        (37, 0.05, 2000),
        (64, 0.05, 2000),
        (100, 0.1, 300),
        (128, 0.003, 2000),
    ] {
        for shininess in [[None; 5], [Some(2.0); 5]] {
            let settings =
                RoomSettings { mesh, radius, photons: count, bounces: 1, rng: Rng::Philox, shininess, ..RoomSettings::default() };
            for scene in [open_box(&settings), slab(&settings)] {
                let plan = RoomPlan::new(&scene, &settings, &Limits::of_host()).unwrap();
                let photons = photons_around(&plan, &scene, count);
                let mut expected = vec![0; plan.points.len() * plan.channel_count as usize];
                gather_brute(&plan, &photons, &mut expected);
                assert!(expected.iter().any(|sum| *sum > 0));
                for (vectors, threads) in vectors_and_threads() {
                    let found = splatted(&plan, &photons, vectors, threads);
                    let what = format!("mesh {mesh}, radius {radius}, {vectors:?}, {threads} threads");
                    assert_holds(what, equal_sums("film", &found, &expected));
                }
                let mut larger = plan.clone();
                larger.settings.radius *= 1.2;
                if mesh >= 16 && radius >= 0.05 {
                    assert_complains("a larger radius", equal_sums("film", &splatted(&larger, &photons, Arch::Scalar, 1), &expected));
                }
                let less = splatted(&plan, &photons[..count as usize / 2], Arch::Scalar, 1);
                assert_complains("half of the photons", equal_sums("film", &less, &expected));
            }
        }
    }
}
