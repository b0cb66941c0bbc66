//! From a request to a run: files, scene, geometry, pilot, trial, plan, rounds and bias, the same for whoever asks.
//!
//! Two short runs come before the run itself. The trial round finds radii and how photons choose among lights. A pilot measures variance
//! and cost, and chooses settings from them; a run that ends at no error and no time needs none.

use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use glam::DVec3;

use super::bias::{bias_before, rounds_after};
use super::checkpoints::Checkpoints;
use super::events::{Event, Observer};
use super::request::RenderRequest;
use super::scene::{PreparedScene, geometry};
use super::tuned_settings::{TunedFor, TunedSettings};
use crate::bake::Layout;
use crate::engine::Control;
use crate::engine::run::retry::until_done;
use crate::engine::run::saved::SavedRun;
use crate::engine::scene::map_file::MapFile;
use crate::engine::scene::pilot::{self, Pilot};
use crate::engine::scene::{Receivers, RunResult, Viewpoint, bias, light_from, light_on, scene_hash, trial};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::oidn::Denoiser;
use crate::output::destination::Destination;
use crate::output::scene_report;

use crate::plan::Limits;
use crate::plan::film::BiasPlan;
use crate::plan::radius::mean_squared_radius;
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::plan::work_division::{Division, TunableSettings};
use crate::records::Receiver;
use crate::scene::geometry::Geometry;
use crate::scene::image_size::ImageSize;
use crate::scene::sensors::with_sensors;
use crate::scene::{Camera, Scene};
use crate::settings::scene::SceneSettings;
use crate::text::counted;

/// A request whose files are open and whose settings are allowed; of the scene nothing is read yet.
pub(crate) struct Inputs {
    pub request: RenderRequest,
    /// What the request asks for; a pilot may choose some of it.
    pub settings: SceneSettings,
    /// Photons that need not be traced.
    pub(super) map: Option<MapFile>,
    /// What a pilot has chosen before.
    pub(super) tuned: Option<TunedSettings>,
    /// Where the settings go that a pilot chooses.
    pub save_settings: Option<Destination>,
    pub(super) denoiser: Option<Denoiser>,
}

impl Inputs {
    /// Fails where a file cannot be used, or a value is not allowed.
    pub(crate) fn open(request: &RenderRequest) -> Result<Inputs> {
        let map = request.map.as_ref().map(|path| MapFile::open("map", path)).transpose()?;
        if let Some((map, rounds)) = map.as_ref().zip(request.rounds).filter(|(map, rounds)| *rounds > map.rounds()) {
            let allowed = format!("must be at most {}, the rounds that the file of `map` holds", map.rounds());
            return Err(Error::setting("rounds", rounds, allowed));
        }
        let tuned = request.settings.as_deref().map(TunedSettings::open).transpose()?;
        Inputs::with(request, map, tuned)
    }

    /// The same with files that are open.
    pub(super) fn with(request: &RenderRequest, map: Option<MapFile>, tuned: Option<TunedSettings>) -> Result<Inputs> {
        let settings = request.settings(tuned.as_ref().map(TunedSettings::settings).as_ref());
        let settings = match &map {
            Some(map) => SceneSettings { rounds: request.rounds.unwrap_or(map.rounds()), ..map.settings(&settings) },
            None => settings,
        };
        settings.validate()?;
        let save_settings = request.save_settings.as_ref().map(|path| Destination::open("save_settings", path)).transpose()?;
        Ok(Inputs { request: request.clone(), settings, map, tuned, save_settings, denoiser: None })
    }

    /// For an image of which nothing says when it ends: an error ends it, or the time that suits the device.
    pub(crate) fn ended(self, kind: &str) -> Inputs {
        Inputs { settings: self.request.ended(self.settings, kind), ..self }
    }
}

