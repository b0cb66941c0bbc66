//! Options that runs of both worlds have.

use std::path::PathBuf;

use clap::Args;

use super::progress::ProgressReporter;
use super::{DeviceArgs, JsonArg, TimingArgs, optional_file, spell};
use crate::engine::run::RunResult;
use crate::error::{Result, require};
use crate::gpu::{DeviceFacts, Gpu, Options};
use crate::output::destination::Destination;
use crate::output::trace_file;

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
        &self,
        run: &RunResult<Plan, Film>,
        json: impl FnOnce() -> Vec<u8>,
    ) -> impl Iterator<Item = (Destination, Vec<u8>)> {
        let json = self.json.as_ref().map(|file| (file.clone(), spell(&String::from_utf8_lossy(&json())).into_bytes()));
        let trace = self.trace.as_ref().map(|file| (file.clone(), trace_file::chrome_trace(&run.timings, run.device_name())));
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

/// The devices of a run that may have several.
#[derive(Args)]
pub(super) struct DevicesOfRunArgs {
    #[command(flatten)]
    pub(super) one: TimedDeviceArgs,
    /// Share the run among several devices: `all` GPUs, or numbers as `photonmill devices` lists them. The result is that of one device,
    /// to the bit; devices of different makes need --math strict
    #[arg(long, value_name = "all|N,N,...", value_parser = parse_devices, allow_hyphen_values = true, conflicts_with = "device", help_heading = "Device")]
    devices: Option<DeviceNumbers>,
}

#[derive(Debug, Clone)]
enum DeviceNumbers {
    All,
    These(Vec<usize>),
}

fn parse_devices(text: &str) -> std::result::Result<DeviceNumbers, String> {
    if text == "all" {
        return Ok(DeviceNumbers::All);
    }
    let numbers: Option<Vec<usize>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers
        .map(DeviceNumbers::These)
        .ok_or_else(|| "must be `all`, or numbers with commas between them, as `photonmill devices` lists them".into())
}

impl DevicesOfRunArgs {
    /// The same for a run that needs none: none after one line on stderr where there is no Vulkan, and nobody asked for a device.
    pub(super) fn open_or_none(&self, reporter: &ProgressReporter) -> Result<Vec<Gpu>> {
        if self.devices.is_some() {
            return self.open(reporter);
        }
        let gpu = self.one.chosen.open(&self.one.options())?;
        gpu.iter().for_each(|gpu| reporter.device(Some(gpu)));
        Ok(gpu.into_iter().collect())
    }

    /// Refuses devices where nothing is run on any.
    pub(super) fn check_unused(&self, idle: &str) -> Result<()> {
        let DeviceArgs { device, validate, memory } = &self.one.chosen;
        require(device.is_none(), "--device", device.as_deref().unwrap_or_default(), idle)?;
        require(self.devices.is_none(), "--devices", "on", idle)?;
        require(memory.is_none(), "--memory", memory.unwrap_or_default(), idle)?;
        require(!validate, "--validate", "on", idle)
    }

    /// The devices, the one that others join first.
    pub(super) fn open(&self, reporter: &ProgressReporter) -> Result<Vec<Gpu>> {
        let numbers = match &self.devices {
            None => return self.one.open(reporter).map(|gpu| vec![gpu]),
            Some(DeviceNumbers::These(numbers)) => numbers.clone(),
            Some(DeviceNumbers::All) => {
                let all = Gpu::list()?;
                let usable = |facts: &&DeviceFacts| facts.lacks.is_empty();
                let gpus = all.iter().filter(usable).filter(|facts| facts.kind != "cpu").map(|facts| facts.index).collect::<Vec<_>>();
                // Where there is no GPU, what there is.
                if gpus.is_empty() { all.iter().filter(usable).map(|facts| facts.index).take(1).collect() } else { gpus }
            }
        };
        if let Some(DeviceNumbers::These(numbers)) = &self.devices {
            let count = Gpu::list()?.len();
            let absent = |number: &usize| format!("there is no device {number}; `photonmill devices` lists those available");
            numbers.iter().try_for_each(|number| require(*number < count, "--devices", number, absent(number)))?;
        }
        let options = |number: &usize| Options { device: Some(number.to_string()), ..self.one.options() };
        // The validation layer's table of devices has no lock (1.3.239): with it they are opened one after another.
        let opened: Vec<Result<Gpu>> = if self.one.chosen.validate {
            numbers.iter().map(|number| Gpu::open(&options(number))).collect()
        } else {
            std::thread::scope(|scope| {
                let threads: Vec<_> = numbers.iter().map(|number| scope.spawn(move || Gpu::open(&options(number)))).collect();
                threads.into_iter().map(|thread| thread.join().expect("opening a device does not panic")).collect()
            })
        };
        let gpus = opened.into_iter().collect::<Result<Vec<Gpu>>>()?;
        gpus.iter().for_each(|gpu| reporter.device(Some(gpu)));
        require(!gpus.is_empty(), "--devices", "all", "names no device: there is none; see `photonmill devices`")?;
        Ok(gpus)
    }
}
