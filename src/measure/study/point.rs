//! One point of a curve: a configuration at a number of rounds, run several times.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::reference::Reference;
use crate::measure::interval::{CONFIDENCE, Interval};
use crate::measure::line_fit::LineFit;

/// What one run left.
#[derive(Debug, Clone)]
pub(crate) struct Shot {
    /// As many as the reference has.
    pub values: Vec<f64>,
    /// All rounds on the device; `None` for the CPU builder and where there are no timestamps.
    pub gpu_ms: Option<f64>,
    /// All rounds on the host's clock.
    pub wall_ms: f64,
    pub photons: u64,
    /// Photons of the global map still flying after the last bounce, over those emitted.
    pub cut_off: f64,
}

/// The root of what may have come out below nothing.
fn root(square: f64) -> f64 {
    square.max(0.0).sqrt()
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Point {
    /// Repeats the first run; the others have the seeds that follow its own.
    pub command: String,
    pub rounds: u32,
    pub photons: u64,
    pub cut_off: f64,
    /// Of each run.
    pub gpu_ms: Vec<Option<f64>>,
    pub wall_ms: Vec<f64>,
    /// Of each run, set-up and all, seconds.
    pub seconds: Vec<f64>,
    /// Mean squared error of each run over the reference's mean square, less what the reference's own noise adds.
    pub squared_errors: Vec<f64>,
    /// The part of it that differs from run to run.
    pub squared_noise: f64,
}

impl Point {
    pub(crate) fn of(shots: &[(Shot, Duration)], reference: &Reference, command: String, rounds: u32) -> Point {
        let (first, _) = &shots[0];
        let count = shots.len() as f64;
        let size = reference.mean_square();
        let spread = |place: usize| {
            let mean = shots.iter().map(|(shot, _)| shot.values[place]).sum::<f64>() / count;
            shots.iter().map(|(shot, _)| (shot.values[place] - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0)
        };
        Point {
            command,
            rounds,
            photons: first.photons,
            cut_off: first.cut_off,
            gpu_ms: shots.iter().map(|(shot, _)| shot.gpu_ms).collect(),
            wall_ms: shots.iter().map(|(shot, _)| shot.wall_ms).collect(),
            seconds: shots.iter().map(|(_, spent)| spent.as_secs_f64()).collect(),
            squared_errors: shots.iter().map(|(shot, _)| reference.squared_error(&shot.values) / size).collect(),
            squared_noise: reference.mean_over(spread) / size,
        }
    }

    pub(crate) fn spent(&self) -> Duration {
        Duration::from_secs_f64(self.seconds.iter().sum())
    }

    /// Relative root mean square error.
    pub(crate) fn error(&self) -> Interval {
        Interval::of_squares(&self.squared_errors).map(root)
    }

    /// What independent runs differ by, relative to the reference.
    pub(crate) fn noise(&self) -> f64 {
        root(self.squared_noise)
    }

    /// What all runs have in common. Below its upper end nothing can be distinguished from noise.
    pub(crate) fn bias(&self) -> Interval {
        Interval::of_squares(&self.squared_errors).map(|square| root(square - self.squared_noise))
    }

    /// Of all rounds: on the device where it has a clock, else the host's. The middle one, the shortest and the longest.
    pub(crate) fn ms(&self) -> Interval {
        let all = sorted((0..self.wall_ms.len()).map(|run| self.ms_of(run)));
        Interval { value: all[all.len() / 2], low: all[0], high: all[all.len() - 1] }
    }

    /// Of one run.
    fn ms_of(&self, run: usize) -> f64 {
        if self.gpu_ms.iter().all(Option::is_some) { self.gpu_ms[run].unwrap_or(0.0) } else { self.wall_ms[run] }
    }

    pub(crate) fn wall(&self) -> f64 {
        sorted(self.wall_ms.iter().copied())[self.wall_ms.len() / 2]
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    all
}

/// A value with the interval that the spread of these logarithms makes. Where a run has none, as it never came so far,
/// the others alone would say too much.
fn around(value: f64, logs: &[Option<f64>], confidence: f64) -> Interval {
    let known: Option<Vec<f64>> = logs.iter().copied().collect();
    let Some(known) = known.filter(|known| known.len() > 1) else {
        return Interval { value, low: 0.0, high: f64::INFINITY };
    };
    let spread = Interval::of_mean(&known, confidence);
    Interval { value, low: value * (spread.low - spread.value).exp(), high: value * (spread.high - spread.value).exp() }
}

/// A configuration at all its numbers of rounds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Curve {
    pub label: String,
    pub points: Vec<Point>,
    /// Why it was not measured.
    pub left_out: Option<String>,
}

impl Curve {
    /// Of no point yet.
    pub(crate) fn new(label: &str) -> Curve {
        Curve { label: label.to_owned(), points: Vec::new(), left_out: None }
    }

    /// Milliseconds to a relative error for one of the runs, or for the mean of all: along straight lines between points
    /// on logarithmic scales, and only as far as was measured.
    fn crossing(points: &[(f64, f64)], error: f64) -> Option<f64> {
        let after = points.iter().position(|(_, found)| *found <= error)?;
        let ((ms_before, found_before), (ms, found)) = (points[after.checked_sub(1)?], points[after]);
        let share = (found_before / error).ln() / (found_before / found.max(1e-12)).ln();
        Some(ms_before * (ms / ms_before).powf(share))
    }

    /// The same, with the interval that the single runs give.
    pub(crate) fn time_to(&self, error: f64) -> Option<Interval> {
        let mean: Vec<(f64, f64)> = self.points.iter().map(|point| (point.ms().value, point.error().value)).collect();
        let value = Curve::crossing(&mean, error)?;
        Some(around(value, &self.logs_of_time_to(error), CONFIDENCE))
    }

    /// Logarithm of the time that each run by itself takes to an error.
    fn logs_of_time_to(&self, error: f64) -> Vec<Option<f64>> {
        let runs = self.points.iter().map(|point| point.squared_errors.len()).min().unwrap_or(0);
        (0..runs)
            .map(|run| {
                let points: Vec<_> = self.points.iter().map(|point| (point.ms_of(run), root(point.squared_errors[run]))).collect();
                Curve::crossing(&points, error).map(f64::ln)
            })
            .collect()
    }

    /// How many times longer than `other` this takes to an error, run by run, with an interval of this confidence.
    pub(crate) fn times_longer(&self, other: &Curve, error: f64, confidence: f64) -> Option<Interval> {
        self.time_ratio(error, other, error, confidence)
    }

    /// How many times longer half an error takes.
    pub(crate) fn halving(&self, error: f64) -> Option<Interval> {
        self.time_ratio(0.5 * error, self, error, CONFIDENCE)
    }

    /// Time to `error` over that of `other` to `other_error`.
    fn time_ratio(&self, error: f64, other: &Curve, other_error: f64, confidence: f64) -> Option<Interval> {
        let value = self.time_to(error)?.value / other.time_to(other_error)?.value;
        let logs = self.logs_of_time_to(error).into_iter().zip(other.logs_of_time_to(other_error));
        let each: Vec<Option<f64>> = logs.map(|(own, other)| Some(own? - other?)).collect();
        Some(around(value, &each, confidence))
    }

    /// Whether every run by itself, and their mean, crossed an error.
    pub(crate) fn crosses(&self, error: f64) -> bool {
        self.time_to(error).is_some() && self.logs_of_time_to(error).iter().all(Option::is_some)
    }

    /// Relative error after a time, where that lies between two points.
    pub(crate) fn error_after(&self, ms: f64) -> Option<Interval> {
        let at = |error: fn(Interval) -> f64| self.value_at(ms, |point| point.ms().value, |point| error(point.error()));
        Some(Interval { value: at(|error| error.value)?, low: at(|error| error.low)?, high: at(|error| error.high)? })
    }

    /// What follows from a power law between two points: their `y` where their `x` has this value.
    pub(crate) fn value_at(&self, value: f64, x: impl Fn(&Point) -> f64, y: impl Fn(&Point) -> f64) -> Option<f64> {
        self.points.windows(2).find_map(|pair| {
            let ([x0, x1], [y0, y1]) = ([&pair[0], &pair[1]].map(&x), [&pair[0], &pair[1]].map(&y));
            let share = (value / x0).ln() / (x1 / x0).ln();
            let found = if y0 > 0.0 && y1 > 0.0 { y0 * (y1 / y0).powf(share) } else { 0.0 };
            (x0 <= value && value <= x1 && x1 > x0).then_some(found)
        })
    }

    /// The smallest error that was measured.
    pub(crate) fn best_error(&self) -> f64 {
        self.points.iter().map(|point| point.error().value).fold(f64::INFINITY, f64::min)
    }

    pub(crate) fn longest(&self) -> f64 {
        self.points.iter().map(|point| point.ms().value).fold(0.0, f64::max)
    }

    /// Slope of the error over photons on logarithmic scales, by least squares through the points whose noise is above
    /// `least` and at least nine tenths of their error: -1/2 where only noise counts.
    pub(crate) fn noise_slope(&self, least: f64) -> Option<f64> {
        let noisy: Vec<(f64, f64)> = self
            .points
            .iter()
            .filter(|point| point.noise() >= 0.9 * point.error().value && point.noise() > least)
            .map(|point| (point.photons as f64, point.noise()))
            .collect();
        if noisy.len() < 3 { None } else { Some(LineFit::of_logarithms(&noisy)?.slope) }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Runs whose squared error is `noise`^2 / rounds plus that of a bias, all but equal.
    pub fn curve(noise: f64, bias: f64, ms_a_round: f64) -> Curve {
        let point = |rounds: u32| {
            let square = noise * noise / f64::from(rounds);
            Point {
                command: String::new(),
                rounds,
                photons: u64::from(rounds),
                cut_off: 0.0,
                gpu_ms: (0..3).map(|run| Some(ms_a_round * f64::from(rounds) * (1.0 + 0.01 * f64::from(run)))).collect(),
                wall_ms: vec![1.0; 3],
                seconds: vec![1.0; 3],
                squared_errors: (0..3).map(|run| square * (1.0 + 0.01 * f64::from(run)) + bias * bias).collect(),
                squared_noise: square,
            }
        };
        Curve { label: String::new(), left_out: None, points: (0..10).map(|doublings| point(1 << doublings)).collect() }
    }

    #[test]
    fn curves_recover_the_prices_that_were_put_into_them() {
        let base = curve(0.4, 0.0, 2.0);
        // 0.4 / sqrt(16) = 0.1.
        let time = base.time_to(0.1).unwrap();
        assert!((time.value / 32.0 - 1.0).abs() < 0.03 && time.low < 32.6 && time.high > 32.0, "{time:?}");
        assert!((base.noise_slope(0.0).unwrap() + 0.5).abs() < 1e-9);
        assert_eq!(base.time_to(1e-3), None, "what was not measured is not guessed");
        assert_eq!(base.time_to(0.9), None, "nor what was reached before the first point");
        let ratio = curve(0.4, 0.0, 6.0).times_longer(&base, 0.1, CONFIDENCE).unwrap();
        assert!((ratio.value - 3.0).abs() < 1e-9 && ratio.low > 2.9 && ratio.high < 3.1, "{ratio:?}");
        assert!((base.error_after(32.0).unwrap().value / 0.1 - 1.0).abs() < 0.02);
    }

    #[test]
    fn noise_and_bias_are_separated() {
        let last = curve(0.4, 0.03, 1.0).points.pop().unwrap();
        assert!((last.bias().value - 0.03).abs() < 1e-3, "{:?}", last.bias());
        assert!(last.error().value > last.noise() && last.bias().low > 0.02);
        let without = curve(0.4, 0.0, 1.0).points.pop().unwrap();
        assert!(without.bias().value < 0.2 * without.noise());
    }
}
