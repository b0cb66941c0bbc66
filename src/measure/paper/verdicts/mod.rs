//! Which of the paper's findings still hold, decided by intervals of this run's measurements.

mod light;
mod times;

use super::Reproduction;
use super::experiments::Pass;
use crate::measure::interval::{Decision, Interval};
use crate::output::words::number;

pub(crate) use light::{figure_1, figure_3};

/// What became of something that the paper found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Standing {
    Holds,
    HoldsInPart,
    NoLonger,
    Undecided,
}

impl Standing {
    /// Of a claim that was tried several times; `None` if never.
    fn of(trials: impl IntoIterator<Item = Decision>) -> Option<Standing> {
        let trials: Vec<Decision> = trials.into_iter().collect();
        let any = |decision| trials.contains(&decision);
        match (any(Decision::Yes), any(Decision::No), any(Decision::Undecided)) {
            (false, false, false) => None,
            (true, true, _) => Some(Standing::HoldsInPart),
            (_, _, true) => Some(Standing::Undecided),
            (true, false, false) => Some(Standing::Holds),
            (false, true, false) => Some(Standing::NoLonger),
        }
    }

    pub(crate) fn words(self) -> &'static str {
        self.in_words()[0]
    }

    /// The same of what a figure shows.
    pub(crate) fn words_for_figures(self) -> &'static str {
        self.in_words()[1]
    }

    /// Its class in the style sheet.
    pub(crate) fn class(self) -> &'static str {
        self.in_words()[2]
    }

    fn in_words(self) -> [&'static str; 3] {
        match self {
            Standing::Holds => ["still holds", "the same is seen", "holds"],
            Standing::HoldsInPart => ["holds in part", "the same is seen in part", "in-part"],
            Standing::NoLonger => ["no longer holds", "the same is not seen", "no-longer"],
            Standing::Undecided => ["not decided by this run", "not decided by this run", "undecided"],
        }
    }
}

/// One finding of the paper, or one that this run adds.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Verdict {
    pub topic: &'static str,
    /// What the paper found, in a few words.
    pub then: String,
    /// The same here, with its interval.
    pub here: String,
    /// What was measured besides, in a few words; empty: nothing.
    pub elsewhere: String,
    /// What it means.
    pub text: String,
    /// Every number that counts.
    pub evidence: Vec<Evidence>,
    /// `None` where the paper claims nothing.
    pub standing: Option<Standing>,
}

impl Verdict {
    /// A claim of the paper's, which stands as the evidence decides; `None` where nothing does.
    fn decided(self) -> Option<Verdict> {
        let standing = Some(Standing::of(self.evidence.iter().filter_map(|one| one.decision))?);
        Some(Verdict { standing, ..self })
    }

    /// 'holds at 2, not decided at 2 of 4'; empty where every number decides alike.
    pub(crate) fn split(&self) -> String {
        let all: Vec<Decision> = self.evidence.iter().filter_map(|one| one.decision).collect();
        let parts: Vec<String> = [Decision::Yes, Decision::No, Decision::Undecided]
            .into_iter()
            .map(|decision| (decision, all.iter().filter(|one| **one == decision).count()))
            .filter(|(_, count)| *count > 0)
            .map(|(decision, count)| format!("{} at {count}", decision.words()))
            .collect();
        if parts.len() > 1 { format!("{} of {}", parts.join(", "), all.len()) } else { String::new() }
    }
}

/// One measured number, and whether it supports the claim.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Evidence {
    pub what: String,
    pub interval: Interval,
    pub quantity: Quantity,
    /// `None` where the paper claims nothing.
    pub decision: Option<Decision>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// A ratio.
    Factor,
    /// A part of a whole, shown in percent.
    Share,
    Exponent,
}

