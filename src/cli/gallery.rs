//! `photonmill gallery`: pictures of what the program does best, in a folder.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::progress::{ProgressArgs, ProgressReporter};
use super::values::parse_integer;
use super::{DeviceArgs, End, complain, say};
use crate::error::{Result, require, within};
use crate::gpu::Gpu;
use crate::measure::gallery::{self, GalleryRequest};
use crate::output::destination::Folder;
use crate::render::{Percent, Seconds};
use crate::scene::image_size::MAX_SIDE;

#[derive(Args)]
pub(super) struct GalleryArgs {
    /// Folder for the pictures, their reports and index.html; created if needed
    #[arg(short, long, alias = "out", value_name = "DIR", help_heading = "Output")]
    output: PathBuf,
    /// Width of each picture, pixels [default: 640; 160 on a CPU]
    #[arg(long, value_name = "WIDTH", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Scene")]
    size: Option<u32>,
    /// End each picture at this error [default: 1%; 5% on a CPU]
    #[arg(long, value_name = "ERROR", allow_hyphen_values = true, help_heading = "When to stop")]
    error: Option<Percent>,
    /// End each picture after this time, if the error is not reached before [default: 5s; 30s on a CPU]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, help_heading = "When to stop")]
    time: Option<Seconds>,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(super) fn run(args: &GalleryArgs, cancelled: &AtomicBool) -> Result<End> {
    let folder = Folder::open("-o", &args.output)?;
    let reporter = ProgressReporter::new(&args.progress);
    let gpu = Gpu::open(&args.device.options())?;
    reporter.device(Some(&gpu));
    let is_cpu = gpu.facts().kind == "cpu";
    // The commands open it for themselves.
    drop(gpu);
    let request = GalleryRequest {
        width: args.size.unwrap_or(if is_cpu { 160 } else { 640 }),
        error: 100.0 * args.error.map_or(if is_cpu { 0.05 } else { 0.01 }, Percent::share),
        seconds: args.time.map_or(if is_cpu { 30.0 } else { 5.0 }, |Seconds(seconds)| seconds),
        device: device_arguments(&args.device),
    };
    within("--size", u64::from(request.width), 1..=u64::from(MAX_SIDE), "pixels")?;
    require((0.001..=1e6).contains(&request.seconds), "--time", request.seconds, "must be from 1ms to 1000000s")?;
    let complete = gallery::make(&folder, &request, cancelled, &mut |line| reporter.step(line))?;
    reporter.finish();
    if !complete {
        complain("incomplete: interrupted before the last picture");
    }
    say(&format!("wrote {}", folder.path().join("index.html").display()))?;
    Ok(if complete { End::Finished } else { End::Cancelled })
}

/// As the commands take them.
fn device_arguments(args: &DeviceArgs) -> Vec<String> {
    let DeviceArgs { device, memory, validate } = args;
    let mut all = Vec::new();
    all.extend(device.iter().flat_map(|device| ["--device".to_owned(), device.clone()]));
    all.extend(memory.iter().flat_map(|bytes| ["--memory".to_owned(), bytes.to_string()]));
    all.extend(validate.then(|| "--validate".to_owned()));
    all
}
