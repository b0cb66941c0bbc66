//! The main job: light the open box with one builder.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::Args;

use super::options::{DevicesOfRunArgs, ReportArgs, Reports};
use super::progress::{ProgressArgs, ProgressReporter};
use super::request::{BOX, RequestArgs};
use super::values::parse_photon_name;
use super::{End, say, say_written};
use crate::engine::error::bound::ErrorSource;
use crate::engine::replay::PhotonName;
use crate::engine::room::film::estimate_walls;
use crate::engine::room::{self, RunResult};
use crate::error::{Result, require};
use crate::output::colour::Format;
use crate::output::destination::{Destination, Folder, check_distinct, write_all};
use crate::output::image::overview;
use crate::output::lightmap::{self, Quantity};
use crate::output::room_report;
use crate::render::checkpoints::Checkpoints;
use crate::render::room::{PreparedRoom, metadata};
use crate::render::{Event, Observer, RenderRequest};
use crate::scene::open_box::open_box;
use crate::scene::room::RoomScene;
use crate::settings::{Builder, RoomSettings};
use crate::timings::Span;

#[derive(Args)]
pub(super) struct RunArgs {
    /// Picture of the box: a .png shows illumination from 0 to 1, an .exr keeps it unclamped
    #[arg(short, long, alias = "out", value_name = "FILE", default_value = "open-box.png", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
    /// Write the irradiance of each wall in W/m2 as <wall>.exr, its standard error as <wall>-error.exr, and layout.json,
    /// into this folder
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    irradiance: Option<PathBuf>,
    /// The same for the radiosity, the reflected flux per area
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    radiosity: Option<PathBuf>,

    #[command(flatten)]
    pub(super) request: RequestArgs<BOX>,
    /// Trace a single photon of this run, print where it is stored, and exit; rounds and photons count from 0
    #[arg(long, value_name = "ROUND:PHOTON", value_parser = parse_photon_name, help_heading = "Checks",
        conflicts_with_all = ["output", "irradiance", "radiosity", "json", "trace", "time_dispatches", "devices"])]
    replay: Option<PhotonName>,

    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DevicesOfRunArgs,
}

pub(super) fn run(args: &RunArgs, cancelled: &AtomicBool) -> Result<End> {
    let request = &args.request.0;
    let settings = request.room_settings();
    settings.validate()?;
    let stores_none = settings.reflectance == 0.0 && args.irradiance.is_some();
    require(!stores_none, "--reflectance", 0, "must be above 0 with --irradiance: the photon map holds only reflected photons")?;
    let is_on_cpu = settings.builder == Builder::Cpu;
    if is_on_cpu {
        args.device.check_unused("has no effect with --variant cpu; leave one of the two out")?;
    }
    let scene = open_box(&settings);
    if let Some(name) = args.replay {
        return show_photon(args, &settings, &scene, name);
    }
    let reporter = ProgressReporter::new(&args.progress);
    let report = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, report: &report };
    let mut checkpoints = Checkpoints::open(request, &observer)?;
    let outputs = Outputs::open(args, &scene, &checkpoints)?;
    if let Some(warning) = settings.warning() {
        observer.report(Event::Warning(&warning));
    }
    let mut gpus = if is_on_cpu { Vec::new() } else { args.device.open_or_none(&reporter)? };
    if gpus.is_empty() {
        reporter.device(None);
    }
    let prepared = PreparedRoom { request, settings, scene };
    let result = prepared.run(&mut gpus, &mut checkpoints, &observer)?;
    reporter.finish();
    let end = End::of(&result);
    outputs.write(result, &prepared.scene, request)?;
    checkpoints.finish()?;
    Ok(end)
}

/// Where one photon of the run is stored.
fn show_photon(args: &RunArgs, settings: &RoomSettings, scene: &RoomScene, name: PhotonName) -> Result<End> {
    let gpu = if settings.builder == Builder::Cpu { None } else { args.device.one.chosen.open(&args.device.one.chosen.options())? };
    say(&room::replay(gpu.as_ref(), scene, settings, name)?.table(scene, settings.seed))?;
    Ok(End::Finished)
}

/// Everything that the run will write, checked before it starts.
struct Outputs {
    picture: (Destination, Format),
    irradiance: Option<Folder>,
    radiosity: Option<Folder>,
    reports: Reports,
}

impl Outputs {
    fn open(args: &RunArgs, scene: &RoomScene, checkpoints: &Checkpoints) -> Result<Outputs> {
        let folder = |option, path: &Option<PathBuf>| path.as_ref().map(|path| Folder::open(option, path)).transpose();
        let outputs = Outputs {
            picture: (Destination::open("-o", &args.output)?, Format::of("-o", &args.output)?),
            reports: args.report.open()?,
            irradiance: folder("--irradiance", &args.irradiance)?,
            radiosity: folder("--radiosity", &args.radiosity)?,
        };
        let folders = [&outputs.irradiance, &outputs.radiosity].into_iter().flatten();
        let mut all = vec![outputs.picture.0.clone()];
        all.extend(outputs.reports.destinations());
        all.extend(checkpoints.destinations());
        all.extend(folders.flat_map(|folder| lightmap::destinations(folder, scene)));
        check_distinct(&all)?;
        Ok(outputs)
    }

    fn write(self, mut result: RunResult, scene: &RoomScene, request: &RenderRequest) -> Result<()> {
        let began = Instant::now();
        let walls = estimate_walls(&result.film, scene, &result.plan);
        let error = room_report::error(&result, scene);
        let (destination, format) = self.picture;
        let picture = destination.path().display().to_string();
        let mut files = vec![(destination, overview(scene, &walls).encode(format, Some(&metadata(request, &result, &error, format))))];
        let confidence = result.plan.settings.stop.confidence;
        let source = ErrorSource { degrees_of_freedom: result.film.error_freedom(), confidence };
        for (folder, quantity) in [(&self.irradiance, Quantity::Irradiance), (&self.radiosity, Quantity::Radiosity)] {
            files.extend(folder.iter().flat_map(|folder| lightmap::files(folder, quantity, scene, &walls, source)));
        }
        let run = result.timings.spans().iter().map(|span| span.start + span.duration).max().unwrap_or_default();
        result.timings.count("output");
        result.timings.add(Span::of_host("output", run, began.elapsed()));

        files.extend(self.reports.files(&result, || room_report::json(&result, &walls, &error)));
        let destinations: Vec<Destination> = files.iter().map(|(destination, _)| destination.clone()).collect();
        let text = room_report::text(&result, &error);
        say_written(&destinations, &text, write_all(files).map(|()| format!("\nwrote {picture}")))
    }
}
