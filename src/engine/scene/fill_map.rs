//! The photons of a scene's rounds by themselves, for a file.

use std::sync::atomic::Ordering;
use std::time::Instant;

use rayon::prelude::*;

use super::map_file::MapWriter;
use super::resources::SceneResources;
use super::{Round, constants, trace};
use crate::constants::TALLY_COPIES;
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::run::commands;
use crate::engine::{Control, Progress, tallies, totals};
use crate::error::{Error, Result};
use crate::gpu::{Commands, Gpu, Interrupt};
use crate::ledger::{Fates, Ledger};
use crate::photon::MapPhoton;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::scene::geometry::Geometry;

/// What became of it.
pub(crate) struct Filled {
    pub rounds: u32,
    /// Ended from outside before the last round.
    pub is_cancelled: bool,
    pub nonfinite_values: Option<NonfiniteValues>,
}

/// Traces the photons of all rounds of a plan that a writer lacks, and hands them to it. A round that is cut short is left out; without
/// a first one this fails.
pub(crate) fn fill(
    gpu: &Gpu,
    geometry: &Geometry,
    plan: &ScenePlan,
    writer: &mut MapWriter,
    unwritten: &dyn Fn(std::io::Error) -> Error,
    control: &mut Control,
) -> Result<Filled> {
    let started = Instant::now();
    let mut commands = commands(gpu, &trace::modules(plan), constants(plan), plan.settings.math, started)?;
    let resources = SceneResources::new(&mut commands, geometry, plan, &[])?;
    commands.set_interrupt(Some(Interrupt { cancelled: control.cancelled, deadline: None }));
    let mut ledger = Ledger::default();
    writer.drop_open_round().map_err(unwritten)?;
    let mut rounds = writer.rounds();
    while rounds < plan.settings.rounds {
        let round = Round { resources: &resources, geometry, plan, number: rounds };
        match one_round(&mut commands, round, writer, unwritten) {
            Ok(of_round) => ledger = ledger.plus(&of_round),
            Err(Error::Interrupted) if rounds > 0 => break,
            Err(error) => return Err(error),
        }
        rounds += 1;
        let seconds = started.elapsed().as_secs_f64();
        (control.progress)(&Progress {
            done: rounds.into(),
            total: plan.settings.rounds.into(),
            seconds,
            seconds_left: Some(seconds / f64::from(rounds) * f64::from(plan.settings.rounds - rounds)),
            photons: ledger.emitted,
            ledger,
            ..Progress::default()
        });
        if control.cancelled.load(Ordering::Relaxed) {
            break;
        }
    }
    commands.set_interrupt(None);
    let nonfinite_values = NonfiniteValues::found(&mut commands, &resources.nonfinite_values, plan.settings.paranoid)?;
    gpu.check_validation()?;
    Ok(Filled { rounds, is_cancelled: rounds < plan.settings.rounds, nonfinite_values })
}

fn one_round(commands: &mut Commands, round: Round, writer: &mut MapWriter, unwritten: &dyn Fn(std::io::Error) -> Error) -> Result<Ledger> {
    let mut ledger = Ledger::default();
    for map in round.plan.maps() {
        writer.begin_map();
        let fates = one_map(commands, round, map, &mut |photons| writer.add(photons).map_err(unwritten))?;
        ledger = ledger.plus(&fates.ledger());
        writer.end_map(fates);
    }
    writer.end_round();
    Ok(ledger)
}

/// Hands over the photons of a chunk in an order of their own, as the order in which a device stores them is not the same twice.
fn one_map(commands: &mut Commands, round: Round, map: &MapPlan, take: &mut dyn FnMut(&[MapPhoton]) -> Result<()>) -> Result<Fates> {
    let which = usize::from(map.caustic_only);
    let (tallies, totals) = (&round.photons().tallies[which], &round.photons().totals[which]);
    commands.clear(tallies);
    commands.clear(totals);
    let mut stored = 0;
    for chunk in map.chunks() {
        let mut found: Vec<MapPhoton> = Vec::new();
        trace::trace(commands, round, map, chunk, &mut |commands, _| trace::take_map(commands, round, map, &mut found))?;
        found.par_sort_unstable_by_key(|photon| bytemuck::cast::<MapPhoton, [u32; 8]>(*photon));
        stored += found.len() as u64;
        take(&found)?;
    }
    let rows = (round.plan.tally_rows() * TALLY_COPIES) as usize;
    let counted = tallies::sums(&commands.read(tallies, rows)?);
    let mut fates = Fates::counted(&counted, Some(totals::sum(&commands.read(totals, totals::WORDS as usize)?)));
    fates.emitted = map.photons.into();
    // Counted where a map is sorted, which this one is not.
    fates.totals.get_or_insert_default().stored = stored;
    let ledger = fates.ledger();
    if ledger.closes() && ledger.dropped == 0 { Ok(fates) } else { Err(Error::LedgerOpen { ledger }) }
}
