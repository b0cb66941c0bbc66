//! A measured quantity: its reference, the configurations that estimate it, and how one of them runs.

use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};

use super::StudyRequest;
use super::axes::{self, Configuration, Group};
use super::point::Shot;
use super::reference::{Reference, wall_points};
use crate::engine::room::{self, film::estimate_walls};
use crate::engine::run::watch::End;
use crate::engine::scene::{Receivers, RunResult};
use crate::engine::{self, Control};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::ledger::Ledger;
use crate::output::colour::ColourImage;
use crate::output::image::view_of_values;
use crate::render::image::command_line;
use crate::render::values::Variant;
use crate::render::{Observer, Percent, PreparedScene, RenderRequest};
use crate::scene::image_size::ImageSize;
use crate::scene::open_box::open_box;
use crate::scene::{Camera, Light, Mesh, Scene};
use crate::settings::scene::{Effect, SceneSettings};
use crate::settings::stop::Stop;
use crate::settings::{Builder, RoomSettings};
use crate::timings::Timings;
use crate::verify::judge::radiosity::inward;

pub(crate) struct StudyCase {
    pub quantity: String,
    pub reference: Reference,
    pub groups: Vec<Group>,
    scene: Rc<PreparedScene>,
    camera: Option<Camera>,
    /// Points and normals, where no camera looks.
    receivers: Vec<(DVec3, DVec3)>,
    /// Texels along a wall, or points along a floor.
    side: u32,
    /// Of the camera's picture.
    pixels: [u32; 2],
    /// The scene as the user named it, its light and its camera.
    viewpoint: RenderRequest,
}

/// What a pilot has chosen for an error.
pub(crate) struct TunedRun {
    settings: SceneSettings,
    /// Milliseconds of the pilot, of the device and of the host.
    gpu_ms: f64,
    wall_ms: f64,
    /// What the run is expected to take.
    pub expected: Duration,
}

/// Longer side of the picture, from the camera's aspect ratio.
fn pixels_of(camera: &Camera, longer: u32) -> [u32; 2] {
    let aspect = camera.aspect.unwrap_or(USUAL_ASPECT);
    let shorter = |ratio: f64| ((f64::from(longer) * ratio).round() as u32).max(1);
    if aspect >= 1.0 { [longer, shorter(1.0 / aspect)] } else { [shorter(aspect), longer] }
}

/// Where the camera leaves it open.
const USUAL_ASPECT: f64 = 4.0 / 3.0;

/// Triangles up to which a list of them may be asked for.
const FEW_TRIANGLES: usize = 256;

