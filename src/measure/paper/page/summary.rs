//! The top of the page: what held, what did not, and how sure that is.

use maud::{Markup, html};

use crate::measure::interval::{CONFIDENCE_IN_WORDS, Decision, LEAST_VALUES};
use crate::measure::paper::figures::SEEDS;
use crate::measure::paper::verdicts::{MARGIN, Standing, Verdict};
use crate::output::page::table;
use crate::output::words;
use crate::text::counted;

pub(crate) fn summary(verdicts: &[Verdict]) -> Markup {
    let (claims, additions): (Vec<&Verdict>, Vec<&Verdict>) = verdicts.iter().partition(|verdict| verdict.standing.is_some());
    html! {
        section id="standing" {
            h2 { "What still holds from 2008" }
            @if claims.is_empty() {
                p { "Too few experiments were completed to say." }
            } @else {
                p { strong { (tally(&claims)) } " Ranges in brackets are " (CONFIDENCE_IN_WORDS) " confidence intervals. Open a row for every number behind it." }
                (list("Finding of the paper", "Verdict", &claims))
            }
            @if !additions.is_empty() {
                h3 { "Beyond the paper" }
                (list("Finding of this run", "", &additions))
            }
            details {
                summary { "How a finding is decided" }
                (method())
            }
        }
    }
}

/// 'Of 9 findings, 5 still hold, 2 hold in part, 1 no longer holds and 1 is not decided by this run.'
fn tally(claims: &[&Verdict]) -> String {
    let parts: Vec<String> = [
        (Standing::Holds, "still holds", "still hold"),
        (Standing::HoldsInPart, "holds in part", "hold in part"),
        (Standing::NoLonger, "no longer holds", "no longer hold"),
        (Standing::Undecided, "is not decided by this run", "are not decided by this run"),
    ]
    .into_iter()
    .filter_map(|(standing, one, several)| {
        let number = claims.iter().filter(|verdict| verdict.standing == Some(standing)).count();
        (number > 0).then(|| format!("{number} {}", if number == 1 { one } else { several }))
    })
    .collect();
    format!("Of {}, {}.", counted(claims.len(), "finding"), words::list(&parts))
}

fn list(name: &str, outcome: &str, verdicts: &[&Verdict]) -> Markup {
    html! {
        div.claims {
            div.claim-head aria-hidden="true" { span { (name) } span { "2008" } span { "Here" } span { (outcome) } }
            @for verdict in verdicts { (row(verdict)) }
        }
    }
}

fn row(verdict: &Verdict) -> Markup {
    html! {
        details.claim {
            summary {
                span.topic { (verdict.topic) }
                span.then { b.key { "2008: " } (verdict.then) }
                span.here {
                    b.key { "Here: " }
                    (verdict.here)
                    @if !verdict.elsewhere.is_empty() { small { (verdict.elsewhere) } }
                }
                span.outcome {
                    @if let Some(standing) = verdict.standing { (badge(standing, standing.words())) }
                    @let split = verdict.split();
                    @if !split.is_empty() { small { (split) } }
                }
            }
            p { (verdict.text) }
            @if !verdict.evidence.is_empty() { (evidence(verdict)) }
        }
    }
}

pub(crate) fn badge(standing: Standing, words: &str) -> Markup {
    html! { span class={ "standing " (standing.class()) } { (words) } }
}

fn evidence(verdict: &Verdict) -> Markup {
    let has_claim = verdict.standing.is_some();
    let head = html! { tr { th.name { "Measured" } th { "Value (interval)" } @if has_claim { th { "Claim" } } } };
    let body = html! {
        @for one in &verdict.evidence {
            tr {
                th scope="row" { (one.what) }
                td { (one.shown()) @if !one.interval.is_bounded() { small { "fewer than " (LEAST_VALUES) " runs" } } }
                @if has_claim { td { (one.decision.map_or("–", Decision::words)) } }
            }
        }
    };
    table(&head, &body)
}

fn method() -> Markup {
    html! {
        ul {
            li {
                "A claim that something takes longer, or is brighter, holds where the whole interval of the factor is above " (MARGIN) ". "
                "It does not hold where the whole interval is below. Otherwise this run does not decide it. "
                "So a difference of less than " (((MARGIN - 1.0) * 100.0).round()) " % counts as none."
            }
            li { "A finding was checked at several sizes. It holds where it holds at every size, and holds in part where it holds at some and not at others. If a size is not decided and no two sizes contradict each other, the finding is not decided by this run." }
            li { "Factors of times are ratios of geometric means of the repeated runs, with Welch's t interval (1947) on their logarithms. With fewer than " (LEAST_VALUES) " runs there is no interval and no decision." }
            li { "Numbers of the figures are geometric means over seeds 1 to " (SEEDS) ", with Student's t interval on their logarithms. Exponents have the t interval of a fitted slope. Shares of filled slots have Hoeffding's interval (1963)." }
            li { "Each interval by itself contains the true value with a confidence level of " (CONFIDENCE_IN_WORDS) ". The intervals describe this machine and driver only. The 2008 numbers were printed without a spread." }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::paper::{sample, verdicts};

    #[test]
    fn the_tally_counts_every_claim() {
        let verdicts = verdicts::all(&sample::reproduction());
        let with = |standing: Standing| Verdict { standing: Some(standing), ..verdicts[0].clone() };
        let several = [with(Standing::Holds), with(Standing::Holds), with(Standing::NoLonger), with(Standing::Undecided)];
        let claims: Vec<&Verdict> = several.iter().collect();
        assert_eq!(tally(&claims), "Of 4 findings, 2 still hold, 1 no longer holds and 1 is not decided by this run.");
        assert_eq!(tally(&claims[2..3]), "Of 1 finding, 1 no longer holds.");
    }
}
