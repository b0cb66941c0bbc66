//! A run that is looked at, until it must begin anew with other settings or another size.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use egui::Context;
use glam::DVec3;

use super::camera::MovingCamera;
use super::choices::Choices;
use super::display::{DisplayImage, Exposure};
use super::events::Events;
use super::live::{Live, Rate};
use super::panel::{self, PHOTON_COLOURS, PanelActions, Status};
use super::{ViewedScene, WindowRequest};
use crate::engine::room::live::LiveRoom;
use crate::engine::scene::live::{DotPlace, LiveScene};
use crate::error::Result;
use crate::gpu::window::Presenter;
use crate::gpu::{Commands, Gpu};
use crate::output::colour::png_of_codes;
use crate::plan::scene::ScenePlan;
use crate::render::image::command_line;
use crate::render::names::{as_option, spelled};
use crate::render::{Inputs, Observer, RenderRequest, RequestedReceivers, Stops, room};
use crate::scene::geometry::Geometry;
use crate::scene::image_size::ImageSize;
use crate::scene::open_box::open_box;
use crate::scene::{Camera, Projection};
use crate::settings::scene::Part;

/// How a run that was looked at ended.
pub(crate) enum Next {
    /// `works`: it had begun.
    Anew {
        works: bool,
    },
    Close,
}

/// What stays from run to run.
pub(crate) struct Session<'a> {
    gpu: &'a Gpu,
    request: &'a WindowRequest<'a>,
    interface: Context,
    status: Status,
    camera: MovingCamera,
    first_camera: MovingCamera,
    /// Nobody has chosen an exposure, and no picture has given one.
    wants_exposure: bool,
    /// What the user is shown for a while.
    said: Option<Instant>,
    files: u32,
    rendering: Option<Rendering>,
}

/// Rounds are run for so long before the window is shown again.
const FRAME: Duration = Duration::from_millis(15);
/// Between two looks at the error, each of which reads the film.
const LOOK: Duration = Duration::from_secs(2);
/// A window keeps its size for so long before the picture takes it.
const SETTLED: Duration = Duration::from_millis(250);
const STOPS_OF_PHOTONS: f32 = 2.0;
const SAID: Duration = Duration::from_secs(8);

