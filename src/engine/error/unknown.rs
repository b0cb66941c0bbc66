//! Points of a result that asked for light and that nothing has reached: how bright they may be all the same.
//!
//! No hit in many tries is no proof of darkness, and its spread of 0 no error. If a run's photons, or shadow rays, are
//! expected to hit a point m times, they all miss with probability exp(-m). So m is at most -ln(1 - c) with confidence c
//! (3.0 at 95 %: the rule of three), and the light of the point at most that times what one hit adds. Points that ask
//! nothing, as a background without an environment, are known to be 0.

use serde::Serialize;

use crate::constants::DIM_PHOTONS;
use crate::text::counted;

/// Hits that a run may expect at most, with this confidence, where it had none.
pub(crate) fn most_hits(confidence: f64) -> f64 {
    -(1.0 - confidence).ln()
}

/// What nothing has reached, of pixels, texels or probes.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(crate) struct Unknown {
    /// Points that asked for light.
    pub asked: u64,
    /// Those that nothing has reached: their error is not known, but an upper bound of their light is.
    pub unreached: u64,
    /// The largest of these bounds, in the result's unit.
    pub upper_bound: f64,
    /// All bounds, added up as errors are; infinite, null in JSON, where the result is 0.
    pub relative: f64,
    /// What reached no point at all, though some asked for it; its bounds count in `relative` too.
    pub absent: Vec<&'static str>,
    /// Lights that neither the trial nor any ray of the run has seen from some points. Mostly walls hide them altogether, as lamps of
    /// another room; where they are seen through a gap, all rays may have missed it.
    pub hidden: Uncounted,
    /// Points that some light has reached, and a kind of light that arrived at others (by shadow rays, caustics, indirect light) has not.
    pub unseen: Uncounted,
    /// Points that only photons of a small part of the brightest's flux have met. Mostly no others get there; where they do so too
    /// rarely for this run, their light is missing.
    pub dim: Uncounted,
    /// Points that lie on no surface, where light that only photons bring is missing.
    pub off_surfaces: OffSurfaces,
}

/// Points whose error is unknown, as they lie on no surface.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct OffSurfaces {
    pub points: u64,
    /// All points there are.
    pub of: u64,
    /// The numbers of the first of them, from 1.
    pub first: Vec<u64>,
    /// What they lack.
    pub lost: &'static str,
}

impl OffSurfaces {
    /// So many of them are named.
    pub(crate) const NAMED: usize = 8;

    /// Whether no error is known of any point.
    pub(crate) fn is_all(&self) -> bool {
        self.points > 0 && self.points == self.of
    }

    fn text(&self, point: &str) -> String {
        let numbers: Vec<String> = self.first.iter().map(u64::to_string).collect();
        let others = if self.points > self.first.len() as u64 { " and others" } else { "" };
        format!(
            "unknown: {} of {} ({}{others}) lie on no surface, where {} cannot be found, so their error is unknown and no bound includes them; leave out `map` and `without` alpha or layers, or put them on a surface\n",
            self.points,
            counted(self.of, point),
            numbers.join(", "),
            self.lost
        )
    }
}

/// Light that may be missing at some points, or not exist. No error counts it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Uncounted {
    pub points: u64,
    /// The most light that it may add to one of these, in the result's unit.
    pub upper_bound: f64,
    /// The most that it may add to all of these together, over all light of the result.
    pub of_mean: f64,
}

/// Of the result's light, what is worth a line where no error counts it.
const WORTH_A_LINE: f64 = 0.01;

impl Unknown {
    pub(crate) fn with_relative(self, relative: f64) -> Unknown {
        Unknown { relative, ..self }
    }

    pub(crate) fn add_unreached(&mut self, upper_bound: f64) {
        self.unreached += 1;
        self.upper_bound = self.upper_bound.max(upper_bound);
    }

    /// A line each for points and kinds of light; `unit` is the result's.
    pub(crate) fn text(&self, point: &str, unit: &str, confidence: f64, rounds: u32) -> String {
        let Unknown { asked, unreached, upper_bound, relative, absent, hidden, unseen, dim, off_surfaces } = self;
        let sure = 100.0 * confidence;
        let mut text = String::new();
        if *unreached > 0 {
            let share = if rounds < 2 {
                String::new()
            } else if relative.is_finite() {
                format!(" The noise bound includes {:.2} % for them.", 100.0 * relative)
            } else {
                " The result is black so far, so its relative error is unknown.".to_owned()
            };
            text.push_str(&format!(
                "unknown: no light has reached {unreached} of {} where some may arrive. Each of them has at most {upper_bound:.3e} {unit} ({sure} % confidence).{share}\n",
                counted(asked, point)
            ));
        }
        if hidden.of_mean > WORTH_A_LINE {
            let Uncounted { points, upper_bound, .. } = hidden;
            text.push_str(&format!(
                "hidden: from {} no shadow ray has met some lamp or some part of the sky. Walls may hide it. If all rays missed a gap, it adds at most {upper_bound:.3e} {unit} to one of them ({sure} % confidence). The noise bound does not include this.\n",
                counted(points, point)
            ));
        }
        if unseen.of_mean > WORTH_A_LINE {
            let Uncounted { points, upper_bound, .. } = unseen;
            text.push_str(&format!(
                "unseen: some kind of light that arrived elsewhere has not been met at {points} of {}. If there is such light, it adds at most {upper_bound:.3e} {unit} to one of them ({sure} % confidence). The noise bound does not include this.\n",
                counted(asked, point)
            ));
        }
        if dim.of_mean > WORTH_A_LINE {
            let Uncounted { points, upper_bound, .. } = dim;
            text.push_str(&format!(
                "dim: rare bright light may be missing at {points} of {}, which only photons of less than 1/{DIM_PHOTONS} of the brightest's flux have met. If there is such light, it adds at most {upper_bound:.3e} {unit} to one of them ({sure} % confidence). The noise bound does not include this.\n",
                counted(asked, point)
            ));
        }
        if off_surfaces.points > 0 {
            text.push_str(&off_surfaces.text(point));
        }
        for kind in absent {
            let part = match *kind {
                "shadow ray" => "direct light",
                "photon of the caustic map" => "caustics",
                _ => "indirect light",
            };
            text.push_str(&format!("unknown: no {kind} has reached any {point}, so {part} may be missing\n"));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_of_three() {
        assert!((most_hits(0.95) - 2.9957).abs() < 1e-4);
        // Tries that miss with the chance that is left.
        assert!(((-most_hits(0.9)).exp() - 0.1).abs() < 1e-12);
    }

    #[test]
    fn what_is_black_altogether_has_no_known_relative_error() {
        let mut unknown = Unknown { asked: 3, ..Unknown::default() };
        unknown.add_unreached(2.0);
        unknown.add_unreached(1.0);
        assert_eq!((unknown.upper_bound, unknown.unreached), (2.0, 2));
        let black = unknown.with_relative(f64::INFINITY);
        assert!(black.text("pixel", "W/m2/sr", 0.95, 2).contains("2 of 3 pixels"));
        assert!(serde_json::to_value(black).unwrap()["relative"].is_null());
    }
}