impl StudyCase {
    /// Quantities of a scene; making their references may take a while.
    pub(crate) fn all(
        gpu: &Gpu,
        scene: &Scene,
        request: &StudyRequest,
        cancelled: &AtomicBool,
        report: &mut dyn FnMut(&str),
    ) -> Result<Vec<StudyCase>> {
        let StudyRequest { scene: name, size, photons, reference_samples, .. } = request.clone();
        let viewpoint = RenderRequest::of_words(&request.scene_options).expect("they are options of a request");
        let viewpoint = RenderRequest { scene: name.clone(), ..viewpoint };
        let prepared = Rc::new(PreparedScene::new(scene.clone()));
        // Fails before references are made, which takes long.
        prepared.geometry(&Observer::default())?;
        let camera = scene.first_camera();
        let pixels = pixels_of(&camera, size);
        let case = |quantity: &str, reference: &Reference, groups, (camera, receivers)| StudyCase {
            quantity: quantity.to_owned(),
            reference: reference.clone(),
            groups,
            scene: prepared.clone(),
            camera,
            receivers,
            side: size,
            pixels,
            viewpoint: viewpoint.clone(),
        };
        let has_known_light = name == "open-box" || Reference::floor(&name, size).is_some();
        if let Some(option) = request.scene_options.first().filter(|_| has_known_light) {
            let allowed =
                format!("cannot be studied with {option}: its reference is of its own light; leave that out, or name another scene");
            return Err(Error::setting("SCENE", &name, allowed));
        }
        let of_scene = |is_picture: bool| scene_axes(gpu, &prepared, &viewpoint, request, is_picture.then_some(pixels));
        if name == "open-box" {
            report("reference: radiosity of the box");
            let reference = Reference::walls(&RoomSettings::default(), size)?;
            let receivers: Vec<_> = wall_points(size).into_iter().map(|(wall, point)| (point, inward(wall))).collect();
            return Ok(vec![
                case("Irradiance of the walls: the paper's box", &reference, axes::of_paper(size, photons), (None, Vec::new())),
                case(
                    "The paper's experiment: rounds of 5000 photons",
                    &reference,
                    axes::of_the_papers_rounds(size),
                    (None, receivers.clone()),
                ),
                case("Irradiance of the walls: the box as triangles", &reference, of_scene(false)?, (None, receivers)),
            ]);
        }
        if let Some((receivers, reference)) = Reference::floor(&name, size) {
            return Ok(vec![case("Irradiance of the floor", &reference, of_scene(false)?, (None, receivers))]);
        }
        let [width, height] = pixels;
        let reference = if unknown_to_paths(scene) {
            report("reference: a long run of photonmill itself, as path tracing cannot find the caustics of lights without a surface");
            let seconds = (request.budget / OF_OWN_REFERENCE).as_secs_f64();
            own_reference(gpu, &prepared, &camera, pixels, seconds, cancelled)?
        } else {
            report(&format!(
                "reference: path tracing of {width} x {height} pixels, {reference_samples} samples per pixel, unless it is in the cache"
            ));
            Reference::picture(scene, &camera, (width, height), reference_samples, cancelled, report)?
        };
        if reference.mean_square() <= f64::MIN_POSITIVE {
            let why =
                "shows no light except light sources seen directly, so a relative error is not defined; choose another scene or camera";
            return Err(Error::setting("SCENE", &name, why));
        }
        Ok(vec![case("Radiance of the image", &reference, of_scene(true)?, (Some(camera), Vec::new()))])
    }

    /// What repeats a run.
    pub(crate) fn command(&self, configuration: &Configuration, rounds: u32, seed: u64) -> String {
        let request = configuration.request_of(rounds, seed).brief();
        if !configuration.is_of_paper() {
            return self.command_of(request);
        }
        let others: &[&str] = &["--irradiance", "irradiance", WARM_UP];
        // The CPU needs no warm-up.
        let is_on_cpu = request.variant == Some(Variant::Of(Builder::Cpu));
        command_line("", &request, if is_on_cpu { &others[..2] } else { others })
    }

    fn command_of(&self, request: RenderRequest) -> String {
        let [width, height] = self.pixels;
        let size = Some(ImageSize::WidthAndHeight(width, height));
        match self.camera {
            Some(_) => command_line("render", &RenderRequest { size, ..request }, &["-o", "picture.exr", WARM_UP]),
            None => command_line("probe", &request, &["--points", POINTS, "-o", "irradiance.csv", WARM_UP]),
        }
    }

    /// What repeats a run with nothing set but its error.
    pub(crate) fn command_to(&self, error: f64, seed: u64) -> String {
        self.command_of(RenderRequest { error: Some(Percent::of_share(error)), seed: Some(seed), ..self.viewpoint.clone() })
    }

    /// What a pilot chooses for an error.
    pub(crate) fn choose(&self, gpu: &Gpu, error: f64, cancelled: &AtomicBool) -> Result<TunedRun> {
        let began = Instant::now();
        let stop = Stop { error: Some(error), ..Stop::default() };
        let settings = SceneSettings { rounds: MOST_ROUNDS, stop, ..SceneSettings::default() };
        let pilot = self.scene.prepare_with(&settings, self.all_receivers())?.choose(gpu, cancelled)?;
        let expected = pilot.as_ref().map_or(0.0, |pilot| 1e-9 * pilot.rounds.until(pilot.chosen, error).1);
        Ok(TunedRun {
            gpu_ms: pilot.as_ref().map_or(0.0, |pilot| pilot.spent),
            settings: pilot.map_or(settings.clone(), |pilot| pilot.set(&settings)),
            wall_ms: 1e3 * began.elapsed().as_secs_f64(),
            expected: Duration::from_secs_f64(expected.clamp(0.0, 1e6)),
        })
    }

