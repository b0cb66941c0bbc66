//! A trial round, from which the default radii are taken: the density of photons around the points that are asked about,
//! and how far it is from these to the next wall. Where there are several lamps, it first learns how to choose among them
//! (`engine::scene::light_trial`), for shadow rays and photons.
//!
//! A radius by the scene's area is right where photons lie everywhere alike. Of a room on a plain it would be wider than the
//! room. So a few photons are traced, with random numbers that no run has, and each of a few points is given the radius
//! within which a round of the run will leave as many photons as `--neighbours` says, and of the caustic map as `--caustic-neighbours` does. The median is taken, in steps of a fourth root of 2:
//! an integer, so that nothing but these photons and points decides; but no more than the radius by the area. It depends on no
//! seed, builder or split.

use std::sync::Arc;
use std::time::Instant;

use glam::Vec4;
use rayon::prelude::*;

use super::resources::SceneResources;
use super::{Round, Viewpoint, constants, light_trial, modules, points, trace, trial_rays};
use crate::engine;
use crate::engine::error::bias_batches;
use crate::error::Result;
use crate::gpu::kernels::{Clearance, TrialRays};
use crate::gpu::{Commands, Extent, Gpu, Kernel, Memory};
use crate::photon::MapPhoton;
use crate::plan::Limits;
use crate::plan::light_choice::LightChoice;
use crate::plan::radius::{RadiusFrom, Trial, TrialPhotons, TrialRadius, area_radius};
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::plan::sensor::Sensor;
use crate::records::{ClearancePush, Receiver, VisiblePoint};
use crate::scene::light_tree::{self, LightTree};
use crate::scene::openings::openings;
use crate::scene::{Camera, Scene};
use crate::settings::scene::{Part, SceneSettings};
use crate::settings::stop::Stop;

/// Photons of each map.
const PHOTONS: u32 = 1 << 14;
/// Points at most.
const POINTS: u32 = 1 << 10;
/// Nearest photons whose distance gives the density at a point.
const NEAREST: usize = 8;
/// Steps of a radius in a factor of 2.
const STEPS: f64 = 4.0;
/// Of the clearance of points: a radius that is no larger reaches round few corners.
pub(super) const CLEARANCE_SHARE: f64 = 0.25;
/// Of 8 directions from a point.
const MEDIAN: u32 = 4;
/// Over the radius by the scene's area: points with so few photons about them are not reached by this map's light.
const REACH: f64 = 4.0;
const SEED: u64 = 0x7472_6961;

/// Photons of the trial, of which this share was kept, within the radius that holds as many of a round of the run as wanted.
pub(super) fn photons_wanted(map: &MapPlan, share: f64) -> f64 {
    share * map.neighbours * f64::from(PHOTONS) / f64::from(map.photons)
}

/// The plan of a run, its default radii and its choice of lights by a trial round.
pub(crate) fn plan(gpu: &Gpu, scene: &Scene, viewpoint: &Viewpoint, settings: &SceneSettings, sensor: Sensor) -> Result<ScenePlan> {
    let limits = engine::limits(gpu.facts());
    let trial = find(gpu, scene, viewpoint, settings, sensor)?;
    ScenePlan::with_trial(scene, viewpoint.geometry, settings, sensor, &limits, trial)
}

/// What a trial finds, where one is needed. The run itself need not fit on the device.
pub(crate) fn find(gpu: &Gpu, scene: &Scene, viewpoint: &Viewpoint, settings: &SceneSettings, sensor: Sensor) -> Result<Option<Trial>> {
    let limits = engine::limits(gpu.facts());
    let boundless = Limits { buffer_bytes: u64::MAX, memory_bytes: u64::MAX, ..limits };
    let plan = ScenePlan::new(scene, viewpoint.geometry, settings, sensor, &boundless)?;
    // Whatever part of the picture is asked for, so that all parts have the same photons.
    let chooses_lights = !light_tree::is_one_lamp(viewpoint.geometry);
    if plan.maps().all(|map| map.radius_from == RadiusFrom::User) && !chooses_lights && plan.openings().is_empty() {
        return Ok(None);
    }
    let lights = chooses_lights.then(|| LightTree::new(viewpoint.geometry));
    run(gpu, scene, viewpoint, &plan, lights, &limits).map(Some)
}

