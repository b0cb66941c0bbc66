//! What is asked for to end a run before its last round; `engine::run::watch` ends it.

use serde::Serialize;

use crate::error::{Result, require};

named! {
    /// What `error` is of. Both are roots of means over pixels, texels or points and their three channels, of light that surfaces
    /// scatter: what emits light and is seen straight is left out (a lamp, the sky, what is unlit).
    pub enum Measure {
        /// The root of the mean square of errors, over the mean.
        Rmse = "rmse",
        /// Root mean square of the relative errors (epsilon: 1 % of the mean).
        RelMse = "relmse",
    }
}

/// Blocks before the error is looked at first: a spread of fewer says little.
pub(crate) const FIRST_LOOK: u32 = 16;

/// Blocks of which the spread is an error at all: that of eight is 27 % uncertain itself, that of four 41 %. Of fewer it is unknown.
pub(crate) const LEAST_BLOCKS: u32 = 8;

/// Levels of confidence with which errors may be stated.
pub(crate) const CONFIDENCES: std::ops::RangeInclusive<f64> = 0.5..=0.9999;

with_defaults! {
    #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
    pub struct Stop {
        /// Relative error that is good enough.
        pub error: Option<f64> = None,
        /// What it is of.
        pub measure: Measure = Measure::Rmse,
        /// Chance that the error is no larger than stated.
        pub confidence: f64 = 0.95,
        /// Wall time.
        pub seconds: Option<f64> = None,
        /// Photons of all rounds and maps.
        pub photons: Option<u64> = None,
        /// Relative error that the first round's radius brings with it, at most; it counts in `error`, and shrinks as the
        /// mean square of the radius does. `None`: noise alone counts.
        pub bias: Option<f64> = None,
    }
}

impl Stop {
    /// Whether anything but the number of rounds ends a run.
    pub fn is_set(&self) -> bool {
        self.error.is_some() || self.seconds.is_some() || self.photons.is_some()
    }

    /// Whether there is an error or a time to be reached as well as can be: a number of rounds or photons is no goal.
    pub fn has_goal(&self) -> bool {
        self.error.is_some() || self.seconds.is_some()
    }

    pub fn validate(&self) -> Result<()> {
        if let Some(error) = self.error {
            require((1e-6..=1.0).contains(&error), "error", error, "must be from 0.0001 % to 100 %")?;
        }
        require(CONFIDENCES.contains(&self.confidence), "confidence", self.confidence, "must be from 50 % to 99.99 %")?;
        if let Some(seconds) = self.seconds {
            require((1e-3..=1e6).contains(&seconds), "time", seconds, "must be from 1ms to 1000000s")?;
        }
        require(self.photons != Some(0), "total_photons", 0, "must be 1 or more")
    }
}
