//! A run that is looked at, until it must begin anew with other settings or another size.

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use egui::Context;
use glam::DVec3;

use super::camera::MovingCamera;
use super::choices::Choices;
use super::events::Events;
use super::live::{Live, Rate};
use super::panel::{self, PHOTON_COLOURS, Requests, Status};
use super::picture::{Exposure, Picture};
use super::{Request, Subject};
use crate::engine::room::live::LiveRoom;
use crate::engine::scene::live::{DotPlace, LiveScene};
use crate::engine::scene::{View, trial};
use crate::error::Result;
use crate::gpu::window::Presenter;
use crate::gpu::{Commands, Gpu};
use crate::output::colour::png_of_codes;
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::scene::geometry::Geometry;
use crate::scene::open_box::open_box;
use crate::scene::{Camera, Lens, Projection};

/// How a run that was looked at ended.
pub enum Next {
    /// `works`: it had begun.
    Anew {
        works: bool,
    },
    Close,
}

/// What stays from run to run.
pub struct Session<'a> {
    gpu: &'a Gpu,
    request: &'a Request<'a>,
    interface: Context,
    status: Status,
    camera: MovingCamera,
    first_camera: MovingCamera,
    /// Nobody has chosen an exposure, and no picture has told one.
    wants_exposure: bool,
    /// What the user is told for a while.
    said: Option<Instant>,
    files: u32,
    child: Option<(Child, PathBuf)>,
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
    pub fn new(gpu: &'a Gpu, request: &'a Request<'a>, interface: Context, title: String) -> Session<'a> {
        let camera = match &request.subject {
            Subject::Scene { scene, camera, .. } => {
                let (min, max) = scene.bounds();
                let ahead = scene.distance_along(camera.eye, camera.forward).filter(|distance| distance.is_finite());
                MovingCamera::new(camera.clone(), ahead.unwrap_or(0.5 * (max - min).length()).max(1e-9))
            }
            Subject::Box(settings) => {
                let room = open_box(settings);
                let middle = 0.5 * (room.min_corner + room.max_corner);
                let half = 0.5 * (room.max_corner - room.min_corner).max_element();
                let eye = middle + half * DVec3::new(0.7, 0.5, 3.2);
                MovingCamera::new(Camera::looking_at("box", eye, middle, DVec3::Y, 0.8), eye.distance(middle))
            }
        };
        let status = Status { title, device: gpu.facts().label(), is_box: matches!(request.subject, Subject::Box(_)), ..Status::default() };
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
            child: None,
        }
    }

    pub fn say(&mut self, message: String) {
        self.status.message = message;
        self.said = Some(Instant::now());
    }

    /// Runs with these choices until they must begin anew.
    pub fn show(&mut self, events: &mut Events, presenter: &mut Presenter, choices: &mut Choices) -> Result<Next> {
        let Some(window) = self.settled_size(events, presenter)? else { return Ok(Next::Close) };
        let size = self.request.size.unwrap_or(window.map(|length| (length / choices.zoom).max(1)));
        let picture = Picture::new(self.gpu, size, window)?;
        self.status.size = size;
        self.status.rounds = 0;
        (self.status.noise, self.status.unseen) = (f64::INFINITY, 0.0);
        self.wait_frame(events, presenter, &picture, choices)?;
        match &self.request.subject {
            Subject::Scene { scene, settings, .. } => {
                let settings = choices.run.of_scene(settings);
                settings.validate()?;
                let geometry = Geometry::new(&scene.without(&settings.without))?;
                let view = View { geometry: &geometry, camera: Some(&self.camera.camera), phases: &[] };
                let sensor = Sensor::Picture { width: size[0], height: size[1] };
                let plan = trial::plan(self.gpu, scene, &view, &settings, sensor)?;
                let live = LiveScene::new(self.gpu, &geometry, &self.camera.camera, &plan, self.request.cancelled)?;
                self.take_plan(&plan, &geometry, choices);
                self.frames(Live::Scene(Box::new(live)), &picture, events, presenter, choices)
            }
            Subject::Box(settings) => {
                let settings = choices.run.of_box(settings);
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
    fn wait_frame(&mut self, events: &mut Events, presenter: &mut Presenter, picture: &Picture, choices: &mut Choices) -> Result<()> {
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
        picture: &Picture,
        choices: &mut Choices,
        is_waiting: bool,
    ) -> Result<(Requests, bool)> {
        events.wait(Duration::ZERO);
        if self.said.is_some_and(|said| said.elapsed() > SAID) {
            self.status.message.clear();
            self.said = None;
        }
        let mut requests = Requests::default();
        let (interface, status, pivot) = (self.interface.clone(), &self.status, self.camera.pivot);
        let input = if is_waiting { events.look_at_input() } else { events.take_input() };
        let mut output = interface.run_ui(input, |ui| {
            requests = panel::show(ui.ctx(), choices, status, pivot);
            if is_waiting {
                egui::Area::new("waiting".into()).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).show(ui.ctx(), |ui| {
                    ui.label(egui::RichText::new("Preparing ...").size(22.0));
                });
            }
        });
        events.obey(&mut output);
        let fits = picture.present(presenter, &interface, output)?;
        Ok((requests, fits))
    }

    fn frames(
        &mut self,
        mut live: Live,
        picture: &Picture,
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
            self.status.command = self.command(choices, None);
            let (requests, fits) = self.interface_frame(events, presenter, picture, choices, false)?;
            if requests.close || events.is_closed() || self.request.cancelled.load(Ordering::Relaxed) {
                self.end_child();
                return Ok(Next::Close);
            }
            self.act(requests, &mut live, picture, presenter, choices)?;
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
    fn zoom(&self, picture: &Picture, choices: &Choices) -> u32 {
        let fits = (picture.window[0] / picture.size[0]).min(picture.window[1] / picture.size[1]).max(1);
        if self.request.size.is_some() { fits } else { choices.zoom }
    }

    fn act(&mut self, requests: Requests, live: &mut Live, picture: &Picture, presenter: &Presenter, choices: &mut Choices) -> Result<()> {
        let back = requests.first_camera && self.camera.camera != self.first_camera.camera;
        if back {
            self.camera = self.first_camera.clone();
        }
        if self.camera.apply(&requests.motion) || back {
            live.look_from(&self.camera.camera)?;
        }
        if requests.usual_exposure {
            choices.stops = live.look()?.stops;
        }
        if requests.screenshot {
            let path = self.free_name("png");
            let codes = picture.codes(live.commands(), presenter.blue_first())?;
            let content = png_of_codes(picture.window[0], picture.window[1], &codes);
            self.say(match std::fs::write(&path, content) {
                Ok(()) => format!("wrote {}", path.display()),
                Err(error) => format!("{}: cannot be written ({error})", path.display()),
            });
        }
        match (requests.render, &self.child) {
            (true, None) => self.begin_render(choices),
            (true, Some((_, path))) => self.say(format!("{} is still being rendered", path.display())),
            _ => {}
        }
        self.look_after_child();
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

    /// Another process of this program renders the picture as it is seen now.
    fn begin_render(&mut self, choices: &Choices) {
        let path = self.free_name("png");
        let words = self.words(choices, Some(&path.display().to_string()));
        let started = std::env::current_exe().and_then(|program| {
            Command::new(program).args(&words).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn()
        });
        match started {
            Ok(child) => {
                self.say(format!("rendering {} ...", path.display()));
                self.said = None;
                self.child = Some((child, path));
            }
            Err(error) => self.say(format!("cannot render: {error}")),
        }
    }

    fn look_after_child(&mut self) {
        let Some((child, path)) = &mut self.child else { return };
        let Ok(Some(status)) = child.try_wait() else { return };
        let message = match status.success() {
            true => format!("wrote {}", path.display()),
            false => {
                let mut text = String::new();
                let _ = child.stderr.take().map(|mut stderr| std::io::Read::read_to_string(&mut stderr, &mut text));
                text.lines().last().unwrap_or("the render failed").to_owned()
            }
        };
        self.child = None;
        self.say(message);
    }

    /// A render that is still under way goes on without the window; its file comes where it was said.
    fn end_child(&mut self) {
        if let Some((_, path)) = self.child.take() {
            println!("{} is still being rendered", path.display());
        }
    }

    /// Of the program, for the picture as it is seen now.
    fn words(&self, choices: &Choices, output: Option<&str>) -> Vec<String> {
        let mut words = self.request.command.clone();
        let mut add = |option: &str, value: String| words.push(format!("{option}={value}"));
        match &self.request.subject {
            Subject::Scene { settings, .. } => {
                for (option, value) in camera_options(&self.camera) {
                    add(option, value);
                }
                add("--size", format!("{}x{}", self.status.size[0], self.status.size[1]));
                choices.run.options(settings).into_iter().for_each(|(option, value)| add(option, value));
                if let Some(part) = part_of(choices.shows) {
                    add("--part", part.to_owned());
                }
                add("--exposure", format!("{:.2}", choices.stops));
            }
            Subject::Box(settings) => {
                let ends = self.request.command.iter().any(|word| word.starts_with("--error=") || word.starts_with("--time="));
                let options = choices.run.options_of_box(settings, (!ends).then_some(self.status.rounds));
                options.into_iter().for_each(|(option, value)| add(option, value));
            }
        }
        words.push("-o".into());
        words.push(output.unwrap_or("picture.png").to_owned());
        words
    }

    fn command(&self, choices: &Choices, output: Option<&str>) -> String {
        let words = self.words(choices, output);
        ["photonmill".to_owned()].into_iter().chain(words.into_iter().map(crate::text::quoted)).collect::<Vec<_>>().join(" ")
    }
}

fn part_of(shows: u32) -> Option<&'static str> {
    let parts = ["direct", "specular", "caustic", "indirect"];
    shows.checked_sub(crate::constants::SHOW_DIRECT).and_then(|part| parts.get(part as usize).copied())
}

/// Nine digits, which tell apart what single precision does.
fn short(value: f64) -> String {
    format!("{value:.8e}").parse().map_or_else(|_| value.to_string(), |rounded: f64| rounded.to_string())
}

/// Options that put a camera where this one is.
fn camera_options(moving: &MovingCamera) -> Vec<(&'static str, String)> {
    let MovingCamera { camera, pivot } = moving;
    let point = |point: DVec3| point.to_array().map(short).join(",");
    let target = camera.eye + *pivot * camera.forward;
    let mut options = vec![("--eye", point(camera.eye)), ("--look-at", point(target)), ("--up", point(camera.up))];
    match camera.projection {
        Projection::Perspective { vertical_view } => options.push(("--fov", short(vertical_view.to_degrees()))),
        Projection::Orthographic { half_height } => options.push(("--orthographic", short(2.0 * half_height))),
    }
    if let Some(Lens { radius, focus }) = camera.lens {
        options.extend([("--aperture", short(2.0 * radius)), ("--focus", short(focus))]);
    }
    options
}

/// A colour as the window has it.
fn word_of([red, green, blue]: [u8; 3], blue_first: bool) -> u32 {
    let ordered = if blue_first { [blue, green, red, 255] } else { [red, green, blue, 255] };
    u32::from_le_bytes(ordered)
}