impl<'a> Session<'a> {
    pub(super) fn new(gpu: &'a Gpu, request: &'a WindowRequest<'a>, interface: Context, title: String) -> Session<'a> {
        let camera = match &request.viewed {
            ViewedScene::Scene { scene, camera } => {
                let scene = &scene.scene;
                let (min, max) = scene.bounds();
                let ahead = scene.distance_along(camera.eye, camera.forward).filter(|distance| distance.is_finite());
                MovingCamera { camera: camera.clone(), pivot: ahead.unwrap_or(0.5 * (max - min).length()).max(1e-9) }
            }
            ViewedScene::Box => {
                let room = open_box(&request.request.room_settings());
                let middle = 0.5 * (room.min_corner + room.max_corner);
                let half = 0.5 * (room.max_corner - room.min_corner).max_element();
                let eye = middle + half * DVec3::new(0.7, 0.5, 3.2);
                MovingCamera { camera: Camera::looking_at("box", eye, middle, DVec3::Y, 0.8), pivot: eye.distance(middle) }
            }
        };
        let status = Status { title, device: gpu.facts().label(), is_box: matches!(request.viewed, ViewedScene::Box), ..Status::default() };
        Session {
            gpu,
            request,
            interface,
            status,
            first_camera: camera.clone(),
            camera,
            wants_exposure: true,
            said: None,
            files: 0,
            rendering: None,
        }
    }

    pub(super) fn say(&mut self, message: String) {
        self.status.message = message;
        self.said = Some(Instant::now());
    }

    /// Runs with these choices until they must begin anew.
    pub(super) fn show(&mut self, events: &mut Events, presenter: &mut Presenter, choices: &mut Choices) -> Result<Next> {
        let Some(window) = self.settled_size(events, presenter)? else { return Ok(Next::Close) };
        let size = self.request.size.unwrap_or(window.map(|length| (length / choices.zoom).max(1)));
        let picture = DisplayImage::new(self.gpu, size, window)?;
        self.status.size = size;
        self.status.rounds = 0;
        (self.status.noise, self.status.unseen) = (f64::INFINITY, 0.0);
        self.wait_frame(events, presenter, &picture, choices)?;
        match &self.request.viewed {
            ViewedScene::Scene { scene, .. } => {
                let request = RenderRequest { size: Some(width_and_height(size)), ..choices.run.live(&self.request.request) };
                let mut inputs = Inputs::open(&request)?;
                inputs.settings.keeps_parts = true;
                let prepared = scene.prepare(inputs, RequestedReceivers::Image(Some(&self.camera.camera)), &Observer::default())?;
                let plan = prepared.plan_on(self.gpu, &prepared.inputs.settings)?;
                let live = LiveScene::new(self.gpu, &prepared.geometry, &self.camera.camera, &plan, self.request.cancelled)?;
                self.take_plan(&plan, &prepared.geometry, choices);
                self.frames(Live::Scene(Box::new(live)), &picture, events, presenter, choices)
            }
            ViewedScene::Box => {
                let settings = choices.run.live_box(&self.request.request);
                let scene = open_box(&settings);
                let plan = LiveRoom::plan(self.gpu, &scene, &settings)?;
                let live = LiveRoom::new(self.gpu, &scene, &plan, self.request.cancelled)?;
                self.status.radii = [Some(settings.radius), None];
                self.frames(Live::Room(Box::new(live)), &picture, events, presenter, choices)
            }
        }
    }

    fn take_plan(&mut self, plan: &ScenePlan, geometry: &Geometry, choices: &mut Choices) {
        let needed = plan.decisions.iter().filter(|decision| decision.needed || choices.run.without.contains(&decision.effect));
        self.status.effects = needed.map(|decision| (decision.effect, decision.evidence.clone())).collect();
        self.status.has_parts = plan.keeps_parts();
        let radius = |map: &Option<_>| map.as_ref().map(|map| plan.radius(map, 0) * geometry.unit);
        self.status.radii = [radius(&plan.global), radius(&plan.caustic)];
    }

    /// A frame that says that a run is being prepared.
    fn wait_frame(&mut self, events: &mut Events, presenter: &mut Presenter, picture: &DisplayImage, choices: &mut Choices) -> Result<()> {
        let mut commands = Commands::new(self.gpu, crate::gpu::Constants::new(64), Instant::now())?;
        commands.fill(&picture.pixels, 0, picture.pixels.count(), 0xff1c_1c1c);
        commands.submit()?;
        // egui measures what it has not drawn before, and draws it in the next frame.
        for _ in 0..2 {
            self.interface_frame(events, presenter, picture, choices, true)?;
        }
        Ok(())
    }

    /// The window's size once it rests; `None`: it was closed.
    fn settled_size(&self, events: &mut Events, presenter: &Presenter) -> Result<Option<[u32; 2]>> {
        let mut since = Instant::now();
        let mut size = presenter.size()?;
        loop {
            if events.is_closed() || self.request.cancelled.load(Ordering::Relaxed) {
                return Ok(None);
            }
            if size[0] > 0 && size[1] > 0 && (since.elapsed() >= SETTLED || self.status.rounds == 0) {
                return Ok(Some(size));
            }
            events.wait(Duration::from_millis(50));
            let now = presenter.size()?;
            if now != size {
                (since, size) = (Instant::now(), now);
            }
        }
    }

    /// Draws the user interface over the picture; what the user asks for, and whether the window has its size still.
    fn interface_frame(
        &mut self,
        events: &mut Events,
        presenter: &mut Presenter,
        picture: &DisplayImage,
        choices: &mut Choices,
        is_waiting: bool,
    ) -> Result<(PanelActions, bool)> {
        events.wait(Duration::ZERO);
        if self.said.is_some_and(|said| said.elapsed() > SAID) {
            self.status.message.clear();
            self.said = None;
        }
        let mut actions = PanelActions::default();
        let (interface, status, pivot) = (self.interface.clone(), &self.status, self.camera.pivot);
        let input = if is_waiting { events.look_at_input() } else { events.take_input() };
        let mut output = interface.run_ui(input, |ui| {
            actions = panel::show(ui.ctx(), choices, status, pivot);
            if is_waiting {
                egui::Area::new("waiting".into()).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).show(ui.ctx(), |ui| {
                    ui.label(egui::RichText::new("Preparing ...").size(22.0));
                });
            }
        });
        events.obey(&mut output);
        let fits = picture.present(presenter, &interface, output)?;
        Ok((actions, fits))
    }