/// What light is asked of.
#[derive(Clone, Copy)]
pub(crate) enum RequestedReceivers<'a> {
    /// The image of the request's camera, or of another one: radiance, W/m2/sr.
    Image(Option<&'a Camera>),
    /// Points with the normals of their surfaces, metres: irradiance, W/m2.
    Points(&'a [(DVec3, DVec3)]),
    /// Texels of lightmaps: irradiance, W/m2.
    Texels(&'a Layout),
}

/// What is rendered: a scene with the geometry that is left of it, and what receives its light.
pub(crate) struct Prepared {
    pub inputs: Inputs,
    pub scene: Arc<Scene>,
    pub geometry: Arc<Geometry>,
    pub sensor: Sensor,
    /// Of an image.
    pub camera: Option<Camera>,
    /// Of points and texels.
    phases: Vec<Vec<Receiver>>,
    /// Pixel, texel or point.
    pub point: &'static str,
    /// What a pilot may choose.
    tunable: TunableSettings,
}

/// A run and what is to be said of it.
pub struct Run {
    pub result: RunResult,
    /// What a pilot chose; `None` where there was nothing to choose.
    pub pilot: Option<Pilot>,
    /// Wall time of all of it, pilot and trial included.
    pub seconds: f64,
}

impl std::ops::Deref for Run {
    type Target = RunResult;

    fn deref(&self) -> &RunResult {
        &self.result
    }
}

/// Reads the scene of a request and makes ready what is asked of it.
pub(crate) fn prepare(inputs: Inputs, receivers: RequestedReceivers, observer: &Observer) -> Result<Prepared> {
    if matches!(receivers, RequestedReceivers::Image(None)) {
        inputs.request.check_camera()?;
    }
    let scene = PreparedScene::read(&inputs.request, observer)?;
    scene.prepare(inputs, receivers, observer)
}

impl PreparedScene {
    /// Makes ready what a request asks of this scene, whatever the scene's name in it. Refuses another light than the scene was read with.
    pub(crate) fn prepare(&self, inputs: Inputs, receivers: RequestedReceivers, observer: &Observer) -> Result<Prepared> {
        let (request, settings) = (&inputs.request, &inputs.settings);
        self.check_read_as(request)?;
        // Photons of a file are those of the scene alone.
        let scene = match receivers {
            RequestedReceivers::Points(points) if inputs.map.is_none() => match with_sensors(&self.scene, points, settings) {
                Cow::Borrowed(_) => self.scene.clone(),
                Cow::Owned(scene) => Arc::new(scene),
            },
            _ => self.scene.clone(),
        };
        let is_own = Arc::ptr_eq(&scene, &self.scene) && settings.without.is_empty();
        let geometry = if is_own { self.geometry(observer)? } else { Arc::new(geometry(&scene, &settings.without, observer)?) };
        let place = |name: &str, places: &mut dyn Iterator<Item = DVec3>| {
            geometry.place_warning(name, places).iter().for_each(|line| observer.warn(line));
        };
        let (camera, sensor, phases, point) = match receivers {
            RequestedReceivers::Image(given) => {
                let (camera, [width, height]) = request.viewpoint(&scene, given, observer)?;
                place("the camera", &mut [camera.eye].into_iter());
                (Some(camera), Sensor::Picture { width, height }, Vec::new(), "pixel")
            }
            RequestedReceivers::Points(points) => {
                place("points", &mut points.iter().map(|(position, _)| *position));
                let receivers = Receivers::Points(points);
                (None, receivers.sensor(), receivers.phases(&geometry), "point")
            }
            RequestedReceivers::Texels(layout) => {
                let sensor = Sensor::Receivers { count: layout.texel_count() as u32 };
                (None, sensor, layout.receivers(settings.rounds, &geometry), "texel")
            }
        };
        let tunable = request.tunable(camera.is_some());
        Ok(Prepared { inputs, scene, geometry, sensor, camera, phases, point, tunable })
    }

    /// The same with settings that are not of a request. A pilot may choose all that it can.
    pub(crate) fn prepare_with(&self, settings: &SceneSettings, receivers: Receivers) -> Result<Prepared> {
        let (size, receivers) = match receivers {
            Receivers::Image(camera, [width, height]) => {
                (Some(ImageSize::WidthAndHeight(width, height)), RequestedReceivers::Image(Some(camera)))
            }
            Receivers::Points(points) => (None, RequestedReceivers::Points(points)),
        };
        let inputs = Inputs::open(&RenderRequest { size, ..RenderRequest::default() })?;
        self.prepare(Inputs { settings: settings.clone(), ..inputs }, receivers, &Observer::default())
    }
}

impl Prepared {
    pub(crate) fn viewpoint(&self) -> Viewpoint<'_> {
        Viewpoint { geometry: &self.geometry, camera: self.camera.as_ref(), phases: &self.phases }
    }

    /// Of an image, width and height in pixels.
    pub(crate) fn size(&self) -> (u32, u32) {
        self.sensor.size()
    }

    pub(crate) fn scene_hash(&self) -> String {
        scene_hash(&self.geometry)
    }

    /// What a device within these limits would do, but for what a trial round finds.
    pub(crate) fn plan_within(&self, limits: &Limits) -> Result<ScenePlan> {
        self.of_map(ScenePlan::new(&self.scene, &self.geometry, &self.inputs.settings, self.sensor, limits)?)
    }

    /// What a device does with these settings, and with what a trial round finds; of a device that works to its end.
    pub(crate) fn plan_on(&self, gpu: &Gpu, settings: &SceneSettings) -> Result<ScenePlan> {
        self.of_map(trial::plan(gpu, &self.scene, &self.viewpoint(), settings, self.sensor)?)
    }

    /// What a pilot chooses; `None` where there is nothing to choose. Of a device that works to its end.
    pub(crate) fn choose(&self, gpu: &Gpu, cancelled: &AtomicBool) -> Result<Option<Pilot>> {
        pilot::choose_for(gpu, &self.scene, &self.viewpoint(), &self.inputs.settings, self.sensor, self.tunable, cancelled)
    }

    /// Runs a plan, and nothing before or after it; on a device that works to its end.
    pub(crate) fn light(&self, gpu: &Gpu, plan: ScenePlan, control: &mut Control) -> Result<RunResult> {
        light_from(gpu, &self.viewpoint(), plan, self.inputs.map.as_ref(), control)
    }

    fn of_map(&self, plan: ScenePlan) -> Result<ScenePlan> {
        self.inputs.map.iter().try_fold(plan, |plan, map| map.plan(plan, &self.geometry))
    }

    /// The settings that a pilot finds best, and what it has found; saved where that is asked for.
    pub(crate) fn tune(&self, gpu: &mut Gpu, observer: &Observer) -> Result<(SceneSettings, Option<Pilot>)> {
        let Inputs { ref settings, ref tuned, ref save_settings, .. } = self.inputs;
        let mut found = None;
        if settings.stop.has_goal() && self.tunable != TunableSettings::default() {
            observer.report(Event::Status("looking for the best settings"));
            found = until_done(gpu, &observer.failed(), |gpu: &Gpu| self.choose(gpu, observer.cancelled))?;
        }
        if let Some(pilot) = &found {
            observer.report(Event::Pilot(pilot, &settings.stop, self.point));
        }
        let best = found.as_ref().map_or_else(|| settings.clone(), |pilot| pilot.set(settings));
        if tuned.is_some() || save_settings.is_some() {
            let this =
                TunedFor { scene: &self.scene.name, scene_hash: self.scene_hash(), size: self.sensor.size(), device: gpu.facts().kind };
            let difference = tuned.as_ref().and_then(|tuned| tuned.difference(&this));
            difference.iter().for_each(|difference| observer.warn(difference));
            if let Some(file) = save_settings {
                let rounds = found.as_ref().map_or(settings.rounds, |pilot| pilot.rounds.expected(pilot.chosen, &settings.stop));
                let block = best.rounds_per_block(self.camera.is_some());
                TunedSettings::new(&best, rounds.next_multiple_of(block), &this).write(file.clone())?;
                let path = file.path().display();
                observer.report(Event::Note(&format!("settings for about {}: wrote {path}", counted(rounds, "round"))));
            }
        }
        Ok((best, found))
    }

    /// The settings of the run that this one goes on with, where nobody has set others; else what a pilot finds.
    fn settings(&self, gpu: &mut Gpu, resumed: Option<&SavedRun>, observer: &Observer) -> Result<(SceneSettings, Option<Pilot>)> {
        let (settings, tunable) = (&self.inputs.settings, self.tunable);
        let Some(run) = resumed else { return self.tune(gpu, observer) };
        let of_run = |name: &str, own: u32, is_free: bool| {
            let value = run.identity.settings.get(name).and_then(|value| value.as_u64()?.try_into().ok());
            if is_free { value.unwrap_or(own) } else { own }
        };
        let division = Division {
            samples: of_run("samples", settings.samples, tunable.samples),
            shadow_rays: of_run("shadow_rays", settings.shadow_rays, tunable.shadow_rays),
            photons: of_run("photons", settings.photons, tunable.photons),
            caustic_photons: of_run("caustic_photons", settings.caustic_photons, tunable.caustic_photons),
            neighbours: of_run("neighbours", settings.neighbours, tunable.neighbours),
            caustic_neighbours: of_run("caustic_neighbours", settings.caustic_neighbours, tunable.caustic_neighbours),
        };
        let tiles = run.identity.settings.get("tiles").and_then(|tiles| serde_json::from_value(tiles.clone()).ok());
        let tiles = tiles.filter(|_| tunable.samples).or_else(|| settings.tiles.clone());
        Ok((SceneSettings { tiles, ..division.set(settings) }, None))
    }

    /// As many rounds as whole blocks have, and as the file of photons holds.
    fn in_whole_blocks(&self, wanted: &SceneSettings, observer: &Observer) -> SceneSettings {
        let is_picture = self.camera.is_some();
        let mut settings = wanted.in_whole_blocks(is_picture);
        let block = settings.rounds_per_block(is_picture);
        let of_map = self.inputs.map.as_ref().map(MapFile::rounds).filter(|most| settings.rounds > *most);
        if let Some(most) = of_map {
            settings.rounds = most - most % block;
        }
        if of_map.unwrap_or(wanted.rounds) != settings.rounds {
            let wanted = of_map.map_or(format!("`rounds` {} is", wanted.rounds), |most| format!("the {most} rounds of `map` are"));
            observer.report(Event::Note(&format!("{wanted} taken as {}: whole blocks of {block}", settings.rounds)));
        }
        settings
    }

    /// Chooses settings by a pilot and radii by a trial round, runs all rounds, and measures the bias where that is asked for.
    pub(crate) fn run(&self, gpus: &mut Vec<Gpu>, checkpoints: &mut Checkpoints, observer: &Observer) -> Result<Run> {
        let started = Instant::now();
        let (viewpoint, map) = (self.viewpoint(), self.inputs.map.as_ref());
        let (wanted, pilot) = self.settings(&mut gpus[0], checkpoints.resumed(), observer)?;
        if observer.cancelled.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let settings = self.in_whole_blocks(&wanted, observer);
        let done = checkpoints.rounds_done(settings.rounds_per_block(self.camera.is_some()));
        if done > settings.rounds {
            let rounds = settings.rounds;
            observer.warn(format!("`rounds` {rounds} is less than the {done} rounds of `resume`, all of which are kept"));
        }
        let mut plan = until_done(&mut gpus[0], &observer.failed(), |gpu: &Gpu| self.plan_on(gpu, &settings))?;
        if let Some(warning) = scene_report::radius_warning(&plan, &self.geometry, self.point) {
            observer.warn(warning);
        }
        let is_of_file = map.is_some();
        let line = scene_report::plan_line(&plan, &self.scene.name, self.geometry.unit, self.point, is_of_file);
        observer.report(Event::Note(&line));
        bias::check(&settings.stop, plan.film.bias)?;
        // The error asked for is noise and bias together, so what blocks do not show must be known beforehand.
        let takes_extra_runs = self.inputs.request.bias && plan.film.bias == BiasPlan::ExtraRuns;
        let measure = |gpu: &mut Gpu, plan: &ScenePlan, factor_and_rounds| {
            let once = |gpu: &Gpu| bias::measure(gpu, &self.scene, &viewpoint, plan, factor_and_rounds, observer.cancelled);
            observer.interruptible(|| until_done(gpu, &observer.failed(), once))
        };
        let alpha = settings.alpha;
        let of_first_round = |rounds| measure(&mut gpus[0], &plan, (1.0, rounds));
        let before = bias_before(&settings.stop, takes_extra_runs, alpha < 1.0, observer, of_first_round)?;
        plan.settings.stop.bias = before.map(|bias| bias.upper);

        observer.report(Event::Status("making the pipelines"));
        let checkpointing = checkpoints.checkpointing(&self.scene.name);
        let mut control = Control {
            cancelled: observer.cancelled,
            progress: &mut |progress| observer.report(Event::Progress(progress, "round")),
            checkpointing,
        };
        let light = || light_on(gpus, (&self.scene, &viewpoint), &plan, map, &observer.failed(), &mut control);
        let mut result = observer.interruptible(light)?;
        if result.is_cancelled() {
            let rounds = counted(result.film.rounds, "round");
            observer.report(Event::Remark(&format!("ended early: the results are of {rounds} of {}", settings.rounds)));
        } else {
            let shrunk = mean_squared_radius(alpha, result.film.rounds);
            result.bias = match before {
                Some(bias) => Some(bias.scaled(shrunk)),
                // At the radius whose square is the mean of the rounds' squares.
                None if takes_extra_runs => {
                    observer.report(Event::Status("measuring the bias"));
                    measure(&mut gpus[0], &result.plan, (shrunk.sqrt(), rounds_after(result.film.rounds)))?
                }
                None => None,
            };
            observer.report(Event::Status("writing the results"));
        }
        Ok(Run { result, pilot, seconds: started.elapsed().as_secs_f64() })
    }
}
