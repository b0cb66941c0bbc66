//! Prefix sum, grid index, appending to a full map and the size of an indirect dispatch, each against
//! the plain way to do it on the host.

use crate::common::prelude::*;
use crate::fuzz::change::Random;
use bytemuck::Zeroable;
use photonmill::constants::{NO_WALL, SCAN_ITEMS};
use photonmill::engine::prefix_sum::scan;
use photonmill::engine::room::resources::RoomResources;
use photonmill::engine::room::{Chunk, constants, index, trace};
use photonmill::engine::tallies;
use photonmill::gpu::kernels::DispatchSize;
use photonmill::plan::buffers::block_sum_counts;
use photonmill::records::{DispatchArgs, DispatchSizePush, Tally};

/// Words that nothing may touch. As an entry of the photon map they are a photon on some wall.
const GUARD: u32 = 0x5EAD_BEEF;

/// Numbers by chance, 0 to `below` - 1.
fn numbers(count: usize, below: u32) -> Vec<u32> {
    let mut random = Random(12_345);
    (0..count).map(|_| random.below(below as usize) as u32).collect()
}

/// Fails unless the device's exclusive prefix sums are the running sums, and it leaves alone what stands behind them in the same buffer.
fn assert_running_sums(gpu: &Device, items: &[u32], group_size: u32) {
    let guards = 64;
    let count = items.len() as u64 + guards;
    let mut commands = Commands::new(gpu, Constants::new(group_size), Instant::now()).unwrap();
    let buffer = gpu.buffer::<u32>("items", count, Memory::Device).unwrap();
    let level = |count| gpu.buffer("block sums", count, Memory::Device).unwrap();
    let levels: Vec<_> = block_sum_counts(items.len() as u64, group_size).into_iter().map(level).collect();
    commands.fill(&buffer, 0, count, GUARD);
    commands.upload(&buffer, items).unwrap();
    scan(&mut commands, &buffer, &levels, items.len() as u32, group_size).unwrap();
    let sums = items.iter().scan(0u32, |sum, item| Some(std::mem::replace(sum, sum.wrapping_add(*item))));
    let expected = sums.chain(std::iter::repeat_n(GUARD, guards as usize));
    let found = commands.read(&buffer, count as usize).unwrap();
    let wrong = pairs(found, expected).enumerate().find(|(_, (found, expected))| found != expected);
    assert_eq!(wrong, None, "{} items, groups of {group_size}", items.len());
}

/// Also where more work groups are needed than a device must allow along x, so that the dispatch is folded into rows where it allows
/// no more.
#[test]
fn the_prefix_sum_is_the_running_sum() {
    let Some(gpu) = device() else { return };
    for group_size in [32, 128, 1024].into_iter().filter(|size| *size <= gpu.facts().work_group_size) {
        let subgroup = gpu.facts().subgroup_size * SCAN_ITEMS;
        let block = group_size * SCAN_ITEMS;
        let around = [subgroup, block].into_iter().flat_map(|size| [size - 1, size, size + 1]);
        let more = [2 * block + 1, block * block, block * block + 1, 1_000_000];
        for size in [0, 1, 3, 4, 5].into_iter().chain(around).chain(more).filter(|size| *size <= 1_100_000) {
            assert_running_sums(&gpu, &numbers(size as usize, 1000), group_size);
        }
    }
    assert_running_sums(&gpu, &numbers((65_535 * 32 * SCAN_ITEMS + 77) as usize, 400), 32);
}

