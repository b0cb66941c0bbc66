//! The error of a result: what a film says of it, and the bound that it has not more of, with a confidence.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

use super::bias::Bias;
use super::degrees_of_freedom::DegreesOfFreedom;
use super::unknown::Unknown;
use crate::constants::PART_COUNT;
use crate::settings::stop::LEAST_BLOCKS;

/// What a film of so many rounds says of its error, relative to its light.
#[derive(Debug, Clone, PartialEq)]
pub struct FilmError {
    pub rounds: u32,
    /// Whole blocks, of which the spread gives the noise.
    pub blocks: u32,
    /// Standard error; infinite of fewer than two blocks.
    pub noise: f64,
    pub(crate) freedom: DegreesOfFreedom,
    /// What nothing has reached.
    pub(crate) unknown: Unknown,
    /// What light may add that is so rare that no round may have shown it, with the confidence that was asked for: as many hits
    /// of the brightest lamp in mirrors and glass as a run may miss. Infinite where all else is black.
    pub unseen: f64,
    /// Of the radius; `None` where it was not measured.
    pub bias: Option<Bias>,
    /// Where the noise sits; `None` where that is not known.
    pub(crate) places: Option<ErrorPlaces>,
}

/// Where the error of the noise sits, as shares of its square.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct ErrorPlaces {
    /// One in a hundred, and the share of these.
    pub worst_pixels: u64,
    pub of_worst_pixels: f64,
    /// Of direct light, what is seen over mirrors and through glass, caustics, indirect light.
    pub of_parts: [f64; PART_COUNT as usize],
}

impl ErrorPlaces {
    /// The share of caustics and indirect light, which come from maps.
    pub(crate) fn of_maps(&self) -> f64 {
        let [_, _, caustic, indirect] = self.of_parts;
        caustic + indirect
    }
}

impl FilmError {
    /// As reported to users: of few blocks the noise is unknown, and so is where it sits. Black all over is as it was.
    pub fn stated(self) -> FilmError {
        match self.blocks < LEAST_BLOCKS && self.noise > 0.0 {
            true => FilmError { noise: f64::INFINITY, places: None, ..self },
            false => self,
        }
    }

    /// The relative error that the film has not more of, with this confidence: of its noise (see [`error_bound`]), and of what
    /// nothing has reached. Infinite where that is all there is.
    pub fn bound(&self, confidence: f64) -> f64 {
        error_bound(self.noise, self.freedom, confidence).hypot(self.unknown.relative)
    }

    /// The relative error that the film has not more of, bias and light that limits kept from it included.
    pub fn bound_of_all(&self, confidence: f64, lost: f64) -> f64 {
        let noise = [self.noise, error_bound(self.noise, self.freedom, confidence)];
        let bias = self.bias.map_or([0.0; 2], |bias| [bias.relative, bias.upper]).map(|bias| bias + lost);
        bound_of_both(noise, bias).hypot(self.unknown.relative)
    }

    /// Whether rounds have shown the tail of the noise: what they may not have shown is no more than the bound of what they have.
    /// The spread of rounds says nothing of hits that none of them had. `unseen` falls as 1 / rounds and noise as the root of it,
    /// so that every tail is known in the end.
    pub fn tail_is_known(&self, confidence: f64) -> bool {
        self.unseen <= error_bound(self.noise, self.freedom, confidence)
    }
}

/// Upper bound of a mean's relative error, with this confidence, from its relative standard error: that error times the root of a
/// quantile of the F distribution (Fisher 1924). With one degree of freedom of the error the root is Student's quantile.
///
/// The standard error is taken one standard error of its own larger, because runs that end at an error end sooner where it is too
/// small by chance. The bound is infinite where nothing gives the error. The bias of the radius is not part of it.
pub(crate) fn error_bound(relative_error: f64, freedom: DegreesOfFreedom, confidence: f64) -> f64 {
    if relative_error == 0.0 || relative_error.is_infinite() {
        return relative_error;
    }
    let distribution = FisherSnedecor::new(freedom.error, freedom.estimate).expect("there are degrees of freedom");
    distribution.inverse_cdf(confidence).sqrt() * relative_error * (1.0 + (0.5 / freedom.estimate).sqrt())
}

/// From what standard errors are, and with which confidence a run states intervals.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ErrorSource {
    pub degrees_of_freedom: u32,
    pub confidence: f64,
}

