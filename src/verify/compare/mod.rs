//! Two pictures of one size in, how far the first is from the second, its reference, out: in numbers ([`Comparison`]), in words
//! ([`report`]) and in colours ([`false_colour`]).

pub mod deviation;
pub mod false_colour;
pub mod flip;
pub mod pair;
pub mod picture;
pub mod report;
pub mod z_scores;

use deviation::Deviation;
use flip::Flip;
use pair::Pair;
use z_scores::ZScores;

/// Everything that is measured. Fields are `None` where a number does not exist.
pub struct Comparison<'a> {
    pub pair: Pair<'a>,
    pub deviation: Deviation,
    /// None of a linear reference that is black: it has no exposure.
    pub flip: Option<Flip>,
    /// None where no errors are stated.
    pub z: Option<ZScores>,
}

impl<'a> Comparison<'a> {
    pub fn new(pair: Pair<'a>, z: Option<ZScores>) -> Comparison<'a> {
        Comparison { deviation: Deviation::of(&pair), flip: Flip::of(&pair), z, pair }
    }
}

/// Names of the channels.
pub const CHANNELS: [&str; 3] = ["red", "green", "blue"];
