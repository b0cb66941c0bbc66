//! The radius of each visible point, found in a run's first round and kept from then on: it follows the density of photons around
//! the point. These photons are those of the trial (`engine::scene::trial`), none of the run's, so that a point's radius knows
//! nothing of what is found within it, and all radii may shrink by the same law (Knaus and Zwicker 2011).

use std::ops::Range;

use super::points::in_pieces;
use super::resources::{PhotonBuffers, SceneResources};
use super::{Round, index};
use crate::constants::{CLASSES_OF_GRID, NO_CLASS, RADIUS_CLASSES};
use crate::engine::scene::trial;
use crate::error::Result;
use crate::gpu::kernels::{Clearance, RadiusClass};
use crate::gpu::{Commands, Extent, Kernel, Module};
use crate::plan::radius::{RADIUS_RANGE, TrialPhotons};
use crate::plan::scene::{MapPlan, TESTS_PER_POINT};
use crate::plan::sensor::Sensor;
use crate::records::{CellPush, ClearancePush, RadiusClassPush};
use crate::scene::{Camera, Projection};

/// Of the 8 directions in which it is looked how much is clear around a point, all but the farthest: a corner of a room is as
/// clear as its middle, and what is nearly closed is not.
const CLEARANCE_RANK: u32 = 6;
/// One point in so many is few.
const FEW: u32 = 256;
/// Rays and tests for one point's clearance, in the plan's units.
const CLEARANCE_RAYS: u32 = 8;
const CLEARANCE_WORK: u64 = 8 * 64;

/// Kernels that find the classes.
pub(crate) fn modules() -> Vec<Module> {
    vec![Clearance::MODULE, RadiusClass::MODULE]
}

/// Bits of a class in the word of its point. Twin of `GLOBAL_CLASS` and `CAUSTIC_CLASS` in `glsl/gather/radius_class.glsl`.
pub(crate) fn map_class(map: &MapPlan) -> u32 {
    if map.caustic_only { 8 } else { 0 }
}

/// Twin of `radius_of_class` in `glsl/gather/radius_class.glsl`.
pub(crate) fn radius_of_class(widest: f64, class: u32) -> f32 {
    (widest as f32 * 0.5f32.powi(class as i32)).max(RADIUS_RANGE.0 as f32)
}

/// Finds the radii of the visible points of a round. Says of each map, the global and the caustic one, which grids its points need,
/// each by the classes that it serves.
pub(crate) fn find(commands: &mut Commands, round: Round, camera: Option<&Camera>) -> Result<[Vec<Range<u32>>; 2]> {
    let Round { resources, plan, .. } = round;
    let SceneResources { scene, visible_points, radius_classes, clearances, film, .. } = resources;
    let class_counts = &film.class_counts;
    let point_count = plan.visible_points();
    // All points of a map whose radius is given have class 0.
    let unknown = plan.maps().filter(|map| map.classes.is_some()).map(|map| NO_CLASS << map_class(map)).sum();
    commands.fill(radius_classes, 0, u64::from(point_count), unknown);
    in_pieces(commands, plan, point_count, plan.items_at_once(CLEARANCE_RAYS), CLEARANCE_WORK, |commands, first_point, end_point| {
        let push = ClearancePush { first_point, end_point, rank: CLEARANCE_RANK };
        commands.dispatch(Clearance { scene, visible_points, clearances }, &push, Extent::Items(u64::from(end_point - first_point)))
    })?;
    for map in plan.maps() {
        of_map(commands, round, map, camera)?;
    }
    let counts = commands.read(class_counts, 2 * RADIUS_CLASSES as usize)?;
    let (global, caustic) = counts.split_at(RADIUS_CLASSES as usize);
    let usual = |map: &Option<MapPlan>| map.as_ref().and_then(|map| map.classes).map_or(0, |classes| classes.usual);
    Ok([grids(global, usual(&plan.global)), grids(caustic, usual(&plan.caustic))])
}

/// That of points which all have the same radius.
pub(crate) fn one_grid() -> Vec<Range<u32>> {
    std::iter::once(0..RADIUS_CLASSES).collect()
}

/// The grids for so many points of each class: one for every few classes, but few points look their photons up in the next wider
/// grid, where there are more to pass over, rather than have another sorted for them.
fn grids(counts: &[u32], usual: u32) -> Vec<Range<u32>> {
    let few = counts.iter().sum::<u32>() / FEW;
    let mut grids: Vec<Range<u32>> = Vec::new();
    for first in (0..RADIUS_CLASSES).step_by(CLASSES_OF_GRID as usize) {
        let classes = first..first + CLASSES_OF_GRID;
        let points: u32 = classes.clone().map(|class| counts[class as usize]).sum();
        match grids.last_mut() {
            Some(wider) if points <= few && wider.start + CLASSES_OF_GRID == first => wider.end = classes.end,
            // What this round does not see has the usual radius.
            _ if points > 0 || classes.contains(&usual) => grids.push(classes),
            _ => {}
        }
    }
    grids
}

