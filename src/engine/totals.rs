//! What a scene's photons lose to limits, and how many its maps have held: twin of `glsl/ledger/totals.glsl`.

use crate::constants::{TALLY_COPIES, TOTAL_WORDS};
use crate::ledger::Totals;

/// Words of the buffer.
pub(crate) const WORDS: u64 = TOTAL_WORDS as u64 * TALLY_COPIES as u64;

/// What [`WORDS`] words of a buffer count, copies added up.
pub(crate) fn sum(words: &[u32]) -> Totals {
    let wide = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
    let mut sum = Totals { stored: wide(words[14], words[15]), ..Totals::default() };
    let (mut cut, mut clamped) = ([0u64; 3], [0u64; 3]);
    for copy in words.chunks_exact(TOTAL_WORDS as usize) {
        sum.cut_off += u64::from(copy[0]);
        sum.clamped += u64::from(copy[1]);
        for channel in 0..3 {
            cut[channel] += wide(copy[2 + 2 * channel], copy[3 + 2 * channel]);
            clamped[channel] += wide(copy[8 + 2 * channel], copy[9 + 2 * channel]);
        }
    }
    (sum.cut_flux, sum.clamped_flux) = (cut, clamped);
    sum
}
