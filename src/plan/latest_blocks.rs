//! What is kept of the latest blocks of a film, from which follows how far errors of its places go together
//! ([`crate::engine::error::degrees_of_freedom`]): some places, evenly spread. Twin of `glsl/film/latest_blocks.glsl`.

use crate::constants::{KEPT_BLOCKS, KEPT_PLACES};
use crate::rng::mix32;

fn kept_step(places: usize) -> usize {
    places.div_ceil(KEPT_PLACES as usize).max(1)
}

/// Places that are kept.
pub(crate) fn kept_count(places: usize) -> usize {
    places.div_ceil(kept_step(places))
}

/// The place with this number among them, one of every so many at random; `None` beyond the film's end.
pub(crate) fn kept_place(number: usize, places: usize) -> Option<usize> {
    let step = kept_step(places);
    let place = number * step + mix32(number as u32) as usize % step;
    (place < places).then_some(place)
}

/// Values of a channel that are kept of a run.
pub(crate) fn kept_values(places: usize) -> usize {
    kept_count(places) * KEPT_BLOCKS as usize
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn kept_places_are_spread_and_no_two_are_the_same() {
        for places in [1, 64, 1024, 1025, 5000, 1 << 20] {
            let kept: Vec<usize> = (0..kept_count(places)).filter_map(|number| kept_place(number, places)).collect();
            assert!(kept.is_sorted_by(|a, b| a < b) && kept.len() >= kept_count(places) - 1, "{places}");
            assert!(kept_count(places) <= KEPT_PLACES as usize && kept_count(places) >= places.min(KEPT_PLACES as usize) / 2);
        }
        // Of a picture of 1024 x 1024 in no order of columns.
        let columns: BTreeSet<usize> = (0..1024).filter_map(|number| kept_place(number, 1 << 20)).map(|place| place % 1024).collect();
        assert!(columns.len() > 512, "{} columns", columns.len());
        assert_eq!(kept_values(64), 64 * 256);
    }
}
