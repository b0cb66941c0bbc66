//! `photonmill render`: what a camera sees of a scene.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;

use super::chosen::Chosen;
use super::display::{DisplayArgs, EVERY};
use super::how_made::{Made, blocks_with_gaps};
use super::job::{Job, MessageArgs};
use super::options::{DevicesOfRunArgs, ReportArgs};
use super::progress::{ProgressArgs, ProgressReporter};
use super::scene::{FilterArg, PictureArgs, Subject, ToneArg, settings};
use super::typed::Typed;
use super::values::{parse_integer, parse_photon_name, parse_seconds, parse_stops};
use super::{End, complain, denoise, optional_file, say, say_beside};
use crate::engine;
use crate::engine::replay::PhotonName;
use crate::engine::saved::{SavedFilm, SavedRun};
use crate::engine::scene::map_file::MapFile;
use crate::engine::scene::{RunResult, View, replay, scene_hash};
use crate::engine::watch::Later;
use crate::error::{Error, Result, require};
use crate::gpu::Gpu;
use crate::oidn::Denoiser;
use crate::output::colour::{Format, Tone};
use crate::output::destination::{Destination, check_distinct, write_all};
use crate::output::metadata::{Metadata, devices};
use crate::output::scene_report;
use crate::output::show::{Layer, Show, surfaces, units};
use crate::plan::scene::ScenePlan;
use crate::scene::{Camera, Scene};
use crate::settings::Math;
use crate::settings::request::{GOOD_ERROR, MOST_ROUNDS, Request, longest_seconds};
use crate::settings::scene::{Filter, Part, SceneSettings};
use crate::verify::judge::{Judge, Verdict};

#[derive(Args)]
pub(super) struct RenderArgs {
    /// Picture: an .exr holds linear radiance in W/m2/sr, a .png is sRGB, for the eye
    #[arg(short, long, alias = "out", value_name = "FILE", required_unless_present_any = ["replay", "shard", "save_settings"], help_heading = "Output")]
    output: Option<PathBuf>,
    /// Also write the picture so far at this interval: 10s, 5m
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, allow_hyphen_values = true, requires = "output", help_heading = "Output")]
    snapshot: Option<f64>,
    #[command(flatten)]
    display: DisplayArgs,
    #[command(flatten)]
    report: ReportArgs,
    /// Write the standard error of each pixel as an .exr, W/m2/sr; infinite where unknown: before eight blocks of rounds are
    /// whole, or where no light has reached the pixel though some may
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    error_image: Option<PathBuf>,
    /// Exposure of a PNG in stops, each of which doubles the brightness [default: what makes the mean middle grey]
    #[arg(long, value_name = "STOPS", value_parser = parse_stops, allow_hyphen_values = true, help_heading = "Output")]
    exposure: Option<f32>,
    /// Tone curve of a PNG [default: neutral]
    #[arg(long, value_enum, value_name = "CURVE", help_heading = "Output")]
    tone: Option<ToneArg>,
    /// Layers of an EXR beside the light: all, none, or some of direct, specular, caustic, indirect, standard_error, unseen, albedo, normal and
    /// depth [default: all]
    #[arg(long, value_name = "all|none|LAYER,...", value_parser = parse_layers, allow_hyphen_values = true, help_heading = "Output")]
    layers: Option<Layers>,
    /// Take the noise from direct light in the picture with Open Image Denoise, which must be installed. Other light, layers and
    /// errors stay as they were rendered
    #[arg(long, requires = "output", help_heading = "Output")]
    denoise: bool,
    #[command(flatten)]
    picture: PictureArgs,
    /// Camera paths per pixel and round, a power of two. Every path queries the caustic map; where all of them
    /// end on the first surface, only one queries the global map [default: 1; what a pilot finds best of a run that ends at an error or a time]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Light transport")]
    samples: Option<u32>,
    /// Write what the pilot has chosen for --settings; without -o nothing else is done
    #[arg(long, value_name = "FILE", help_heading = "Light transport")]
    save_settings: Option<PathBuf>,
    /// Reconstruction filter of the pixels [default: box]
    #[arg(long, value_enum, value_name = "FILTER", help_heading = "Light transport")]
    filter: Option<FilterArg>,
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

