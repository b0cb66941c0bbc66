//! `photonmill plan`: which effects a scene calls for, and why.

use clap::Args;

use super::picture_size::{PictureSize, parse_size};
use super::progress::{ProgressArgs, ProgressReporter};
use super::transport::{Job, PartArg, SceneArgs, TransportArgs, camera, geometry};
use super::{DeviceArgs, JsonOrStdoutArg, optional_file, say};
use crate::engine;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::output::destination::write_all;
use crate::output::light_report;
use crate::plan::Limits;
use crate::plan::radius::RadiusFrom;
use crate::plan::scene::ScenePlan;
use crate::settings::scene::{Part, SceneSettings};
use crate::text::counted;

#[derive(Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    json: JsonOrStdoutArg,
    #[command(flatten)]
    scene: SceneArgs,
    /// Camera by name [default: the first one; one that sees the whole scene if it has none]
    #[arg(long, value_name = "NAME", help_heading = "Scene")]
    camera: Option<String>,
    /// Size of the picture in pixels; a width alone takes its height from the camera's aspect ratio [default: about 307200
    /// pixels in the camera's aspect ratio, 640x480 if it has none]
    #[arg(long, value_name = "WIDTH[xHEIGHT]", value_parser = parse_size, allow_hyphen_values = true, help_heading = "Scene")]
    size: Option<PictureSize>,
    #[command(flatten)]
    transport: TransportArgs,
    /// Compute only this part of the light; the four parts sum to `all` exactly
    #[arg(long, value_enum, value_name = "PART", help_heading = "Light transport")]
    part: Option<PartArg>,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(super) fn run(args: &PlanArgs) -> Result<()> {
    let usual = args.transport.settings();
    let settings = SceneSettings { part: args.part.map_or(usual.part, Part::from), ..usual };
    settings.validate()?;
    let json = optional_file("--json", args.json.json.as_ref())?;
    let reporter = ProgressReporter::new(&args.progress);
    let scene = args.scene.open(&reporter)?;
    let camera = camera(&scene, args.camera.as_deref())?;
    let (width, height) = PictureSize::resolve(args.size, &camera, &reporter)?;
    let job = Job::picture(&scene, &settings, &camera, (width, height));
    let geometry = geometry(&scene, &settings, &reporter)?;
    // A plan is data: it needs a device's limits, not the device.
    let limits = match Gpu::open(&args.device.options()) {
        Ok(gpu) => engine::limits(gpu.facts()),
        Err(error) if args.device.device.is_some() => return Err(error),
        Err(_) => Limits::of_host(),
    };
    let plan = ScenePlan::new(job.scene, &geometry, job.settings, job.sensor, &limits)?;
    reporter.finish();
    if let Some(json) = json {
        return write_all([(json, [light_report::plan_json(&plan), b"\n".to_vec()].concat())]);
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
                _ => "from a trial round at the start of the run".to_owned(),
            };
            let (photons, chunks) = (counted(map.photons, "photon"), counted(map.chunks().count(), "chunk"));
            format!("{} map: {photons} per round in {chunks}, first radius {radius}", map.name)
        })
        .collect();
    say(&format!("{text}{}\n{width} x {height} pixels\n{} bytes of device memory", maps.join("\n"), plan.bytes))
}
