//! Photons of a chunk on the CPU: the modified algorithm, block by block, side by side.
//!
//! A block's paths go from bounce to bounce as arrays that stay in the first-level cache, and a loop over them is
//! compiled for the widest vectors that the machine has. Every operation is rounded by itself and no sum is reordered,
//! so vectors change no bit.
#![expect(clippy::needless_range_loop, reason = "one index runs through arrays that lie side by side")]

use std::array::{from_mut, from_ref};
use std::mem::swap;

use glam::{UVec2, Vec3};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::bsdf::view_weight;
use super::emission::emit_from_disc;
use super::room::{intersect_room, wall_frame};
use super::sampling::{sample_cosine_hemisphere, to_world};
use crate::constants::FACE_COUNT;
use crate::photon::Photon;
use crate::photon_state::PhotonState;
use crate::plan::{EmissionRange, RoomPlan};
use crate::records::{DiscLight, RandomKey, Room, Tally, Wall};
use crate::rng::{self, Rng, words};
use crate::scene::room::RoomScene;

/// The scene and settings as the tracing functions read them.
pub(crate) struct Tracer<'a> {
    plan: &'a RoomPlan,
    room: Room,
    walls: [Wall; FACE_COUNT as usize],
    /// Of each wall: below it a random number lets a photon live.
    survival: [f32; FACE_COUNT as usize],
    lights: Vec<DiscLight>,
    vectors: Arch,
}

/// Photons that are traced side by side; their arrays fit a first-level cache, their numbers a byte.
const BLOCK: usize = 256;
/// Numbers of the widest vector. Loops run over whole vectors: what lies behind the last path is no path.
const LANES: usize = 16;
/// A number of each path. The inner loops over it have a length that the compiler knows, so that nothing is left over.
type Column<T> = [[T; LANES]; BLOCK / LANES];

const NO_NUMBERS: Column<f32> = [[0.0; LANES]; BLOCK / LANES];
const NO_WORDS: Column<u32> = [[0; LANES]; BLOCK / LANES];

/// What became of some photons of one light.
#[derive(Default)]
pub(crate) struct Block {
    /// By bounce, and by number within a bounce.
    pub photons: Vec<Photon>,
    /// Bounce by bounce.
    pub tallies: Vec<Tally>,
    /// Numbers of photons with values that are infinite or no number, where `--paranoid` looks for them.
    pub odd: Vec<u32>,
}

/// Paths in flight.
struct PhotonStates {
    position: [Column<f32>; 3],
    direction: [Column<f32>; 3],
    wall: Column<u32>,
    photon: Column<u32>,
    stream: [Column<u32>; 2],
}

/// Where they arrive, and the random numbers of what happens there.
struct Hits {
    position: [Column<f32>; 3],
    wall: Column<u32>,
    roulette: Column<f32>,
    /// Cosine and azimuth.
    u: [Column<f32>; 2],
}

