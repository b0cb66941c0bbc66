//! What a picture's rounds cost, and the error that they leave: the formulas of the module above.

use super::variance::{BIAS_POWER, MapVariance, Variance};
use super::{Division, PhotonsOfMap};
use crate::plan::radius::mean_squared_radius;
use crate::plan::work_cost::Cost;
use crate::settings::scene::SAMPLES_PER_BLOCK;
use crate::settings::stop::{FIRST_LOOK, Stop};

/// More neighbours make a lookup longer: by this share for as many again as usual.
const OF_NEIGHBOURS: f64 = 0.15;
/// The bound of the bias over the bias.
const BOUND_OF_BIAS: f64 = 2.1;
/// The bound of noise over noise, squared.
const BOUND_OF_NOISE: f64 = 1.2;

/// What an error is made of.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ErrorParts {
    /// The square of the noise of paths, of the global and of the caustic map.
    pub noise: [f64; 3],
    pub bias: f64,
    /// What is not known of its square.
    pub unknown: f64,
    pub unseen: f64,
}

impl ErrorParts {
    /// Of so many rounds, of what the first one has, while radii shrink.
    fn after(&self, rounds: f64, alpha: f64) -> ErrorParts {
        // The mean of 1 / r^2 over rounds is n^(1 - alpha) / (2 - alpha), and that of the first round 1.
        let inverse = 1.0 / (2.0 - alpha);
        let of_radii = rounds.powf(-alpha) * (inverse + (1.0 - inverse) / rounds);
        let [paths, global, caustic] = self.noise;
        ErrorParts {
            noise: [paths / rounds, global * of_radii, caustic * of_radii],
            bias: self.bias * mean_squared_radius(alpha, rounds.ceil() as u32).powf(BIAS_POWER),
            unknown: self.unknown * of_radii,
            unseen: self.unseen / rounds,
        }
    }
}

/// What is known of a picture's rounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rounds {
    pub variance: Variance,
    pub cost: Cost,
    pub alpha: f64,
    /// Whether the bias is part of the error.
    pub counts_bias: bool,
    /// What light may add that is so rare that one path of each pixel misses it ([`crate::engine::error::bound::FilmError::unseen`]), and
    /// the samples of pixels that have fewest, over the mean of all.
    pub unseen: f64,
    pub least_samples: f64,
    /// Where no photon of the global map has reached any pixel, what they may add all the same, times photons and the square of the radius
    /// over the usual one.
    pub unreached: f64,
}

impl Rounds {
    /// Nanoseconds of a round.
    pub(crate) fn cost(&self, division: Division) -> f64 {
        self.cost.round + self.costs(division).iter().sum::<f64>()
    }

    /// Those of paths, of global and of caustic photons.
    pub(crate) fn costs(&self, division: Division) -> [f64; 3] {
        let Cost { paths, shadow_rays, lookups, discs, photons, .. } = self.cost;
        let mut of_path = paths + f64::from(division.shadow_rays) * shadow_rays;
        let mut of_photons = [0.0; 2];
        for (place, (map, of)) in self.maps(division) {
            of_photons[place] = photons[place] * f64::from(of.photons);
            of_path += lookups * (1.0 + OF_NEIGHBOURS * (of.neighbours - 1.0));
            of_path += 0.5 * discs * map.squared_radius(of) / map.squared_radius(map.at);
        }
        [f64::from(division.samples) * of_path, of_photons[0], of_photons[1]]
    }

    /// The maps that there are, the global one in place 0 and the caustic one in place 1, with their photons.
    fn maps(&self, division: Division) -> impl Iterator<Item = (usize, (MapVariance, PhotonsOfMap))> {
        let both = [(self.variance.global, division.global()), (self.variance.caustic, division.caustic())];
        both.into_iter().enumerate().filter(|(_, (map, _))| map.has_photons())
    }

    /// The bound of the error after so many rounds.
    pub(crate) fn error(&self, division: Division, rounds: f64) -> f64 {
        self.bound(&self.parts(division, rounds))
    }

