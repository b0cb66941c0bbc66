//! Confidence intervals of measured numbers, and whether they decide a claim.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::line_fit::LineFit;

/// Confidence level of every interval here.
pub(crate) const CONFIDENCE: f64 = 0.95;
pub(crate) const CONFIDENCE_IN_WORDS: &str = "95 %";
/// With fewer values the interval is unbounded: two values say next to nothing about their spread.
pub(crate) const LEAST_VALUES: usize = 3;

/// A number and the interval that contains its true value with [`CONFIDENCE`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Interval {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

/// Whether an interval decides a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Decision {
    Yes,
    No,
    Undecided,
}

impl Interval {
    fn around(value: f64, half_width: f64) -> Interval {
        Interval { value, low: value - half_width, high: value + half_width }
    }

    /// The mean of independent values, by Student's t; of a single one nothing is known.
    pub(crate) fn of_mean(values: &[f64], confidence: f64) -> Interval {
        Moments::of(values, 2).interval(confidence)
    }

    /// The same of values above 0 whose logarithm is more nearly normal than they, as squared errors are: the interval
    /// reaches further up than down.
    pub(crate) fn of_squares(values: &[f64]) -> Interval {
        let plain = Interval::of_mean(values, CONFIDENCE);
        let half = (plain.high - plain.value) / plain.value.max(f64::MIN_POSITIVE);
        Interval { value: plain.value, low: plain.value * (-half).exp(), high: plain.value * half.exp() }
    }

    /// The geometric mean of positive values, by Student's t on their logarithms.
    pub(crate) fn of_geometric_mean(values: &[f64]) -> Interval {
        Moments::of_logarithms(values).interval(CONFIDENCE).map(f64::exp)
    }

    /// The ratio of two geometric means of positive values, by Welch's t on their logarithms: B. L. Welch, The
    /// generalization of 'Student's' problem when several different population variances are involved, Biometrika 34,
    /// 1947. The two may differ in spread and in number. A ratio of times needs logarithms because the geometric mean does
    /// not depend on which of the two is the reference: P. J. Fleming and J. J. Wallace, How not to lie with statistics,
    /// Communications of the ACM 29, 1986.
    pub(crate) fn of_ratio(over: &[f64], under: &[f64]) -> Interval {
        let [over, under] = [over, under].map(Moments::of_logarithms);
        let variance_of_mean = over.variance_of_mean + under.variance_of_mean;
        let share = |part: &Moments| part.variance_of_mean.powi(2) / part.freedom;
        // Runs that are equal to the last digit have no spread.
        let is_spread = variance_of_mean > 0.0;
        let freedom = if is_spread { variance_of_mean.powi(2) / (share(&over) + share(&under)) } else { over.freedom.min(under.freedom) };
        Moments { mean: over.mean - under.mean, variance_of_mean, freedom }.interval(CONFIDENCE).map(f64::exp)
    }

    /// The slope of a line through this many points, by Student's t on its standard error.
    pub(crate) fn of_slope(fit: &LineFit, points: usize) -> Interval {
        if points < LEAST_VALUES {
            return Interval::around(fit.slope, f64::INFINITY);
        }
        Interval::around(fit.slope, quantile(points as f64 - 2.0, CONFIDENCE) * fit.slope_error)
    }

    /// The mean of independent values that all lie in [0, 1], whatever their distribution: W. Hoeffding, Probability
    /// inequalities for sums of bounded random variables, Journal of the American Statistical Association 58, 1963.
    pub(crate) fn of_share(mean: f64, values: f64) -> Interval {
        let half_width = ((2.0 / (1.0 - CONFIDENCE)).ln() / (2.0 * values)).sqrt();
        Interval { value: mean, low: (mean - half_width).max(0.0), high: (mean + half_width).min(1.0) }
    }

    pub(crate) fn map(self, f: impl Fn(f64) -> f64) -> Interval {
        Interval { value: f(self.value), low: f(self.low), high: f(self.high) }
    }

    pub(crate) fn is_bounded(&self) -> bool {
        self.high.is_finite()
    }

    /// Whether the true value is above a limit.
    pub(crate) fn above(&self, limit: f64) -> Decision {
        match (self.low > limit, self.high < limit) {
            (true, _) => Decision::Yes,
            (_, true) => Decision::No,
            _ => Decision::Undecided,
        }
    }

