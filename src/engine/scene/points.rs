//! Visible points and direct light, at the start of a round.

use super::Round;
use super::film_buffers::FilmBuffers;
use super::resources::SceneResources;
use crate::constants::{DOMAIN_CAMERA, DOMAIN_RECEIVERS};
use crate::error::Result;
use crate::gpu::kernels::{CameraPaths, GoOn, Receive};
use crate::gpu::{Commands, Extent};
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::records::{CameraPathsPush, Draws, GoOnPush, ReceivePush};
use crate::rng::{mix32, words};
use crate::scene::geometry::Geometry;
use crate::scene::{Camera, Lens, Projection};
use crate::timings::Handled;

/// Records `count` items, so many that none keeps the device busy for long, and at most `most`, at a time; each is so much `work`. Hands
/// the commands over where they amount to a submission.
pub(super) fn in_pieces(
    commands: &mut Commands,
    plan: &ScenePlan,
    count: u32,
    most: u32,
    work: u64,
    mut record: impl FnMut(&mut Commands, u32, u32) -> Result<()>,
) -> Result<()> {
    let mut first = 0;
    while first < count {
        let fits = commands.paced(plan.work_per_submission) / work.max(1);
        let end = count.min(first.saturating_add(fits.max(LEAST_ITEMS).min(most.into()) as u32));
        record(commands, first, end)?;
        commands.add_work(work * u64::from(end - first));
        first = end;
        let wants_time = if first < count { commands.is_due(plan.work_per_submission) } else { commands.is_full(plan.work_per_submission) };
        if wants_time {
            commands.submit()?;
        }
    }
    Ok(())
}

/// Fewer would leave any device idle.
const LEAST_ITEMS: u64 = 16;

/// What decides in a round which fractions are rounded up (`glsl/world/scene/rounding.glsl`).
pub(super) fn rounding(plan: &ScenePlan, round: u32) -> u32 {
    let seed = words(plan.settings.seed);
    mix32(seed.x.wrapping_add(mix32(seed.y.wrapping_add(mix32(round)))))
}

/// A kernel that follows camera paths: what all of these write to, and its own buffers.
macro_rules! camera_kernel {
    ($kernel:ident, $resources:ident, $($own:ident: $buffer:expr),*) => {{
        let SceneResources { scene, visible_points, rough_lobes, rough_covers, pass_sums, film, nonfinite_values, .. } = $resources;
        let FilmBuffers { single_hits, part_totals, anomalies, .. } = film;
        let camera_path_counts = &$resources.camera_path_counts;
        $kernel {
            scene, visible_points, rough_lobes, rough_covers, pass_sums, single_hits, part_totals, anomalies, nonfinite_values,
            camera_path_counts, $($own: $buffer),*
        }
    }};
}

/// Finds the visible points of a round and writes the light that needs no photons.
pub(crate) fn see(commands: &mut Commands, round: Round, camera: Option<&Camera>) -> Result<()> {
    let Round { resources, geometry, plan, number: round } = round;
    let SceneResources { camera_paths: [camera_paths, _], camera_path_counts, .. } = resources;
    let goes_on = plan.chains_go_on();
    let emitter_count = geometry.emitters.len() as u32;
    let draws = |domain| Draws { seed: words(plan.settings.seed), round, domain };
    let record = |commands: &mut Commands, first: u32, end: u32| {
        commands.count(Handled { bytes: u64::from(end - first) * plan.bytes_of_path(), ..Handled::default() });
        if goes_on {
            commands.fill(camera_path_counts, 0, 1, 0);
        }
        match plan.sensor {
            Sensor::Picture { width, height } => {
                let camera = camera.expect("a picture has a camera");
                // Parallel rays start where they cross the picture: normalised lengths.
                let is_orthographic = matches!(camera.projection, Projection::Orthographic { .. });
                let half_height = camera.half_height() / if is_orthographic { geometry.unit } else { 1.0 };
                let lens = camera.lens.unwrap_or(Lens { radius: 0.0, focus: 1.0 });
                let half_width = half_height * f64::from(width) / f64::from(height);
                let push = CameraPathsPush {
                    draws: draws(DOMAIN_CAMERA),
                    work: plan.work(),
                    rounding: rounding(plan, round),
                    width,
                    height,
                    first_path: first,
                    end_path: end,
                    eye: geometry.to_local(camera.eye),
                    forward: camera.forward.as_vec3(),
                    right: (half_width * camera.right).as_vec3(),
                    up: (half_height * camera.up).as_vec3(),
                    is_orthographic: u32::from(is_orthographic),
                    lens_radius: (lens.radius / geometry.unit) as f32,
                    focus: (lens.focus / geometry.unit) as f32,
                    emitter_count,
                    footprint: plan.footprint as f32,
                    film_scale: plan.film.scale as f32,
                    film_limit: plan.film.limit as f32,
                };
                let kernel =
                    camera_kernel!(CameraPaths, resources, next_camera_paths: camera_paths, extra_samples: &resources.extra_samples);
                commands.dispatch(kernel, &push, Extent::Items(u64::from(end - first)))?;
            }
            Sensor::Receivers { .. } => {
                let receivers = &resources.receivers[round as usize % resources.receivers.len()];
                let radius = plan.maps().map(|map| plan.radius(map, round)).fold(f64::INFINITY, f64::min);
                let push = ReceivePush {
                    draws: draws(DOMAIN_RECEIVERS),
                    work: plan.work(),
                    rounding: rounding(plan, round),
                    first_point: first,
                    end_point: end,
                    point_count: plan.sensor.pixels(),
                    emitter_count,
                    film_scale: plan.film.scale as f32,
                    film_limit: plan.film.limit as f32,
                    radius: if radius.is_finite() { radius as f32 } else { 1.0 / 1024.0 },
                };
                let kernel = camera_kernel!(Receive, resources, receivers: receivers, next_camera_paths: camera_paths);
                commands.dispatch(kernel, &push, Extent::Items(u64::from(end - first)))?;
            }
        }
        if goes_on {
            go_on(commands, resources, geometry, plan, round)?;
        }
        Ok(())
    };
    let work = 64 * u64::from(plan.rays_per_path());
    in_pieces(commands, plan, plan.paths(), plan.camera_paths_at_once(), work, record)
}

/// Follows camera paths that are still under way over mirrors and glass, until none is left.
fn go_on(commands: &mut Commands, resources: &SceneResources, geometry: &Geometry, plan: &ScenePlan, round: u32) -> Result<()> {
    let camera_path_counts = &resources.camera_path_counts;
    let domain = if matches!(plan.sensor, Sensor::Picture { .. }) { DOMAIN_CAMERA } else { DOMAIN_RECEIVERS };
    for parity in [0, 1].into_iter().cycle() {
        let path_count = commands.read(camera_path_counts, 1)?[0];
        if path_count == 0 {
            break;
        }
        commands.fill(camera_path_counts, 0, 1, 0);
        let push = GoOnPush {
            draws: Draws { seed: words(plan.settings.seed), round, domain },
            work: plan.work(),
            most_samples: plan.film.samples,
            path_count,
            pixel_count: plan.sensor.pixels(),
            emitter_count: geometry.emitters.len() as u32,
            film_scale: plan.film.scale as f32,
            film_limit: plan.film.limit as f32,
            rounding: rounding(plan, round),
        };
        let kernel = camera_kernel!(GoOn, resources, camera_paths: &resources.camera_paths[parity], next_camera_paths: &resources.camera_paths[1 - parity]);
        commands.dispatch(kernel, &push, Extent::Items(u64::from(path_count)))?;
    }
    Ok(())
}
