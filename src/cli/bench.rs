//! `photonmill bench`: every pass beside the device's limits, and the targets.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::{Args, ValueEnum};

use super::stop::seconds;
use super::{DeviceArgs, End, complain, say};
use crate::bench::experiments::Experiment;
use crate::bench::{self, Request, Size, table};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::output::destination::{Destination, Folder, write_all};

#[derive(Args)]
pub(super) struct BenchArgs {
    /// Only these experiments, by name and separated by commas: open-box, builders, table-1, index, gather, cornell,
    /// cornell-spheres, caustic-sphere, mesh, effects, compaction [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = experiment)]
    only: Vec<Experiment>,
    /// Workloads of the targets, or small ones that take seconds [default: full on a GPU, small on a CPU]
    #[arg(long, value_enum)]
    size: Option<SizeArg>,
    /// Follow cost and memory over photons and triangles instead
    #[arg(long, conflicts_with = "only")]
    scale: bool,
    /// Write the report as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Folder for the report as JSON and text, and charts of --scale; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Wall time after which no further experiment begins: 90s, 10m
    #[arg(long, value_name = "TIME", value_parser = seconds, allow_negative_numbers = true, default_value = "10m")]
    time: f64,
    #[command(flatten)]
    device: DeviceArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SizeArg {
    Small,
    Full,
}

fn experiment(name: &str) -> std::result::Result<Experiment, String> {
    Experiment::ALL.into_iter().find(|experiment| experiment.name() == name).ok_or_else(|| {
        let names: Vec<&str> = Experiment::ALL.iter().map(|experiment| experiment.name()).collect();
        format!("must be one of {}", names.join(", "))
    })
}

pub(super) fn run(args: &BenchArgs, cancelled: &AtomicBool) -> Result<End> {
    if !(1.0..=1e6).contains(&args.time) {
        return Err(Error::setting("--time", args.time, "must be from 1s to 1000000s"));
    }
    let json = args.json.as_ref().map(|path| Destination::open("--json", path)).transpose()?;
    let folder = args.out.as_ref().map(|path| Folder::open("--out", path)).transpose()?;
    let gpu = Gpu::open(&args.device.steady())?;
    let usual = if gpu.facts().kind == "cpu" { SizeArg::Small } else { SizeArg::Full };
    let request = Request {
        command: std::iter::once("photonmill".to_owned()).chain(std::env::args().skip(1)).collect::<Vec<_>>().join(" "),
        size: match args.size.unwrap_or(usual) {
            SizeArg::Small => Size::Small,
            SizeArg::Full => Size::Full,
        },
        experiments: if args.only.is_empty() { Experiment::ALL.to_vec() } else { args.only.clone() },
        scale: args.scale,
        budget: Duration::from_secs_f64(args.time),
    };
    let found = bench::run(&gpu, request, cancelled, &mut |line| complain(line))?;
    if let Some(json) = json {
        write_all([(json, found.json())])?;
    }
    if let Some(folder) = &folder {
        bench::write(folder, &found)?;
    }
    say(table::text(&found).trim_end())?;
    Ok(if cancelled.load(std::sync::atomic::Ordering::Relaxed) { End::Cancelled } else { End::Finished })
}
