//! A comparison in, a picture of it in false colours out.

use flip_rs::MAGMA;
use glam::Vec3;

use super::Comparison;
use crate::output::colour;

/// What colours stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Show {
    #[default]
    Difference,
    Z,
    Flip,
}

/// Differences that have the first colour and the last one, of the reference's mean; between them the scale is logarithmic.
const DIFFERENCES: [f64; 2] = [1e-3, 1.0];
/// The z-score that has the last colour.
const MOST_Z: f64 = 5.0;
/// The colour of pixels that are not compared: a grey, which the map has not.
const NONE: [u8; 3] = [128; 3];

impl Show {
    /// What the first and the last colour mean.
    pub(crate) fn scale(self) -> String {
        match self {
            Show::Difference => {
                let [least, most] = DIFFERENCES.map(|share| 100.0 * share);
                format!("the difference from {least} % (black) to {most} % (pale yellow) of the reference's mean, logarithmic")
            }
            Show::Z => format!("the z-score's size from 0 (black) to {MOST_Z} (pale yellow)"),
            Show::Flip => "FLIP from 0 (black) to 1 (pale yellow)".to_owned(),
        }
    }
}

impl Comparison<'_> {
    /// Of each pixel the channel that is furthest apart, as a PNG; none where the numbers do not exist.
    pub(crate) fn false_colour(&self, show: Show) -> Option<Vec<u8>> {
        let pixels = 0..self.pair.is_compared.len();
        let shares: Vec<f64> = match show {
            Show::Difference => {
                let [least, most] = DIFFERENCES.map(f64::ln);
                let mean = self.deviation.relative.map(|_| self.deviation.mean_b)?;
                let share = |pixel: usize| {
                    let difference: Vec3 = self.pair.a.pixels[pixel] - self.pair.b.pixels[pixel];
                    ((f64::from(difference.abs().max_element()) / mean).ln() - least) / (most - least)
                };
                pixels.map(share).collect()
            }
            Show::Z => self.z.as_ref()?.map.iter().map(|z| f64::from(*z) / MOST_Z).collect(),
            Show::Flip => self.flip.as_ref()?.map.iter().map(|flip| f64::from(*flip)).collect(),
        };
        // Magma: equal steps look equally large (van der Walt and Smith 2015).
        let of = |(share, is_compared): (f64, &bool)| {
            if !is_compared || share.is_nan() {
                return NONE;
            }
            MAGMA[(255.0 * share.clamp(0.0, 1.0)).round() as usize].map(|channel| (255.0 * channel).round() as u8)
        };
        let codes: Vec<[u8; 3]> = shares.into_iter().zip(&self.pair.is_compared).map(of).collect();
        Some(colour::png_of_codes(self.pair.a.width, self.pair.a.height, &codes))
    }
}
