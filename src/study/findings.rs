//! What the points say: the price of an error, what each choice buys or costs, the Pareto front, tables, CSV.

use super::axes::Axis;
use super::point::{CONFIDENCE, Curve, Estimate, Point};
use super::{Comparison, Part, Study};
use crate::output::words::{count, duration, number};
use crate::paper::published;

/// Relative errors that people ask for, the largest first.
pub const ASKED: [f64; 10] = [0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0005];

pub fn percent(share: f64) -> String {
    format!("{}\u{a0}%", number(100.0 * share))
}

/// 'from a to b', or that nothing is known.
fn between(estimate: Estimate, show: impl Fn(f64) -> String) -> String {
    if estimate.high.is_finite() && estimate.low > 0.0 {
        format!("{} to {}", show(estimate.low), show(estimate.high))
    } else {
        "unknown from so few runs".to_owned()
    }
}

impl Part {
    /// What the others are compared with, as it was measured first.
    pub fn base(&self) -> Option<&Curve> {
        self.comparisons.first().and_then(Comparison::base)
    }

    pub fn curves(&self) -> impl Iterator<Item = &Curve> {
        self.comparisons.iter().flat_map(|comparison| &comparison.curves)
    }

    /// Points that no other beats in both error and time, the fastest first.
    pub fn pareto_front(&self) -> Vec<(&Curve, &Point)> {
        let mut all: Vec<(&Curve, &Point)> = self.curves().flat_map(|curve| curve.points.iter().map(move |point| (curve, point))).collect();
        all.sort_by(|(_, a), (_, b)| a.ms().value.total_cmp(&b.ms().value));
        let mut best = f64::INFINITY;
        all.retain(|(_, point)| {
            let better = point.error().value < best;
            best = best.min(point.error().value);
            better
        });
        all
    }

    /// Sentences made of this part's numbers, the most asked for first.
    pub fn sentences(&self) -> Vec<String> {
        let Some(base) = self.base() else { return Vec::new() };
        let mut sentences: Vec<String> = [price(base), halving(base), law(base)].into_iter().flatten().collect();
        for comparison in &self.comparisons {
            let Some(base) = comparison.base() else { continue };
            sentences.extend(comparison.others().filter_map(|curve| choice(comparison.axis, curve, base)));
            let left_out =
                |curve: &Curve| Some(format!("{}: {} was left out: {}.", comparison.axis.name(), curve.label, curve.left_out.as_ref()?));
            sentences.extend(comparison.curves.iter().filter_map(left_out));
        }
        for comparison in &self.comparisons {
            // The paper's rounds are all compared with the law of noise, not with each other alone.
            let curves = comparison.curves.iter().skip(usize::from(comparison.axis != Axis::Paper));
            sentences.extend(curves.filter_map(|curve| floor(comparison.axis, curve)));
        }
        for comparison in self.comparisons.iter().filter(|comparison| comparison.axis == Axis::Bounces) {
            sentences.extend(comparison.curves.iter().filter_map(lost));
        }
        if self.comparisons.iter().any(|comparison| comparison.axis == Axis::Paper) {
            sentences.extend(then_and_now(base));
        }
        sentences
    }
}

impl Comparison {
    pub fn base(&self) -> Option<&Curve> {
        self.curves.first().filter(|curve| !curve.points.is_empty())
    }

    pub fn others(&self) -> impl Iterator<Item = &Curve> {
        self.curves.iter().skip(1).filter(|curve| !curve.points.is_empty())
    }
}

/// The smallest error that all runs of two curves reach on their way, else that their means do.
fn common_error(one: &Curve, other: &Curve) -> Option<f64> {
    let mut steps = (0..200).map(|step| 1e-5 * 1.08f64.powi(step));
    steps
        .clone()
        .find(|error| one.crosses(*error) && other.crosses(*error))
        .or_else(|| steps.find(|error| one.time_to(*error).is_some() && other.time_to(*error).is_some()))
}

/// Ends of an interval as far apart as that tell nothing.
const NOT_TOLD_APART: f64 = 1.2;

/// Clocks of shared machines drift by more than this.
const NEXT_TO_NOTHING: f64 = 1.02;