/// Of an EXR.
#[derive(Debug, Clone)]
struct Layers(Vec<Layer>);

fn parse_layers(text: &str) -> std::result::Result<Layers, String> {
    let names: Vec<&str> = match text {
        "all" => Layer::ALL.map(Layer::name).into(),
        "none" => Vec::new(),
        _ => text.split(',').map(str::trim).collect(),
    };
    let known = Layer::ALL.map(Layer::name);
    if names.iter().any(|name| !known.contains(name)) {
        return Err(format!("must be all, none, or some of {}, with commas between them", known.join(", ")));
    }
    Ok(Layers(Layer::ALL.into_iter().filter(|layer| names.contains(&layer.name())).collect()))
}

impl RenderArgs {
    fn request(&self) -> Request {
        Request { filter: self.filter.map(Filter::from), samples: self.samples, ..self.picture.request() }
    }

    pub(super) fn settings(&self, map: Option<&MapFile>, chosen: Option<&Chosen>) -> SceneSettings {
        settings(&self.request(), map, chosen)
    }

    /// Takes from the user what decides no pixel, and where the scene is.
    pub(super) fn set(&mut self, scene: Option<String>, progress: ProgressArgs, device: DevicesOfRunArgs) {
        scene.into_iter().for_each(|scene| self.picture.set_scene(scene));
        self.messages.progress = progress;
        self.device = device;
    }

    fn job<'a>(&self, subject: &'a Subject, settings: &'a SceneSettings, map: Option<&'a MapFile>) -> Job<'a> {
        Job {
            scene: &subject.scene,
            geometry: &subject.geometry,
            settings,
            sensor: subject.sensor(),
            camera: Some(&subject.camera),
            phases: &[],
            map,
            free: self.picture.transport.free(&self.request()),
            chosen: None,
            save_settings: None,
            explain: self.messages.explains(),
            point: "pixel",
        }
    }

    fn show(&self, subject: &Subject) -> Show {
        let size = (subject.width, subject.height);
        Show { size, exposure: self.exposure, tone: self.tone.map_or(Tone::default(), Tone::from), layers: self.layers(), denoised: None }
    }

    fn layers(&self) -> Vec<Layer> {
        self.layers.as_ref().map_or(Layer::ALL.into(), |Layers(layers)| layers.clone())
    }

    /// Whether the picture has layers of the parts of its light.
    fn shows_parts(&self, format: Option<Format>) -> bool {
        format == Some(Format::Exr) && self.layers().into_iter().any(Layer::is_part)
    }

    /// What a viewer shows.
    fn live(&self, subject: &Subject) -> Show {
        let layers = Layer::ALL.into_iter().filter(|layer| !layer.is_of_surface()).collect();
        Show { layers, ..self.show(subject) }
    }
}

/// Between two pictures of a run of which nothing says when it ends.
const SNAPSHOT_SECONDS: f64 = 5.0;