    fn bound(&self, parts: &ErrorParts) -> f64 {
        let ErrorParts { noise, bias, unknown, unseen } = *parts;
        let of_bias = if self.counts_bias { BOUND_OF_BIAS.powi(2) * (bias * bias + unknown) } else { 0.0 };
        (BOUND_OF_NOISE * noise.iter().sum::<f64>() + of_bias + unseen * unseen).sqrt()
    }

    pub(crate) fn parts(&self, division: Division, rounds: f64) -> ErrorParts {
        self.first_round(division).after(rounds, self.alpha)
    }

    fn first_round(&self, division: Division) -> ErrorParts {
        let mut parts = ErrorParts {
            noise: [self.variance.of_paths_in_round(division), 0.0, 0.0],
            unseen: self.unseen / (self.least_samples * f64::from(division.samples)),
            ..ErrorParts::default()
        };
        for (place, (map, of)) in self.maps(division) {
            let noise = map.of_first_round(of, division.samples);
            parts.noise[1 + place] = noise;
            parts.unknown += noise * map.uncertainty;
            parts.bias += map.bias(map.squared_radius(of));
            if place == 0 {
                parts.unseen = parts.unseen.hypot(self.unreached / (f64::from(of.photons) * map.squared_radius(of)));
            }
        }
        parts
    }

    /// Rounds after which the error is so small, if ever, and their nanoseconds.
    pub(crate) fn until(&self, division: Division, error: f64) -> (f64, f64) {
        let (mut less, mut more) = (self.least_rounds(division), MOST_ROUNDS);
        let first = self.first_round(division);
        let is_small = |rounds: f64| self.bound(&first.after(rounds, self.alpha)) <= error;
        if !is_small(less) {
            // Halves the range of the logarithm.
            for _ in 0..16 {
                let middle = (less * more).sqrt();
                if is_small(middle) { more = middle } else { less = middle }
            }
            less = more;
        }
        (less, less * self.cost(division))
    }

    /// The error after so many seconds.
    pub(crate) fn after(&self, division: Division, seconds: f64) -> f64 {
        let rounds = 1e9 * seconds / self.cost(division);
        let few = (self.least_rounds(division) / rounds).max(1.0);
        // Fewer rounds than an error takes: it is not known.
        few * self.error(division, rounds.clamp(1.0, MOST_ROUNDS))
    }

    fn least_rounds(&self, division: Division) -> f64 {
        f64::from(FIRST_LOOK) * rounds_of_block(division)
    }

    /// Rounds that a goal takes.
    pub(crate) fn expected(&self, division: Division, stop: &Stop) -> u32 {
        let in_time = stop.seconds.map_or(f64::INFINITY, |seconds| 1e9 * seconds / self.cost(division));
        let of_error = stop.error.map_or(f64::INFINITY, |error| self.until(division, error).0);
        in_time.min(of_error).clamp(1.0, MOST_ROUNDS).ceil() as u32
    }

    /// What is to be small: the seconds until an error. Where there are fewer, those that the error after them would take if its square
    /// fell as time goes by, and of no error those for all there is.
    pub(crate) fn loss(&self, division: Division, stop: &Stop) -> f64 {
        let wanted = stop.error.unwrap_or(1.0);
        let (rounds, nanoseconds) = self.until(division, wanted);
        // A run of few blocks cannot end when its error is smaller than expected.
        let nanoseconds = nanoseconds.max(ENOUGH_BLOCKS * rounds_of_block(division) * self.cost(division));
        let reached = self.error(division, rounds).max(wanted) / wanted;
        match stop.seconds {
            Some(most) if stop.error.is_none() || 1e-9 * nanoseconds > most => most * (self.after(division, most) / wanted).powi(2),
            _ => 1e-9 * nanoseconds * reached * reached,
        }
    }
}

fn rounds_of_block(division: Division) -> f64 {
    f64::from((SAMPLES_PER_BLOCK / division.samples).max(1))
}

/// Blocks that a division should leave a run, whose error is looked at after 16, 20, 25 and 31.
const ENOUGH_BLOCKS: f64 = 24.0;
/// Rounds of a run that its error ends, at most.
const MOST_ROUNDS: f64 = 65_536.0;
