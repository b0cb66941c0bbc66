//! What a smaller radius would change, from all blocks of a run: sums that give the bias of the radius ([`super::bias`]).
//!
//! Each round is also estimated within a share of its radii. Each block b so has a picture D_b of what that changes. The bias follows from
//! scalar products of different blocks, whose mean is |E D|^2. A picture per block is more than can be kept, so each is kept as a count
//! sketch (Charikar, Chen and Farach-Colton 2002): every pixel goes to one of some sums, with a sign of its own. Scalar products of
//! sketches have the mean of those of the pictures, and the sketch of a sum is the sum of sketches. Sums are integers, so that shards
//! add up to the bits of one run.

use super::bias::{Bias, BiasFrom, Groups};
use crate::plan::differences::row_length;

/// Of a film in film units, as `glsl/film/differences.glsl` and `glsl/kernels/end_difference.comp` leave them: for each row three
/// channels of each sum, then how many blocks it has. Two's complement. Empty where nobody measures.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Differences(pub Vec<u64>);

impl Differences {
    /// Adds the blocks of another part of the same run.
    pub(crate) fn merge(&mut self, other: &Differences) {
        self.0.iter_mut().zip(&other.0).for_each(|(sum, others)| *sum = sum.wrapping_add(*others));
    }

    /// The bias of a film of so many places; `relative` is what a difference of one unit in one value adds to the root of the square of
    /// the relative error.
    pub(crate) fn bias(&self, places: usize, relative: f64, confidence: f64) -> Bias {
        let rows: Vec<(f64, Vec<f64>)> = self
            .0
            .chunks_exact(row_length(places))
            .filter_map(|row| {
                let (blocks, sums) = row.split_last()?;
                let signed = |sum: &u64| *sum as i64 as f64 * relative;
                (*blocks > 0).then(|| (*blocks as f64, sums.iter().map(signed).collect()))
            })
            .collect();
        let blocks = rows.iter().map(|(blocks, _)| *blocks).sum::<f64>() as u32;
        Bias::extrapolated(Groups::of(&rows).mean_size(confidence), confidence, BiasFrom::Blocks(blocks))
    }
}
