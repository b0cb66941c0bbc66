//! When a run ends before its last round: at an error (`--error`), at a time, or at a number of photons, whichever comes first.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::error_bound::{FilmError, error_bound};
use crate::error::{Error, Result};
use crate::ledger::Ledger;
use crate::plan::radius::mean_squared_radius;
use crate::settings::stop::Stop;
use serde::Serialize;

/// How a caller watches a run and ends it early.
pub struct Control<'a> {
    /// Set from outside to end the run after the photons, or the round, under way.
    pub cancelled: &'a AtomicBool,
    /// Told from time to time how far the run has come.
    pub progress: &'a mut dyn FnMut(&Progress),
}

impl<'a> Control<'a> {
    /// Watches nothing but `cancelled`.
    pub fn quiet(cancelled: &'a AtomicBool) -> Control<'a> {
        // A closure without captures takes no memory, so none is lost.
        Control { cancelled, progress: Box::leak(Box::new(|_: &Progress| {})) }
    }
}

/// Lets a run go on to its end.
impl Default for Control<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Control::quiet(&NEVER)
    }
}

/// How far a run has come.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Progress {
    /// Photons emitted, or rounds done, and how many there will be at most.
    pub done: u64,
    pub total: u64,
    /// Wall time since the start, and predicted until the end, seconds.
    pub seconds: f64,
    pub seconds_left: Option<f64>,
    /// Relative error that the result has not more of, with the confidence asked for, and the one that is wanted.
    pub error: Option<f64>,
    pub error_wanted: Option<f64>,
    /// Photons traced so far, of all maps.
    pub photons: u64,
    /// Their fates so far.
    pub ledger: Ledger,
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    Rounds,
    Error,
    Time,
    Photons,
    Cancelled,
}

/// Rounds before the error is looked at first: a spread of fewer says little. Looks come at rounds that grow by a
/// quarter, as each is one more chance to stop too early.
const FIRST_LOOK: u32 = 30;

/// Watches a run: how long it has taken, and how large its error still is.
pub struct Watch {
    stop: Stop,
    /// How fast the radius shrinks (`mean_squared_radius`); 1 keeps it.
    alpha: f64,
    started: Instant,
    next_look: u32,
    /// The latest look.
    seen: Option<Look>,
}

/// What a film told.
#[derive(Clone, Copy)]
struct Look {
    rounds: u32,
    /// Bound of the noise.
    noise: f64,
    unknown: f64,
    /// What is too rare to have been seen.
    unseen: f64,
    /// What limits have kept from the result ([`crate::ledger::Losses`]).
    lost: f64,
}

impl Watch {
    /// Of a run that began at `started`.
    pub fn new(stop: Stop, alpha: f64, started: Instant) -> Watch {
        Watch { stop, alpha, started, next_look: FIRST_LOOK, seen: None }
    }

    /// Whether the film should be read after so many rounds.
    pub fn is_due(&self, rounds: u32) -> bool {
        rounds >= self.next_look
    }

    /// Whether the run must be looked at now, as it may have done enough.
    pub fn may_end(&self, rounds: u32, photons: u64) -> bool {
        (self.stop.error.is_some() && self.is_due(rounds)) || self.has_photons(photons)
    }

    /// When the run's time is up.
    pub fn deadline(&self) -> Option<Instant> {
        self.stop.seconds.map(|seconds| self.started + Duration::from_secs_f64(seconds))
    }

    /// Takes what a film tells, and what limits kept from it, relative to it.
    pub fn look(&mut self, error: &FilmError, lost: f64) {
        let FilmError { rounds, noise, freedom, ref unknown, unseen } = *error;
        let noise = error_bound(noise, freedom, self.stop.confidence);
        self.seen = Some(Look { rounds, noise, unknown: unknown.relative, unseen, lost });
        self.next_look = rounds + (rounds / 4).max(1);
    }

    /// Noise, bias, what is unknown and what is unseen together at the latest look.
    fn error(&self) -> Option<(u32, f64)> {
        self.seen.map(|Look { rounds, noise, unknown, unseen, lost }| {
            (rounds, noise.hypot(unknown).hypot(unseen).hypot(self.bias(rounds) + lost))
        })
    }

