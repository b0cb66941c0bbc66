//! The error of a film of rounds.

use super::SceneFilm;
use crate::engine::watch;
use crate::plan::scene::ScenePlan;

/// The relative error that a film has not more of, with this confidence: of its noise (see [`watch::error_bound`]), and of
/// what nothing has reached. Infinite where that is all there is.
pub fn error_bound(film: &SceneFilm, plan: &ScenePlan, confidence: f64) -> f64 {
    if film.rounds < 2 {
        return f64::INFINITY;
    }
    watch::error_bound(film.rounds, film.relative_error(plan), confidence).hypot(film.unknown(plan, confidence).relative)
}
