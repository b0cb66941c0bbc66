//! The paper's box: photons that land on its walls, and their density at points of these. `on_gpu` runs it with kernels,
//! `on_cpu` with their twins.

mod bias;
pub(crate) mod estimate;
pub mod film;
pub(crate) mod index;
pub(crate) mod live;
mod on_cpu;
pub(super) mod on_gpu;
mod replay;
pub(crate) mod resources;
pub(crate) mod trace;

use std::cell::OnceCell;

pub(crate) use bias::measure_bias;
pub(crate) use on_cpu::on_cpu;
pub(crate) use on_gpu::{constants, on_gpu};
#[cfg(test)]
pub(crate) use replay::photons_on_cpu;
pub(crate) use replay::{photons_on_gpu, replay};

use crate::engine::Control;
use crate::engine::room::film::{RoomFilm, irradiance_weights};
use crate::engine::room::resources::RoomResources;
use crate::engine::run::identity::{Hash, Identity};
use crate::engine::run::saved::SavedFilm;
use crate::engine::run::watch::Checkpointing;
use crate::engine::run::{self, Task};
use crate::error::{Result, require};
use crate::gpu::{DeviceFacts, Gpu};
use crate::ledger::{Fates, Losses};
use crate::plan::RoomPlan;
use crate::plan::latest_blocks::kept_count;
use crate::scene::room::RoomScene;
use crate::settings::{Builder, RoomSettings, Sums};

/// What a run leaves behind.
pub type RunResult = run::RunResult<RoomPlan, RoomFilm>;

/// Runs on a device or, without one and by the CPU builder, on the CPU.
pub(crate) fn run(gpu: Option<&Gpu>, scene: &RoomScene, settings: &RoomSettings, control: &mut Control) -> Result<RunResult> {
    match gpu.filter(|_| settings.builder != Builder::Cpu) {
        Some(gpu) => on_gpu(gpu, scene, settings, control),
        None => on_cpu(scene, settings, control),
    }
}

/// Photons that are traced together: what the stages of their way to the film share.
#[derive(Clone, Copy)]
pub(crate) struct Chunk<'a> {
    pub resources: &'a RoomResources,
    pub plan: &'a RoomPlan,
    pub photon_count: u32,
}

impl Chunk<'_> {
    /// Entries of the photon map that it uses: all slots, or as many as there is room for.
    pub(crate) fn photon_list_capacity(self) -> u32 {
        let Chunk { plan, photon_count, .. } = self;
        if plan.has_slots() { (photon_count * plan.settings.bounces).min(plan.photon_capacity) } else { plan.photon_capacity }
    }
}

/// What a run of a plan is to do.
pub(crate) fn task<'a>(scene: &'a RoomScene, plan: &'a RoomPlan) -> Task<'a, RoomFilm> {
    let weights = OnceCell::new();
    Task {
        identity: None,
        sensor: None,
        stop: plan.settings.stop,
        // The paper's radius never shrinks.
        alpha: 1.0,
        rounds: plan.settings.rounds,
        // Rounds are independent of one another.
        rounds_per_block: 1,
        bounces: plan.settings.bounces,
        photons_per_round: plan.settings.photons.into(),
        parts_per_round: plan.chunks_per_round,
        photons_per_part: plan.path_capacity.into(),
        counts_photons: true,
        fates: fates(plan),
        can_go_on: plan.settings.sums == Sums::Integer,
        error: Box::new(move |film| film.error(weights.get_or_init(|| irradiance_weights(scene, plan)), 1.0, &plan.settings.stop)),
        losses: Box::new(|_, fates| Losses::of_room(&fates[0], plan.settings.light_power.iter().sum())),
    }
}

fn fates(plan: &RoomPlan) -> Vec<Fates> {
    vec![Fates::new(plan.settings.bounces)]
}

/// What a run of the box computes, where it is kept.
fn identity(
    checkpointing: &mut Checkpointing,
    scene: &RoomScene,
    plan: &RoomPlan,
    device: Option<&DeviceFacts>,
) -> Result<Option<Identity>> {
    let settings = &plan.settings;
    let identity = checkpointing.identity(|name| {
        let (mut content, mut found) = (Hash::default(), Hash::default());
        content.add_text(&format!("{scene:?}"));
        found.add_text(&format!("{} {} {:?} {:?}", plan.channel_count, plan.film_shift, plan.light_photons, plan.relative_flux));
        Identity::new(name, content, settings, found, device, settings.math)
    })?;
    let is_kept = identity.is_some() || checkpointing.share.of > 1;
    let allowed = "must be integer with `checkpoint`, `resume` and `shard`, whose sums are the same to the bit in any order";
    require(!is_kept || settings.sums == Sums::Integer, "sums", format!("{:?}", settings.sums).to_lowercase(), allowed)?;
    let (places, channels) = (plan.points.len(), plan.channel_count);
    checkpointing.check_resumed(|saved| {
        matches!(&saved.film, SavedFilm::Room(film) if film.channel_count == channels)
            && saved.has_lengths(&fates(plan), places * channels as usize, kept_count(places))
    })?;
    Ok(identity)
}
