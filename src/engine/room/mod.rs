//! The paper's box: photons that land on its walls, and their density at points of these. [`on_gpu`] runs it with kernels,
//! [`on_cpu`] with their twins.

mod bias;
pub mod estimate;
pub mod film;
pub mod index;
mod on_cpu;
pub(super) mod on_gpu;
mod replay;
pub mod resources;
pub mod trace;

use std::cell::OnceCell;

pub use bias::measure_bias;
pub use on_cpu::on_cpu;
pub use on_gpu::{constants, on_gpu};
pub use replay::{photons_on_cpu, photons_on_gpu, replay};

use crate::engine::Control;
use crate::engine::error_bound::FilmError;
use crate::engine::room::film::{RoomFilm, irradiance_weights};
use crate::engine::run::{self, Task};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::ledger::{Fates, Losses};
use crate::plan::RoomPlan;
use crate::scene::room::RoomScene;
use crate::settings::{Builder, RoomSettings};

/// What a run leaves behind.
pub type RunResult = run::RunResult<RoomPlan, RoomFilm>;

/// Runs on a device or, without one and by the CPU builder, on the CPU.
pub fn run(gpu: Option<&Gpu>, scene: &RoomScene, settings: &RoomSettings, control: &mut Control) -> Result<RunResult> {
    match gpu.filter(|_| settings.builder != Builder::Cpu) {
        Some(gpu) => on_gpu(gpu, scene, settings, control),
        None => on_cpu(scene, settings, control),
    }
}

fn task<'a>(plan: &RoomPlan, device: Option<(&'a Gpu, usize)>) -> Task<'a> {
    Task {
        device,
        stop: plan.settings.stop,
        // The paper's radius never shrinks.
        alpha: 1.0,
        rounds: plan.settings.rounds,
        bounces: plan.settings.bounces,
        photons_per_round: plan.settings.photons.into(),
        parts_per_round: plan.chunks_per_round,
        photons_per_part: plan.path_capacity.into(),
        counts_photons: true,
        fates: vec![Fates::new(plan.settings.bounces)],
    }
}

/// What a film tells of its error. `weights` are [`irradiance_weights`], made at the first look.
fn error(film: &RoomFilm, scene: &RoomScene, plan: &RoomPlan, weights: &OnceCell<Vec<f64>>) -> FilmError {
    film.error(weights.get_or_init(|| irradiance_weights(scene, plan)), 1.0, plan.settings.stop.confidence)
}

/// Light that the cap on bounces kept from the result.
fn losses(plan: &RoomPlan, fates: &[Fates]) -> Losses {
    Losses::of_room(&fates[0], plan.settings.light_power.iter().sum())
}
