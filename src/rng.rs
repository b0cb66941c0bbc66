//! Random numbers of a photon, a function of (seed, round, photon, draw) alone, so that every
//! builder, split and thread traces the same photons. Twin of `glsl/rng/rng.glsl`.
//!
//! What a photon draws from is always inlined, so that it is compiled for the vectors of the loops that call it
//! ([`crate::cpu::trace`]).

use glam::UVec2;
use serde::Serialize;

use crate::constants::{self, BOUNCE_DRAWS, EMISSION_DRAWS, MT_MIDDLE};
use crate::records::RandomKey;

/// Which generator a run draws from; each as the kernels' number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum Rng {
    /// The paper's: the C library's 48-bit generator, one sequence leap-frogged over the photons of
    /// a round (van Meel et al. 2008): photon i draws numbers i, i + N, i + 2N, ... of `srand48(seed)`.
    Rand48 = constants::RNG_RAND48,
    /// The paper's alternative: MT19937, seeded anew for each photon by a bijection of its number in
    /// the run, so that no two photons share a stream.
    Mt = constants::RNG_MT,
    /// Philox4x32-10 (Salmon et al. 2011), counter-based.
    Philox = constants::RNG_PHILOX,
    /// Owen-scrambled Sobol' points (Burley 2020). The photons of each light, over all rounds, are the
    /// first points of a sequence of the light's own, so that any number of rounds covers its emission
    /// and every bounce more evenly than chance; one sequence dealt out to two lights would leave each
    /// of them a part with gaps.
    Sobol = constants::RNG_SOBOL,
}

/// Bounces for which a photon's MT19937 stream suffices: its outputs 0 to 226 need nothing beyond
/// the 624 words that seeding makes.
pub(crate) const MT_MAX_BOUNCES: u32 = (624 - MT_MIDDLE - EMISSION_DRAWS) / BOUNCE_DRAWS;

/// x -> multiplier * x + increment mod 2^48: one or many steps of rand48.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Affine48 {
    pub multiplier: u64,
    pub increment: u64,
}

const MASK48: u64 = (1 << 48) - 1;

impl Affine48 {
    const IDENTITY: Affine48 = Affine48 { multiplier: 1, increment: 0 };
    /// One step of drand48.
    pub(crate) const STEP: Affine48 = Affine48 { multiplier: 0x5_DEEC_E66D, increment: 0xB };

    #[inline(always)]
    pub(crate) fn apply(self, state: u64) -> u64 {
        self.multiplier.wrapping_mul(state).wrapping_add(self.increment) & MASK48
    }

    /// First `self`, then `next`.
    fn then(self, next: Affine48) -> Affine48 {
        Affine48 { multiplier: next.multiplier.wrapping_mul(self.multiplier) & MASK48, increment: next.apply(self.increment) }
    }

    /// `count` steps at once, by repeated squaring.
    pub(crate) fn steps(count: u64) -> Affine48 {
        let mut result = Affine48::IDENTITY;
        let mut power = Affine48::STEP;
        let mut rest = count;
        while rest != 0 {
            if rest & 1 == 1 {
                result = result.then(power);
            }
            power = power.then(power);
            rest >>= 1;
        }
        result
    }
}

/// Low 32 bits and high bits of a 48- or 64-bit number, as GLSL takes them.
#[inline(always)]
pub(crate) fn words(value: u64) -> UVec2 {
    UVec2::new(value as u32, (value >> 32) as u32)
}

#[inline(always)]
fn from_words(words: UVec2) -> u64 {
    u64::from(words.x) | (u64::from(words.y) << 32)
}

/// The state one draw on.
#[inline(always)]
pub(crate) fn rand48_step(state: UVec2) -> UVec2 {
    words(Affine48::STEP.apply(from_words(state)))
}

/// State of `srand48(seed)`.
pub(crate) fn srand48(seed: u32) -> u64 {
    (u64::from(seed) << 16) | 0x330E
}

/// The streams of a run: what its seed, photons per round and draws per photon make of the generator.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Streams {
    pub rng: Rng,
    pub seed: u64,
    /// Photons of a round.
    pub photons: u32,
    pub draws_per_photon: u64,
}

impl Streams {
    /// The key that all photons of a round share.
    pub(crate) fn key(self, round: u32) -> RandomKey {
        // From one draw of a photon to its next.
        let leap = Affine48::steps(u64::from(self.photons));
        RandomKey {
            seed: words(self.seed),
            round,
            photons_before: round.wrapping_mul(self.photons),
            leap_multiplier: words(leap.multiplier),
            leap_increment: words(leap.increment),
        }
    }