    pub(crate) fn below(&self, limit: f64) -> Decision {
        self.above(limit).opposite()
    }

    /// Whether the true value is from `low` to `high`.
    pub(crate) fn within(&self, low: f64, high: f64) -> Decision {
        match (self.above(low), self.below(high)) {
            (Decision::Yes, Decision::Yes) => Decision::Yes,
            (Decision::No, _) | (_, Decision::No) => Decision::No,
            _ => Decision::Undecided,
        }
    }
}

impl Decision {
    pub(crate) fn words(self) -> &'static str {
        match self {
            Decision::Yes => "holds",
            Decision::No => "does not hold",
            Decision::Undecided => "not decided",
        }
    }

    fn opposite(self) -> Decision {
        match self {
            Decision::Yes => Decision::No,
            Decision::No => Decision::Yes,
            Decision::Undecided => Decision::Undecided,
        }
    }
}

/// Mean and spread of values or of their logarithms.
struct Moments {
    mean: f64,
    variance_of_mean: f64,
    /// Degrees of freedom of the variance.
    freedom: f64,
}

impl Moments {
    /// Fewer values than `least` have an unbounded spread.
    fn of(values: &[f64], least: usize) -> Moments {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let freedom = count - 1.0;
        let variance_of_mean = if values.len() < least { f64::INFINITY } else { squares / freedom / count };
        Moments { mean, variance_of_mean, freedom }
    }

    fn of_logarithms(values: &[f64]) -> Moments {
        Moments::of(&values.iter().map(|value| value.ln()).collect::<Vec<_>>(), LEAST_VALUES)
    }

    fn interval(&self, confidence: f64) -> Interval {
        Interval::around(self.mean, quantile(self.freedom, confidence) * self.variance_of_mean.sqrt())
    }
}

