//! What rounds are recorded with, and timed by: commands of a device, or the host's clock.

use std::time::Instant;

use crate::error::Result;
use crate::gpu::Commands;
use crate::timings::{HostClock, Timings};

pub trait Recorder {
    /// Runs `body` as a round, and times it.
    fn round(&mut self, body: impl FnOnce(&mut Self) -> Result<()>) -> Result<()>;
    /// The zero of all times.
    fn started(&self) -> Instant;
    /// Dispatches and submissions so far.
    fn counts(&self) -> [u64; 2];
    fn finish(self) -> Timings;
}

impl Recorder for Commands<'_> {
    fn round(&mut self, body: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        self.scope("round", body)
    }

    fn started(&self) -> Instant {
        self.started()
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

    fn started(&self) -> Instant {
        self.started()
    }

    fn counts(&self) -> [u64; 2] {
        [0; 2]
    }

    fn finish(self) -> Timings {
        self.finish()
    }
}
