//! Photons of a chunk through a scene of triangles, by each builder.

use super::Round;
use super::resources::{OrderBuffers, PhotonBuffers, SceneResources};
use crate::constants::NONE;
use crate::engine::prefix_sum::scan;
use crate::error::Result;
use crate::gpu::kernels::{
    DispatchSize, EmitScene, ScanAdd, ScanBlocks, ScanMoveScene, TracePersistentScene, TraceSceneAtomic, TraceSceneBallot, TraceSceneGroup,
    TraceSceneNaive, TraceSceneScan,
};
use crate::gpu::{Commands, Extent, Kernel, Module};
use crate::photon::MapPhoton;
use crate::plan::buffers::survivor_count;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::records::{DispatchSizePush, Draws, EmissionPush, FlightPush, PhotonEmission, PhotonStore, SceneTracePersistentPush};
use crate::rng::words;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;
use crate::timings::Handled;

/// Kernels that tracing needs.
pub(crate) fn modules(plan: &ScenePlan) -> Vec<Module> {
    let by_builder = match plan.builder() {
        Builder::Naive => vec![EmitScene::MODULE, TraceSceneNaive::MODULE],
        Builder::Atomic => vec![EmitScene::MODULE, TraceSceneAtomic::MODULE],
        Builder::Ballot => vec![EmitScene::MODULE, TraceSceneBallot::MODULE],
        Builder::Group => vec![EmitScene::MODULE, TraceSceneGroup::MODULE],
        Builder::Scan => vec![EmitScene::MODULE, TraceSceneScan::MODULE, ScanMoveScene::MODULE],
        Builder::Persistent => vec![TracePersistentScene::MODULE],
        Builder::Cpu => panic!("the CPU builder traces no scene"),
    };
    [vec![DispatchSize::MODULE, ScanBlocks::MODULE, ScanAdd::MODULE], by_builder].concat()
}

/// Timestamps that must be left for the scopes that are open and for a bounce.
const TIMESTAMP_RESERVE: u32 = 32;
/// Work of one flight of a photon, in the plan's units.
const WORK_PER_PHOTON: u64 = 256;

/// Photons that a segment begins with.
#[derive(Debug, Clone, Copy)]
enum Start {
    /// Photons (first, count) of the round, at their lights.
    Lights((u32, u32)),
    /// So many in the list of this parity, with so many bounces behind them.
    List { count: u32, parity: usize, first_bounce: u32 },
}

/// Traces the photons (first, count) of a chunk to their end and adds their fates to the map's tallies. They go in segments of
/// bounces where more would not fit one dispatch or one map; survivors go on in the next. `gather` is called with the photons in
/// the map, and with their number where that is known: at the end, and before a segment for which the map might have no room.
pub(crate) fn trace(
    commands: &mut Commands,
    round: Round,
    map: &MapPlan,
    chunk: (u32, u32),
    gather: &mut dyn FnMut(&mut Commands, Option<u32>) -> Result<()>,
) -> Result<()> {
    let counters = &round.photons().counters;
    commands.fill(counters, 0, map.counter_count(), 0);
    let mut start = Start::Lights(chunk);
    let mut first_bounce = 0;
    loop {
        let flights = map.segment_bounces.min(map.bounces - first_bounce);
        let parity = commands.scope("trace", |commands| segment(commands, round, map, start, flights))?;
        first_bounce += flights;
        let slots = has_slots(round.plan).then(|| chunk.1 * if map.lands_once { 1 } else { flights });
        if let Some(slots) = slots {
            commands.fill(counters, 0, 1, slots);
        }
        if first_bounce == map.bounces {
            return gather(commands, None);
        }
        let counts = commands.read(counters, map.counter_count() as usize)?;
        let left = counts[if is_persistent(round.plan) { 1 } else { 1 + flights as usize }];
        let stored = counts[0];
        // Slots may be empty.
        let known = slots.is_none().then_some(stored);
        if left == 0 {
            return if stored > 0 { gather(commands, known) } else { Ok(()) };
        }
        let landings = u64::from(map.capacity / map.chunk_photons);
        let is_full = slots.is_some() || u64::from(stored) + u64::from(left) * landings > u64::from(map.capacity);
        if is_full {
            gather(commands, known)?;
        }
        commands.fill(counters, 0, map.counter_count(), 0);
        if !is_full {
            commands.fill(counters, 0, 1, stored);
        }
        // Paths that keep their slots leave gaps among those that go on.
        let count = if slots.is_some() { chunk.1 } else { left };
        start = Start::List { count, parity, first_bounce };
    }
}

