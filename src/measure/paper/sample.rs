//! A reproduction with made-up times, for the tests of what is said of it.

use super::bench::Device;
use super::experiments::{Implementation, LeftOut, Pass, RunningTime, TotalTime, command, row_of_table_1};
use super::figures::{Figure, Panel};
use super::{PaperRequest, Reproduction, published};
use crate::settings::{Builder, Gather};
use crate::timings::{Clock, Spread};

const LARGE: u32 = 65_536;

pub(crate) fn reproduction() -> Reproduction {
    Reproduction {
        device: Some(Device { name: "a device".to_owned(), driver: "its driver".to_owned(), has_timestamps: true, is_cpu: true }),
        cpu: "a processor".to_owned(),
        request: PaperRequest { large: LARGE, repeats: 7, threads: 1, longest_ms: 90e3 },
        figures: vec![Figure {
            number: 1,
            title: "a figure",
            published: "What the paper shows.",
            caption: "A caption.",
            frames: Vec::new(),
            repeats: Vec::new(),
            panels: vec![Panel { label: "a panel".to_owned(), side: 1, png: vec![1, 2, 3] }],
        }],
        running_times: running_times(),
        totals: totals(),
        passes_left_out: Vec::new(),
        totals_left_out: vec![LeftOut { what: "a long run".to_owned(), predicted_ms: 100_000.0 }],
        complete: true,
    }
}

fn running_times() -> Vec<RunningTime> {
    let mut times = Vec::new();
    for photons in [published::PHOTONS, LARGE] {
        for bounces in [published::BOUNCES, 15] {
            for builder in [Builder::Naive, Builder::Atomic, Builder::Ballot, Builder::Cpu] {
                times.extend(Pass::ALL.map(|pass| RunningTime {
                    photons,
                    bounces,
                    implementation: Implementation::of(builder),
                    pass,
                    clock: if builder == Builder::Cpu { Clock::Wall } else { Clock::Gpu },
                    ms: Spread { median: f64::from(photons) / 1000.0, min: 0.5, max: 100.0, repeats: 7 },
                    runs_ms: vec![f64::from(photons) / 1000.0; 7],
                    stored: u64::from(photons),
                    command: String::new(),
                }));
            }
        }
    }
    times
}

fn totals() -> Vec<TotalTime> {
    let series = [(published::PHOTONS, Gather::Brute), (published::PHOTONS, Gather::Grid), (LARGE, Gather::Grid)];
    let total = |photons: u32, rounds: u32, gather: Gather| TotalTime {
        photons_per_round: photons,
        rounds,
        gather,
        gpu_ms: Some(f64::from(rounds)),
        wall_ms: f64::from(rounds) + 1.0,
        command: command(&row_of_table_1(Builder::Atomic, photons, rounds, gather)),
    };
    series.into_iter().flat_map(|(photons, gather)| published::TABLE_1.map(|(rounds, _)| total(photons, rounds, gather))).collect()
}