impl Quantity {
    /// '1.36 × (1.31 to 1.41)'; the value alone where too few runs bound it.
    pub(crate) fn shown(self, interval: &Interval) -> String {
        let (digits, unit): (fn(f64) -> String, &str) = match self {
            Quantity::Factor => (number, "\u{a0}×"),
            Quantity::Share => (|share| number(100.0 * share), "\u{a0}%"),
            Quantity::Exponent => (|value| format!("{value:.2}"), ""),
        };
        let value = digits(interval.value) + unit;
        if interval.is_bounded() { format!("{value} ({} to {})", digits(interval.low), digits(interval.high)) } else { value }
    }
}

impl Evidence {
    /// A factor that supports the claim where it is above [`MARGIN`].
    fn above_margin(what: String, interval: Interval) -> Evidence {
        Evidence { what, interval, quantity: Quantity::Factor, decision: Some(interval.above(MARGIN)) }
    }

    pub(crate) fn shown(&self) -> String {
        self.quantity.shown(&self.interval)
    }
}

/// Factors closer to 1 count as no difference.
pub(crate) const MARGIN: f64 = 1.1;

pub(crate) fn all(found: &Reproduction) -> Vec<Verdict> {
    let verdicts = [
        times::append(found),
        times::packed(found),
        times::on_gpu(found, Pass::Map),
        times::on_gpu(found, times::BRUTE),
        times::linear(found),
        times::empty_slots(found),
        times::memory(found),
        light::indirect_light(found),
        light::noise(found),
        times::ballot(found),
        times::table_1(found),
        light::bias(found),
    ];
    verdicts.into_iter().flatten().collect()
}

/// The finding that a figure illustrates.
pub(crate) fn of_figure(found: &Reproduction, number: usize) -> Option<Verdict> {
    match number {
        1 => figure_1(found),
        2 => light::indirect_light(found),
        3 => figure_3(found),
        _ => light::noise(found),
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;

    #[test]
    fn a_claim_stands_as_its_trials_were_decided() {
        use Decision::{No, Undecided, Yes};
        let cases: [(&[Decision], Option<Standing>); 8] = [
            (&[], None),
            (&[Yes, Yes], Some(Standing::Holds)),
            (&[No], Some(Standing::NoLonger)),
            (&[Yes, No], Some(Standing::HoldsInPart)),
            (&[Yes, Undecided, No], Some(Standing::HoldsInPart)),
            (&[Yes, Undecided], Some(Standing::Undecided)),
            (&[No, Undecided], Some(Standing::Undecided)),
            (&[Undecided], Some(Standing::Undecided)),
        ];
        for (trials, standing) in cases {
            assert_eq!(Standing::of(trials.iter().copied()), standing, "{trials:?}");
        }
    }

    #[test]
    fn a_verdict_says_how_its_numbers_split() {
        use Decision::{No, Undecided, Yes};
        let interval = Interval { value: 1.0, low: 1.0, high: 1.0 };
        let split = |decisions: &[Decision]| {
            let one =
                |decision: &Decision| Evidence { what: String::new(), interval, quantity: Quantity::Factor, decision: Some(*decision) };
            let evidence = decisions.iter().map(one).collect();
            Verdict { evidence, ..all(&sample::reproduction())[0].clone() }.split()
        };
        assert_eq!(split(&[Yes, No, Undecided, Yes]), "holds at 2, does not hold at 1, not decided at 1 of 4");
        assert_eq!(split(&[No, No]), "");
    }

    #[test]
    fn numbers_are_shown_with_their_intervals() {
        let interval = Interval { value: 1.36, low: 1.305, high: 1.412 };
        assert_eq!(Quantity::Factor.shown(&interval), "1.36\u{a0}× (1.31 to 1.41)");
        assert_eq!(Quantity::Share.shown(&interval.map(|value| 0.1 * value)), "13.6\u{a0}% (13.1 to 14.1)");
        assert_eq!(Quantity::Exponent.shown(&Interval { low: -0.5, ..interval }), "1.36 (-0.50 to 1.41)");
        assert_eq!(Quantity::Factor.shown(&Interval { low: 0.0, high: f64::INFINITY, ..interval }), "1.36\u{a0}×");
    }
}
