//! The plan of the paper's box: how photons are dealt to lights and chunks, how many are traced at once, and the film's fixed-point
//! scale. Its buffers are in [`super::buffers`].

use std::ops::Range;

use serde::Serialize;

use super::capacity::{self, Limits, Persistence, Work};
use super::room_effects::{self as effect, Decision};
use crate::constants::{COUNTER_STRIDE, NEAREST_BITS, NEAREST_GAIN_BITS};
use crate::error::{Result, require};
use crate::photon::StoredPhoton;
use crate::records::{IndexPush, Point};
use crate::rng::Streams;
use crate::scene::room::RoomScene;
use crate::settings::{Builder, Gather, MAX_NEAREST_SUMMED, MOST_ROUNDS, RoomSettings, Sums};

/// A run of photons of one light inside a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct EmissionRange {
    pub light: u32,
    /// Number within the round.
    pub first_photon: u32,
    pub count: u32,
}

impl EmissionRange {
    /// The same photons in runs of at most so many.
    pub(crate) fn parts(self, most: u32) -> impl Iterator<Item = EmissionRange> {
        let EmissionRange { light, first_photon, count } = self;
        (0..count).step_by(most.max(1) as usize).map(move |first| EmissionRange {
            light,
            first_photon: first_photon + first,
            count: most.min(count - first),
        })
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct RoomPlan {
    pub settings: RoomSettings,
    pub(crate) decisions: Vec<Decision>,
    /// Sums a point keeps: flux, and where it differs from the paper's illumination, that too.
    pub channel_count: u32,
    /// Fixed-point bits after the binary point of a film sum.
    pub film_shift: u32,
    /// Photons of a round that each light emits.
    pub light_photons: Vec<u32>,
    /// Flux of a photon of each light, relative to the strongest.
    pub relative_flux: Vec<f32>,
    /// Watts of a photon of relative flux 1, times the photons emitted: a run of n photons shares its
    /// lights' power among them, so that each carries `flux_unit` / n.
    pub flux_unit: f64,
    pub chunks_per_round: u32,
    /// Counters that the atomic builder's work groups use round-robin.
    pub counters: u32,
    /// What the path arrays hold: photons of the largest chunk, and the gaps that several counters leave.
    pub path_capacity: u32,
    /// Entries of the photon map.
    pub photon_capacity: u32,
    pub(crate) points: Vec<Point>,
    pub(crate) grid: Grid,
    /// What a gather is expected to cost.
    pub(crate) work: Work,
    /// Pair tests (point, photon) after which commands are handed to the device.
    pub pair_tests_per_submission: u64,
    /// How photons are dealt to invocations that keep them to their end.
    pub(crate) persistence: Persistence,
    /// Whether entries of the photon map say which photon they are: the nearest photons are distinguished by it, and so are
    /// photons that somebody lists.
    pub keeps_origins: bool,
    /// Whether the run may go on later, or is a part of one.
    pub is_kept: bool,
    /// Invocations that share a point of a gather over the grid.
    pub lanes: u32,
    /// Whether they test a slice of its candidates only, lest they loop for too long.
    pub slices_candidates: bool,
}

/// The uniform grid that sorts photons.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Grid {
    pub origin: [f32; 3],
    pub cells_per_metre: f32,
    pub cell_count: [u32; 3],
    /// A little over the radius, so that rounding never costs a photon at the rim.
    pub reach: f32,
}

impl Grid {
    /// Cells of `cell` metres or more, at most [`MAX_CELLS_PER_AXIS`] along an axis.
    fn new(scene: &RoomScene, radius: f64, cell: f64) -> Grid {
        let extent = scene.max_corner - scene.min_corner;
        let cell = cell.max(extent.max_element() / f64::from(MAX_CELLS_PER_AXIS));
        Grid {
            origin: scene.min_corner.as_vec3().to_array(),
            cells_per_metre: (1.0 / cell) as f32,
            cell_count: extent.to_array().map(|edge| ((edge / cell).ceil() as u32).clamp(1, MAX_CELLS_PER_AXIS)),
            reach: (radius * (1.0 + 1.0 / 1024.0)) as f32,
        }
    }

    pub(crate) fn cells(&self) -> u32 {
        self.cell_count.iter().product()
    }