/// The index holds each photon once, in the run of its own cell.
fn index_check(plan: &RoomPlan, cells: &[u32], sorted: &[Photon], map: &[Photon]) -> Check {
    let grid = &plan.grid;
    let [mut found, mut expected] = [sorted, map].map(|photons| photons.iter().map(|photon| photon.stored().0).collect::<Vec<_>>());
    expected.sort_unstable();
    found.sort_unstable();
    require(found == expected, || "the sorted photons are not the photons of the map")?;
    require(cells.last() == Some(&(map.len() as u32)), || format!("the last cell ends at {:?} of {}", cells.last(), map.len()))?;
    let mut begin = 0;
    for (cell, &end) in cells.iter().enumerate() {
        require(end >= begin, || format!("cell {cell} ends at {end} before it begins at {begin}"))?;
        for photon in &sorted[begin as usize..end as usize] {
            let place: [u32; 3] = std::array::from_fn(|axis| {
                let along = (photon.position[axis] - grid.origin[axis]) * grid.cells_per_metre;
                (along.floor().max(0.0) as u32).min(grid.cell_count[axis] - 1)
            });
            let number = (place[2] * grid.cell_count[1] + place[1]) * grid.cell_count[0] + place[0];
            require(number as usize == cell, || format!("{photon:?} of cell {number} lies in cell {cell}"))?;
        }
        begin = end;
    }
    Ok(())
}

#[test]
fn the_index_holds_every_photon_in_its_cell() {
    let Some(gpu) = device() else { return };
    let cases = [(5000, 0.05, 128), (2, 0.05, 128), (129, 0.05, 32), (5001, 0.001, 256), (20_001, 0.5, 64)];
    for (builder, (photon_count, radius, group_size)) in Builder::ON_GPU.into_iter().zip(cases.into_iter().cycle()) {
        let settings =
            RoomSettings { builder, photons: photon_count, radius, group_size, chunk: Some(photon_count), ..RoomSettings::default() };
        let scene = open_box(&settings);
        let plan = plan_for(&gpu, &scene, &settings);
        assert_eq!(plan.chunks_per_round, 1);
        let mut commands = Commands::new(&gpu, constants(&plan), Instant::now()).unwrap();
        let resources = RoomResources::new(&mut commands, &scene, &plan).unwrap();
        let buffers = resources.index.as_ref().expect("a grid gather has an index");
        trace::chunk(&mut commands, &resources, &plan, 0, &plan.chunk(0)).unwrap();
        index::build(&mut commands, Chunk { resources: &resources, plan: &plan, photon_count }).unwrap();
        let map = photons(&gpu, &settings);
        let begins = commands.read(&buffers.cells, plan.grid.cells() as usize + 1).unwrap();
        assert_eq!(begins[0], 0);
        // A cell ends where the next one begins.
        let cells = begins[1..].to_vec();
        let sorted = commands.read(&buffers.sorted_photons, map.len()).unwrap();
        let sorted: Vec<Photon> = sorted.into_iter().map(|photon| photon.photon(Origin::default(), &scene.room_record())).collect();
        assert_holds(format!("{builder:?}, {photon_count} photons, radius {radius}"), index_check(&plan, &cells, &sorted, &map));

        if photon_count == 5000 {
            let mut swapped = sorted.clone();
            swapped.swap(10, sorted.len() - 10);
            assert_complains("photons in each other's cells", index_check(&plan, &cells, &swapped, &map));
            let mut doubled = sorted.clone();
            doubled[10] = doubled[11];
            assert_complains("a photon in place of another", index_check(&plan, &cells, &doubled, &map));
            let mut shifted = cells.clone();
            let busy = (1..cells.len()).find(|&cell| cells[cell] > cells[cell - 1]).unwrap();
            shifted[busy] -= 1;
            assert_complains("a cell that ends early", index_check(&plan, &shifted, &sorted, &map));
        }
    }
}

/// What some bounces left behind when the photon map has room for `capacity` photons.
#[derive(Clone)]
struct Appended {
    /// Of the photon map, as far as there was room.
    photons: Vec<Photon>,
    /// Behind the photon map and behind the outgoing paths, inside the buffers that were bound.
    guards: Vec<u32>,
    counters: Vec<u32>,
    tallies: Vec<Tally>,
    /// Whether places may be left empty.
    has_gaps: bool,
}

