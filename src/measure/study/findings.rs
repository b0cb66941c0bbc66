//! Conclusions from the points: time to reach an error, cost and gain of each option, the Pareto front, tables, CSV.

use super::axes::Axis;
use super::point::{Curve, Point};
use super::{Comparison, Part, Study};
use crate::measure::interval::{CONFIDENCE, Interval};
use crate::measure::paper::published;
use crate::output::csv_table::{Column, csv_table};
use crate::output::words::{count, duration, number};
use crate::text::{counted, percent};

/// Relative errors that people ask for, the largest first.
const ASKED: [f64; 10] = [0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0005];

/// 'from a to b', or that nothing is known.
pub(crate) fn between(estimate: Interval, show: impl Fn(f64) -> String) -> String {
    // Beyond that it is no knowledge.
    if estimate.low > 0.0 && estimate.high < 100.0 * estimate.low {
        format!("{} to {}", show(estimate.low), show(estimate.high))
    } else {
        "interval unknown: too few runs".to_owned()
    }
}

impl Part {
    /// What the others are compared with: of the comparisons that it was measured in, the one that took it furthest.
    pub(crate) fn base(&self) -> Option<&Curve> {
        let mut bases = self.comparisons.iter().filter_map(Comparison::base);
        let first = bases.next()?;
        let further = |best: &'_ Curve, next: &'_ Curve| next.label == best.label && next.points.len() > best.points.len();
        Some(bases.fold(first, |best, next| if further(best, next) { next } else { best }))
    }

    pub(crate) fn curves(&self) -> impl Iterator<Item = (Axis, &Curve)> {
        let of_default = self.default.iter().map(|curve| (Axis::Default, curve));
        of_default.chain(self.comparisons.iter().flat_map(|comparison| comparison.curves.iter().map(|curve| (comparison.axis, curve))))
    }

    pub(crate) fn points(&self) -> impl Iterator<Item = (&Curve, &Point)> {
        self.curves().flat_map(|(_, curve)| curve.points.iter().map(move |point| (curve, point)))
    }

    /// Points that no other beats in both error and time, the fastest first.
    pub(crate) fn pareto_front(&self) -> Vec<(&Curve, &Point)> {
        let mut all: Vec<(&Curve, &Point)> = self.points().collect();
        all.sort_by(|(_, a), (_, b)| a.ms().value.total_cmp(&b.ms().value));
        let mut best = f64::INFINITY;
        all.retain(|(_, point)| {
            let better = point.error().value < best;
            best = best.min(point.error().value);
            better
        });
        all
    }

