//! When a run of the paper's box ends, and what is kept of it.

use std::path::PathBuf;

use clap::Args;

use super::values::{parse_percent, parse_seconds, parse_shard, parse_within, value_enum};
use crate::engine::blocks::Share;
use crate::error::Result;
use crate::render::checkpoints::{CheckpointRequest, Checkpoints, check_shard};
use crate::render::{Observer, Percent, Seconds};
use crate::settings::stop::{Measure, Stop};

#[derive(Args)]
#[command(next_help_heading = "When to stop")]
pub(super) struct StopArgs {
    /// Stop once the relative error is at most this: 2%
    #[arg(long, value_name = "PERCENT", value_parser = parse_percent, allow_hyphen_values = true)]
    error: Option<Percent>,
    /// What the error is: the RMSE over the mean, or the root of relMSE, whose epsilon is (1 % of the mean)^2 [default: rmse]
    #[arg(long, value_enum, value_name = "MEASURE")]
    measure: Option<MeasureArg>,
    /// Confidence level of the error bound [default: 95%]
    #[arg(long, value_name = "PERCENT", value_parser = parse_percent, allow_hyphen_values = true)]
    confidence: Option<Percent>,
    /// Stop after rounds of this time: 2s, 500ms, 3m. Does not include start-up
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, allow_hyphen_values = true)]
    time: Option<Seconds>,
    /// Stop once this many photons have been traced, summed over all rounds
    #[arg(long, value_name = "N", value_parser = parse_within(1..=u64::MAX), allow_hyphen_values = true)]
    total_photons: Option<u64>,
    /// Measure the bias, which is the blur by the search radius, in extra runs. With --error it counts as part of the error
    #[arg(long)]
    pub(super) bias: bool,
}

value_enum!(MeasureArg => Measure {
    /// The root of the mean square of errors, over the mean
    Rmse,
    /// Root mean square of the relative errors (epsilon: 1 % of the mean)
    #[value(name = "relmse")]
    RelMse,
});

impl StopArgs {
    pub(super) fn stop(&self) -> Stop {
        let usual = Stop::default();
        Stop {
            error: self.error.map(Percent::share),
            measure: self.measure.map_or(usual.measure, Measure::from),
            confidence: self.confidence.map_or(usual.confidence, Percent::share),
            seconds: self.time.map(|Seconds(seconds)| seconds),
            photons: self.total_photons,
            ..usual
        }
    }
}

#[derive(Args)]
#[command(next_help_heading = "When to stop")]
pub(super) struct CheckpointArgs {
    /// Write all sums into this file from time to time and at the end, so that --resume can go on with them
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Time between two checkpoints [default: 30s]
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, allow_hyphen_values = true, requires = "checkpoint")]
    every: Option<Seconds>,
    /// Go on with the blocks of rounds that a checkpoint holds; the result is that of a run without a break, to the bit
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Do every N-th block of rounds, from the K-th on (K from 1 to N); `photonmill merge` adds the checkpoints of all of them
    #[arg(long, value_name = "K/N", value_parser = parse_shard, requires = "checkpoint")]
    shard: Option<Share>,
}

impl CheckpointArgs {
    pub(super) fn open<'a>(&self, stop: &StopArgs, observer: &Observer<'a>) -> Result<Checkpoints<'a>> {
        let CheckpointArgs { checkpoint, every, resume, shard } = self;
        check_shard(*shard, stop.error, stop.total_photons, stop.bias)?;
        CheckpointRequest { checkpoint: checkpoint.clone(), every: *every, resume: resume.clone(), shard: *shard }.open(observer.tell)
    }
}
