//! How a picture divides its work between paths, shadow rays, photons and the radius, so that its error falls fastest.
//!
//! After n rounds of S paths a pixel with R shadow rays each, the squared error relative to the light is taken for
//!
//! ```text
//! noise of paths   (path + shadow ray / R^p) / (S^p n)
//! noise of maps    of a round / (photons in the disc x S^p of the map) x the mean of 1 / r^2 of the rounds / n
//! bias             (of a map's light x its share x the mean of r^2 to a power)^2
//! unseen           (of a path / (samples of those that have fewest x n))^2, and (of a photon / (photons x r^2 x n))^2 where none has arrived
//! ```
//!
//! with what is not known of the bias, which falls with the noise of the maps. Radii shrink as Knaus and Zwicker (2011) have them. Variances
//! are a pilot's ([`crate::engine::scene::pilot`]), costs those of a class of devices ([`super::work_cost`]).

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::radius::{mean_squared_radius, over_usual};
use super::work_cost::Cost;
use crate::settings::scene::{SAMPLES_PER_BLOCK, SceneSettings};
use crate::settings::stop::{FIRST_LOOK, Stop};

/// What each round does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Division {
    /// Paths through a pixel, and shadow rays from each visible point.
    pub samples: u32,
    pub shadow_rays: u32,
    /// Of the global and of the caustic map.
    pub photons: u32,
    pub caustic_photons: u32,
    /// Photons of a round within the first radius of each.
    pub neighbours: u32,
    pub caustic_neighbours: u32,
}

impl Division {
    pub fn of(settings: &SceneSettings) -> Division {
        let &SceneSettings { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours, .. } = settings;
        Division { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours }
    }

    pub fn set(self, settings: &SceneSettings) -> SceneSettings {
        let Division { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours } = self;
        SceneSettings { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours, ..settings.clone() }
    }

    pub fn global(self) -> PhotonsOfMap {
        PhotonsOfMap { photons: self.photons, neighbours: over_usual(self.neighbours, false) }
    }

    pub fn caustic(self) -> PhotonsOfMap {
        PhotonsOfMap { photons: self.caustic_photons, neighbours: over_usual(self.caustic_neighbours, true) }
    }
}

/// Photons of a round, and those of them within the first radius over the usual ones.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PhotonsOfMap {
    pub photons: u32,
    pub neighbours: f64,
}

impl PhotonsOfMap {
    /// The square of the radius over the usual one.
    pub fn over_usual(self) -> f64 {
        self.neighbours * USUAL_PHOTONS / f64::from(self.photons)
    }
}

/// What is to be chosen, as nobody has set it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Free {
    pub samples: bool,
    pub shadow_rays: bool,
    pub photons: bool,
    pub caustic_photons: bool,
    pub neighbours: bool,
    pub caustic_neighbours: bool,
}

impl Free {
    pub const ALL: Free =
        Free { samples: true, shadow_rays: true, photons: true, caustic_photons: true, neighbours: true, caustic_neighbours: true };
}

/// What light of a round varies by, relative to the square of all light.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Variance {
    /// Of one path of [`SAMPLES_PER_BLOCK`] through each pixel, and of one shadow ray of each.
    pub path: f64,
    pub shadow_ray: f64,
    pub global: MapVariance,
    pub caustic: MapVariance,
}

