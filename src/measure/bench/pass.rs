//! One pass of a workload: its time, its work, and how close it comes to the device's limits.

use std::collections::BTreeMap;
use std::ops::Add;

use serde::Serialize;

use super::rates::Rates;
use crate::plan::buffers::block_sum_counts;
use crate::timings::{Clock, Spread, Timings};

/// What a pass cannot do without, whatever the code: the bytes that move when every record is read and written once and
/// nothing is kept from one dispatch to the next, and the arithmetic of its formulas. Atomics, order of access and
/// divergence cost more, and are what the fraction of the limit shows.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub(crate) struct Cost {
    pub bytes: f64,
    /// Sums, products and comparisons of floats; quotients, roots and angles count as [`SLOW_OPERATION`] each.
    pub float_operations: f64,
    /// Products of 32-bit integers to 64 bits.
    pub integer_products: f64,
}

/// Of a record.
pub(crate) fn bytes<T>() -> f64 {
    size_of::<T>() as f64
}

/// Of a prefix sum: down its levels and up again.
pub(crate) fn scan_dispatches(items: u32, group_size: u32) -> f64 {
    2.0 * block_sum_counts(u64::from(items) + 1, group_size).len() as f64 - 1.0
}

/// Sums and products that a quotient, a root or an angle is made of, roughly.
pub(crate) const SLOW_OPERATION: f64 = 8.0;

impl Add for Cost {
    type Output = Cost;

    fn add(self, other: Cost) -> Cost {
        Cost {
            bytes: self.bytes + other.bytes,
            float_operations: self.float_operations + other.float_operations,
            integer_products: self.integer_products + other.integer_products,
        }
    }
}

/// What bounds a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Bound {
    Bytes,
    Floats,
    Integers,
    Launches,
}

/// The roofline (Williams, Waterman and Patterson 2009): the least time that the scarcest of a device's means allows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Limit {
    pub ms: f64,
    pub by: Bound,
}

impl Cost {
    /// By the best rates that were measured: a device that was disturbed can do no less for it. `dispatches` wait for
    /// each other and share the bytes, so that those of each may fit a cache.
    pub(crate) fn limit(&self, dispatches: f64, rates: &Rates) -> Limit {
        let ms = |amount: f64, rate: f64| 1e3 * amount / rate;
        [
            (ms(self.bytes, rates.most_bytes(self.bytes / dispatches)), Bound::Bytes),
            (ms(self.float_operations, rates.float_operations.max), Bound::Floats),
            (ms(self.integer_products, rates.integer_products.max), Bound::Integers),
            (ms(dispatches, rates.dispatches.max), Bound::Launches),
        ]
        .map(|(ms, by)| Limit { ms, by })
        .into_iter()
        .max_by(|a, b| a.ms.total_cmp(&b.ms))
        .expect("there are four")
    }
}

/// What a pass does in a round.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Work {
    /// In the plural.
    pub item: &'static str,
    pub items: f64,
    /// That do it, one after another.
    pub dispatches: f64,
    #[serde(flatten)]
    pub cost: Cost,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Pass {
    pub workload: String,
    /// As the timing table has it, without the round.
    pub name: String,
    /// On the device, of a round.
    pub ms: Spread,
    /// `None` where the work of the pass has not been counted.
    pub work: Option<Work>,
    pub items_per_second: Option<f64>,
    pub bytes_per_second: Option<f64>,
    pub limit: Option<Limit>,
    /// Limit over median time.
    pub fraction: Option<f64>,
}

impl Pass {
    pub(crate) fn new(workload: &str, name: &str, ms: Spread, work: Option<Work>, rates: &Rates) -> Pass {
        let seconds = 1e-3 * ms.median;
        let limit = work.map(|work| work.cost.limit(work.dispatches, rates));
        Pass {
            workload: workload.to_owned(),
            name: name.to_owned(),
            ms,
            items_per_second: work.map(|work| work.items / seconds),
            bytes_per_second: work.map(|work| work.cost.bytes / seconds),
            fraction: limit.map(|limit| limit.ms / ms.median),
            limit,
            work,
        }
    }
}

/// Device milliseconds of every run of every scope, in the order of the runs. A scope that is open when commands are
/// submitted leaves several spans: they are one run, as long as nothing but its parts and what it is a part of ended
/// between them.
fn runs_of(timings: &Timings) -> BTreeMap<&str, Vec<f64>> {
    let is_within = |inner: &str, outer: &str| inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'));
    let mut runs: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut unfinished: Vec<&str> = Vec::new();
    for span in timings.spans().iter().filter(|span| span.clock == Clock::Gpu && span.name.starts_with("round/")) {
        let name = &*span.name;
        let ms = 1e3 * span.duration.as_secs_f64();
        unfinished.retain(|other| is_within(other, name) || is_within(name, other));
        match runs.entry(name).or_default() {
            of_scope if unfinished.contains(&name) => *of_scope.last_mut().expect("it was begun") += ms,
            of_scope => {
                of_scope.push(ms);
                unfinished.push(name);
            }
        }
    }
    runs
}