impl<'a> Tracer<'a> {
    pub(crate) fn new(scene: &RoomScene, plan: &'a RoomPlan) -> Tracer<'a> {
        Tracer::with_vectors(scene, plan, Arch::new())
    }

    /// For vectors of a given kind.
    pub(crate) fn with_vectors(scene: &RoomScene, plan: &'a RoomPlan, vectors: Arch) -> Tracer<'a> {
        let walls: [Wall; FACE_COUNT as usize] = scene.wall_records().try_into().expect("a room has six faces");
        Tracer {
            plan,
            room: scene.room_record(),
            walls,
            survival: walls.map(|wall| if wall.is_open != 0 { 0.0 } else { wall.albedo }),
            lights: scene.light_records(&plan.relative_flux),
            vectors,
        }
    }

    /// Photons of a chunk, on the threads of the current pool. `blocks` are filled anew in their old memory: the same in
    /// the same order, whatever the threads.
    pub(crate) fn trace(&self, round: u32, ranges: &[EmissionRange], blocks: &mut Vec<Block>) {
        let key = self.plan.streams().key(round);
        let parts: Vec<EmissionRange> = ranges.iter().flat_map(parts).collect();
        blocks.resize_with(parts.len(), Block::default);
        let trace = |(block, range): (&mut Block, &EmissionRange)| {
            self.vectors.dispatch(TraceBlock { tracer: self, key: &key, range, block });
        };
        if rayon::current_num_threads() == 1 {
            blocks.iter_mut().zip(&parts).for_each(trace);
        } else {
            blocks.par_iter_mut().zip(&parts).for_each(trace);
        }
    }

    /// Paths of a chunk as lights emit them.
    pub(crate) fn emit(&self, round: u32, ranges: &[EmissionRange]) -> Vec<PhotonState> {
        let key = self.plan.streams().key(round);
        let of_part = |range: EmissionRange| {
            let mut paths = PhotonStates::none();
            self.emit_paths(&key, &range, &mut paths);
            let flux = self.lights[range.light as usize].flux;
            (0..range.count as usize).map(move |i| PhotonState {
                position: vector(&paths.position, i),
                wall: number(&paths.wall, i),
                direction: vector(&paths.direction, i),
                photon: number(&paths.photon, i),
                stream: UVec2::new(number(&paths.stream[0], i), number(&paths.stream[1], i)),
                flux,
            })
        };
        ranges.iter().flat_map(parts).flat_map(of_part).collect()
    }

    #[inline(always)]
    fn emit_paths(&self, key: &RandomKey, range: &EmissionRange, paths: &mut PhotonStates) {
        match self.plan.settings.rng {
            Rng::Rand48 => self.emit_by(Rng::Rand48, key, range, paths),
            Rng::Mt => self.emit_by(Rng::Mt, key, range, paths),
            Rng::Philox => self.emit_by(Rng::Philox, key, range, paths),
            Rng::Sobol => self.emit_by(Rng::Sobol, key, range, paths),
        }
    }

    /// `rng` is a constant where this is inlined, so that the loop over paths has no branch.
    #[inline(always)]
    fn emit_by(&self, rng: Rng, key: &RandomKey, range: &EmissionRange, paths: &mut PhotonStates) {
        let light = self.lights[range.light as usize];
        let wall = self.walls[light.wall as usize];
        let law = self.plan.settings.emission;
        paths.wall = [[light.wall; LANES]; BLOCK / LANES];
        self.start_streams(rng, key.round, range, &mut paths.stream);
        for group in 0..(range.count as usize).div_ceil(LANES) {
            let first_photon = range.first_photon.wrapping_add((group * LANES) as u32);
            let photons: [u32; LANES] = std::array::from_fn(|lane| first_photon.wrapping_add(lane as u32));
            let starts = [paths.stream[0][group], paths.stream[1][group]];
            let mut streams = rng::open_streams(rng, key, &photons, starts);
            let u = rng::draw_emissions(rng, key, &photons, &mut streams);
            paths.photon[group] = photons;
            [paths.stream[0][group], paths.stream[1][group]] = streams;
            for lane in 0..LANES {
                let (position, direction) = emit_from_disc(&light, &wall, law, [u[0][lane], u[1][lane], u[2][lane], u[3][lane]]);
                set(&mut paths.position, group, lane, position);
                set(&mut paths.direction, group, lane, direction);
            }
        }
    }

    /// What each photon's stream is opened from.
    #[inline(always)]
    fn start_streams(&self, rng: Rng, round: u32, range: &EmissionRange, [x, y]: &mut [Column<u32>; 2]) {
        let streams = self.plan.streams();
        let (x, y) = (x.as_flattened_mut(), y.as_flattened_mut());
        match rng {
            Rng::Rand48 => {
                // The host reaches the first state by itself, without a prepared set.
                let mut state = words(streams.jump(round, range.first_photon + 1).apply(rng::srand48(streams.seed as u32)));
                for (x, y) in x.iter_mut().zip(y).take(range.count as usize) {
                    (*x, *y) = (state.x, state.y);
                    state = rng::rand48_step(state);
                }
            }
            Rng::Sobol => {
                let first_sample = self.plan.first_sample(round, range);
                for (i, (x, y)) in x.iter_mut().zip(y).enumerate() {
                    (*x, *y) = (first_sample.wrapping_add(i as u32), range.light);
                }
            }
            Rng::Philox | Rng::Mt => {}
        }
    }

    /// Who goes on: their numbers, in order, and what became of all.
    #[inline(always)]
    fn play_roulette(&self, count: usize, hits: &Hits, survivors: &mut [u8; BLOCK]) -> Tally {
        let (mut stored, mut escaped) = (0, 0);
        for (i, (wall, roulette)) in hits.wall.as_flattened().iter().zip(hits.roulette.as_flattened()).take(count).enumerate() {
            // Written down in any case: whether to would be a branch that nobody can guess.
            survivors[stored] = i as u8;
            stored += usize::from(*roulette < self.survival[*wall as usize]);
            escaped += self.walls[*wall as usize].is_open;
        }
        let stored = stored as u32;
        Tally { stored, absorbed: count as u32 - stored - escaped, escaped, dropped: 0 }
    }
}

/// A range in pieces of a block.
fn parts(range: &EmissionRange) -> impl Iterator<Item = EmissionRange> + use<> {
    let range = *range;
    (0..range.count).step_by(BLOCK).map(move |before| EmissionRange {
        first_photon: range.first_photon + before,
        count: (range.count - before).min(BLOCK as u32),
        ..range
    })
}

#[inline(always)]
fn number<T: Copy>(column: &Column<T>, i: usize) -> T {
    column.as_flattened()[i]
}

#[inline(always)]
fn vector(columns: &[Column<f32>; 3], i: usize) -> Vec3 {
    Vec3::from_array(columns.each_ref().map(|column| number(column, i)))
}

#[inline(always)]
fn set(columns: &mut [Column<f32>; 3], group: usize, lane: usize, vector: Vec3) {
    (columns[0][group][lane], columns[1][group][lane], columns[2][group][lane]) = vector.into();
}

/// The survivors' entries, without gaps.
#[inline(always)]
fn pick<T: Copy, const N: usize>(survivors: &[u8], from: &[Column<T>; N], to: &mut [Column<T>; N]) {
    for (from, to) in from.iter().zip(to) {
        for (to, survivor) in to.as_flattened_mut().iter_mut().zip(survivors) {
            *to = number(from, usize::from(*survivor));
        }
    }
}

#[inline(always)]
fn draw(rng: Rng, key: &RandomKey, bounce: u32, count: usize, paths: &mut PhotonStates, hits: &mut Hits) {
    match rng {
        Rng::Rand48 => draw_by(Rng::Rand48, key, bounce, count, paths, hits),
        Rng::Mt => draw_by(Rng::Mt, key, bounce, count, paths, hits),
        Rng::Philox => draw_by(Rng::Philox, key, bounce, count, paths, hits),
        Rng::Sobol => draw_by(Rng::Sobol, key, bounce, count, paths, hits),
    }
}

#[inline(always)]
fn draw_by(rng: Rng, key: &RandomKey, bounce: u32, count: usize, paths: &mut PhotonStates, hits: &mut Hits) {
    for group in 0..count.div_ceil(LANES) {
        let mut streams = [paths.stream[0][group], paths.stream[1][group]];
        let u = rng::draw_bounces(rng, key, &paths.photon[group], bounce, &mut streams);
        [hits.roulette[group], hits.u[0][group], hits.u[1][group]] = u;
        [paths.stream[0][group], paths.stream[1][group]] = streams;
    }
}

#[inline(always)]
fn next_hits(room: &Room, count: usize, paths: &PhotonStates, hits: &mut Hits) {
    for group in 0..count.div_ceil(LANES) {
        for lane in 0..LANES {
            let at = |columns: &[Column<f32>; 3]| Vec3::new(columns[0][group][lane], columns[1][group][lane], columns[2][group][lane]);
            let hit = intersect_room(room, at(&paths.position), at(&paths.direction), paths.wall[group][lane]);
            set(&mut hits.position, group, lane, hit.position);
            hits.wall[group][lane] = hit.wall;
        }
    }
}

/// The directions in which walls reflect.
#[inline(always)]
fn reflect(count: usize, u: &[Column<f32>; 2], paths: &mut PhotonStates) {
    for group in 0..count.div_ceil(LANES) {
        for lane in 0..LANES {
            let local = sample_cosine_hemisphere(u[0][group][lane], u[1][group][lane]);
            set(&mut paths.direction, group, lane, to_world(local, wall_frame(paths.wall[group][lane])));
        }
    }
}

impl PhotonStates {
    fn none() -> PhotonStates {
        PhotonStates { position: [NO_NUMBERS; 3], direction: [NO_NUMBERS; 3], wall: NO_WORDS, photon: NO_WORDS, stream: [NO_WORDS; 2] }
    }

    fn are_finite(&self, i: usize) -> bool {
        vector(&self.position, i).is_finite() && vector(&self.direction, i).is_finite()
    }
}

/// A block's photons from emission to their end.
struct TraceBlock<'a> {
    tracer: &'a Tracer<'a>,
    key: &'a RandomKey,
    range: &'a EmissionRange,
    block: &'a mut Block,
}

impl WithSimd for TraceBlock<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let TraceBlock { tracer, key, range, block: Block { photons, tallies, odd } } = self;
        let settings = &tracer.plan.settings;
        let flux = tracer.lights[range.light as usize].flux;
        photons.clear();
        odd.clear();
        tallies.clear();
        tallies.resize(settings.bounces as usize, Tally::default());
        let (paths, next) = (&mut PhotonStates::none(), &mut PhotonStates::none());
        let (mut paths, mut next) = (paths, next);
        let mut hits = Hits { position: [NO_NUMBERS; 3], wall: NO_WORDS, roulette: NO_NUMBERS, u: [NO_NUMBERS; 2] };
        let mut u = [NO_NUMBERS; 2];
        let mut survivors = [0; BLOCK];