    pub(crate) fn index_push(&self, photon_capacity: u32) -> IndexPush {
        IndexPush { origin: self.origin.into(), cells_per_metre: self.cells_per_metre, cell_count: self.cell_count.into(), photon_capacity }
    }
}

const MAX_CELLS_PER_AXIS: u32 = 128;
/// Tests of a point in cells of the radius, from which on cells of half of it pay: lavapipe gathers 1.4 x faster with 100
/// times as many.
const DENSE: u64 = 512;
/// Events to which any run may go on.
const EVENTS_OF_SCALE: u64 = 1 << 40;
/// Fixed-point units that the faintest photon must be worth: a thousandth is lost to rounding at most.
const MIN_FIXED_POINT: f64 = 512.0;

impl RoomPlan {
    pub(crate) fn new(scene: &RoomScene, settings: &RoomSettings, limits: &Limits) -> Result<RoomPlan> {
        settings.validate()?;
        limits.check_builder(settings.builder)?;
        let light_photons = deal(settings.photons, &scene.lights.iter().map(|light| light.power).collect::<Vec<_>>());
        let watts: Vec<f64> = scene.lights.iter().zip(&light_photons).map(|(light, count)| light.power / f64::from(*count)).collect();
        let strongest = watts.iter().fold(0.0, |a: f64, b| a.max(*b));
        let relative_flux: Vec<f32> = watts.iter().map(|flux| (flux / strongest) as f32).collect();

        let equal_flux = relative_flux.iter().all(|flux| *flux == 1.0);
        let decisions = effect::decide(scene, settings, equal_flux);
        let channel_count = if settings.has_phong() || !equal_flux { 2 } else { 1 };
        let film_shift = if channel_count == 1 && settings.nearest.is_none() { 0 } else { film_shift(settings) };

        let faintest = relative_flux.iter().fold(1.0f32, |a, b| a.min(*b));
        let is_seen = channel_count == 1 || f64::from(faintest) * ((1u64 << film_shift) as f64) >= MIN_FIXED_POINT;
        let [floor, left] = settings.light_power;
        let allowed =
            "differ too much for the film's integer sums over so many photons; choose closer values, or ask for fewer photons * bounces";
        require(is_seen, "light_power", format!("{floor},{left}"), allowed)?;

        let points: Vec<Point> = scene
            .walls()
            .flat_map(|(face, _)| {
                let centres: Vec<_> = scene.rectangle(face).texel_centres(settings.mesh, settings.mesh).collect();
                centres.into_iter().map(move |centre| Point { position: centre.as_vec3(), wall: face as u32 })
            })
            .collect();
        let work = Work::new(scene, settings, points.len());
        let chunk_photons = capacity::chunk_photons(settings, limits, &work)?;
        // Smaller cells leave fewer photons to be tested in vain, and more rows of cells to be looked up.
        let is_dense = work.tests_per_point(chunk_photons) >= DENSE;
        let grid = Grid::new(scene, settings.radius, settings.radius * if is_dense { 0.5 } else { 1.0 });
        let chunks_per_round = settings.photons.div_ceil(chunk_photons);
        let mut plan = RoomPlan {
            settings: settings.clone(),
            decisions,
            channel_count,
            film_shift,
            light_photons,
            relative_flux,
            flux_unit: strongest * f64::from(settings.photons),
            chunks_per_round,
            counters: capacity::counters(settings, limits, chunk_photons),
            path_capacity: 0,
            photon_capacity: 0,
            points,
            grid,
            work,
            pair_tests_per_submission: limits.pair_tests_per_submission,
            persistence: Persistence::new(capacity::loops_to_begin(settings.rng), capacity::LOOPS_PER_BOUNCE, settings.bounces, limits),
            keeps_origins: settings.nearest.is_some(),
            is_kept: false,
            lanes: capacity::lanes(settings, limits, work.tests_per_point(chunk_photons)),
            slices_candidates: false,
        };
        // Of each light's photons the larger share: there may be a billion chunks, too many to look at each.
        plan.path_capacity = plan.light_photons.iter().map(|count| count.div_ceil(chunks_per_round)).sum();
        if plan.counters > 1 {
            // The n-th work group of a counter's turn hands out no more than its n-th block, whose number is the group's own, so
            // places end where the last group does.
            plan.path_capacity = plan.path_capacity.next_multiple_of(settings.group_size);
        }
        plan.photon_capacity = plan.path_capacity * settings.bounces;
        // Even if a point has every photon in reach.
        plan.slices_candidates = plan.photon_capacity.div_ceil(plan.lanes) > capacity::most_candidates(limits);
        Ok(plan)
    }

