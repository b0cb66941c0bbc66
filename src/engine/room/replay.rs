//! Photons of the box in a list: all of the map of round 0, or those of one photon by itself.

use std::time::Instant;

use super::on_cpu::{self, photons_of_blocks, tallies_of};
use super::on_gpu::constants;
use super::resources::RoomResources;
use super::{Chunk, trace};
use crate::constants::NO_WALL;
use crate::cpu::trace::Tracer;
use crate::engine;
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::replay::{PhotonName, Replayed};
use crate::engine::run::check_math;
use crate::engine::tallies;
use crate::error::Result;
use crate::gpu::{Commands, Gpu};
use crate::ledger::fate;
use crate::photon::Photon;
use crate::photon_state::{self, PhotonState};
use crate::plan::{EmissionRange, RoomPlan, photons_of};
use crate::scene::room::RoomScene;
use crate::settings::RoomSettings;
use crate::text::counted;

/// One photon of a run, on a device or, without one, on the CPU.
pub(crate) fn replay(
    gpu: Option<&Gpu>,
    scene: &RoomScene,
    settings: &RoomSettings,
    name: PhotonName,
) -> Result<Replayed<PhotonState, Photon>> {
    if name.caustic {
        return Err(name.refused("must be ROUND:PHOTON here: the paper's box has no caustic map"));
    }
    settings.validate()?;
    name.check_round(settings.rounds)?;
    name.check_photon(settings.photons, "")?;
    match gpu {
        Some(gpu) => replay_on_gpu(gpu, scene, settings, name),
        None => replay_on_cpu(scene, settings, name),
    }
}

fn replay_on_gpu(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings, name: PhotonName) -> Result<Replayed<PhotonState, Photon>> {
    let whole = RoomPlan::new(scene, settings, &engine::limits(gpu.facts()))?;
    let plan = RoomPlan { keeps_origins: true, counters: 1, path_capacity: 1, photon_capacity: settings.bounces, ..whole };
    check_math(gpu, settings.math)?;
    let ranges = [plan.range_of(name.photon)];
    let mut commands = Commands::new(gpu, constants(&plan), Instant::now())?;
    let resources = RoomResources::new(&mut commands, scene, &plan)?;
    trace::emit(&mut commands, &resources, &plan, name.round, &ranges)?;
    let start = photon_state::unpack(&commands.read(&resources.paths[0], 1)?, 0);
    let vertices = stored(&mut commands, &resources, scene, &plan, name.round, &ranges)?;
    let tallies = tallies::read(&mut commands, &resources.tallies, settings.bounces)?;
    let nonfinite_values = NonfiniteValues::found(&mut commands, &resources.nonfinite_values, settings.paranoid)?;
    gpu.check_validation()?;
    Ok(Replayed { name, start, vertices, fate: fate(&tallies), nonfinite_values })
}

fn replay_on_cpu(scene: &RoomScene, settings: &RoomSettings, name: PhotonName) -> Result<Replayed<PhotonState, Photon>> {
    let plan = on_cpu::plan(scene, settings)?;
    let tracer = Tracer::new(scene, &plan);
    let ranges = [plan.range_of(name.photon)];
    let start = tracer.emit(name.round, &ranges)[0];
    let mut nonfinite_values = NonfiniteValues::default();
    let mut blocks = Vec::new();
    tracer.trace(name.round, &ranges, &mut blocks);
    let tallies = tallies_of(&blocks, name.round, &plan, &mut nonfinite_values);
    let nonfinite_values = settings.paranoid.then_some(nonfinite_values);
    Ok(Replayed { name, start, vertices: photons_of_blocks(&blocks), fate: fate(&tallies), nonfinite_values })
}

/// The photon map of round 0, for comparing builders.
pub(crate) fn photons_on_gpu(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> Result<Vec<Photon>> {
    let plan = RoomPlan { keeps_origins: true, ..RoomPlan::new(scene, settings, &engine::limits(gpu.facts()))? };
    let mut commands = Commands::new(gpu, constants(&plan), Instant::now())?;
    let resources = RoomResources::new(&mut commands, scene, &plan)?;
    let mut photons = Vec::new();
    for ranges in plan.chunks() {
        photons.extend(stored(&mut commands, &resources, scene, &plan, 0, &ranges)?);
    }
    gpu.check_validation()?;
    Ok(photons)
}

/// The same by the CPU builder.
#[cfg(test)]
pub(crate) fn photons_on_cpu(scene: &RoomScene, settings: &RoomSettings) -> Result<Vec<Photon>> {
    let plan = on_cpu::plan(scene, settings)?;
    let pool = on_cpu::thread_pool(settings)?;
    let tracer = Tracer::new(scene, &plan);
    let mut blocks = Vec::new();
    let of_chunk = |ranges: Vec<EmissionRange>| {
        pool.install(|| tracer.trace(0, &ranges, &mut blocks));
        photons_of_blocks(&blocks)
    };
    Ok(plan.chunks().flat_map(of_chunk).collect())
}

/// What a chunk leaves in the photon map.
fn stored(
    commands: &mut Commands,
    resources: &RoomResources,
    scene: &RoomScene,
    plan: &RoomPlan,
    round: u32,
    ranges: &[EmissionRange],
) -> Result<Vec<Photon>> {
    trace::chunk(commands, resources, plan, round, ranges)?;
    let capacity = Chunk { resources, plan, photon_count: photons_of(ranges) }.photon_list_capacity();
    let length = if plan.has_slots() { capacity } else { commands.read(&resources.counters, 1)?[0].min(capacity) };
    let photons = commands.read(&resources.photons, length as usize)?;
    let origins = commands.read(&resources.origins, length as usize)?;
    let room = scene.room_record();
    let stored = photons.into_iter().zip(origins).map(|(photon, origin)| photon.photon(origin, &room));
    Ok(stored.filter(|photon| photon.wall != NO_WALL).collect())
}

impl Replayed<PhotonState, Photon> {
    /// A line per place where it is stored: position and weight at the eye.
    pub(crate) fn table(&self, scene: &RoomScene, seed: u64) -> String {
        let name_of = |wall: u32| scene.faces[wall as usize].as_ref().map_or("opening", |wall| wall.name);
        let PhotonName { round, photon, .. } = self.name;
        let (start, p, d) = (name_of(self.start.wall), self.start.position, self.start.direction);
        let mut lines = vec![
            format!("photon {photon} of round {round}, seed {seed}"),
            format!("{:>6} {:<8} {:>10} {:>10} {:>10} {:>10}", "bounce", "wall", "x, m", "y", "z", "weight"),
            format!("{:>6} {start:<8} {:>10.6} {:>10.6} {:>10.6}   towards {:.6}, {:.6}, {:.6}", "light", p.x, p.y, p.z, d.x, d.y, d.z),
        ];
        lines.extend(self.vertices.iter().map(|photon| {
            let (wall, p) = (name_of(photon.wall), photon.position);
            format!("{:>6} {wall:<8} {:>10.6} {:>10.6} {:>10.6} {:>10.6}", photon.bounce + 1, p.x, p.y, p.z, photon.weight)
        }));
        lines.push(format!("stored {}, then it {}", counted(self.vertices.len(), "time"), self.fate));
        lines.extend(self.nonfinite_values.as_ref().map(NonfiniteValues::text));
        lines.join("\n")
    }
}
