//! `photonmill view`: a window.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;
use glam::DVec3;

use super::progress::{ProgressArgs, ProgressReporter};
use super::request::{RequestArgs, VIEW};
use super::{DeviceArgs, End};
use crate::error::{Error, Result};
use crate::render::options::ROWS;
use crate::render::viewpoint::size_of;
use crate::render::{Event, Inputs, Observer, Percent, PreparedScene, RenderRequest, Seconds};
use crate::scene::Camera;
use crate::settings::RoomSettings;
use crate::settings::scene::{SceneSettings, Stop};
use crate::window::{self, ViewedScene, WindowRequest};

pub(super) const HELP: &str = "\
Examples:
  photonmill view scene.glb
      A window: drag to look around, wheel to come nearer, W A S D to fly
  photonmill view cornell-spheres --size 640x480 --photons 65536
      A built-in scene, with a picture of this size
  photonmill view box
      The paper's box, round by round";

#[derive(Args)]
pub(super) struct ViewArgs {
    #[command(flatten)]
    request: RequestArgs<VIEW>,
    /// Error at which a picture ends that R renders [default: 2 %, or a time that suits the device]
    #[arg(long, value_name = "PERCENT", allow_hyphen_values = true, help_heading = "When to stop")]
    error: Option<Percent>,
    /// Time after which it ends: 30s, 5m
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, help_heading = "When to stop")]
    time: Option<Seconds>,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// In place of a scene.
const BOX: &str = "box";
/// Fields of the paper's box here; it has more of them without a window.
const OF_BOX: [&str; 4] = ["photons", "seed", "size", "variant"];

/// Refuses what would have no effect.
fn check_box(request: &RenderRequest) -> Result<()> {
    let given = ROWS.iter().filter(|row| !OF_BOX.contains(&row.field)).find_map(|row| Some((row, row.text(request)?)));
    let allowed = "is an option of scenes; in a window the paper's box takes --photons, --seed, --size and --variant";
    given.map_or(Ok(()), |(row, value)| Err(Error::setting(row.field, value, allowed)))
}

pub(super) fn run(args: &ViewArgs, cancelled: &AtomicBool) -> Result<End> {
    let request = &args.request.0;
    let reporter = ProgressReporter::new(&args.progress);
    let report = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, report: &report };
    let is_box = request.scene == BOX;
    let (error, seconds) = (args.error.map(Percent::share), args.time.map(|Seconds(seconds)| seconds));
    let stop = Stop { error, seconds, ..Stop::default() };
    let (viewed, size) = if is_box {
        check_box(request)?;
        let settings = request.room_settings();
        RoomSettings { stop, ..settings }.validate()?;
        // Its camera is none of a scene.
        let camera = Camera::looking_at("box", DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0);
        let size = request.size.map(|_| size_of(request.size, &camera, &observer)).transpose()?;
        (ViewedScene::Box, size.map(<[u32; 2]>::from))
    } else {
        request.check_camera()?;
        let settings = Inputs::open(request)?.settings;
        SceneSettings { stop, ..settings }.validate()?;
        let scene = Arc::new(PreparedScene::read(request, &observer)?);
        let (camera, size) = request.viewpoint(&scene.scene, None, &observer)?;
        (ViewedScene::Scene { scene, camera }, request.size.map(|_| size))
    };
    reporter.finish();
    let scene = if is_box { String::new() } else { request.scene.clone() };
    let request = RenderRequest { scene, error: args.error, time: args.time, size: None, ..request.clone() };
    window::run(WindowRequest { viewed, request, size, options: args.device.options(), cancelled })?;
    Ok(End::Finished)
}
