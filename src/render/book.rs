//! Book-keeping of a run: photons emitted, their fates, and whether to go on.

use std::sync::atomic::Ordering;

use super::{Control, Progress};
use crate::error::{Error, Result};
use crate::ledger::Fates;
use crate::plan::Plan;
use crate::records::Tally;

pub(super) struct Book<'a, 'c> {
    control: &'a mut Control<'c>,
    total: u64,
    /// Photons handed out, of which `fates` may not know yet.
    pub(super) emitted: u64,
    pub(super) fates: Fates,
    /// Submissions of which the fates are booked.
    pub(super) submissions_settled: u64,
    pub(super) cancelled: bool,
}

impl<'a, 'c> Book<'a, 'c> {
    pub(super) fn new(plan: &Plan, control: &'a mut Control<'c>) -> Book<'a, 'c> {
        Book {
            control,
            total: plan.settings.total_photons(),
            emitted: 0,
            fates: Fates::new(plan.settings.bounces),
            submissions_settled: 0,
            cancelled: false,
        }
    }

    /// Photons whose fates are not booked.
    pub(super) fn open(&self) -> u64 {
        self.emitted - self.fates.emitted
    }

    /// Books the fates of all photons handed out, and says whether to stop.
    pub(super) fn settle(&mut self, tallies: &[Tally]) -> Result<bool> {
        self.fates.add(self.open(), tallies);
        let ledger = self.fates.ledger();
        if !ledger.closes() || ledger.dropped != 0 {
            return Err(Error::LedgerOpen { ledger });
        }
        let (done, total) = (self.emitted, self.total);
        (self.control.progress)(&Progress { done, total, photons: done, ..Progress::default() });
        self.cancelled = self.emitted < self.total && self.control.cancelled.load(Ordering::Relaxed);
        Ok(self.cancelled)
    }
}
