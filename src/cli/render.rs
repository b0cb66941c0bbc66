//! `photonmill render`: what a camera sees of a scene.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;

use super::display::{DisplayArgs, EVERY};
use super::options::{DevicesOfRunArgs, ReportArgs};
use super::progress::{MessageArgs, ProgressReporter};
use super::request::{RENDER, RequestArgs};
use super::values::{parse_integer, parse_photon_name};
use super::{End, complain, optional_file, say, say_beside};
use crate::engine;
use crate::engine::replay::PhotonName;
use crate::engine::saved::{SavedFilm, SavedRun};
use crate::engine::scene::replay;
use crate::engine::watch::Later;
use crate::error::{Result, require};
use crate::output::colour::Format;
use crate::output::destination::{Destination, check_distinct, write_all};
use crate::output::scene_report;
use crate::output::show::{Layer, Show};
use crate::render::checkpoints::Checkpoints;
use crate::render::image::{check_format, show};
use crate::render::{Event, Image, Inputs, Observer, Receivers, Seconds, prepare};
use crate::settings::scene::{Filter, Part, SceneSettings};
use crate::verify::judge::{Judge, Verdict};

#[derive(Args)]
pub(super) struct RenderArgs {
    /// Picture: an .exr holds linear radiance in W/m2/sr, a .png is sRGB, for the eye
    #[arg(short, long, alias = "out", value_name = "FILE", required_unless_present_any = ["replay", "shard", "save_settings"], help_heading = "Output")]
    output: Option<PathBuf>,
    /// Also write the picture so far at this interval: 10s, 5m
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, requires = "output", help_heading = "Output")]
    snapshot: Option<Seconds>,
    #[command(flatten)]
    display: DisplayArgs,
    #[command(flatten)]
    report: ReportArgs,
    /// Write the standard error of each pixel as an .exr, W/m2/sr; infinite where unknown: before eight blocks of rounds are
    /// whole, or where no light has reached the pixel though some may
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    error_image: Option<PathBuf>,
    #[command(flatten)]
    pub(super) request: RequestArgs<RENDER>,
    /// Also path trace the picture on the CPU, and print whether the two agree within their errors; `--judge` alone takes 64
    /// samples per pixel
    #[arg(long, value_name = "SAMPLES", value_parser = parse_integer::<u32>, allow_negative_numbers = true, num_args = 0..=1, default_missing_value = "64", help_heading = "Checks")]
    judge: Option<u32>,
    /// Trace a single photon of this run, print its path, and exit; rounds and photons count from 0, and `:caustic` at the
    /// end takes a photon of the caustic map
    #[arg(long, value_name = "ROUND:PHOTON", value_parser = parse_photon_name, help_heading = "Checks",
        conflicts_with_all = ["output", "display", "error_image", "exposure", "tone", "layers", "denoise", "judge", "explain", "json", "trace", "save_settings", "time_dispatches", "map", "devices"])]
    replay: Option<PhotonName>,
    #[command(flatten)]
    messages: MessageArgs,
    #[command(flatten)]
    device: DevicesOfRunArgs,
}

/// Between two pictures of a run of which nothing says when it ends.
const SNAPSHOT: Seconds = Seconds(5.0);

