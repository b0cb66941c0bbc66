//! Error against time, both logarithmic: what matters of a part on one chart, the curves of an axis with their bands, and all points with
//! the Pareto front.

use super::point::{Curve, Point};
use super::{Comparison, Part, Study, axes};
use crate::measure::paper::published;
use crate::output::svg::{Axis, Chart, Series, around, log_log};
use crate::output::words;

/// A chart for each axis, one of everything, and one of what matters, by names fit for files.
pub(crate) fn all(study: &Study, part: &Part) -> Vec<(String, Chart)> {
    let main = main(study, part).map(|drawn| ("main".to_owned(), drawn));
    let overview = overview(part).map(|drawn| ("overview".to_owned(), drawn));
    let of_axes = part
        .comparisons
        .iter()
        .filter_map(|comparison| Some((comparison.axis.name().replace([' ', '\''], "-"), of_axis(&comparison.curves)?)));
    main.into_iter().chain(overview).chain(of_axes).collect()
}

/// The default, the base, and the best choice, of the first part beside the paper's and other programs' points.
pub(crate) fn main(study: &Study, part: &Part) -> Option<Chart> {
    let base = part.base()?;
    let is_first = study.parts.first().is_some_and(|first| first.quantity == part.quantity);
    let papers = study.parts.iter().flat_map(|part| &part.comparisons).find(|comparison| comparison.axis == axes::Axis::Paper);
    let paper = papers.filter(|_| is_first).and_then(Comparison::base).map(of_the_paper).unwrap_or_default();
    let peers = if is_first { study.request.peers.as_slice() } else { &[] };
    let mut curves = vec![(base, format!("base: {}", base.label), 0)];
    if let Some(default) = part.default.as_ref().filter(|default| !default.points.is_empty()) {
        curves.push((default, "default settings, pilot included".to_owned(), 1));
    }
    if let Some(best) = part.best_choice() {
        curves.push((best.curve, format!("best single change: {}", best.name()), 2));
    }
    let mut series: Vec<Series> =
        curves.into_iter().map(|(curve, label, colour)| with_band(&above(curve, part.least_error), label, colour)).collect();
    series.push(Series::line("the paper's GPU in 2008, error of the same photons here", 4, paper));
    series.extend((5..).zip(peers).map(|(colour, peer)| Series::line(peer.name.clone(), colour, peer.points.clone())));
    let (x, y) = scales(series.iter().flat_map(|series| &series.points).copied())?;
    Some(log_log(&x, &y, &series))
}

/// Times that the paper printed, with the errors that its numbers of rounds have on this device, over the curve of its own settings.
fn of_the_paper(base: &Curve) -> Vec<(f64, f64)> {
    let error = |rounds: u32| base.value_at(f64::from(rounds), |point| f64::from(point.rounds), |point| point.error().value);
    published::TABLE_1.into_iter().filter_map(|(rounds, ms)| Some((ms, error(rounds)?))).collect()
}

/// The curves with their bands; nothing where no time is known.
pub(crate) fn of_axis(curves: &[Curve]) -> Option<Chart> {
    let (x, y) = scales(curves.iter().flat_map(|curve| curve.points.iter().map(place)))?;
    let series = curves.iter().enumerate().map(|(number, curve)| with_band(curve, curve.label.clone(), number));
    Some(log_log(&x, &y, &series.collect::<Vec<_>>()))
}

/// Every point, and those that no other beats.
pub(crate) fn overview(part: &Part) -> Option<Chart> {
    let (x, y) = scales(part.points().map(|(_, point)| place(point)))?;
    let places = |points: Vec<(&Curve, &Point)>| points.into_iter().map(|(_, point)| place(point)).collect();
    let all = Series { dot: 2, ..Series::dots("all points", 0, places(part.points().collect())) };
    Some(log_log(&x, &y, &[all, Series::line("Pareto front", 1, places(part.pareto_front()))]))
}

/// Without points that the reference cannot judge.
fn above(curve: &Curve, least: f64) -> Curve {
    let points = curve.points.iter().filter(|point| point.error().value >= least).cloned().collect();
    Curve { points, ..Curve::new(&curve.label) }
}

fn with_band(curve: &Curve, label: String, colour: usize) -> Series {
    let is_known = |point: &&Point| point.error().high < MOST_NOISE * point.error().low;
    let low = curve.points.iter().map(|point| (point.ms().value, point.error().low));
    let high = curve.points.iter().rev().map(|point| (point.ms().value, point.error().high));
    Series {
        band: low.chain(high).collect(),
        line: curve.points.iter().filter(is_known).map(place).collect(),
        ..Series::dots(label, colour, curve.points.iter().map(place).collect())
    }
}

/// A line goes through points whose interval is narrower than this.
const MOST_NOISE: f64 = 2.5;

fn place(point: &Point) -> (f64, f64) {
    (point.ms().value, point.error().value)
}

fn scales(points: impl Iterator<Item = (f64, f64)>) -> Option<(Axis, Axis)> {
    let points: Vec<(f64, f64)> = points.filter(|(ms, error)| *ms > 0.0 && *error > 0.0).collect();
    let percent = |error: f64| format!("{} %", (100.0 * error * 1e6).round() / 1e6);
    let x = Axis { name: "time on this device", range: around(points.iter().map(|point| point.0)), label: words::tick };
    let y = Axis { name: "relative RMS error", range: around(points.iter().map(|point| point.1)), label: percent };
    (!points.is_empty()).then_some((x, y))
}