impl ErrorSource {
    /// Standard errors to either side of a mean between which lies what it estimates: a quantile of Student's distribution (1908).
    /// `None` where so few blocks leave the error unknown.
    pub fn reach(self) -> Option<f64> {
        let student = StudentsT::new(0.0, 1.0, f64::from(self.degrees_of_freedom)).ok()?;
        (self.degrees_of_freedom + 1 >= LEAST_BLOCKS).then(|| student.inverse_cdf(0.5 + 0.5 * self.confidence))
    }

    /// For people: what follows from a standard error.
    pub fn in_words(self) -> String {
        let ErrorSource { degrees_of_freedom, confidence } = self;
        let Some(reach) = self.reach() else {
            return format!("Standard errors: unknown, as fewer than {LEAST_BLOCKS} blocks of rounds are whole");
        };
        let sure = 100.0 * confidence;
        format!(
            "Standard errors: of {degrees_of_freedom} degrees of freedom; a {sure} % interval reaches {reach:.3} of them to either side"
        )
    }

    /// The interval that follows from a mean and its standard error. No light is below 0, and an unknown error leaves it open.
    pub fn interval(self, mean: f64, error: f64) -> [f64; 2] {
        let half = match self.reach() {
            Some(reach) => reach * error,
            None => f64::INFINITY,
        };
        [(mean - half).max(0.0), mean + half]
    }
}

/// The bound of noise and bias together, each as it was found and its own bound. Squares add up, and so do the squares of how far
/// these may lie above what was found, as the one may be found too small where the other is not.
pub(crate) fn bound_of_both([noise, most_noise]: [f64; 2], [bias, most_bias]: [f64; 2]) -> f64 {
    if most_noise.is_infinite() || most_bias.is_infinite() {
        return f64::INFINITY;
    }
    let above = |found: f64, most: f64| most * most - found * found;
    (noise * noise + bias * bias + above(noise, most_noise).hypot(above(bias, most_bias))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_noise_and_bias_go_together() {
        // One alone is its own bound, and what is known exactly adds its square.
        assert_eq!((bound_of_both([2.0, 3.0], [0.0; 2]), bound_of_both([0.0; 2], [2.0, 3.0])), (3.0, 3.0));
        assert!((bound_of_both([2.0, 3.0], [4.0, 4.0]) - 5.0).abs() < 1e-12);
        let both = bound_of_both([2.0, 3.0], [1.0, 2.0]);
        assert!(both > 3.0 && both < 3f64.hypot(2.0), "{both}");
        assert_eq!(bound_of_both([f64::INFINITY; 2], [0.0; 2]), f64::INFINITY);
        assert_eq!(bound_of_both([1.0, 2.0], [0.0, f64::INFINITY]), f64::INFINITY);
    }

    /// Tables of Student's distribution.
    #[test]
    fn intervals_widen_where_few_blocks_give_the_error() {
        let source = |degrees_of_freedom| ErrorSource { degrees_of_freedom, confidence: 0.95 };
        for (freedom, expected) in [(7, 2.365), (15, 2.131), (31, 2.040)] {
            assert!((source(freedom).reach().unwrap() - expected).abs() < 1e-3, "{freedom}");
        }
        assert!([0, 1, 6].into_iter().all(|freedom| source(freedom).reach().is_none()));
        let [low, high] = source(7).interval(3.0, 1.0);
        assert!((low - 0.635).abs() < 1e-3 && (high - 5.365).abs() < 1e-3, "{low} to {high}");
        assert_eq!((source(7).interval(2.0, 1.0)[0], source(7).interval(2.0, 0.0)), (0.0, [2.0, 2.0]));
        assert_eq!((source(7).interval(2.0, f64::INFINITY), source(6).interval(2.0, 0.0)), ([0.0, f64::INFINITY], [0.0, f64::INFINITY]));
    }

    #[test]
    fn a_tail_is_known_once_the_noise_covers_what_is_unseen() {
        let error = |rounds: u32| FilmError {
            rounds,
            blocks: rounds,
            noise: 0.4 / f64::from(rounds).sqrt(),
            freedom: DegreesOfFreedom::least(rounds),
            unknown: Unknown::default(),
            unseen: 8.0 / f64::from(rounds),
            bias: None,
            places: None,
        };
        assert!(!error(16).tail_is_known(0.95) && error(256).tail_is_known(0.95));
        // The bound itself is of what rounds have shown.
        assert!(error(16).bound(0.95) < error(16).unseen);
        assert!(FilmError { unseen: 0.0, noise: 0.0, ..error(16) }.tail_is_known(0.95));
        assert!(!FilmError { unseen: f64::INFINITY, noise: 0.0, ..error(16) }.tail_is_known(0.95));
    }
}
