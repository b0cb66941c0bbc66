//! When a run has done enough: at its last round, at an error, or at a time, whichever comes first.

use std::time::{Duration, Instant};

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::RoundFilm;
use crate::plan::transport::TransportPlan;
use crate::render::Progress;
use crate::settings::transport::Stop;

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    Rounds,
    Error,
    Time,
    Cancelled,
}

/// Rounds before the error is looked at first: a spread of fewer says little. Looks come at rounds that grow by a
/// quarter, as each is one more chance to stop too early.
const FIRST_LOOK: u32 = 30;

/// Watches a run: how long it has taken, and how large its error still is.
pub struct Watch {
    stop: Stop,
    started: Instant,
    next_look: u32,
    /// At the latest look.
    error: Option<(u32, f64)>,
}

impl Watch {
    /// Of a run that began at `started`.
    pub fn new(stop: Stop, started: Instant) -> Watch {
        Watch { stop, started, next_look: FIRST_LOOK, error: None }
    }

    /// Whether the film should be read after so many rounds.
    pub fn is_due(&self, rounds: u32) -> bool {
        rounds >= self.next_look
    }

    pub fn look(&mut self, film: &RoundFilm, plan: &TransportPlan) {
        self.error = Some((film.rounds, error_bound(film, plan, self.stop.confidence)));
        self.next_look = film.rounds + (film.rounds / 4).max(1);
    }

    /// Whether the run has done enough after so many rounds.
    pub fn end(&self, rounds: u32) -> Option<End> {
        let small_enough = |wanted: f64| self.error.is_some_and(|(at, error)| at == rounds && error <= wanted);
        if self.stop.error.is_some_and(small_enough) {
            return Some(End::Error);
        }
        let over = self.stop.seconds.is_some_and(|seconds| self.started.elapsed() >= Duration::from_secs_f64(seconds));
        over.then_some(End::Time)
    }

    /// How far the run has come; the noise falls with the root of the rounds.
    pub fn progress(&self, rounds: u32, plan: &TransportPlan) -> Progress {
        let seconds = self.started.elapsed().as_secs_f64();
        let a_round = seconds / f64::from(rounds.max(1));
        let rounds_wanted = self.stop.error.zip(self.error).map(|(wanted, (at, error))| {
            (f64::from(at) * (error / wanted).powi(2)).clamp(f64::from(rounds), f64::from(plan.settings.rounds))
        });
        let by_rounds = a_round * (rounds_wanted.unwrap_or(f64::from(plan.settings.rounds)) - f64::from(rounds));
        let by_time = self.stop.seconds.map(|limit| (limit - seconds).max(0.0));
        Progress {
            done: u64::from(rounds),
            total: u64::from(plan.settings.rounds),
            seconds,
            seconds_left: Some(by_time.map_or(by_rounds, |left| left.min(by_rounds))),
            error: self.error.map(|(_, error)| error),
            error_wanted: self.stop.error,
            photons: u64::from(rounds) * plan.maps().map(|map| u64::from(map.photons)).sum::<u64>(),
        }
    }
}

/// The relative error that a film has not more of, with this confidence: Student's quantile times its standard error.
///
/// Pixels share photons, so their errors go together to an extent that nobody has measured; this bound takes them to
/// go together altogether, and so holds more often than it says. It is of the noise, not of the radius's bias.
pub fn error_bound(film: &RoundFilm, plan: &TransportPlan, confidence: f64) -> f64 {
    if film.rounds < 2 {
        return f64::INFINITY;
    }
    let distribution = StudentsT::new(0.0, 1.0, f64::from(film.rounds - 1)).expect("there is a degree of freedom");
    distribution.inverse_cdf(0.5 + 0.5 * confidence) * film.relative_error(plan)
}