pub(super) fn run(args: &RenderArgs, typed: &Typed, cancelled: &AtomicBool) -> Result<End> {
    let map = args.picture.transport.map()?;
    let chosen = args.picture.transport.light.chosen.open()?;
    let mut settings = args.settings(map.as_ref(), chosen.as_ref());
    settings.validate()?;
    if let Some(name) = args.replay {
        return show_photon(args, &settings, name);
    }
    let has_no_end = args.picture.transport.has_no_end();
    if has_no_end {
        settings.stop.error = Some(GOOD_ERROR);
        settings.rounds = MOST_ROUNDS;
    }
    let output = args.output.as_ref();
    let format = output.map(|output| Format::of("-o", output)).transpose()?;
    if let Some(samples) = args.judge {
        let range = format!("must be from 2 to {MAX_JUDGE_SAMPLES} samples per pixel");
        require((2..=MAX_JUDGE_SAMPLES).contains(&samples), "--judge", samples, range)?;
        let block = settings.rounds_per_block(true);
        let is_known = settings.filter == Filter::Box && settings.rounds >= 2 * block;
        let needs = format!("needs --filter box, and {} rounds or more, which are two blocks, to know the error", 2 * block);
        require(is_known, "--judge", samples, needs)?;
    }
    if let Some(exposure) = args.exposure {
        require(format == Some(Format::Png), "--exposure", exposure, "is for PNG only: an EXR holds linear radiance")?;
    }
    if let (Some(_), Some(output)) = (&args.layers, output) {
        require(format == Some(Format::Exr), "--layers", output.display(), "is for EXR only: a PNG holds what the eye sees")?;
    }
    if args.tone.is_some() {
        let name = output.map_or_else(String::new, |output| output.display().to_string());
        require(format == Some(Format::Png), "--tone", name, "is for PNG only: an EXR holds linear radiance")?;
    }
    let picture = optional_file("-o", output)?;
    let errors = optional_file("--error-image", args.error_image.as_ref())?;
    if let Some(path) = &args.error_image {
        require(Format::of("--error-image", path)? == Format::Exr, "--error-image", path.display(), "must end in .exr")?;
    }
    let reports = args.report.open()?;
    let stop = &args.picture.transport.stop;
    let mut keeper = args.picture.transport.keep.open(stop)?;
    // A run that goes on with one that has no parts has none.
    let denoiser = args.denoise.then(|| denoise::open(&settings, keeper.resumed())).transpose()?;
    let wants_parts = args.shows_parts(format) || args.display.is_given() || args.denoise;
    settings.keeps_parts = wants_parts && keeper.resumed().is_none_or(SavedRun::has_parts);
    let save_settings = optional_file("--save-settings", args.save_settings.as_ref())?;
    let files = [&picture, &errors, &save_settings].into_iter().flatten().cloned().collect();
    let all: Vec<Destination> = [files, reports.destinations(), keeper.destinations()].concat();
    check_distinct(&all)?;
    keeper.check_not_read(&all, args.picture.inputs())?;

    let reporter = ProgressReporter::new(&args.messages.progress);
    let subject = args.picture.open(&settings, &reporter)?;
    let Subject { scene, camera, geometry, .. } = &subject;
    let live = args.live(&subject);
    let name = output.map_or_else(String::new, |output| output.display().to_string());
    let mut viewer = args.display.connect(name, live.size)?;
    let mut gpus = args.device.open(&reporter)?;
    if has_no_end {
        settings.stop.seconds = Some(longest_seconds(gpus[0].facts().kind));
    }
    let job = Job { chosen: chosen.as_ref(), save_settings: save_settings.as_ref(), ..args.job(&subject, &settings, map.as_ref()) };
    let show = args.show(&subject);
    let mut snapshot = |run: &SavedRun| match (&run.film, &picture, format) {
        (SavedFilm::Scene(film), Some(picture), Some(format)) => write_all([(picture.clone(), show.so_far(film, format))]),
        _ => Ok(()),
    };
    if let Some(seconds) = args.snapshot.or(has_no_end.then_some(SNAPSHOT_SECONDS)) {
        require((0.001..=1e6).contains(&seconds), "--snapshot", seconds, "must be from 1ms to 1000000s")?;
        keeper.set_snapshot(Duration::from_secs_f64(seconds), &mut snapshot);
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
        keeper.set_display(EVERY, &mut send);
    }
    if picture.is_none() && args.picture.transport.keep.shard.is_none() {
        let view = View { geometry, camera: Some(camera), phases: &[] };
        job.choose(&mut gpus[0], &view, &reporter, cancelled)?;
        reporter.finish();
        return Ok(End::Finished);
    }
    let blocks_with_gaps = blocks_with_gaps(keeper.resumed());
    let lit = job.run(&mut gpus, stop, &mut keeper, &reporter, cancelled)?;
    let kept = keeper.finish();
    if let Some(viewer) = viewer
        && let Err(error) = viewer.finish(live.channels(&lit.film, &[]))
    {
        complain(&format!("warning: {error}"));
    }

    if lit.film.sums.iter().all(|sum| *sum == 0) {
        complain(
            "warning: the picture is black: the camera sees nothing that is lit; is it outside of the scene, behind a wall, or does it look away?",
        );
    }
    let text = scene_report::text(&scene.name, &lit, job.point, args.messages.explains());
    let mut files = Vec::new();
    let mut shown = String::new();
    if let (Some(picture), Some(format), Some(output)) = (&picture, format, output) {
        let made = Made {
            typed,
            lit: &lit,
            scene: &scene.name,
            scene_hash: scene_hash(geometry),
            is_shard: args.picture.transport.keep.shard.is_some(),
            blocks_with_gaps,
        };
        if args.shows_parts(Some(format)) && settings.part == Part::All && lit.film.parts.is_none() {
            let layers = "has no layers of the parts of its light, which this run does not keep apart";
            complain(&format!("warning: -o {}: {layers}: {}", output.display(), no_parts(&lit, &settings)));
        }
        let (bytes, how) = file(&made, &show, format, (scene, camera), denoiser.as_ref());
        files.push((picture.clone(), bytes));
        shown = format!("\nwrote {}{how}", output.display());
    }
    files.extend(errors.map(|errors| (errors, show.errors(&lit.film))));
    files.extend(reports.files(&lit, || scene_report::json(&scene.name, &lit)));
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
        let verdict = verdict(&lit, scene, camera, show.size, samples);
        reporter.finish();
        say_beside(&all, &format!("judge: {verdict}"))?;
    }
    kept?;
    Ok(End::of(&lit))
}

