//! `photonmill render`: what a camera sees of a scene.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::run::{number, whole};
use super::transport::{FilterArg, Job, PartArg, ReportArgs, SceneArgs, TransportArgs, camera, geometry, light, photon_name, plan, size};
use super::{DeviceArgs, End, say};
use crate::error::{Error, Result};
use crate::judge::{self, Judge, Verdict};
use crate::output::colour::ColourPicture;
use crate::output::destination::{Destination, check_distinct, write_all};
use crate::output::image::Format;
use crate::output::light_report;
use crate::plan::transport::{Sensor, TransportPlan};
use crate::render::limits;
use crate::scene::{Camera, Scene};
use crate::settings::transport::{Filter, Part, TransportSettings};
use crate::transport::Lit;
use crate::transport::replay::{self, PhotonName};

#[derive(Args)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Picture: an .exr of linear radiance, W/m2/sr, or a .png for the eye
    #[arg(short, long, value_name = "FILE", required_unless_present = "replay", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Standard error of each pixel, an .exr in the same unit; infinite where unknown: after a single round, or where no light
    /// has reached the pixel though some may
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    error_image: Option<PathBuf>,
    /// Brightness of a PNG in stops: each doubles it [default: so that the picture's mean is a middle
    /// grey]
    #[arg(long, value_name = "STOPS", value_parser = number::<f32>, allow_negative_numbers = true, help_heading = "Output")]
    exposure: Option<f32>,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", value_parser = size, allow_hyphen_values = true, default_value = "640x480", help_heading = "Scene")]
    size: (u32, u32),
    /// Hold the picture against a path tracer on the CPU of so many samples a pixel (64), and say whether they
    /// agree within their errors
    #[arg(long, value_name = "SAMPLES", value_parser = whole::<u32>, allow_negative_numbers = true, num_args = 0..=1, default_missing_value = "64", help_heading = "Output")]
    judge: Option<u32>,
    /// Trace one photon of the run by itself, print its path and end: round and number from 0, `:caustic` for one of
    /// the caustic map
    #[arg(long, value_name = "ROUND:PHOTON", value_parser = photon_name, help_heading = "Output",
        conflicts_with_all = ["output", "error_image", "exposure", "judge", "explain", "json", "trace", "time_dispatches"])]
    replay: Option<PhotonName>,
    /// Camera by name [default: the first; one that sees everything if there is none]
    #[arg(long, value_name = "NAME", help_heading = "Scene")]
    camera: Option<String>,
    /// Only this part of the light; the four add up to the whole to the bit
    #[arg(long, value_enum, help_heading = "Transport")]
    part: Option<PartArg>,
    /// Paths from the camera through each pixel, each round, a power of two: even strata of the pixel, of the lamps and of what
    /// glass mirrors. All look caustics up, and what they see in mirrors and glass; one looks up the global map for all
    /// [default: 1]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Transport")]
    samples: Option<u32>,
    /// How a pixel weighs the picture around its centre [default: box]
    #[arg(long, value_enum, help_heading = "Estimate")]
    filter: Option<FilterArg>,
    #[command(flatten)]
    transport: TransportArgs,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

impl RenderArgs {
    pub(super) fn settings(&self) -> TransportSettings {
        let usual = self.transport.settings();
        TransportSettings {
            part: self.part.map_or(usual.part, Part::from),
            filter: self.filter.map_or(usual.filter, Filter::from),
            samples: self.samples.unwrap_or(usual.samples),
            ..usual
        }
    }
}

