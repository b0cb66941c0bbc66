//! `photonmill plan`: which effects a scene calls for, and why.

use clap::Args;

use super::progress::{ProgressArgs, ProgressReporter};
use super::scene::{PictureArgs, Subject, settings};
use super::{DeviceArgs, JsonOrStdoutArg, optional_file, say};
use crate::engine;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::output::destination::write_all;
use crate::output::scene_report;
use crate::plan::Limits;
use crate::plan::radius::RadiusFrom;
use crate::plan::scene::ScenePlan;
use crate::scene::light_tree::is_one_lamp;
use crate::text::counted;

#[derive(Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    json: JsonOrStdoutArg,
    #[command(flatten)]
    picture: PictureArgs,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(super) fn run(args: &PlanArgs) -> Result<()> {
    let map = args.picture.transport.map()?;
    let settings = settings(&args.picture.request(), map.as_ref(), args.picture.transport.light.chosen.open()?.as_ref());
    settings.validate()?;
    let json = optional_file("--json", args.json.json.as_ref())?;
    let reporter = ProgressReporter::new(&args.progress);
    let subject = args.picture.open(&settings, &reporter)?;
    // A plan is data: it needs a device's limits, not the device.
    let limits = match Gpu::open(&args.device.options()) {
        Ok(gpu) => engine::limits(gpu.facts()),
        Err(error) if args.device.device.is_some() => return Err(error),
        Err(_) => Limits::of_host(),
    };
    let plan = ScenePlan::new(&subject.scene, &subject.geometry, &settings, subject.sensor(), &limits)?;
    let plan = map.iter().try_fold(plan, |plan, map| map.plan(plan, &subject.geometry))?;
    reporter.finish();
    if let Some(json) = json {
        return write_all([(json, [scene_report::plan_json(&plan), b"\n".to_vec()].concat())]);
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
                RadiusFrom::User => format!("{:.4} m", map.radius * subject.geometry.unit),
                // A plan needs no device, and a trial round does.
                _ => "from a trial round at the start of the run".to_owned(),
            };
            let (photons, chunks) = (counted(map.photons, "photon"), counted(map.chunks().count(), "chunk"));
            format!("{} map: {photons} per round in {chunks}, first radius {radius}", map.name)
        })
        .collect();
    let lights =
        if is_one_lamp(&subject.geometry) { "" } else { "lights chosen by what they do, from a trial round at the start of the run\n" };
    let Subject { width, height, .. } = subject;
    say(&format!("{text}{}\n{lights}{width} x {height} pixels\n{} bytes of device memory", maps.join("\n"), plan.bytes))
}
