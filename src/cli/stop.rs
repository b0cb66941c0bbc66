//! What runs of both lines share: when they end, how far they have come, and the bias of their radius.

use std::io::Write;

use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};

use super::complain;
use super::run::whole;
use crate::bias::Bias;
use crate::error::{Error, Result};
use crate::render::Progress;
use crate::settings::stop::Stop;

#[derive(Args)]
#[command(next_help_heading = "Stop")]
pub(super) struct StopArgs {
    /// End when the relative error is at most this, in per cent of the result's root mean square
    #[arg(long, value_name = "PERCENT", value_parser = share, allow_negative_numbers = true)]
    error: Option<f64>,
    /// Chance that the error is no larger than stated [default: 95%]
    #[arg(long, value_name = "PERCENT", value_parser = share, allow_negative_numbers = true)]
    confidence: Option<f64>,
    /// End after this time: 2s, 500ms, 3m
    #[arg(long, value_name = "TIME", value_parser = seconds, allow_negative_numbers = true)]
    time: Option<f64>,
    /// End once so many photons have been traced, of all rounds and maps
    #[arg(long, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    total_photons: Option<u64>,
    /// Measure the bias of the radius too, in runs of their own; with --error it counts in the error
    #[arg(long)]
    pub(super) bias: bool,
}

impl StopArgs {
    pub(super) fn stop(&self) -> Stop {
        let usual = Stop::default();
        Stop {
            error: self.error,
            confidence: self.confidence.unwrap_or(usual.confidence),
            seconds: self.time,
            photons: self.total_photons,
            ..usual
        }
    }
}

/// `1%` or `1`, per cent.
fn share(text: &str) -> std::result::Result<f64, String> {
    let number = text.strip_suffix('%').unwrap_or(text).trim();
    number.parse().map(|percent: f64| percent / 100.0).map_err(|_| "must be a number of per cent, as 1%".to_owned())
}

/// `2s`, `500ms`, `3m`, or seconds.
pub(super) fn seconds(text: &str) -> std::result::Result<f64, String> {
    let units = [("ms", 1e-3), ("s", 1.0), ("m", 60.0), ("h", 3600.0)];
    let (number, unit) = units.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit))).unwrap_or((text, 1.0));
    number.trim().parse().map(|count: f64| count * unit).map_err(|_| "must be a time, as 2s, 500ms or 3m".to_owned())
}

/// How a run tells how far it has come.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum ProgressArg {
    /// A bar, where stderr is a terminal.
    Bar,
    /// A line of JSON on stderr at every step.
    Json,
}

/// Tells how far a run has come.
pub(super) struct Teller {
    told: ProgressArg,
    bar: ProgressBar,
    /// What progress counts: rounds or photons.
    unit: &'static str,
}

/// Steps of the bar.
const BAR_STEPS: u64 = 1000;

impl Teller {
    pub(super) fn new(told: ProgressArg, unit: &'static str) -> Teller {
        let style = ProgressStyle::with_template("{bar:32} {msg}\n{prefix}").expect("the template is valid");
        Teller { told, bar: ProgressBar::new(BAR_STEPS).with_style(style), unit }
    }

    pub(super) fn tell(&self, progress: &Progress) {
        match self.told {
            ProgressArg::Bar => {
                self.bar.set_position((share_done(progress) * BAR_STEPS as f64) as u64);
                self.bar.set_message(progress_line(progress, self.unit));
                self.bar.set_prefix(ledger_line(progress));
            }
            ProgressArg::Json => {
                // Where nobody can read it, the run goes on.
                let _ = writeln!(std::io::stderr(), "{}", serde_json::to_string(progress).expect("progress is plain data"));
            }
        }
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// By the time that is predicted, as a run may end before its last round.
fn share_done(progress: &Progress) -> f64 {
    progress.seconds_left.map_or(0.0, |left| progress.seconds / (progress.seconds + left).max(1e-9))
}

/// Amount done, rate, error now and wanted, and the predicted end.
fn progress_line(progress: &Progress, unit: &str) -> String {
    let Progress { done, seconds, photons, .. } = progress;
    let rate = *photons as f64 / seconds.max(1e-9);
    let wanted = progress.error_wanted.map_or_else(String::new, |wanted| format!(" of {:.3} % wanted", 100.0 * wanted));
    let error = progress.error.map_or_else(String::new, |error| format!(", error {:.3} %{wanted}", 100.0 * error));
    let left = progress.seconds_left.map_or_else(String::new, |left| format!(", {left:.1} s left"));
    format!("{done} {unit}, {rate:.2e} photons/s{error}{left}")
}

fn ledger_line(progress: &Progress) -> String {
    let ledger = &progress.ledger;
    format!(
        "{} emitted = {} absorbed + {} escaped + {} cut off; {} stored",
        ledger.emitted, ledger.absorbed, ledger.escaped, ledger.cut_off, ledger.stored
    )
}

/// Rounds of a batch after a run of so many: all batches at both radii together do about as many as the run.
pub(super) fn rounds_after(rounds: u32) -> u32 {
    rounds.div_ceil(2 * crate::bias::BATCHES).max(1)
}

/// Rounds of a batch at first, and how often it is made again with four times as many, as long as the interval leaves
/// open whether the error wanted can be had.
const FIRST_ROUNDS: u32 = 2;
const REFINEMENTS: u32 = 4;

/// Measures the bias of the first round's radius for a run that ends at an error, which the bias counts in. `shrinks` says
/// whether later radii are smaller.
pub(super) fn bias_before(wanted: f64, shrinks: bool, mut measure: impl FnMut(u32) -> Result<Option<Bias>>) -> Result<Option<Bias>> {
    let mut rounds = FIRST_ROUNDS;
    for refinement in 0..=REFINEMENTS {
        complain(&format!("measuring the bias first: {} batches of {rounds} round(s) at two radii", crate::bias::BATCHES));
        let Some(bias) = measure(rounds)? else { return Ok(None) };
        // More than half of the error wanted is then left for noise.
        let is_decided = bias.upper <= 0.85 * wanted || bias.lower > wanted || refinement == REFINEMENTS;
        // What shrinks need not be known as well: it will be small enough some day.
        if is_decided || shrinks {
            if !shrinks && bias.upper >= wanted {
                let (lower, upper) = (100.0 * bias.lower, 100.0 * bias.upper);
                let allowed = format!(
                    "cannot be promised, as the radius alone has a bias from {lower:.2} % to {upper:.2} % and never shrinks; ask for a smaller --radius{}",
                    if bias.lower > wanted { "" } else { " or a lower --confidence" }
                );
                return Err(Error::setting("--error", format!("{}%", 100.0 * wanted), allowed));
            }
            return Ok(Some(bias));
        }
        rounds *= 4;
    }
    Ok(None)
}