impl Appended {
    /// Entries of the photon map that anybody looks at.
    fn entries(&self, settings: &RoomSettings) -> u32 {
        let slots = settings.photons * settings.bounces;
        if settings.builder == Builder::Naive { slots } else { self.counters[0] }.min(self.photons.len() as u32)
    }

    fn stored(&self, settings: &RoomSettings) -> impl Iterator<Item = &Photon> {
        self.photons[..self.entries(settings) as usize].iter().filter(|photon| photon.wall != NO_WALL)
    }
}

/// Entries of each array that stand behind its capacity.
const GUARD_ENTRIES: u64 = 64;

fn append(gpu: &Device, scene: &RoomScene, settings: &RoomSettings, capacity: u32) -> Appended {
    let mut plan = RoomPlan { keeps_origins: true, ..plan_for(gpu, scene, settings) };
    let bounces = settings.bounces;
    // Behind each of the arrays that paths lie in.
    let path_places = plan.path_capacity as usize;
    plan.path_capacity += GUARD_ENTRIES as u32;
    let path_count = u64::from(plan.path_capacity);
    let mut commands = Commands::new(gpu, constants(&plan), Instant::now()).unwrap();
    let mut resources = RoomResources::new(&mut commands, scene, &plan).unwrap();
    plan.photon_capacity = capacity;
    let entries = u64::from(capacity) + GUARD_ENTRIES;
    resources.photons = gpu.buffer("guarded photons", entries, Memory::Device).unwrap();
    resources.origins = gpu.buffer("guarded origins", entries, Memory::Device).unwrap();
    commands.fill(&resources.photons, 0, entries, GUARD);
    commands.fill(&resources.origins, 0, entries, GUARD);
    for paths in &mut resources.paths {
        *paths = gpu.buffer("guarded paths", path_count, Memory::Device).unwrap();
        commands.fill(paths, 0, path_count, GUARD);
    }
    trace::chunk(&mut commands, &resources, &plan, 0, &plan.chunk(0)).unwrap();
    let map = commands.read(&resources.photons, entries as usize).unwrap();
    let (map, behind) = map.split_at(capacity as usize);
    let origins = commands.read(&resources.origins, entries as usize).unwrap();
    let (origins, origins_behind) = origins.split_at(capacity as usize);
    let mut guards: Vec<u32> = [bytemuck::cast_slice(behind), bytemuck::cast_slice(origins_behind)].concat();
    for paths in &resources.paths {
        let words = commands.read(paths, path_count as usize).unwrap();
        for array in bytemuck::cast_slice::<_, [u32; 4]>(&words).chunks_exact(path_count as usize) {
            guards.extend(array[path_places..].as_flattened());
        }
    }
    Appended {
        photons: map.iter().zip(origins).map(|(photon, origin)| photon.photon(*origin, &scene.room_record())).collect(),
        guards,
        counters: commands.read(&resources.counters, bounces as usize + 2).unwrap(),
        tallies: tallies::read(&mut commands, &resources.tallies, bounces).unwrap(),
        has_gaps: plan.counters > 1,
    }
}

