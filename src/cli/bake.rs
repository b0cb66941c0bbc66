//! `photonmill bake`: irradiance of every surface as lightmaps, and the scene's file with coordinates for them.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::options::{DevicesOfRunArgs, ReportArgs};
use super::progress::{MessageArgs, ProgressReporter};
use super::request::{BAKE, RequestArgs};
use super::values::{parse_number, parse_stops};
use super::{End, say_written};
use crate::bake::pages::{Atlas, MIN_PAGE};
use crate::bake::{MAX_SIDE, Written};
use crate::error::{Error, Result};
use crate::output::destination::{Folder, check_distinct, write_all};
use crate::output::scene_report;
use crate::render::checkpoints::Checkpoints;
use crate::render::{BakeRequest, Event, Inputs, Observer, PreparedScene, Stops};
use crate::scene::built_in;
use crate::text::counted;

#[derive(Args)]
pub(super) struct BakeArgs {
    /// Folder for the lightmaps and for your file with lightmap coordinates; created if needed
    #[arg(short, long, alias = "out", value_name = "DIR", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
    /// Put the lightmaps of several objects into pages of SIZE x SIZE texels, or `off` for a file an object [default: off up to 8
    /// objects, above that one page, or several of 4096]
    #[arg(long, value_name = "SIZE", value_parser = parse_atlas, allow_hyphen_values = true, help_heading = "Output")]
    atlas: Option<Atlas>,
    /// Also write a copy that shows the baked light in any viewer, as emission; a built-in scene always has one
    #[arg(long, help_heading = "Output")]
    preview: bool,
    /// Exposure of the preview in stops, each of which doubles the brightness [default: what makes the mean middle grey]
    #[arg(long, value_name = "STOPS", value_parser = parse_stops, allow_hyphen_values = true, help_heading = "Output")]
    exposure: Option<Stops>,
    /// Texels per metre of surface [default: about 65536 texels in all maps together]
    #[arg(long, value_name = "N", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Scene")]
    texels_per_metre: Option<f64>,
    #[command(flatten)]
    request: RequestArgs<BAKE>,
    #[command(flatten)]
    messages: MessageArgs,
    #[command(flatten)]
    device: DevicesOfRunArgs,
}

pub(super) fn run(args: &BakeArgs, cancelled: &AtomicBool) -> Result<End> {
    let request = &args.request.0;
    let inputs = Inputs::open(request)?;
    let reporter = ProgressReporter::explaining(&args.messages);
    let report = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, report: &report };
    let folder = Folder::open("-o", &args.output)?;
    let reports = args.report.open()?;
    let mut checkpoints = Checkpoints::open(request, &observer)?;
    let report_files = [reports.destinations(), checkpoints.destinations()].concat();
    check_distinct(&[report_files.as_slice(), &[folder.itself()]].concat())?;
    checkpoints.check_not_read(&report_files, request.inputs())?;
    let is_built_in = built_in::by_name(&request.scene).is_some();
    if let Some(Atlas::Size(size)) = args.atlas.filter(|_| is_built_in) {
        return Err(Error::setting("--atlas", size, format!("is for scenes from a file, and {} is built in; leave it out", request.scene)));
    }
    if let Some(Stops(stops)) = args.exposure.filter(|_| !is_built_in && !args.preview) {
        return Err(Error::setting("--exposure", stops, "is for the preview; add --preview, or leave it out"));
    }

    let scene = PreparedScene::read(request, &observer)?;
    let bake = BakeRequest {
        texels_per_metre: args.texels_per_metre,
        folder: Some(folder),
        atlas: args.atlas,
        preview: args.preview,
        exposure: args.exposure.map(|Stops(stops)| stops),
    };
    let devices = || args.device.open(&reporter).map(Box::new);
    let (lightmaps, written) = scene.bake_on(devices, &bake, inputs, &mut checkpoints, &report_files, &observer)?;
    let run = &lightmaps.run.result;
    let name = &scene.scene.name;
    let text = scene_report::text(name, run, "texel", args.messages.explains());
    reporter.finish();
    let written = written.and_then(|files| write_all(reports.files(run, || scene_report::json(name, run))).map(|()| files));
    let [maps, texels] = [(lightmaps.maps.len(), "lightmap"), (lightmaps.texels, "texel")].map(|(count, noun)| counted(count, noun));
    let exposure = lightmaps.stops.map_or_else(String::new, |stops| format!(", pictures for the eye at {stops:+.2} stops"));
    let line = |file: &Written| format!("\nwrote {}: {}", args.output.join(&file.name).display(), file.purpose);
    let wrote = written.map(|files| format!("\n{maps} of {texels}{exposure}{}", files.iter().map(line).collect::<String>()));
    say_written(&report_files, &text, wrote)?;
    checkpoints.finish()?;
    Ok(End::of(run))
}

/// `1024`, `off`.
fn parse_atlas(text: &str) -> std::result::Result<Atlas, String> {
    let size = text.parse().ok().filter(|size| (MIN_PAGE..=MAX_SIDE).contains(size)).map(Atlas::Size);
    let atlas = if text == "off" { Some(Atlas::Off) } else { size };
    atlas.ok_or_else(|| format!("must be a size in texels from {MIN_PAGE} to {MAX_SIDE}, or off"))
}