        let mut count = range.count as usize;
        tracer.emit_paths(key, range, paths);
        if settings.paranoid {
            odd.extend((0..count).filter(|i| !paths.are_finite(*i)).map(|i| number(&paths.photon, i)));
        }
        for bounce in 0..settings.bounces {
            if count == 0 {
                break;
            }
            draw(settings.rng, key, bounce, count, paths, &mut hits);
            next_hits(&tracer.room, count, paths, &mut hits);
            let tally = tracer.play_roulette(count, &hits, &mut survivors);
            tallies[bounce as usize] = tally;
            count = tally.stored as usize;
            let survivors = &survivors[..count];
            pick(survivors, &hits.position, &mut next.position);
            pick(survivors, from_ref(&hits.wall), from_mut(&mut next.wall));
            pick(survivors, from_ref(&paths.photon), from_mut(&mut next.photon));
            pick(survivors, &paths.stream, &mut next.stream);
            pick(survivors, &hits.u, &mut u);
            reflect(count, &u, next);
            let first = photons.len();
            photons.extend((0..count).map(|i| Photon {
                position: vector(&next.position, i),
                wall: number(&next.wall, i),
                flux,
                weight: 1.0,
                photon: number(&next.photon, i),
                bounce,
            }));
            if settings.has_phong() {
                for (i, photon) in photons[first..].iter_mut().enumerate() {
                    let wall = &tracer.walls[photon.wall as usize];
                    let (arriving, reflected) = (vector(&paths.direction, usize::from(survivors[i])), vector(&next.direction, i));
                    photon.weight = view_weight(wall, photon.position, arriving, reflected, settings.eye.into(), settings.phong_direction);
                }
            }
            if settings.paranoid {
                odd.extend((0..count).filter(|i| !next.are_finite(*i)).map(|i| number(&next.photon, i)));
                let odd_photons = photons[first..].iter().filter(|photon| !(photon.weight.is_finite() && photon.flux.is_finite()));
                odd.extend(odd_photons.map(|photon| photon.photon));
            }
            swap(&mut paths, &mut next);
        }
    }
}
