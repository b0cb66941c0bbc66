//! The straight line: scene, plan, resources, then rounds of photons traced, indexed and estimated;
//! [`on_gpu`] walks it with kernels, [`on_cpu`] with their twins.

mod bias;
pub mod estimate;
pub mod film;
pub mod index;
mod on_cpu;
pub(super) mod on_gpu;
pub mod resources;
mod run_state;
pub mod trace;

pub use bias::{bias_batch, measure_bias};
pub use on_cpu::{on_cpu, photons_on_cpu, replay_on_cpu};
pub use on_gpu::{constants, on_gpu, photons_on_gpu, replay_on_gpu};

use crate::engine::End;
use crate::engine::bias::Bias;
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::room::film::RoomFilm;
use crate::gpu::DeviceFacts;
use crate::ledger::{Fates, Losses};
use crate::path::Path;
use crate::photon::Photon;
use crate::plan::RoomPlan;
use crate::timings::Timings;

/// What a run leaves behind.
#[derive(Debug, Clone)]
pub struct RunResult {
    pub plan: RoomPlan,
    pub film: RoomFilm,
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
