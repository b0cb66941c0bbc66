//! The bias that a density estimate's radius brings with it, by extrapolation to radius 0.
//!
//! A photon that lands within the radius r of a point counts as landed there, so the estimate is the mean of light over
//! the disc, and where light is smooth and the disc whole, that is off by c r^2 to leading order (Silverman 1986,
//! section 4.3; Hachisuka, Jarosz and Jensen 2010, equation 9). So of two radii r and r / sqrt(2) the estimates differ
//! by half the bias of the larger, and the bias is twice their difference. Both come from the same photons, as a photon
//! follows from seed, round and number alone: what is noise in one is mostly noise in the other.
//!
//! Several independent batches tell how large the difference D is without its noise: the mean of D_g * D_h over pairs of
//! different batches has the mean |E D|^2, where |mean of D|^2 would have the noise on top. Its interval is a jackknife's
//! over batches with Student's quantile.

use std::f64::consts::FRAC_1_SQRT_2;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::watch::{Control, End};
use crate::error::Result;
use crate::settings::stop::Stop;

/// Root mean square over a result's pixels and channels where there is light, over their mean: as errors by `Measure::Rmse`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bias {
    pub relative: f64,
    pub lower: f64,
    pub upper: f64,
    /// Chance that it lies between the two.
    pub confidence: f64,
    pub batches: u32,
    /// Rounds of a batch, at each of the two radii.
    pub rounds_per_batch: u32,
    /// Wall time that it took.
    pub seconds: f64,
}

pub const BATCHES: u32 = 8;

/// How far the law c r^2 may be off, either way: the true bias over what is extrapolated.
///
/// Of light without noise (`tests/bias.rs`) it is 1.00 where light is a parabola, 1.12 along the edge of a lit surface,
/// 1.05, 1.2 and 1.6 on bumps of a deviation of r, r/2 and r/4, and 1.82 along the edge of a shadow. Of scenes it was 1.0 to
/// 1.3, and 1.8 of a caustic that is narrower than its radius. Whatever is much narrower than r at both radii is not seen at all.
const ALLOWANCE: (f64, f64) = (0.9, 1.9);

impl Bias {
    /// Of a result that no radius has a part in.
    pub fn none(confidence: f64) -> Bias {
        Bias { relative: 0.0, lower: 0.0, upper: 0.0, confidence, batches: 0, rounds_per_batch: 0, seconds: 0.0 }
    }

    /// Of radii that are as small as they may be, and still wider than what many points lie in: a wider one tells nothing.
    pub fn unknown(confidence: f64) -> Bias {
        Bias { relative: f64::INFINITY, upper: f64::INFINITY, ..Bias::none(confidence) }
    }

    /// Why a bias may be unknown.
    pub const UNKNOWN: &str =
        "the search radius exceeds the distance from many points to the next wall, and the scene is too wide for a smaller one";

    pub fn is_known(&self) -> bool {
        self.upper.is_finite()
    }

    /// Of radii whose mean square is so many times that of the one it was measured at.
    pub fn scaled(self, mean_squared_radius: f64) -> Bias {
        let Bias { relative, lower, upper, .. } = self;
        let [relative, lower, upper] = [relative, lower, upper].map(|bias| bias * mean_squared_radius);
        Bias { relative, lower, upper, ..self }
    }
}

/// Batches of a run's own kind, with photons of their own.
pub struct Batches<'a> {
    /// Of the run.
    pub seed: u64,
    pub confidence: f64,
    /// Of each batch.
    pub rounds: u32,
    pub cancelled: &'a AtomicBool,
}

/// What a batch differs in from the run.
pub struct Batch {
    /// Of the radius, which stays.
    pub factor: f64,
    pub rounds: u32,
    pub seed: u64,
    /// Its rounds alone end it.
    pub stop: Stop,
}

impl Batches<'_> {
    /// The bias at the run's radius; `None` if it was cancelled. `run` gives the values of a batch's result.
    pub fn measure(&self, mut run: impl FnMut(&Batch, &mut Control) -> Result<(End, Vec<f64>)>) -> Result<Option<Bias>> {
        extrapolate(self.confidence, self.rounds, |factor, number| self.values(factor, number, &mut run))
    }

    /// The values of a batch; `None` if it was cancelled.
    pub fn values(
        &self,
        factor: f64,
        number: u32,
        run: impl FnOnce(&Batch, &mut Control) -> Result<(End, Vec<f64>)>,
    ) -> Result<Option<Vec<f64>>> {
        let stop = Stop { confidence: self.confidence, ..Stop::default() };
        let batch = Batch { factor, rounds: self.rounds, seed: seed(self.seed, number), stop };
        let (end, values) = run(&batch, &mut Control::quiet(self.cancelled))?;
        Ok((end != End::Cancelled).then_some(values))
    }
}

/// The bias at a radius. `batch` gives the result's values of a batch at the radius times a factor, the same photons for
/// the same batch; `None` ends it without an answer.
pub fn extrapolate(
    confidence: f64,
    rounds_per_batch: u32,
    batch: impl FnMut(f64, u32) -> Result<Option<Vec<f64>>>,
) -> Result<Option<Bias>> {
    let began = Instant::now();
    let Some(difference) = difference(confidence, FRAC_1_SQRT_2, batch)? else { return Ok(None) };
    let [lower, relative, upper] = difference.map(|relative| 2.0 * relative);
    Ok(Some(Bias {
        relative,
        lower: ALLOWANCE.0 * lower,
        upper: ALLOWANCE.1 * upper,
        confidence,
        batches: BATCHES,
        rounds_per_batch,
        seconds: began.elapsed().as_secs_f64(),
    }))
}