fn run(gpu: &Gpu, scene: &Scene, viewpoint: &Viewpoint, run: &ScenePlan, lights: Option<LightTree>, limits: &Limits) -> Result<Trial> {
    let settings = settings_of_trial(&run.settings);
    // Parts of a picture have the points of the whole.
    let points_per_path = match run.settings.part {
        Part::All => run.points_per_path,
        _ => ScenePlan::new(scene, viewpoint.geometry, &settings, run.sensor, limits)?.points_per_path,
    };
    let (sensor, phases) = few_points(viewpoint, run.sensor, POINTS / points_per_path);
    let by_power = lights
        .clone()
        .map(|lights| Trial { lights: Some(Arc::new(LightChoice::by_power(viewpoint.geometry, lights))), ..Trial::default() });
    let plan = ScenePlan::with_trial(scene, viewpoint.geometry, &settings, sensor, limits, by_power)?;

    let casts_rays = lights.is_some() || !plan.openings().is_empty();
    let rays_of_trial = if casts_rays { vec![TrialRays::MODULE] } else { Vec::new() };
    // All pipelines of the run, which they are made for, but where it shows a part alone.
    gpu.prepare(
        &[modules(&plan, gpu.facts()), vec![Clearance::MODULE], light_trial::modules(&plan), rays_of_trial].concat(),
        &constants(&plan),
    )?;
    let began = Instant::now();
    let mut commands = Commands::new(gpu, constants(&plan), began)?;
    let resources = SceneResources::new(&mut commands, viewpoint.geometry, &plan, &phases)?;
    let round = Round { resources: &resources, geometry: viewpoint.geometry, plan: &plan, number: 0 };
    let seen = see(&mut commands, round, viewpoint.camera)?;

    let mut trial = Trial::default();
    let points = light_trial::points(&phases, &seen.points, &viewpoint.geometry.planes);
    let rays = if casts_rays { trial_rays::cast(&mut commands, round, &points)? } else { Vec::new() };
    if !plan.openings().is_empty() {
        trial.openings = openings(&rays);
        // The scene's from here on.
        if !trial.openings.is_empty() {
            commands.upload(&resources.scene.openings, &trial.openings)?;
        }
    }
    if let Some(lights) = lights {
        let lights = light_trial::learn(&mut commands, round, lights, &points, &rays)?;
        commands.upload(&resources.scene.emitters, &lights.emitters)?;
        trial.lights = Some(Arc::new(lights));
    }
    find_radii(&mut commands, round, run, &seen, &mut trial)?;
    gpu.check_validation()?;
    trial.seconds = began.elapsed().as_secs_f64();
    Ok(trial)
}

fn settings_of_trial(of_run: &SceneSettings) -> SceneSettings {
    SceneSettings {
        photons: PHOTONS,
        caustic_photons: PHOTONS,
        rounds: 1,
        seed: bias_batches::seed(SEED, 0),
        // Radii and lights are those of places, whatever the paths there.
        samples: 1,
        tiles: None,
        // Parts of a picture have the radii and lights of the whole, so that they add up to it.
        part: Part::All,
        stop: Stop::default(),
        ..of_run.clone()
    }
}

/// What sees at most so many points of those that a run asks about, evenly spread: a smaller picture, or some of the receivers.
pub(super) fn few_points(viewpoint: &Viewpoint, sensor: Sensor, most: u32) -> (Sensor, Vec<Vec<Receiver>>) {
    match sensor {
        Sensor::Picture { width, height } => {
            let smaller = (f64::from(most) / (f64::from(width) * f64::from(height))).sqrt().min(1.0);
            let length = |length: u32| ((f64::from(length) * smaller) as u32).max(1);
            (Sensor::Picture { width: length(width), height: length(height) }, Vec::new())
        }
        Sensor::Receivers { .. } => {
            let all = &viewpoint.phases[0];
            let some: Vec<_> = all.iter().step_by(all.len().div_ceil(most as usize)).copied().collect();
            (Sensor::Receivers { count: some.len() as u32 }, vec![some])
        }
    }
}

