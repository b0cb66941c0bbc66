//! How much the light of a round varies, and what the radius adds to it: what a pilot says of paths, shadow rays and maps.

use super::{Division, PhotonsOfMap};
use crate::settings::scene::SAMPLES_PER_BLOCK;

/// What light of a round varies by, relative to the square of all light.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Variance {
    /// Of one path of [`SAMPLES_PER_BLOCK`] through each pixel, and of one shadow ray of each.
    pub path: f64,
    pub shadow_ray: f64,
    pub global: MapVariance,
    pub caustic: MapVariance,
}

/// The same of a map at its first radius.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct MapVariance {
    /// With these photons and a path; none without a map.
    pub of_round: f64,
    pub at: PhotonsOfMap,
    /// By which the variance falls with the paths of a pixel, which look the map up at several places.
    pub sample_power: f64,
    /// The share of all light that the map gives.
    pub share: f64,
    /// The bias of that light at the usual radius, relative to it.
    pub bias: f64,
    /// How well the bias's square is known, over the variance of the light.
    pub uncertainty: f64,
    /// The square of the widest first radius over that of the usual photons and neighbours; `None` where it is given, whatever the photons.
    pub widest: Option<f64>,
}

impl MapVariance {
    /// The first radius's square over that of the usual photons and neighbours; one that is given is taken for that.
    pub(crate) fn squared_radius(&self, of: PhotonsOfMap) -> f64 {
        self.widest.map_or(1.0, |widest| widest.min(of.over_usual()))
    }

    /// The bias of all light for a squared radius over the usual one.
    pub(super) fn bias(&self, squared_radius: f64) -> f64 {
        self.bias * self.share * squared_radius.powf(BIAS_POWER)
    }

    /// Weighs the square of a bias that was found for this map's photons, and how well it is known, against that of the usual one, of which
    /// `share` is left in a run. One that is too small makes a run much longer, and one that is too large a little: so it is taken for half
    /// a deviation more.
    pub(crate) fn learn_bias(&mut self, found: f64, uncertainty: f64, share: f64) {
        let at_usual = share * self.squared_radius(self.at).powf(-2.0 * BIAS_POWER);
        // The interval reaches two deviations to either side.
        let [found, deviation] = [found * found, 0.5 * uncertainty].map(|square| at_usual * square);
        let usual = self.bias * self.bias;
        let [of_found, of_usual] = [deviation, USUAL_SPREAD * usual].map(|deviation| deviation.powi(-2));
        if deviation > 0.0 {
            let both = of_found + of_usual;
            self.bias = ((found * of_found + usual * of_usual) / both + 0.5 * both.powf(-0.5)).sqrt();
        }
    }

    /// The variance of the first round's light.
    pub(crate) fn of_first_round(&self, of: PhotonsOfMap, samples: u32) -> f64 {
        let hits = |of: PhotonsOfMap| f64::from(of.photons) * self.squared_radius(of);
        match self.of_round {
            0.0 => 0.0,
            found => found * hits(self.at) / hits(of) * f64::from(samples).powf(-self.sample_power),
        }
    }

    pub(super) fn has_photons(&self) -> bool {
        self.at.photons > 0
    }
}

impl Variance {
    /// From what a path with 1 shadow ray and with `many` had.
    pub(crate) fn of_paths(with_one: f64, with_many: f64, many: u32) -> Variance {
        let shadow_ray = ((with_one - with_many) / (1.0 - of_samples(many))).clamp(0.0, with_one);
        Variance { path: with_one - shadow_ray, shadow_ray, ..Variance::default() }
    }

    /// Of a round's paths.
    pub(crate) fn of_paths_in_round(&self, division: Division) -> f64 {
        let of_a_path = self.path + self.shadow_ray * of_samples(division.shadow_rays);
        of_a_path / f64::from(SAMPLES_PER_BLOCK) * of_samples(division.samples) / of_samples(SAMPLES_PER_BLOCK)
    }
}

/// The variance of the mean of so many samples of a pixel over that of one: many lie more evenly than few.
pub(crate) fn of_samples(count: u32) -> f64 {
    f64::from(count).powf(-SAMPLE_POWER)
}

/// The bias of light from the global and the caustic map at the usual first radius, relative to it, where nothing is known: of ten scenes
/// 0.3 to 3 % and 4 to 90 %; and the spread of its square.
pub(crate) const USUAL_BIAS: [f64; 2] = [0.015, 0.12];
const USUAL_SPREAD: f64 = 2.0;
/// The square of a run's bias over that of a pilot's, whose radii fit the density of a caustic's photons worse.
pub(crate) const FOUND_BIAS: [f64; 2] = [1.0, 0.5];
/// How well its square is known, over the variance of the light: a Student's quantile of what some 1000 discs show that have no photon in
/// common, at two radii.
pub(crate) const USUAL_UNCERTAINTY: f64 = 0.2;
/// The power of the squared radius that it goes by: 1 where light is smooth, less along edges and in corners.
pub(super) const BIAS_POWER: f64 = 0.45;
/// By which the variance of even samples falls: 1 at random, and up to 3 where light is smooth (Owen 1997). Between 1 and 1.4 in ten scenes.
const SAMPLE_POWER: f64 = 1.25;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::work_division::USUAL_PHOTONS;

    #[test]
    fn variances_are_separated_by_the_shadow_rays() {
        let found = Variance::of_paths(5.0, 1.0 + 4.0 * of_samples(4), 4);
        assert_eq!((found.path, found.shadow_ray), (1.0, 4.0));
        // Chance may turn them round: then all of it is the paths'.
        let found = Variance::of_paths(2.0, 5.0, 4);
        assert_eq!((found.path, found.shadow_ray), (2.0, 0.0));
    }

    /// What is well known counts, and of what is not the usual; never less than is likely.
    #[test]
    fn a_bias_is_between_what_was_found_and_what_is_usual() {
        let at = PhotonsOfMap { photons: USUAL_PHOTONS as u32, neighbours: 1.0 };
        let learned = |found: f64, uncertainty: f64, share: f64| {
            let mut map = MapVariance { at, bias: 0.1, widest: Some(100.0), ..MapVariance::default() };
            map.learn_bias(found, uncertainty, share);
            map.bias
        };
        assert!((learned(0.3, 1e-6, 1.0) - 0.3).abs() < 1e-3 && (learned(0.01, 1e-9, 1.0) - 0.01).abs() < 1e-4);
        assert!((learned(0.3, 1e-6, 0.25) - 0.15).abs() < 1e-3);
        let hardly = learned(0.5, 100.0, 1.0);
        assert!((0.1..0.16).contains(&hardly), "{hardly}");
        assert!((learned(0.0, 0.0, 1.0) - 0.1).abs() < 1e-12);
        // What is as usual, and less well known.
        assert!(learned(0.1, 0.02, 1.0) > learned(0.1, 0.002, 1.0));
    }
}
