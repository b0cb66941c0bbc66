//! `photonmill render`: what a camera sees of a scene.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;

use super::display::{DisplayArgs, EVERY};
use super::options::{DevicesOfRunArgs, ReportArgs, Reports};
use super::progress::{MessageArgs, ProgressReporter};
use super::request::{RENDER, RequestArgs};
use super::values::{parse_integer, parse_photon_name};
use super::{End, complain, optional_file, say, say_beside, say_written};
use crate::engine;
use crate::engine::replay::PhotonName;
use crate::engine::run::saved::{SavedRun, WorldFilm};
use crate::engine::scene::{SceneFilm, replay};
use crate::error::{Result, require};
use crate::output::colour::Format;
use crate::output::destination::{Destination, check_distinct, write_all};
use crate::output::scene_report;
use crate::output::show::{Layer, Show};
use crate::render::checkpoints::Checkpoints;
use crate::render::image::{check_format, show};
use crate::render::{Event, Image, Inputs, Observer, RequestedReceivers, Seconds, prepare};
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
        conflicts_with_all = ["output", "display", "error_image", "exposure", "tone", "white_balance", "layers", "denoise", "judge", "explain", "json", "trace", "save_settings", "time_dispatches", "map", "devices"])]
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
    let inputs = Inputs::open(request)?;
    let reporter = ProgressReporter::explaining(&args.messages);
    let report = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, report: &report };
    if let Some(name) = args.replay {
        return show_photon(args, inputs, name, &observer, &reporter);
    }
    let mut outputs = Outputs::open(args, &inputs)?;
    let mut checkpoints = Checkpoints::open(request, &observer)?;
    let inputs = inputs.for_image(outputs.shows_parts || args.display.is_given(), checkpoints.resumed())?;
    outputs.all.extend(checkpoints.destinations());
    check_distinct(&outputs.all)?;
    checkpoints.check_not_read(&outputs.all, request.inputs())?;

    let mut prepared = prepare(inputs, RequestedReceivers::Image(None), &observer)?;
    let show = show(request, prepared.size());
    let mut display = args.display.connect(args.output.as_deref(), &show)?;
    let mut gpus = args.device.open(&reporter)?;
    prepared.inputs = prepared.inputs.ended(gpus[0].facts().kind);
    let mut write = |run: &SavedRun| outputs.write_so_far(&show, run);
    if let Some(Seconds(every)) = args.snapshot.or(request.has_no_end().then_some(SNAPSHOT)) {
        require((0.001..=1e6).contains(&every), "--snapshot", every, "must be from 1ms to 1000000s")?;
        checkpoints.set_snapshot(Duration::from_secs_f64(every), &mut write);
    }
    let mut send = |run| display.as_mut().map_or(Ok(()), |display| display.send(run));
    if args.display.is_given() {
        checkpoints.set_display(EVERY, &mut send);
    }
    if outputs.picture.is_none() && request.shard.is_none() {
        prepared.tune(&mut gpus[0], &observer)?;
        return Ok(End::Finished);
    }
    let image = prepared.image(&mut gpus, &mut checkpoints, &observer)?;
    let kept = checkpoints.finish();
    display.into_iter().for_each(|display| display.finish(&image.run.film));

    let (files, wrote) = outputs.files(&image, &prepared.inputs.settings, &observer);
    let written = write_all(files);
    reporter.finish();
    let text = scene_report::text(&image.scene.name, &image.run, prepared.point, args.messages.explains());
    say_written(&outputs.all, &text, written.map(|()| wrote))?;
    if let Some(samples) = args.judge {
        // The picture is there, so Ctrl-C may end the program here.
        let reporter = ProgressReporter::new(&args.messages.progress);
        reporter.step(&format!("path tracing {samples} samples per pixel on the CPU for --judge"));
        let verdict = verdict(&image, samples);
        reporter.finish();
        say_beside(&outputs.all, &format!("judge: {verdict}"))?;
    }
    kept?;
    Ok(End::of(&image.run))
}

/// Everything that the run will write, checked before it starts.
struct Outputs {
    picture: Option<(Destination, Format)>,
    /// Whether the picture has layers of the parts of its light.
    shows_parts: bool,
    errors: Option<Destination>,
    reports: Reports,
    all: Vec<Destination>,
}

impl Outputs {
    fn open(args: &RenderArgs, inputs: &Inputs) -> Result<Outputs> {
        let request = &args.request.0;
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
        let files = [&picture, &errors, &inputs.save_settings].into_iter().flatten().cloned();
        let all = files.chain(reports.destinations()).collect();
        let shows_parts = format == Some(Format::Exr) && show(request, (0, 0)).layers.into_iter().any(Layer::is_part);
        Ok(Outputs { picture: picture.zip(format), shows_parts, errors, reports, all })
    }

    /// The picture of a run that is under way.
    fn write_so_far(&self, show: &Show, run: &SavedRun) -> Result<()> {
        let Some((picture, format)) = &self.picture else { return Ok(()) };
        write_all([(picture.clone(), show.so_far(SceneFilm::of(&run.film), *format))])
    }

    /// What an image gives, and what is to be said of its picture.
    fn files(&self, image: &Image, asked: &SceneSettings, observer: &Observer) -> (Vec<(Destination, Vec<u8>)>, String) {
        let run = &image.run.result;
        if run.film.sums.iter().all(|sum| *sum == 0) {
            complain(
                "warning: the picture is black: the camera sees nothing that is lit; is it outside of the scene, behind a wall, or does it look away?",
            );
        }
        let mut files = Vec::new();
        let mut wrote = String::new();
        if let Some((picture, format)) = &self.picture {
            let path = picture.path().display();
            if let Some(reason) = image.missing_parts(asked).filter(|_| self.shows_parts) {
                let layers = "has no layers of the parts of its light, which this run does not keep apart";
                complain(&format!("warning: -o {path}: {layers}: {reason}"));
            }
            let (bytes, how) = image.file(&image.request, *format, observer);
            files.push((picture.clone(), bytes));
            wrote = format!("\nwrote {path}{how}");
        }
        files.extend(self.errors.iter().map(|errors| (errors.clone(), show(&image.request, image.size).errors(&run.film))));
        files.extend(self.reports.files(run, || scene_report::json(&image.scene.name, run)));
        (files, wrote)
    }
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
    let prepared = prepare(inputs, RequestedReceivers::Image(None), observer)?;
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
