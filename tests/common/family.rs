//! Many tests of one subject, judged together: the more there are, the further each may be off by chance.

use std::cmp::Ordering;

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

use super::aimed::mean_and_error;
use super::{Check, Complaint, Kind};

/// Chance that a whole family complains although every value in it is right. Seeds are fixed, so a family that
/// passes once passes always on the same device.
pub const FALSE_ALARM: f64 = 1e-3;
/// Relative error of what is not random: single precision over some tens of operations.
pub const ROUNDING: f64 = 1e-5;

/// A value against its expectation.
#[derive(Debug, Clone)]
struct Test {
    what: String,
    found: f64,
    expected: f64,
    standard_error: f64,
    /// Of the standard error; `None` where it is known and not estimated.
    freedom: Option<u32>,
}

impl Test {
    /// Whether chance may well put it so far off. An error or a value that is no number is not chance.
    fn holds(&self, expected: f64, least_p_value: f64) -> bool {
        self.p_value(expected) >= least_p_value
    }

    /// Chance of being at least so far off.
    fn p_value(&self, expected: f64) -> f64 {
        let z = (self.found - expected).abs() / self.standard_error;
        self.freedom.map_or_else(|| normal_p_value(z), |freedom| student_p_value(z, freedom))
    }
}

/// Tests that share [`FALSE_ALARM`]. By Sidak (1967) each may fail with the chance 1 - (1 - alpha)^(1 / count), so
/// that independent ones all pass with the chance 1 - alpha, and dependent ones (of two-sided normal errors)
/// more often.
#[derive(Debug, Clone, Default)]
pub struct Family {
    tests: Vec<Test>,
}

impl Family {
    /// A value of known standard error.
    pub fn expect(&mut self, what: impl Into<String>, found: f64, expected: f64, standard_error: f64) {
        self.push(what.into(), found, expected, standard_error, None);
    }

    /// The mean of independent values, of which the spread gives the error. No error is below rounding.
    pub fn expect_mean(&mut self, what: impl Into<String>, values: &[f64], expected: f64) {
        let (mean, error) = mean_and_error(values);
        self.expect_estimate(what, mean, error, values.len() as u32, expected);
    }

    /// A mean whose error was estimated from so many independent values.
    pub fn expect_estimate(&mut self, what: impl Into<String>, mean: f64, standard_error: f64, values: u32, expected: f64) {
        self.push(what.into(), mean, expected, standard_error, Some(values - 1));
    }

    /// A count of independent trials of this probability.
    pub fn expect_count(&mut self, what: impl Into<String>, count: u64, trials: u64, probability: f64) {
        let error = (probability * (1.0 - probability) / trials as f64).sqrt();
        self.push(what.into(), count as f64 / trials as f64, probability, error, None);
    }

    fn push(&mut self, what: String, found: f64, expected: f64, standard_error: f64, freedom: Option<u32>) {
        let rounding = ROUNDING * expected.abs();
        // An error that is no number stays one, and fails.
        let standard_error = if standard_error < rounding { rounding } else { standard_error };
        self.tests.push(Test { what, found, expected, standard_error, freedom });
    }

    fn least_p_value(&self) -> f64 {
        -((-FALSE_ALARM).ln_1p() / self.tests.len() as f64).exp_m1()
    }

    /// Complains about what is further off than chance allows.
    pub fn check(&self) -> Check {
        self.complaint().map_err(|complaint| complaint.text)
    }

    /// The same, and in which way the first of them is off.
    pub fn complaint(&self) -> Check<Complaint> {
        let least = self.least_p_value();
        for test in &self.tests {
            println!("{}", self.line(test));
            if !test.holds(test.expected, least) {
                let (p_value, count) = (test.p_value(test.expected), self.tests.len());
                let kind = match test.found.partial_cmp(&test.expected) {
                    Some(Ordering::Less) => Kind::TooDark,
                    Some(_) => Kind::TooBright,
                    None => Kind::NoNumber,
                };
                let text = format!("{}; p = {p_value:.1e}, of {count} tests none should be below {least:.1e}", self.line(test));
                return Err(Complaint::new(kind, text));
            }
        }
        if self.tests.is_empty() { Err(Complaint::new(Kind::Broken, "nothing was tested")) } else { Ok(()) }
    }

    fn line(&self, test: &Test) -> String {
        let Test { what, found, expected, standard_error, .. } = test;
        let z = (found - expected) / standard_error;
        let noticed = 100.0 * self.least_noticed(test);
        format!("{what:<64} expected {expected:>12.7} found {found:>12.7} +- {standard_error:.1e}, z = {z:>5.2}, notices {noticed:.2} %")
    }

    /// Whether a test would fail, were the expected value wrong by this share, up or down.
    fn notices(&self, test: &Test, share: f64) -> bool {
        [1.0 - share, 1.0 + share].iter().all(|wrong| !test.holds(wrong * test.expected, self.least_p_value()))
    }

    /// Least relative error of the expected value at which a test fails.
    fn least_noticed(&self, test: &Test) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            (low, high) = if self.notices(test, middle) { (low, middle) } else { (middle, high) };
        }
        high
    }

    /// Fails unless everything holds, and unless every test that `which` names fails, by itself, once its expected
    /// value is wrong by `share`.
    #[track_caller]
    pub fn assert_detects(&self, share: f64, which: impl Fn(&str) -> bool) {
        if let Err(complaint) = self.check() {
            panic!("{complaint}");
        }
        let asked: Vec<&Test> = self.tests.iter().filter(|test| which(&test.what)).collect();
        assert!(!asked.is_empty());
        for test in asked {
            assert!(self.notices(test, share), "an error of {} % is not noticed: {}", 100.0 * share, self.line(test));
        }
    }

    /// The same for all tests and one per cent.
    #[track_caller]
    pub fn assert_detects_one_per_cent(&self) {
        self.assert_detects(0.01, |_| true);
    }
}

/// Chance of a standard normal number beyond z on either side.
pub fn normal_p_value(z: f64) -> f64 {
    2.0 * Normal::standard().sf(z)
}

/// The same of Student's t.
pub fn student_p_value(t: f64, freedom: u32) -> f64 {
    2.0 * StudentsT::new(0.0, 1.0, f64::from(freedom)).expect("there is a degree of freedom").sf(t)
}

/// The standard normal number that is as unlikely to be exceeded as a chi-squared sum of so many squares.
pub fn chi_squared_z(sum: f64, freedom: f64) -> f64 {
    Normal::standard().inverse_cdf(ChiSquared::new(freedom).expect("there is a degree of freedom").cdf(sum))
}
