//! Traces single photons of a run: a photon is (seed, round, number), so its path alone is the same as in the run.

use std::time::Instant;

use super::photons::Flight;
use super::resources::SceneResources;
use super::{Round, constants, photons};
use crate::constants::{DOMAIN_CAUSTIC_PHOTONS, DOMAIN_PHOTONS, TALLY_ROWS};
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::tallies;
use crate::error::{Error, Result};
use crate::gpu::check::strict_math;
use crate::gpu::{Commands, Extent, Gpu};
use crate::ledger::fate;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::records::{LightPath, Tally};
use crate::scene::geometry::Geometry;
use crate::settings::Math;

/// Which photon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PhotonName {
    pub round: u32,
    pub photon: u32,
    /// Of the caustic map.
    pub caustic: bool,
}

impl std::fmt::Display for PhotonName {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}:{}{}", self.round, self.photon, if self.caustic { ":caustic" } else { "" })
    }
}

/// The photon as it left its light source and each surface, normalised as in the kernels, and how it ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    pub name: PhotonName,
    pub vertices: Vec<LightPath>,
    pub fate: &'static str,
    /// Nonfinite values that `--paranoid` found on this path; `None` without it.
    pub nonfinite_values: Option<NonfiniteValues>,
}

pub fn replay(gpu: &Gpu, geometry: &Geometry, plan: &ScenePlan, name: PhotonName) -> Result<Path> {
    let PhotonName { round: number, photon, caustic } = name;
    let domain = if caustic { DOMAIN_CAUSTIC_PHOTONS } else { DOMAIN_PHOTONS };
    let kind = if caustic { "caustic" } else { "global" };
    let refuse = |allowed: String| Error::setting("--replay", name, allowed);
    let rounds = plan.settings.rounds;
    if number >= rounds {
        return Err(refuse(format!("the run has rounds 0 to {}", rounds - 1)));
    }
    let Some(map) = plan.maps().find(|map| map.domain == domain) else {
        return Err(refuse(format!("this run has no {kind} map")));
    };
    if photon >= map.photons {
        return Err(refuse(format!("a round has photons 0 to {} in the {kind} map", map.photons - 1)));
    }
    if plan.settings.math == Math::Strict {
        strict_math(gpu)?;
    }
    let Flights { paths, tallies, nonfinite_values } = light_paths(gpu, geometry, plan, map, number, (photon, 1), map.bounces)?;
    Ok(Path { name, vertices: paths.concat(), fate: fate(&tallies), nonfinite_values })
}

/// Some photons in flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Flights {
    /// As they leave the lights, then those that are left after each flight.
    pub paths: Vec<Vec<LightPath>>,
    /// Their fates in each flight.
    pub tallies: Vec<Tally>,
    /// Nonfinite values that `--paranoid` found; `None` without it.
    pub nonfinite_values: Option<NonfiniteValues>,
}

/// The photons (first, count) of a round of `map`, no more than it traces at once, through `flights` flights or until
/// none is left.
pub fn light_paths(
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
    let resources = SceneResources::new(gpu, &mut commands, geometry, plan, &[])?;
    let buffers = resources.photons.as_ref().expect("a map has photons");
    let round = Round { resources: &resources, geometry, plan, number };
    photons::emit(&mut commands, round, buffers, map, chunk)?;
    let mut paths = vec![commands.read(&buffers.paths[0], chunk.1 as usize)?];
    let mut traced = 0;
    let mut left = chunk.1;
    for bounce in 0..flights {
        let parity = bounce as usize % 2;
        // Each flight starts with an empty map, so that there is always room.
        commands.fill(&buffers.counters, 0, 3, 0);
        commands.fill(&buffers.counters, 1, 1, left);
        photons::trace_flight(
            &mut commands,
            round,
            buffers,
            map,
            Flight { bounce, list: 0, parity, is_asked: false },
            Extent::Items(u64::from(left)),
        )?;
        traced += 1;
        left = commands.read(&buffers.counters, 3)?[2];
        if left == 0 {
            break;
        }
        paths.push(commands.read(&buffers.paths[1 - parity], left as usize)?);
    }
    let tallies = tallies::read(&mut commands, &buffers.tallies[usize::from(map.caustic_only)], traced.min(TALLY_ROWS))?;
    let nonfinite_values =
        if plan.settings.paranoid { Some(NonfiniteValues::read(&mut commands, &resources.nonfinite_values)?) } else { None };
    Ok(Flights { paths, tallies, nonfinite_values })
}

impl Path {
    /// A line per vertex: position, direction and flux after the vertex.
    pub fn table(&self, geometry: &Geometry, plan: &ScenePlan) -> String {
        let flux = plan.maps().find(|map| map.caustic_only == self.name.caustic).map_or(0.0, |map| map.photon_flux(geometry));
        let watts = flux * geometry.unit * geometry.unit;
        let row = |(bounce, vertex): (usize, &LightPath)| {
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
        let rows: Vec<String> = self.vertices.iter().enumerate().map(row).collect();
        let nonfinite_values =
            self.nonfinite_values.as_ref().map_or_else(String::new, |nonfinite_values| format!("\n{}", nonfinite_values.text()));
        format!("{head}\n{columns}\n{}\nthen it {}{nonfinite_values}", rows.join("\n"), self.fate)
    }
}
