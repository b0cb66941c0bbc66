//! Samples against the density that they should have: the plane is cut into cells, a cell's probability is the
//! integral of the density over it, by quadrature, and a two-sided chi-square test asks whether the cells hold as
//! many samples as they should.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Check, require};

/// Probability that a check's limits are exceeded by chance, on each side: samples too far from their density, and
/// samples that lie closer to it than random ones do.
pub const CHANCE: f64 = 1e-6;
/// Samples that a cell should hold at least; smaller cells are put together.
const LEAST: f64 = 10.0;
/// What a density over everything integrates to, and by how much the quadrature may miss that.
pub const ONE: (f64, f64) = (1.0, 1e-6);

/// Cells between given coordinates, in ascending order.
#[derive(Debug, Clone)]
pub struct Grid {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
}

/// `count` cells of equal width.
pub fn even(from: f64, to: f64, count: usize) -> Vec<f64> {
    (0..=count).map(|k| from + (to - from) * k as f64 / count as f64).collect()
}

/// Gauss-Legendre quadrature with eight points: (place in [-1, 1], weight) of the half above 0.
const NODES: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

fn integral(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    half * NODES.iter().map(|(place, weight)| weight * (f(middle - half * place) + f(middle + half * place))).sum::<f64>()
}

impl Grid {
    /// Row by row.
    pub fn probabilities(&self, density: &dyn Fn(f64, f64) -> f64) -> Vec<f64> {
        let cell = |x: &[f64], y: &[f64]| integral(y[0], y[1], |v| integral(x[0], x[1], |u| density(u, v)));
        self.y.windows(2).flat_map(|y| self.x.windows(2).map(move |x| cell(x, y))).collect()
    }

    /// The cell of a place; rounding may have put it a little beside the grid.
    fn cell(&self, (x, y): (f64, f64)) -> Option<usize> {
        let find = |edges: &[f64], at: f64| {
            let (first, last) = (edges[0], edges[edges.len() - 1]);
            let margin = 1e-6 * (last - first);
            let inside = at >= first - margin && at <= last + margin;
            inside.then(|| edges[1..edges.len() - 1].partition_point(|edge| *edge <= at))
        };
        Some(find(&self.y, y)? * (self.x.len() - 1) + find(&self.x, x)?)
    }

    /// Samples in each cell; all must lie in one.
    pub fn counts(&self, places: &[(f64, f64)]) -> Result<Vec<u64>, String> {
        let mut counts = vec![0; (self.x.len() - 1) * (self.y.len() - 1)];
        for place in places {
            counts[self.cell(*place).ok_or_else(|| format!("{place:?} lies outside"))?] += 1;
        }
        Ok(counts)
    }
}

/// (probability of less, probability of more) than `chi_square` at so many degrees of freedom.
pub fn tails(chi_square: f64, degrees: usize) -> (f64, f64) {
    let distribution = ChiSquared::new(degrees as f64).expect("there is a degree of freedom");
    (distribution.cdf(chi_square), distribution.sf(chi_square))
}

/// Counts against probabilities, of which one stands for what is counted nowhere else.
pub fn counts_check(what: &str, counts: &[u64], probabilities: &[f64]) -> Check {
    let trials: u64 = counts.iter().sum();
    let mut cells: Vec<(f64, f64)> =
        counts.iter().zip(probabilities).map(|(count, probability)| (probability * trials as f64, *count as f64)).collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut small, mut large) = ((0.0, 0.0), Vec::new());
    for (expected, count) in cells {
        if small.0 < LEAST {
            small = (small.0 + expected, small.1 + count);
        } else {
            large.push((expected, count));
        }
    }
    large.push(small);
    let chi_square: f64 = large.iter().map(|(expected, count)| (count - expected) * (count - expected) / expected).sum();
    let degrees = large.len() - 1;
    let (less, more) = tails(chi_square, degrees);
    println!("{what}: chi-square {chi_square:.1} at {degrees} degrees of freedom, p = {more:.2e}");
    let side = if more < CHANCE { "too far from" } else { "too close to" };
    require(less >= CHANCE && more >= CHANCE, || {
        format!("{what}: chi-square {chi_square:.1} at {degrees} degrees of freedom: {trials} samples lie {side} their density")
    })
}

/// The samples that `trials` gave against a density, which must integrate to `total` within a bound: the share of the
/// trials that give a sample.
pub fn density_check(
    what: &str,
    places: &[(f64, f64)],
    trials: usize,
    grid: &Grid,
    total: (f64, f64),
    density: &dyn Fn(f64, f64) -> f64,
) -> Check {
    let mut probabilities = grid.probabilities(density);
    let sum: f64 = probabilities.iter().sum();
    require((sum - total.0).abs() <= total.1, || format!("{what}: the density integrates to {sum}, not to {}", total.0))?;
    let mut counts = grid.counts(places).map_err(|outside| format!("{what}: {outside}"))?;
    if total.0 < 1.0 {
        counts.push((trials - places.len()) as u64);
        probabilities.push(1.0 - sum);
    } else if trials != places.len() {
        return Err(format!("{what}: {} samples of {trials}", places.len()));
    }
    counts_check(what, &counts, &probabilities)
}
