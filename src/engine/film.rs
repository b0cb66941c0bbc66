//! The core of all films: exact sums over blocks of rounds and of the squares of what each block left, whose spread shows the
//! error. Sums are integers, so that it does not matter in which order photons, chunks, blocks or devices add to them.

use super::error::degrees_of_freedom::{DegreesOfFreedom, concentration};
use crate::constants::KEPT_BLOCKS;
use crate::plan::latest_blocks::{kept_count, kept_place};

/// Sums over blocks, place by place.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BlockSums {
    /// Rounds that the sums hold: of whole blocks, or of one that was cut short where there is no whole one.
    pub rounds: u32,
    /// Whole blocks.
    pub blocks: u32,
    pub sums: Vec<u64>,
    /// Of what each whole block left; empty where nobody asks for the error.
    pub squares: Vec<u128>,
}

/// Of any place of a film.
const MOST_SUM: u64 = 1 << 63;

/// Sums of two parts do not fit into one, as those of a run do. What was to hold them holds nothing of use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TooLarge;

/// Adds others, place by place.
pub(crate) fn add_all<T: Copy>(sums: &mut [T], others: &[T], add: impl Fn(T, T) -> Option<T>) -> Result<(), TooLarge> {
    sums.iter_mut().zip(others).try_for_each(|(sum, others)| {
        *sum = add(*sum, *others).ok_or(TooLarge)?;
        Ok(())
    })
}

/// What a block left at [`kept_count`] places.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct KeptBlock {
    pub number: u32,
    pub values: Vec<f32>,
}

/// What the latest [`KEPT_BLOCKS`] blocks left, by their numbers: of blocks whose numbers differ by a multiple of that the higher one.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct LatestBlocks(Vec<KeptBlock>);

impl BlockSums {
    /// Adds what a block of so many rounds left.
    pub fn end_block(&mut self, rounds: u32, of_block: &[u64]) {
        self.sums.iter_mut().zip(of_block).for_each(|(sum, of_block)| *sum += of_block);
        self.squares.iter_mut().zip(of_block).for_each(|(squares, of_block)| *squares += u128::from(*of_block).pow(2));
        self.rounds += rounds;
        self.blocks += 1;
    }

    /// Adds the blocks of another part of the same run.
    pub(crate) fn merge(&mut self, other: &BlockSums) -> Result<(), TooLarge> {
        self.rounds = self.rounds.checked_add(other.rounds).ok_or(TooLarge)?;
        self.blocks = self.blocks.checked_add(other.blocks).ok_or(TooLarge)?;
        add_all(&mut self.sums, &other.sums, u64::checked_add)?;
        add_all(&mut self.squares, &other.squares, u128::checked_add)
    }

    /// Whether sums and squares can be those of so many blocks: where all else is equal, sums^2 <= blocks * squares, and one block
    /// left it all where squares = sums^2.
    pub fn is_sound(&self) -> bool {
        let mut places = self.sums.iter().zip(&self.squares);
        places.all(|(sum, squares)| {
            let square = u128::from(*sum).pow(2);
            *sum <= MOST_SUM && *squares <= square && squares.checked_mul(self.blocks.into()).is_none_or(|most| square <= most)
        })
    }

    /// Independent numbers that give a standard error: the blocks less one.
    pub fn error_freedom(&self) -> u32 {
        self.blocks.saturating_sub(1)
    }

    /// Variance of a place's sum; infinite of fewer than two blocks.
    pub fn variance(&self, place: usize) -> f64 {
        if self.blocks < 2 || self.squares.is_empty() {
            return f64::INFINITY;
        }
        let (blocks, sum) = (f64::from(self.blocks), u128::from(self.sums[place]));
        // sum^2 <= blocks * squares, so what is left of the squares is not negative but for the division's remainder.
        let deviation = self.squares[place].saturating_sub(sum * sum / u128::from(self.blocks)) as f64;
        deviation * blocks / (blocks - 1.0)
    }
}

impl LatestBlocks {
    pub(crate) fn push(&mut self, block: KeptBlock) {
        let slot = |number: u32| number % KEPT_BLOCKS;
        match self.0.iter().position(|kept| slot(kept.number) == slot(block.number)) {
            Some(place) if self.0[place].number > block.number => return,
            Some(place) => drop(self.0.remove(place)),
            None => {}
        }
        let place = self.0.partition_point(|kept| kept.number < block.number);
        self.0.insert(place, block);
    }

    pub(crate) fn merge(&mut self, other: &LatestBlocks) {
        other.iter().for_each(|block| self.push(block.clone()));
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &KeptBlock> {
        self.0.iter()
    }

    /// How far errors of places go together in a film of so many blocks: `value` makes what counts of a kept place of what is kept of
    /// it, from `size` numbers; `variances` are those of all places.
    pub(crate) fn degrees_of_freedom<const N: usize>(
        &self,
        size: usize,
        places: usize,
        blocks: u32,
        value: impl Fn(usize, &[f32]) -> [f64; N],
        variances: impl Iterator<Item = f64>,
    ) -> DegreesOfFreedom {
        let weighted = |block: &KeptBlock| -> Vec<f64> {
            let kept = block.values.chunks_exact(size).take(kept_count(places)).enumerate();
            kept.filter_map(|(number, values)| Some(value(kept_place(number, places)?, values))).flatten().collect()
        };
        let latest: Vec<Vec<f64>> = self.0.iter().map(weighted).collect();
        DegreesOfFreedom::of(&latest, N, blocks, concentration(variances))
    }
}

/// A value of a film as it is kept of a block. Twin of `float_of` in `glsl/film/latest_blocks.glsl`.
pub(crate) fn kept_value(sum: u64) -> f32 {
    (sum >> 32) as f32 * 4_294_967_296.0 + (sum as u32) as f32
}

/// Lower and upper 64 bits of each.
pub(crate) fn halves(squares: &[u128]) -> Vec<u64> {
    squares.iter().flat_map(|square| [*square as u64, (*square >> 64) as u64]).collect()
}

/// A sum of squares from its lower and upper 64 bits.
pub(crate) fn wide(low: u64, high: u64) -> u128 {
    u128::from(low) | u128::from(high) << 64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_blocks_are_kept_in_whatever_order_they_come() {
        let kept = |numbers: &[u32]| {
            let mut latest = LatestBlocks::default();
            numbers.iter().for_each(|number| latest.push(KeptBlock { number: *number, values: vec![*number as f32] }));
            latest
        };
        let all: Vec<u32> = (0..600).collect();
        let in_order = kept(&all);
        let numbers: Vec<u32> = in_order.iter().map(|block| block.number).collect();
        assert!(numbers.into_iter().eq(344..600));
        let backwards: Vec<u32> = all.iter().rev().copied().collect();
        let (even, odd): (Vec<u32>, Vec<u32>) = all.iter().partition(|number| *number % 2 == 0);
        assert!(kept(&backwards) == in_order && kept(&[odd, even].concat()) == in_order);
    }
}
