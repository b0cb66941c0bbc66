//! The photon ledger: integer counts of how every emitted photon ended, whose sum equals the photons emitted.

use serde::{Deserialize, Serialize};

use crate::constants::TALLY_ROWS;
use crate::records::Tally;

/// Fates of a run's photons.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Ledger {
    pub emitted: u64,
    /// Ended by the roulette at a wall.
    pub absorbed: u64,
    /// Left through an opening.
    pub escaped: u64,
    /// Still alive after the last bounce allowed, or when the run was interrupted.
    pub cut_off: u64,
    /// Lost because a buffer was full; the plan prevents that, and this counter would show it.
    pub dropped: u64,
    /// Entries of the photon map over the run. In the room a photon is stored at every bounce that reflects it, in a scene
    /// where it arrives at a surface that scatters, if the map holds light that arrived in its way.
    pub stored: u64,
}

impl Ledger {
    /// emitted = absorbed + escaped + cut off + dropped.
    pub fn closes(&self) -> bool {
        self.emitted == self.absorbed + self.escaped + self.cut_off + self.dropped
    }

    /// Of the photons of both.
    pub fn plus(&self, other: &Ledger) -> Ledger {
        Ledger {
            emitted: self.emitted + other.emitted,
            absorbed: self.absorbed + other.absorbed,
            escaped: self.escaped + other.escaped,
            cut_off: self.cut_off + other.cut_off,
            dropped: self.dropped + other.dropped,
            stored: self.stored + other.stored,
        }
    }
}

/// The equation that does or does not close.
impl std::fmt::Display for Ledger {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Ledger { emitted, absorbed, escaped, cut_off, dropped, .. } = self;
        let equals = if self.closes() { "=" } else { "is not" };
        write!(f, "{emitted} emitted {equals} {absorbed} absorbed + {escaped} escaped + {cut_off} cut off + {dropped} dropped")
    }
}

/// Relative flux per channel in units of 2^-`TOTAL_FLUX_BITS`; [`crate::plan::scene::MapPlan::photon_flux`] makes watts of it.
pub(crate) type FluxUnits = [u64; 3];

/// What the photons of a scene's map lose to limits, and how many photons the map has held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Totals {
    /// Entries of the map over all chunks.
    pub stored: u64,
    /// Photons still under way after the last bounce that is allowed, and their flux.
    pub cut_off: u64,
    pub cut_flux: FluxUnits,
    /// Photons whose flux a shading normal would have raised beyond `MAX_SHADING_GAIN`, and what they lost.
    pub clamped: u64,
    pub clamped_flux: FluxUnits,
    /// Photons that were under way when the run was interrupted, in a round that does not count. They are among those cut off.
    pub interrupted: u64,
}

impl Totals {
    /// Counts of both, by what adds or takes away.
    fn combine(&mut self, other: &Totals, combine: fn(&mut u64, u64)) {
        combine(&mut self.stored, other.stored);
        combine(&mut self.cut_off, other.cut_off);
        combine(&mut self.clamped, other.clamped);
        combine(&mut self.interrupted, other.interrupted);
        for channel in 0..3 {
            combine(&mut self.cut_flux[channel], other.cut_flux[channel]);
            combine(&mut self.clamped_flux[channel], other.clamped_flux[channel]);
        }
    }
}

/// Fates bounce by bounce, from which the ledger follows.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Fates {
    pub emitted: u64,
    /// Photons that survived each bounce, which stores them in the room, and that were absorbed, escaped and dropped there.
    /// The last count of a scene takes in all later bounces.
    pub bounces: Vec<BounceFates>,
    /// Of a scene, where a photon that survives need not be stored.
    pub totals: Option<Totals>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct BounceFates {
    pub stored: u64,
    pub absorbed: u64,
    pub escaped: u64,
    pub dropped: u64,
}

impl Fates {
    pub(crate) fn new(bounces: u32) -> Fates {
        Fates { emitted: 0, bounces: vec![BounceFates::default(); bounces as usize], totals: None }
    }

    /// Of the photons of a scene's map.
    pub(crate) fn of_scene(bounces: u32) -> Fates {
        Fates { totals: Some(Totals::default()), ..Fates::new(bounces.min(TALLY_ROWS)) }
    }

    /// Counts photons as cut off that were under way when a run was interrupted.
    pub(crate) fn interrupt(&mut self) {
        let Ledger { emitted, absorbed, escaped, cut_off, dropped, .. } = self.ledger();
        let open = emitted.saturating_sub(absorbed + escaped + cut_off + dropped);
        let totals = self.totals.get_or_insert_default();
        totals.cut_off += open;
        totals.interrupted += open;
    }

    /// Whether they are what files may hold: counts whose sum is no more than this, and flux that can be added up.
    pub(crate) fn is_sound(&self, most: u64) -> bool {
        let of_bounces = self.bounces.iter().flat_map(|bounce| [bounce.stored, bounce.absorbed, bounce.escaped, bounce.dropped]);
        let totals = self.totals.unwrap_or_default();
        let others = [self.emitted, totals.stored, totals.cut_off, totals.clamped, totals.interrupted];
        let sum: u128 = of_bounces.chain(others).map(u128::from).sum();
        sum <= most.into() && totals.cut_flux.iter().chain(&totals.clamped_flux).all(|flux| *flux <= 1 << 62)
    }

