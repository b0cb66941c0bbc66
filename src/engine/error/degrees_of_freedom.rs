//! How far the errors of a film's places go together.
//!
//! The error of a picture is the root mean square of its pixels' errors. If these were independent, it would be almost the same in
//! every run; if all came from the same photons, it would vary as a single number does. In between its square is distributed as that
//! of fewer independent numbers (Satterthwaite 1946). How many there are follows from what each of the latest rounds left at some
//! places, e_r after their mean is taken away, with covariance S between places: from e_r . e_s of two rounds, whose mean square is
//! tr(S^2), and from the spread of |e_r|^2 between rounds, which also knows rare bright hits.
//!
//! Both have a part that comes from each place by itself, and one that places have in common. What few places have in common is what all
//! have. But few places have few errors of their own: how many all have follows from the variances of all.

/// Of a film's squared error, and of what the rounds say of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DegreesOfFreedom {
    pub error: f64,
    pub estimate: f64,
}

/// Rounds that are multiplied lie no further apart.
const LAGS: usize = 4;
/// Standard errors that an upper limit lies above what is found: 95 % of all are below it.
const SURE: f64 = 1.645;

impl DegreesOfFreedom {
    /// All errors go together, as far as anybody knows.
    pub(crate) fn least(rounds: u32) -> DegreesOfFreedom {
        DegreesOfFreedom { error: 1.0, estimate: (f64::from(rounds) - 1.0).max(1.0) }
    }

    /// Of so many rounds, of which `latest` has what some left at some places, `size` numbers each. `alone` is [`concentration`] of all
    /// places' variances.
    pub(crate) fn of(latest: &[Vec<f64>], size: usize, rounds: u32, alone: f64) -> DegreesOfFreedom {
        let least = DegreesOfFreedom::least(rounds);
        let kept = latest.len() as f64;
        if latest.len() < 4 || !alone.is_finite() {
            return least;
        }
        let places = latest[0].len();
        let mean: Vec<f64> = (0..places).map(|place| latest.iter().map(|values| values[place]).sum::<f64>() / kept).collect();
        let errors: Vec<Vec<f64>> =
            latest.iter().map(|values| values.iter().zip(&mean).map(|(value, mean)| value - mean).collect()).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let squares: Vec<f64> = errors.iter().map(|errors| dot(errors, errors)).collect();
        let mean_square = squares.iter().sum::<f64>() / kept;
        // tr(S), as the mean of so few took some of it away.
        let trace = mean_square * kept / (kept - 1.0);
        if trace == 0.0 {
            return least;
        }
        // What each place has by itself of the square of a round, and of the product of two.
        let by_place = |a: &[f64], b: &[f64]| -> Vec<f64> { a.chunks(size).zip(b.chunks(size)).map(|(a, b)| dot(a, b)).collect() };
        let pairs = || (1..=LAGS.min(latest.len() - 1)).flat_map(|lag| errors.iter().zip(&errors[lag..]));
        let count = pairs().count() as f64;
        let (mut normal, mut normal_alone) = (0.0, 0.0);
        for (a, b) in pairs() {
            let of_places = by_place(a, b);
            normal += ((of_places.iter().sum::<f64>() + trace / kept) / trace).powi(2) / count;
            normal_alone += dot(&of_places, &of_places) / (trace * trace) / count;
        }
        let squares_of_places: Vec<Vec<f64>> = errors.iter().map(|errors| by_place(errors, errors)).collect();
        let variances: Vec<f64> =
            (0..places / size).map(|place| squares_of_places.iter().map(|of| of[place]).sum::<f64>() / kept).collect();
        let spread_of = |of_round: &dyn Fn(usize) -> f64, mean: f64| {
            (0..latest.len()).map(|round| ((of_round(round) - mean) / mean_square).powi(2)).sum::<f64>() / (kept - 1.0)
        };
        let spread = spread_of(&|round| squares[round], mean_square);
        let spread_alone: f64 =
            variances.iter().enumerate().map(|(place, mean)| spread_of(&|round| squares_of_places[round][place], *mean)).sum();
        // Relative variances of the square of a round's error: as far as it is normal, and in all. What few rounds say of them may
        // be too small by chance, so their upper limits are taken.
        let upper = |count: f64| 1.0 + SURE * (2.0 / count).sqrt();
        let of_all =
            |kept: f64, kept_alone: f64| (kept - kept_alone).max(0.0) + kept_alone * alone / concentration(variances.iter().copied());
        let normal = 2.0 * of_all(normal, normal_alone) * upper(count);
        let all = of_all(spread, spread_alone).max(normal);
        let rounds = f64::from(rounds);
        DegreesOfFreedom { error: (2.0 / (normal + (all - normal) / rounds)).max(1.0), estimate: (2.0 * (rounds - 1.0) / all).max(1.0) }
    }
}