/// What a choice buys or costs against the base.
fn choice(axis: Axis, curve: &Curve, base: &Curve) -> Option<String> {
    let name = format!("{}: {}", axis.name(), curve.label);
    let Some(error) = common_error(curve, base) else {
        let reach = |curve: &Curve| format!("{} after {}", percent(curve.best_error()), duration(curve.longest()));
        return Some(format!("{name} reaches {}, the base {}: they share no error that both crossed.", reach(curve), reach(base)));
    };
    let longer = curve.times_longer(base, error)?;
    let (at, interval) = (percent(error), between(longer, ratio));
    Some(if longer.low > 1.0 && longer.value > NEXT_TO_NOTHING {
        format!("{name} costs {} the time to {at} ({interval}).", ratio(longer.value))
    } else if longer.high < 1.0 && longer.value < 1.0 / NEXT_TO_NOTHING {
        let faster = Estimate { value: 1.0 / longer.value, low: 1.0 / longer.high, high: 1.0 / longer.low };
        format!("{name} buys {}: it is so much faster to {at} ({}).", ratio(faster.value), between(faster, ratio))
    } else if longer.low > 0.0 && longer.high < NOT_TOLD_APART * longer.low {
        format!("{name} makes no difference worth its name to {at} ({} the time, {interval}).", ratio(longer.value))
    } else {
        format!("{name} cannot be told from the base by these runs: {} the time to {at} ({interval}).", ratio(longer.value))
    })
}

fn ratio(value: f64) -> String {
    format!("{}\u{a0}\u{d7}", number(value))
}

/// Times to the errors that people ask for.
fn price(base: &Curve) -> Option<String> {
    let prices: Vec<String> = ASKED
        .into_iter()
        .filter_map(|error| {
            Some(format!("{} takes {} ({})", percent(error), duration(base.time_to(error)?.value), between(base.time_to(error)?, duration)))
        })
        .collect();
    if prices.is_empty() { None } else { Some(format!("A relative RMS error of {}.", prices.join(", "))) }
}

/// The cost of half the error, where it was measured at the smallest errors.
fn halving(base: &Curve) -> Option<String> {
    let error = ASKED.into_iter().rev().find(|error| base.time_to(*error).is_some() && base.time_to(0.5 * error).is_some())?;
    let (whole, half) = (base.time_to(error)?, base.time_to(0.5 * error)?);
    Some(format!("Halving the error from {} costs {} the time.", percent(error), ratio(half.value / whole.value)))
}

/// The law of noise.
fn law(base: &Curve) -> Option<String> {
    let slope = base.noise_slope()?;
    Some(format!(
        "Where noise is the error, it falls with the photons to the power {slope:.2}; at a fixed radius independent photons make -0.50, and a radius that shrinks slows that."
    ))
}

/// Where bias ends the fall of the error.
fn floor(axis: Axis, curve: &Curve) -> Option<String> {
    let last = curve.points.last()?;
    let bias = last.bias();
    (bias.low > last.noise()).then(|| {
        format!(
            "{}: {} ends at {} after {}, of which {} is bias ({}) that no more photons take away.",
            axis.name(),
            curve.label,
            percent(last.error().value),
            duration(last.ms().value),
            percent(bias.value),
            between(bias, percent)
        )
    })
}

/// What a cap on bounces leaves out.
fn lost(curve: &Curve) -> Option<String> {
    let last = curve.points.last()?;
    Some(format!("bounces: {} ends with {} of the photons still flying; their light is lost.", curve.label, percent(last.cut_off)))
}

/// Table 1's last row, and its time, on this device.
fn then_and_now(base: &Curve) -> Vec<String> {
    let (Some((rounds, then)), Some(last)) = (published::TABLE_1.last(), base.points.last()) else { return Vec::new() };
    let photons = u64::from(rounds * published::PHOTONS);
    let rate = last.photons as f64 / last.ms().value;
    let mut sentences = vec![format!(
        "2008 took {} for {} photons; at the {} photons a second measured here the same time buys {} photons.",
        duration(*then),
        count(photons),
        number(1000.0 * rate),
        number(rate * then)
    )];
    let ms = base.points.windows(2).find(|pair| pair[0].photons <= photons && photons <= pair[1].photons).map(|pair| {
        let share = (photons as f64 / pair[0].photons as f64).ln() / (pair[1].photons as f64 / pair[0].photons as f64).ln();
        pair[0].ms().value * (pair[1].ms().value / pair[0].ms().value).powf(share)
    });
    if let Some(ms) = ms {
        let error = base.error_after(ms).map_or_else(String::new, |error| format!(", with an error of {}", percent(error.value)));
        sentences.push(format!("Those {} photons take {} here, {} less{error}.", count(photons), duration(ms), ratio(then / ms)));
    }
    sentences
}

