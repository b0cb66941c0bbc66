//! Density estimates from the maps at the visible points, and the film at the end of a round.

use std::ops::Range;

use super::Round;
use super::film_buffers::FilmBuffers;
use super::points::{in_pieces, rounding};
use super::radius_class::map_class;
use super::resources::{PhotonBuffers, SceneResources};
use crate::constants::MAX_GROUPS;
use crate::error::Result;
use crate::gpu::kernels::{
    DensePointsSize, DiscCuts, EndDifference, FluxToRadiance, GatherVisiblePointsTwoWords, GatherVisiblePointsU64, Resolve,
};
use crate::gpu::{Commands, Extent, dispatch_by_sums};
use crate::plan::differences::row_length;
use crate::plan::scene::MapPlan;
use crate::records::{CellPush, DensePointsSizePush, DiscCutsPush, EndDifferencePush, FluxToRadiancePush, ResolvePush, SceneGatherPush};
use crate::timings::Handled;

/// Finds the walls at which each visible point's density estimates from a map end.
pub(crate) fn cut_discs(commands: &mut Commands, round: Round, map: &MapPlan) -> Result<()> {
    let Round { resources, plan, .. } = round;
    let SceneResources { scene, visible_points, radius_classes, disc_cuts, .. } = resources;
    let (width, height) = plan.sensor.size();
    in_pieces(commands, plan, plan.visible_points(), plan.items_at_once(4), 256, |commands, first_point, end_point| {
        let push = DiscCutsPush {
            work: plan.work(),
            first_point,
            end_point,
            pixel_count: plan.sensor.pixels(),
            width,
            height,
            arrivals: map.stored,
            map_class: map_class(map),
            first_cut: plan.first_cut(map.caustic_only),
            radius: plan.widest_radius(map, round.number) as f32,
        };
        let kernel = DiscCuts { scene, visible_points, radius_classes, disc_cuts };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(end_point - first_point)))
    })
}

/// Adds a chunk of a map to the estimates of all visible points whose class this grid serves, all where radii have no classes.
pub(crate) fn gather(commands: &mut Commands, round: Round, map: &MapPlan, classes: Range<u32>, cells_push: CellPush) -> Result<()> {
    let PhotonBuffers { cells, sorted_map, dense_points, dispatch_args, .. } = round.photons();
    let Round { resources, plan, number: round, .. } = round;
    let SceneResources { scene, visible_points, rough_lobes, rough_covers, estimates, near_sums, .. } = resources;
    let SceneResources { radius_classes, disc_cuts, nonfinite_values, .. } = resources;
    let point_count = plan.visible_points();
    let lanes = map.lanes;
    let (width, height) = plan.sensor.size();
    let dispatch = |commands: &mut Commands, push: &SceneGatherPush, extent: Extent| {
        dispatch_by_sums!(
            commands,
            commands.facts().int64_atomics,
            [GatherVisiblePointsU64, GatherVisiblePointsTwoWords] {
                scene, visible_points, rough_lobes, rough_covers, film: estimates, near_sums, cells, sorted_map, dense_points,
                radius_classes, disc_cuts, nonfinite_values,
            },
            push,
            extent
        )
    };
    in_pieces(commands, plan, point_count, plan.points_at_once(), map.tests_per_point(), |commands, first_point, end_point| {
        let push = SceneGatherPush {
            work: plan.work(),
            first_point,
            end_point,
            point_count,
            pixel_count: plan.sensor.pixels(),
            arrival: map.stored.trailing_zeros(),
            round,
            rounding: rounding(plan, round),
            width,
            height,
            first_slice: 0,
            lanes,
            radius: plan.widest_radius(map, round) as f32,
            map_class: map_class(map),
            first_class: classes.start,
            end_class: classes.end,
            first_cut: plan.first_cut(map.caustic_only),
            cells: cells_push,
        };
        commands.fill(dense_points, 0, 2, 0);
        let groups = ((end_point - first_point) * lanes).div_ceil(plan.settings.group_size);
        dispatch(commands, &push, Extent::Groups(groups, 1))?;
        let size = DensePointsSizePush { items_per_group: plan.settings.group_size / lanes, max_groups: MAX_GROUPS };
        commands.dispatch(DensePointsSize { dense_points, dispatch_args }, &size, Extent::Groups(1, 1))?;
        dispatch(commands, &SceneGatherPush { first_slice: 1, ..push }, Extent::Indirect(dispatch_args))
    })
}

