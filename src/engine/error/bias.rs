//! The bias that a density estimate's radius brings with it, by extrapolation to radius 0.
//!
//! A photon that lands within the radius r of a point counts as landed there, so the estimate is the mean of light over
//! the disc, and where light is smooth and the disc whole, that is off by c r^2 to leading order (Silverman 1986,
//! section 4.3; Hachisuka, Jarosz and Jensen 2010, equation 9). So of two radii r and r / sqrt(2) the estimates differ
//! by half the bias of the larger, and the bias is twice their difference. Both come from the same photons, as a photon
//! follows from seed, round and number alone: what is noise in one is mostly noise in the other.
//!
//! Several independent groups of rounds show how large the difference D is without its noise: the mean of D_g * D_h over pairs of
//! different groups has the mean |E D|^2, where |mean of D|^2 would have the noise on top. Its interval is a jackknife's
//! over groups with Student's quantile. Of a scene the groups are the blocks of the run itself ([`super::differences`]); where these
//! do not show it, they are batches of rounds of their own ([`super::bias_batches`]).

use std::f64::consts::FRAC_1_SQRT_2;

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Relative to a result's light, as its measure of errors adds it up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bias {
    pub relative: f64,
    pub lower: f64,
    pub upper: f64,
    /// Chance that it lies between the two.
    pub confidence: f64,
    pub from: BiasFrom,
}

/// Where a bias comes from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BiasFrom {
    /// No light comes from a photon map.
    NoMap,
    /// Nothing does, because of [`Bias::UNKNOWN`].
    Nothing,
    /// So many blocks of the run.
    Blocks(u32),
    /// Batches, each of so many rounds at each of the two radii, which took so many seconds.
    Batches { batches: u32, rounds: u32, seconds: f64 },
}

/// How far the law c r^2 may be off, either way: the true bias over what is extrapolated.
///
/// Of light without noise (`tests/engine/bias.rs`) it is 1.00 where light is a parabola, 1.12 along the edge of a lit surface,
/// 1.05, 1.2 and 1.6 on bumps of a deviation of r, r/2 and r/4, and 1.82 along the edge of a shadow. Of scenes it was 1.2 to
/// 1.5 at radii of 0.15 of the scene, and 2.0 of a caustic narrower than that. Whatever is much narrower than r at both radii is not seen
/// at all.
const ALLOWANCE: (f64, f64) = (0.9, 2.1);

/// The smaller radius over the larger one, and how many times their difference the bias of the larger one is.
pub(crate) const SMALLER: f64 = FRAC_1_SQRT_2;
const TIMES: f64 = 2.0;

impl Bias {
    /// Of a result that no radius has a part in.
    pub fn none(confidence: f64) -> Bias {
        Bias { relative: 0.0, lower: 0.0, upper: 0.0, confidence, from: BiasFrom::NoMap }
    }

    /// Of radii that are as small as they may be, and still wider than what many points lie in: a wider one shows nothing.
    pub fn unknown(confidence: f64) -> Bias {
        Bias { relative: f64::INFINITY, upper: f64::INFINITY, from: BiasFrom::Nothing, ..Bias::none(confidence) }
    }

    /// From the lower end, the estimate and the upper end of the difference of two radii.
    pub fn extrapolated([lower, difference, upper]: [f64; 3], confidence: f64, from: BiasFrom) -> Bias {
        let [lower, upper] = [TIMES * ALLOWANCE.0 * lower, TIMES * ALLOWANCE.1 * upper];
        Bias { relative: TIMES * difference, lower, upper, confidence, from }
    }

    /// Why a bias may be unknown.
    pub const UNKNOWN: &str =
        "the search radius exceeds the distance from many points to the next wall, and the scene is too wide for a smaller one";

    pub fn is_known(&self) -> bool {
        self.upper.is_finite()
    }

    /// How well its square is known.
    pub fn uncertainty(&self) -> f64 {
        ((self.upper / ALLOWANCE.1).powi(2) - self.relative.powi(2)).max(0.0)
    }

    /// The bias and its upper end, as they may be expected of more rounds, whose radii have a mean square `shrunk` times and a variance of
    /// the light `quieter` times what they are now. The interval's square narrows as that variance while the bias does not stand out of
    /// the noise, and then as noise times bias.
    pub fn expected(&self, shrunk: f64, quieter: f64) -> [f64; 2] {
        let narrows = if self.lower > 0.0 { shrunk * quieter.sqrt() } else { quieter };
        let found = self.relative * shrunk;
        [found, ALLOWANCE.1 * (found * found + self.uncertainty() * narrows).sqrt()]
    }

    /// Of radii whose mean square is so many times that of the one it was measured at.
    pub fn scaled(self, mean_squared_radius: f64) -> Bias {
        let Bias { relative, lower, upper, .. } = self;
        let [relative, lower, upper] = [relative, lower, upper].map(|bias| bias * mean_squared_radius);
        Bias { relative, lower, upper, ..self }
    }
}

/// Vectors of independent groups of rounds, each with how many equal parts it is the sum of: by these, and by scalar products.
pub(crate) struct Groups {
    parts: Vec<f64>,
    products: Vec<Vec<f64>>,
}

impl Groups {
    /// Fewer give no spread.
    const LEAST: usize = 4;

    pub(crate) fn of<T: Copy + Into<f64>>(groups: &[(f64, Vec<T>)]) -> Groups {
        let product = |one: &[T], two: &[T]| one.iter().zip(two).map(|(a, b)| (*a).into() * (*b).into()).sum();
        Groups {
            parts: groups.iter().map(|(parts, _)| *parts).collect(),
            products: groups.iter().map(|(_, one)| groups.iter().map(|(_, two)| product(one, two)).collect()).collect(),
        }
    }

    /// The length of the mean of a part without its noise: lower end, estimate and upper end. Of few groups the upper end is the length
    /// with its noise; of a single one that is all there is, and of none it is unknown.
    pub(crate) fn mean_size(&self, confidence: f64) -> [f64; 3] {
        let root = |square: f64| square.max(0.0).sqrt();
        let groups = self.parts.len();
        if groups < Groups::LEAST {
            let parts: f64 = self.parts.iter().sum();
            let most = if groups == 0 { f64::INFINITY } else { root(self.products.iter().flatten().sum()) / parts };
            return [0.0, if groups < 2 { most } else { root(self.square(None)) }, most];
        }
        let without: Vec<f64> = (0..groups).map(|number| self.square(Some(number))).collect();
        let mean = without.iter().sum::<f64>() / groups as f64;
        let spread: f64 = without.iter().map(|square| (square - mean).powi(2)).sum();
        let standard_error = ((groups - 1) as f64 / groups as f64 * spread).sqrt();
        let student = StudentsT::new(0.0, 1.0, (groups - 1) as f64).expect("there are several groups");
        let half_width = student.inverse_cdf(0.5 + 0.5 * confidence) * standard_error;
        let square = self.square(None);
        [square - half_width, square, square + half_width].map(root)
    }

    /// The square of that length from pairs of different groups, of all but one.
    fn square(&self, left_out: Option<usize>) -> f64 {
        let kept: Vec<usize> = (0..self.parts.len()).filter(|number| Some(*number) != left_out).collect();
        let pairs = || kept.iter().flat_map(|&one| kept.iter().filter(move |&&two| two != one).map(move |&two| (one, two)));
        let parts: f64 = pairs().map(|(one, two)| self.parts[one] * self.parts[two]).sum();
        pairs().map(|(one, two)| self.products[one][two]).sum::<f64>() / parts
    }
}
