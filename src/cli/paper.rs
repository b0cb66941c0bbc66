//! `photonmill paper`: every figure and table of the paper, in a folder.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::progress::{ProgressArgs, ProgressReporter};
use super::values::{parse_integer, parse_threads};
use super::{DeviceArgs, End, complain, say};
use crate::error::{Error, Result, require};
use crate::measure::paper::bench::Bench;
use crate::measure::paper::{self, PaperRequest, Reproduction, published, tables, verdicts};
use crate::output::destination::Folder;
use crate::render::Seconds;
use crate::render::values::Threads;
use crate::text::counted;

#[derive(Args)]
pub(super) struct PaperArgs {
    /// Folder for pictures, tables and index.html; created if needed
    #[arg(short, long, alias = "out", value_name = "DIR", help_heading = "Output")]
    output: PathBuf,
    /// Photons per round of the large size, which is to fill the device [default: 4194304; 65536 on a CPU]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Measurements")]
    large: Option<u32>,
    /// Timed runs of each case; a first run is not timed, and the large size has at most 3. Verdicts need at least 3
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, default_value = "7", help_heading = "Measurements")]
    repeats: u32,
    /// Leave out rows of table 1 that would take longer than this
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, default_value = "90s", help_heading = "Measurements")]
    longest: Seconds,
    /// Also measure the CPU builder on this many threads, or on `all` [default: only on one]
    #[arg(long, value_name = "N|all", value_parser = parse_threads, allow_hyphen_values = true, help_heading = "Implementation")]
    threads: Option<Threads>,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

const LARGE_ON_GPU: u32 = 1 << 22;
const LARGE_ON_CPU: u32 = 1 << 16;

pub(super) fn run(args: &PaperArgs, cancelled: &AtomicBool) -> Result<End> {
    args.validate()?;
    let folder = Folder::open("-o", &args.output)?;
    let reporter = ProgressReporter::new(&args.progress);
    let gpu = args.device.open(&args.device.steady())?;
    reporter.device(gpu.as_ref());
    let is_cpu = gpu.as_ref().is_none_or(|gpu| gpu.facts().kind == "cpu");
    let request = PaperRequest {
        large: args.large.unwrap_or(if is_cpu { LARGE_ON_CPU } else { LARGE_ON_GPU }),
        repeats: args.repeats as usize,
        threads: args.threads.map_or(1, |Threads(threads)| threads),
        longest_ms: 1e3 * args.longest.0,
    };
    reporter.note(&format!(
        "plan: 4 figures, running times and table 1; {} and {} photons per round, the median of {}",
        published::PHOTONS,
        request.large,
        counted(request.repeats, "run")
    ));
    let mut progress = |line: &str| reporter.step(line);
    let found = paper::reproduce(&mut Bench::new(gpu.as_ref(), cancelled, &mut progress), request)?;
    reporter.finish();
    write(&folder, &found)?;
    if !found.complete {
        complain("incomplete: ended before the last experiment; the page has what was finished");
    }
    say(&format!("wrote {}", folder.path().join("index.html").display()))?;
    Ok(if found.complete { End::Finished } else { End::Cancelled })
}

/// Writes the page. What was measured for minutes must not be lost: if no folder takes it, the tables are printed.
fn write(folder: &Folder, found: &Reproduction) -> Result<()> {
    match paper::write(folder, found) {
        Err(error @ Error::Output { .. }) => {
            let findings = tables::findings(&verdicts::all(found));
            let tables = [tables::running_times(&found.running_times), tables::totals(&found.totals), findings];
            let text = tables.map(|table| String::from_utf8_lossy(&table).into_owned()).join("\n");
            say(text.trim_end()).and(Err(error))
        }
        written => written,
    }
}

impl PaperArgs {
    fn validate(&self) -> Result<()> {
        let smallest = published::PHOTONS + 1;
        let large = self.large.unwrap_or(smallest);
        let allowed = format!("must be from {smallest} to {MAX_LARGE} photons per round, more than the paper's");
        require((smallest..=MAX_LARGE).contains(&large), "--large", large, allowed)?;
        require((1..=MAX_REPEATS).contains(&self.repeats), "--repeats", self.repeats, format!("must be from 1 to {MAX_REPEATS}"))?;
        let is_time = self.longest.0.is_finite() && self.longest.0 > 0.0;
        require(is_time, "--longest", self.longest, "must be a time above 0, such as 90s")?;
        let threads = self.threads.map_or(1, |Threads(threads)| threads);
        require((1..=MAX_THREADS).contains(&threads), "--threads", threads, format!("must be from 1 to {MAX_THREADS}, or all"))
    }
}

const MAX_LARGE: u32 = 1 << 31;
const MAX_REPEATS: u32 = 1000;
const MAX_THREADS: usize = 1024;
