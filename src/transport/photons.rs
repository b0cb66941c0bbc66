//! Photons of a chunk through a scene of triangles, and the index of their map.

use super::Round;
use super::resources::{PhotonBuffers, TransportResources};
use crate::constants::MAX_GROUPS;
use crate::error::Result;
use crate::gpu::kernels::{DispatchSize, FlyAtomic, FlyBallot, FlyWhole, MapCount, MapScatter, Shine};
use crate::gpu::{Commands, Extent};
use crate::plan::transport::{MapPlan, TransportPlan};
use crate::prefix_sum::scan;
use crate::records::{CellPush, DispatchSizePush, Draws, EmissionPush, FlightPush, FlyWholePush, PhotonEmission, PhotonStore};
use crate::rng::words;
use crate::scene::geometry::Geometry;
use crate::settings::transport::Append;

/// The grid of a map in a round: cells as wide as the radius, its corner a little outside of the scene.
pub fn cells(round: Round, map: &MapPlan) -> CellPush {
    let radius = round.plan.radius(map, round.number) as f32;
    CellPush {
        origin: round.geometry.bounds.0 - 4.0 * radius,
        cells_per_unit: 1.0 / radius,
        bucket_mask: map.bucket_count - 1,
        photon_capacity: map.capacity,
    }
}

/// Timestamps that must be left for the scopes that are open and for a bounce.
const TIMESTAMP_RESERVE: u32 = 32;

/// Traces the photons (first, count) of a chunk into the map and adds their fates to its tallies.
pub fn trace(commands: &mut Commands, round: Round, photons: &PhotonBuffers, map: &MapPlan, chunk: (u32, u32)) -> Result<()> {
    if round.plan.settings.append == Append::Persistent {
        return whole(commands, round, photons, map, chunk);
    }
    emit(commands, round, photons, map, chunk)?;
    for bounce in 0..map.bounces {
        if commands.timestamps_left() < TIMESTAMP_RESERVE {
            commands.submit()?;
        }
        // Every photon enters bounce 0; after that only the device knows how many paths are left.
        let extent = if bounce == 0 {
            Extent::Items(u64::from(chunk.1))
        } else {
            dispatch_size(commands, photons, round.plan, 1 + bounce, map.chunk_photons)?;
            Extent::Indirect(&photons.dispatch_args)
        };
        fly(commands, round, photons, map, bounce, extent)?;
    }
    Ok(())
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
        flux_gain: map.flux_gain as f32,
    }
}

fn store(plan: &TransportPlan, map: &MapPlan) -> PhotonStore {
    PhotonStore {
        photon_capacity: map.capacity,
        stored: map.stored,
        caustic_only: u32::from(map.caustic_only),
        caustic_surfaces: plan.caustic_surfaces,
    }
}

/// Traces every photon from the lights to its end.
fn whole(commands: &mut Commands, round: Round, photons: &PhotonBuffers, map: &MapPlan, chunk: (u32, u32)) -> Result<()> {
    let Round { resources, geometry, plan, .. } = round;
    let TransportResources { nodes, triangles, normals, uvs, materials, textures, texels, emitters, caustic_targets, oddities, .. } =
        resources;
    commands.fill(&photons.counters, 0, 1, 0);
    let tallies = &photons.tallies[usize::from(map.caustic_only)];
    let (first_photon, end) = (chunk.0, chunk.0 + chunk.1);
    let most = plan.photons_per_dispatch();
    for first in (first_photon..end).step_by(most as usize) {
        let count = most.min(end - first);
        let push = FlyWholePush {
            draws: draws(round, map),
            emission: emission(geometry, map, (first, count)),
            map: store(plan, map),
            bounces: map.bounces,
            stride: map.persistence.invocations(count),
        };
        let PhotonBuffers { counters, map, .. } = photons;
        let kernel = FlyWhole {
            nodes,
            triangles,
            normals,
            uvs,
            materials,
            textures,
            texels,
            emitters,
            caustic_targets,
            map,
            counters,
            tallies,
            oddities,
        };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(push.stride)))?;
    }
    Ok(())
}

