//! The photon ledger: integer counts of how every emitted photon ended, whose sum equals the photons emitted.

use serde::Serialize;

use crate::records::Tally;

/// Fates of a run's photons.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Ledger {
    pub emitted: u64,
    /// Ended by the roulette at a wall.
    pub absorbed: u64,
    /// Left through an opening.
    pub escaped: u64,
    /// Still alive after the last bounce allowed.
    pub cut_off: u64,
    /// Lost because a buffer was full; the plan prevents that, and this counter would show it.
    pub dropped: u64,
    /// Entries of the photon map over the run: a photon is stored at every bounce that reflects it.
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

/// Fates bounce by bounce, from which the ledger follows.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Fates {
    pub emitted: u64,
    /// Photons stored, absorbed, escaped and dropped at each bounce.
    pub bounces: Vec<BounceFates>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct BounceFates {
    pub stored: u64,
    pub absorbed: u64,
    pub escaped: u64,
    pub dropped: u64,
}

impl Fates {
    pub fn new(bounces: u32) -> Fates {
        Fates { emitted: 0, bounces: vec![BounceFates::default(); bounces as usize] }
    }

    pub fn add(&mut self, emitted: u64, tallies: &[Tally]) {
        assert_eq!(tallies.len(), self.bounces.len());
        self.emitted += emitted;
        for (sum, tally) in self.bounces.iter_mut().zip(tallies) {
            sum.stored += u64::from(tally.stored);
            sum.absorbed += u64::from(tally.absorbed);
            sum.escaped += u64::from(tally.escaped);
            sum.dropped += u64::from(tally.dropped);
        }
    }

    pub fn ledger(&self) -> Ledger {
        let sum = |fate: fn(&BounceFates) -> u64| self.bounces.iter().map(fate).sum();
        Ledger {
            emitted: self.emitted,
            absorbed: sum(|bounce| bounce.absorbed),
            escaped: sum(|bounce| bounce.escaped),
            cut_off: self.bounces.last().map_or(self.emitted, |last| last.stored),
            dropped: sum(|bounce| bounce.dropped),
            stored: sum(|bounce| bounce.stored),
        }
    }
}

/// How the one photon of these tallies ended.
pub fn fate(tallies: &[Tally]) -> &'static str {
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
            fates.add(100, tallies);
            fates.ledger()
        };
        assert!(ledger(&closed).closes());
        assert_eq!((ledger(&closed).cut_off, ledger(&closed).stored, ledger(&closed).dropped), (30, 90, 1));
        for spoiled in [[tally(60, 20, 19, 0), closed[1]], [closed[0], tally(31, 15, 14, 1)]] {
            assert!(!ledger(&spoiled).closes());
        }
    }

    #[test]
    fn totals_exceed_32_bits() {
        let mut fates = Fates::new(1);
        for _ in 0..4 {
            fates.add(u64::from(u32::MAX), &[tally(u32::MAX, 0, 0, 0)]);
        }
        assert_eq!(fates.ledger().stored, 4 * u64::from(u32::MAX));
        assert!(fates.ledger().closes());
    }
}