    /// What each choice changes, in the order of the axes.
    pub(crate) fn choices(&self) -> Vec<Choice<'_>> {
        let count: usize = self.comparisons.iter().map(|comparison| comparison.others().count()).sum();
        // So that all of them together are as sure as one.
        let confidence = 1.0 - (1.0 - CONFIDENCE) / count.max(1) as f64;
        let least = self.least_error;
        let mut choices = Vec::with_capacity(count);
        for comparison in &self.comparisons {
            if let Some(base) = comparison.base() {
                let effect = |curve| effect(curve, base, least, confidence);
                choices.extend(comparison.others().map(|curve| Choice { axis: comparison.axis, curve, effect: effect(curve) }));
            }
        }
        choices
    }

    /// The choice that saves most time for the same error, by as much as is certain.
    pub(crate) fn best_choice(&self) -> Option<Choice<'_>> {
        let faster = self.choices().into_iter().filter_map(|choice| Some((choice.effect.certain_gain()?, choice)));
        faster.min_by(|one, other| one.0.total_cmp(&other.0)).map(|(_, choice)| choice)
    }

    /// A sentence for each choice that was left out.
    pub(crate) fn not_measured(&self) -> Vec<String> {
        let sentence =
            |(axis, curve): (_, &Curve)| Some(format!("{} was not measured: {}.", named(axis, &curve.label), curve.left_out.as_ref()?));
        self.curves().filter_map(sentence).collect()
    }

    /// Sentences made of this part's numbers, the most asked for first.
    pub(crate) fn sentences(&self) -> Vec<String> {
        let Some(base) = self.base() else { return Vec::new() };
        let least = self.least_error;
        let mut sentences: Vec<String> =
            [price(base, least), halving(base, least), law("the base", base, least), floor("the base", base, least)]
                .into_iter()
                .flatten()
                .collect();
        let (mut undecided, mut single) = (Vec::new(), Vec::new());
        for choice in self.choices() {
            match choice.effect {
                Effect::Differs(..) | Effect::Apart(..) => sentences.push(choice.sentence()),
                Effect::Undecided(..) => undecided.push(choice.sentence()),
                Effect::SinglePoint => single.push(choice.sentence()),
            }
        }
        sentences.extend(self.not_measured());
        if !undecided.is_empty() {
            sentences.push(format!("Not significantly faster or slower than the base: {}.", undecided.join("; ")));
        }
        if !single.is_empty() {
            sentences.push(format!("Not compared, because the budget allowed a single point only: {}.", single.join("; ")));
        }
        for comparison in &self.comparisons {
            let Some(base) = comparison.base() else { continue };
            let of_base = base.points.last().map_or(0.0, |last| last.bias().high);
            // What differs from the base in nothing but time has its bias too.
            sentences.extend(
                comparison.others().filter_map(|curve| floor(&named(comparison.axis, &curve.label), curve, least.max(1.2 * of_base))),
            );
        }
        for comparison in self.comparisons.iter().filter(|comparison| comparison.axis == Axis::Bounces) {
            sentences.extend(comparison.curves.iter().filter_map(lost));
        }
        for comparison in self.comparisons.iter().filter(|comparison| comparison.axis == Axis::Paper) {
            sentences.extend(comparison.others().filter_map(|curve| law(&curve.label, curve, least)));
            sentences.extend(then_and_now(base));
        }
        sentences
    }
}

impl Comparison {
    pub(crate) fn base(&self) -> Option<&Curve> {
        self.curves.first().filter(|curve| !curve.points.is_empty())
    }

    pub(crate) fn others(&self) -> impl Iterator<Item = &Curve> {
        self.curves.iter().skip(1).filter(|curve| !curve.points.is_empty())
    }
}

/// Errors from `least` on, close together.
fn steps(least: f64) -> impl Iterator<Item = f64> + Clone {
    (0..160).map(move |step| least.max(1e-5) * 1.08f64.powi(step))
}

/// The smallest error that all runs of two curves reach on their way, else that their means do.
pub(crate) fn common_error(one: &Curve, other: &Curve, least: f64) -> Option<f64> {
    let by_means = |error: &f64| one.time_to(*error).is_some() && other.time_to(*error).is_some();
    steps(least).find(|error| one.crosses(*error) && other.crosses(*error)).or_else(|| steps(least).find(by_means))
}

/// Clocks of shared machines drift by more than this.
const NEXT_TO_NOTHING: f64 = 1.02;

/// What a choice changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Effect {
    /// The time to this error over the base's, and that it is significantly more or less.
    Differs(f64, Interval),
    Undecided(f64, Interval),
    /// The best errors that it and the base reach, and after how many milliseconds: the two have no error in common.
    Apart([(f64, f64); 2]),
    /// The budget allowed one point, which compares nothing.
    SinglePoint,
}

impl Effect {
    /// Time to the same error over the base's, at most, where that is less; where the two have no error in common, as the noise of both would
    /// fall with the root of the time.
    fn certain_gain(self) -> Option<f64> {
        match self {
            Effect::Differs(_, longer) if longer.value < 1.0 => Some(longer.high),
            Effect::Apart([own, base]) if own.0 < base.0 => Some((own.0 / base.0).powi(2) * own.1 / base.1),
            _ => None,
        }
    }

    /// From what buys most to what noise hides.
    pub(crate) fn rank(self) -> (u32, f64) {
        match self {
            Effect::Apart([own, base]) if own.0 < base.0 => (0, own.0 / base.0),
            Effect::Differs(_, longer) => (1, longer.value),
            Effect::Apart([own, base]) => (2, own.0 / base.0),
            Effect::Undecided(_, longer) => (3, longer.value),
            Effect::SinglePoint => (4, 0.0),
        }
    }
}