/// Turns what the maps found at all visible points into light; so many photons of the global and of the caustic map were traced.
pub(crate) fn flux_to_radiance(commands: &mut Commands, round: Round, traced: [u32; 2]) -> Result<()> {
    let Round { resources, geometry, plan, .. } = round;
    let SceneResources {
        scene,
        visible_points,
        estimates,
        near_sums,
        radius_classes,
        disc_cuts,
        nonfinite_values,
        extra_samples,
        film,
        ..
    } = resources;
    let FilmBuffers { differences, single_hits, part_totals, anomalies, .. } = film;
    let radius = |map: &Option<MapPlan>| map.as_ref().map_or(1.0, |map| plan.widest_radius(map, round.number)) as f32;
    let flux =
        |map: &Option<MapPlan>| map.as_ref().map_or(0.0, |map| map.photon_flux_of(geometry, traced[usize::from(map.caustic_only)])) as f32;
    let (width, height) = plan.sensor.size();
    in_pieces(commands, plan, plan.visible_points(), plan.items_at_once(4), 256, |commands, first_point, end_point| {
        let push = FluxToRadiancePush {
            work: plan.work(),
            first_point,
            end_point,
            point_count: plan.visible_points(),
            pixel_count: plan.sensor.pixels(),
            width,
            height,
            arrivals: plan.arrivals,
            round: round.number,
            rounding: rounding(plan, round.number),
            film_scale: plan.film.scale as f32,
            film_limit: plan.film.point_limit as f32,
            global_radius: radius(&plan.global),
            caustic_radius: radius(&plan.caustic),
            first_caustic_cut: plan.first_cut(true),
            global_flux: flux(&plan.global),
            caustic_flux: flux(&plan.caustic),
        };
        commands.count(Handled { bytes: u64::from(end_point - first_point) * plan.bytes_of_point(), ..Handled::default() });
        let kernel = FluxToRadiance {
            scene,
            anomalies,
            visible_points,
            estimates,
            near_sums,
            differences,
            radius_classes,
            disc_cuts,
            single_hits,
            part_totals,
            nonfinite_values,
            extra_samples,
        };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(end_point - first_point)))
    })
}

/// Ends a round: light that was found joins its block, and at the end of that the film.
pub(crate) fn resolve(commands: &mut Commands, round: Round, ends_block: bool) -> Result<()> {
    let Round { resources, plan, .. } = round;
    let SceneResources { extra_samples, pass_sums, estimates, film, .. } = resources;
    let FilmBuffers { sums_of_block, film_sums, film_squares, part_totals, part_sums, latest_blocks, .. } = film;
    let FilmBuffers { surface_sums_of_block, surface_sums, surface_squares, .. } = film;
    let pixel_count = plan.sensor.pixels();
    let points_per_path = if resources.photons.is_some() { plan.points_per_path } else { 0 };
    let block = round.number / plan.film.rounds_per_block;
    let work = u64::from(plan.film.samples * (1 + points_per_path));
    in_pieces(commands, plan, pixel_count, plan.items_at_once(1), work, |commands, first_pixel, end_pixel| {
        let push = ResolvePush {
            work: plan.work(),
            first_pixel,
            end_pixel,
            pixel_count,
            points_per_path,
            counts_paths: u32::from(plan.light_of.has_paths()),
            block,
            ends_block: u32::from(ends_block),
        };
        commands.count(Handled { bytes: u64::from(end_pixel - first_pixel) * plan.bytes_of_pixel(), ..Handled::default() });
        let kernel = Resolve {
            extra_samples,
            pass_sums,
            estimates,
            sums_of_block,
            film_sums,
            film_squares,
            surface_sums_of_block,
            surface_sums,
            surface_squares,
            part_totals,
            part_sums,
            latest_blocks,
        };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(end_pixel - first_pixel)))
    })
}

/// Ends a block: what a smaller radius would change in it joins the sums of all blocks.
pub(crate) fn end_difference(commands: &mut Commands, round: Round) -> Result<()> {
    let Round { resources, plan, .. } = round;
    let (row_length, block) = (row_length(plan.sensor.pixels() as usize) as u32, round.number / plan.film.rounds_per_block);
    let kernel = EndDifference { differences: &resources.film.differences };
    commands.dispatch(kernel, &EndDifferencePush { row_length, block }, Extent::Items(u64::from(row_length)))
}
