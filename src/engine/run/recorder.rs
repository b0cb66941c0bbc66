//! What rounds are recorded with, and timed by: commands of a device, or the host's clock.

use crate::error::Result;
use crate::gpu::{Commands, Gpu};
use crate::timings::{HostClock, Timings};

pub(crate) trait Recorder {
    /// Runs `body` as a round, and times it.
    fn round(&mut self, body: impl FnOnce(&mut Self) -> Result<()>) -> Result<()>;
    /// The device, and the pipelines that it made since; `None` for the CPU.
    fn device(&self) -> Option<(&Gpu, usize)>;
    /// Dispatches and submissions so far.
    fn counts(&self) -> [u64; 2];
    fn finish(self) -> Timings;
}

impl Recorder for Commands<'_> {
    fn round(&mut self, body: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        self.scope("round", body)
    }

    fn device(&self) -> Option<(&Gpu, usize)> {
        Some((self.gpu(), self.pipelines()))
    }

    fn counts(&self) -> [u64; 2] {
        [self.dispatch_count(), self.submission_count()]
    }

    fn finish(self) -> Timings {
        self.finish("run")
    }
}

/// The CPU runs everything at once.
impl Recorder for HostClock {
    fn round(&mut self, body: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        self.time("round", body)
    }

    fn device(&self) -> Option<(&Gpu, usize)> {
        None
    }

    fn counts(&self) -> [u64; 2] {
        [0; 2]
    }

    fn finish(self) -> Timings {
        self.finish()
    }
}
