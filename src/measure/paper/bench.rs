//! The bench on which experiments run: the device if there is one, else the CPU builder; and the
//! statistics of repeated runs.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::engine::Control;
use crate::engine::room::{self, RunResult};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::scene::open_box::open_box;
use crate::settings::{Builder, RoomSettings};
use crate::text::counted;

/// What the times were measured on.
#[derive(Debug, Clone)]
pub(crate) struct Device {
    pub name: String,
    pub driver: String,
    pub has_timestamps: bool,
    /// A software device, whose 'GPU' is the CPU.
    pub is_cpu: bool,
}

pub(crate) struct Bench<'a> {
    gpu: Option<&'a Gpu>,
    cancelled: &'a AtomicBool,
    /// Told one line an experiment.
    progress: &'a mut dyn FnMut(&str),
    begun: usize,
    expected: usize,
}

/// A case is not repeated once its runs have taken this long. Four runs of 7 s fit, three of which count, as an interval
/// needs them.
pub(crate) const PATIENCE: Duration = Duration::from_secs(24);

impl<'a> Bench<'a> {
    pub(crate) fn new(gpu: Option<&'a Gpu>, cancelled: &'a AtomicBool, progress: &'a mut dyn FnMut(&str)) -> Bench<'a> {
        Bench { gpu, cancelled, progress, begun: 0, expected: 0 }
    }

    pub(crate) fn has_gpu(&self) -> bool {
        self.gpu.is_some()
    }

    /// The builder that stands for `builder` here.
    pub(crate) fn available(&self, builder: Builder) -> Builder {
        if self.has_gpu() { builder } else { Builder::Cpu }
    }

    pub(crate) fn device(&self) -> Option<Device> {
        self.gpu.map(Gpu::facts).map(|facts| Device {
            name: facts.name.clone(),
            driver: facts.driver.clone(),
            has_timestamps: facts.timestamp_bits > 0,
            is_cpu: facts.kind == "cpu",
        })
    }

    /// Sets how many experiments there will be.
    pub(crate) fn expect(&mut self, experiments: usize) {
        self.expected = experiments;
    }

    /// Begins an experiment, unless the user has had enough.
    pub(crate) fn begin(&mut self, title: &str) -> Result<()> {
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        self.begun += 1;
        (self.progress)(&format!("[{}/{}] {title}", self.begun, self.expected));
        Ok(())
    }

    /// One run to its last photon.
    pub(crate) fn run(&self, settings: &RoomSettings) -> Result<RunResult> {
        room::run(self.gpu, &open_box(settings), settings, &mut Control::quiet(self.cancelled))?.finished()
    }

    /// `repeats` runs of every case after one that is dropped, as it makes pipelines and fills caches; in turn, so that a
    /// clock that drifts touches all alike. A case that is slow is repeated less, and one whose first run alone is slow
    /// keeps that.
    pub(crate) fn repeat_interleaved(&self, cases: &[RoomSettings], repeats: usize) -> Result<Vec<Vec<RunResult>>> {
        let mut results = vec![Vec::new(); cases.len()];
        let mut spent = vec![Duration::ZERO; cases.len()];
        for turn in 0..=repeats {
            for (case, settings) in cases.iter().enumerate() {
                if spent[case] < PATIENCE {
                    let began = Instant::now();
                    let result = self.run(settings)?;
                    spent[case] += began.elapsed();
                    // The first stands until a later one has come.
                    if turn == 1 {
                        results[case].clear();
                    }
                    results[case].push(result);
                }
            }
        }
        Ok(results)
    }
}

/// The host's processor, as Linux calls it; elsewhere its architecture.
pub(crate) fn processor() -> String {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let listed = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = listed.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name.trim().to_owned()));
    format!("{}, {}", model.unwrap_or_else(|| std::env::consts::ARCH.to_owned()), counted(threads, "thread"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cancelled_bench_begins_nothing() {
        let cancelled = AtomicBool::new(true);
        let mut lines = 0;
        let mut count = |_: &str| lines += 1;
        let mut bench = Bench::new(None, &cancelled, &mut count);
        assert!(matches!(bench.begin("figure 1"), Err(Error::Interrupted)));
        assert_eq!(lines, 0);
    }

    #[test]
    fn the_first_run_is_dropped() {
        let cancelled = AtomicBool::new(false);
        let bench_settings = RoomSettings { builder: Builder::Cpu, photons: 10, mesh: 2, ..RoomSettings::default() };
        let mut silent = |_: &str| {};
        let bench = Bench::new(None, &cancelled, &mut silent);
        let results = bench.repeat_interleaved(&[bench_settings.clone(), bench_settings], 3).unwrap();
        assert_eq!(results.iter().map(Vec::len).collect::<Vec<_>>(), [3, 3]);
    }
}