/// The same of a map at its first radius.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MapVariance {
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
    pub fn squared_radius(&self, of: PhotonsOfMap) -> f64 {
        self.widest.map_or(1.0, |widest| widest.min(of.over_usual()))
    }

    /// The bias of all light for a squared radius over the usual one.
    fn bias(&self, squared_radius: f64) -> f64 {
        self.bias * self.share * squared_radius.powf(BIAS_POWER)
    }

    /// Weighs the square of a bias that was found for this map's photons, and how well it is known, against that of the usual one, of which
    /// `share` is left in a run. One that is too small makes a run much longer, and one that is too large a little: so it is taken for half
    /// a deviation more.
    pub fn learn_bias(&mut self, found: f64, uncertainty: f64, share: f64) {
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
    pub fn of_first_round(&self, of: PhotonsOfMap, samples: u32) -> f64 {
        let hits = |of: PhotonsOfMap| f64::from(of.photons) * self.squared_radius(of);
        match self.of_round {
            0.0 => 0.0,
            found => found * hits(self.at) / hits(of) * f64::from(samples).powf(-self.sample_power),
        }
    }

    fn has_photons(&self) -> bool {
        self.at.photons > 0
    }
}

impl Variance {
    /// From what a path with 1 shadow ray and with `many` had.
    pub fn of_paths(with_one: f64, with_many: f64, many: u32) -> Variance {
        let shadow_ray = ((with_one - with_many) / (1.0 - of_samples(many))).clamp(0.0, with_one);
        Variance { path: with_one - shadow_ray, shadow_ray, ..Variance::default() }
    }

    /// Of a round's paths.
    pub fn of_paths_in_round(&self, division: Division) -> f64 {
        let of_a_path = self.path + self.shadow_ray * of_samples(division.shadow_rays);
        of_a_path / f64::from(SAMPLES_PER_BLOCK) * of_samples(division.samples) / of_samples(SAMPLES_PER_BLOCK)
    }
}

/// The variance of the mean of so many samples of a pixel over that of one: many lie more evenly than few.
pub fn of_samples(count: u32) -> f64 {
    f64::from(count).powf(-SAMPLE_POWER)
}

/// More neighbours make a lookup longer: by this share for as many again as usual.
const OF_NEIGHBOURS: f64 = 0.15;
/// Photons of the usual radius, with the usual neighbours.
const USUAL_PHOTONS: f64 = 131_072.0;
/// The bias of light from the global and the caustic map at the usual first radius, relative to it, where nothing is known: of ten scenes
/// 0.3 to 3 % and 4 to 90 %; and the spread of its square.
pub const USUAL_BIAS: [f64; 2] = [0.015, 0.12];
const USUAL_SPREAD: f64 = 2.0;
/// The square of a run's bias over that of a pilot's, whose radii fit the density of a caustic's photons worse.
pub const FOUND_BIAS: [f64; 2] = [1.0, 0.5];
/// How well its square is known, over the variance of the light: a Student's quantile of what some 1000 discs tell that have no photon in
/// common, at two radii.
pub const USUAL_UNCERTAINTY: f64 = 0.2;
/// The power of the squared radius that it goes by: 1 where light is smooth, less along edges and in corners.
const BIAS_POWER: f64 = 0.45;
/// The bound of the bias over the bias.
const BOUND_OF_BIAS: f64 = 2.1;
/// By which the variance of even samples falls: 1 at random, and up to 3 where light is smooth (Owen 1997). Between 1 and 1.4 in ten scenes.
const SAMPLE_POWER: f64 = 1.25;
/// The bound of noise over noise, squared.
const BOUND_OF_NOISE: f64 = 1.2;

/// What an error is made of.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ErrorParts {
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
pub struct Rounds {
    pub variance: Variance,
    pub cost: Cost,
    pub alpha: f64,
    /// Whether the bias is part of the error.
    pub counts_bias: bool,
    /// What light may add that is so rare that one path of each pixel misses it ([`crate::engine::error_bound::FilmError::unseen`]), and
    /// the samples of pixels that have fewest, over the mean of all.
    pub unseen: f64,
    pub least_samples: f64,
    /// Where no photon of the global map has reached any pixel, what they may add all the same, times photons and the square of the radius
    /// over the usual one.
    pub unreached: f64,
}

impl Rounds {
    /// Nanoseconds of a round.
    pub fn cost(&self, division: Division) -> f64 {
        self.cost.round + self.costs(division).iter().sum::<f64>()
    }