pub(super) fn run(args: &RenderArgs, cancelled: &AtomicBool) -> Result<End> {
    let request = &args.request.0;
    let mut inputs = Inputs::open(request)?;
    let reporter = ProgressReporter::explaining(&args.messages);
    let tell = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, tell: &tell };
    if let Some(name) = args.replay {
        return show_photon(args, inputs, name, &observer, &reporter);
    }
    let output = args.output.as_ref();
    let format = output.map(|output| Format::of("-o", output)).transpose()?;
    check_format(request, output.map(PathBuf::as_path))?;
    args.check_judge(&inputs.settings, request.has_no_end())?;
    let picture = optional_file("-o", output)?;
    let errors = optional_file("--error-image", args.error_image.as_ref())?;
    if let Some(path) = &args.error_image {
        require(Format::of("--error-image", path)? == Format::Exr, "--error-image", path.display(), "must end in .exr")?;
    }
    let reports = args.report.open()?;
    let mut checkpoints = Checkpoints::open(request, &observer)?;
    let shows_parts = format == Some(Format::Exr) && show(request, (0, 0)).layers.into_iter().any(Layer::is_part);
    inputs = inputs.for_image(shows_parts || args.display.is_given(), checkpoints.resumed())?;
    let files = [picture.clone(), errors.clone(), inputs.save_settings.clone()].into_iter().flatten().collect();
    let all: Vec<Destination> = [files, reports.destinations(), checkpoints.destinations()].concat();
    check_distinct(&all)?;
    checkpoints.check_not_read(&all, request.inputs())?;

    let mut prepared = prepare(inputs, Receivers::Image(None), &observer)?;
    let show = show(request, prepared.size());
    // A viewer shows nothing of surfaces.
    let live = Show { layers: Layer::ALL.into_iter().filter(|layer| !layer.is_of_surface()).collect(), ..show.clone() };
    let name = output.map_or_else(String::new, |output| output.display().to_string());
    let mut viewer = args.display.connect(name, live.size)?;
    let mut gpus = args.device.open(&reporter)?;
    prepared.inputs = prepared.inputs.ended(gpus[0].facts().kind);
    let mut snapshot = |run: &SavedRun| match (&run.film, &picture, format) {
        (SavedFilm::Scene(film), Some(picture), Some(format)) => write_all([(picture.clone(), show.so_far(film, format))]),
        _ => Ok(()),
    };
    if let Some(Seconds(seconds)) = args.snapshot.or(request.has_no_end().then_some(SNAPSHOT)) {
        require((0.001..=1e6).contains(&seconds), "--snapshot", seconds, "must be from 1ms to 1000000s")?;
        checkpoints.set_snapshot(Duration::from_secs_f64(seconds), &mut snapshot);
    }
    let mut send = |run: Later<Arc<SavedRun>>| {
        let Some(viewer) = &mut viewer else { return Ok(()) };
        let live = live.clone();
        viewer.show(Box::new(move || match &run().film {
            SavedFilm::Scene(film) => live.channels(film, &[]),
            SavedFilm::Room(_) => unreachable!("a scene is lit"),
        }))
    };
    if args.display.is_given() {
        checkpoints.set_display(EVERY, &mut send);
    }
    if picture.is_none() && request.shard.is_none() {
        prepared.tune(&mut gpus[0], &observer)?;
        return Ok(End::Finished);
    }
    let image = prepared.image(&mut gpus, &mut checkpoints, &observer)?;
    let kept = checkpoints.finish();
    if let Some(viewer) = viewer
        && let Err(error) = viewer.finish(live.channels(&image.run.film, &[]))
    {
        complain(&format!("warning: {error}"));
    }

    let run = &image.run.result;
    if run.film.sums.iter().all(|sum| *sum == 0) {
        complain(
            "warning: the picture is black: the camera sees nothing that is lit; is it outside of the scene, behind a wall, or does it look away?",
        );
    }
    let scene = &image.scene.name;
    let text = scene_report::text(scene, run, prepared.point, args.messages.explains());
    let mut files = Vec::new();
    let mut shown = String::new();
    if let (Some(picture), Some(format), Some(output)) = (&picture, format, output) {
        let asked = &prepared.inputs.settings;
        if let Some(reason) = image.missing_parts(asked).filter(|_| shows_parts) {
            let layers = "has no layers of the parts of its light, which this run does not keep apart";
            complain(&format!("warning: -o {}: {layers}: {reason}", output.display()));
        }
        let (bytes, how) = image.file(request, format, &observer);
        files.push((picture.clone(), bytes));
        shown = format!("\nwrote {}{how}", output.display());
    }
    files.extend(errors.map(|errors| (errors, show.errors(&run.film))));
    files.extend(reports.files(run, || scene_report::json(scene, run)));
    let written = write_all(files);
    reporter.finish();
    if let Err(error) = written {
        return say_beside(&all, &text).and(Err(error));
    }
    say_beside(&all, &format!("{text}{shown}"))?;
    if let Some(samples) = args.judge {
        // The picture is there, so Ctrl-C may end the program here.
        let reporter = ProgressReporter::new(&args.messages.progress);
        reporter.step(&format!("path tracing {samples} samples per pixel on the CPU for --judge"));
        let verdict = verdict(&image, samples);
        reporter.finish();
        say_beside(&all, &format!("judge: {verdict}"))?;
    }
    kept?;
    Ok(End::of(run))
}

impl RenderArgs {
    fn check_judge(&self, settings: &SceneSettings, has_no_end: bool) -> Result<()> {
        let Some(samples) = self.judge else { return Ok(()) };
        let range = format!("must be from 2 to {MAX_JUDGE_SAMPLES} samples per pixel");
        require((2..=MAX_JUDGE_SAMPLES).contains(&samples), "--judge", samples, range)?;
        let block = settings.rounds_per_block(true);
        let is_known = settings.filter == Filter::Box && (settings.rounds >= 2 * block || has_no_end);
        let needs = format!("needs --filter box, and {} rounds or more, which are two blocks, to know the error", 2 * block);
        require(is_known, "--judge", samples, needs)
    }
}

/// The path of one photon of the run that these options ask for.
fn show_photon(args: &RenderArgs, inputs: Inputs, name: PhotonName, observer: &Observer, reporter: &ProgressReporter) -> Result<End> {
    let prepared = prepare(inputs, Receivers::Image(None), observer)?;
    let gpu = args.device.one.open(reporter)?;
    // A photon's path does not depend on the radius.
    let plan = prepared.plan_within(&engine::limits(gpu.facts()))?;
    let path = replay::replay(&gpu, &prepared.geometry, &plan, name)?;
    reporter.finish();
    say(&path.table(&prepared.geometry, &plan))?;
    Ok(End::Finished)
}

const MAX_JUDGE_SAMPLES: u32 = 1 << 24;

/// How the picture compares with a path tracer's.
fn verdict(image: &Image, samples: u32) -> Verdict {
    let film = &image.run.film;
    let settings = &image.run.plan.settings;
    let part = Some(settings.part).filter(|part| *part != Part::All);
    // Of the same scene, without what was left out, and with other random numbers than the photons'.
    let scene = image.scene.without(&settings.without);
    let (width, height) = image.size;
    let judged = Judge::new(&scene, settings.bounces).image(&image.camera, width, height, samples, !settings.seed);
    let means: Vec<_> = film.means().collect();
    let errors: Vec<_> = (0..film.pixels()).map(|pixel| film.standard_error(pixel)).collect();
    Verdict::new(&means, &errors, film.blocks.min(samples), &judged, part)
}
