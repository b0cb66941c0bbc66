//! Measured times as CSV, for programs.

use super::experiments::{RunningTime, TotalTime};
use crate::output::command;
use crate::timings::Clock;

const RUNNING_TIMES: [&str; 11] =
    ["photons", "bounces", "builder", "pass", "gather", "clock", "repeats", "median_ms", "min_ms", "max_ms", "published_ms"];
const TOTALS: [&str; 7] = ["photons_per_round", "rounds", "photons", "gather", "gpu_ms", "wall_ms", "published_ms"];

pub fn running_times(times: &[RunningTime]) -> Vec<u8> {
    table(
        RUNNING_TIMES,
        times.iter().map(|time| {
            [
                time.photons.to_string(),
                time.bounces.to_string(),
                time.implementation.name(),
                time.pass.name().to_owned(),
                time.gather.map(command::gather_name).unwrap_or_default(),
                match time.clock {
                    Clock::Gpu => "gpu".to_owned(),
                    Clock::Wall => "wall".to_owned(),
                },
                time.ms.repeats.to_string(),
                milliseconds(Some(time.ms.median)),
                milliseconds(Some(time.ms.min)),
                milliseconds(Some(time.ms.max)),
                milliseconds(time.published_ms()),
            ]
        }),
    )
}

pub fn totals(totals: &[TotalTime]) -> Vec<u8> {
    table(
        TOTALS,
        totals.iter().map(|total| {
            [
                total.photons_per_round.to_string(),
                total.rounds.to_string(),
                total.photons().to_string(),
                command::gather_name(total.gather),
                milliseconds(total.gpu_ms),
                milliseconds(Some(total.wall_ms)),
                milliseconds(total.published_ms()),
            ]
        }),
    )
}

/// To the nanosecond, which is as fine as any clock here; empty where there is no value.
fn milliseconds(value: Option<f64>) -> String {
    value.map(|value| ((value * 1e6).round() / 1e6).to_string()).unwrap_or_default()
}

fn table<const COLUMNS: usize>(header: [&str; COLUMNS], rows: impl Iterator<Item = [String; COLUMNS]>) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(header).expect("rows of one length can be written to memory");
    for row in rows {
        writer.write_record(row).expect("rows of one length can be written to memory");
    }
    writer.into_inner().expect("memory can be flushed")
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