    /// A run to its error, the pilot's time included, and its rounds; `None` if it was longer than `most`.
    pub(crate) fn run_to_error(
        &self,
        gpu: &Gpu,
        chosen: &TunedRun,
        seed: u64,
        most: Duration,
        cancelled: &AtomicBool,
    ) -> Result<Option<(Shot, u32)>> {
        let stop = Stop { seconds: Some(most.as_secs_f64()), ..chosen.settings.stop };
        let result = self.light(gpu, &SceneSettings { seed, stop, ..chosen.settings.clone() }, &mut Control::quiet(cancelled))?;
        if cancelled.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let shot = self.shot_of(&result);
        let with_pilot = Shot { gpu_ms: shot.gpu_ms.map(|ms| ms + chosen.gpu_ms), wall_ms: shot.wall_ms + chosen.wall_ms, ..shot };
        Ok((result.end == End::Error).then_some((with_pilot, result.film.rounds)))
    }

    /// Values as a picture, linear: as the camera sees them, or of the walls or the floor.
    pub(crate) fn picture(&self, values: &[f64]) -> ColourImage {
        let of_greys = |width: u32, height: u32, values: Vec<f64>| ColourImage {
            width,
            height,
            pixels: values.into_iter().map(|value| Vec3::splat(value as f32)).collect(),
        };
        if self.camera.is_some() {
            let [width, height] = self.pixels;
            let pixels = values.chunks(3).map(|pixel| DVec3::from_slice(pixel).as_vec3()).collect();
            return ColourImage { width, height, pixels };
        }
        if self.viewpoint.scene == "open-box" {
            let room = open_box(&RoomSettings::default());
            let per_wall = (self.side * self.side) as usize;
            let walls: Vec<(usize, &[f64])> = room.walls().map(|(face, _)| face).zip(values.chunks(per_wall)).collect();
            let seen = view_of_values(&room, &walls, BOX_VIEW, BOX_PIXELS as usize);
            return of_greys(BOX_PIXELS, BOX_PIXELS, seen.values);
        }
        of_greys(self.side, self.side, values.to_vec())
    }

    /// Whether runs with nothing set are measured too: the paper's box has no pilot.
    pub(crate) fn has_default(&self) -> bool {
        !self.is_of_paper()
    }

    /// The points that are probed, as `photonmill probe --points` reads them; `None` for a picture.
    pub(crate) fn points_file(&self) -> Option<String> {
        let line = |(p, n): &(DVec3, DVec3)| format!("{} {} {} {} {} {}\n", p.x, p.y, p.z, n.x, n.y, n.z);
        if self.receivers.is_empty() { None } else { Some(self.receivers.iter().map(line).collect()) }
    }

    /// Whether it is the paper's room.
    pub(crate) fn is_of_paper(&self) -> bool {
        self.groups.iter().flat_map(|group| &group.configurations).any(Configuration::is_of_paper)
    }

    /// One run.
    pub(crate) fn run(&self, gpu: &Gpu, configuration: &Configuration, rounds: u32, seed: u64, cancelled: &AtomicBool) -> Result<Shot> {
        let mut control = Control::quiet(cancelled);
        let request = configuration.request_of(rounds, seed);
        let shot = if configuration.is_of_paper() {
            let settings = request.room_settings();
            let room = open_box(&settings);
            let result = room::run(Some(gpu), &room, &settings, &mut control)?;
            let walls = estimate_walls(&result.film, &room, &result.plan);
            let values = walls.into_iter().flat_map(|wall| wall.irradiance).collect();
            shot(values, &result.timings, result.ledger())
        } else {
            self.shot_of(&self.light(gpu, &request.settings(None), &mut control)?)
        };
        if cancelled.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(shot) }
    }

    fn shot_of(&self, result: &RunResult) -> Shot {
        let channels = if self.camera.is_some() { 3 } else { 1 };
        let values = (0..result.film.pixels()).flat_map(|pixel| result.film.mean(pixel).to_array().into_iter().take(channels)).collect();
        let global = result.fates[0].ledger();
        // A caustic map's photons end at the first surface that scatters, so the cap is the global map's.
        Shot { photons: result.ledger().emitted, ..shot(values, &result.timings, global) }
    }

    fn all_receivers(&self) -> Receivers<'_> {
        self.camera.as_ref().map_or(Receivers::Points(&self.receivers), |camera| Receivers::Image(camera, self.pixels))
    }

    fn light(&self, gpu: &Gpu, settings: &SceneSettings, control: &mut Control) -> Result<RunResult> {
        let prepared = self.scene.prepare_with(settings, self.all_receivers())?;
        prepared.light(gpu, prepared.plan_on(gpu, settings)?, control)
    }
}

