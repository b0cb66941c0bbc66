//! `photonmill plan`: which effects a scene calls for, and why.

use clap::Args;

use super::progress::{ProgressArgs, ProgressReporter};
use super::request::{PLAN, RequestArgs};
use super::{DeviceArgs, JsonOrStdoutArg, optional_file, say, spell};
use crate::engine;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::output::destination::write_all;
use crate::output::scene_report;
use crate::plan::Limits;
use crate::plan::radius::RadiusFrom;
use crate::render::{Event, Inputs, Observer, RequestedReceivers, prepare};
use crate::scene::light_tree::is_one_lamp;
use crate::text::counted;

#[derive(Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    json: JsonOrStdoutArg,
    #[command(flatten)]
    request: RequestArgs<PLAN>,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(super) fn run(args: &PlanArgs) -> Result<()> {
    let inputs = Inputs::open(&args.request.0)?;
    let json = optional_file("--json", args.json.json.as_ref())?;
    let reporter = ProgressReporter::new(&args.progress);
    let report = |event: Event| reporter.event(event);
    let prepared = prepare(inputs, RequestedReceivers::Image(None), &Observer { report: &report, ..Observer::default() })?;
    // A plan is data: it needs a device's limits, not the device.
    let limits = match Gpu::open(&args.device.options()) {
        Ok(gpu) => engine::limits(gpu.facts()),
        Err(error) if args.device.device.is_some() => return Err(error),
        Err(_) => Limits::of_host(),
    };
    let plan = prepared.plan_within(&limits)?;
    let geometry = &prepared.geometry;
    reporter.finish();
    if let Some(json) = json {
        return write_all([(json, (spell(&String::from_utf8_lossy(&scene_report::plan_json(&plan))) + "\n").into_bytes())]);
    }
    let mut text = scene_report::plan_table(&plan, None);
    if let Some(line) = scene_report::missing(&plan) {
        text.push_str(&line);
        text.push('\n');
    }
    let maps: Vec<String> = plan
        .maps()
        .map(|map| {
            let radius = match map.radius_from {
                RadiusFrom::User => format!("{:.4} m", map.radius * geometry.unit),
                // A plan needs no device, and a trial round does.
                _ => "from a trial round at the start of the run".to_owned(),
            };
            let (photons, chunks) = (counted(map.photons, "photon"), counted(map.chunks().count(), "chunk"));
            format!("{} map: {photons} per round in {chunks}, first radius {radius}", map.name)
        })
        .collect();
    let lights = if is_one_lamp(geometry) { "" } else { "lights chosen by what they do, from a trial round at the start of the run\n" };
    let (width, height) = prepared.size();
    say(&format!("{text}{}\n{lights}{width} x {height} pixels\n{} bytes of device memory", maps.join("\n"), plan.bytes))
}
