//! The bias of a run's radii by extra runs, before a run that ends at an error and after any other.

use super::events::{Event, Observer};
use super::values::Percent;
use crate::engine::error::bias::Bias;
use crate::engine::error::bias_batches::BATCHES;
use crate::error::{Error, Result};
use crate::settings::stop::Stop;
use crate::text::counted;

/// Rounds of a batch after a run of so many: all batches at both radii together do about as many as the run.
pub(crate) fn rounds_after(rounds: u32) -> u32 {
    rounds.div_ceil(2 * BATCHES).max(1)
}

/// Rounds of a batch at first, and how often it is made again with four times as many, as long as the interval leaves
/// open whether the error wanted can be reached.
const FIRST_ROUNDS: u32 = 2;
const REFINEMENTS: u32 = 4;

/// Measures the bias of the first round's radius if it is asked for and the run ends at an error, of which it is a part.
/// `shrinks` says whether later radii are smaller.
pub(crate) fn bias_before(
    stop: &Stop,
    is_asked: bool,
    shrinks: bool,
    observer: &Observer,
    mut measure: impl FnMut(u32) -> Result<Option<Bias>>,
) -> Result<Option<Bias>> {
    let Some(wanted) = stop.error.filter(|_| is_asked) else { return Ok(None) };
    let mut rounds = FIRST_ROUNDS;
    for refinement in 0..=REFINEMENTS {
        observer.report(Event::Step(&format!("measuring the bias first: {BATCHES} batches of {} at two radii", counted(rounds, "round"))));
        let Some(bias) = measure(rounds)? else { return Ok(None) };
        // More than half of the error wanted is then left for noise.
        let is_decided = bias.upper <= 0.85 * wanted || bias.lower > wanted || refinement == REFINEMENTS;
        // Where the radius shrinks the bias need not be known as well: it will be small enough some day.
        if is_decided || shrinks {
            if !shrinks && bias.upper >= wanted {
                let (lower, upper) = (100.0 * bias.lower, 100.0 * bias.upper);
                let allowed = format!(
                    "cannot be reached: the bias of the radius alone is {lower:.2} % to {upper:.2} %, and the radius never shrinks; use a smaller `radius`{}",
                    if bias.lower > wanted { "" } else { " or a lower `confidence`" }
                );
                return Err(Error::setting("error", Percent::of_share(wanted), allowed));
            }
            return Ok(Some(bias));
        }
        rounds *= 4;
    }
    Ok(None)
}