    /// From the first state of photon i in round 0 to that of photon `first_photon` + i in `round`.
    pub(crate) fn jump(self, round: u32, first_photon: u32) -> Affine48 {
        // The caller has checked that a run's draws stay below 2^48 (RoomSettings::validate).
        Affine48::steps(u64::from(round) * u64::from(self.photons) * self.draws_per_photon + u64::from(first_photon))
    }

    /// First states of photons 0 to `count` - 1 of round 0: the initial set that, as the paper says,
    /// the host prepares. Later rounds and photons are reached from it by [`Streams::jump`]. Only
    /// rand48 needs any; the others get one unused entry.
    pub(crate) fn first_states(self, count: u32) -> Vec<UVec2> {
        if self.rng != Rng::Rand48 {
            return vec![UVec2::ZERO; self.first_state_count(count) as usize];
        }
        let mut state = srand48(self.seed as u32);
        (0..count)
            .map(|_| {
                state = Affine48::STEP.apply(state);
                words(state)
            })
            .collect()
    }

    /// How many those are.
    pub(crate) fn first_state_count(self, count: u32) -> u64 {
        if self.rng == Rng::Rand48 { u64::from(count) } else { 1 }
    }
}

#[inline(always)]
fn unit_float(bits24: u32) -> f32 {
    bits24 as f32 * (1.0 / 16_777_216.0)
}

#[inline(always)]
fn rand48_next(state: &mut UVec2, key: &RandomKey) -> f32 {
    let u = unit_float((state.y << 8) | (state.x >> 24));
    let leap = Affine48 { multiplier: from_words(key.leap_multiplier), increment: from_words(key.leap_increment) };
    *state = words(leap.apply(from_words(*state)));
    u
}

#[inline(always)]
pub(crate) fn mix32(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[inline(always)]
fn mt_word(previous: u32, index: u32) -> u32 {
    1_812_433_253u32.wrapping_mul(previous ^ (previous >> 30)).wrapping_add(index)
}

/// States of the twisters that `init_genrand(seed)` starts: seeds, and their words `MT_MIDDLE`.
#[inline(always)]
pub(crate) fn mt_open<const N: usize>(seeds: [u32; N]) -> [[u32; N]; 2] {
    let mut words = seeds;
    for index in 1..=MT_MIDDLE {
        for word in &mut words {
            *word = mt_word(*word, index);
        }
    }
    [seeds, words]
}

/// The 32-bit output number `draw` of the twister.
#[inline(always)]
pub(crate) fn mt_next_word(words: &mut UVec2, draw: u32) -> u32 {
    let next = mt_word(words.x, draw + 1);
    let mixed = (words.x & 0x8000_0000) | (next & 0x7fff_ffff);
    let mut y = words.y ^ (mixed >> 1) ^ ((mixed & 1) * 0x9908_b0df);
    y ^= y >> 11;
    y ^= (y << 7) & 0x9d2c_5680;
    y ^= (y << 15) & 0xefc6_0000;
    y ^= y >> 18;
    *words = UVec2::new(next, mt_word(words.y, draw + MT_MIDDLE + 1));
    y
}

/// Philox4x32-10.
#[inline(always)]
pub(crate) fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let product0 = u64::from(counter[0]) * 0xd251_1f53;
        let product1 = u64::from(counter[2]) * 0xcd9e_8d57;
        counter = [
            (product1 >> 32) as u32 ^ counter[1] ^ key[0],
            product1 as u32,
            (product0 >> 32) as u32 ^ counter[3] ^ key[1],
            product0 as u32,
        ];
        key = [key[0].wrapping_add(0x9e37_79b9), key[1].wrapping_add(0xbb67_ae85)];
    }
    counter
}

#[inline(always)]
fn philox_block(key: &RandomKey, photon: u32, block: u32) -> [f32; 4] {
    philox([photon, key.round, block, 0], [key.seed.x, key.seed.y]).map(|bits| unit_float(bits >> 8))
}

/// Direction numbers of the first four dimensions of Joe and Kuo (2008), bit by bit of the index. They follow from the
/// recurrences of their polynomials, 1, x + 1, x^2 + x + 1 and x^3 + x + 1.
const SOBOL_DIRECTIONS: [[u32; 4]; 32] = {
    let mut directions = [[0; 4]; 32];
    let mut second = 0x8000_0000u32;
    let mut third = [0x8000_0000u32, 0xc000_0000];
    let mut fourth = [0x8000_0000u32, 0xc000_0000, 0x2000_0000];
    let mut bit = 0;
    while bit < 32 {
        directions[bit] = [1 << (31 - bit), second, third[0], fourth[0]];
        second ^= second >> 1;
        third = [third[1], third[1] ^ third[0] ^ (third[0] >> 2)];
        fourth = [fourth[1], fourth[2], fourth[1] ^ fourth[0] ^ (fourth[0] >> 3)];
        bit += 1;
    }
    directions
};

