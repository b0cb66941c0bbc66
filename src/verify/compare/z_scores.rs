//! Two pictures and their standard errors in, out how many standard errors lie between them, and whether that is more than chance
//! explains.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec3;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::function::erf::erfc;

use super::CHANNELS;
use super::image::{Image, Values};
use super::pair::{Pair, Value};

/// z = (a - b) / sqrt(error_a^2 + error_b^2), of every channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ZScores {
    /// Values that have one.
    pub count: usize,
    /// Pixels of which an error is unknown.
    pub unknown_pixels: usize,
    /// Values that are equal and stated without an error, as those of a black background: they have no z-score.
    pub exact_values: usize,
    /// Of the errors; none where they count as known.
    pub degrees_of_freedom: Option<f64>,
    pub mean: f64,
    /// Standard error of the mean, from tiles; none where there are fewer than two.
    pub mean_error: Option<f64>,
    /// How likely chance makes the mean deviate as much from 0, or more.
    pub mean_p: Option<f64>,
    pub standard_deviation: f64,
    /// Shares whose size exceeds 2 and 3.
    pub beyond_2: f64,
    pub beyond_3: f64,
    /// The same as chance has them.
    pub expected_beyond_2: f64,
    pub expected_beyond_3: f64,
    pub largest: LargestZ,
    pub agree: bool,
    /// The largest size by pixel; 0 where all is exact, NaN where an error is unknown.
    #[serde(skip)]
    pub map: Vec<f32>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct LargestZ {
    pub z: f64,
    pub x: u32,
    pub y: u32,
    pub channel: &'static str,
    /// How likely chance makes the largest of so many z-scores as large, or larger.
    pub p: f64,
}

/// Of a value, what its error is at least: pictures are 32-bit floats, and sums of many.
const ROUNDING: f64 = 1e-5;
/// Pictures disagree where one of two tests finds less chance than this. So one in a hundred pairs that differ by chance alone is
/// said to disagree.
const LEVEL: f64 = 0.005;
/// Tiles along each side of a picture. Photons light several pixels, so that neighbouring errors are alike; those of tiles hardly are.
const TILES: u32 = 8;

/// Whether a picture can be that of standard errors for this pair; else why not, and what to do.
pub(crate) fn check(errors: &Image, pair: &Pair) -> Result<(), String> {
    if pair.a.values == Values::Display {
        return Err(format!("is for linear pictures, and {} has display values; compare .exr pictures", pair.a.path.display()));
    }
    if errors.values == Values::Display {
        return Err("has display values; name the .exr that render `error_image` writes".into());
    }
    if (errors.width, errors.height) != (pair.a.width, pair.a.height) {
        return Err(format!("is {} and the pictures are {} pixels; name the errors of the same render", errors.size(), pair.a.size()));
    }
    if let Some(pixel) = errors.pixels.iter().position(|error| error.min_element() < 0.0) {
        let [x, y] = errors.place(pixel);
        return Err(format!("is negative at column {x}, row {y}, as no standard error is; name the .exr that render `error_image` writes"));
    }
    Ok(())
}

