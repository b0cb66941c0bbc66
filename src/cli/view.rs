//! `photonmill view`: a window.

use std::sync::atomic::AtomicBool;

use clap::Args;
use glam::DVec3;

use super::progress::{ProgressArgs, ProgressReporter};
use super::request::{RequestArgs, VIEW};
use super::values::{parse_percent, parse_seconds};
use super::{DeviceArgs, End};
use crate::error::{Error, Result};
use crate::render::image::kept;
use crate::render::options::ROWS;
use crate::render::values::Variant;
use crate::render::viewpoint::size_of;
use crate::render::{Event, Inputs, Observer, Percent, PreparedScene, RenderRequest, Seconds};
use crate::scene::{Camera, Scene};
use crate::settings::RoomSettings;
use crate::settings::scene::{SceneSettings, Stop};
use crate::view::{self, Request, Subject};

#[derive(Args)]
pub(super) struct ViewArgs {
    #[command(flatten)]
    request: RequestArgs<VIEW>,
    /// Error at which a picture ends that R renders [default: 2 %, or a time that suits the device]
    #[arg(long, value_name = "PERCENT", value_parser = parse_percent, allow_hyphen_values = true, help_heading = "When to stop")]
    error: Option<Percent>,
    /// Time after which it ends: 30s, 5m
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, allow_hyphen_values = true, help_heading = "When to stop")]
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
    let tell = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, tell: &tell };
    let is_box = request.scene == BOX;
    let (error, seconds) = (args.error.map(Percent::share), args.time.map(|Seconds(seconds)| seconds));
    let stop = Stop { error, seconds, ..Stop::default() };
    let (subject, size) = if is_box {
        check_box(request)?;
        let usual = RoomSettings::default();
        let settings = RoomSettings {
            builder: request.variant.and_then(Variant::builder).unwrap_or(usual.builder),
            seed: request.seed.unwrap_or(usual.seed),
            ..usual
        };
        let photons = request.photons.unwrap_or(settings.photons);
        RoomSettings { stop, photons, ..settings.clone() }.validate()?;
        // Its camera is none of a scene.
        let camera = Camera::looking_at("box", DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0);
        let size = request.size.map(|_| size_of(request.size, &camera, &observer)).transpose()?;
        (Subject::Box(Box::new(settings)), size.map(<[u32; 2]>::from))
    } else {
        let inputs = Inputs::open(request)?;
        let settings = inputs.settings.clone();
        SceneSettings { stop, ..settings.clone() }.validate()?;
        let scene = PreparedScene::read(request, &observer)?;
        let (camera, size) = request.viewpoint(&scene.scene, None, &observer)?;
        let scene = Box::new(Scene::clone(&scene.scene));
        (Subject::Scene { scene, camera, settings: Box::new(settings) }, request.size.map(|_| size))
    };
    reporter.finish();
    // What the window says anew is left out.
    let kept = RenderRequest {
        camera: None,
        eye: None,
        look_at: None,
        up: None,
        fov: None,
        orthographic: None,
        size: None,
        aperture: None,
        focus: None,
        without: Vec::new(),
        ..kept(request)
    };
    let words = if is_box { kept.words().split_off(1) } else { [vec!["render".to_owned()], kept.words()].concat() };
    let error = args.error.map(|error| format!("--error={error}"));
    let time = args.time.map(|time| format!("--time={time}"));
    let command = words.into_iter().chain(error).chain(time).collect();
    view::run(Request { subject, photons: request.photons, size, command, options: args.device.options(), cancelled })?;
    Ok(End::Finished)
}