/// A choice and its effect.
pub(crate) struct Choice<'a> {
    pub axis: Axis,
    pub curve: &'a Curve,
    pub effect: Effect,
}

impl Choice<'_> {
    pub(crate) fn name(&self) -> String {
        named(self.axis, &self.curve.label)
    }

    fn sentence(&self) -> String {
        let name = self.name();
        let (error, longer) = match self.effect {
            Effect::Apart([own, base]) => {
                let reach = |(error, ms): (f64, f64)| format!("{} after {}", percent(error), duration(ms));
                return format!("{name} reaches {}, the base {}; the two ranges of error do not overlap.", reach(own), reach(base));
            }
            Effect::SinglePoint => return name,
            Effect::Differs(error, longer) | Effect::Undecided(error, longer) => (percent(error), longer),
        };
        let faster = Interval { value: 1.0 / longer.value, low: 1.0 / longer.high, high: 1.0 / longer.low };
        match self.effect {
            Effect::Undecided(..) => format!("{name} takes {} as long to reach {error} ({})", ratio(longer.value), between(longer, ratio)),
            _ if longer.value > 1.0 => {
                format!("{name} takes {} as long as the base to reach {error} ({}).", ratio(longer.value), between(longer, ratio))
            }
            _ => format!("{name} is {} as fast as the base in reaching {error} ({}).", ratio(faster.value), between(faster, ratio)),
        }
    }
}

/// A configuration with its axis, unless its label names that already.
pub(crate) fn named(axis: Axis, label: &str) -> String {
    if label.contains(axis.name()) { label.to_owned() } else { format!("{}: {label}", axis.name()) }
}

/// How much faster or slower a choice is than the base.
fn effect(curve: &Curve, base: &Curve, least: f64, confidence: f64) -> Effect {
    if curve.points.len() < 2 || base.points.len() < 2 {
        return Effect::SinglePoint;
    }
    let Some((error, longer)) =
        common_error(curve, base, least).and_then(|error| Some((error, curve.times_longer(base, error, confidence)?)))
    else {
        return Effect::Apart([curve, base].map(|curve| (curve.best_error(), curve.longest())));
    };
    let is_slower = longer.low > 1.0 && longer.value > NEXT_TO_NOTHING;
    let is_faster = longer.high < 1.0 && longer.value < 1.0 / NEXT_TO_NOTHING;
    if is_slower || is_faster { Effect::Differs(error, longer) } else { Effect::Undecided(error, longer) }
}

pub(crate) fn ratio(value: f64) -> String {
    format!("{}\u{a0}\u{d7}", number(value))
}

/// Times to the errors that people ask for.
fn price(base: &Curve, least: f64) -> Option<String> {
    let prices: Vec<String> = ASKED
        .into_iter()
        .filter(|error| *error >= least)
        .filter_map(|error| {
            Some(format!("{} in {} ({})", percent(error), duration(base.time_to(error)?.value), between(base.time_to(error)?, duration)))
        })
        .collect();
    if prices.is_empty() { None } else { Some(format!("The base reaches a relative RMS error of {}.", prices.join(", "))) }
}

/// The cost of half the error, where it was measured at the smallest errors.
fn halving(base: &Curve, least: f64) -> Option<String> {
    let error = steps(2.0 * least).find(|error| base.crosses(*error) && base.crosses(0.5 * error))?;
    let cost = base.halving(error)?;
    Some(format!("Halving the error from {} takes {} the time ({}).", percent(error), ratio(cost.value), between(cost, ratio)))
}

/// The law of noise.
fn law(name: &str, curve: &Curve, least: f64) -> Option<String> {
    let slope = curve.noise_slope(least)?;
    Some(format!(
        "The noise of {name} falls as the number of photons to the power {slope:.2}. Independent photons give -0.50 at a fixed radius; a shrinking radius gives a slower fall."
    ))
}

