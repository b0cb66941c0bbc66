//! Visible points and direct light at the start of a round, density estimates from the maps, and the film at its end.

use super::Round;
use super::resources::{PhotonBuffers, SceneResources};
use crate::constants::{DOMAIN_CAMERA, DOMAIN_RECEIVERS, MAX_GROUPS};
use crate::error::Result;
use crate::gpu::kernels::{CrowdSize, FluxToRadiance, GatherVisiblePointsTwoWords, GatherVisiblePointsU64, GoOn, Receive, Resolve, View};
use crate::gpu::{Commands, Extent};
use crate::plan::scene::{MapPlan, ScenePlan, TESTS_PER_POINT};
use crate::plan::sensor::Sensor;
use crate::records::{CellPush, CrowdSizePush, Draws, FluxToRadiancePush, GoOnPush, ReceivePush, ResolvePush, SceneGatherPush, ViewPush};
use crate::rng::{mix32, words};
use crate::scene::Camera;
use crate::scene::geometry::Geometry;

/// Runs of `count` items, `step` long.
fn runs(count: u32, step: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..count).step_by(step as usize).map(move |first| (first, count.min(first.saturating_add(step))))
}

/// Hands the commands over once they amount to a submission.
fn add_work(commands: &mut Commands, plan: &ScenePlan, work: u64) -> Result<()> {
    commands.add_work(work);
    if commands.work() >= commands.paced(plan.work_per_submission) { commands.submit() } else { Ok(()) }
}

/// What decides in a round which fractions are rounded up (`glsl/world/scene/rounding.glsl`).
fn rounding(plan: &ScenePlan, round: u32) -> u32 {
    let seed = words(plan.settings.seed);
    mix32(seed.x.wrapping_add(mix32(seed.y.wrapping_add(mix32(round)))))
}

/// Finds the visible points of a round and writes the light that needs no photons.
pub fn see(commands: &mut Commands, round: Round, camera: Option<&Camera>) -> Result<()> {
    let Round { resources, geometry, plan, number: round } = round;
    let SceneResources { scene, visible_points, pass_sums, one_hits, part_totals, anomalies, nonfinite_values, .. } = resources;
    let SceneResources { camera_paths: [camera_paths, _], camera_path_counts, .. } = resources;
    let step = plan.pixels_at_once(plan.rays_per_pixel());
    let goes_on = plan.chains_go_on();
    let emitter_count = geometry.emitters.len() as u32;
    let draws = |domain| Draws { seed: words(plan.settings.seed), round, domain };
    for (first, end) in runs(plan.sensor.pixels(), step) {
        if goes_on {
            commands.fill(camera_path_counts, 0, 1, 0);
        }
        match plan.sensor {
            Sensor::Picture { width, height } => {
                let camera = camera.expect("a picture has a camera");
                let half_height = (0.5 * camera.vertical_view).tan();
                let half_width = half_height * f64::from(width) / f64::from(height);
                let push = ViewPush {
                    draws: draws(DOMAIN_CAMERA),
                    rounding: rounding(plan, round),
                    width,
                    height,
                    first_pixel: first,
                    end_pixel: end,
                    eye: geometry.to_local(camera.eye),
                    forward: camera.forward.as_vec3(),
                    right: (half_width * camera.right).as_vec3(),
                    up: (half_height * camera.up).as_vec3(),
                    emitter_count,
                    // Each sample has its share of the pixel's light; exact, as their number is a power of two.
                    film_scale: (plan.film_scale / f64::from(plan.samples())) as f32,
                    film_limit: (plan.film_limit / f64::from(plan.samples())) as f32,
                };
                let kernel = View {
                    scene,
                    anomalies,
                    visible_points,
                    pass_sums,
                    one_hits,
                    part_totals,
                    next_camera_paths: camera_paths,
                    camera_path_counts,
                    nonfinite_values,
                };
                commands.dispatch(kernel, &push, Extent::Items(u64::from(end - first) * u64::from(plan.samples())))?;
            }
            Sensor::Receivers { .. } => {
                let receivers = &resources.receivers[round as usize % resources.receivers.len()];
                let radius = plan.maps().map(|map| plan.radius(map, round)).fold(f64::INFINITY, f64::min);
                let push = ReceivePush {
                    draws: draws(DOMAIN_RECEIVERS),
                    rounding: rounding(plan, round),
                    first_point: first,
                    end_point: end,
                    point_count: plan.sensor.pixels(),
                    emitter_count,
                    film_scale: plan.film_scale as f32,
                    film_limit: plan.film_limit as f32,
                    radius: if radius.is_finite() { radius as f32 } else { 1.0 / 1024.0 },
                };
                let kernel = Receive {
                    scene,
                    receivers,
                    anomalies,
                    visible_points,
                    pass_sums,
                    one_hits,
                    part_totals,
                    next_camera_paths: camera_paths,
                    camera_path_counts,
                    nonfinite_values,
                };
                commands.dispatch(kernel, &push, Extent::Items(u64::from(end - first)))?;
            }
        }
        if goes_on {
            go_on(commands, resources, geometry, plan, round)?;
        }
        add_work(commands, plan, 64 * u64::from(end - first) * u64::from(plan.rays_per_pixel()))?;
    }
    Ok(())
}

