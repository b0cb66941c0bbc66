//! What a device allows ([`Limits`]), and how many photons of the paper's box are traced at once: what its buffers hold for certain,
//! and what its gather does in a fraction of a second.

use serde::Serialize;

use crate::constants::{LOOP_LIMIT, MT_MIDDLE};
use crate::error::{Result, require};
use crate::photon::{Origin, StoredPhoton};
use crate::photon_state::PackedPhotonState;
use crate::rng::Rng;
use crate::scene::room::RoomScene;
use crate::settings::{Builder, Gather, RoomSettings, Sums};

/// What a device allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct Limits {
    /// Largest buffer, bytes.
    pub buffer_bytes: u64,
    /// Memory for all buffers together, bytes.
    pub memory_bytes: u64,
    /// Pair tests (point, photon) of one submission: about a tenth of a second, far from the two
    /// seconds after which a desktop driver takes the device away.
    pub pair_tests_per_submission: u64,
    pub group_size: u32,
    /// Invocations that keep the device busy.
    pub busy_invocations: u32,
    /// Loop iterations that one of them may take.
    pub loop_iterations: u32,
    /// Neighbouring invocations whose reads of neighbouring records are one.
    pub lanes: u32,
    /// Counters that serve more work groups than one does.
    pub counters: u32,
    /// Subgroup votes are right in a loop in which lanes go different ways, as those of the persistent builder do.
    pub votes_in_loops: bool,
}

impl Limits {
    /// Limits of the CPU builder, which splits to keep its arrays small and to hear Ctrl-C.
    pub(crate) fn of_host() -> Limits {
        Limits {
            buffer_bytes: 1 << 29,
            memory_bytes: 1 << 31,
            pair_tests_per_submission: 1 << 27,
            group_size: 1024,
            busy_invocations: 1,
            loop_iterations: LOOP_LIMIT,
            lanes: 1,
            counters: 1,
            votes_in_loops: true,
        }
    }

    /// Refuses a builder that the device cannot run.
    pub(crate) fn check_builder(&self, builder: Builder) -> Result<()> {
        let why = "needs the lanes of a subgroup to vote together in a loop, which this device's start-up check found wrong; choose another builder, or auto";
        require(builder != Builder::Persistent || self.votes_in_loops, "variant", builder.name(), why)
    }

    /// What a device of a kind is good for; its buffers are as the host's, until the device is asked.
    pub(crate) fn of_kind(kind: &str) -> Limits {
        // Pair tests a tenth of a second: a slow device of its kind does 2^36 (discrete), 2^33 (integrated) or 2^28 (CPU; lavapipe
        // on two cores) a second. Half of the invocations that a large GPU holds at a time keep a device busy.
        let (pair_tests_per_submission, busy_invocations) = match kind {
            "discrete" => (1 << 33, 1 << 17),
            "cpu" => (1 << 25, 1 << 10),
            _ => (1 << 30, 1 << 14),
        };
        // Lavapipe leaves loops early, others only after seconds; a software device's lanes each read on their own, and its cores
        // add to one counter as fast as to many.
        let (loop_iterations, lanes, counters) = if kind == "cpu" { (LOOP_LIMIT, 1, 1) } else { (1 << 20, 32, 8) };
        Limits { pair_tests_per_submission, busy_invocations, loop_iterations, lanes, counters, ..Limits::of_host() }
    }
}

/// Submissions that a chunk may take: between chunks a run can be ended.
const SUBMISSIONS_PER_CHUNK: f64 = 4.0;
/// Work of one flight of a photon, in pair tests.
const PAIR_TESTS_PER_FLIGHT: f64 = 16.0;
/// Work of a photon in one digit of the tree's sort or one height of its nodes, in pair tests.
const PAIR_TESTS_PER_TREE_PASS: f64 = 16.0;
/// Work of finding one of the nearest photons, in pair tests.
const TESTS_PER_NEAREST: f64 = 64.0;
/// Bytes of an entry of the photon map, and of its name where one is kept.
const PHOTON_BYTES: u64 = size_of::<StoredPhoton>() as u64;
const ORIGIN_BYTES: u64 = size_of::<Origin>() as u64;
/// Bytes that the kd-tree takes for an entry of the photon map: the photon and its name again, three lists of (key,
/// entry), a rank, a count, and a plane for each leaf.
const TREE_BYTES: u64 = PHOTON_BYTES + ORIGIN_BYTES + 3 * 8 + 4 + 4 + 1;