impl ZScores {
    /// From the errors of one picture or both; those of the other count as 0. Errors are themselves estimates: where they are the
    /// spread of a few `blocks` of rounds, z-scores follow Student's distribution, else a normal one. None where no z-score exists.
    pub(crate) fn of(pair: &Pair, errors: [Option<&Image>; 2], blocks: Option<u32>) -> Option<ZScores> {
        let degrees_of_freedom = blocks.map(|blocks| f64::from(blocks) - 1.0);
        let both_tails = |z: f64| both_tails(z, degrees_of_freedom);
        let variance = |pixel: usize| {
            let stated = errors.iter().flatten().map(|errors| errors.pixels[pixel].as_dvec3());
            stated.map(|error| error * error).sum::<DVec3>()
        };
        let (mut count, mut exact_values, mut sum, mut squares) = (0, 0, 0.0, 0.0);
        let (mut beyond_2, mut beyond_3) = (0, 0);
        let mut largest: Option<(f64, Value)> = None;
        let mut map = vec![f32::NAN; pair.is_compared.len()];
        let mut tiles = vec![(0.0, 0.0); (TILES * TILES) as usize];
        for value in pair.values() {
            let Value { pixel, channel, a, b } = value;
            let variance = variance(pixel);
            if !variance.is_finite() {
                continue;
            }
            if a == b && variance[channel] == 0.0 {
                exact_values += 1;
                map[pixel] = map[pixel].max(0.0);
                continue;
            }
            let z = (a - b) / variance[channel].sqrt().max(ROUNDING * a.abs().max(b.abs()));
            count += 1;
            sum += z;
            squares += z * z;
            beyond_2 += usize::from(z.abs() > 2.0);
            beyond_3 += usize::from(z.abs() > 3.0);
            map[pixel] = map[pixel].max(z.abs() as f32);
            if largest.is_none_or(|(most, _)| z.abs() > most.abs()) {
                largest = Some((z, value));
            }
            let [x, y] = pair.a.place(pixel);
            let tile = |place: u32, size: u32| (u64::from(place) * u64::from(TILES) / u64::from(size)) as usize;
            let tile = &mut tiles[tile(y, pair.a.height) * TILES as usize + tile(x, pair.a.width)];
            *tile = (tile.0 + z, tile.1 + 1.0);
        }
        let (z, Value { pixel, channel, .. }) = largest?;
        let [x, y] = pair.a.place(pixel);
        let share = |of: usize| of as f64 / count as f64;
        let mean = sum / count as f64;
        let means: Vec<f64> = tiles.iter().filter(|(_, count)| *count > 0.0).map(|(sum, count)| sum / count).collect();
        let tested = test_of_mean(mean, &means);
        let p = sidak(both_tails(z), count);
        let is_unknown = |pixel: &usize| pair.is_compared[*pixel] && !variance(*pixel).is_finite();
        Some(ZScores {
            count,
            unknown_pixels: (0..pair.is_compared.len()).filter(is_unknown).count(),
            exact_values,
            degrees_of_freedom,
            mean,
            mean_error: tested.map(|(error, _)| error),
            mean_p: tested.map(|(_, p)| p),
            standard_deviation: (squares / count as f64 - mean * mean).max(0.0).sqrt(),
            beyond_2: share(beyond_2),
            beyond_3: share(beyond_3),
            expected_beyond_2: both_tails(2.0),
            expected_beyond_3: both_tails(3.0),
            largest: LargestZ { z, x, y, channel: CHANNELS[channel], p },
            agree: p >= LEVEL && tested.is_none_or(|(_, p)| p >= LEVEL),
            map,
        })
    }

    /// Whether the largest z-score alone says that the pictures disagree.
    pub(crate) fn has_outlier(&self) -> bool {
        self.largest.p < LEVEL
    }
}

/// The standard error of a mean from those of its tiles (batch means), and the p-value that it is 0.
fn test_of_mean(mean: f64, tiles: &[f64]) -> Option<(f64, f64)> {
    let count = tiles.len() as f64;
    if count < 2.0 {
        return None;
    }
    let of_tiles = tiles.iter().sum::<f64>() / count;
    let variance = tiles.iter().map(|tile| (tile - of_tiles).powi(2)).sum::<f64>() / (count - 1.0);
    let error = (variance / count).sqrt();
    let p = if mean == 0.0 { 1.0 } else { both_tails(mean / error.max(f64::MIN_POSITIVE), Some(count - 1.0)) };
    Some((error, p))
}

/// How likely chance makes z as far from 0, or farther: by Student's distribution with so many degrees of freedom, or by the normal
/// one.
fn both_tails(z: f64, degrees_of_freedom: Option<f64>) -> f64 {
    match degrees_of_freedom {
        None => erfc(z.abs() * FRAC_1_SQRT_2),
        Some(freedom) => 2.0 * StudentsT::new(0.0, 1.0, freedom).expect("there are degrees of freedom").cdf(-z.abs()),
    }
}

/// The chance that one of so many independent tests has a p-value as small (Sidak 1967): 1 - (1 - p)^count, without
/// losing small ones.
fn sidak(p: f64, count: usize) -> f64 {
    -(count as f64 * (-p.min(1.0)).ln_1p()).exp_m1()
}