/// The points of a trial, and how far it is from each to the next wall.
struct Seen {
    points: Vec<VisiblePoint>,
    clearances: Vec<f32>,
}

fn see(commands: &mut Commands, round: Round, camera: Option<&Camera>) -> Result<Seen> {
    points::see(commands, round, camera)?;
    let count = round.plan.visible_points();
    let clearances = commands.gpu().buffer::<f32>("clearances", u64::from(count), Memory::Device)?;
    let SceneResources { scene, visible_points, .. } = round.resources;
    let kernel = Clearance { scene, visible_points, clearances: &clearances };
    commands.dispatch(kernel, &ClearancePush { first_point: 0, end_point: count, rank: MEDIAN }, Extent::Items(u64::from(count)))?;
    Ok(Seen { points: commands.read(visible_points, count as usize)?, clearances: commands.read(&clearances, count as usize)? })
}

/// Traces photons of each map of the run whose radius is not given, and finds the radius at the points that look that map up.
fn find_radii(commands: &mut Commands, round: Round, run: &ScenePlan, seen: &Seen, trial: &mut Trial) -> Result<()> {
    let planes = &round.geometry.planes;
    let mut largest = 0.0;
    for of_run in run.maps() {
        let which = usize::from(of_run.caustic_only);
        let Some(map) = round.plan.maps().find(|map| map.caustic_only == of_run.caustic_only) else { continue };
        let (asked, clear): (Vec<&VisiblePoint>, Vec<f64>) = seen
            .points
            .iter()
            .zip(&seen.clearances)
            .filter(|(point, _)| point.arrivals & map.stored != 0)
            .map(|(point, clear)| (point, f64::from(*clear)))
            .unzip();
        trial.points = trial.points.max(asked.len() as u32);
        if of_run.radius_from == RadiusFrom::User || asked.is_empty() {
            continue;
        }
        let found = trace::stored(commands, round, map)?;
        let own: Vec<f64> = asked.par_iter().map(|point| own_radius(point, &found, planes, of_run.photons, of_run.neighbours)).collect();
        let neighbours = if map.caustic_only { run.settings.caustic_neighbours } else { run.settings.neighbours };
        let reach = reach(&own, &clear, area_radius(round.geometry, of_run.photons, neighbours, map.caustic_only));
        let radius = reach.radius();
        *(if map.caustic_only { &mut trial.caustic_radius } else { &mut trial.global_radius }) = Some(radius);
        trial.reach[which] = reach;
        trial.photons[which] = TrialPhotons::some_of(found);
        if radius > largest {
            largest = radius;
            trial.too_wide = clear.iter().filter(|clear| **clear < radius).count() as f64 / clear.len() as f64;
        }
    }
    Ok(())
}

/// The radius around a point within which a round of so many photons is to leave `wanted`; infinite where too few photons are
/// about to show.
fn own_radius(point: &VisiblePoint, photons: &[MapPhoton], planes: &[Vec4], photons_of_run: u32, wanted: f64) -> f64 {
    // Squared distances, ascending.
    let mut nearest = [f32::INFINITY; NEAREST];
    for photon in photons {
        let squared = photon.position.distance_squared(point.position);
        if squared < nearest[NEAREST - 1] && belongs(point, photon.plane, planes, squared.sqrt()) {
            let place = nearest.partition_point(|other| *other <= squared);
            nearest[place..].rotate_right(1);
            nearest[place] = squared;
        }
    }
    // The disc up to the k-th of some points at random holds k - 1/3 in the median.
    let of_trial = (NEAREST as f64 - 1.0 / 3.0) * f64::from(photons_of_run) / f64::from(PHOTONS);
    (f64::from(nearest[NEAREST - 1]) * wanted / of_trial).sqrt()
}

