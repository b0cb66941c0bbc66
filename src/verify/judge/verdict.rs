//! Whether an image agrees with the path tracer's, within the errors that both state.

use glam::DVec3;

use super::{Image, Part, Parts};

/// Squares of pixels along each side of a picture that are compared as one.
const BLOCKS: u32 = 12;
/// Standard errors beyond which a block disagrees: by chance one in 16 000 does.
const Z_LIMIT: f64 = 4.0;

/// Of f32 pictures of many operations.
const ROUNDING: f64 = 1e-5;

/// A comparison, block by block.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Verdict {
    pub blocks: usize,
    /// Blocks and channels that differ by more than four standard errors.
    pub apart: usize,
    /// Largest distance, standard errors.
    pub worst: f64,
    /// Light of the whole picture over the judge's, and its standard error.
    pub ratio: f64,
    pub ratio_error: f64,
    /// Root mean square difference of blocks over that of the judge's values.
    pub relative_difference: f64,
}

impl Verdict {
    /// Compares `means` with stated `errors` with the judge's picture; `part` of it, or all.
    ///
    /// Photons are shared by neighbouring pixels, so the error of a block's mean is taken as that of its
    /// pixels, as though they erred together: that is never too small.
    ///
    /// What neither saw, neither states an error of: an edge or a spark that a pixel's `samples` (the fewer of both)
    /// all missed may be worth one sample of what the block holds, and each number is rounded.
    pub(crate) fn new(means: &[DVec3], errors: &[DVec3], samples: u32, judged: &Image, part: Option<Part>) -> Verdict {
        let of = |parts: &Parts| part.map_or(parts.total(), |part| parts[part]);
        let (width, height) = (judged.width, judged.height);
        let side = |length: u32, block: u32| (block * length / BLOCKS)..((block + 1) * length / BLOCKS);
        let mut verdict = Verdict { blocks: 0, apart: 0, worst: 0.0, ratio: 1.0, ratio_error: 0.0, relative_difference: 0.0 };
        let (mut sum, mut expected_sum, mut sum_error, mut expected_variance) = (0.0, 0.0, 0.0, 0.0);
        let (mut differences, mut squares) = (0.0, 0.0);
        for block in 0..BLOCKS * BLOCKS {
            let (mut mean, mut error, mut expected, mut variance) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
            let (mut brightest, mut count) = (DVec3::ZERO, 0.0);
            for row in side(height, block / BLOCKS) {
                for column in side(width, block % BLOCKS) {
                    let pixel = (row * width + column) as usize;
                    let estimate = &judged.pixels[pixel];
                    mean += means[pixel];
                    error += errors[pixel];
                    expected += of(&estimate.mean);
                    let deviation = part.map_or(estimate.total_standard_error, |part| estimate.standard_error[part]);
                    variance += deviation * deviation;
                    brightest = brightest.max(means[pixel]).max(of(&estimate.mean));
                    count += 1.0;
                }
            }
            if count == 0.0 {
                continue;
            }
            verdict.blocks += 1;
            for channel in 0..3 {
                let difference = (mean[channel] - expected[channel]) / count;
                let unseen = brightest[channel] / f64::from(samples.max(1));
                let rounding = ROUNDING * expected[channel];
                let deviation = (error[channel].powi(2) + variance[channel] + count * unseen * unseen + rounding * rounding).sqrt() / count;
                if difference != 0.0 {
                    let z = difference.abs() / deviation;
                    verdict.worst = verdict.worst.max(z);
                    verdict.apart += usize::from(z > Z_LIMIT);
                }
                differences += difference * difference;
                squares += (expected[channel] / count).powi(2);
            }
            sum += mean.element_sum();
            expected_sum += expected.element_sum();
            sum_error += error.element_sum();
            expected_variance += variance.element_sum();
        }
        if expected_sum > 0.0 {
            verdict.ratio = sum / expected_sum;
            verdict.ratio_error = (sum_error * sum_error + expected_variance).sqrt() / expected_sum;
        }
        if squares > 0.0 {
            verdict.relative_difference = (differences / squares).sqrt();
        }
        verdict
    }

    pub(crate) fn agrees(&self) -> bool {
        self.apart == 0
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let verdict = if self.agrees() { "agrees with the path tracer within" } else { "DISAGREES with the path tracer beyond" };
        write!(
            f,
            "{verdict} the stated errors: {} of {} block channels differ by more than {Z_LIMIT} standard errors (largest {:.2}); total light {:.4} of the path tracer's (+- {:.4}); RMS difference of blocks {:.2} %",
            self.apart,
            3 * self.blocks,
            self.worst,
            self.ratio,
            self.ratio_error,
            100.0 * self.relative_difference
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::Estimate;
    use super::*;

    #[test]
    fn equal_pictures_agree_and_shifted_ones_do_not() {
        let direct = DVec3::new(1.0, 2.0, 3.0);
        let deviation = DVec3::splat(0.01);
        let estimate = Estimate {
            mean: Parts { direct, ..Parts::default() },
            standard_error: Parts { direct: deviation, ..Parts::default() },
            total_standard_error: deviation,
        };
        let judged = Image { width: 20, height: 16, pixels: vec![estimate; 320] };
        let errors = vec![DVec3::splat(0.01); 320];
        assert!(Verdict::new(&vec![direct; 320], &errors, 1000, &judged, None).agrees());
        let mut shifted = vec![direct; 320];
        assert!(!Verdict::new(&vec![1.1 * direct; 320], &errors, 1000, &judged, Some(Part::Direct)).agrees());
        shifted[17] = DVec3::splat(5.0);
        assert!(!Verdict::new(&shifted, &errors, 1000, &judged, None).agrees());
        // Light where the judge is certain that there is none.
        let dark = Image { pixels: vec![Estimate::default(); 320], ..judged };
        assert!(!Verdict::new(&vec![direct; 320], &vec![DVec3::ZERO; 320], 1000, &dark, None).agrees());
        assert!(Verdict::new(&vec![DVec3::ZERO; 320], &errors, 1000, &dark, None).agrees());
    }
}