    /// Those of paths, of global and of caustic photons.
    pub fn costs(&self, division: Division) -> [f64; 3] {
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
    pub fn error(&self, division: Division, rounds: f64) -> f64 {
        self.bound(&self.parts(division, rounds))
    }

    fn bound(&self, parts: &ErrorParts) -> f64 {
        let ErrorParts { noise, bias, unknown, unseen } = *parts;
        let of_bias = if self.counts_bias { BOUND_OF_BIAS.powi(2) * (bias * bias + unknown) } else { 0.0 };
        (BOUND_OF_NOISE * noise.iter().sum::<f64>() + of_bias + unseen * unseen).sqrt()
    }

    pub fn parts(&self, division: Division, rounds: f64) -> ErrorParts {
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
    pub fn until(&self, division: Division, error: f64) -> (f64, f64) {
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
    pub fn after(&self, division: Division, seconds: f64) -> f64 {
        let rounds = 1e9 * seconds / self.cost(division);
        let few = (self.least_rounds(division) / rounds).max(1.0);
        // Fewer rounds than an error takes: it is not known.
        few * self.error(division, rounds.clamp(1.0, MOST_ROUNDS))
    }

    fn least_rounds(&self, division: Division) -> f64 {
        f64::from(FIRST_LOOK) * rounds_of_block(division)
    }

    /// Rounds that a goal takes.
    pub fn expected(&self, division: Division, stop: &Stop) -> u32 {
        let in_time = stop.seconds.map_or(f64::INFINITY, |seconds| 1e9 * seconds / self.cost(division));
        let of_error = stop.error.map_or(f64::INFINITY, |error| self.until(division, error).0);
        in_time.min(of_error).clamp(1.0, MOST_ROUNDS).ceil() as u32
    }

    /// What is to be small: the seconds until an error. Where there are fewer, those that the error after them would take if its square
    /// fell as time goes by, and of no error those for all there is.
    pub fn loss(&self, division: Division, stop: &Stop) -> f64 {
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
/// More shadow rays of one path tell little that other paths do not.
const MOST_SHADOW_RAYS: u32 = 16;
pub const MOST_SAMPLES: u32 = 256;
const LEAST_PHOTONS: u32 = 1 << 12;
pub const MOST_PHOTONS: u32 = 1 << 22;
/// From an eighth of the usual ones to 16 times as many, and of the caustic map from a sixth to 32 times.
const CHOICE_OF_NEIGHBOURS: [u32; 8] = [3, 6, 12, 24, 48, 96, 192, 384];
/// Each third of what may be chosen begins a search.
const BEGINS_APART: usize = 3;
const CHOICE_OF_CAUSTIC_NEIGHBOURS: [u32; 9] = [1, 2, 3, 6, 12, 24, 48, 96, 192];

/// The division whose loss is least: what is free in powers of two, up to so many samples and photons.
pub fn best(rounds: &Rounds, before: Division, free: Free, stop: &Stop, (most_samples, most_photons): (u32, u32)) -> Division {
    let powers = |is_free: bool, least: u32, most: u32, own: u32| match is_free {
        true => std::iter::successors(Some(least), |power| Some(2 * power)).take_while(|power| *power <= most).collect(),
        false => vec![own],
    };
    let Variance { global, caustic, .. } = rounds.variance;
    let photons = powers(free.photons && global.has_photons(), LEAST_PHOTONS, most_photons, before.photons);
    let caustic_photons = powers(free.caustic_photons && caustic.has_photons(), LEAST_PHOTONS, most_photons, before.caustic_photons);
    let neighbours = if free.neighbours { CHOICE_OF_NEIGHBOURS.to_vec() } else { vec![before.neighbours] };
    let caustic_neighbours = if free.caustic_neighbours { CHOICE_OF_CAUSTIC_NEIGHBOURS.to_vec() } else { vec![before.caustic_neighbours] };
    let samples = powers(free.samples, 1, most_samples, before.samples);
    let shadow_rays = powers(free.shadow_rays, 1, MOST_SHADOW_RAYS, before.shadow_rays);
    let pairs = |some: &[u32], others: &[u32]| -> Vec<(u32, u32)> {
        some.iter().flat_map(|one| others.iter().map(move |other| (*one, *other))).collect()
    };
    let (of_paths, of_both) = (pairs(&samples, &shadow_rays), pairs(&photons, &caustic_photons));
    let (of_global, of_caustic) = (pairs(&photons, &neighbours), pairs(&caustic_photons, &caustic_neighbours));
    let better = |least: (f64, Division), pairs: &[(u32, u32)], set: fn(&mut Division, (u32, u32))| {
        let changed = pairs.iter().map(|pair| {
            let mut division = least.1;
            set(&mut division, *pair);
            (rounds.loss(division, stop), division)
        });
        changed.fold(least, less)
    };
    // What goes together is chosen together, in turn, until nothing is better; from several beginnings, as none leads to the best for certain.
    let from = |begin: Division| {
        let mut least = (rounds.loss(begin, stop), begin);
        loop {
            let at = least.1;
            least = better(least, &of_paths, |division, pair| (division.samples, division.shadow_rays) = pair);
            least = better(least, &of_global, |division, pair| (division.photons, division.neighbours) = pair);
            least = better(least, &of_caustic, |division, pair| (division.caustic_photons, division.caustic_neighbours) = pair);
            least = better(least, &of_both, |division, pair| (division.photons, division.caustic_photons) = pair);
            if least.1 == at {
                return least;
            }
        }
    };
    let some = |choice: &[u32]| -> Vec<u32> { choice.iter().copied().step_by(BEGINS_APART).collect() };
    let begins = pairs(&some(&samples), &some(&neighbours));
    let found: Vec<_> = begins.into_par_iter().map(|(samples, neighbours)| from(Division { samples, neighbours, ..before })).collect();
    found.into_iter().fold((rounds.loss(before, stop), before), less).1
}

/// The first of two whose loss is no more.
fn less(one: (f64, Division), other: (f64, Division)) -> (f64, Division) {
    if other.0 < one.0 { other } else { one }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::scene::{CAUSTIC_NEIGHBOURS, NEIGHBOURS};

    const BEFORE: Division = Division {
        samples: 1,
        shadow_rays: 1,
        photons: 1 << 17,
        caustic_photons: 1 << 17,
        neighbours: NEIGHBOURS,
        caustic_neighbours: CAUSTIC_NEIGHBOURS,
    };
    const OF_PATHS: Free = Free { photons: false, caustic_photons: false, neighbours: false, caustic_neighbours: false, ..Free::ALL };

    fn rounds(variance: Variance, cost: Cost) -> Rounds {
        Rounds { variance, cost, alpha: 2.0 / 3.0, counts_bias: true, unseen: 0.0, least_samples: 1.0, unreached: 0.0 }
    }

    fn goal(error: f64) -> Stop {
        Stop { error: Some(error), ..Stop::default() }
    }

    #[test]
    fn variances_are_told_apart_by_the_shadow_rays() {
        let found = Variance::of_paths(5.0, 1.0 + 4.0 * of_samples(4), 4);
        assert_eq!((found.path, found.shadow_ray), (1.0, 4.0));
        // Chance may turn them round: then all of it is the paths'.
        let found = Variance::of_paths(2.0, 5.0, 4);
        assert_eq!((found.path, found.shadow_ray), (2.0, 0.0));
    }

    /// As many shadow rays as make their noise and their cost alike those of paths: sqrt(16 / 1 x 1 / 1).
    #[test]
    fn the_best_division_balances_costs() {
        let cost = Cost { paths: 1.0, shadow_rays: 1.0, ..Cost::default() };
        let of_rays = rounds(Variance { path: 1.0, shadow_ray: 16.0, ..Variance::default() }, cost);
        let all = (MOST_SAMPLES, MOST_PHOTONS);
        assert_eq!(best(&of_rays, BEFORE, OF_PATHS, &goal(0.001), all).shadow_rays, 4);
        // What each round takes is shared by as many samples as leave enough rounds.
        let dear_rounds = rounds(Variance { path: 1.0, ..Variance::default() }, Cost { round: 1000.0, paths: 1.0, ..Cost::default() });
        assert_eq!(best(&dear_rounds, BEFORE, OF_PATHS, &goal(0.01), all).samples, 256);
        assert_eq!(best(&dear_rounds, BEFORE, OF_PATHS, &goal(0.1), all).samples, 8);
        assert_eq!(best(&dear_rounds, BEFORE, OF_PATHS, &goal(0.01), (2, MOST_PHOTONS)).samples, 2);
        // What is set stays, a power of two or none.
        let set = Division { shadow_rays: 3, ..BEFORE };
        assert_eq!(best(&of_rays, set, Free { shadow_rays: false, ..OF_PATHS }, &goal(0.001), all).shadow_rays, 3);
    }

    #[test]
    fn photons_go_where_the_noise_is() {
        let map = MapVariance { at: BEFORE.global(), bias: USUAL_BIAS[0], uncertainty: USUAL_UNCERTAINTY, ..MapVariance::default() };
        let of_map = |of_round: f64, share: f64| MapVariance { of_round, share, widest: Some(100.0), ..map };
        let variance = Variance { path: 0.1, global: of_map(0.05, 0.5), caustic: of_map(1e-4, 0.01), ..Variance::default() };
        let found = rounds(variance, Cost { round: 1e6, paths: 1e6, shadow_rays: 1e5, photons: [5.0; 2], ..Cost::default() });
        let of = |error: f64| best(&found, BEFORE, Free::ALL, &goal(error), (MOST_SAMPLES, MOST_PHOTONS));
        assert!(of(0.02).photons > of(0.02).caustic_photons, "{:?}", of(0.02));
        let [chosen, usual] = [of(0.01), BEFORE].map(|division| found.until(division, 0.01).1);
        assert!(chosen < 0.5 * usual, "{chosen} {usual}");
        // A radius that is given has its bias, and more photons in it less noise.
        let set = MapVariance { widest: None, ..of_map(0.05, 0.5) };
        let twice = PhotonsOfMap { photons: 1 << 18, ..BEFORE.global() };
        let few = PhotonsOfMap { neighbours: 0.1, ..twice };
        assert_eq!((set.of_first_round(few, 8), of_map(0.05, 0.5).of_first_round(twice, 8)), (0.025, 0.05));
        assert_eq!(MapVariance { sample_power: 1.0, ..set }.of_first_round(few, 8), 0.025 / 8.0);
    }

    /// Of photons that have reached nothing more are traced, or more looked at, until they prove that nothing is missing.
    #[test]
    fn photons_that_reach_nothing_are_as_many_as_prove_it() {
        let at = PhotonsOfMap { photons: USUAL_PHOTONS as u32, neighbours: 1.0 };
        let global = MapVariance { at, widest: Some(100.0), ..MapVariance::default() };
        let variance = Variance { path: 1e-3, global, ..Variance::default() };
        let known = rounds(variance, Cost { round: 1e6, paths: 1e6, photons: [5.0; 2], ..Cost::default() });
        let dark = Rounds { unreached: 0.5 * USUAL_PHOTONS, ..known };
        let [few, many] = [known, dark].map(|rounds| best(&rounds, BEFORE, Free::ALL, &goal(0.002), (MOST_SAMPLES, MOST_PHOTONS)));
        assert!(many.global().over_usual() * f64::from(many.photons) > 4.0 * few.global().over_usual() * f64::from(few.photons));
        assert!(dark.until(many, 0.002).1 < 0.5 * dark.until(few, 0.002).1, "{many:?} {few:?}");
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
