//! A measured quantity: its reference, the configurations that estimate it, and how one of them runs.

use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;

use super::Request;
use super::axes::{self, Configuration, Group, Line};
use super::point::Shot;
use super::reference::{Reference, wall_points};
use crate::engine::room::{self, film::estimate_walls};
use crate::engine::scene::{self, RunResult, Target, View};
use crate::engine::{self, Control};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::ledger::Ledger;
use crate::output::command;
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::scene::geometry::Geometry;
use crate::scene::open_box::open_box;
use crate::scene::{Camera, Light, Mesh, Scene};
use crate::settings::scene::{Effect, SceneSettings};
use crate::settings::{Builder, Preset, RoomSettings};
use crate::timings::Timings;
use crate::verify::judge::radiosity::inward;

pub struct Subject {
    pub quantity: String,
    pub reference: Reference,
    pub groups: Vec<Group>,
    scene: Scene,
    /// Of the scene as it is.
    geometry: Rc<Geometry>,
    camera: Option<Camera>,
    /// Points and normals, where no camera looks.
    receivers: Vec<(DVec3, DVec3)>,
    size: u32,
    /// The scene as the user named it.
    name: String,
}

/// Triangles up to which a list of them may be asked for.
const FEW_TRIANGLES: usize = 256;

impl Subject {
    /// Quantities of a scene; making their references may take a while.
    pub fn all(gpu: &Gpu, scene: &Scene, request: &Request, cancelled: &AtomicBool, tell: &mut dyn FnMut(&str)) -> Result<Vec<Subject>> {
        let Request { scene: name, size, photons, reference_samples, .. } = request.clone();
        let geometry = Rc::new(Geometry::new(scene)?);
        let subject = |quantity: &str, reference: &Reference, groups, (camera, receivers)| Subject {
            quantity: quantity.to_owned(),
            reference: reference.clone(),
            groups,
            scene: scene.clone(),
            geometry: geometry.clone(),
            camera,
            receivers,
            size,
            name: name.clone(),
        };
        let of_scene = |is_picture| scene_axes(gpu, scene, &geometry, request, is_picture);
        if name == "open-box" {
            tell("reference: radiosity of the box");
            let reference = Reference::walls(&RoomSettings::default(), size)?;
            let receivers: Vec<_> = wall_points(size).into_iter().map(|(wall, point)| (point, inward(wall))).collect();
            return Ok(vec![
                subject("Irradiance of the walls: the paper's box", &reference, axes::of_paper(size, photons), (None, Vec::new())),
                subject("Irradiance of the walls: the box as triangles", &reference, of_scene(false)?, (None, receivers.clone())),
                subject("The paper's experiment: rounds of 5000 photons", &reference, axes::of_the_papers_rounds(size), (None, receivers)),
            ]);
        }
        if let Some((receivers, reference)) = Reference::floor(&name, size) {
            return Ok(vec![subject("Irradiance of the floor", &reference, of_scene(false)?, (None, receivers))]);
        }
        let refuse = |why: &str| Err(Error::setting("study", &name, why));
        if unknown_to_paths(scene) {
            return refuse(
                "has a point, spot, directional or disc light with mirrors or glass. Path tracing, the reference, cannot find the caustics of such lights; choose another scene",
            );
        }
        tell(&format!(
            "reference: path tracing of {size} x {size} pixels, {reference_samples} samples per pixel, unless it is in the cache"
        ));
        let camera = scene.first_camera();
        let reference = Reference::picture(scene, &camera, size, reference_samples, cancelled, tell)?;
        if reference.mean_square() <= f64::MIN_POSITIVE {
            return refuse(
                "shows no light except light sources seen directly, so a relative error is not defined; choose another scene or camera",
            );
        }
        Ok(vec![subject("Radiance of the image", &reference, of_scene(true)?, (Some(camera), Vec::new()))])
    }

    /// What repeats a run.
    pub fn command(&self, configuration: &Configuration, rounds: u32, seed: u64) -> String {
        match &configuration.line {
            Line::Paper(settings) => {
                let job = command::main_job(Preset::Modified, &RoomSettings { rounds, seed, ..settings.clone() });
                let warm_up = if settings.builder == Builder::Cpu { "" } else { WARM_UP };
                format!("{job} --irradiance irradiance{warm_up}")
            }
            Line::Scene(settings) => {
                let settings = SceneSettings { rounds, seed, ..settings.clone() };
                let job = match self.camera {
                    Some(_) => format!("render {} --size {}x{} -o picture.exr", quoted(&self.name), self.size, self.size),
                    None => format!("probe {} --points {POINTS} -o irradiance.csv", quoted(&self.name)),
                };
                command::on_scene(&job, &settings) + WARM_UP
            }
        }
    }