    /// Refuses an error that cannot be reached, as limits alone keep more light from the result, and that nothing else would end.
    pub fn check_losses(&self, bounces: u32) -> Result<()> {
        if self.stop.seconds.is_some() || self.stop.photons.is_some() {
            return Ok(());
        }
        let lost = self.seen.map_or(0.0, |look| look.lost);
        let Some(wanted) = self.stop.error.filter(|wanted| lost > *wanted) else { return Ok(()) };
        let allowed = format!(
            "cannot be reached, because photons are cut off after {bounces} bounces, and what they carry may add up to {:.2} % of the result; allow more --bounces",
            100.0 * lost
        );
        Err(Error::setting("--error", format!("{}%", 100.0 * wanted), allowed))
    }

    fn bias(&self, rounds: u32) -> f64 {
        self.stop.bias.map_or(0.0, |bias| bias * mean_squared_radius(self.alpha, rounds))
    }

    pub fn has_photons(&self, photons: u64) -> bool {
        self.stop.photons.is_some_and(|wanted| photons >= wanted)
    }

    /// Whether the run has done enough after so many whole rounds and photons.
    pub fn end(&self, rounds: u32, photons: u64) -> Option<End> {
        let small_enough = |wanted: f64| self.error().is_some_and(|(at, error)| at == rounds && error <= wanted);
        if self.stop.error.is_some_and(small_enough) {
            return Some(End::Error);
        }
        if self.has_photons(photons) {
            return Some(End::Photons);
        }
        let over = self.stop.seconds.is_some_and(|seconds| self.started.elapsed() >= Duration::from_secs_f64(seconds));
        over.then_some(End::Time)
    }

    /// How far the run has come, in rounds, which have so many photons each.
    pub fn progress(&self, rounds: f64, most_rounds: u32, photons_per_round: u64, ledger: Ledger) -> Progress {
        let seconds = self.started.elapsed().as_secs_f64();
        let a_round = seconds / rounds.max(1e-9);
        let most = f64::from(most_rounds);
        let by_photons = self.stop.photons.map_or(most, |photons| (photons as f64 / photons_per_round.max(1) as f64).ceil());
        // Before the first look nobody knows when the error will be what is wanted.
        let by_error = match self.stop.error {
            Some(wanted) => self.seen.map(|seen| self.rounds_wanted(wanted, seen, most)),
            None => Some(most),
        };
        let by_rounds = by_error.map(|by_error| a_round * (by_error.min(by_photons).min(most) - rounds).max(0.0));
        let by_time = self.stop.seconds.map(|limit| (limit - seconds).max(0.0));
        Progress {
            done: rounds as u64,
            total: u64::from(most_rounds),
            seconds,
            seconds_left: by_rounds.into_iter().chain(by_time).reduce(f64::min),
            error: self.error().map(|(_, error)| error).filter(|error| error.is_finite()),
            error_wanted: self.stop.error,
            photons: ledger.emitted,
            ledger,
        }
    }

    /// Rounds after which the error will be what is wanted: the square of the noise falls as 1 / rounds, the bias as
    /// rounds^(alpha - 1), what nothing has reached as 1 / (rounds and area of the discs), and what is unseen as 1 / rounds.
    fn rounds_wanted(&self, wanted: f64, Look { rounds, noise, unknown, unseen, lost }: Look, most: f64) -> f64 {
        let (at, bias) = (f64::from(rounds), self.bias(rounds));
        let error = |rounds: f64| {
            let unknown = unknown * (at / rounds).powf(self.alpha);
            (noise * (at / rounds).sqrt())
                .hypot(unknown)
                .hypot(unseen * at / rounds)
                .hypot(bias * (at / rounds).powf(1.0 - self.alpha) + lost)
        };
        let (mut less, mut more) = (at.min(most), most);
        if error(less) <= wanted {
            return less;
        }
        // Halves the range of the logarithm: 50 times are far below a round.
        for _ in 0..50 {
            let middle = (less * more).sqrt();
            if error(middle) <= wanted { more = middle } else { less = middle }
        }
        more
    }
}