pub(super) fn run(args: &RenderArgs, cancelled: &AtomicBool) -> Result<End> {
    let settings = args.settings();
    settings.validate()?;
    if let Some(name) = args.replay {
        return show_photon(args, &settings, name);
    }
    let output = args.output.as_ref().expect("clap asks for it");
    let format = Format::of("-o", output)?;
    if let Some(samples) = args.judge {
        if !(2..=MAX_JUDGE_SAMPLES).contains(&samples) {
            return Err(Error::setting("--judge", samples, format!("must be from 2 to {MAX_JUDGE_SAMPLES} samples a pixel")));
        }
        if settings.filter != Filter::Box || settings.rounds < 2 {
            return Err(Error::setting("--judge", samples, "needs --filter box and two rounds or more, whose spread is the error"));
        }
    }
    if let (Format::Exr, Some(exposure)) = (format, args.exposure) {
        return Err(Error::setting("--exposure", exposure, "is for PNG only: an EXR holds radiance untouched"));
    }
    if let Some(exposure) = args.exposure.filter(|stops| stops.is_nan() || stops.abs() > 64.0) {
        return Err(Error::setting("--exposure", exposure, "must be from -64 to 64 stops"));
    }
    let picture = Destination::open("-o", output)?;
    let errors = args.error_image.as_ref().map(|path| Destination::open("--error-image", path)).transpose()?;
    if let Some(path) = &args.error_image
        && Format::of("--error-image", path)? != Format::Exr
    {
        return Err(Error::setting("--error-image", path.display(), "must end in .exr"));
    }
    let reports = args.report.open()?;
    let all: Vec<Destination> = [vec![picture.clone()], errors.clone().into_iter().collect(), reports.destinations()].concat();
    check_distinct(&all)?;

    let scene = args.scene.open()?;
    let camera = camera(&scene, args.camera.as_deref())?;
    let (width, height) = args.size;
    let job = Job { scene: &scene, settings: &settings, sensor: Sensor::Picture { width, height }, camera: Some(&camera), phases: &[] };
    let geometry = geometry(&scene, &settings)?;
    let gpu = args.report.device(&args.device)?;
    let plan = plan(&gpu, &job, &geometry)?;
    let lit = light(&gpu, &job, &geometry, plan, (args.report.progress, args.transport.stop.bias), cancelled)?;

    let image = radiance(&lit, width, height);
    let stops = args.exposure.unwrap_or_else(|| image.usual_exposure());
    let text = light_report::text(&scene.name, &lit, reports.explain);
    let mut files = vec![(picture, image.encode(format, stops))];
    if let Some(errors) = errors {
        files.push((errors, standard_error(&lit, width, height).encode(Format::Exr, 0.0)));
    }
    files.extend(reports.files(&scene, &lit));
    write_all(files)?;
    let shown = match format {
        Format::Png => format!(" at {stops:+.2} stops"),
        Format::Exr => String::new(),
    };
    say(&format!("{text}\nwrote {}{shown}", output.display()))?;
    if let Some(samples) = args.judge {
        // The picture is there; who has seen enough may end the program.
        say(&format!("judge: {}", verdict(&lit, &scene, &camera, (width, height), samples)))?;
    }
    Ok(End::of(&lit))
}

/// The path of one photon of the run that these options ask for.
fn show_photon(args: &RenderArgs, settings: &TransportSettings, name: PhotonName) -> Result<End> {
    let scene = args.scene.open()?;
    let (width, height) = args.size;
    let geometry = geometry(&scene, settings)?;
    let gpu = args.report.device(&args.device)?;
    // No photon's path knows of a radius.
    let plan = TransportPlan::new(&scene, &geometry, settings, Sensor::Picture { width, height }, &limits(gpu.facts()))?;
    let path = replay::replay(&gpu, &geometry, &plan, name)?;
    say(&path.table(&geometry, &plan))?;
    Ok(End::Finished)
}

const MAX_JUDGE_SAMPLES: u32 = 1 << 24;

/// How the picture compares with a path tracer's.
fn verdict(lit: &Lit, scene: &Scene, camera: &Camera, (width, height): (u32, u32), samples: u32) -> Verdict {
    let settings = &lit.plan.settings;
    let part = match settings.part {
        Part::All => None,
        Part::Direct => Some(judge::Part::Direct),
        Part::Specular => Some(judge::Part::Specular),
        Part::Caustic => Some(judge::Part::Caustic),
        Part::Indirect => Some(judge::Part::Indirect),
    };
    // Of the same scene, without what was left out, and with other random numbers than the photons'.
    let scene = scene.without(&settings.without);
    let judged = Judge::new(&scene, settings.bounces).image(camera, width, height, samples, !settings.seed);
    let means: Vec<_> = (0..lit.film.pixels()).map(|pixel| lit.film.mean(pixel, &lit.plan)).collect();
    let errors: Vec<_> = (0..lit.film.pixels()).map(|pixel| lit.film.standard_error(pixel, &lit.plan)).collect();
    Verdict::new(&means, &errors, lit.film.rounds.min(samples), &judged, part)
}

/// W/m2/sr.
fn radiance(lit: &Lit, width: u32, height: u32) -> ColourPicture {
    let pixels = (0..lit.film.pixels()).map(|pixel| lit.film.mean(pixel, &lit.plan).as_vec3()).collect();
    ColourPicture { width, height, pixels }
}

fn standard_error(lit: &Lit, width: u32, height: u32) -> ColourPicture {
    let pixels = (0..lit.film.pixels()).map(|pixel| lit.film.stated_error(pixel, &lit.plan).as_vec3()).collect();
    ColourPicture { width, height, pixels }
}
