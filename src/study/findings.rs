//! What the points say: the price of an error, what each choice buys or costs, the Pareto front, tables, CSV.

use super::axes::Axis;
use super::point::{CONFIDENCE, Curve, Estimate, Point};
use super::{Part, Study};
use crate::output::words::{count, duration, number, times};
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
    /// What the others are compared with.
    pub fn base(&self) -> Option<&Curve> {
        self.curves.iter().find(|curve| curve.is_base && !curve.points.is_empty())
    }

    pub fn axes(&self) -> Vec<Axis> {
        let mut axes: Vec<Axis> = self.curves.iter().filter(|curve| !curve.is_base).map(|curve| curve.axis).collect();
        axes.dedup();
        axes
    }

    /// The base and the curves along an axis.
    pub fn along(&self, axis: Axis) -> Vec<&Curve> {
        self.curves.iter().filter(|curve| !curve.points.is_empty() && (curve.is_base || curve.axis == axis)).collect()
    }

    /// Points that no other beats in both error and time, the fastest first.
    pub fn pareto_front(&self) -> Vec<(&Curve, &Point)> {
        let mut all: Vec<(&Curve, &Point)> = self.curves.iter().flat_map(|curve| curve.points.iter().map(move |point| (curve, point))).collect();
        all.sort_by(|(_, a), (_, b)| a.ms().value.total_cmp(&b.ms().value));
        let mut best = f64::INFINITY;
        all.retain(|(_, point)| {
            let better = point.error().value < best;
            best = best.min(point.error().value);
            better
        });
        all
    }

    /// The smallest asked error that two curves both reach.
    fn common_error(one: &Curve, other: &Curve) -> Option<f64> {
        ASKED.into_iter().rev().find(|error| one.time_to(*error).is_some() && other.time_to(*error).is_some())
    }

    /// Sentences made of this part's numbers, the most asked for first.
    pub fn sentences(&self) -> Vec<String> {
        let Some(base) = self.base() else { return Vec::new() };
        let mut sentences: Vec<String> = [price(base), halving(base), law(base)].into_iter().flatten().collect();
        sentences.extend(self.curves.iter().filter(|curve| !curve.is_base).filter_map(|curve| Part::choice(curve, base)));
        sentences.extend(self.curves.iter().filter_map(floor));
        sentences.extend(self.curves.iter().filter(|curve| curve.axis == Axis::Bounces || curve.is_base).filter_map(lost));
        if self.curves.iter().any(|curve| curve.axis == Axis::Paper) {
            sentences.extend(then_and_now(base));
        }
        sentences
    }

    /// What a choice buys or costs against the base.
    fn choice(curve: &Curve, base: &Curve) -> Option<String> {
        let name = format!("{}: {}", curve.axis.name(), curve.label);
        let Some(error) = Part::common_error(curve, base) else {
            let reached = (!curve.points.is_empty()).then(|| percent(curve.best_error()))?;
            return Some(format!(
                "{name} shares no error with the base that both were measured at; its smallest is {reached} after {}.",
                duration(curve.longest())
            ));
        };
        let longer = curve.times_longer(base, error)?;
        let (at, interval) = (percent(error), between(longer, times));
        Some(if longer.low > 1.0 {
            format!("{name} costs {} the time to {at} ({interval}).", times(longer.value))
        } else if longer.high < 1.0 {
            let faster = Estimate { value: 1.0 / longer.value, low: 1.0 / longer.high, high: 1.0 / longer.low };
            format!("{name} buys {} to {at} ({}).", times(faster.value), between(faster, times))
        } else {
            format!("{name} makes no difference to {at} that these runs could tell ({} the time, {interval}).", times(longer.value))
        })
    }
}

/// Times to the errors that people ask for.
fn price(base: &Curve) -> Option<String> {
    let prices: Vec<String> = ASKED
        .into_iter()
        .filter_map(|error| Some(format!("{} takes {} ({})", percent(error), duration(base.time_to(error)?.value), between(base.time_to(error)?, duration))))
        .collect();
    if prices.is_empty() { None } else { Some(format!("A relative RMS error of {}.", prices.join(", "))) }
}

/// The cost of half the error, where it was measured at the smallest errors.
fn halving(base: &Curve) -> Option<String> {
    let error = ASKED.into_iter().rev().find(|error| base.time_to(*error).is_some() && base.time_to(0.5 * error).is_some())?;
    let (whole, half) = (base.time_to(error)?, base.time_to(0.5 * error)?);
    Some(format!("Halving the error from {} costs {} the time.", percent(error), times(half.value / whole.value)))
}

/// The law of noise.
fn law(base: &Curve) -> Option<String> {
    let slope = base.noise_slope()?;
    Some(format!("Where noise is the error, it falls with the photons to the power {slope:.2}; independent photons make -0.50."))
}

/// Where bias ends the fall of the error.
fn floor(curve: &Curve) -> Option<String> {
    let last = curve.points.last()?;
    let bias = last.bias();
    (bias.low > last.noise()).then(|| {
        format!(
            "{}: {} ends at {} after {}, of which {} is bias ({}) that no more photons take away.",
            curve.axis.name(),
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
        let error = base.error_after(ms).map_or_else(String::new, |error| format!(", with an error of {}", percent(error)));
        sentences.push(format!("Those {} photons take {} here, {} less{error}.", count(photons), duration(ms), times(then / ms)));
    }
    sentences
}

/// A row of the tables of equal time and equal error: a curve, its value, and the value over the base's.
pub type Row<'a> = (&'a Curve, Option<Estimate>, Option<f64>);

/// Errors after the longest time that half of all curves were measured at.
pub fn equal_time(part: &Part) -> Option<(f64, Vec<Row<'_>>)> {
    let base = part.base()?;
    let mut longest: Vec<f64> = part.curves.iter().filter(|curve| !curve.points.is_empty()).map(Curve::longest).collect();
    longest.sort_by(f64::total_cmp);
    let ms = longest[longest.len() / 2].min(base.longest());
    let value = |curve: &Curve| curve.error_after(ms);
    let of_base = value(base);
    let rows = part.curves.iter().map(|curve| {
        let error = value(curve);
        (curve, error.map(|value| Estimate { value, low: value, high: value }), error.zip(of_base).map(|(error, base)| error / base))
    });
    Some((ms, rows.collect()))
}

/// Times to the smallest asked error that half of all curves reach.
pub fn equal_error(part: &Part) -> Option<(f64, Vec<Row<'_>>)> {
    let base = part.base()?;
    let reach = |error: f64| part.curves.iter().filter(|curve| curve.time_to(error).is_some()).count();
    let error = ASKED.into_iter().rev().find(|error| base.time_to(*error).is_some() && 2 * reach(*error) >= part.curves.len())?;
    let of_base = base.time_to(error)?.value;
    let rows = part.curves.iter().map(|curve| {
        let time = curve.time_to(error);
        (curve, time, time.map(|time| time.value / of_base))
    });
    Some((error, rows.collect()))
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
        for curve in &part.curves {
            for point in &curve.points {
                let (ms, error) = (point.ms(), point.error());
                let known = |value: f64| if value.is_finite() { value.to_string() } else { String::new() };
                write(&[
                    part.quantity.clone(),
                    curve.axis.name().to_owned(),
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