/// How far the result at a smaller radius is from that at the whole one, relative to the latter: the lower end of the
/// interval, the estimate, the upper end.
pub fn difference(confidence: f64, factor: f64, mut batch: impl FnMut(f64, u32) -> Result<Option<Vec<f64>>>) -> Result<Option<[f64; 3]>> {
    let (mut wholes, mut differences) = (Vec::new(), Vec::new());
    for number in 0..BATCHES {
        let (Some(whole), Some(smaller)) = (batch(1.0, number)?, batch(factor, number)?) else { return Ok(None) };
        // All batches are kept until the end, in half the room.
        differences.push(whole.iter().zip(&smaller).map(|(whole, smaller)| (whole - smaller) as f32).collect::<Vec<f32>>());
        wholes.push(whole.iter().map(|value| *value as f32).collect::<Vec<f32>>());
    }
    let light = squared_light(&wholes);
    let differences = products(&differences);
    let share = |left_out: Option<usize>| if light > 0.0 { off_diagonal_mean(&differences, left_out) / light } else { 0.0 };
    let batches = wholes.len();
    let without: Vec<f64> = (0..batches).map(|number| share(Some(number))).collect();
    let mean = without.iter().sum::<f64>() / batches as f64;
    let spread: f64 = without.iter().map(|share| (share - mean).powi(2)).sum();
    let standard_error = ((batches - 1) as f64 / batches as f64 * spread).sqrt();
    let student = StudentsT::new(0.0, 1.0, (batches - 1) as f64).expect("there are several batches");
    let half_width = student.inverse_cdf(0.5 + 0.5 * confidence) * standard_error;
    let squared = share(None);
    Ok(Some([squared - half_width, squared, squared + half_width].map(|squared| squared.max(0.0).sqrt())))
}

/// The square of the mean of all values that are lit in any batch, times their number.
fn squared_light(wholes: &[Vec<f32>]) -> f64 {
    let sums = |value: usize| wholes.iter().map(|whole| f64::from(whole[value])).sum::<f64>();
    let lit: Vec<f64> = (0..wholes[0].len()).map(sums).filter(|sum| *sum > 0.0).collect();
    (lit.iter().sum::<f64>() / wholes.len() as f64).powi(2) / (lit.len() as f64).max(1.0)
}

/// Scalar products of all pairs.
fn products(images: &[Vec<f32>]) -> Vec<Vec<f64>> {
    let product = |one: &[f32], two: &[f32]| one.iter().zip(two).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
    images.iter().map(|one| images.iter().map(|two| product(one, two)).collect()).collect()
}

/// Mean over pairs of different batches, of all but one.
fn off_diagonal_mean(products: &[Vec<f64>], left_out: Option<usize>) -> f64 {
    let kept: Vec<usize> = (0..products.len()).filter(|number| Some(*number) != left_out).collect();
    let pairs = kept.iter().flat_map(|&one| kept.iter().filter(move |&&two| two != one).map(move |&two| products[one][two]));
    pairs.sum::<f64>() / (kept.len() * (kept.len() - 1)) as f64
}

/// Seed of a batch: 32 bits, which is what every generator takes, and far from the run's own.
pub fn seed(run: u64, batch: u32) -> u64 {
    // The output function of SplitMix64 (Steele, Lea and Flood 2014).
    let mut z = run.wrapping_add(u64::from(batch + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) >> 32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixels of value 1 whose bias is 0.1 r^2, with noise that both radii share in part.
    fn batch(factor: f64, number: u32) -> Vec<f64> {
        let noise = |pixel: u64, which: u64| seed(pixel + (which << 40), number) as f64 / 2f64.powi(32) - 0.5;
        (0..4096).map(|pixel| 1.0 + 0.1 * factor * factor + noise(pixel, 0) + 0.5 * factor * noise(pixel, 1)).collect()
    }

    #[test]
    fn noise_is_not_taken_for_bias() {
        let bias = extrapolate(0.95, 1, |factor, number| Ok(Some(batch(factor, number)))).unwrap().unwrap();
        let truth = 0.1 / 1.1;
        assert!((bias.relative / truth - 1.0).abs() < 0.05, "{bias:?}");
        assert!(bias.lower < truth && truth < bias.upper, "{bias:?}");
        // What a single batch would say.
        let (whole, smaller) = (batch(1.0, 0), batch(FRAC_1_SQRT_2, 0));
        let naive = 2.0 * (whole.iter().zip(&smaller).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 4096.0).sqrt() / 1.1;
        assert!(naive > 1.1 * truth, "{naive}");
        assert_eq!(extrapolate(0.95, 1, |_, _| Ok(None)).unwrap(), None);
        assert_eq!(extrapolate(0.95, 1, |_, _| Ok(Some(vec![0.0; 8]))).unwrap().unwrap().upper, 0.0);
    }

    #[test]
    fn seeds_of_batches_differ() {
        let mut seeds: Vec<u64> = (1..1000).flat_map(|run| (0..BATCHES).map(move |batch| seed(run, batch))).collect();
        assert!(seeds.iter().all(|seed| *seed <= u64::from(u32::MAX)));
        seeds.sort_unstable();
        seeds.dedup();
        assert!(seeds.len() > 7985, "{}", seeds.len());
    }
}