/// Points of the Sobol' sequence, dimension by dimension, as fractions of 2^32.
#[inline(always)]
pub(crate) fn sobol<const N: usize>(indices: [u32; N]) -> [[u32; N]; 4] {
    let mut points = [[0; N]; 4];
    for (bit, directions) in SOBOL_DIRECTIONS.iter().enumerate() {
        // All ones where the bit is set: no branch that random bits would mislead.
        let taken = indices.map(|index| ((index >> bit) & 1).wrapping_neg());
        for (words, direction) in points.iter_mut().zip(directions) {
            for lane in 0..N {
                words[lane] ^= direction & taken[lane];
            }
        }
    }
    points
}

/// Owen's scrambling by a hash (Burley 2020, listing 3): each bit is flipped or not by the bits above
/// it and the seed. Of an index, it shuffles every aligned block of 2^k among such blocks.
#[inline(always)]
pub(crate) fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits().wrapping_add(seed);
    for factor in [0x6c50_b47cu32, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(factor);
    }
    x.reverse_bits()
}

/// Four dimensions of samples of a light: shuffled and scrambled by block, so that no two blocks are alike.
#[inline(always)]
fn sobol_block<const N: usize>([samples, light_keys]: &[[u32; N]; 2], block: u32) -> [[f32; N]; 4] {
    let mut seeds = [0; N];
    let mut indices = [0; N];
    for lane in 0..N {
        seeds[lane] = mix32(light_keys[lane].wrapping_add(block));
        indices[lane] = owen_scramble(samples[lane], seeds[lane]);
    }
    let points = sobol(indices);
    let mut u = [[0.0; N]; 4];
    for (k, (u, words)) in u.iter_mut().zip(&points).enumerate() {
        for lane in 0..N {
            u[lane] = unit_float(owen_scramble(words[lane], mix32(seeds[lane].wrapping_add(k as u32 + 1))) >> 8);
        }
    }
    u
}

/// Opens the streams of some photons from their starts: the first states of rand48, or for Sobol' points their numbers
/// among the light's photons of the run, and the light. The others need none.
#[inline(always)]
pub(crate) fn open_streams<const N: usize>(rng: Rng, key: &RandomKey, photons: &[u32; N], starts: [[u32; N]; 2]) -> [[u32; N]; 2] {
    let run = mix32(key.seed.x.wrapping_add(mix32(key.seed.y)));
    match rng {
        Rng::Rand48 => starts,
        Rng::Mt => mt_open(photons.map(|photon| mix32(key.photons_before.wrapping_add(photon).wrapping_add(run)))),
        Rng::Philox => [[0; N]; 2],
        Rng::Sobol => [starts[0], starts[1].map(|light| mix32(run.wrapping_add(light)))],
    }
}

/// Their numbers of a block, which Philox and Sobol' points have for each emission and bounce, or from number `first`
/// on: as many dimensions as are asked for.
#[inline(always)]
fn draw<const N: usize, const DRAWS: usize>(
    rng: Rng,
    key: &RandomKey,
    photons: &[u32; N],
    (block, first): (u32, u32),
    streams: &mut [[u32; N]; 2],
) -> [[f32; N]; DRAWS] {
    let mut u = [[0.0; N]; DRAWS];
    if rng == Rng::Sobol {
        let drawn = sobol_block(streams, block);
        u.copy_from_slice(&drawn[..DRAWS]);
        return u;
    }
    for lane in 0..N {
        let mut stream = UVec2::new(streams[0][lane], streams[1][lane]);
        let drawn: [f32; DRAWS] = match rng {
            Rng::Rand48 => std::array::from_fn(|_| rand48_next(&mut stream, key)),
            Rng::Mt => std::array::from_fn(|k| unit_float(mt_next_word(&mut stream, first + k as u32) >> 8)),
            Rng::Philox | Rng::Sobol => {
                let drawn = philox_block(key, photons[lane], block);
                std::array::from_fn(|k| drawn[k])
            }
        };
        (streams[0][lane], streams[1][lane]) = (stream.x, stream.y);
        (0..DRAWS).for_each(|k| u[k][lane] = drawn[k]);
    }
    u
}

