//! The error of a result: what a film tells of it, and the bound that it has not more of, with a confidence.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::degrees_of_freedom::DegreesOfFreedom;
use super::unknown::Unknown;
use crate::constants::PART_COUNT;

/// What a film of so many rounds tells of its error, relative to its light.
#[derive(Debug, Clone, PartialEq)]
pub struct FilmError {
    pub rounds: u32,
    /// Whole blocks, of which the spread tells the noise.
    pub blocks: u32,
    /// Standard error; infinite of fewer than two blocks.
    pub noise: f64,
    pub freedom: DegreesOfFreedom,
    /// What nothing has reached.
    pub unknown: Unknown,
    /// What light may add that is so rare that no round may have shown it, with the confidence that was asked for: as many hits
    /// of the brightest lamp in mirrors and glass as a run may miss. Infinite where all else is black.
    pub unseen: f64,
    /// Where the noise sits; `None` where that is not known.
    pub places: Option<ErrorPlaces>,
}

/// Where the error of the noise sits, as shares of its square.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorPlaces {
    /// One in a hundred, and the share of these.
    pub worst_pixels: u64,
    pub of_worst_pixels: f64,
    /// Of direct light, what is seen over mirrors and through glass, caustics, indirect light.
    pub of_parts: [f64; PART_COUNT as usize],
}

impl FilmError {
    /// The relative error that the film has not more of, with this confidence: of its noise (see [`error_bound`]), and of what
    /// nothing has reached. Infinite where that is all there is.
    pub fn bound(&self, confidence: f64) -> f64 {
        error_bound(self.noise, self.freedom, confidence).hypot(self.unknown.relative)
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
/// small by chance. The bound is infinite where nothing tells the error. The bias of the radius is not part of it.
pub fn error_bound(relative_error: f64, freedom: DegreesOfFreedom, confidence: f64) -> f64 {
    if relative_error == 0.0 || relative_error.is_infinite() {
        return relative_error;
    }
    let distribution = FisherSnedecor::new(freedom.error, freedom.estimate).expect("there are degrees of freedom");
    distribution.inverse_cdf(confidence).sqrt() * relative_error * (1.0 + (0.5 / freedom.estimate).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tail_is_known_once_the_noise_covers_what_is_unseen() {
        let error = |rounds: u32| FilmError {
            rounds,
            blocks: rounds,
            noise: 0.4 / f64::from(rounds).sqrt(),
            freedom: DegreesOfFreedom::least(rounds),
            unknown: Unknown::default(),
            unseen: 8.0 / f64::from(rounds),
            places: None,
        };
        assert!(!error(16).tail_is_known(0.95) && error(256).tail_is_known(0.95));
        // The bound itself is of what rounds have shown.
        assert!(error(16).bound(0.95) < error(16).unseen);
        assert!(FilmError { unseen: 0.0, noise: 0.0, ..error(16) }.tail_is_known(0.95));
        assert!(!FilmError { unseen: f64::INFINITY, noise: 0.0, ..error(16) }.tail_is_known(0.95));
    }
}
