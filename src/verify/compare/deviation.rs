//! Two pictures in, their deviation out: root mean square, relative to the reference, and the largest.

use serde::Serialize;

use super::CHANNELS;
use super::pair::{Pair, Value};

/// Means are over pixels and channels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Deviation {
    pub mean_a: f64,
    pub mean_b: f64,
    /// Root mean square error.
    pub rmse: f64,
    /// None where the reference's mean is not above 0.
    pub relative: Option<Relative>,
    pub largest: Largest,
}

/// Relative to the reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Relative {
    /// Over the reference's mean.
    pub rmse: f64,
    /// The mean over the reference's, minus 1.
    pub bias: f64,
    /// The mean of (a - b)^2 / (b^2 + epsilon) (Rousselle, Knaus and Zwicker 2011). Unlike `rmse` it weighs dark pixels as it
    /// does bright ones.
    pub relmse: f64,
    /// Keeps pixels that are nearly black from deciding everything.
    pub epsilon: f64,
}

/// The channel of a pixel that differs most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Largest {
    pub deviation: f64,
    pub x: u32,
    pub y: u32,
    pub channel: &'static str,
    pub a: f64,
    pub b: f64,
}

/// The root of `epsilon`, of the reference's mean.
const EPSILON: f64 = 0.01;

impl Deviation {
    pub(crate) fn of(pair: &Pair) -> Deviation {
        let mut count = 0.0;
        let (mut sum_a, mut sum_b, mut squares) = (0.0, 0.0, 0.0);
        let mut largest: Option<(f64, Value)> = None;
        for value in pair.values() {
            let deviation = (value.a - value.b).abs();
            count += 1.0;
            sum_a += value.a;
            sum_b += value.b;
            squares += deviation * deviation;
            if largest.is_none_or(|(most, _)| deviation > most) {
                largest = Some((deviation, value));
            }
        }
        let (deviation, Value { pixel, channel, a, b }) = largest.expect("a pair has a pixel");
        let [x, y] = pair.a.place(pixel);
        let (mean_a, mean_b, rmse) = (sum_a / count, sum_b / count, (squares / count).sqrt());
        let relative = || {
            let epsilon = (EPSILON * mean_b).powi(2);
            let errors = pair.values().map(|Value { a, b, .. }| (a - b).powi(2) / (b * b + epsilon));
            Relative { rmse: rmse / mean_b, bias: mean_a / mean_b - 1.0, relmse: errors.sum::<f64>() / count, epsilon }
        };
        Deviation {
            mean_a,
            mean_b,
            rmse,
            relative: (mean_b > 0.0).then(relative),
            largest: Largest { deviation, x, y, channel: CHANNELS[channel], a, b },
        }
    }

    /// Whether the RMSE is above a share of the reference's mean. Any error is above every share of 0.
    pub(crate) fn is_above(&self, share: f64) -> bool {
        self.relative.map_or(self.rmse > 0.0, |relative| relative.rmse > share)
    }
}