/// The photons that a map holds of a round.
pub(crate) fn stored(commands: &mut Commands, round: Round, map: &MapPlan) -> Result<Vec<MapPhoton>> {
    let mut found = Vec::new();
    for chunk in map.chunks() {
        trace(commands, round, map, chunk, &mut |commands, _| take_map(commands, round, map, &mut found))?;
    }
    Ok(found)
}

/// Adds the photons that are in the map now, without empty slots.
pub(crate) fn take_map(commands: &mut Commands, round: Round, map_plan: &MapPlan, found: &mut Vec<MapPhoton>) -> Result<()> {
    let PhotonBuffers { counters, map, .. } = round.photons();
    let count = commands.read(counters, 1)?[0].min(map_plan.capacity);
    found.extend(commands.read(map, count as usize)?.into_iter().filter(|photon| photon.plane != NONE));
    Ok(())
}

/// Whether the map has slots, some of them empty.
fn has_slots(plan: &ScenePlan) -> bool {
    plan.builder() == Builder::Naive
}

fn is_persistent(plan: &ScenePlan) -> bool {
    plan.builder() == Builder::Persistent
}

/// So many flights of each photon; says where those are that are left.
fn segment(commands: &mut Commands, round: Round, map: &MapPlan, start: Start, flights: u32) -> Result<usize> {
    if is_persistent(round.plan) {
        return trace_persistent(commands, round, map, start, flights);
    }
    let (count, mut parity, first_bounce) = match start {
        Start::Lights(chunk) => {
            emit(commands, round, map, chunk)?;
            commands.count(Handled { photons: chunk.1.into(), ..Handled::default() });
            (chunk.1, 0, 0)
        }
        Start::List { count, parity, first_bounce } => (count, parity, first_bounce),
    };
    commands.fill(&round.photons().counters, 1, 1, count);
    for list in 0..flights {
        if commands.timestamps_left() < TIMESTAMP_RESERVE {
            commands.submit()?;
        }
        // After the first flight only the device knows how many paths are left; the naive builder looks at every slot each time.
        let extent = if list == 0 || has_slots(round.plan) {
            Extent::Items(u64::from(count))
        } else {
            dispatch_size(commands, round, 1 + list, map.chunk_photons)?;
            Extent::Indirect(&round.photons().dispatch_args)
        };
        let is_asked = list + 1 == flights && first_bounce + flights < map.bounces;
        trace_flight(commands, round, map, Flight { bounce: first_bounce + list, list, parity, is_asked }, extent)?;
        parity = 1 - parity;
    }
    commands.add_work(WORK_PER_PHOTON * u64::from(count));
    Ok(parity)
}

fn draws(round: Round, map: &MapPlan) -> Draws {
    Draws { seed: words(round.plan.settings.seed), round: round.number, domain: map.domain }
}

fn emission(geometry: &Geometry, map: &MapPlan, (first_photon, photon_count): (u32, u32)) -> PhotonEmission {
    PhotonEmission {
        first_photon,
        photon_count,
        emitter_count: geometry.emitters.len() as u32,
        scene_radius: geometry.radius as f32,
        target_count: map.target_count,
        through_openings: u32::from(map.through_openings),
        flux_gain: map.flux_gain as f32,
    }
}

fn store(plan: &ScenePlan, map: &MapPlan) -> PhotonStore {
    PhotonStore {
        photon_capacity: map.capacity,
        stored: map.stored,
        caustic_only: u32::from(map.caustic_only),
        lands_once: u32::from(map.lands_once),
        caustic_surfaces: plan.caustic_surfaces,
    }
}

/// So many flights of each photon, which keeps its invocation; says where those are that are left.
fn trace_persistent(commands: &mut Commands, round: Round, map: &MapPlan, start: Start, flights: u32) -> Result<usize> {
    let Round { resources, geometry, plan, .. } = round;
    let SceneResources { scene, nonfinite_values, .. } = resources;
    let PhotonBuffers { paths, counters, map: map_buffer, tallies, totals, .. } = round.photons();
    let which = usize::from(map.caustic_only);
    let (tallies, totals) = (&tallies[which], &totals[which]);
    let (mut first, end, parity, first_bounce) = match start {
        Start::Lights((first, count)) => (first, first + count, 0, 0),
        Start::List { count, parity, first_bounce } => (0, count, parity, first_bounce),
    };
    while first < end {
        let count = photons_at_once(commands, plan).min(end - first);
        let push = SceneTracePersistentPush {
            draws: draws(round, map),
            emission: emission(geometry, map, (first, count)),
            map: store(plan, map),
            bounces: map.bounces,
            first_bounce,
            flights,
            stride: map.persistence.invocations(count),
        };
        let kernel = TracePersistentScene {
            scene,
            paths: &paths[parity],
            next_paths: &paths[1 - parity],
            map: map_buffer,
            counters,
            tallies,
            totals,
            nonfinite_values,
        };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(push.stride)))?;
        commands.add_work(WORK_PER_PHOTON * u64::from(count));
        if matches!(start, Start::Lights(_)) {
            commands.count(Handled { photons: count.into(), ..Handled::default() });
        }
        first += count;
        if first < end && commands.is_due(plan.work_per_submission) {
            commands.submit()?;
        }
    }
    Ok(1 - parity)
}