/// Where bias ends the fall of the error.
fn floor(name: &str, curve: &Curve, least: f64) -> Option<String> {
    let last = curve.points.last()?;
    let bias = last.bias();
    // Noise falls with the root of the rounds.
    let rounds = f64::from(last.rounds) * (last.noise() / bias.value).powi(2);
    (bias.low > least && bias.low > 0.5 * last.noise()).then(|| {
        format!(
            "{name}: an error of {} after {}, with a bias of {} ({}); noise is below this bias from round {} on.",
            percent(last.error().value),
            counted(last.rounds, "round"),
            percent(bias.value),
            between(bias, percent),
            count(rounds.ceil().max(1.0) as u64)
        )
    })
}

/// What a cap on bounces leaves out.
fn lost(curve: &Curve) -> Option<String> {
    let last = curve.points.last().filter(|last| last.cut_off > 0.0)?;
    Some(format!("{}: the bounce limit ends {} of the photons, and their remaining light is lost.", curve.label, percent(last.cut_off)))
}

/// Table 1's last row, and its time, on this device.
fn then_and_now(base: &Curve) -> Vec<String> {
    let (Some((rounds, then)), Some(last)) = (published::TABLE_1.last(), base.points.last()) else { return Vec::new() };
    let photons = u64::from(rounds * published::PHOTONS);
    let rate = last.photons as f64 / last.ms().value;
    let mut sentences = vec![format!(
        "In 2008, {} photons took {}. This device traces {} photons/s, or {} photons in that time.",
        count(photons),
        duration(*then),
        number(1000.0 * rate),
        number(rate * then)
    )];
    if let Some(ms) = base.value_at(photons as f64, |point| point.photons as f64, |point| point.ms().value) {
        let error = base.error_after(ms).map_or_else(String::new, |error| format!(", with an error of {}", percent(error.value)));
        sentences.push(format!("Here {} photons take {}, {} as fast as in 2008{error}.", count(photons), duration(ms), ratio(then / ms)));
    }
    sentences
}

/// A row of the tables of equal time and equal error.
pub(crate) struct Row {
    pub name: String,
    /// The value, or why there is none.
    pub value: Result<Interval, String>,
    /// Over the value of the base that was measured in turn with it.
    pub ratio: Option<f64>,
}

/// All curves and, in every comparison, what `value` says of them; the base stands first, once.
fn rows(part: &Part, value: impl Fn(&Curve) -> Result<Interval, String>) -> Vec<Row> {
    let of_base = |base: &Curve| Row { name: format!("base: {}", base.label), value: value(base), ratio: None };
    let mut rows: Vec<Row> = part.base().map(of_base).into_iter().collect();
    for comparison in &part.comparisons {
        let base = comparison.base().and_then(|base| value(base).ok()).filter(|base| base.value > 0.0);
        rows.extend(comparison.others().map(|curve| {
            let value = value(curve);
            let ratio = value.as_ref().ok().zip(base).map(|(own, base)| own.value / base.value);
            Row { name: named(comparison.axis, &curve.label), value, ratio }
        }));
    }
    rows
}

/// Why a curve has no error after a time.
fn measured_to(curve: &Curve, ms: f64) -> String {
    match (curve.points.first(), curve.points.last()) {
        (Some(first), _) if first.ms().value > ms => {
            format!("first point: {} after {}", percent(first.error().value), duration(first.ms().value))
        }
        (_, Some(last)) => format!("last point: {} after {}", percent(last.error().value), duration(last.ms().value)),
        _ => "not measured".to_owned(),
    }
}

/// Why a curve has no time to an error.
fn beyond(curve: &Curve, error: f64) -> String {
    match curve.points.first() {
        Some(first) if first.error().value <= error => format!("less than {}", duration(first.ms().value)),
        Some(_) => format!("not reached in {}", duration(curve.longest())),
        None => "not measured".to_owned(),
    }
}

/// Errors after the longest time that nine in ten of all curves were measured at.
pub(crate) fn equal_time(part: &Part) -> Option<(f64, Vec<Row>)> {
    let mut longest: Vec<f64> = part.curves().map(|(_, curve)| curve).filter(|curve| curve.points.len() > 1).map(Curve::longest).collect();
    longest.sort_by(f64::total_cmp);
    let ms = longest.get(longest.len() / 10)?.min(part.base()?.longest());
    Some((ms, rows(part, |curve| curve.error_after(ms).ok_or_else(|| measured_to(curve, ms)))))
}