/// Why a film of all parts has them not apart.
fn no_parts(lit: &RunResult, asked: &SceneSettings) -> &'static str {
    match (asked.keeps_parts, lit.plan.keeps_parts()) {
        (false, _) => "the checkpoint of --resume is of a run without -o FILE.exr",
        (true, false) => "the picture is too large for the device with them",
        (true, true) => "it was cut short within its first block of rounds",
    }
}

/// The picture's file, and in words its exposure and who has changed it.
fn file(made: &Made, show: &Show, format: Format, (scene, camera): (&Scene, &Camera), denoiser: Option<&Denoiser>) -> (Vec<u8>, String) {
    let film = &made.lit.film;
    let scene = scene.without(&made.lit.plan.settings.without);
    let has_layers = format == Format::Exr && show.shows_surfaces();
    let surfaces = if has_layers || denoiser.is_some() { surfaces(&scene, camera, show.size) } else { Vec::new() };
    let denoised = denoiser.and_then(|denoiser| Some((denoise::denoised(denoiser, film, &surfaces, show.size)?, denoise::name(denoiser))));
    let (denoised, denoiser) = denoised.unzip();
    let by = denoiser.as_ref().map_or_else(String::new, |denoiser| {
        format!("\ndirect light is denoised by {denoiser}; all errors are those of the picture before that, and layers are as rendered")
    });
    let show = Show { denoised, ..show.clone() };
    let metadata = |stops: f32| Metadata { denoiser: denoiser.clone(), ..made.metadata(units(format, stops, show.tone), format) };
    if format == Format::Png {
        let (content, stops) = show.png(film, metadata);
        return (content, format!(" at {stops:+.2} stops{by}"));
    }
    (show.exr(film, &surfaces, Some(&metadata(0.0))), by)
}

/// A picture that is made again.
pub(super) struct Again<'a> {
    pub(super) path: &'a Path,
    pub(super) format: Format,
    pub(super) made: &'a Metadata,
    pub(super) chosen: &'a Chosen,
    pub(super) typed: &'a Typed,
    /// Whether the user has said where the scene is now.
    pub(super) has_moved: bool,
}

/// The file that comes out, and the devices that made it.
pub(super) struct Repeated {
    pub(super) content: Vec<u8>,
    pub(super) devices: Vec<String>,
}