    /// The photons of one chunk: of each light the same share, so that whatever has run so far is
    /// a fair sample of all lights.
    pub(crate) fn chunk(&self, chunk: u32) -> Vec<EmissionRange> {
        let chunks = u64::from(self.chunks_per_round);
        let mut first_of_light = 0;
        let mut ranges = Vec::new();
        for (light, &count) in self.light_photons.iter().enumerate() {
            let part = |chunk: u64| (u64::from(count) * chunk / chunks) as u32;
            let Range { start, end } = part(u64::from(chunk))..part(u64::from(chunk) + 1);
            if end > start {
                ranges.push(EmissionRange { light: light as u32, first_photon: first_of_light + start, count: end - start });
            }
            first_of_light += count;
        }
        ranges
    }

    /// Every chunk of a round.
    pub(crate) fn chunks(&self) -> impl Iterator<Item = Vec<EmissionRange>> {
        (0..self.chunks_per_round).map(|chunk| self.chunk(chunk))
    }

    /// The range of one photon of a round.
    pub(crate) fn range_of(&self, photon: u32) -> EmissionRange {
        let mut first_of_next = 0;
        let light = self.light_photons.iter().position(|count| {
            first_of_next += count;
            photon < first_of_next
        });
        EmissionRange { light: light.expect("a round has this photon") as u32, first_photon: photon, count: 1 }
    }

    /// Number of a range's first photon among its light's photons of the run, mod 2^32.
    pub(crate) fn first_sample(&self, round: u32, range: &EmissionRange) -> u32 {
        let light = range.light as usize;
        let first_of_light: u32 = self.light_photons[..light].iter().sum();
        round.wrapping_mul(self.light_photons[light]).wrapping_add(range.first_photon.wrapping_sub(first_of_light))
    }

    pub(crate) fn streams(&self) -> Streams {
        Streams {
            rng: self.settings.rng,
            seed: self.settings.seed,
            photons: self.settings.photons,
            draws_per_photon: self.settings.draws_per_photon(),
        }
    }

    /// Whether rounds are distinguished, so that their spread gives the error: floats go on over all rounds.
    pub(crate) fn keeps_squares(&self) -> bool {
        (self.settings.rounds > 1 || self.is_kept) && self.settings.sums == Sums::Integer
    }

    /// Photons that one dispatch traces from their light to their end, in a fraction of a second.
    pub(crate) fn photons_per_dispatch(&self) -> u32 {
        let photons = self.pair_tests_per_submission / self.work.tracing(1).max(1);
        photons.clamp(1, u64::from(u32::MAX)) as u32
    }

    /// Paths that one bounce hands to the next; where each photon has an invocation to its end, the one that a replay starts.
    pub(crate) fn path_array_length(&self) -> u32 {
        if self.settings.builder == Builder::Persistent { 1 } else { self.path_capacity }
    }

    /// Length of the photon map, paths entering each bounce, and the striped counters.
    pub(crate) fn counter_array_length(&self) -> u64 {
        let striped_counters = if self.counters > 1 { self.counters * COUNTER_STRIDE } else { 0 };
        u64::from(self.settings.bounces) + 2 + u64::from(striped_counters)
    }

    /// Entries of the photon map that say which photon they are.
    pub(crate) fn origin_array_length(&self) -> u32 {
        if self.keeps_origins { self.photon_capacity } else { 0 }
    }

    pub(crate) fn has_slots(&self) -> bool {
        self.settings.builder == Builder::Naive
    }

    /// Fixed-point units in 1.
    pub(crate) fn film_scale(&self) -> f64 {
        (1u64 << self.film_shift) as f64
    }

    /// Bytes of the photon map.
    pub(crate) fn photon_map_bytes(&self) -> u64 {
        u64::from(self.photon_capacity) * size_of::<StoredPhoton>() as u64
    }

    pub(crate) fn gathers_by_grid(&self) -> bool {
        self.settings.gather == Gather::Grid
    }

