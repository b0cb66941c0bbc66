//! `photonmill bake`: irradiance of every surface as lightmaps, and the scene with them assigned.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::job::{Job, MessageArgs};
use super::options::{ReportArgs, TimedDeviceArgs};
use super::progress::ProgressReporter;
use super::scene::{SceneArgs, TransportArgs, geometry};
use super::values::{parse_number, parse_stops};
use super::{End, complain, say_beside};
use crate::bake::{self, Layout, PHASE_COUNT, TexelEstimate};
use crate::engine::scene::RunResult;
use crate::error::Result;
use crate::output::colour::ColourPicture;
use crate::output::destination::{Folder, check_distinct, write_all};
use crate::output::scene_report;
use crate::plan::sensor::Sensor;
use crate::records::Receiver;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;
use crate::text::counted;

#[derive(Args)]
pub(super) struct BakeArgs {
    /// Folder for the lightmaps and for the scene with them; created if needed
    #[arg(short, long, alias = "out", value_name = "DIR", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
    /// Exposure of the PNGs in stops, each of which doubles the brightness [default: what makes the mean middle grey]
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
    device: TimedDeviceArgs,
}

pub(super) fn run(args: &BakeArgs, cancelled: &AtomicBool) -> Result<End> {
    let settings = args.transport.settings();
    settings.validate()?;
    let folder = Folder::open("-o", &args.output)?;
    let reports = args.report.open()?;
    let report_files = reports.destinations();
    check_distinct(&report_files)?;

    let reporter = ProgressReporter::new(&args.messages.progress);
    let scene = args.scene.open(&reporter)?;
    reporter.status("laying out the lightmaps");
    let layout = Layout::new(&scene, args.texels_per_metre.unwrap_or_else(|| usual_density(&scene)))?;
    layout.warnings.iter().for_each(|warning| complain(&format!("warning: {warning}")));
    let geometry = geometry(&scene, &settings, &reporter)?;
    // Each round estimates one point of every texel, another one each time.
    let phases: Vec<Vec<Receiver>> =
        (0..PHASE_COUNT.min(settings.rounds as usize)).map(|phase| receivers(&layout, phase, &geometry)).collect();
    let sensor = Sensor::Receivers { count: layout.texel_count() as u32 };
    let job = Job { scene: &scene, geometry: &geometry, settings: &settings, sensor, camera: None, phases: &phases, point: "texel" };
    let gpu = args.device.open(&reporter)?;
    let lit = job.run(&gpu, &args.transport.stop, &reporter, cancelled)?;

    let estimates = estimates(&lit);
    let stops = args.exposure.unwrap_or_else(|| usual_exposure(&estimates));
    let text = scene_report::text(&scene.name, &lit, job.point, args.messages.explain);
    let written = bake::write(&folder, &scene, &layout, &layout.maps(&estimates), stops.exp2());
    reporter.finish();
    let written = written.and_then(|()| write_all(reports.files(&lit, || scene_report::json(&scene.name, &lit))));
    if let Err(error) = written {
        return say_beside(&report_files, &text).and(Err(error));
    }
    let maps = counted(layout.lightmaps().count(), "lightmap");
    let document = args.output.join("scene.gltf");
    let texels = counted(layout.texel_count(), "texel");
    say_beside(&report_files, &format!("{text}\nwrote {maps} of {texels} and {} at {stops:+.2} stops", document.display()))?;
    Ok(End::of(&lit))
}

/// Texels of all maps together, unless the user asks for a density.
const USUAL_TEXELS: f64 = 65_536.0;

fn usual_density(scene: &Scene) -> f64 {
    let kinds = scene.lobe_kinds();
    let baked = scene.meshes.iter().filter(|mesh| kinds[mesh.material].matt);
    let area: f64 = baked.map(|mesh| (0..mesh.triangles.len()).map(|triangle| mesh.area(triangle)).sum::<f64>()).sum();
    (USUAL_TEXELS / area.max(f64::MIN_POSITIVE)).sqrt()
}

fn receivers(layout: &Layout, phase: usize, geometry: &Geometry) -> Vec<Receiver> {
    layout
        .phase(phase)
        .iter()
        .map(|sample| Receiver {
            position: geometry.to_local(sample.position),
            normal: sample.geometric_normal.as_vec3(),
            shading_normal: sample.shading_normal.as_vec3(),
        })
        .collect()
}

fn estimates(lit: &RunResult) -> Vec<TexelEstimate> {
    let errors = lit.film.stated_errors(&lit.plan);
    (0..lit.film.pixels())
        .map(|texel| TexelEstimate { irradiance: lit.film.mean(texel, &lit.plan).as_vec3(), standard_error: errors(texel).as_vec3() })
        .collect()
}

fn usual_exposure(estimates: &[TexelEstimate]) -> f32 {
    let pixels = estimates.iter().map(|estimate| estimate.irradiance / std::f32::consts::PI).collect();
    ColourPicture { width: estimates.len() as u32, height: 1, pixels }.usual_exposure()
}