pub(super) fn again(args: &RenderArgs, again: &Again, cancelled: &AtomicBool) -> Result<Repeated> {
    let &Again { path, format, made, chosen, typed, has_moved } = again;
    let refuse = |reason: String| Error::Picture { path: path.to_owned(), reason };
    if args.picture.lacks_scene() && !has_moved {
        let scene = args.picture.scene_path().display();
        let remedy = "run it from the same folder, or say with --scene where the scene is now";
        return Err(refuse(format!("is of the scene {scene}, which is not there; {remedy}")));
    }
    let map = args.picture.transport.map()?;
    let mut settings = args.settings(map.as_ref(), Some(chosen));
    settings.validate()?;
    settings.keeps_parts = args.shows_parts(Some(format)) || args.denoise;
    let denoiser = args.denoise.then(|| denoise::open(&settings, None)).transpose()?;
    if let (Some(before), Some(now)) = (&made.denoiser, denoiser.as_ref().map(denoise::name))
        && *before != now
    {
        complain(&format!("warning: was denoised by {before}, and now by {now}, which may leave other bits"));
    }
    let reporter = ProgressReporter::new(&args.messages.progress);
    let subject = args.picture.open(&settings, &reporter)?;
    let hash = scene_hash(&subject.geometry);
    if let Some(before) = made.scene_hash.as_ref().filter(|before| **before != hash) {
        let scene = args.picture.scene_path().display();
        let remedy = "restore the scene as it was, or name another file with --scene";
        return Err(refuse(format!("is of another scene than {scene} is now (SHA-256 {before}, not {hash}); {remedy}")));
    }
    let mut gpus = args.device.open(&reporter)?;
    let here = devices(gpus.iter().map(Gpu::facts));
    if settings.math != Math::Strict && here != made.devices {
        let (before, now) = (made.devices.join("; "), here.join("; "));
        complain(&format!("warning: made on {before}, and repeated on {now}, which may round otherwise"));
    }
    let stop = &args.picture.transport.stop;
    let mut keeper = args.picture.transport.keep.open(stop)?;
    let job = args.job(&subject, &settings, map.as_ref());
    let lit = job.run(&mut gpus, stop, &mut keeper, &reporter, cancelled)?.finished()?;
    reporter.finish();
    let show = args.show(&subject);
    let scene = &subject.scene.name;
    let made = Made { typed, lit: &lit, scene, scene_hash: hash, is_shard: false, blocks_with_gaps: 0 };
    let (content, _) = file(&made, &show, format, (&subject.scene, &subject.camera), denoiser.as_ref());
    Ok(Repeated { content, devices: made.devices() })
}

/// The path of one photon of the run that these options ask for.
fn show_photon(args: &RenderArgs, settings: &SceneSettings, name: PhotonName) -> Result<End> {
    let reporter = ProgressReporter::new(&args.messages.progress);
    let subject = args.picture.open(settings, &reporter)?;
    let gpu = args.device.one.open(&reporter)?;
    // A photon's path does not depend on the radius.
    let plan = ScenePlan::new(&subject.scene, &subject.geometry, settings, subject.sensor(), &engine::limits(gpu.facts()))?;
    let path = replay::replay(&gpu, &subject.geometry, &plan, name)?;
    reporter.finish();
    say(&path.table(&subject.geometry, &plan))?;
    Ok(End::Finished)
}

const MAX_JUDGE_SAMPLES: u32 = 1 << 24;

/// How the picture compares with a path tracer's.
fn verdict(lit: &RunResult, scene: &Scene, camera: &Camera, (width, height): (u32, u32), samples: u32) -> Verdict {
    let settings = &lit.plan.settings;
    let part = Some(settings.part).filter(|part| *part != Part::All);
    // Of the same scene, without what was left out, and with other random numbers than the photons'.
    let scene = scene.without(&settings.without);
    let judged = Judge::new(&scene, settings.bounces).image(camera, width, height, samples, !settings.seed);
    let means: Vec<_> = lit.film.means().collect();
    let errors: Vec<_> = (0..lit.film.pixels()).map(|pixel| lit.film.standard_error(pixel)).collect();
    Verdict::new(&means, &errors, lit.film.blocks.min(samples), &judged, part)
}
