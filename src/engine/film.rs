//! The core of all films: exact sums over rounds and of the squares of what each round left, whose spread tells the error.
//! Sums are integers, so that it does not matter in which order photons, chunks, rounds or devices add to them.

/// Sums over rounds, place by place.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RoundSums {
    /// Rounds that have ended.
    pub rounds: u32,
    pub sums: Vec<u64>,
    /// Of what each of these rounds left; empty where nobody asks for the error.
    pub squares: Vec<u128>,
}

impl RoundSums {
    /// Variance of a place's sum over all rounds, of which `sum` is what those that have ended left; infinite of fewer than two.
    pub fn variance(&self, place: usize, sum: u64) -> f64 {
        if self.rounds < 2 || self.squares.is_empty() {
            return f64::INFINITY;
        }
        let (rounds, sum) = (f64::from(self.rounds), u128::from(sum));
        // sum^2 <= rounds * squares, so what is left of the squares is not negative but for the division's remainder; and sums
        // are at most 2^63.
        let deviation = self.squares[place].saturating_sub(sum * sum / u128::from(self.rounds)) as f64;
        deviation * rounds / (rounds - 1.0)
    }
}

/// A sum of squares from its lower and upper 64 bits.
pub fn wide(low: u64, high: u64) -> u128 {
    u128::from(low) | u128::from(high) << 64
}