/// How far behind the picture the eye of parallel rays stands, in units of the scene.
const FAR: f64 = 16_384.0;

/// From the finest grid to the widest, each for the points that had too few photons in the one before.
fn of_map(commands: &mut Commands, round: Round, map: &MapPlan, camera: Option<&Camera>) -> Result<()> {
    let Round { resources, plan, geometry, .. } = round;
    let Some(classes) = map.classes else { return Ok(()) };
    let trial = plan.trial.as_ref().expect("classes come from a trial");
    let TrialPhotons { kept, share } = &trial.photons[usize::from(map.caustic_only)];
    commands.upload(&round.photons().map, kept)?;
    commands.fill(&round.photons().counters, 0, 1, kept.len() as u32);
    // The trial's radii, whatever the run makes of them.
    let widest = map.radius / trial.factor.unwrap_or(1.0) * classes.widest();
    let (eye, pixel_share) = match (plan.sensor, camera) {
        (Sensor::Picture { height, .. }, Some(camera)) => {
            // Parallel rays are those of an eye far behind.
            let distance = match camera.projection {
                Projection::Perspective { .. } => 0.0,
                Projection::Orthographic { .. } => FAR * geometry.unit,
            };
            let share = camera.half_height() / if distance > 0.0 { distance } else { 1.0 };
            (geometry.to_local(camera.eye - distance * camera.forward), share / f64::from(height))
        }
        _ => (glam::Vec3::ZERO, 0.0),
    };
    let first_classes: Vec<u32> = (0..classes.count).step_by(CLASSES_OF_GRID as usize).collect();
    for first_class in first_classes.into_iter().rev() {
        let cells = CellPush {
            counts_stored: 0,
            photon_capacity: kept.len() as u32,
            ..index::cells(round, map, radius_of_class(widest, first_class))
        };
        index::build(commands, round, map, &cells, None)?;
        let (points, most) = (plan.visible_points(), plan.points_at_once());
        in_pieces(commands, plan, points, most, TESTS_PER_POINT, |commands, first_point, end_point| {
            let push = RadiusClassPush {
                first_point,
                end_point,
                map_class: map_class(map),
                first_class,
                class_count: classes.count,
                usual_class: classes.usual,
                radius: widest as f32,
                wanted: trial::photons_wanted(map, *share) as f32,
                clearance_share: trial::CLEARANCE_SHARE as f32,
                eye,
                pixel_share: pixel_share as f32,
                cells,
            };
            let SceneResources { scene, visible_points, radius_classes, clearances, film, .. } = resources;
            let class_counts = &film.class_counts;
            let PhotonBuffers { cells, sorted_map, .. } = round.photons();
            let kernel = RadiusClass { scene, visible_points, cells, sorted_map, radius_classes, clearances, class_counts };
            commands.dispatch(kernel, &push, Extent::Items(u64::from(end_point - first_point)))
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_class_that_a_point_has_is_served_by_one_grid() {
        let counts = |used: &[(usize, u32)]| {
            let mut counts = vec![0; RADIUS_CLASSES as usize];
            used.iter().for_each(|(class, points)| counts[*class] = *points);
            counts
        };
        let pairs = |used, usual| grids(&counts(used), usual).into_iter().map(|grid| (grid.start, grid.end)).collect::<Vec<_>>();
        assert_eq!(pairs(&[(1, 1000)], 1), [(0, 4)]);
        assert_eq!(pairs(&[(0, 1000), (3, 3)], 0), [(0, 4)]);
        assert_eq!(pairs(&[(0, 1000), (3, 4), (4, 2), (9, 1)], 0), [(0, 2), (2, 6), (8, 12)]);
        // Points that no round has seen yet.
        assert_eq!(pairs(&[(9, 1000)], 2), [(2, 6), (8, 12)]);
        for seed in 0..1000u32 {
            let counts: Vec<u32> = (0..RADIUS_CLASSES).map(|class| if (seed >> (class % 10)) & 1 == 1 { 1 << class } else { 0 }).collect();
            let served = |class: u32| grids(&counts, 5).iter().filter(|grid| grid.contains(&class)).count();
            assert!(
                (0..RADIUS_CLASSES).all(|class| served(class) == 1 || (served(class) == 0 && counts[class as usize] == 0 && class != 5))
            );
        }
    }
}