/// Student's t that bounds a two-sided interval; 0 degrees of freedom and those of infinite variances bound nothing.
fn quantile(freedom: f64, confidence: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |student| student.inverse_cdf(0.5 + 0.5 * confidence))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::philox;

    fn normal(key: [u32; 2], trial: u32, draw: u32) -> f64 {
        let uniform = philox([trial, draw, 0, 0], key).map(|word| (f64::from(word) + 0.5) / 4_294_967_296.0);
        (-2.0 * uniform[0].ln()).sqrt() * (std::f64::consts::TAU * uniform[1]).cos()
    }

    const KEY: [u32; 2] = [7, 1];

    /// Times around `median` whose logarithms have this standard deviation.
    fn times(trial: u32, first: u32, count: u32, median: f64, deviation: f64) -> Vec<f64> {
        (first..first + count).map(|draw| median * (deviation * normal(KEY, trial, draw)).exp()).collect()
    }

    const TRIALS: u32 = 4000;

    /// Of this many trials, the share whose interval holds the truth.
    fn coverage(truth: f64, interval: impl Fn(u32) -> Interval) -> f64 {
        let holds = |trial: &u32| (interval(*trial).low..=interval(*trial).high).contains(&truth);
        f64::from((0..TRIALS).filter(holds).count() as u32) / f64::from(TRIALS)
    }

    /// Three standard errors of a share of 0.95 in 4000 trials are 0.0104.
    #[test]
    fn intervals_contain_the_truth_as_often_as_stated() {
        for count in [3, 7] {
            let held = coverage(2.0, |trial| Interval::of_geometric_mean(&times(trial, 0, count, 2.0, 0.3)));
            assert!((held - CONFIDENCE).abs() < 0.0104, "{count} runs: {held}");
        }
        // Welch's is an approximation, which is cautious for few runs.
        for (over, under, deviation) in [(3, 3, 0.1), (7, 7, 0.1), (7, 7, 0.5), (3, 7, 0.2), (7, 3, 0.02)] {
            let held =
                coverage(1.5, |trial| Interval::of_ratio(&times(trial, 0, over, 3.0, 0.1), &times(trial, 100, under, 2.0, deviation)));
            assert!((CONFIDENCE - 0.0104..0.985).contains(&held), "{over} and {under} runs, {deviation}: {held}");
        }
        // Points with normal errors around a line of slope 1.
        let held = coverage(1.0, |trial| {
            let points: Vec<(f64, f64)> = (0..5).map(|x| (f64::from(x), f64::from(x) + 0.1 * normal(KEY, trial, x))).collect();
            Interval::of_slope(&LineFit::of(&points).unwrap(), points.len())
        });
        assert!((held - CONFIDENCE).abs() < 0.0104, "slopes: {held}");
    }

    /// Hoeffding's holds for every distribution, so it covers more than it states for any one.
    #[test]
    fn shares_are_covered() {
        let held = coverage(0.5, |trial| {
            let heads = (0..100).filter(|draw| normal(KEY, trial, *draw) > 0.0).count();
            Interval::of_share(heads as f64 / 100.0, 100.0)
        });
        assert!(held >= CONFIDENCE, "{held}");
        let Interval { low, high, .. } = Interval::of_share(0.3, 5000.0);
        assert!((low - 0.2808).abs() < 1e-4 && (high - 0.3192).abs() < 1e-4, "{low} {high}");
    }

    /// Intervals over few runs hold the truth as often as they say, and of squared errors nearly so even where one pixel
    /// in all carries the noise.
    #[test]
    fn intervals_cover() {
        let normal = |trial: u32, draw: u32| normal([5, 9], trial, draw);
        for runs in [2, 3, 5] {
            let values = |trial: u32| (0..runs).map(|draw| 7.0 + normal(trial, draw)).collect::<Vec<_>>();
            let held = coverage(7.0, |trial| Interval::of_mean(&values(trial), CONFIDENCE));
            // Three standard errors of a share of 0.95.
            assert!((held - CONFIDENCE).abs() < 0.0104, "{runs} runs: {held}");
        }
        assert!(Interval::of_mean(&[1.0], CONFIDENCE).high.is_infinite());
        for (pixels, runs) in [(1, 3), (1, 5), (2, 3), (2, 5), (5, 3), (5, 5), (40, 5)] {
            let square =
                |trial: u32, run: u32| (0..pixels).map(|pixel| normal(trial, 64 * run + pixel).powi(2)).sum::<f64>() / f64::from(pixels);
            let held = coverage(1.0, |trial| Interval::of_squares(&(0..runs).map(|run| square(trial, run)).collect::<Vec<_>>()));
            assert!(held > 0.87, "{pixels} pixels, {runs} runs: {held}");
        }
    }

    #[test]
    fn two_runs_decide_nothing() {
        let (two, three) = ([1.0, 1.01], [5.0, 5.01, 5.02]);
        for interval in [Interval::of_ratio(&three, &two), Interval::of_ratio(&two, &three), Interval::of_geometric_mean(&two)] {
            assert!(!interval.is_bounded() && interval.above(0.01) == Decision::Undecided, "{interval:?}");
        }
        assert_eq!(LineFit::of(&[(0.0, 0.0)]), None);
        let fit = LineFit::of(&[(0.0, 0.0), (1.0, 1.0)]).unwrap();
        assert_eq!(Interval::of_slope(&fit, 2).within(0.9, 1.1), Decision::Undecided);
        assert_eq!(Interval::of_ratio(&three, &[1.0, 1.01, 1.02]).above(1.1), Decision::Yes);
    }

    #[test]
    fn equal_runs_have_no_spread() {
        let ratio = Interval::of_ratio(&[3.0; 4], &[2.0; 5]);
        assert!((ratio.low - 1.5).abs() < 1e-12 && (ratio.high - 1.5).abs() < 1e-12, "{ratio:?}");
    }

    #[test]
    fn an_interval_decides_only_what_lies_outside_it() {
        let interval = Interval { value: 1.3, low: 1.2, high: 1.4 };
        assert_eq!([1.1, 1.3, 1.5].map(|limit| interval.above(limit)), [Decision::Yes, Decision::Undecided, Decision::No]);
        assert_eq!([1.1, 1.3, 1.5].map(|limit| interval.below(limit)), [Decision::No, Decision::Undecided, Decision::Yes]);
        assert_eq!(interval.within(1.0, 1.5), Decision::Yes);
        assert_eq!(interval.within(1.3, 1.5), Decision::Undecided);
        assert_eq!(interval.within(1.5, 2.0), Decision::No);
        assert_eq!(interval.within(0.5, 1.1), Decision::No);
    }
}