/// Whether a photon counts at a point. Twin of `belongs` in `glsl/gather/belongs.glsl`.
fn belongs(point: &VisiblePoint, plane: u32, planes: &[Vec4], radius: f32) -> bool {
    let normal = |plane: u32| planes[plane as usize / 2].truncate() * if plane.is_multiple_of(2) { 1.0 } else { -1.0 };
    let (own, other) = (normal(point.plane), normal(plane));
    let height = planes[plane as usize / 2].dot(point.position.extend(1.0));
    plane == point.plane || (own.dot(other) >= 0.75 && height.abs() <= radius * own.cross(other).length() + 1.0 / 4_194_304.0)
}

/// The radius for all points, from those that each would have for itself and from their clearances.
fn reach(own: &[f64], clear: &[f64], by_area: f64) -> TrialRadius {
    let median = |values: Vec<f64>| {
        let mut steps: Vec<i32> = values.into_iter().map(|value| (STEPS * value.log2()).round().clamp(-1e6, 1e6) as i32).collect();
        steps.sort_unstable();
        steps.get(steps.len() / 2).map(|steps| f64::from(*steps))
    };
    let reached = median(own.iter().copied().filter(|radius| *radius <= REACH * by_area).collect());
    // Where no photon came near, the scene's area is all that is known.
    let steps = reached.unwrap_or((STEPS * by_area.log2()).round());
    let room = median(clear.iter().map(|clear| CLEARANCE_SHARE * clear).collect()).unwrap_or(f64::INFINITY);
    // The median point of a caustic lies at its faint rim: what is wider than by the area is wider than need be.
    TrialRadius { wanted: (steps / STEPS).exp2().min(by_area), widest: (room / STEPS).exp2() }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn radii_are_medians_in_steps_and_no_wider_than_the_room() {
        let radius = |own: &[f64], clear: &[f64], by_area: f64| reach(own, clear, by_area).radius();
        let step = |k: i32| (f64::from(k) / STEPS).exp2();
        let (near, far) = (step(-20), step(-24));
        let own = [near, 1.01 * near, 0.99 * near, far, f64::INFINITY];
        let clear = [1.0; 5];
        assert_eq!(radius(&own, &clear, 0.05), near);
        // Points that no photon is near do not count, nor does the order.
        assert_eq!(radius(&[f64::INFINITY, f64::INFINITY, 0.99 * near], &clear, 0.05), near);
        assert_eq!(radius(&[f64::INFINITY], &clear, near), near);
        assert_eq!(radius(&own, &[4.0 * far; 5], 0.05), far);
    }

    /// Photons on a grid of a plane have a density that is known; those of another plane do not count.
    #[test]
    fn a_points_own_radius_holds_as_many_photons_of_the_run_as_wanted() {
        let planes = [Vec4::new(0.0, 0.0, 1.0, 0.0), Vec4::new(0.0, 0.0, 1.0, -0.001)];
        let side = 256;
        let place = |i: usize| (i as f32 + 0.5) / side as f32 - 0.5;
        let photon = |i: usize, plane: u32, height: f32| {
            let position = Vec3::new(place(i % side), place(i / side), height);
            MapPhoton { position, plane, flux: Vec3::ONE, wi: 0 }
        };
        let photons: Vec<MapPhoton> = (0..side * side).flat_map(|i| [photon(i, 0, 0.0), photon(i, 2, 0.001)]).collect();
        let point = VisiblePoint { position: Vec3::ZERO, plane: 0, ..bytemuck::Zeroable::zeroed() };
        let found = own_radius(&point, &photons, &planes, 4 * PHOTONS, 60.0);
        let exact = (60.0 / (std::f64::consts::PI * 4.0 * (side * side) as f64)).sqrt();
        assert!((found / exact - 1.0).abs() < 0.3, "{found}, {exact}");
        assert_eq!(own_radius(&point, &photons[..3], &planes, PHOTONS, 60.0), f64::INFINITY);
    }
}