/// A row of the tables of equal time and equal error: name, value, and the value over that of the base beside it.
pub type Row = (String, Option<Estimate>, Option<f64>);

/// All curves and, in every comparison, what `value` says of them; the base stands first, once.
fn rows(part: &Part, value: impl Fn(&Curve) -> Option<Estimate>) -> Vec<Row> {
    let mut rows: Vec<Row> = part.base().map(|base| (format!("base: {}", base.label), value(base), None)).into_iter().collect();
    for comparison in &part.comparisons {
        let of_base = comparison.base().and_then(&value);
        rows.extend(comparison.others().map(|curve| {
            let own = value(curve);
            (format!("{}: {}", comparison.axis.name(), curve.label), own, own.zip(of_base).map(|(own, base)| own.value / base.value))
        }));
    }
    rows
}

/// Errors after the longest time that half of all curves were measured at.
pub fn equal_time(part: &Part) -> Option<(f64, Vec<Row>)> {
    let mut longest: Vec<f64> = part.curves().filter(|curve| !curve.points.is_empty()).map(Curve::longest).collect();
    longest.sort_by(f64::total_cmp);
    let ms = longest.get(longest.len() / 2)?.min(part.base()?.longest());
    Some((ms, rows(part, |curve| curve.error_after(ms))))
}

/// Times to the smallest error that half of all curves reach.
pub fn equal_error(part: &Part) -> Option<(f64, Vec<Row>)> {
    let base = part.base()?;
    let reach = |error: f64| part.curves().filter(|curve| curve.time_to(error).is_some()).count();
    let error = ASKED.into_iter().rev().find(|error| base.time_to(*error).is_some() && 2 * reach(*error) >= part.curves().count())?;
    Some((error, rows(part, |curve| curve.time_to(error))))
}

const COLUMNS: [&str; 18] = [
    "quantity",
    "axis",
    "configuration",
    "rounds",
    "photons",
    "runs",
    "ms",
    "ms_least",
    "ms_most",
    "clock",
    "wall_ms",
    "error",
    "error_low",
    "error_high",
    "noise",
    "bias",
    "cut_off",
    "command",
];

/// Every point; errors are relative.
pub fn csv(study: &Study) -> Vec<u8> {
    let mut table = csv::Writer::from_writer(Vec::new());
    let mut write = |row: &[String]| table.write_record(row).expect("memory takes what is written");
    write(&COLUMNS.map(str::to_owned));
    for part in &study.parts {
        for (axis, curve) in part.comparisons.iter().flat_map(|one| one.curves.iter().map(|curve| (one.axis, curve))) {
            for point in &curve.points {
                let (ms, error) = (point.ms(), point.error());
                let known = |value: f64| if value.is_finite() { value.to_string() } else { String::new() };
                write(&[
                    part.quantity.clone(),
                    axis.name().to_owned(),
                    curve.label.clone(),
                    point.rounds.to_string(),
                    point.photons.to_string(),
                    point.squared_errors.len().to_string(),
                    ms.value.to_string(),
                    ms.low.to_string(),
                    ms.high.to_string(),
                    clock(point).to_owned(),
                    point.wall().to_string(),
                    error.value.to_string(),
                    known(error.low),
                    known(error.high),
                    point.noise().to_string(),
                    point.bias().value.to_string(),
                    point.cut_off.to_string(),
                    point.command.clone(),
                ]);
            }
        }
    }
    table.into_inner().expect("memory takes what is written")
}

pub fn clock(point: &Point) -> &'static str {
    if point.gpu_ms.iter().all(Option::is_some) { "gpu" } else { "wall" }
}

/// What intervals are.
pub fn words_of_confidence() -> String {
    format!("{} %", 100.0 * CONFIDENCE)
}
