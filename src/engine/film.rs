//! The core of all films: exact sums over rounds and of the squares of what each round left, whose spread tells the error.
//! Sums are integers, so that it does not matter in which order photons, chunks, rounds or devices add to them.

use super::degrees_of_freedom::DegreesOfFreedom;
use crate::constants::KEPT_ROUNDS;
use crate::plan::latest_rounds::{kept_count, kept_place};

/// Sums over rounds, place by place.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RoundSums {
    /// Rounds that have ended.
    pub rounds: u32,
    pub sums: Vec<u64>,
    /// Of what each of these rounds left; empty where nobody asks for the error.
    pub squares: Vec<u128>,
    /// What each of the latest [`KEPT_ROUNDS`] rounds left at [`kept_count`] places, round after round.
    pub latest: Vec<f32>,
}

impl RoundSums {
    /// Adds what a round left: each place has so many sums, of which the first is kept.
    pub fn end_round(&mut self, of_round: &[u64], channel_count: usize) {
        self.sums.iter_mut().zip(of_round).for_each(|(sum, of_round)| *sum += of_round);
        self.squares.iter_mut().zip(of_round).for_each(|(squares, of_round)| *squares += u128::from(*of_round).pow(2));
        if !self.latest.is_empty() {
            let places = of_round.len() / channel_count;
            let first = self.rounds as usize % KEPT_ROUNDS as usize * kept_count(places);
            for (number, place) in (0..kept_count(places)).filter_map(|number| Some((number, kept_place(number, places)?))) {
                let sum = of_round[place * channel_count];
                self.latest[first + number] = (sum >> 32) as f32 * 4_294_967_296.0 + (sum as u32) as f32;
            }
        }
        self.rounds += 1;
    }

    /// How far errors of places go together, in whose sum each counts by its weight; each has so many values that are kept.
    pub fn degrees_of_freedom(&self, channels: usize, places: usize, weight: impl Fn(usize) -> f64) -> DegreesOfFreedom {
        let kept = self.latest.chunks_exact(channels * kept_count(places)).take(self.rounds as usize);
        let weights: Vec<f64> = (0..kept_count(places)).map(|number| kept_place(number, places).map_or(0.0, &weight)).collect();
        let weighted = |values: &[f32]| values.iter().enumerate().map(|(k, value)| weights[k / channels] * f64::from(*value)).collect();
        DegreesOfFreedom::of(&kept.map(weighted).collect::<Vec<_>>(), self.rounds)
    }

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