    pub(crate) fn gathers_by_tree(&self) -> bool {
        self.settings.gather == Gather::KdTree
    }
}

/// Photons of a list of ranges.
pub(crate) fn photons_of(ranges: &[EmissionRange]) -> u32 {
    ranges.iter().map(|range| range.count).sum()
}

/// Deals `photons` to lights by power: each its whole share, the rest by largest remainder (the
/// earlier light first), and one at least to each.
fn deal(photons: u32, powers: &[f64]) -> Vec<u32> {
    let total: f64 = powers.iter().sum();
    let exact: Vec<f64> = powers.iter().map(|power| f64::from(photons) * power / total).collect();
    let mut counts: Vec<u32> = exact.iter().map(|share| (share.floor() as u32).max(1)).collect();
    let mut by_remainder: Vec<usize> = (0..counts.len()).collect();
    by_remainder.sort_by(|&a, &b| exact[b].fract().total_cmp(&exact[a].fract()).then(a.cmp(&b)));
    let mut next = by_remainder.iter().cycle();
    while counts.iter().sum::<u32>() < photons {
        counts[*next.next().expect("there is a light")] += 1;
    }
    while counts.iter().sum::<u32>() > photons {
        let richest = (0..counts.len()).max_by_key(|&light| counts[light]).expect("there is a light");
        counts[richest] -= 1;
    }
    counts
}

/// Bits after the binary point of a film sum.
///
/// A stored photon adds at most 1 to a point's channel, and a run stores at most
/// E = photons * rounds * bounces of them, so a sum is at most E * 2^shift <= 2^63: it cannot
/// overflow 64 bits. No more than 31 bits, so that one photon's share fits a 32-bit word.
///
/// Of nearest photons a round adds fewer than K, each scaled up by 2^[`NEAREST_GAIN_BITS`] at most, and
/// their flux has no more bits to give than [`NEAREST_BITS`].
///
/// The scale is the same for all numbers of rounds up to [`MOST_ROUNDS`] and [`EVENTS_OF_SCALE`], so that a run can go on.
fn film_shift(settings: &RoomSettings) -> u32 {
    let of_round = settings.nearest.map_or(u64::from(settings.photons) * u64::from(settings.bounces), u64::from);
    let (fits, gain, most) = match settings.nearest {
        Some(_) => (MAX_NEAREST_SUMMED, NEAREST_GAIN_BITS, NEAREST_BITS),
        None => (EVENTS_OF_SCALE, 0, 31),
    };
    let rounds = (fits / of_round).min(MOST_ROUNDS.into()).max(settings.rounds.into());
    let events = (rounds * of_round) << gain;
    let bits = u64::BITS - (events - 1).leading_zeros();
    (63 - bits).min(most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;
    use crate::scene::open_box::open_box;
    use crate::settings::Preset;

    #[test]
    fn several_counters_serve_many_photons_of_the_atomic_builder() {
        let limits = Limits { buffer_bytes: 1 << 32, memory_bytes: 1 << 36, counters: 8, ..Limits::of_host() };
        let counters = |photons, builder, counters| {
            let small = RoomSettings { bounces: 2, mesh: 1, rng: Rng::Philox, ..RoomSettings::default() };
            let settings = RoomSettings { photons, builder, counters, chunk: Some(photons), ..small };
            RoomPlan::new(&open_box(&settings), &settings, &limits).unwrap().counters
        };
        assert_eq!([1000, (1 << 21) - 1, 1 << 21, 1 << 24].map(|photons| counters(photons, Builder::Atomic, None)), [1, 1, 8, 8]);
        assert_eq!([1, 4, 64].map(|number| counters(1000, Builder::Atomic, Some(number))), [1, 4, 64]);
        for builder in Builder::ALL.into_iter().filter(|builder| *builder != Builder::Atomic) {
            assert_eq!([None, Some(4)].map(|number| counters(1 << 21, builder, number)), [1, 1], "{builder:?}");
        }
    }

    #[test]
    fn photons_are_dealt_by_power_and_none_is_lost() {
        assert_eq!(deal(5000, &[1.0, 1.0]), [2500, 2500]);
        assert_eq!(deal(5001, &[1.0, 1.0]), [2501, 2500]);
        assert_eq!(deal(5000, &[1e8, 1.0]), [4999, 1]);
        assert_eq!(deal(7, &[1.0, 2.0, 4.0]), [1, 2, 4]);
        assert_eq!(deal(3, &[1.0, 1e6, 1.0]), [1, 1, 1]);
    }

    #[test]
    fn film_sums_cannot_overflow() {
        for (photons, rounds, bounces) in [(5000, 1, 15), (5000, 100, 15), (1 << 31, 1, 15), (1 << 30, 1 << 13, 16), (2, 1, 1)] {
            let settings = RoomSettings { photons, rounds, bounces, ..RoomSettings::default() };
            let events = u128::from(settings.total_photons()) * u128::from(bounces);
            let shift = film_shift(&settings);
            assert!(events << shift <= 1 << 63, "{events} events, shift {shift}");
            assert!((16..=31).contains(&shift), "{events} events, shift {shift}");
        }
        for (rounds, nearest) in [(1, 2), (1, 1024), (100, 50), (1 << 21, 1024), (1 << 30, 2)] {
            let settings = RoomSettings { photons: 2, rounds, gather: Gather::KdTree, nearest: Some(nearest), ..RoomSettings::default() };
            assert!(u64::from(rounds) * u64::from(nearest) <= MAX_NEAREST_SUMMED);
            let shift = film_shift(&settings);
            // With half a unit of rounding each round.
            let most = (u128::from(nearest - 1) << (NEAREST_GAIN_BITS + shift)) + 1;
            assert!(u128::from(rounds) * most <= 1 << 63, "{rounds} rounds of {nearest}, shift {shift}");
            assert!((10..=NEAREST_BITS).contains(&shift), "{rounds} rounds of {nearest}, shift {shift}");
        }
    }

    /// Photons and points of a wall share its coordinate across it to the bit: the grid's gather counts on it, and stored
    /// photons do without it.
    #[test]
    fn points_lie_in_the_planes_of_their_walls() {
        for size in [0.5, 1e-7, 0.1, 3e9] {
            let settings = RoomSettings { mesh: 7, ..RoomSettings::default() };
            let mut scene = open_box(&settings);
            scene.min_corner *= size / 3.0;
            scene.max_corner *= size;
            let room = scene.room_record();
            for point in RoomPlan::new(&scene, &settings, &Limits::of_host()).unwrap().points {
                let axis = point.wall as usize / 2;
                let plane = if point.wall % 2 == 1 { room.max_corner } else { room.min_corner }[axis];
                assert_eq!(point.position[axis].to_bits(), plane.to_bits(), "{point:?}");
            }
        }
    }

    /// Runs of photons cut into dispatches hold each photon once; invocations are never more than photons.
    #[test]
    fn persistent_photons_are_dealt_without_loss() {
        let range = EmissionRange { light: 1, first_photon: 100, count: 1001 };
        for most in [1, 7, 1000, 1001, 5000] {
            let parts: Vec<EmissionRange> = range.parts(most).collect();
            let photons: Vec<u32> = parts.iter().flat_map(|part| part.first_photon..part.first_photon + part.count).collect();
            assert!(photons.into_iter().eq(100..1101) && parts.iter().all(|part| part.light == 1 && part.count <= most), "{most}");
        }
        let dealing = Persistence { busy_invocations: 100, most_photons: 4 };
        for (photons, invocations) in
            [(1, 1), (99, 99), (199, 199), (200, 100), (398, 133), (399, 133), (400, 100), (401, 101), (4000, 1000)]
        {
            assert_eq!(dealing.invocations(photons), invocations, "{photons} photons");
        }
    }

    /// Whatever the split, each light numbers its photons of all rounds without gaps: every photon of a round is in one chunk, and every
    /// chunk holds each light's share.
    #[test]
    fn lights_number_their_photons_without_gaps() {
        let (even, uneven) = ([1.0; 2], [2.0, 1.0]);
        for (photons, chunk, light_power) in [
            (5000, None, even),
            (5000, Some(64), even),
            (5001, Some(7), even),
            (11, Some(2), even),
            (5001, None, uneven),
            (5001, Some(64), uneven),
        ] {
            let settings = RoomSettings { photons, chunk, rounds: 3, light_power, ..RoomSettings::preset(Preset::Modified) };
            let plan = RoomPlan::new(&open_box(&settings), &settings, &Limits::of_host()).unwrap();
            let mut samples = [Vec::new(), Vec::new()];
            for (round, ranges) in (0..settings.rounds).flat_map(|round| plan.chunks().map(move |ranges| (round, ranges))) {
                assert!(photons_of(&ranges) <= plan.path_capacity);
                for range in ranges {
                    let first = plan.first_sample(round, &range);
                    samples[range.light as usize].extend(first..first + range.count);
                }
            }
            for (samples, count) in samples.iter().zip(&plan.light_photons) {
                assert!(samples.iter().copied().eq(0..settings.rounds * count), "{photons} photons, chunks of {chunk:?}");
            }
        }
    }
}
