//! `photonmill view`: a window in which a picture is refined while one looks, flies through the scene and changes settings. Rounds
//! are the engine's own, and what is shown never leaves the device.

mod camera;
mod choices;
pub(crate) mod display;
mod events;
mod live;
mod panel;
mod session;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::error::{Error, Result};
use crate::gpu::window::Presenter;
use crate::gpu::{Gpu, Options};
use crate::render::{PreparedScene, RenderRequest};
use crate::scene::Camera;
use choices::{Choices, RunChoices};
use events::Events;

use session::{Next, Session};

/// What is looked at: by a camera of its own, or the paper's box.
pub(crate) enum ViewedScene {
    Scene { scene: Arc<PreparedScene>, camera: Camera },
    Box,
}

/// What `photonmill view` is asked for.
pub(crate) struct WindowRequest<'a> {
    pub viewed: ViewedScene,
    /// What the picture in a file is asked for, but for its camera and what the user of the window chooses.
    pub request: RenderRequest,
    /// Of the picture; `None` for what suits the window and the device.
    pub size: Option<[u32; 2]>,
    pub options: Options,
    pub cancelled: &'a AtomicBool,
}

/// Pixels of a window that nobody has given another size, and its width over height where the camera does not say.
const WINDOW_HEIGHT: u32 = 768;
const USUAL_ASPECT: f64 = 4.0 / 3.0;
/// In a narrower window the panel would hide the picture: it opens by its key.
const PANEL_WINDOW: u32 = 600;
/// Along each side of a pixel of the picture, where a CPU computes it.
const ZOOM_OF_CPU: u32 = 4;

/// Shows a window until it is closed.
pub(crate) fn run(request: WindowRequest) -> Result<()> {
    let interface = egui::Context::default();
    let name = match &request.viewed {
        ViewedScene::Scene { scene, .. } => scene.scene.name.clone(),
        ViewedScene::Box => "the paper's box".to_owned(),
    };
    let aspect = match &request.viewed {
        ViewedScene::Scene { camera, .. } => camera.aspect.unwrap_or(USUAL_ASPECT).clamp(0.5, 2.0),
        ViewedScene::Box => USUAL_ASPECT,
    };
    let usual = [(aspect * f64::from(WINDOW_HEIGHT)) as u32, WINDOW_HEIGHT];
    // A small picture is shown with large pixels.
    let window = request.size.map_or(usual, |[width, height]| {
        let zoom = (WINDOW_HEIGHT / height.max(width)).max(1);
        [width * zoom, height * zoom]
    });
    let mut events = Events::open(&format!("{name} - photonmill"), window, &interface)?;
    let gpu = Gpu::open_in(&request.options, Some(events.window()))?;
    // The box costs what its walls do, whoever looks.
    let is_slow = gpu.facts().kind == "cpu" && matches!(request.viewed, ViewedScene::Scene { .. });
    let zoom = if is_slow && request.size.is_none() { ZOOM_OF_CPU } else { 1 };
    let mut presenter = Presenter::new(&gpu)?;
    let run = RunChoices::of(&request, gpu.facts().kind);
    let mut choices =
        Choices { shows: crate::constants::SHOW_ALL, stops: 0.0, has_photons: false, is_open: window[0] >= PANEL_WINDOW, zoom, run };
    let mut session = Session::new(&gpu, &request, interface, name);
    // What worked last, where a change does not.
    let mut last: Option<Choices> = None;
    loop {
        match session.show(&mut events, &mut presenter, &mut choices) {
            Ok(Next::Anew { works }) => last = works.then(|| choices.clone()).or(last),
            Ok(Next::Close) => return gpu.check_validation(),
            Err(Error::Interrupted) => return Ok(()),
            Err(error) => match last.take() {
                Some(before) => {
                    session.say(error.to_string());
                    choices = before;
                }
                None => return Err(error),
            },
        }
    }
}
