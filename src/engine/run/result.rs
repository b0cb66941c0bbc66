//! What a run leaves behind.

use super::state::sum_of;
use super::watch::End;
use crate::engine::error::bias::Bias;
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::error::{Error, Result};
use crate::gpu::DeviceFacts;
use crate::ledger::{Fates, Ledger, Losses};
use crate::timings::Timings;

/// What a run leaves behind.
#[derive(Debug, Clone)]
pub struct RunResult<Plan, Film> {
    pub plan: Plan,
    pub film: Film,
    /// Of the photons of each map.
    pub(crate) fates: Vec<Fates>,
    pub timings: Timings,
    /// `None` for the CPU builder.
    pub device: Option<DeviceFacts>,
    /// Those that shared the run with it.
    pub more_devices: Vec<DeviceFacts>,
    pub end: End,
    /// The bias of the radius from extra runs; `None` without these.
    pub bias: Option<Bias>,
    /// Light that limits kept from the result.
    pub losses: Losses,
    /// Photons of a block that was cut short: they are in neither the film nor its errors nor the fates.
    pub left_out: u64,
    pub dispatches: u64,
    pub submissions: u64,
    /// Pipelines that the run made.
    pub pipelines: usize,
    /// Nonfinite values that `--paranoid` found; `None` without it.
    pub(crate) nonfinite_values: Option<NonfiniteValues>,
}

impl<Plan, Film> RunResult<Plan, Film> {
    /// Ended from outside before its last photon.
    pub fn is_cancelled(&self) -> bool {
        self.end == End::Cancelled
    }

    /// Fails if it was.
    pub fn finished(self) -> Result<Self> {
        if self.is_cancelled() { Err(Error::Interrupted) } else { Ok(self) }
    }

    /// `cpu` without a device.
    pub fn device_name(&self) -> &str {
        self.device.as_ref().map_or("cpu", |facts| &facts.name)
    }

    /// Of the photons of all maps.
    pub fn ledger(&self) -> Ledger {
        sum_of(&self.fates)
    }
}
