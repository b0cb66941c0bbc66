//! Traces some photons of a scene by themselves.

use std::time::Instant;

use super::resources::SceneResources;
use super::trace::Flight;
use super::{Round, constants, trace};
use crate::constants::{DOMAIN_CAUSTIC_PHOTONS, DOMAIN_PHOTONS, TALLY_ROWS};
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::replay::{PhotonName, Replayed};
use crate::engine::run::check_math;
use crate::engine::tallies;
use crate::error::Result;
use crate::gpu::{Commands, Extent, Gpu};
use crate::ledger::fate;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::records::{PhotonState, Tally};
use crate::scene::geometry::Geometry;

/// The photon as it left its light source and then each surface, normalised as in the kernels.
pub(crate) fn replay(gpu: &Gpu, geometry: &Geometry, plan: &ScenePlan, name: PhotonName) -> Result<Replayed<PhotonState, PhotonState>> {
    let (domain, kind) = if name.caustic { (DOMAIN_CAUSTIC_PHOTONS, "caustic") } else { (DOMAIN_PHOTONS, "global") };
    name.check_round(plan.settings.rounds)?;
    let map = plan.maps().find(|map| map.domain == domain).ok_or_else(|| name.refused(format!("this run has no {kind} map")))?;
    name.check_photon(map.photons, &format!(" in the {kind} map"))?;
    check_math(gpu, plan.settings.math)?;
    let Flights { paths, tallies, nonfinite_values } = light_paths(gpu, geometry, plan, map, name.round, (name.photon, 1), map.bounces)?;
    let mut vertices = paths.concat();
    Ok(Replayed { name, start: vertices.remove(0), vertices, fate: fate(&tallies), nonfinite_values })
}

/// Some photons in flight.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Flights {
    /// As they leave the lights, then those that are left after each flight.
    pub paths: Vec<Vec<PhotonState>>,
    /// Their fates in each flight.
    pub tallies: Vec<Tally>,
    /// Nonfinite values that `--paranoid` found; `None` without it.
    pub nonfinite_values: Option<NonfiniteValues>,
}

/// The photons (first, count) of a round of `map`, no more than it traces at once, through `flights` flights or until
/// none is left.
pub(crate) fn light_paths(
    gpu: &Gpu,
    geometry: &Geometry,
    plan: &ScenePlan,
    map: &MapPlan,
    number: u32,
    chunk: (u32, u32),
    flights: u32,
) -> Result<Flights> {
    let plan = &plan.by_flights();
    assert!(chunk.1 <= map.chunk_photons && flights <= map.bounces, "{chunk:?}, {flights} flights of {map:?}");
    let mut commands = Commands::new(gpu, constants(plan), Instant::now())?;
    let resources = SceneResources::new(&mut commands, geometry, plan, &[])?;
    let round = Round { resources: &resources, geometry, plan, number };
    let buffers = round.photons();
    trace::emit(&mut commands, round, map, chunk)?;
    let mut paths = vec![commands.read(&buffers.paths[0], chunk.1 as usize)?];
    let mut traced = 0;
    let mut left = chunk.1;
    for bounce in 0..flights {
        let parity = bounce as usize % 2;
        // Each flight starts with an empty map, so that there is always room.
        commands.fill(&buffers.counters, 0, 3, 0);
        commands.fill(&buffers.counters, 1, 1, left);
        let flight = Flight { bounce, list: 0, parity, is_asked: false };
        trace::trace_flight(&mut commands, round, map, flight, Extent::Items(u64::from(left)))?;
        traced += 1;
        left = commands.read(&buffers.counters, 3)?[2];
        if left == 0 {
            break;
        }
        paths.push(commands.read(&buffers.paths[1 - parity], left as usize)?);
    }
    let tallies = tallies::read(&mut commands, &buffers.tallies[usize::from(map.caustic_only)], traced.min(TALLY_ROWS))?;
    let nonfinite_values = NonfiniteValues::found(&mut commands, &resources.nonfinite_values, plan.settings.paranoid)?;
    Ok(Flights { paths, tallies, nonfinite_values })
}

impl Replayed<PhotonState, PhotonState> {
    /// A line per vertex: position, direction and flux after the vertex.
    pub(crate) fn table(&self, geometry: &Geometry, plan: &ScenePlan) -> String {
        let flux = plan.maps().find(|map| map.caustic_only == self.name.caustic).map_or(0.0, |map| map.photon_flux(geometry));
        let watts = flux * geometry.unit * geometry.unit;
        let row = |(bounce, vertex): (usize, &PhotonState)| {
            let p = geometry.to_world(vertex.position);
            let (d, flux) = (vertex.direction, vertex.flux.as_dvec3() * watts);
            format!(
                "{bounce:>6} {:>11.6} {:>11.6} {:>11.6} {:>9.6} {:>9.6} {:>9.6} {:>11.4e} {:>11.4e} {:>11.4e}",
                p.x, p.y, p.z, d.x, d.y, d.z, flux.x, flux.y, flux.z
            )
        };
        let PhotonName { round, photon, caustic } = self.name;
        let head = format!("{}photon {photon} of round {round}, seed {}", if caustic { "caustic " } else { "" }, plan.settings.seed);
        let columns = format!(
            "{:>6} {:>11} {:>11} {:>11} {:>9} {:>9} {:>9} {:>11} {:>11} {:>11}",
            "bounce", "x, m", "y", "z", "dir x", "y", "z", "red, W", "green", "blue"
        );
        let rows: Vec<String> = [&self.start].into_iter().chain(&self.vertices).enumerate().map(row).collect();
        let nonfinite_values =
            self.nonfinite_values.as_ref().map_or_else(String::new, |nonfinite_values| format!("\n{}", nonfinite_values.text()));
        format!("{head}\n{columns}\n{}\nthen it {}{nonfinite_values}", rows.join("\n"), self.fate)
    }
}
