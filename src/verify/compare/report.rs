//! A comparison in, a report of it out: as text for people, and as JSON.

use std::path::Path;

use serde::Serialize;

use super::Comparison;
use super::deviation::{Deviation, Largest};
use super::flip::Flip;
use super::image::{Image, Values};
use super::pair::LeftOut;
use super::z_scores::ZScores;
use crate::text::{counted, echo, percent};

/// The fields of the JSON.
#[derive(Serialize)]
struct Report<'a> {
    a: &'a Path,
    b: &'a Path,
    width: u32,
    height: u32,
    values: Values,
    left_out: LeftOut,
    #[serde(flatten)]
    deviation: &'a Deviation,
    flip: Option<&'a Flip>,
    z: Option<&'a ZScores>,
    warnings: Vec<String>,
}

impl Comparison<'_> {
    pub(crate) fn json(&self) -> Vec<u8> {
        let (a, b) = (self.pair.a, self.pair.b);
        let report = Report {
            a: &a.path,
            b: &b.path,
            width: a.width,
            height: a.height,
            values: a.values,
            left_out: self.pair.left_out,
            deviation: &self.deviation,
            flip: self.flip.as_ref(),
            z: self.z.as_ref(),
            warnings: self.warnings(),
        };
        let mut text = serde_json::to_vec_pretty(&report).expect("a report is plain data");
        text.push(b'\n');
        text
    }

    /// What of the files is not compared, or not as it is.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let of = |picture: &Image| {
            let path = echo(picture.path.display());
            picture.warnings.iter().map(move |warning| format!("{path}: {warning}")).collect::<Vec<_>>()
        };
        [of(self.pair.a), of(self.pair.b)].concat()
    }

    pub(crate) fn text(&self) -> String {
        let (a, b) = (self.pair.a, self.pair.b);
        let values = match a.values {
            Values::Linear => "linear values",
            Values::Display => "display values (sRGB, 0 to 1)",
        };
        let (named_a, named_b) = (echo(a.path.display()), echo(b.path.display()));
        let mut lines = vec![format!("{named_a} against the reference {named_b}: {} pixels of {values}", a.size())];
        let LeftOut { a: of_a, b: of_b, pixels } = self.pair.left_out;
        if pixels > 0 {
            let pixels = counted(pixels, "pixel");
            lines.push(format!("left out: {pixels} with NaN or infinite values ({of_a} in {named_a}, {of_b} in {named_b})"));
        }
        lines.extend(self.deviation.lines());
        lines.push(match &self.flip {
            None => "FLIP: none, as the reference is black".to_owned(),
            Some(flip) => flip.line(),
        });
        lines.extend(self.z.iter().flat_map(ZScores::lines));
        lines.join("\n")
    }
}

impl Deviation {
    /// The RMSE and what it is relative to.
    pub(crate) fn relative_rmse(&self) -> String {
        match self.relative {
            Some(relative) => format!("{} of the reference's mean", percent(relative.rmse)),
            None => format!("{}, and the reference's mean is not above 0", number(self.rmse)),
        }
    }

    fn lines(&self) -> Vec<String> {
        let Deviation { mean_a, mean_b, rmse, relative, largest } = self;
        let means = format!("means {} and {}", number(*mean_a), number(*mean_b));
        let mut lines = match relative {
            Some(relative) => vec![
                format!("RMSE: {}, {}", number(*rmse), self.relative_rmse()),
                format!(
                    "relMSE: {}, the mean of (A - B)^2 / (B^2 + e), where e = (1 % of the reference's mean)^2 = {}",
                    number(relative.relmse),
                    number(relative.epsilon)
                ),
                format!("bias: {:+.3} % of the reference's mean ({means})", 100.0 * relative.bias),
            ],
            None => vec![format!("RMSE: {} ({means}), so that nothing is relative to it", self.relative_rmse())],
        };
        let Largest { deviation, x, y, channel, a, b } = largest;
        let (a, b) = (number(*a), number(*b));
        lines.push(match deviation {
            0.0 => "largest deviation: none, all values are equal".to_owned(),
            _ => format!("largest deviation: {} at column {x}, row {y}, {channel}: {a} instead of {b}", number(*deviation)),
        });
        lines
    }
}

impl Flip {
    fn line(&self) -> String {
        let mean = number(self.mean);
        match self.exposures[..] {
            [first, .., last] => {
                let count = self.exposures.len();
                format!("FLIP: {mean} on average, from 0 to 1; HDR-FLIP of {count} exposures in 8 bits, {first:+.2} to {last:+.2} stops")
            }
            _ => format!("FLIP: {mean} on average, from 0 to 1"),
        }
    }
}

impl ZScores {
    fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if self.unknown_pixels > 0 {
            lines.push(format!("without z-score: {} of unknown (infinite) error", counted(self.unknown_pixels, "pixel")));
        }
        if self.exact_values > 0 {
            let of = counted(self.exact_values, "value");
            lines.push(format!("without z-score: {of} of channels that are equal and stated without error"));
        }
        let mean_error = self.mean_error.map_or_else(String::new, |error| format!(" +- {error:.3}"));
        let [usual_2, usual_3] = [self.expected_beyond_2, self.expected_beyond_3].map(percent);
        lines.push(format!(
            "z-scores: mean {:+.3}{mean_error}, standard deviation {:.3}, {} beyond 2 and {} beyond 3 (by chance {usual_2} and {usual_3})",
            self.mean,
            self.standard_deviation,
            percent(self.beyond_2),
            percent(self.beyond_3)
        ));
        let largest = self.largest;
        lines.push(format!(
            "largest z-score: {:+.2} at column {}, row {}, {}; p = {} for the largest of {} (Sidak)",
            largest.z,
            largest.x,
            largest.y,
            largest.channel,
            number(largest.p),
            self.count
        ));
        lines.push(format!("verdict: {}", self.verdict()));
        lines
    }

    fn verdict(&self) -> String {
        if self.agree {
            return "the pictures agree within their errors".to_owned();
        }
        let reason = match self.mean_p.filter(|_| !self.has_outlier()) {
            Some(p) => format!("the mean z-score is farther from 0 than by chance (p = {})", number(p)),
            None if self.degrees_of_freedom.is_some() => "the largest z-score is larger than by chance".to_owned(),
            None => {
                "the largest z-score is larger than by chance, unless the errors are of few blocks (then add --error-blocks)".to_owned()
            }
        };
        format!("the pictures DISAGREE beyond their errors: {reason}")
    }
}

/// Four significant digits.
fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let decimals = (3 - size.log10().floor() as i32).max(0);
    format!("{value:.*}", decimals as usize)
}