    fn frames(
        &mut self,
        mut live: Live,
        picture: &DisplayImage,
        events: &mut Events,
        presenter: &mut Presenter,
        choices: &mut Choices,
    ) -> Result<Next> {
        let (run, zoom) = (choices.run.clone(), choices.zoom);
        let (mut looked, mut mean) = (None::<Instant>, 1.0);
        let mut rate = Rate::default();
        loop {
            let began = Instant::now();
            while live.round()? && began.elapsed() < FRAME {}
            self.status.rounds = live.rounds();
            rate.take(live.rounds());
            self.status.rounds_per_second = rate.per_second;
            self.status.take(&mut live);
            if looked.is_none_or(|looked: Instant| looked.elapsed() >= LOOK) {
                let look = live.look()?;
                (self.status.noise, self.status.bias, self.status.unseen, mean) = (look.noise, look.bias, look.unseen, look.mean);
                looked = Some(Instant::now());
                if std::mem::take(&mut self.wants_exposure) {
                    choices.stops = look.stops;
                }
            }
            let is_light = !self.status.is_box;
            let shows = if self.status.has_parts || choices.shows == crate::constants::SHOW_ERROR { choices.shows } else { 0 };
            // Dots show on a picture that is darker.
            let stops = choices.stops - if choices.has_photons { STOPS_OF_PHOTONS } else { 0.0 };
            let exposure = Exposure { shows, stops, is_light };
            match &mut live {
                Live::Scene(live) => live.show(shows, mean, &picture.shown)?,
                Live::Room(live) => live.show(shows, mean, &self.camera.camera, picture.size, &picture.shown)?,
            }
            picture.expose(live.commands(), exposure, self.zoom(picture, choices), presenter.blue_first())?;
            if let (Live::Scene(live), true) = (&mut live, choices.has_photons) {
                let place = DotPlace { window: picture.window, zoom: self.zoom(picture, choices) };
                live.show_photons(PHOTON_COLOURS.map(|colour| word_of(colour, presenter.blue_first())), place, &picture.pixels)?;
            }
            live.commands().submit()?;
            self.status.command = self.command(choices);
            let (actions, fits) = self.interface_frame(events, presenter, picture, choices, false)?;
            if actions.close || events.is_closed() || self.request.cancelled.load(Ordering::Relaxed) {
                self.end_rendering();
                return Ok(Next::Close);
            }
            self.act(actions, &mut live, picture, presenter, choices)?;
            // A minimised window has no pixels; the run goes on when it is back.
            if presenter.size()?.contains(&0) {
                events.wait(Duration::from_millis(100));
                continue;
            }
            if !fits || choices.run != run || choices.zoom != zoom || presenter.size()? != picture.window {
                return Ok(Next::Anew { works: choices.run == run });
            }
            if live.has_ended() {
                events.wait(FRAME);
            }
        }
    }

    /// Window pixels of one of the picture.
    fn zoom(&self, picture: &DisplayImage, choices: &Choices) -> u32 {
        let fits = (picture.window[0] / picture.size[0]).min(picture.window[1] / picture.size[1]).max(1);
        if self.request.size.is_some() { fits } else { choices.zoom }
    }

    fn act(
        &mut self,
        actions: PanelActions,
        live: &mut Live,
        picture: &DisplayImage,
        presenter: &Presenter,
        choices: &mut Choices,
    ) -> Result<()> {
        let back = actions.first_camera && self.camera.camera != self.first_camera.camera;
        if back {
            self.camera = self.first_camera.clone();
        }
        if self.camera.apply(&actions.motion) || back {
            live.look_from(&self.camera.camera)?;
        }
        if actions.usual_exposure {
            choices.stops = live.look()?.stops;
        }
        if actions.screenshot {
            let path = self.free_name("png");
            let codes = picture.codes(live.commands(), presenter.blue_first())?;
            let content = png_of_codes(picture.window[0], picture.window[1], &codes);
            self.say(match std::fs::write(&path, content) {
                Ok(()) => format!("wrote {}", path.display()),
                Err(error) => format!("{}: cannot be written ({error})", path.display()),
            });
        }
        match (actions.render, &self.rendering) {
            (true, None) => self.begin_rendering(choices),
            (true, Some(rendering)) => self.say(format!("{} is still being rendered", rendering.path.display())),
            _ => {}
        }
        self.look_after_rendering();
        Ok(())
    }

    /// Of a file that is not there yet.
    fn free_name(&mut self, ending: &str) -> PathBuf {
        loop {
            self.files += 1;
            let path = PathBuf::from(format!("photonmill-{}.{ending}", self.files));
            if !path.exists() {
                return path;
            }
        }
    }

