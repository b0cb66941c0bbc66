//! The bias of a radius from batches of rounds of their own, at two radii and with the same photons: what is noise in one is mostly
//! noise in the other.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::bias::{Bias, BiasFrom, Groups, SMALLER};
use crate::engine::error::measure::ErrorMeasure;
use crate::engine::run::watch::{Control, End};
use crate::error::Result;
use crate::settings::stop::{Measure, Stop};

pub(crate) const BATCHES: u32 = 8;

/// Batches of a run's own kind, with photons of their own.
pub(crate) struct Batches<'a> {
    /// Of the run.
    pub seed: u64,
    pub measure: Measure,
    pub confidence: f64,
    /// Of each batch.
    pub rounds: u32,
    pub cancelled: &'a AtomicBool,
}

/// What a batch differs in from the run.
pub(crate) struct Batch {
    /// Of the radius, which stays.
    pub factor: f64,
    pub rounds: u32,
    pub seed: u64,
    /// Its rounds alone end it.
    pub stop: Stop,
}

impl Batches<'_> {
    /// The bias at the run's radius; `None` if it was cancelled. `run` gives the values of a batch's result.
    pub(crate) fn measure(&self, mut run: impl FnMut(&Batch, &mut Control) -> Result<(End, Vec<f64>)>) -> Result<Option<Bias>> {
        extrapolate(self.measure, self.confidence, self.rounds, |factor, number| self.values(factor, number, &mut run))
    }

    /// The values of a batch; `None` if it was cancelled.
    pub(crate) fn values(
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
pub(crate) fn extrapolate(
    measure: Measure,
    confidence: f64,
    rounds_per_batch: u32,
    batch: impl FnMut(f64, u32) -> Result<Option<Vec<f64>>>,
) -> Result<Option<Bias>> {
    let began = Instant::now();
    let Some(difference) = difference(measure, confidence, SMALLER, batch)? else { return Ok(None) };
    let from = BiasFrom::Batches { batches: BATCHES, rounds: rounds_per_batch, seconds: began.elapsed().as_secs_f64() };
    Ok(Some(Bias::extrapolated(difference, confidence, from)))
}

/// How far the result at a smaller radius is from that at the whole one, relative to the latter: the lower end of the
/// interval, the estimate, the upper end.
pub(crate) fn difference(
    measure: Measure,
    confidence: f64,
    factor: f64,
    mut batch: impl FnMut(f64, u32) -> Result<Option<Vec<f64>>>,
) -> Result<Option<[f64; 3]>> {
    let (mut wholes, mut differences) = (Vec::new(), Vec::new());
    for number in 0..BATCHES {
        let (Some(whole), Some(smaller)) = (batch(1.0, number)?, batch(factor, number)?) else { return Ok(None) };
        // All batches are kept until the end, in half the room.
        differences.push((1.0, whole.iter().zip(&smaller).map(|(whole, smaller)| (whole - smaller) as f32).collect::<Vec<f32>>()));
        wholes.push(whole.iter().map(|value| *value as f32).collect::<Vec<f32>>());
    }
    let means: Vec<f64> = (0..wholes[0].len())
        .map(|value| wholes.iter().map(|whole: &Vec<f32>| f64::from(whole[value])).sum::<f64>() / wholes.len() as f64)
        .collect();
    let positive = means.iter().filter(|mean| **mean > 0.0).count();
    if positive == 0 {
        return Ok(Some([0.0; 3]));
    }
    let measure = ErrorMeasure::new(measure, positive as f64, means.iter().sum());
    for (_, values) in &mut differences {
        values.iter_mut().zip(&means).for_each(|(value, mean)| *value = measure.relative(f64::from(*value), *mean) as f32);
    }
    Ok(Some(Groups::of(&differences).mean_size(confidence)))
}

/// Seed of a batch: 32 bits, which is what every generator takes, and far from the run's own.
pub(crate) fn seed(run: u64, batch: u32) -> u64 {
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
        let bias = extrapolate(Measure::Rmse, 0.95, 1, |factor, number| Ok(Some(batch(factor, number)))).unwrap().unwrap();
        let truth = 0.1 / 1.1;
        assert!((bias.relative / truth - 1.0).abs() < 0.05, "{bias:?}");
        assert!(bias.lower < truth && truth < bias.upper, "{bias:?}");
        // What a single batch would say.
        let (whole, smaller) = (batch(1.0, 0), batch(SMALLER, 0));
        let naive = 2.0 * (whole.iter().zip(&smaller).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 4096.0).sqrt() / 1.1;
        assert!(naive > 1.1 * truth, "{naive}");
        assert_eq!(extrapolate(Measure::Rmse, 0.95, 1, |_, _| Ok(None)).unwrap(), None);
        assert_eq!(extrapolate(Measure::Rmse, 0.95, 1, |_, _| Ok(Some(vec![0.0; 8]))).unwrap().unwrap().upper, 0.0);
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
