//! The error of a film of rounds.

use super::RoundFilm;
use crate::plan::transport::TransportPlan;
use crate::render::stop;

/// The relative error that a film has not more of, with this confidence: of its noise (see [`stop::error_bound`]), and of
/// what nothing has reached. Infinite where that is all there is.
pub fn error_bound(film: &RoundFilm, plan: &TransportPlan, confidence: f64) -> f64 {
    if film.rounds < 2 {
        return f64::INFINITY;
    }
    stop::error_bound(film.rounds, film.relative_error(plan), confidence).hypot(film.unknown(plan, confidence).relative)
}