    /// Renders the picture as it is seen now beside the window, on a device of its own.
    fn begin_rendering(&mut self, choices: &Choices) {
        let path = self.free_name("png");
        // Here, as the validation layer's table of devices has no lock (1.3.239).
        let gpu = match Gpu::open(&self.request.options) {
            Ok(gpu) => gpu,
            Err(error) => return self.say(error.to_string()),
        };
        let (request, cancelled) = (self.image_request(choices), Arc::new(AtomicBool::new(false)));
        let scene = match &self.request.viewed {
            ViewedScene::Scene { scene, .. } => Some(scene.clone()),
            ViewedScene::Box => None,
        };
        let thread = std::thread::spawn({
            let (path, cancelled) = (path.clone(), cancelled.clone());
            move || {
                let mut gpus = vec![gpu];
                let observer = Observer { cancelled: &cancelled, ..Observer::default() };
                let written = match scene {
                    Some(scene) => scene.render(&mut gpus, None, &request, &observer).and_then(|image| image.save(&path, &observer)),
                    None => room::render(&mut gpus, &request, &observer).and_then(|image| image.save(&path)),
                };
                (gpus, written)
            }
        });
        self.say(format!("rendering {} ...", path.display()));
        self.said = None;
        self.rendering = Some(Rendering { thread, path, cancelled });
    }

    fn look_after_rendering(&mut self) {
        let Some(rendering) = self.rendering.take_if(|rendering| rendering.thread.is_finished()) else { return };
        let message = rendering.end();
        self.say(message);
    }

    /// A picture that is still being rendered is finished without the window, unless the program is interrupted.
    fn end_rendering(&mut self) {
        let Some(rendering) = self.rendering.take() else { return };
        println!("{} is still being rendered", rendering.path.display());
        while !rendering.thread.is_finished() {
            rendering.cancelled.store(self.request.cancelled.load(Ordering::Relaxed), Ordering::Relaxed);
            std::thread::sleep(FRAME);
        }
        println!("{}", rendering.end());
    }

    /// What the picture as it is seen now is asked for.
    fn image_request(&self, choices: &Choices) -> RenderRequest {
        let request = &self.request.request;
        match &self.request.viewed {
            ViewedScene::Scene { .. } => RenderRequest {
                size: Some(width_and_height(self.status.size)),
                part: part_of(choices.shows),
                exposure: Some(Stops((100.0 * choices.stops).round() / 100.0)),
                ..seen_from(&self.camera, choices.run.of_scene(request))
            },
            ViewedScene::Box => {
                let ends = request.error.is_some() || request.time.is_some();
                choices.run.of_box(request, (!ends).then_some(self.status.rounds))
            }
        }
    }

    fn command(&self, choices: &Choices) -> String {
        let command = if self.status.is_box { "" } else { "render" };
        command_line(command, &self.image_request(choices), &["-o", "picture.png"])
    }
}

/// A picture that is rendered into a file; its devices are closed by the thread that opened them.
struct Rendering {
    thread: JoinHandle<(Vec<Gpu>, Result<()>)>,
    path: PathBuf,
    cancelled: Arc<AtomicBool>,
}

impl Rendering {
    /// What came of it, once it has ended.
    fn end(self) -> String {
        match self.thread.join() {
            Ok((_, Ok(()))) => format!("wrote {}", self.path.display()),
            Ok((_, Err(error))) => spelled(&error.to_string(), as_option),
            Err(_) => "the render failed".to_owned(),
        }
    }
}

fn width_and_height([width, height]: [u32; 2]) -> ImageSize {
    ImageSize::WidthAndHeight(width, height)
}

fn part_of(shows: u32) -> Option<Part> {
    shows.checked_sub(crate::constants::SHOW_DIRECT).and_then(|part| Part::EACH.get(part as usize).copied())
}

/// Nine digits, which distinguish what single precision does.
fn short(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}

/// A request with a camera where this one is.
fn seen_from(moving: &MovingCamera, request: RenderRequest) -> RenderRequest {
    let MovingCamera { camera, pivot } = moving;
    let (fov, orthographic) = match camera.projection {
        Projection::Perspective { vertical_view } => (Some(short(vertical_view.to_degrees())), None),
        Projection::Orthographic { half_height } => (None, Some(short(2.0 * half_height))),
    };
    RenderRequest {
        camera: None,
        eye: Some(camera.eye.map(short)),
        look_at: Some((camera.eye + *pivot * camera.forward).map(short)),
        up: Some(camera.up.map(short)),
        fov,
        orthographic,
        aperture: camera.lens.map(|lens| short(2.0 * lens.radius)),
        focus: camera.lens.map(|lens| short(lens.focus)),
        ..request
    }
}

/// A colour as the window has it.
fn word_of([red, green, blue]: [u8; 3], blue_first: bool) -> u32 {
    let ordered = if blue_first { [blue, green, red, 255] } else { [red, green, blue, 255] };
    u32::from_le_bytes(ordered)
}