/// Everything that must hold of a map with too little room; `all` are the photons that exist.
fn overflow_check(appended: &Appended, settings: &RoomSettings, capacity: u32, all: &[Photon]) -> Check {
    let touched = appended.guards.iter().find(|word| **word != GUARD);
    require(touched.is_none(), || format!("a guard word became {touched:x?}"))?;
    let entries = appended.entries(settings);
    let stored: Vec<Photon> = appended.stored(settings).copied().collect();
    let counted: u32 = appended.tallies.iter().map(|tally| tally.stored).sum();
    require(stored.len() as u32 == counted, || format!("{} photons are in the map, {counted} were counted", stored.len()))?;
    let exist: HashSet<Vec<u8>> = all.iter().map(|photon| bytemuck::bytes_of(photon).to_vec()).collect();
    let stranger = stored.iter().find(|photon| !exist.contains(bytemuck::bytes_of(*photon)));
    require(stranger.is_none(), || format!("{stranger:?} is no photon of this run"))?;
    let distinct: HashSet<(u32, u32)> = stored.iter().map(|photon| (photon.photon, photon.bounce)).collect();
    require(distinct.len() == stored.len(), || "a photon is there twice")?;
    let mut entering = settings.photons;
    for (bounce, tally) in appended.tallies.iter().enumerate() {
        require(tally.stored + tally.absorbed + tally.escaped + tally.dropped == entering, || {
            format!("bounce {}: {entering} entered, {tally:?}", bounce + 1)
        })?;
        entering = tally.stored;
    }
    let survivors: u32 = appended.tallies.iter().map(|tally| tally.stored + tally.dropped).sum();
    let first = &appended.tallies[0];
    let needed = all.iter().filter(|photon| photon.bounce == 0).count() as u32;
    require(first.stored + first.dropped == needed, || {
        format!("{} + {} survivors of the first bounce, {needed} are right", first.stored, first.dropped)
    })?;
    if settings.builder == Builder::Naive {
        // Slot = number of the photon, so it is known which ones find no room.
        let fits = all.iter().filter(|photon| photon.bounce * settings.photons + photon.photon < capacity);
        // A photon that was dropped at one bounce has no later ones.
        let kept: Vec<Photon> = fits.filter(|photon| photon.photon < capacity).copied().collect();
        require(in_order(stored) == in_order(kept), || "other photons than those of the slots that exist")?;
        return Ok(());
    }
    // Gaps take places, too.
    let has_gaps = appended.has_gaps;
    require(counted == capacity.min(survivors) || has_gaps, || format!("{counted} of {capacity} places taken by {survivors} survivors"))?;
    require(counted >= survivors || appended.counters[0] > capacity, || {
        format!("{survivors} survivors, {counted} of them stored, and room was left")
    })?;
    require(appended.counters[0] >= survivors && (appended.counters[0] <= survivors || has_gaps), || {
        format!("the counter says {} instead of the need, {survivors}", appended.counters[0])
    })?;
    if settings.builder == Builder::Persistent {
        // No bounce hands paths to the next.
        return Ok(());
    }
    let places: u32 = appended.counters[2..].iter().sum();
    require(places == entries, || format!("{places} places of paths, {entries} of photons"))?;
    for (bounce, tally) in appended.tallies.iter().enumerate() {
        let paths = appended.counters[2 + bounce];
        let most = if has_gaps { appended.counters[1 + bounce].next_multiple_of(settings.group_size) } else { tally.stored };
        require((tally.stored..=most).contains(&paths), || {
            format!("{} paths leave bounce {}, {} were stored", appended.counters[2 + bounce], bounce + 1, tally.stored)
        })?;
    }
    Ok(())
}

