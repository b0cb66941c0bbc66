//! Options that runs of both worlds have.

use std::path::PathBuf;

use clap::Args;

use super::progress::ProgressReporter;
use super::values::{MathArg, parse_integer, parse_within};
use super::{DeviceArgs, JsonArg, TimingArgs, optional_file};
use crate::engine::run::RunResult;
use crate::error::Result;
use crate::gpu::{Gpu, Options};
use crate::output::destination::Destination;
use crate::output::trace_file;

/// What the settings of both worlds have, whatever the defaults.
#[derive(Args)]
pub(super) struct CommonArgs {
    /// Seed of the random numbers [default: 1]
    #[arg(long, value_name = "N", value_parser = parse_within(0..=u64::MAX), allow_hyphen_values = true, help_heading = "Photons")]
    pub(super) seed: Option<u64>,
    /// Rounding of the arithmetic [default: fast]
    #[arg(long, value_enum, value_name = "ROUNDING", help_heading = "Implementation")]
    pub(super) math: Option<MathArg>,
    /// Most photons traced at once; the result is the same to the bit [default: what fits on the device]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Implementation")]
    pub(super) chunk: Option<u32>,
    /// Invocations per work group, a power of two [default: 128]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Implementation")]
    pub(super) group_size: Option<u32>,
    /// Detect NaN and infinity, and print which photon, pixel, texel or point they come from
    #[arg(long, help_heading = "Checks")]
    pub(super) paranoid: bool,
}

/// Reports of a run as files.
#[derive(Args)]
pub(super) struct ReportArgs {
    #[command(flatten)]
    json: JsonArg,
    /// Write the time of every pass as a Chrome trace, for Perfetto or chrome://tracing
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    trace: Option<PathBuf>,
}

/// The outputs of [`ReportArgs`], checked before the run.
pub(super) struct Reports {
    json: Option<Destination>,
    trace: Option<Destination>,
}

impl ReportArgs {
    pub(super) fn open(&self) -> Result<Reports> {
        Ok(Reports { json: optional_file("--json", self.json.json.as_ref())?, trace: optional_file("--trace", self.trace.as_ref())? })
    }
}

impl Reports {
    pub(super) fn destinations(&self) -> Vec<Destination> {
        [&self.json, &self.trace].into_iter().flatten().cloned().collect()
    }

    /// What they hold after a run, of which `json` is the report.
    pub(super) fn files<Plan, Film>(
        self,
        run: &RunResult<Plan, Film>,
        json: impl FnOnce() -> Vec<u8>,
    ) -> impl Iterator<Item = (Destination, Vec<u8>)> {
        let json = self.json.map(|file| (file, json()));
        let trace = self.trace.map(|file| (file, trace_file::chrome_trace(&run.timings, run.device_name())));
        json.into_iter().chain(trace)
    }
}

/// The device of a run and how it is timed.
#[derive(Args)]
pub(super) struct TimedDeviceArgs {
    #[command(flatten)]
    pub(super) chosen: DeviceArgs,
    #[command(flatten)]
    timing: TimingArgs,
}

impl TimedDeviceArgs {
    pub(super) fn options(&self) -> Options {
        self.timing.options(&self.chosen)
    }

    /// The device; a scene of triangles needs one.
    pub(super) fn open(&self, reporter: &ProgressReporter) -> Result<Gpu> {
        let gpu = Gpu::open(&self.options())?;
        reporter.device(Some(&gpu));
        Ok(gpu)
    }
}
