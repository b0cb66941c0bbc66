//! Measured times as CSV, for programs.

use super::experiments::{RunningTime, TotalTime};
use crate::output::command;
use crate::output::csv_table::{Column, csv_table};
use crate::timings::Clock;

const RUNNING_TIMES: [Column<RunningTime>; 11] = [
    ("photons", |time| time.photons.to_string()),
    ("bounces", |time| time.bounces.to_string()),
    ("builder", |time| time.implementation.name()),
    ("pass", |time| time.pass.name().to_owned()),
    ("gather", |time| time.pass.gather().map(command::gather_name).unwrap_or_default()),
    ("clock", |time| if time.clock == Clock::Gpu { "gpu" } else { "wall" }.to_owned()),
    ("repeats", |time| time.ms.repeats.to_string()),
    ("median_ms", |time| milliseconds(time.ms.median)),
    ("min_ms", |time| milliseconds(time.ms.min)),
    ("max_ms", |time| milliseconds(time.ms.max)),
    ("published_ms", |time| time.published_ms().map_or_else(String::new, milliseconds)),
];

const TOTALS: [Column<TotalTime>; 7] = [
    ("photons_per_round", |total| total.photons_per_round.to_string()),
    ("rounds", |total| total.rounds.to_string()),
    ("photons", |total| total.photons().to_string()),
    ("gather", |total| command::gather_name(total.gather)),
    ("gpu_ms", |total| total.gpu_ms.map_or_else(String::new, milliseconds)),
    ("wall_ms", |total| milliseconds(total.wall_ms)),
    ("published_ms", |total| total.published_ms().map_or_else(String::new, milliseconds)),
];

pub fn running_times(times: &[RunningTime]) -> Vec<u8> {
    csv_table(&RUNNING_TIMES, times)
}

pub fn totals(totals: &[TotalTime]) -> Vec<u8> {
    csv_table(&TOTALS, totals)
}

/// To the nanosecond, which is as fine as any clock here.
fn milliseconds(value: f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;

    fn lines(table: Vec<u8>) -> Vec<String> {
        String::from_utf8(table).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn every_row_has_every_column() {
        let found = sample::reproduction();
        let times = lines(running_times(&found.running_times));
        assert_eq!(times[0], "photons,bounces,builder,pass,gather,clock,repeats,median_ms,min_ms,max_ms,published_ms");
        assert_eq!(times.len(), 1 + found.running_times.len());
        assert_eq!(times[1], "5000,2,naive,map,,gpu,7,5,0.5,100,1.7");
        assert_eq!(times[2], "5000,2,naive,rendering,brute,gpu,7,5,0.5,100,3000");
        assert!(times.iter().all(|line| line.split(',').count() == RUNNING_TIMES.len()));

        let totals = lines(totals(&found.totals));
        assert_eq!(totals[0], "photons_per_round,rounds,photons,gather,gpu_ms,wall_ms,published_ms");
        assert_eq!(totals[5], "5000,50,250000,brute,50,51,105640");
        assert_eq!(totals[11], "65536,1,65536,grid,1,2,");
        assert!(totals.iter().all(|line| line.split(',').count() == TOTALS.len()));
    }

    #[test]
    fn what_is_not_known_is_empty() {
        let mut found = sample::reproduction();
        found.totals[0].gpu_ms = None;
        assert_eq!(lines(totals(&found.totals))[1], "5000,1,5000,brute,,2,2130");
        assert_eq!(lines(running_times(&[])).len(), 1);
    }
}
