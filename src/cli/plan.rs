//! `photonmill plan`: which effects a scene calls for, and why.

use clap::Args;

use super::transport::{Job, PartArg, SceneArgs, TransportArgs, camera, geometry, size};
use super::{DeviceArgs, say};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::output::light_report;
use crate::plan::Limits;
use crate::plan::transport::{RadiusFrom, Sensor, TransportPlan};
use crate::render;
use crate::settings::transport::{Part, TransportSettings};

#[derive(Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", value_parser = size, allow_hyphen_values = true, default_value = "640x480", help_heading = "Scene")]
    size: (u32, u32),
    /// Only this part of the light
    #[arg(long, value_enum, help_heading = "Transport")]
    part: Option<PartArg>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    transport: TransportArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(super) fn run(args: &PlanArgs) -> Result<()> {
    let usual = args.transport.settings();
    let settings = TransportSettings { part: args.part.map_or(usual.part, Part::from), ..usual };
    settings.validate()?;
    let scene = args.scene.open()?;
    let (width, height) = args.size;
    let camera = camera(&scene, None)?;
    let job = Job { scene: &scene, settings: &settings, sensor: Sensor::Picture { width, height }, camera: Some(&camera), phases: &[] };
    let geometry = geometry(&scene, &settings)?;
    // A plan is data: it needs a device's limits, not the device.
    let limits = match Gpu::open(&args.device.options()) {
        Ok(gpu) => render::limits(gpu.facts()),
        Err(error) if args.device.device.is_some() => return Err(error),
        Err(_) => Limits::of_host(),
    };
    let plan = TransportPlan::new(job.scene, &geometry, job.settings, job.sensor, &limits)?;
    if args.json {
        return say(&String::from_utf8(light_report::plan_json(&plan)).expect("JSON is text"));
    }
    let mut text = light_report::plan_table(&plan, None);
    if let Some(line) = light_report::missing(&plan) {
        text.push_str(&line);
        text.push('\n');
    }
    let maps: Vec<String> = plan
        .maps()
        .map(|map| {
            let radius = match map.radius_from {
                RadiusFrom::User => format!("{:.4} m", map.radius * geometry.unit),
                // A plan needs no device, and a trial round does.
                _ => "by a trial round at the start of the run".to_owned(),
            };
            format!("{} map: {} photons a round in {} chunk(s), first radius {radius}", map.name, map.photons, map.chunks().count())
        })
        .collect();
    say(&format!("{text}{}\n{} bytes of device memory", maps.join("\n"), plan.bytes))
}