/// Of variances of places that have nothing in common: one over how many equal ones would do the same.
pub(crate) fn concentration(variances: impl Iterator<Item = f64>) -> f64 {
    let (sum, squares) = variances.fold((0.0, 0.0), |(sum, squares), variance| (sum + variance, squares + variance * variance));
    squares / (sum * sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::mix32;

    /// A normal number (Box and Muller 1958).
    fn normal(number: u32) -> f64 {
        let unit = |word: u32| (f64::from(mix32(word) >> 8) + 0.5) / f64::from(1 << 24);
        (-2.0 * unit(2 * number).ln()).sqrt() * (std::f64::consts::TAU * unit(2 * number + 1)).cos()
    }

    /// Rounds whose places have as many independent errors as `sources`, each seen at as many of them.
    fn rounds(count: u32, places: u32, sources: u32) -> Vec<Vec<f64>> {
        let round = |round: u32| (0..places).map(|place| 7.0 + normal(round * sources + place % sources)).collect();
        (1..=count).map(round).collect()
    }

    #[test]
    fn as_many_are_found_as_there_are_sources() {
        for sources in [1, 4, 30, 240] {
            let found = DegreesOfFreedom::of(&rounds(256, 240, sources), 1, 256, 1.0 / 240.0);
            let ratio = [found.error, found.estimate / 255.0].map(|found| found / f64::from(sources));
            assert!(ratio.iter().all(|ratio| (0.7..1.2).contains(ratio)), "{sources}: {found:?}");
        }
    }

    #[test]
    fn rare_hits_leave_little_known_of_the_spread() {
        // One round in 32 has a bright place, each time another one.
        let mut rare = rounds(256, 240, 240);
        (0..8).for_each(|hit| rare[32 * hit + 5][31 * hit % 240] += 500.0);
        let found = DegreesOfFreedom::of(&rare, 1, 256, 1.0 / 8.0);
        assert!(found.estimate < 20.0 && found.error < 20.0, "{found:?}");
    }

    /// 240 places of 24 000 are kept: what each has by itself, all have a hundred times as often, and what they have in common no more often.
    #[test]
    fn few_places_stand_for_all() {
        let found = DegreesOfFreedom::of(&rounds(256, 240, 240), 1, 256, 1.0 / 24_000.0);
        assert!((4e3..3e4).contains(&found.error), "{found:?}");
        let found = DegreesOfFreedom::of(&rounds(256, 240, 4), 1, 256, 1.0 / 24_000.0);
        assert!((2.8..4.8).contains(&found.error), "{found:?}");
        // All from one place that is not among those that are kept.
        let found = DegreesOfFreedom::of(&rounds(256, 240, 240), 1, 256, 1.0);
        assert!(found.error < 1.5, "{found:?}");
    }

    #[test]
    fn of_few_rounds_and_of_no_noise_nothing_is_known() {
        assert_eq!(DegreesOfFreedom::of(&rounds(3, 10, 10), 1, 3, 0.1), DegreesOfFreedom { error: 1.0, estimate: 2.0 });
        assert_eq!(DegreesOfFreedom::of(&vec![vec![1.0; 5]; 9], 1, 9, 0.2), DegreesOfFreedom::least(9));
        assert_eq!(DegreesOfFreedom::of(&[], 1, 1, 1.0), DegreesOfFreedom { error: 1.0, estimate: 1.0 });
    }
}