/// Bytes of a photon's place in its cell.
const RANK_BYTES: u64 = 4;

/// Expected work of a chunk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Work {
    points: f64,
    /// Photons that a point tests for each photon emitted.
    tests_per_photon: f64,
    flights_per_photon: f64,
    /// Most tests of one point, whatever the photons.
    most_tests: f64,
    /// Entries of the photon map that a photon takes.
    entries_per_photon: f64,
}

impl Work {
    pub(crate) fn new(scene: &RoomScene, settings: &RoomSettings, point_count: usize) -> Work {
        // A photon is stored albedo + albedo^2 + ... times at most, and never more than `bounces`.
        let albedo = scene.walls().map(|(_, wall)| f64::from(wall.albedo)).fold(0.0, f64::max);
        let stored = (albedo / (1.0 - albedo)).min(f64::from(settings.bounces));
        let tests_per_photon = match settings.gather {
            Gather::Brute if settings.builder == Builder::Naive => f64::from(settings.bounces),
            Gather::Brute => stored,
            Gather::Grid | Gather::KdTree => {
                // The cells in reach are three radii wide and may hold pieces of two walls; photons
                // are taken as spread over all walls alike. A tree has fewer photons in reach and planes to pass.
                let areas = scene.walls().map(|(face, _)| scene.rectangle(face)).map(|wall| wall.u.length() * wall.v.length());
                let in_reach = 2.0 * (3.0 * settings.radius).powi(2);
                stored * (in_reach / areas.sum::<f64>()).min(1.0)
            }
        };
        let slots = settings.builder == Builder::Naive;
        Work {
            points: point_count as f64,
            tests_per_photon,
            flights_per_photon: stored + 1.0,
            most_tests: settings.nearest.map_or(f64::INFINITY, |nearest| TESTS_PER_NEAREST * f64::from(nearest)),
            entries_per_photon: if slots { f64::from(settings.bounces) } else { stored },
        }
    }

    /// Pair tests of one point for a chunk.
    pub(crate) fn tests_per_point(&self, photons: u32) -> u64 {
        (self.tests_per_photon * f64::from(photons)).min(self.most_tests).ceil() as u64
    }

    /// A pass of building the kd-tree over a chunk's photons, as pair tests.
    pub(crate) fn tree_pass(&self, photons: u32) -> u64 {
        (self.entries_per_photon * PAIR_TESTS_PER_TREE_PASS * f64::from(photons)) as u64
    }

    /// Flights of a chunk, as pair tests.
    pub(crate) fn tracing(&self, photons: u32) -> u64 {
        (self.flights_per_photon * PAIR_TESTS_PER_FLIGHT * f64::from(photons)) as u64
    }
}

/// Candidates of a point for each invocation that shares them.
const TESTS_PER_LANE: f64 = 8.0;

/// Invocations that share a point of a gather over the grid, where it is expected to test so many photons.
pub(super) fn lanes(settings: &RoomSettings, limits: &Limits, tests_per_point: u64) -> u32 {
    // Sums of floats depend on who adds what.
    if settings.sums != Sums::Integer {
        return 1;
    }
    lanes_of(tests_per_point as f64 / TESTS_PER_LANE, limits)
}

/// Invocations that share a point which would keep so many of them busy: a power of two.
pub(super) fn lanes_of(busy: f64, limits: &Limits) -> u32 {
    1 << (busy.clamp(1.0, f64::from(limits.lanes)) as u32).ilog2()
}

/// Candidates that one invocation of a gather may have to test. A software device's lanes wait for each other, row by row
/// of cells: a quarter leaves room for that.
pub(super) fn most_candidates(limits: &Limits) -> u32 {
    limits.loop_iterations / 4
}

/// Photons of a chunk from which on one counter keeps the atomic builder waiting: on an NVIDIA H200 8 of them make it 1.7 to
/// 1.8 times as fast from 2^22 photons on, and 0.9 times at 2^20, where gaps cost a launch a bounce; this lies between.
const MANY_PHOTONS: u32 = 1 << 21;

/// Counters that the atomic builder's work groups use round-robin.
pub(super) fn counters(settings: &RoomSettings, limits: &Limits, photons: u32) -> u32 {
    if settings.builder != Builder::Atomic {
        return 1;
    }
    settings.counters.unwrap_or(if photons < MANY_PHOTONS { 1 } else { limits.counters })
}

