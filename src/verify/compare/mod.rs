//! Two pictures of one size in, how far the first is from the second, its reference, out: in numbers ([`Comparison`]), in words
//! ([`report`]) and in colours ([`false_colour`]).

pub(crate) mod deviation;
pub(crate) mod false_colour;
pub(crate) mod flip;
pub(crate) mod image;
pub(crate) mod pair;
pub(crate) mod report;
pub(crate) mod z_scores;

use deviation::Deviation;
use flip::Flip;
use pair::Pair;
use z_scores::ZScores;

/// Everything that is measured. Fields are `None` where a number does not exist.
pub(crate) struct Comparison<'a> {
    pub pair: Pair<'a>,
    pub deviation: Deviation,
    /// None of a linear reference that is black: it has no exposure.
    pub flip: Option<Flip>,
    /// None where no errors are stated.
    pub z: Option<ZScores>,
}

impl<'a> Comparison<'a> {
    pub(crate) fn new(pair: Pair<'a>, z: Option<ZScores>) -> Comparison<'a> {
        Comparison { deviation: Deviation::of(&pair), flip: Flip::of(&pair), z, pair }
    }
}

/// Names of the channels.
pub(crate) const CHANNELS: [&str; 3] = ["red", "green", "blue"];