/// Whether light goes from lamps that no path meets over mirrors or through glass.
fn unknown_to_paths(scene: &Scene) -> bool {
    let kinds = scene.lobe_kinds();
    let is_specular = |mesh: &Mesh| kinds[mesh.material].is_sharp();
    let is_point_like = |light: &Light| !light.kind.is_environment();
    scene.lights.iter().any(is_point_like) && scene.meshes.iter().any(is_specular)
}

/// A reference by photonmill itself, where no other method has one: with other random numbers than any run that it judges.
fn own_reference(
    gpu: &Gpu,
    scene: &PreparedScene,
    camera: &Camera,
    pixels: [u32; 2],
    seconds: f64,
    cancelled: &AtomicBool,
) -> Result<Reference> {
    let stop = Stop { seconds: Some(seconds), ..Stop::default() };
    let settings = SceneSettings { rounds: MOST_ROUNDS, stop, seed: OWN_SEED, ..SceneSettings::default() };
    let prepared = scene.prepare_with(&settings, Receivers::Image(camera, pixels))?;
    let chosen = prepared.choose(gpu, cancelled)?.map_or(settings.clone(), |pilot| pilot.set(&settings));
    let result = prepared.light(gpu, prepared.plan_on(gpu, &chosen)?, &mut Control::quiet(cancelled))?.finished()?;
    let (film, error) = (&result.film, result.error());
    let all = |value: &dyn Fn(usize) -> DVec3| (0..film.pixels()).flat_map(|pixel| value(pixel).to_array()).collect::<Vec<f64>>();
    let surfaces = film.surface_means().collect::<Vec<_>>();
    let errors = all(&|pixel| film.standard_error(pixel));
    let is_lamp = |pixel: usize| film.mean(pixel) != surfaces[pixel];
    let reference = Reference {
        method: "a long run of photonmill itself with other random numbers: path tracing cannot find the caustics of lights without a surface. What such runs have in common, as a bias, is not in the errors here".to_owned(),
        values: all(&|pixel| film.mean(pixel)),
        // Places whose error is not known judge nothing.
        counts: errors.iter().enumerate().map(|(place, error)| error.is_finite() && !is_lamp(place / 3)).collect(),
        standard_errors: errors,
        relative_error: 0.0,
    }
    .with_own_error();
    let bias = error.bias.map_or(0.0, |bias| bias.relative);
    Ok(Reference { relative_error: reference.relative_error.hypot(bias), ..reference })
}

/// Of the budget, a reference that photonmill makes itself.
const OF_OWN_REFERENCE: u32 = 4;
const OWN_SEED: u64 = 0x5eed_0000_0000;
const MOST_ROUNDS: u32 = 1 << 16;
/// Which of the box's views is shown, and pixels along it.
const BOX_VIEW: usize = 1;
const BOX_PIXELS: u32 = 240;

/// Runs of a study are timed at full clock.
const WARM_UP: &str = "--warm-up";

/// The file beside the page that the commands read points from.
pub(crate) const POINTS: &str = "points.txt";

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

fn scene_axes(
    gpu: &Gpu,
    scene: &PreparedScene,
    viewpoint: &RenderRequest,
    request: &StudyRequest,
    picture: Option<[u32; 2]>,
) -> Result<Vec<Group>> {
    let base = RenderRequest { photons: Some(request.photons), block: Some(1), ..viewpoint.clone() };
    let camera = scene.scene.first_camera();
    let prepared = scene.prepare_with(&base.settings(None), Receivers::Image(&camera, picture.unwrap_or([request.size; 2])))?;
    let plan = prepared.plan_within(&engine::limits(gpu.facts()))?;
    let kept: Vec<Effect> = plan.decisions.iter().filter(|decision| decision.kept).map(|decision| decision.effect).collect();
    let radius = plan.global.as_ref().map(|map| map.radius * prepared.geometry.unit);
    Ok(axes::of_scene(base, &kept, radius, prepared.geometry.triangles.len() <= FEW_TRIANGLES, picture.is_some()))
}