/// Writes the paths of a chunk as they leave the lights.
pub fn emit(commands: &mut Commands, round: Round, photons: &PhotonBuffers, map: &MapPlan, chunk: (u32, u32)) -> Result<()> {
    let Round { resources, geometry, .. } = round;
    let photon_count = chunk.1;
    let TransportResources { nodes, triangles, normals, uvs, materials, textures, texels, emitters, caustic_targets, oddities, .. } =
        resources;
    let PhotonBuffers { paths: [light_paths, _], counters, .. } = photons;
    commands.fill(counters, 0, u64::from(map.bounces) + 2, 0);
    commands.fill(counters, 1, 1, photon_count);
    let push = EmissionPush { draws: draws(round, map), emission: emission(geometry, map, chunk) };
    let kernel = Shine { nodes, triangles, normals, uvs, materials, textures, texels, emitters, caustic_targets, light_paths, oddities };
    commands.dispatch(kernel, &push, Extent::Items(u64::from(photon_count)))
}

/// One flight of every path that is left.
pub fn fly(commands: &mut Commands, round: Round, photons: &PhotonBuffers, map: &MapPlan, bounce: u32, extent: Extent) -> Result<()> {
    let Round { resources, plan, .. } = round;
    let TransportResources { nodes, triangles, normals, uvs, materials, textures, texels, oddities, .. } = resources;
    let push = FlightPush { draws: draws(round, map), map: store(plan, map), bounce, path_capacity: map.chunk_photons };
    let tallies = &photons.tallies[usize::from(map.caustic_only)];
    let PhotonBuffers { paths: [even, odd], counters, map, .. } = photons;
    let (light_paths, next_light_paths) = if bounce.is_multiple_of(2) { (even, odd) } else { (odd, even) };
    match plan.settings.append {
        Append::Atomic => commands.dispatch(
            FlyAtomic {
                nodes,
                triangles,
                normals,
                uvs,
                materials,
                textures,
                texels,
                light_paths,
                next_light_paths,
                map,
                counters,
                tallies,
                oddities,
            },
            &push,
            extent,
        ),
        Append::Persistent | Append::Auto => panic!("{} has no flights of all photons", plan.settings.append.name()),
        Append::Ballot => commands.dispatch(
            FlyBallot {
                nodes,
                triangles,
                normals,
                uvs,
                materials,
                textures,
                texels,
                light_paths,
                next_light_paths,
                map,
                counters,
                tallies,
                oddities,
            },
            &push,
            extent,
        ),
    }
}

fn dispatch_size(commands: &mut Commands, photons: &PhotonBuffers, plan: &TransportPlan, counter: u32, capacity: u32) -> Result<()> {
    let PhotonBuffers { counters, dispatch_args, .. } = photons;
    let push = DispatchSizePush { counter, capacity, items_per_group: plan.settings.group_size, max_groups: MAX_GROUPS };
    commands.dispatch(DispatchSize { counters, dispatch_args }, &push, Extent::Groups(1, 1))
}

/// Sorts the map by the buckets of its cells.
pub fn index(commands: &mut Commands, photons: &PhotonBuffers, plan: &TransportPlan, cells_push: &CellPush) -> Result<()> {
    let PhotonBuffers { map, sorted_map, counters, cells, ranks, block_sums, dispatch_args, .. } = photons;
    let buckets = cells_push.bucket_mask + 1;
    commands.scope("count", |commands| {
        commands.fill(cells, 0, u64::from(buckets) + 1, 0);
        dispatch_size(commands, photons, plan, 0, cells_push.photon_capacity)?;
        commands.dispatch(MapCount { map, counters, cells, ranks }, cells_push, Extent::Indirect(dispatch_args))
    })?;
    commands.scope("scan", |commands| scan(commands, cells, block_sums, buckets + 1, plan.settings.group_size))?;
    commands.scope("sort", |commands| {
        commands.dispatch(MapScatter { map, counters, cells, sorted_map, ranks }, cells_push, Extent::Indirect(dispatch_args))
    })
}