/// Emission: disc radius, disc angle, cosine, azimuth.
#[inline(always)]
pub(crate) fn draw_emissions<const N: usize>(rng: Rng, key: &RandomKey, photons: &[u32; N], streams: &mut [[u32; N]; 2]) -> [[f32; N]; 4] {
    draw(rng, key, photons, (0, 0), streams)
}

/// Bounce: roulette, cosine, azimuth.
#[inline(always)]
pub(crate) fn draw_bounces<const N: usize>(
    rng: Rng,
    key: &RandomKey,
    photons: &[u32; N],
    bounce: u32,
    streams: &mut [[u32; N]; 2],
) -> [[f32; N]; 3] {
    draw(rng, key, photons, (bounce + 1, EMISSION_DRAWS + BOUNCE_DRAWS * bounce), streams)
}

/// [`open_streams`] of one photon.
#[cfg(test)]
pub(crate) fn open_stream(rng: Rng, key: &RandomKey, photon: u32, start: UVec2) -> UVec2 {
    open_streams(rng, key, &[photon], start.to_array().map(|word| [word])).map(|[word]| word).into()
}

/// [`draw_emissions`] of one photon.
#[cfg(test)]
pub(crate) fn draw_emission(rng: Rng, key: &RandomKey, photon: u32, stream: &mut UVec2) -> [f32; 4] {
    let mut streams = stream.to_array().map(|word| [word]);
    let u = draw_emissions(rng, key, &[photon], &mut streams);
    *stream = streams.map(|[word]| word).into();
    u.map(|[u]| u)
}

/// [`draw_bounces`] of one photon.
#[cfg(test)]
pub(crate) fn draw_bounce(rng: Rng, key: &RandomKey, photon: u32, bounce: u32, stream: &mut UVec2) -> [f32; 3] {
    let mut streams = stream.to_array().map(|word| [word]);
    let u = draw_bounces(rng, key, &[photon], bounce, &mut streams);
    *stream = streams.map(|[word]| word).into();
    u.map(|[u]| u)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leap_frogged_streams_are_the_one_sequence() {
        let (photons, bounces) = (7, 3);
        let draws = u64::from(EMISSION_DRAWS + BOUNCE_DRAWS * bounces);
        let streams = Streams { rng: Rng::Rand48, seed: 5, photons, draws_per_photon: draws };
        let first = streams.first_states(photons);
        for round in 0..3 {
            let key = streams.key(round);
            for photon in 0..photons {
                let jump = streams.jump(round, photon);
                let mut stream = words(jump.apply(from_words(first[0])));
                let mut drawn = draw_emission(Rng::Rand48, &key, photon, &mut stream).to_vec();
                for bounce in 0..bounces {
                    drawn.extend(draw_bounce(Rng::Rand48, &key, photon, bounce, &mut stream));
                }
                for (k, u) in drawn.iter().enumerate() {
                    let place = (u64::from(round) * draws + k as u64) * u64::from(photons) + u64::from(photon) + 1;
                    let expected = Affine48::steps(place).apply(srand48(5));
                    assert_eq!(*u, unit_float((expected >> 24) as u32), "round {round} photon {photon} draw {k}");
                }
            }
        }
    }

    /// Known answers of Random123.
    #[test]
    fn philox_gives_the_known_answers() {
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([u32::MAX; 4], [u32::MAX; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
    }

    /// Direction numbers as Joe and Kuo's generator prints them, from new-joe-kuo-6.21201.
    #[test]
    fn sobol_gives_the_published_direction_numbers() {
        let point = |index: u32| sobol([index]).map(|[word]| word);
        let of_bit = |bit: u32| point(1 << bit).map(|word| word >> 24);
        let expected = [
            [0x80, 0x80, 0x80, 0x80],
            [0x40, 0xc0, 0xc0, 0xc0],
            [0x20, 0xa0, 0x60, 0x20],
            [0x10, 0xf0, 0x90, 0x50],
            [0x08, 0x88, 0xe8, 0xf8],
            [0x04, 0xcc, 0x5c, 0x74],
        ];
        assert_eq!([0, 1, 2, 3, 4, 5].map(of_bit), expected);
        assert_eq!(point(0b101), std::array::from_fn(|k| point(1)[k] ^ point(4)[k]));
    }

    #[test]
    fn unit_floats_stay_below_one() {
        assert_eq!(unit_float(0), 0.0);
        assert!(unit_float(u32::MAX >> 8) < 1.0);
    }
}
