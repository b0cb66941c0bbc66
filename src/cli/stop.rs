//! When a run ends, and the bias of its radius: options and measurements that all runs share.

use clap::Args;

use super::progress::ProgressReporter;
use super::values::{parse_percent, parse_seconds, parse_within, value_enum};
use crate::engine::blocks::Share;
use crate::engine::error::bias::Bias;
use crate::error::{Error, Result, require};
use crate::settings::stop::{Measure, Stop};
use crate::text::counted;

#[derive(Args)]
#[command(next_help_heading = "When to stop")]
pub(super) struct StopArgs {
    /// Stop once the relative error is at most this: 2% (2 is the same). It is of light that surfaces scatter; lamps, the sky and
    /// unlit surfaces that are seen directly are left out
    #[arg(long, value_name = "PERCENT", value_parser = parse_percent, allow_hyphen_values = true)]
    error: Option<f64>,
    /// What the error is: the RMSE over the mean, or the root of relMSE, whose epsilon is (1 % of the mean)^2 [default: rmse]
    #[arg(long, value_enum, value_name = "MEASURE")]
    measure: Option<MeasureArg>,
    /// Confidence level of the error bound [default: 95%]
    #[arg(long, value_name = "PERCENT", value_parser = parse_percent, allow_hyphen_values = true)]
    confidence: Option<f64>,
    /// Stop after rounds of this time: 2s, 500ms, 3m. Start-up and a pilot come on top
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, allow_hyphen_values = true)]
    time: Option<f64>,
    /// Stop once this many photons have been traced, summed over all rounds and maps
    #[arg(long, value_name = "N", value_parser = parse_within(1..=u64::MAX), allow_hyphen_values = true)]
    total_photons: Option<u64>,
    /// Measure the bias, which is the blur by the search radius, in extra runs: of the paper's box, and with --measure relmse. Else
    /// all blocks of a run tell it. With --error it counts as part of the error
    #[arg(long)]
    pub(super) bias: bool,
}

value_enum!(MeasureArg => Measure {
    /// The root of the mean square of errors, over the mean
    Rmse,
    /// The root of the mean of squares of errors, each over the square of its value and of a hundredth of the mean
    #[value(name = "relmse")]
    RelMse,
});

impl StopArgs {
    /// Refuses what only all shards together can know.
    pub(super) fn check_shard(&self, shard: Share) -> Result<()> {
        let only_merged = "cannot be known to one shard; give --rounds, leave it out with --shard, and look at the error of the merge";
        if let Some(error) = self.error {
            return Err(Error::setting("--error", format!("{}%", 100.0 * error), only_merged));
        }
        if let Some(photons) = self.total_photons {
            return Err(Error::setting("--total-photons", photons, only_merged));
        }
        require(!self.bias, "--shard", shard, "cannot be measured with --bias; leave --bias out")
    }

    pub(super) fn stop(&self) -> Stop {
        let usual = Stop::default();
        Stop {
            error: self.error,
            measure: self.measure.map_or(usual.measure, Measure::from),
            confidence: self.confidence.unwrap_or(usual.confidence),
            seconds: self.time,
            photons: self.total_photons,
            ..usual
        }
    }
}

/// What ends a run, as it was understood: for the line that announces the plan.
pub(super) fn goals(stop: &Stop) -> String {
    let mut goals = Vec::new();
    // Rounded to twelve digits, as 0.05 / 100 * 100 is not quite 0.05.
    let percent = |share: f64| format!("{} %", (share * 1e14).round() / 1e12);
    goals.extend(stop.error.map(|error| format!("an error of {} ({} confidence)", percent(error), percent(stop.confidence))));
    goals.extend(stop.seconds.map(|seconds| format!("{seconds} s")));
    goals.extend(stop.photons.map(|photons| counted(photons, "photon")));
    if goals.is_empty() { String::new() } else { format!("; stops at {}", goals.join(" or ")) }
}

/// Rounds that a run does, or may do at most.
pub(super) fn up_to(stop: &Stop, rounds: u32) -> String {
    format!("{}{}", if stop.is_set() { "up to " } else { "" }, counted(rounds, "round"))
}

/// Rounds of a batch after a run of so many: all batches at both radii together do about as many as the run.
pub(super) fn rounds_after(rounds: u32) -> u32 {
    rounds.div_ceil(2 * crate::engine::error::bias_batches::BATCHES).max(1)
}

/// Rounds of a batch at first, and how often it is made again with four times as many, as long as the interval leaves
/// open whether the error wanted can be reached.
const FIRST_ROUNDS: u32 = 2;
const REFINEMENTS: u32 = 4;

/// Measures the bias of the first round's radius if it is asked for and the run ends at an error, of which it is a part.
/// `shrinks` says whether later radii are smaller.
pub(super) fn bias_before(
    stop: &Stop,
    is_asked: bool,
    shrinks: bool,
    reporter: &ProgressReporter,
    mut measure: impl FnMut(u32) -> Result<Option<Bias>>,
) -> Result<Option<Bias>> {
    let Some(wanted) = stop.error.filter(|_| is_asked) else { return Ok(None) };
    let mut rounds = FIRST_ROUNDS;
    for refinement in 0..=REFINEMENTS {
        reporter.step(&format!(
            "measuring the bias first: {} batches of {} at two radii",
            crate::engine::error::bias_batches::BATCHES,
            counted(rounds, "round")
        ));
        let Some(bias) = measure(rounds)? else { return Ok(None) };
        // More than half of the error wanted is then left for noise.
        let is_decided = bias.upper <= 0.85 * wanted || bias.lower > wanted || refinement == REFINEMENTS;
        // Where the radius shrinks the bias need not be known as well: it will be small enough some day.
        if is_decided || shrinks {
            if !shrinks && bias.upper >= wanted {
                let (lower, upper) = (100.0 * bias.lower, 100.0 * bias.upper);
                let allowed = format!(
                    "cannot be reached: the bias of the radius alone is {lower:.2} % to {upper:.2} %, and the radius never shrinks; use a smaller --radius{}",
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
