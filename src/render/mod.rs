//! The straight line: scene, plan, resources, then rounds of photons traced, indexed and estimated;
//! [`on_gpu`] walks it with kernels, [`on_cpu`] with their twins.

mod bias;
mod choice;
mod on_cpu;
mod on_gpu;
mod run_state;
pub mod stop;

use std::sync::atomic::AtomicBool;

use serde::Serialize;

pub use bias::{bias_batch, measure_bias};
pub use choice::{Candidate, Choice, choose_builder};
pub use on_cpu::{on_cpu, photons_on_cpu, replay_on_cpu};
pub use on_gpu::{constants, limits, on_gpu, photons_on_gpu, replay_on_gpu};

use crate::bias::Bias;
use crate::film::Film;
use crate::gpu::DeviceFacts;
use crate::ledger::{Fates, Ledger, Losses};
use crate::nonfinite_values::NonfiniteValues;
use crate::path::Path;
use crate::photon::Photon;
use crate::plan::Plan;
use crate::timings::Timings;
use stop::End;

/// How a caller watches a run and ends it early.
pub struct Control<'a> {
    /// Set from outside to end the run after the photons, or the round, under way.
    pub cancelled: &'a AtomicBool,
    /// Told from time to time how far the run has come.
    pub progress: &'a mut dyn FnMut(&Progress),
}

/// How far a run has come.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Progress {
    /// Photons emitted, or rounds done, and how many there will be at most.
    pub done: u64,
    pub total: u64,
    /// Wall time since the start, and predicted until the end, seconds.
    pub seconds: f64,
    pub seconds_left: Option<f64>,
    /// Relative error that the result has not more of, with the confidence asked for, and the one that is wanted.
    pub error: Option<f64>,
    pub error_wanted: Option<f64>,
    /// Photons traced so far, of all maps.
    pub photons: u64,
    /// Their fates so far.
    pub ledger: Ledger,
}

/// What a run leaves behind.
#[derive(Debug, Clone)]
pub struct RunResult {
    pub plan: Plan,
    pub film: Film,
    pub fates: Fates,
    pub timings: Timings,
    /// `None` for the CPU builder.
    pub device: Option<DeviceFacts>,
    pub end: End,
    /// The run was ended from outside before its last photon.
    pub cancelled: bool,
    /// The bias of the radius; `None` where it was not measured.
    pub bias: Option<Bias>,
    /// Light that limits kept from the result.
    pub losses: Losses,
    pub dispatches: u64,
    pub submissions: u64,
    /// Nonfinite values that `--paranoid` found; `None` without it.
    pub nonfinite_values: Option<NonfiniteValues>,
}

/// One photon of a run by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// As it leaves its light.
    pub start: Path,
    pub stored: Vec<Photon>,
    pub fate: &'static str,
    /// Nonfinite values that `--paranoid` found; `None` without it.
    pub nonfinite_values: Option<NonfiniteValues>,
}