    /// The points that are probed, as `photonmill probe --points` reads them; `None` for a picture.
    pub fn points_file(&self) -> Option<String> {
        let line = |(p, n): &(DVec3, DVec3)| format!("{} {} {} {} {} {}\n", p.x, p.y, p.z, n.x, n.y, n.z);
        if self.receivers.is_empty() { None } else { Some(self.receivers.iter().map(line).collect()) }
    }

    /// Whether it is lit by the paper's line.
    pub fn is_of_paper(&self) -> bool {
        self.groups.iter().flat_map(|group| &group.configurations).any(|configuration| matches!(configuration.line, Line::Paper(_)))
    }

    /// One run.
    pub fn run(&self, gpu: &Gpu, configuration: &Configuration, rounds: u32, seed: u64, cancelled: &AtomicBool) -> Result<Shot> {
        let mut control = Control::quiet(cancelled);
        let shot = match &configuration.line {
            Line::Paper(settings) => {
                let settings = RoomSettings { rounds, seed, ..settings.clone() };
                let room = open_box(&settings);
                let outcome = room::run(Some(gpu), &room, &settings, &mut control)?;
                let walls = estimate_walls(&outcome.film, &room, &outcome.plan);
                let values = walls.into_iter().flat_map(|wall| wall.irradiance).collect();
                shot(values, &outcome.timings, outcome.ledger())
            }
            Line::Scene(settings) => {
                let settings = SceneSettings { rounds, seed, ..settings.clone() };
                let lit = self.light(gpu, settings, &mut control)?;
                let channels = if self.camera.is_some() { 3 } else { 1 };
                let values = (0..lit.film.pixels()).flat_map(|pixel| lit.film.mean(pixel).to_array().into_iter().take(channels)).collect();
                let global = lit.fates[0].ledger();
                // A caustic map's photons end at the first surface that scatters, so the cap is the global map's.
                Shot { photons: lit.ledger().emitted, ..shot(values, &lit.timings, global) }
            }
        };
        if cancelled.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(shot) }
    }

    fn light(&self, gpu: &Gpu, settings: SceneSettings, control: &mut Control) -> Result<RunResult> {
        let geometry = match settings.without.as_slice() {
            [] => self.geometry.clone(),
            without => Rc::new(Geometry::new(&self.scene.without(without))?),
        };
        let target = self.camera.as_ref().map_or(Target::Points(&self.receivers), |camera| Target::Picture(camera, [self.size; 2]));
        let view = View { geometry: &geometry, camera: target.camera(), phases: &target.phases(&geometry) };
        let plan = scene::trial::plan(gpu, &self.scene, &view, &settings, target.sensor())?;
        scene::light(gpu, &view, plan, control)
    }
}

/// As a shell takes it for one word.
fn quoted(name: &str) -> String {
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./+,".contains(letter);
    if name.chars().all(plain) { name.to_owned() } else { format!("'{}'", name.replace('\'', "'\\''")) }
}

/// Whether light goes from lamps that no path meets over mirrors or through glass.
fn unknown_to_paths(scene: &Scene) -> bool {
    let kinds = scene.lobe_kinds();
    let is_specular = |mesh: &Mesh| kinds[mesh.material].is_sharp();
    let is_point_like = |light: &Light| !light.kind.is_environment();
    scene.lights.iter().any(is_point_like) && scene.meshes.iter().any(is_specular)
}

/// Runs of a study are timed at the clock of work.
const WARM_UP: &str = " --warm-up";

/// The file beside the page that the commands read points from.
pub const POINTS: &str = "points.txt";

fn shot(values: Vec<f64>, timings: &Timings, ledger: Ledger) -> Shot {
    let round = timings.row("round");
    Shot {
        values,
        gpu_ms: round.and_then(|row| row.gpu_ms),
        wall_ms: round.and_then(|row| row.wall_ms).or_else(|| timings.row("run").and_then(|row| row.wall_ms)).unwrap_or(0.0),
        photons: ledger.emitted,
        cut_off: ledger.cut_off as f64 / ledger.emitted.max(1) as f64,
    }
}

fn scene_axes(gpu: &Gpu, scene: &Scene, geometry: &Geometry, request: &Request, is_picture: bool) -> Result<Vec<Group>> {
    let settings = SceneSettings { photons: request.photons, caustic_photons: request.photons, block: Some(1), ..SceneSettings::default() };
    let sensor = Sensor::Picture { width: request.size, height: request.size };
    let plan = ScenePlan::new(scene, geometry, &settings, sensor, &engine::limits(gpu.facts()))?;
    let kept: Vec<Effect> = plan.decisions.iter().filter(|decision| decision.kept).map(|decision| decision.effect).collect();
    let radius = plan.global.as_ref().map(|map| map.radius * geometry.unit);
    Ok(axes::of_scene(request.photons, &kept, radius, geometry.triangles.len() <= FEW_TRIANGLES, is_picture))
}
