//! Fates of paths while kernels count them: a tally for each bounce in `TALLY_COPIES` copies, which work
//! groups use round-robin.

use crate::constants::TALLY_COPIES;
use crate::error::Result;
use crate::gpu::{Buffer, Commands};
use crate::records::Tally;

/// Fates of the first bounces, copies added up.
pub(crate) fn read(commands: &mut Commands, tallies: &Buffer<Tally>, bounces: u32) -> Result<Vec<Tally>> {
    Ok(sums(&commands.read(tallies, (bounces * TALLY_COPIES) as usize)?))
}

/// Fates of bounces, the copies of each added up.
pub(crate) fn sums(copies: &[Tally]) -> Vec<Tally> {
    copies.chunks_exact(TALLY_COPIES as usize).map(sum).collect()
}

fn sum(copies: &[Tally]) -> Tally {
    let all = |fate: fn(&Tally) -> u32| copies.iter().map(fate).sum();
    Tally {
        stored: all(|tally| tally.stored),
        absorbed: all(|tally| tally.absorbed),
        escaped: all(|tally| tally.escaped),
        dropped: all(|tally| tally.dropped),
    }
}
