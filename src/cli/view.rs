//! `photonmill view`: a window.

use std::sync::atomic::AtomicBool;

use clap::Args;

use super::camera::CameraArgs;
use super::options::CommonArgs;
use super::progress::{ProgressArgs, ProgressReporter};
use super::scene::{PhotonArgs, SceneArgs, settings};
use super::typed::Typed;
use super::values::{BuilderArg, builder_parser, parse_percent, parse_seconds};
use super::{DeviceArgs, End};
use crate::error::{Error, Result};
use crate::settings::scene::{SceneSettings, Stop};
use crate::settings::{Builder, RoomSettings};
use crate::view::{self, Request, Subject};

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
    scene: SceneArgs,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    light: PhotonArgs,
    /// Builder of the photon maps; all give bit-identical results [default: auto]
    #[arg(long, value_name = "BUILDER", help_heading = "Implementation", value_parser = builder_parser(Builder::ON_GPU, "Persistent for scenes, atomic for the box"))]
    variant: Option<BuilderArg>,
    /// Error at which a picture ends that R renders [default: 2 %, or a time that suits the device]
    #[arg(long, value_name = "PERCENT", value_parser = parse_percent, allow_hyphen_values = true, help_heading = "When to stop")]
    error: Option<f64>,
    /// Time after which it ends: 30s, 5m
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, allow_hyphen_values = true, help_heading = "When to stop")]
    time: Option<f64>,
    #[command(flatten)]
    common: CommonArgs,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// In place of a scene.
const BOX: &str = "box";
/// What the window says anew in the command that makes its picture.
const SAID_ANEW: [&str; 11] =
    ["--camera", "--eye", "--look-at", "--up", "--fov", "--orthographic", "--size", "--aperture", "--focus", "--without", "--variant"];

/// Options that decide how the paper's box is lit here; it has more of them without a window.
const OF_BOX: [&str; 3] = ["--photons", "--seed", "--size"];

/// Refuses what would have no effect.
fn check_box(typed: &Typed) -> Result<()> {
    let words = typed.words();
    let of_scenes = words.iter().filter(|word| word.starts_with("--")).find(|word| !OF_BOX.contains(&option_of(word)));
    let Some(word) = of_scenes else { return Ok(()) };
    let (option, value) = word.split_once('=').unwrap_or((word, "on"));
    let allowed = "is an option of scenes; in a window the paper's box takes --photons, --seed, --size and --variant";
    Err(Error::Setting { option: option.to_owned().leak(), value: value.to_owned(), allowed: allowed.to_owned() })
}

fn option_of(word: &str) -> &str {
    word.split('=').next().unwrap_or_default()
}

pub(super) fn run(args: &ViewArgs, typed: &Typed, cancelled: &AtomicBool) -> Result<End> {
    let reporter = ProgressReporter::new(&args.progress);
    let is_box = args.scene.scene == BOX;
    let builder = args.variant.flatten();
    let stop = Stop { error: args.error, seconds: args.time, ..Stop::default() };
    if is_box {
        check_box(typed)?;
    }
    let (subject, size) = if is_box {
        let usual = RoomSettings::default();
        let settings = RoomSettings { builder: builder.unwrap_or(usual.builder), seed: args.common.seed.unwrap_or(usual.seed), ..usual };
        let photons = args.light.photons.unwrap_or(settings.photons);
        RoomSettings { stop, photons, ..settings.clone() }.validate()?;
        (Subject::Box(Box::new(settings)), args.camera.size_of_box(&reporter)?)
    } else {
        let chosen = args.light.chosen.open()?;
        let settings = SceneSettings { builder, ..settings(&args.light.request(&args.common), None, chosen.as_ref()) };
        SceneSettings { stop, ..settings.clone() }.validate()?;
        args.camera.check()?;
        let scene = args.scene.open(&reporter)?;
        let (camera, resolved) = args.camera.resolve(&scene, &reporter)?;
        let subject = Subject::Scene { scene: Box::new(scene), camera, settings: Box::new(settings) };
        (subject, args.camera.size.map(|_| resolved))
    };
    reporter.finish();
    let is_kept = |word: &String| !SAID_ANEW.contains(&option_of(word));
    let words = typed.words().into_iter().filter(is_kept).filter(|word| !is_box || word != BOX);
    let error = args.error.map(|error| format!("--error={}%", 100.0 * error));
    let time = args.time.map(|seconds| format!("--time={seconds}s"));
    let words = words.chain(error).chain(time);
    let command = if is_box { words.collect() } else { ["render".to_owned()].into_iter().chain(words).collect() };
    view::run(Request { subject, photons: args.light.photons, size, command, options: args.device.options(), cancelled })?;
    Ok(End::Finished)
}