/// Follows camera paths that are still under way over mirrors and glass, until none is left.
fn go_on(commands: &mut Commands, resources: &SceneResources, geometry: &Geometry, plan: &ScenePlan, round: u32) -> Result<()> {
    let SceneResources { scene, visible_points, pass_sums, one_hits, part_totals, anomalies, nonfinite_values, camera_path_counts, .. } =
        resources;
    let domain = if matches!(plan.sensor, Sensor::Picture { .. }) { DOMAIN_CAMERA } else { DOMAIN_RECEIVERS };
    for parity in [0, 1].into_iter().cycle() {
        let path_count = commands.read(camera_path_counts, 1)?[0];
        if path_count == 0 {
            break;
        }
        commands.fill(camera_path_counts, 0, 1, 0);
        let push = GoOnPush {
            draws: Draws { seed: words(plan.settings.seed), round, domain },
            path_count,
            pixel_count: plan.sensor.pixels(),
            emitter_count: geometry.emitters.len() as u32,
            film_scale: (plan.film_scale / f64::from(plan.samples())) as f32,
            film_limit: (plan.film_limit / f64::from(plan.samples())) as f32,
            rounding: rounding(plan, round),
        };
        let kernel = GoOn {
            scene,
            anomalies,
            visible_points,
            pass_sums,
            one_hits,
            part_totals,
            camera_paths: &resources.camera_paths[parity],
            next_camera_paths: &resources.camera_paths[1 - parity],
            camera_path_counts,
            nonfinite_values,
        };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(path_count)))?;
    }
    Ok(())
}

/// Adds a chunk of a map to the estimates of all visible points.
pub fn gather(commands: &mut Commands, round: Round, photons: &PhotonBuffers, map: &MapPlan, cells_push: CellPush) -> Result<()> {
    let Round { resources, plan, number: round, .. } = round;
    let PhotonBuffers { cells, sorted_map, crowded, dispatch_args, .. } = photons;
    let SceneResources { scene, visible_points, estimates, nonfinite_values, .. } = resources;
    let point_count = plan.visible_points();
    let (lanes, step) = (map.lanes, plan.points_at_once());
    let (width, height) = plan.sensor.size();
    let dispatch = |commands: &mut Commands, push: &SceneGatherPush, extent: Extent| {
        if commands.facts().int64_atomics {
            commands.dispatch(
                GatherVisiblePointsU64 { scene, visible_points, film: estimates, cells, sorted_map, crowded, nonfinite_values },
                push,
                extent,
            )
        } else {
            commands.dispatch(
                GatherVisiblePointsTwoWords { scene, visible_points, film: estimates, cells, sorted_map, crowded, nonfinite_values },
                push,
                extent,
            )
        }
    };
    for (first_point, end_point) in runs(point_count, step) {
        let push = SceneGatherPush {
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
            radius: plan.radius(map, round) as f32,
            cells: cells_push,
        };
        commands.fill(crowded, 0, 2, 0);
        let groups = ((end_point - first_point) * lanes).div_ceil(plan.settings.group_size);
        dispatch(commands, &push, Extent::Groups(groups, 1))?;
        let size = CrowdSizePush { items_per_group: plan.settings.group_size / lanes, max_groups: MAX_GROUPS };
        commands.dispatch(CrowdSize { crowded, dispatch_args }, &size, Extent::Groups(1, 1))?;
        dispatch(commands, &SceneGatherPush { first_slice: 1, ..push }, Extent::Indirect(dispatch_args))?;
        add_work(commands, plan, TESTS_PER_POINT * u64::from(end_point - first_point))?;
    }
    Ok(())
}

/// Turns what the maps found at all visible points into light; so many photons of the global and of the caustic map were traced.
pub fn flux_to_radiance(commands: &mut Commands, round: Round, traced: [u32; 2]) -> Result<()> {
    let Round { resources, geometry, plan, number: round } = round;
    let SceneResources { scene, visible_points, estimates, one_hits, part_totals, anomalies, nonfinite_values, .. } = resources;
    let radius = |map: &Option<MapPlan>| map.as_ref().map_or(1.0, |map| plan.radius(map, round)) as f32;
    let flux =
        |map: &Option<MapPlan>| map.as_ref().map_or(0.0, |map| map.photon_flux_of(geometry, traced[usize::from(map.caustic_only)])) as f32;
    let (width, height) = plan.sensor.size();
    for (first_point, end_point) in runs(plan.visible_points(), plan.pixels_at_once(4)) {
        let push = FluxToRadiancePush {
            first_point,
            end_point,
            point_count: plan.visible_points(),
            pixel_count: plan.sensor.pixels(),
            width,
            height,
            arrivals: plan.arrivals,
            round,
            rounding: rounding(plan, round),
            film_scale: plan.film_scale as f32,
            film_limit: plan.point_limit() as f32,
            global_radius: radius(&plan.global),
            caustic_radius: radius(&plan.caustic),
            global_flux: flux(&plan.global),
            caustic_flux: flux(&plan.caustic),
        };
        let kernel = FluxToRadiance { scene, anomalies, visible_points, estimates, one_hits, part_totals, nonfinite_values };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(end_point - first_point)))?;
        add_work(commands, plan, 256 * u64::from(end_point - first_point))?;
    }
    Ok(())
}

/// Ends a round: light that was found goes to the film.
pub fn resolve(commands: &mut Commands, round: Round) -> Result<()> {
    let Round { resources, plan, .. } = round;
    let SceneResources { pass_sums, estimates, film_sums, film_squares, .. } = resources;
    let pixel_count = plan.sensor.pixels();
    let points_per_pixel = if resources.photons.is_some() { plan.points_per_pixel } else { 0 };
    for (first_pixel, end_pixel) in runs(pixel_count, plan.pixels_at_once(1)) {
        let push = ResolvePush { first_pixel, end_pixel, pixel_count, points_per_pixel };
        let kernel = Resolve { pass_sums, estimates, film_sums, film_squares };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(end_pixel - first_pixel)))?;
        add_work(commands, plan, u64::from(end_pixel - first_pixel) * u64::from(plan.samples() + points_per_pixel))?;
    }
    Ok(())
}
