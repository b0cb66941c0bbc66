//! The film of all rounds: the mean of each pixel and its standard error, from integer sums.

use glam::DVec3;

use crate::plan::transport::TransportPlan;

/// Exact sums over rounds, three channels a pixel, in film units.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RoundFilm {
    pub rounds: u32,
    pub sums: Vec<u64>,
    pub squares: Vec<u128>,
}

impl RoundFilm {
    pub fn new(rounds: u32, sums: Vec<u64>, squares: Vec<u64>) -> RoundFilm {
        let squares = squares.chunks_exact(2).map(|words| u128::from(words[0]) | u128::from(words[1]) << 64).collect();
        RoundFilm { rounds, sums, squares }
    }

    pub fn pixels(&self) -> usize {
        self.sums.len() / 3
    }

    /// Radiance (W/m2/sr) or irradiance (W/m2) of a pixel.
    pub fn mean(&self, pixel: usize, plan: &TransportPlan) -> DVec3 {
        let unit = plan.film_scale * f64::from(self.rounds.max(1));
        DVec3::from_array([0, 1, 2].map(|channel| self.sums[3 * pixel + channel] as f64 / unit))
    }

    /// Standard error of the mean, from the variance between rounds; of a single round nothing is known,
    /// and it is infinite.
    pub fn standard_error(&self, pixel: usize, plan: &TransportPlan) -> DVec3 {
        if self.rounds < 2 {
            return DVec3::INFINITY;
        }
        let rounds = f64::from(self.rounds);
        DVec3::from_array([0, 1, 2].map(|channel| {
            let (sum, square) = (u128::from(self.sums[3 * pixel + channel]), self.squares[3 * pixel + channel]);
            // sum^2 <= rounds * square, so what is left of the square is not negative but for the division's
            // remainder.
            let deviation = square.saturating_sub(sum * sum / u128::from(self.rounds)) as f64;
            (deviation / (rounds - 1.0) / rounds).sqrt() / plan.film_scale
        }))
    }

    /// Of all pixels and channels.
    pub fn root_mean_square(&self, plan: &TransportPlan) -> f64 {
        let squares: f64 = (0..self.pixels()).map(|pixel| self.mean(pixel, plan).length_squared()).sum();
        (squares / (3 * self.pixels()).max(1) as f64).sqrt()
    }

    /// Root mean square over pixels and channels of standard error and of the mean.
    pub fn relative_error(&self, plan: &TransportPlan) -> f64 {
        let (mut errors, mut means) = (0.0, 0.0);
        for pixel in 0..self.pixels() {
            errors += self.standard_error(pixel, plan).length_squared();
            means += self.mean(pixel, plan).length_squared();
        }
        if means > 0.0 { (errors / means).sqrt() } else { 0.0 }
    }
}