/// Photons of one dispatch.
fn photons_at_once(commands: &Commands, plan: &ScenePlan) -> u32 {
    let paced = commands.paced(plan.work_per_submission) / WORK_PER_PHOTON;
    (paced.min(u32::MAX.into()) as u32).max(LEAST_PHOTONS).min(plan.photons_per_dispatch())
}

/// Fewer photons in a dispatch would leave a device idle.
const LEAST_PHOTONS: u32 = 1 << 12;

/// Writes the paths of a chunk as they leave the lights.
pub(crate) fn emit(commands: &mut Commands, round: Round, map: &MapPlan, chunk: (u32, u32)) -> Result<()> {
    let Round { resources, geometry, .. } = round;
    let SceneResources { scene, nonfinite_values, .. } = resources;
    let next_paths = &round.photons().paths[0];
    let push = EmissionPush { draws: draws(round, map), emission: emission(geometry, map, chunk) };
    let kernel = EmitScene { scene, next_paths, nonfinite_values };
    commands.dispatch(kernel, &push, Extent::Items(u64::from(chunk.1)))
}

/// One flight of the paths in list `list` of a segment, which the buffer of this parity holds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Flight {
    pub bounce: u32,
    pub list: u32,
    pub parity: usize,
    /// The host will ask how many paths are left.
    pub is_asked: bool,
}

pub(crate) fn trace_flight(commands: &mut Commands, round: Round, map: &MapPlan, flight: Flight, extent: Extent) -> Result<()> {
    let Round { resources, plan, .. } = round;
    let SceneResources { scene, nonfinite_values, .. } = resources;
    let Flight { bounce, list, parity, is_asked } = flight;
    let push = FlightPush {
        draws: draws(round, map),
        map: store(plan, map),
        bounce,
        list,
        is_last: u32::from(bounce + 1 == map.bounces),
        counts_left: u32::from(is_asked),
        path_capacity: map.chunk_photons,
    };
    let which = usize::from(map.caustic_only);
    let PhotonBuffers { paths, counters, map, sorted_map, order, tallies, totals, .. } = round.photons();
    let (tallies, totals) = (&tallies[which], &totals[which]);
    let (paths, next_paths) = (&paths[parity], &paths[1 - parity]);
    macro_rules! trace {
        ($kernel:ident { $next_paths:expr $(, $more:ident)* }) => {
            commands.dispatch(
                $kernel {
                    scene, paths, next_paths: $next_paths, map, counters, tallies,
                    totals, nonfinite_values $(, $more)*
                },
                &push,
                extent,
            )
        };
    }
    match plan.builder() {
        Builder::Naive => trace!(TraceSceneNaive { next_paths }),
        Builder::Atomic => trace!(TraceSceneAtomic { next_paths }),
        Builder::Ballot => trace!(TraceSceneBallot { next_paths }),
        Builder::Group => trace!(TraceSceneGroup { next_paths }),
        Builder::Scan => {
            let Some(OrderBuffers { survivors, sums_of_survivors }) = order else { panic!("the plan has no order to keep") };
            // Nobody needs the sorted map before the photons of all bounces are there.
            let landed = sorted_map;
            let item_count = survivor_count(plan, push.path_capacity);
            commands.fill(survivors, 0, u64::from(item_count), 0);
            trace!(TraceSceneScan { paths, survivors, landed })?;
            scan(commands, survivors, sums_of_survivors, item_count, plan.settings.group_size)?;
            commands.dispatch(ScanMoveScene { paths, next_paths, map, counters, tallies, totals, survivors, landed }, &push, extent)
        }
        Builder::Persistent | Builder::Cpu => panic!("{} has no flights of all photons", plan.builder().name()),
    }
}

fn dispatch_size(commands: &mut Commands, round: Round, counter: u32, capacity: u32) -> Result<()> {
    let PhotonBuffers { counters, dispatch_args, .. } = round.photons();
    let push = DispatchSizePush::new(counter, capacity, round.plan.settings.group_size);
    commands.dispatch(DispatchSize { counters, dispatch_args }, &push, Extent::Groups(1, 1))
}
