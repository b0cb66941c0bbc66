//! Measured times as CSV, for programs.

use super::experiments::{RunningTime, TotalTime};
use super::verdicts::{Evidence, Standing, Verdict};
use crate::measure::interval::{Decision, Interval};
use crate::output::csv_table::{Column, csv_table};
use crate::output::words::lower_case;
use crate::timings::Clock;

const RUNNING_TIMES: [Column<RunningTime>; 15] = [
    ("photons", |time| time.photons.to_string()),
    ("bounces", |time| time.bounces.to_string()),
    ("builder", |time| time.implementation.name()),
    ("pass", |time| time.pass.name().to_owned()),
    ("gather", |time| time.pass.gather().map(lower_case).unwrap_or_default()),
    ("clock", |time| if time.clock == Clock::Gpu { "gpu" } else { "wall" }.to_owned()),
    ("repeats", |time| time.ms.repeats.to_string()),
    ("median_ms", |time| milliseconds(time.ms.median)),
    ("min_ms", |time| milliseconds(time.ms.min)),
    ("max_ms", |time| milliseconds(time.ms.max)),
    ("geometric_mean_ms", |time| milliseconds(Interval::of_geometric_mean(&time.runs_ms).value)),
    ("low_ms", |time| bound(time, |interval| interval.low)),
    ("high_ms", |time| bound(time, |interval| interval.high)),
    ("runs_ms", |time| time.runs_ms.iter().map(|ms| milliseconds(*ms)).collect::<Vec<_>>().join(" ")),
    ("published_ms", |time| time.published_ms().map_or_else(String::new, milliseconds)),
];

const TOTALS: [Column<TotalTime>; 7] = [
    ("photons_per_round", |total| total.photons_per_round.to_string()),
    ("rounds", |total| total.rounds.to_string()),
    ("photons", |total| total.photons().to_string()),
    ("gather", |total| lower_case(total.gather)),
    ("gpu_ms", |total| total.gpu_ms.map_or_else(String::new, milliseconds)),
    ("wall_ms", |total| milliseconds(total.wall_ms)),
    ("published_ms", |total| total.published_ms().map_or_else(String::new, milliseconds)),
];

/// A finding and one number behind it, if there is any.
struct Finding {
    topic: &'static str,
    standing: Option<Standing>,
    evidence: Option<Evidence>,
}

const FINDINGS: [Column<Finding>; 7] = [
    ("finding", |finding| finding.topic.to_owned()),
    ("verdict", |finding| finding.standing.map_or("", Standing::words).to_owned()),
    ("measured", |finding| finding.evidence.as_ref().map_or_else(String::new, |one| one.what.clone())),
    ("value", |finding| finding.evidence.as_ref().map_or_else(String::new, |one| one.interval.value.to_string())),
    ("low", |finding| finding.bound(|interval| interval.low)),
    ("high", |finding| finding.bound(|interval| interval.high)),
    ("claim", |finding| finding.evidence.as_ref().and_then(|one| one.decision).map_or("", Decision::words).to_owned()),
];

impl Finding {
    fn bound(&self, end: fn(&Interval) -> f64) -> String {
        self.evidence.as_ref().filter(|one| one.interval.is_bounded()).map_or_else(String::new, |one| end(&one.interval).to_string())
    }
}

pub fn running_times(times: &[RunningTime]) -> Vec<u8> {
    csv_table(&RUNNING_TIMES, times)
}

pub fn totals(totals: &[TotalTime]) -> Vec<u8> {
    csv_table(&TOTALS, totals)
}

/// Every finding, one row for each number behind it.
pub fn findings(verdicts: &[Verdict]) -> Vec<u8> {
    let rows: Vec<Finding> = verdicts
        .iter()
        .flat_map(|Verdict { topic, standing, evidence, .. }| {
            let row = |evidence| Finding { topic, standing: *standing, evidence };
            if evidence.is_empty() { vec![row(None)] } else { evidence.iter().cloned().map(Some).map(row).collect() }
        })
        .collect();
    csv_table(&FINDINGS, &rows)
}

/// An end of the interval of the geometric mean; empty where too few runs bound it.
fn bound(time: &RunningTime, end: fn(&Interval) -> f64) -> String {
    let interval = Interval::of_geometric_mean(&time.runs_ms);
    if interval.is_bounded() { milliseconds(end(&interval)) } else { String::new() }
}

/// To the nanosecond, which is as fine as any clock here.
fn milliseconds(value: f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}

#[cfg(test)]
mod tests {
    use super::super::{sample, verdicts};
    use super::*;

    fn lines(table: Vec<u8>) -> Vec<String> {
        String::from_utf8(table).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn every_row_has_every_column() {
        let mut found = sample::reproduction();
        let times = lines(running_times(&found.running_times));
        assert_eq!(
            times[0],
            "photons,bounces,builder,pass,gather,clock,repeats,median_ms,min_ms,max_ms,geometric_mean_ms,low_ms,high_ms,runs_ms,published_ms"
        );
        assert_eq!(times.len(), 1 + found.running_times.len());
        assert_eq!(times[1], "5000,2,naive,map,,gpu,7,5,0.5,100,5,5,5,5 5 5 5 5 5 5,1.7");
        assert_eq!(times[2], "5000,2,naive,rendering,brute,gpu,7,5,0.5,100,5,5,5,5 5 5 5 5 5 5,3000");
        assert!(times.iter().all(|line| line.split(',').count() == RUNNING_TIMES.len()));

        // What is not known is empty.
        found.totals[0].gpu_ms = None;
        assert_eq!(lines(running_times(&[])).len(), 1);
        let totals = lines(totals(&found.totals));
        assert_eq!(totals[0], "photons_per_round,rounds,photons,gather,gpu_ms,wall_ms,published_ms");
        assert_eq!(totals[1], "5000,1,5000,brute,,2,2130");
        assert_eq!(totals[5], "5000,50,250000,brute,50,51,105640");
        assert_eq!(totals[11], "65536,1,65536,grid,1,2,");
        assert!(totals.iter().all(|line| line.split(',').count() == TOTALS.len()));
    }

    #[test]
    fn findings_have_their_intervals() {
        let mut found = sample::reproduction();
        let table = lines(findings(&verdicts::all(&found)));
        assert_eq!(table[0], "finding,verdict,measured,value,low,high,claim");
        // Equal runs have no spread but that of rounding.
        let row = "Atomics slow the map pass down,no longer holds,\"modified / naive: 5000 photons, 2 bounces\",1,0.99999";
        assert!(table[1].starts_with(row) && table[1].ends_with(",does not hold"), "{}", table[1]);
        found.running_times.iter_mut().for_each(|time| time.runs_ms.truncate(2));
        let table = lines(findings(&verdicts::all(&found)));
        assert!(
            table[1].starts_with("Atomics slow the map pass down,not decided") && table[1].ends_with(",1,,,not decided"),
            "{}",
            table[1]
        );
    }
}
