//! The search for the division of work whose loss is least.

use rayon::prelude::*;

use super::rounds::Rounds;
use super::variance::Variance;
use super::{Division, TunableSettings};
use crate::settings::stop::Stop;

/// More shadow rays of one path show little that other paths do not.
const MOST_SHADOW_RAYS: u32 = 16;
pub(crate) const MOST_SAMPLES: u32 = 256;
const LEAST_PHOTONS: u32 = 1 << 12;
pub(crate) const MOST_PHOTONS: u32 = 1 << 22;
/// From an eighth of the usual ones to 16 times as many, and of the caustic map from a sixth to 32 times.
const CHOICE_OF_NEIGHBOURS: [u32; 8] = [3, 6, 12, 24, 48, 96, 192, 384];
/// Each third of what may be chosen begins a search.
const BEGINS_APART: usize = 3;
const CHOICE_OF_CAUSTIC_NEIGHBOURS: [u32; 9] = [1, 2, 3, 6, 12, 24, 48, 96, 192];

/// The division whose loss is least: what is free in powers of two, up to so many samples and photons.
pub(crate) fn best(
    rounds: &Rounds,
    before: Division,
    tunable: TunableSettings,
    stop: &Stop,
    (most_samples, most_photons): (u32, u32),
) -> Division {
    let powers = |is_free: bool, least: u32, most: u32, own: u32| match is_free {
        true => std::iter::successors(Some(least), |power| Some(2 * power)).take_while(|power| *power <= most).collect(),
        false => vec![own],
    };
    let Variance { global, caustic, .. } = rounds.variance;
    let photons = powers(tunable.photons && global.has_photons(), LEAST_PHOTONS, most_photons, before.photons);
    let caustic_photons = powers(tunable.caustic_photons && caustic.has_photons(), LEAST_PHOTONS, most_photons, before.caustic_photons);
    let neighbours = if tunable.neighbours { CHOICE_OF_NEIGHBOURS.to_vec() } else { vec![before.neighbours] };
    let caustic_neighbours =
        if tunable.caustic_neighbours { CHOICE_OF_CAUSTIC_NEIGHBOURS.to_vec() } else { vec![before.caustic_neighbours] };
    let samples = powers(tunable.samples, 1, most_samples, before.samples);
    let shadow_rays = powers(tunable.shadow_rays, 1, MOST_SHADOW_RAYS, before.shadow_rays);
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
    use crate::plan::work_cost::Cost;
    use crate::plan::work_division::variance::{MapVariance, USUAL_BIAS, USUAL_UNCERTAINTY};
    use crate::plan::work_division::{PhotonsOfMap, USUAL_PHOTONS};
    use crate::settings::scene::{CAUSTIC_NEIGHBOURS, NEIGHBOURS};

    const BEFORE: Division = Division {
        samples: 1,
        shadow_rays: 1,
        photons: 1 << 17,
        caustic_photons: 1 << 17,
        neighbours: NEIGHBOURS,
        caustic_neighbours: CAUSTIC_NEIGHBOURS,
    };
    const OF_PATHS: TunableSettings =
        TunableSettings { photons: false, caustic_photons: false, neighbours: false, caustic_neighbours: false, ..TunableSettings::ALL };

    fn rounds(variance: Variance, cost: Cost) -> Rounds {
        Rounds { variance, cost, alpha: 2.0 / 3.0, counts_bias: true, unseen: 0.0, least_samples: 1.0, unreached: 0.0 }
    }

    fn goal(error: f64) -> Stop {
        Stop { error: Some(error), ..Stop::default() }
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
        assert_eq!(best(&of_rays, set, TunableSettings { shadow_rays: false, ..OF_PATHS }, &goal(0.001), all).shadow_rays, 3);
    }

    #[test]
    fn photons_go_where_the_noise_is() {
        let map = MapVariance { at: BEFORE.global(), bias: USUAL_BIAS[0], uncertainty: USUAL_UNCERTAINTY, ..MapVariance::default() };
        let of_map = |of_round: f64, share: f64| MapVariance { of_round, share, widest: Some(100.0), ..map };
        let variance = Variance { path: 0.1, global: of_map(0.05, 0.5), caustic: of_map(1e-4, 0.01), ..Variance::default() };
        let found = rounds(variance, Cost { round: 1e6, paths: 1e6, shadow_rays: 1e5, photons: [5.0; 2], ..Cost::default() });
        let of = |error: f64| best(&found, BEFORE, TunableSettings::ALL, &goal(error), (MOST_SAMPLES, MOST_PHOTONS));
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
        let [few, many] =
            [known, dark].map(|rounds| best(&rounds, BEFORE, TunableSettings::ALL, &goal(0.002), (MOST_SAMPLES, MOST_PHOTONS)));
        assert!(many.global().over_usual() * f64::from(many.photons) > 4.0 * few.global().over_usual() * f64::from(few.photons));
        assert!(dark.until(many, 0.002).1 < 0.5 * dark.until(few, 0.002).1, "{many:?} {few:?}");
    }
}