/// Times to the smallest error that half of all curves reach.
pub(crate) fn equal_error(part: &Part) -> Option<(f64, Vec<Row>)> {
    let base = part.base()?;
    let reach = |error: f64| part.curves().filter(|(_, curve)| curve.time_to(error).is_some()).count();
    let most = part.curves().count();
    let error = steps(part.least_error).find(|error| base.time_to(*error).is_some() && 2 * reach(*error) >= most)?;
    Some((error, rows(part, |curve| curve.time_to(error).ok_or_else(|| beyond(curve, error)))))
}

/// Every point; errors are relative.
pub(crate) fn csv(study: &Study) -> Vec<u8> {
    struct Row<'a> {
        part: &'a Part,
        axis: Axis,
        curve: &'a Curve,
        point: &'a Point,
        seed: u64,
    }
    fn known(value: f64) -> String {
        if value.is_finite() { value.to_string() } else { String::new() }
    }
    let columns: [Column<Row>; 21] = [
        ("quantity", |row| row.part.quantity.clone()),
        ("axis", |row| row.axis.name().to_owned()),
        ("configuration", |row| row.curve.label.clone()),
        ("rounds", |row| row.point.rounds.to_string()),
        ("photons", |row| row.point.photons.to_string()),
        ("seed", |row| row.seed.to_string()),
        ("runs", |row| row.point.squared_errors.len().to_string()),
        ("ms", |row| row.point.ms().value.to_string()),
        ("ms_least", |row| row.point.ms().low.to_string()),
        ("ms_most", |row| row.point.ms().high.to_string()),
        ("clock", |row| clock(row.point).to_owned()),
        ("wall_ms", |row| row.point.wall().to_string()),
        ("error", |row| row.point.error().value.to_string()),
        ("error_low", |row| known(row.point.error().low)),
        ("error_high", |row| known(row.point.error().high)),
        ("noise", |row| row.point.noise().to_string()),
        ("bias", |row| row.point.bias().value.to_string()),
        ("bias_low", |row| known(row.point.bias().low)),
        ("bias_high", |row| known(row.point.bias().high)),
        ("cut_off", |row| row.point.cut_off.to_string()),
        ("command", |row| row.point.command.clone()),
    ];
    let seed = study.request.seed;
    let mut rows = Vec::new();
    for part in &study.parts {
        for (axis, curve) in part.curves() {
            rows.extend(curve.points.iter().map(|point| Row { part, axis, curve, point, seed }));
        }
    }
    csv_table(&columns, &rows)
}

pub(crate) fn clock(point: &Point) -> &'static str {
    if point.gpu_ms.iter().all(Option::is_some) { "gpu" } else { "wall" }
}

#[cfg(test)]
mod tests {
    use super::super::point::tests::curve;
    use super::*;

    #[test]
    fn the_base_is_summed_up_where_it_was_measured_furthest() {
        let to = |label: &str, points: usize| {
            let mut curve = curve(0.4, 0.0, 1.0);
            curve.points.truncate(points);
            Curve { label: label.to_owned(), ..curve }
        };
        let comparison = |axis, base, other| Comparison { axis, curves: vec![base, other] };
        let part = Part {
            quantity: String::new(),
            reference: String::new(),
            reference_error: 0.0,
            least_error: 0.0,
            default: None,
            strip: None,
            comparisons: vec![
                comparison(Axis::Builder, to("base", 2), to("naive", 9)),
                comparison(Axis::Radius, to("base", 7), to("twice", 8)),
                comparison(Axis::Sums, to("base", 5), to("floats", 5)),
                // Of another line.
                comparison(Axis::Index, to("kd-tree", 8), to("brute", 9)),
            ],
        };
        assert_eq!(part.base().map(|base| (base.label.as_str(), base.points.len())), Some(("base", 7)));
    }
}