/// Photons of an invocation over which short and long paths even out.
const MOST_PHOTONS_PER_INVOCATION: u32 = 16;
/// Lanes of a software device's vector: they begin photons at different times, and it counts the loops of all.
const LANES: u32 = 16;

/// How photons are dealt to invocations that keep them to their end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct Persistence {
    /// Invocations that keep the device busy.
    pub busy_invocations: u32,
    /// Most photons of one, one after the other.
    pub most_photons: u32,
}

impl Persistence {
    /// Of photons that take so many loop iterations to begin and for each of their bounces.
    pub(crate) fn new(loops_to_begin: u32, loops_per_bounce: u32, bounces: u32, limits: &Limits) -> Persistence {
        let loops = LANES * loops_to_begin + loops_per_bounce * bounces;
        Persistence {
            busy_invocations: limits.busy_invocations,
            most_photons: (limits.loop_iterations / loops).clamp(1, MOST_PHOTONS_PER_INVOCATION),
        }
    }

    /// Invocations for the photons of a dispatch.
    pub(crate) fn invocations(&self, photons: u32) -> u32 {
        photons.div_ceil((photons / self.busy_invocations).clamp(1, self.most_photons))
    }
}

/// Loop iterations of a bounce in the paper's room, those of its random numbers included, and of beginning a photon.
pub(super) const LOOPS_PER_BOUNCE: u32 = 48;

pub(super) fn loops_to_begin(rng: Rng) -> u32 {
    if rng == Rng::Mt { MT_MIDDLE } else { LOOPS_PER_BOUNCE }
}

/// Photons traced at once.
///
/// The photon map has room for `bounces` photons of each path, the most that can be stored, so it
/// can never be full: a round that does not fit is split here, and nothing is dropped there.
pub(crate) fn chunk_photons(settings: &RoomSettings, limits: &Limits, work: &Work) -> Result<u32> {
    let bounces = u64::from(settings.bounces);
    let path = size_of::<PackedPhotonState>() as u64;
    let by_buffer = (limits.buffer_bytes / path).min(limits.buffer_bytes / (PHOTON_BYTES * bounces));
    // Two path arrays, the photon map with the names that somebody may ask for, and its sorted copy.
    let copy = if settings.gather == Gather::KdTree { TREE_BYTES } else { PHOTON_BYTES + RANK_BYTES };
    let by_memory = limits.memory_bytes / (2 * path + (PHOTON_BYTES + ORIGIN_BYTES + copy) * bounces);
    // Entries are numbered in 32 bits.
    let by_index = u64::from(u32::MAX) / bounces;
    let fits = by_buffer.min(by_memory).min(by_index);
    // A chunk may hold one photon more than its share of each of the two lights, and gaps up to the end of a work group.
    let has_gaps = counters(settings, limits, fits.min(u64::from(settings.photons)) as u32) > 1;
    let spare = 2 + if has_gaps { u64::from(settings.group_size) } else { 0 };
    let too_many =
        format!("the hits of two photons exceed the device's largest buffer, {} bytes; ask for fewer bounces", limits.buffer_bytes);
    require(fits >= 2 + spare, "bounces", settings.bounces, too_many)?;
    let most = format!("must be at most {} on this device", limits.group_size);
    require(settings.group_size <= limits.group_size, "group_size", settings.group_size, most)?;
    // A point's tests are not split further than by work group, nor a chunk by Ctrl-C; who asks for
    // larger chunks gets them.
    let budget = limits.pair_tests_per_submission as f64;
    let tests_per_photon = work.tests_per_photon.max(1e-9);
    let by_dispatch = budget / (f64::from(settings.group_size) * tests_per_photon);
    let by_chunk = SUBMISSIONS_PER_CHUNK * budget / (work.points * tests_per_photon + work.flights_per_photon * PAIR_TESTS_PER_FLIGHT);
    let by_time = by_dispatch.min(by_chunk) as u64;
    if let Some(nearest) = settings.nearest {
        // The nearest photons of parts of a round are not those of the round.
        let (photons, room) = (u64::from(settings.photons), fits - spare);
        let most = format!(
            "searches the {photons} photons of a round at once, but the device holds at most {room}; ask for fewer photons and more rounds"
        );
        require(photons <= room, "nearest", nearest, most)?;
        return Ok(settings.photons);
    }
    let wanted = settings.chunk.map_or(by_time, u64::from);
    Ok((fits - spare).min(wanted).clamp(2, u64::from(settings.photons)) as u32)
}
