//! RunState-keeping of a run: photons emitted, their fates, the error, and whether to go on.

use std::sync::atomic::Ordering;
use std::time::Instant;

use crate::engine::room::film::{RoomFilm, irradiance_weights};
use crate::engine::watch::{Control, End, Progress, Watch};
use crate::error::{Error, Result};
use crate::ledger::{Fates, Losses};
use crate::plan::RoomPlan;
use crate::records::Tally;
use crate::scene::room::RoomScene;

pub(super) struct RunState<'a, 'c> {
    control: &'a mut Control<'c>,
    watch: Watch,
    photons_per_round: u32,
    /// Of all lights.
    watts: f64,
    most_rounds: u32,
    /// What tells errors of irradiance; made at the first look.
    weights: Option<Vec<f64>>,
    /// Photons handed out, of which `fates` may not know yet, and rounds that are whole.
    pub(super) emitted: u64,
    pub(super) rounds: u32,
    pub(super) fates: Fates,
    /// Submissions of which the fates are collected.
    pub(super) submissions_collected: u64,
    /// Why the run ends, once it does.
    pub(super) end: Option<End>,
}

impl<'a, 'c> RunState<'a, 'c> {
    /// Of a run that began at `started`.
    pub(super) fn new(plan: &RoomPlan, control: &'a mut Control<'c>, started: Instant) -> RunState<'a, 'c> {
        RunState {
            control,
            // The paper's radius never shrinks.
            watch: Watch::new(plan.settings.stop, 1.0, started),
            photons_per_round: plan.settings.photons,
            watts: plan.settings.light_power.iter().sum(),
            most_rounds: plan.settings.rounds,
            weights: None,
            emitted: 0,
            rounds: 0,
            fates: Fates::new(plan.settings.bounces),
            submissions_collected: 0,
            end: None,
        }
    }

    /// Photons whose fates are not collected.
    pub(super) fn open(&self) -> u64 {
        self.emitted - self.fates.emitted
    }

    /// Whether the run is between two rounds.
    pub(super) fn is_whole(&self) -> bool {
        self.emitted == u64::from(self.rounds) * u64::from(self.photons_per_round)
    }

    /// Whether the run may have done enough, so that its fates must be collected.
    pub(super) fn may_end(&self) -> bool {
        self.watch.has_photons(self.emitted) || (self.is_whole() && self.watch.may_end(self.rounds, self.emitted))
    }

    /// Whether the error should be looked at.
    pub(super) fn wants_film(&self) -> bool {
        self.is_whole() && self.watch.is_due(self.rounds)
    }

    /// Light that the cap on bounces kept from the result so far.
    pub(super) fn losses(&self) -> Losses {
        Losses::of_room(&self.fates, self.watts)
    }

    /// Adds the fates of all photons handed out.
    pub(super) fn count(&mut self, tallies: &[Tally]) {
        self.fates.add(self.open(), tallies);
    }

    pub(super) fn look(&mut self, film: &RoomFilm, scene: &RoomScene, plan: &RoomPlan) {
        let weights = self.weights.get_or_insert_with(|| irradiance_weights(scene, plan));
        let unknown = film.unknown(weights, 1.0, plan.settings.stop.confidence).relative;
        self.watch.look(film.rounds, film.relative_error(weights), unknown, Losses::of_room(&self.fates, self.watts).relative);
    }

    /// Books the fates of all photons handed out, and says whether to stop.
    pub(super) fn collect(&mut self) -> Result<bool> {
        self.watch.check_losses(self.fates.bounces.len() as u32)?;
        let ledger = self.fates.ledger();
        if !ledger.closes() || ledger.dropped != 0 {
            return Err(Error::LedgerOpen { ledger });
        }
        let a_round = u64::from(self.photons_per_round);
        let total = a_round * u64::from(self.most_rounds);
        let rounds = self.emitted as f64 / a_round as f64;
        let progress = self.watch.progress(rounds, self.most_rounds, a_round, ledger);
        (self.control.progress)(&Progress { done: self.emitted, total, ..progress });
        self.end = if self.emitted == total {
            Some(if self.watch.has_photons(self.emitted) { End::Photons } else { End::Rounds })
        } else {
            let cancelled = self.control.cancelled.load(Ordering::Relaxed).then_some(End::Cancelled);
            self.watch.end(self.rounds, self.emitted).or(cancelled)
        };
        Ok(self.end.is_some())
    }
}