/// Device milliseconds of each round from number `first` on for every scope within it, in the order of the timing table.
/// Scopes that differ by a number at the end (`bounce 3`) are one.
pub(crate) fn rounds_of(timings: &Timings, rounds: u32, first: u32) -> Vec<(String, Vec<f64>)> {
    let runs = runs_of(timings);
    let mut scopes: Vec<(String, Vec<f64>)> = Vec::new();
    for row in timings.rows() {
        let (Some(path), Some(runs)) = (row.name.strip_prefix("round/"), runs.get(row.name.as_str())) else { continue };
        let name = path.trim_end_matches(|letter: char| letter.is_ascii_digit()).trim_end().to_owned();
        let per_round = if runs.len() % rounds as usize == 0 {
            runs.chunks_exact(runs.len() / rounds as usize).map(|runs| runs.iter().sum()).skip(first as usize).collect()
        } else {
            // Not every round has it: all that is known is the mean.
            vec![runs.iter().sum::<f64>() / f64::from(rounds)]
        };
        match scopes.iter_mut().find(|(known, _)| *known == name) {
            None => scopes.push((name, per_round)),
            Some((_, sums)) if sums.len() == per_round.len() => sums.iter_mut().zip(per_round).for_each(|(sum, ms)| *sum += ms),
            Some((_, sums)) => {
                let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
                *sums = vec![mean(sums) + mean(&per_round)];
            }
        }
    }
    scopes
}

/// Sum of the outermost scopes: all of a round.
pub(crate) fn sum_of_outermost(scopes: &[(String, Vec<f64>)]) -> f64 {
    scopes.iter().filter(|(name, _)| !name.contains('/')).map(|(_, values)| median(values.clone())).sum()
}

/// Not a number for no value at all.
pub(crate) fn median(values: Vec<f64>) -> f64 {
    Spread::of(values).map_or(f64::NAN, |spread| spread.median)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::rates::CopyRate;
    use super::*;
    use crate::timings::Span;

    fn timings(spans: &[(&str, u64)]) -> Timings {
        let mut timings = Timings::default();
        for (name, ms) in spans {
            timings.count(name);
            timings.add(Span { clock: Clock::Gpu, ..Span::of_host(name, Duration::ZERO, Duration::from_millis(*ms)) });
        }
        timings
    }

    #[test]
    fn scopes_are_taken_round_by_round() {
        let spans = [("round/build/bounce 1", 1), ("round/build/bounce 2", 2), ("round/build", 4), ("round/gather", 7), ("round", 11)];
        let later = spans.map(|(name, ms)| (name, 10 * ms));
        let found = rounds_of(&timings(&[spans, later].concat()), 2, 0);
        let expected = [("build/bounce", vec![3.0, 30.0]), ("build", vec![4.0, 40.0]), ("gather", vec![7.0, 70.0])];
        assert_eq!(found, expected.map(|(name, ms)| (name.to_owned(), ms)));
        assert_eq!(sum_of_outermost(&found), 22.0 + 38.5);
        assert_eq!(rounds_of(&timings(&[spans, later].concat()), 2, 1)[1].1, [40.0]);
        // Commands were submitted in the second round's gather, and in the first round's second bounce.
        let cut = [
            ("round/build/bounce 1", 1),
            ("round/build/bounce 2", 1),
            ("round/build", 2),
            ("round", 2),
            ("round/build/bounce 2", 3),
            ("round/build", 3),
            ("round/gather", 4),
            ("round", 7),
            ("round/build/bounce 1", 1),
            ("round/build/bounce 2", 1),
            ("round/build", 2),
            ("round/gather", 5),
            ("round", 7),
            ("round/gather", 6),
            ("round", 6),
        ];
        let expected = [("build/bounce", vec![5.0, 2.0]), ("build", vec![5.0, 2.0]), ("gather", vec![4.0, 11.0])];
        assert_eq!(rounds_of(&timings(&cut), 2, 0), expected.map(|(name, ms)| (name.to_owned(), ms)));
        // Of two rounds, one has no film.
        let partly = rounds_of(&timings(&[("round/gather", 6), ("round/film", 1), ("round/gather", 5)]), 2, 0);
        assert_eq!(partly[1], ("film".to_owned(), vec![0.5]));
    }

    #[test]
    fn the_scarcest_means_bounds() {
        let spread = |median: f64| Spread { median, min: median, max: median, repeats: 1 };
        let rates = Rates {
            dispatches: spread(1e5),
            copies: [(1 << 32, 1e12), (1 << 28, 2e12), (1 << 20, 1e11)]
                .map(|(moved_bytes, rate)| CopyRate { moved_bytes, rate: spread(rate) }),
            float_operations: spread(1e13),
            integer_products: spread(1e12),
            random_reads: spread(1.0),
            spread_atomics: spread(1.0),
            single_atomics: spread(1.0),
            counter_additions: spread(1.0),
        };
        // What fits a cache may go faster; a copy that is all launch says nothing.
        assert_eq!([1e3, 1e8, 1e9, 1e12].map(|moved| rates.most_bytes(moved)), [2e12, 2e12, 1e12, 1e12]);
        let cost = Cost { bytes: 2e9, float_operations: 1e9, integer_products: 1e9 };
        assert_eq!(cost.limit(1.0, &rates), Limit { ms: 2.0, by: Bound::Bytes });
        assert_eq!(Cost { bytes: 0.0, ..cost }.limit(1.0, &rates), Limit { ms: 1.0, by: Bound::Integers });
        assert_eq!(cost.limit(1000.0, &rates), Limit { ms: 10.0, by: Bound::Launches });
        let pass = Pass::new("w", "p", spread(8.0), Some(Work { item: "events", items: 1e6, dispatches: 1.0, cost }), &rates);
        assert_eq!((pass.fraction, pass.items_per_second, pass.bytes_per_second), (Some(0.25), Some(1.25e8), Some(2.5e11)));
    }
}
