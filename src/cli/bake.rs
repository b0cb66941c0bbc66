//! `photonmill bake`: irradiance of every surface as lightmaps, and the scene's file with coordinates for them.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::job::{Job, MessageArgs};
use super::options::{DevicesOfRunArgs, ReportArgs};
use super::progress::ProgressReporter;
use super::scene::{SceneArgs, TransportArgs, geometry, settings};
use super::values::{parse_number, parse_stops};
use super::{End, complain, say_beside};
use crate::bake::pages::{Atlas, MIN_PAGE, Pages};
use crate::bake::{self, IntoFile, Layout, MAX_SIDE, Written};
use crate::error::{Error, Result};
use crate::output::destination::{Folder, check_distinct, write_all};
use crate::output::scene_report;
use crate::plan::sensor::Sensor;
use crate::plan::work_division::Free;
use crate::scene::built_in;
use crate::scene::gltf::source::File;
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
    exposure: Option<f32>,
    #[command(flatten)]
    scene: SceneArgs,
    /// Texels per metre of surface [default: about 65536 texels in all maps together]
    #[arg(long, value_name = "N", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Scene")]
    texels_per_metre: Option<f64>,
    #[command(flatten)]
    transport: TransportArgs,
    #[command(flatten)]
    messages: MessageArgs,
    #[command(flatten)]
    device: DevicesOfRunArgs,
}

pub(super) fn run(args: &BakeArgs, cancelled: &AtomicBool) -> Result<End> {
    let map = args.transport.map()?;
    let request = args.transport.request();
    let settings = settings(&request, map.as_ref(), args.transport.light.chosen.open()?.as_ref());
    settings.validate()?;
    let folder = Folder::open("-o", &args.output)?;
    let reports = args.report.open()?;
    let mut keeper = args.transport.keep.open(&args.transport.stop)?;
    let report_files = [reports.destinations(), keeper.destinations()].concat();
    check_distinct(&[report_files.as_slice(), &[folder.itself()]].concat())?;
    keeper.check_not_read(&report_files, args.transport.inputs().chain([args.scene.path()]))?;
    let name = args.scene.scene.as_str();
    let is_built_in = built_in::by_name(name).is_some();
    if let Some(Atlas::Size(size)) = args.atlas.filter(|_| is_built_in) {
        return Err(Error::setting("--atlas", size, format!("is for scenes from a file, and {name} is built in; leave it out")));
    }

    if let Some(stops) = args.exposure.filter(|_| !is_built_in && !args.preview) {
        return Err(Error::setting("--exposure", stops, "is for the preview; add --preview, or leave it out"));
    }

    let reporter = ProgressReporter::new(&args.messages.progress);
    let scene = args.scene.open(&reporter)?;
    let file = if is_built_in { None } else { Some(File::open(Path::new(name))?) };
    let density = bake::usual_density(&scene, name)?;
    reporter.status("laying out the lightmaps");
    let atlas = if is_built_in { Atlas::Off } else { args.atlas.unwrap_or(Atlas::Auto) };
    let layout = Layout::of_file(&scene, file.as_ref(), args.texels_per_metre.unwrap_or(density), atlas.max_side())?;
    layout.warnings.iter().for_each(|warning| complain(&format!("warning: {warning}")));
    let pages = Pages::new(&layout, atlas);
    // Before the light, as it says what is wrong with the file.
    let into_file = file.as_ref().map(|file| IntoFile::new(&folder, file, &scene, &layout, &pages)).transpose()?;
    into_file.iter().flat_map(|into| &into.warnings).for_each(|warning| complain(&format!("warning: {warning}")));
    let names = into_file.as_ref().map_or_else(|| bake::names(&scene, &layout), |into_file| into_file.names(args.preview));
    for name in names {
        check_distinct(&[&[folder.file(&name)], report_files.as_slice()].concat())?;
    }
    let geometry = geometry(&scene, &settings, &reporter)?;
    let phases = layout.receivers(settings.rounds, &geometry);
    let sensor = Sensor::Receivers { count: layout.texel_count() as u32 };
    let job = Job {
        scene: &scene,
        geometry: &geometry,
        settings: &settings,
        sensor,
        camera: None,
        phases: &phases,
        map: map.as_ref(),
        free: Free { samples: false, ..args.transport.free(&request) },
        chosen: None,
        save_settings: None,
        explain: args.messages.explains(),
        point: "texel",
    };
    let mut gpus = args.device.open(&reporter)?;
    let lit = job.run(&mut gpus, &args.transport.stop, &mut keeper, &reporter, cancelled)?;

    let estimates = bake::estimates(&lit);
    let stops = args.exposure.unwrap_or_else(|| bake::usual_exposure(&estimates));
    let text = scene_report::text(&scene.name, &lit, job.point, args.messages.explains());
    let maps = layout.maps(&estimates, lit.film.error_source());
    let written = match into_file {
        Some(into_file) => into_file.write(&folder, &maps, args.preview.then(|| stops.exp2())),
        None => bake::write(&folder, &scene, &layout, &maps, stops.exp2()).map(|()| built_in_files(&layout)),
    };
    reporter.finish();
    let written = written.and_then(|files| write_all(reports.files(&lit, || scene_report::json(&scene.name, &lit))).map(|()| files));
    let files = match written {
        Ok(files) => files,
        Err(error) => return say_beside(&report_files, &text).and(Err(error)),
    };
    let lightmaps = counted(layout.objects.len(), "lightmap");
    let texels = counted(layout.texel_count(), "texel");
    let exposure = if is_built_in || args.preview { format!(", pictures for the eye at {stops:+.2} stops") } else { String::new() };
    let line = |file: &Written| format!("\nwrote {}: {}", args.output.join(&file.name).display(), file.purpose);
    let files: String = files.iter().map(line).collect();
    say_beside(&report_files, &format!("{text}\n{lightmaps} of {texels}{exposure}{files}"))?;
    keeper.finish()?;
    Ok(End::of(&lit))
}

/// `1024`, `off`.
fn parse_atlas(text: &str) -> std::result::Result<Atlas, String> {
    let size = text.parse().ok().filter(|size| (MIN_PAGE..=MAX_SIDE).contains(size)).map(Atlas::Size);
    let atlas = if text == "off" { Some(Atlas::Off) } else { size };
    atlas.ok_or_else(|| format!("must be a size in texels from {MIN_PAGE} to {MAX_SIDE}, or off"))
}

/// What a built-in scene's files are for.
fn built_in_files(layout: &Layout) -> Vec<Written> {
    let maps = counted(layout.objects.len(), "lightmap");
    [
        ("scene.gltf", "the scene with its light in any viewer, as emission".to_owned()),
        ("scene_lightmap.gltf", "the scene with its materials and lightmaps (MOZ_lightmap), for engines".to_owned()),
        ("NAME_irradiance.exr, NAME_error.exr", format!("W/m2, linear, of {maps}")),
        ("NAME.png, NAME_lightmap.png, NAME_radiance.png", "the same for the eye, and for the two scenes".to_owned()),
    ]
    .map(|(name, purpose)| Written { name: name.to_owned(), purpose })
    .into()
}
