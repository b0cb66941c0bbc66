//! `photonmill bench`: every pass beside the device's limits.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::{Args, ValueEnum};

use super::progress::{ProgressArgs, ProgressReporter};
use super::{DeviceArgs, End, JsonArg, optional_file, say_beside};
use crate::error::{Result, require};
use crate::gpu::Gpu;
use crate::measure::bench::experiments::{self, Experiment};
use crate::measure::bench::{self, BenchRequest, Size, table};
use crate::output::destination::{Destination, Folder, check_distinct, write_all};
use crate::render::Seconds;
use crate::scene::Scene;

#[derive(Args)]
pub(super) struct BenchArgs {
    /// Folder for the report as a page, JSON and text, and for charts; created if needed
    #[arg(short, long, alias = "out", value_name = "DIR", help_heading = "Output")]
    output: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArg,
    /// Start no further experiment after this time: 90s, 10m
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, default_value = "10m", help_heading = "When to stop")]
    time: Seconds,
    /// Run only these experiments, separated by commas: open-box, builders, table-1, index, gather, cornell, mesh,
    /// compaction [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = parse_experiment, help_heading = "Measurements")]
    only: Vec<Experiment>,
    /// Size of the experiments [default: full on a GPU, small on a CPU]
    #[arg(long, alias = "size", value_enum, value_name = "SIZE", help_heading = "Measurements")]
    workload: Option<WorkloadArg>,
    /// Built-in scene or glTF file in which `compaction` compares the builders, beside the paper's box
    #[arg(long, value_name = "SCENE", default_value = "cornell-spheres", help_heading = "Measurements")]
    scene: String,
    /// Measure time and memory against the number of photons and of triangles instead
    #[arg(long, conflicts_with = "only", help_heading = "Measurements")]
    scale: bool,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum WorkloadArg {
    /// Seconds in all
    Small,
    /// Minutes in all
    Full,
}

fn parse_experiment(name: &str) -> std::result::Result<Experiment, String> {
    experiments::by_name(name).ok_or_else(|| format!("must be one of {}", experiments::ALL.map(|experiment| experiment.name).join(", ")))
}

pub(super) fn run(args: &BenchArgs, cancelled: &AtomicBool) -> Result<End> {
    require((1.0..=1e6).contains(&args.time.0), "--time", args.time, "must be from 1s to 1000000s")?;
    let json = optional_file("--json", args.json.json.as_ref())?;
    let folder = args.output.as_ref().map(|path| Folder::open("-o", path)).transpose()?;
    let in_folder = folder.iter().map(|folder| folder.file("bench.json"));
    check_distinct(&json.iter().cloned().chain(in_folder).collect::<Vec<_>>())?;
    let reporter = ProgressReporter::new(&args.progress);
    let scene = Scene::open(&args.scene, false)?;
    let gpu = Gpu::open(&args.device.steady())?;
    reporter.device(Some(&gpu));
    let usual = if gpu.facts().kind == "cpu" { WorkloadArg::Small } else { WorkloadArg::Full };
    let request = BenchRequest {
        command: std::iter::once("photonmill".to_owned()).chain(std::env::args().skip(1)).collect::<Vec<_>>().join(" "),
        size: match args.workload.unwrap_or(usual) {
            WorkloadArg::Small => Size::Small,
            WorkloadArg::Full => Size::Full,
        },
        experiments: if args.only.is_empty() { experiments::ALL.to_vec() } else { args.only.clone() },
        scene: Some(scene),
        scale: args.scale,
        budget: Duration::from_secs_f64(args.time.0),
    };
    let names: Vec<&str> = request.experiments.iter().map(|experiment| experiment.name).collect();
    let what = if args.scale { "time and memory against photons and triangles".to_owned() } else { names.join(", ") };
    reporter.note(&format!("plan: {what}; starts no experiment after {} s", args.time.0));
    let found = bench::run(&gpu, request, cancelled, &mut |line| reporter.step(line))?;
    reporter.finish();
    let to_stdout = json.iter().any(Destination::is_standard_output).then(|| json.clone()).flatten();
    let in_file = json.map_or(Ok(()), |json| write_all([(json, found.json())]));
    let written = in_file.and(folder.map_or(Ok(()), |folder| bench::write(&folder, &found)));
    say_beside(&to_stdout, table::text(&found).trim_end())?;
    written?;
    Ok(if cancelled.load(std::sync::atomic::Ordering::Relaxed) { End::Cancelled } else { End::Finished })
}
