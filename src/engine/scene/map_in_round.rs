//! The photons of a map in a round: traced, read from a file or kept from before, and gathered at all points.

use std::ops::Range;
use std::time::{Duration, Instant};

use super::map_cache::MapCache;
use super::map_file::MapFile;
use super::{Round, SceneFilm, estimate, index, radius_class, trace};
use crate::engine::run::RunState;
use crate::error::Result;
use crate::gpu::Commands;
use crate::ledger::Fates;
use crate::plan::scene::MapPlan;
use crate::records::CellPush;
use crate::timings::Handled;

/// Timestamps that one grid of a map may need.
const TIMESTAMPS_PER_GRID: u32 = 32;

/// Photons of the first chunk of a run in which the time may be up, and how long a chunk may take that the next one doubles.
pub(super) const FIRST_TIMED_CHUNK: u32 = 1 << 12;
const TIMED_CHUNK: Duration = Duration::from_millis(40);

/// Photons of a file that are uploaded together.
const STORED_AT_ONCE: u32 = 1 << 22;

/// A file, and the fates of its photons in rounds that nobody has counted yet: of each map, and those of whole blocks among them.
pub(super) struct StoredPhotons<'a> {
    pub(super) file: &'a MapFile,
    pub(super) open: [Fates; 2],
    pub(super) open_of_blocks: [Fates; 2],
}

/// A map, and the grids that its points need.
pub(super) struct MapInRound<'a> {
    pub(super) map: &'a MapPlan,
    pub(super) grids: &'a [Range<u32>],
}

/// The photons of a map that a file holds; says how many were emitted for them.
pub(super) fn one_stored_map(
    commands: &mut Commands,
    round: Round,
    in_round: &MapInRound,
    stored: &mut StoredPhotons,
    state: &mut RunState<SceneFilm>,
) -> Result<u32> {
    let (map, photons) = (in_round.map, round.photons());
    let which = usize::from(map.caustic_only);
    state.hand_out(which, map.photons);
    stored.open[which].add(&Fates { emitted: 0, ..stored.file.fates(round.number, map.name).clone() });
    let most = map.capacity.min(STORED_AT_ONCE) as usize;
    stored.file.photons(round.number, map.name, most, round.geometry.planes.len(), &mut |of_file| {
        commands.upload(&photons.map, of_file)?;
        commands.fill(&photons.counters, 0, 1, of_file.len() as u32);
        gather_in_grids(commands, round, in_round, Some(of_file.len() as u32))?;
        // What was staged goes.
        commands.submit()
    })?;
    Ok(map.photons)
}

/// The photons of a map; says how many. Where the time may be up, chunks grow only as long as they take little of it, from round to round.
pub(super) fn one_map(
    commands: &mut Commands,
    round: Round,
    in_round: &MapInRound,
    deadline: Option<Instant>,
    timed_chunk: &mut u32,
    mut cache: Option<&mut MapCache>,
    state: &mut RunState<SceneFilm>,
) -> Result<u32> {
    let map = in_round.map;
    let mut traced = 0;
    while traced < map.photons {
        let began = Instant::now();
        if traced > 0 && deadline.is_some_and(|deadline| began >= deadline) {
            break;
        }
        let most = if deadline.is_some() { *timed_chunk } else { map.chunk_photons };
        let count = most.min(map.chunk_photons).min(map.photons - traced);
        state.hand_out(usize::from(map.caustic_only), count);
        trace::trace(commands, round, map, (traced, count), &mut |commands, stored| {
            cache.as_mut().map_or(Ok(()), |cache| cache.store(commands, round, map))?;
            gather_in_grids(commands, round, in_round, stored)
        })?;
        traced += count;
        if deadline.is_some() {
            commands.submit()?;
            let is_short = began.elapsed() < TIMED_CHUNK;
            *timed_chunk = if is_short { timed_chunk.saturating_mul(2) } else { *timed_chunk };
        }
    }
    Ok(traced)
}

/// The photons of a map that was kept; says how many were emitted for them.
pub(super) fn one_cached_map(
    commands: &mut Commands,
    round: Round,
    in_round: &MapInRound,
    cache: &MapCache,
    state: &mut RunState<SceneFilm>,
) -> Result<u32> {
    let (map, photons) = (in_round.map, round.photons());
    state.hand_out(usize::from(map.caustic_only), map.photons);
    for part in cache.parts(map) {
        commands.copy(part, &photons.map, part.count());
        commands.fill(&photons.counters, 0, 1, part.count() as u32);
        gather_in_grids(commands, round, in_round, Some(part.count() as u32))?;
    }
    Ok(map.photons)
}

/// Adds the photons that are in the map, whose number may be known, to the estimates of all points. Points of radii that differ much look photons up in grids of
/// their own.
fn gather_in_grids(commands: &mut Commands, round: Round, map: &MapInRound, stored: Option<u32>) -> Result<()> {
    let MapInRound { map, grids } = *map;
    for (grid, classes) in grids.iter().enumerate() {
        if commands.timestamps_left() < TIMESTAMPS_PER_GRID || commands.is_full(round.plan.work_per_submission) {
            commands.submit()?;
        }
        let radius = radius_class::radius_of_class(round.plan.widest_radius(map, round.number), classes.start);
        let cells = CellPush { counts_stored: u32::from(grid == 0), ..index::cells(round, map, radius) };
        commands.scope("index", |commands| index::build(commands, round, map, &cells, stored))?;
        commands.scope("gather", |commands| {
            let stored = stored.map_or(0, u64::from);
            commands.count(Handled { stored, bytes: map.bytes_of_reading(stored), ..Handled::default() });
            estimate::gather(commands, round, map, classes.clone(), cells)
        })?;
    }
    Ok(())
}
