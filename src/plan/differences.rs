//! How the sums that give the bias of a scene's radii lie in their buffer (`engine::error::differences`). Twin of
//! `glsl/film/differences.glsl` and
//! `glsl/kernels/end_difference.comp`.

use crate::constants::{DIFFERENCE_ROWS, DIFFERENCE_SUMS};

/// Words of a row of a film of so many places: three channels of each sum, then how many blocks it has.
pub(crate) fn row_length(places: usize) -> usize {
    3 * places.min(DIFFERENCE_SUMS as usize) + 1
}

/// Words of all rows of whole blocks; on the device one more follows, of the block under way.
pub(crate) fn difference_count(places: usize) -> usize {
    DIFFERENCE_ROWS as usize * row_length(places)
}