    /// What kernels have counted; nobody knows yet of how many photons.
    pub(crate) fn counted(tallies: &[Tally], totals: Option<Totals>) -> Fates {
        let fates = |tally: &Tally| BounceFates {
            stored: tally.stored.into(),
            absorbed: tally.absorbed.into(),
            escaped: tally.escaped.into(),
            dropped: tally.dropped.into(),
        };
        Fates { emitted: 0, bounces: tallies.iter().map(fates).collect(), totals }
    }

    pub(crate) fn add(&mut self, other: &Fates) {
        self.combine(other, |sum, count| *sum += count);
    }

    /// Takes away what is among these.
    pub(crate) fn subtract(&mut self, other: &Fates) {
        self.combine(other, |sum, count| *sum -= count);
    }

    fn combine(&mut self, other: &Fates, combine: fn(&mut u64, u64)) {
        assert_eq!(other.bounces.len(), self.bounces.len());
        combine(&mut self.emitted, other.emitted);
        for (fates, other) in self.bounces.iter_mut().zip(&other.bounces) {
            combine(&mut fates.stored, other.stored);
            combine(&mut fates.absorbed, other.absorbed);
            combine(&mut fates.escaped, other.escaped);
            combine(&mut fates.dropped, other.dropped);
        }
        if let Some(other) = &other.totals {
            self.totals.get_or_insert_default().combine(other, combine);
        }
    }

    pub(crate) fn ledger(&self) -> Ledger {
        let sum = |fate: fn(&BounceFates) -> u64| self.bounces.iter().map(fate).sum();
        Ledger {
            emitted: self.emitted,
            absorbed: sum(|bounce| bounce.absorbed),
            escaped: sum(|bounce| bounce.escaped),
            cut_off: self.totals.map_or_else(|| self.bounces.last().map_or(self.emitted, |last| last.stored), |totals| totals.cut_off),
            dropped: sum(|bounce| bounce.dropped),
            stored: self.totals.map_or_else(|| sum(|bounce| bounce.stored), |totals| totals.stored),
        }
    }
}

/// Light that limits kept from a result. Mean over rounds, W in all channels together.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Losses {
    /// W of all lights.
    pub emitted: f64,
    /// W of photons that were cut off after the last bounce that is allowed.
    pub cut_off: f64,
    /// W that shading normals would have added to photons beyond the limit of each.
    pub clamped: f64,
    /// Camera paths that were cut off among mirrors and glass, all rounds.
    pub camera_paths: u32,
    /// Values larger than the film holds, all rounds.
    pub clamped_values: u32,
    /// Bound of what all of these would add to the result, relative to its root mean square.
    pub relative: f64,
}

/// Further landings that a photon which was cut off is taken to miss at most.
const MOST_LANDINGS: f64 = 1e4;

impl Losses {
    /// What is lost may fall where less light is: the bound is so many times its share of all light.
    pub const SAFETY: f64 = 2.0;

    /// Of the paper's room, whose lights have so many watts and whose photons all carry alike.
    pub(crate) fn of_room(fates: &Fates, watts: f64) -> Losses {
        let Ledger { emitted, cut_off, stored, .. } = fates.ledger();
        if emitted == 0 {
            return Losses::default();
        }
        let missed = cut_off as f64 * (fates.further_landings() - 1.0);
        let relative = if missed > 0.0 { Losses::SAFETY * missed / (stored as f64 + missed) } else { 0.0 };
        Losses { emitted: watts, cut_off: watts * cut_off as f64 / emitted as f64, relative, ..Losses::default() }
    }

    /// Share of all light that is emitted.
    pub fn share(&self) -> f64 {
        if self.emitted > 0.0 { (self.cut_off + self.clamped) / self.emitted } else { 0.0 }
    }
}

impl Fates {
    /// Landings that a photon which was cut off would still have had, from the chance with which photons survived their latest
    /// bounces.
    pub(crate) fn further_landings(&self) -> f64 {
        let entered = |bounce: &BounceFates| bounce.stored + bounce.absorbed + bounce.escaped;
        let latest = self.bounces.iter().rev().take(self.bounces.len().div_ceil(2));
        let (survived, all) = latest.fold((0, 0), |(survived, all), bounce| (survived + bounce.stored, all + entered(bounce)));
        if all == 0 { 1.0 } else { (1.0 / (1.0 - survived as f64 / all as f64).max(1.0 / MOST_LANDINGS)).min(MOST_LANDINGS) }
    }
}

/// How the one photon of these tallies ended.
pub(crate) fn fate(tallies: &[Tally]) -> &'static str {
    if tallies.iter().any(|tally| tally.escaped > 0) {
        "escaped"
    } else if tallies.iter().any(|tally| tally.absorbed > 0) {
        "was absorbed"
    } else {
        "reached the bounce limit"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(stored: u32, absorbed: u32, escaped: u32, dropped: u32) -> Tally {
        Tally { stored, absorbed, escaped, dropped }
    }

    #[test]
    fn a_lost_or_doubled_photon_keeps_the_ledger_open() {
        let closed = [tally(60, 20, 20, 0), tally(30, 15, 14, 1)];
        let ledger = |tallies: &[Tally]| {
            let mut fates = Fates::new(2);
            fates.add(&Fates { emitted: 100, ..Fates::counted(tallies, None) });
            fates.ledger()
        };
        assert!(ledger(&closed).closes());
        assert_eq!((ledger(&closed).cut_off, ledger(&closed).stored, ledger(&closed).dropped), (30, 90, 1));
        for spoiled in [[tally(60, 20, 19, 0), closed[1]], [closed[0], tally(31, 15, 14, 1)]] {
            assert!(!ledger(&spoiled).closes());
        }
    }
}
