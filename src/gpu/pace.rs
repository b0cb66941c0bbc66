//! How much work is handed to the device at once: as much as takes a fraction of a second, which is learnt while a run goes on.

use std::collections::HashMap;
use std::time::Duration;

/// What work takes on this device and in this scene, by the scope in which it is done: so that neither a dispatch nor a submission takes
/// long.
#[derive(Default)]
pub(super) struct Pace {
    /// Nothing is learnt, and all that a plan allows is done at once.
    by_plan: bool,
    /// Since the last submission.
    work: HashMap<String, u64>,
    known: HashMap<String, Known>,
}

/// What is known of a scope.
#[derive(Default)]
struct Known {
    /// That a unit of work took lately at most; 0 as long as all of it took too little time to measure.
    seconds: f64,
    /// Work that was done between two submissions at most.
    most: u64,
}

/// What work of one scope should take between two submissions: half of what a dispatch may, as not all pieces are alike.
const PIECE_TIME: f64 = 0.025;
/// Share of a plan's work per submission that is taken at once as long as nobody knows how long it takes.
const FIRST_SHARE: u64 = 256;
/// Less says nothing of a unit of work: it is the time of starting a dispatch that leaves most of a device idle.
const LEAST_TIME: f64 = 0.002;
/// How many times as much is dared as was ever done at once, as not all parts of a picture are alike.
const GROWTH: u64 = 4;
/// What is left of a time once another was measured: what is slow in one part of a picture comes again in the next round.
const MEMORY: f64 = 0.97;
/// What a submission should take: short enough that a run ends soon after it is asked to.
const SUBMISSION_TIME: f64 = 0.1;

impl Pace {
    pub(super) fn new(by_plan: bool) -> Pace {
        Pace { by_plan, ..Pace::default() }
    }

    /// Counts work that was recorded in a scope.
    pub(super) fn add_work(&mut self, scope: String, amount: u64) {
        *self.work.entry(scope).or_default() += amount;
    }

    /// Whether what is recorded in a scope should run before more of it is.
    pub(super) fn is_due(&self, scope: &str, most: u64) -> bool {
        self.work.get(scope).copied().unwrap_or(0) >= self.fits(scope, most)
    }

    /// Whether all that is recorded will take as long as a submission should.
    pub(super) fn is_long(&self) -> bool {
        self.expected() >= SUBMISSION_TIME
    }

    /// Units of work of a scope that may be done at once, where a plan allows so many.
    pub(super) fn fits(&self, scope: &str, most: u64) -> u64 {
        if self.by_plan {
            return most;
        }
        let fits = self.known.get(scope).map_or(most / FIRST_SHARE, |known| {
            let at_once = known.most.max(most / FIRST_SHARE).saturating_mul(GROWTH);
            if known.seconds > 0.0 { at_once.min((PIECE_TIME / known.seconds) as u64) } else { at_once }
        });
        fits.min(most).max(1)
    }

    /// Seconds that what was recorded will take, as far as that is known.
    fn expected(&self) -> f64 {
        self.work.iter().filter_map(|(scope, work)| Some(self.known.get(scope)?.seconds * *work as f64)).sum()
    }

    /// Takes what scopes took in a submission.
    pub(super) fn learn(&mut self, took: &HashMap<&str, Duration>) {
        for (scope, work) in self.work.drain().filter(|(_, work)| *work > 0 && !self.by_plan) {
            let Some(took) = took.get(scope.as_str()) else { continue };
            let known = self.known.entry(scope).or_default();
            let took = took.as_secs_f64();
            known.seconds = if took < LEAST_TIME { 0.0 } else { took / work as f64 }.max(MEMORY * known.seconds);
            known.most = known.most.max(work);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learns(pace: &mut Pace, scope: &'static str, work: u64, millis: u64) {
        pace.work.insert(scope.to_owned(), work);
        pace.learn(&HashMap::from([(scope, Duration::from_millis(millis))]));
    }

    #[test]
    fn pieces_become_as_long_as_they_may_be() {
        const MOST: u64 = 1 << 20;
        let mut pace = Pace::default();
        assert_eq!(pace.fits("a", MOST), MOST / FIRST_SHARE);
        // Twice as slow as it may be, then fast: it is not trusted at once.
        learns(&mut pace, "a", 1 << 18, 50);
        assert_eq!(pace.fits("a", MOST), 1 << 17);
        learns(&mut pace, "a", 1 << 17, 1);
        assert!((130_000..140_000).contains(&pace.fits("a", MOST)), "{}", pace.fits("a", MOST));
        (0..200).for_each(|_| learns(&mut pace, "a", 1 << 17, 1));
        assert_eq!(pace.fits("a", MOST), MOST);
        // Slow beyond measure, and what nothing is known of.
        learns(&mut pace, "a", 1, 1_000_000);
        assert_eq!((pace.fits("a", MOST), pace.fits("b", MOST)), (1, MOST / FIRST_SHARE));
        // Little that was fast says little of much.
        learns(&mut pace, "c", 1 << 13, 1);
        assert_eq!(pace.fits("c", MOST), GROWTH << 13);
        // A scope without work says nothing.
        learns(&mut pace, "b", 0, 1000);
        assert_eq!(pace.fits("b", MOST), MOST / FIRST_SHARE);
    }
}