/// What is spoiled, and how.
type Spoil = (&'static str, fn(&mut Appended));

const SPOILS: [Spoil; 7] = [
    ("a write behind the end", |appended| appended.guards[5] = 0),
    ("a photon lost", |appended| appended.photons[5] = Photon { wall: NO_WALL, ..Photon::zeroed() }),
    ("a photon doubled", |appended| appended.photons[5] = appended.photons[6]),
    ("a photon made up", |appended| appended.photons[5].position.x *= 1.01),
    ("a drop that was not counted", |appended| appended.tallies[1].dropped -= 1),
    ("a counter that stops at the end", |appended| appended.counters[0] = appended.photons.len() as u32),
    ("a path without a photon", |appended| appended.counters[2] += 1),
];

#[test]
fn a_full_map_drops_counts_and_keeps_to_its_room() {
    let Some(gpu) = device() else { return };
    for (builder, counters) in Builder::ON_GPU.map(|builder| (builder, None)).into_iter().chain([2, 16].map(|n| (Builder::Atomic, Some(n))))
    {
        for photon_count in [9, 65, 1000, 5001] {
            let settings = RoomSettings { builder, counters, photons: photon_count, bounces: 3, ..RoomSettings::default() };
            let scene = open_box(&settings);
            let all = photons(&gpu, &settings);
            let most = plan_for(&gpu, &scene, &settings).photon_capacity;
            let slots = builder == Builder::Naive;
            let need = if slots || counters.is_some() { most } else { all.len() as u32 };
            let half = if slots { need / 2 } else { all.len() as u32 / 2 };
            // Half of the need; room for none but one; all but one; enough.
            for capacity in [half, 1, need - 1, need, need + 17] {
                let what = format!("{builder:?}, {counters:?}, {photon_count} photons, room for {capacity} of {need}");
                let appended = append(&gpu, &scene, &settings, capacity);
                assert_holds(&what, overflow_check(&appended, &settings, capacity, &all));
                let dropped: u32 = appended.tallies.iter().map(|tally| tally.dropped).sum();
                if capacity >= need {
                    assert_eq!(dropped, 0, "{what}");
                } else if capacity == half && photon_count >= 65 {
                    assert!(dropped > 0, "{what}");
                }
                if builder == Builder::Atomic && counters != Some(16) && photon_count == 1000 && capacity == half {
                    for (what, spoil) in SPOILS {
                        let mut spoiled = appended.clone();
                        spoil(&mut spoiled);
                        assert_complains(what, overflow_check(&spoiled, &settings, capacity, &all));
                    }
                }
            }
        }
    }
}

/// All survive, none survives: in a closed white or black room.
#[test]
fn appending_at_survival_none_and_all() {
    let Some(gpu) = device() else { return };
    for builder in Builder::ON_GPU {
        for (albedo, stored_each) in [(0.0, 0), (1.0, 3)] {
            for photon_count in [2, 7, 8, 9, 31, 33, 127, 128, 129, 1000] {
                let settings = RoomSettings { builder, photons: photon_count, bounces: 3, reflectance: albedo, ..RoomSettings::default() };
                let scene = closed_box(&settings, albedo);
                let capacity = photon_count * 3;
                let appended = append(&gpu, &scene, &settings, capacity);
                let what = format!("{builder:?}, {photon_count} photons, albedo {albedo}");
                assert!(appended.guards.iter().all(|word| *word == GUARD), "{what}");
                let stored: HashSet<(u32, u32)> = appended.stored(&settings).map(|photon| (photon.photon, photon.bounce)).collect();
                assert_eq!(stored.len() as u32, photon_count * stored_each, "{what}");
                assert_eq!(appended.tallies.iter().map(|tally| tally.stored).sum::<u32>(), photon_count * stored_each, "{what}");
            }
        }
    }
}

/// The size that the device computes for an indirect dispatch of `items` items.
fn dispatch_size(gpu: &Device, items: u32, push: DispatchSizePush) -> DispatchArgs {
    let mut commands = Commands::new(gpu, Constants::new(128), Instant::now()).unwrap();
    let counters = gpu.buffer::<u32>("counters", 3, Memory::Device).unwrap();
    let dispatch_args = gpu.buffer::<DispatchArgs>("dispatch args", 2, Memory::Device).unwrap();
    commands.fill(&counters, 0, 3, 17);
    commands.fill(&counters, u64::from(push.counter), 1, items);
    commands.fill(&dispatch_args, 0, 2, GUARD);
    commands.dispatch(DispatchSize { counters: &counters, dispatch_args: &dispatch_args }, &push, Extent::Groups(1, 1)).unwrap();
    let sizes = commands.read(&dispatch_args, 2).unwrap();
    assert_eq!(sizes[1], DispatchArgs { x: GUARD, y: GUARD, z: GUARD });
    sizes[0]
}

/// Enough groups for every item, no row in vain, and no more along x than allowed.
fn dispatch_check(size: DispatchArgs, items: u64, push: DispatchSizePush) -> Check {
    let wanted = items.min(u64::from(push.capacity)).div_ceil(u64::from(push.items_per_group));
    let groups = u64::from(size.x) * u64::from(size.y);
    let fits = size.x <= push.max_groups && size.z == 1 && groups >= wanted;
    let in_vain = if wanted == 0 { groups } else { (groups - wanted.min(groups)) / u64::from(size.x.max(1)) };
    if fits && in_vain == 0 { Ok(()) } else { Err(format!("{size:?} for {wanted} groups of at most {} a row", push.max_groups)) }
}

#[test]
fn indirect_dispatches_are_folded_below_the_limit() {
    let Some(gpu) = device() else { return };
    for group in [32u32, 128, 1024] {
        let row = 65_535 * group;
        let around = [group, row, 2 * row].into_iter().flat_map(|size| [size - 1, size, size + 1]);
        for items in around.chain([0, 1, row + group, u32::MAX - 1, u32::MAX]) {
            for capacity in [u32::MAX, row, 1000] {
                for counter in [0, 2] {
                    let push = DispatchSizePush { counter, capacity, items_per_group: group, max_groups: 65_535 };
                    let size = dispatch_size(&gpu, items, push);
                    assert_holds(format!("{items} items, {push:?}"), dispatch_check(size, u64::from(items), push));
                }
            }
        }
    }
    let push = DispatchSizePush { counter: 0, capacity: u32::MAX, items_per_group: 64, max_groups: 65_535 };
    // 2^22 photons in groups of 64 are one group more than a row holds.
    assert_eq!(dispatch_size(&gpu, 1 << 22, push), DispatchArgs { x: 65_535, y: 2, z: 1 });
    for (what, size) in [
        ("a group too few", DispatchArgs { x: 65_535, y: 1, z: 1 }),
        ("a row too long", DispatchArgs { x: 65_536, y: 1, z: 1 }),
        ("a row in vain", DispatchArgs { x: 65_535, y: 3, z: 1 }),
        ("no depth", DispatchArgs { x: 65_535, y: 2, z: 0 }),
    ] {
        assert_complains(what, dispatch_check(size, 1 << 22, push));
    }
}

/// A full row of groups and more: photons of the folded rows are traced like the others.
#[test]
fn rounds_around_a_full_row_of_groups_lose_no_photon() {
    let beyond = of_run::<&[_]>(&[33], &[0, 33]);
    let builders = of_run::<&[_]>(&[Builder::Ballot, Builder::Persistent], &Builder::ON_GPU);
    let Some(gpu) = device() else { return };
    let row: u32 = 65_535 * 32;
    for photons in beyond.iter().map(|beyond| row + *beyond) {
        let of_one_bounce = RoomSettings { bounces: 1, mesh: 1, rng: Rng::Philox, ..RoomSettings::default() };
        let settings = RoomSettings { builder: Builder::Ballot, photons, group_size: 32, ..of_one_bounce };
        let split = run(&gpu, &RoomSettings { chunk: Some(1_000_003), ..settings.clone() });
        // The builders dispatch alike, so one of them tries both counts.
        for &builder in builders.iter().filter(|builder| photons > row || **builder == Builder::Ballot) {
            let folded = run(&gpu, &RoomSettings { builder, ..settings.clone() });
            assert_eq!(folded.plan.chunks_per_round, 1, "{photons} photons do not fit one dispatch here");
            let ledger = folded.ledger();
            assert!(ledger.closes() && ledger.emitted == u64::from(photons), "{ledger:?}");
            assert_eq!(split.fates, folded.fates, "{builder:?}");
            assert_holds(format!("{builder:?}"), equal_sums("a folded round", &folded.film.sums, &split.film.sums));
        }
    }
}
