//! Error against time, both logarithmic: the curves of an axis with their bands, and all points with the Pareto front.

use super::Part;
use super::point::{Curve, Point};
use crate::output::svg::{Axis, Series, around, log_log};
use crate::output::words;

/// A chart for each axis and one of everything, by names fit for files.
pub fn all(part: &Part) -> Vec<(String, String)> {
    let overview = overview(part).map(|drawn| ("overview".to_owned(), drawn));
    let of_axes = part
        .comparisons
        .iter()
        .filter_map(|comparison| Some((comparison.axis.name().replace([' ', '\''], "-"), of_axis(&comparison.curves)?)));
    overview.into_iter().chain(of_axes).collect()
}

/// The curves with their bands; nothing where no time is known.
pub fn of_axis(curves: &[Curve]) -> Option<String> {
    let (x, y) = axes(curves.iter())?;
    let series = curves.iter().enumerate().map(|(number, curve)| {
        let low = curve.points.iter().map(|point| (point.ms().value, point.error().low));
        let high = curve.points.iter().rev().map(|point| (point.ms().value, point.error().high));
        Series { dot: 3, band: low.chain(high).collect(), ..Series::line(&curve.label, number, curve.points.iter().map(place).collect()) }
    });
    Some(log_log(x, y, &series.collect::<Vec<_>>()))
}

/// Every point, and those that no other beats.
pub fn overview(part: &Part) -> Option<String> {
    let (x, y) = axes(part.curves())?;
    let places = |points: Vec<(&Curve, &Point)>| points.into_iter().map(|(_, point)| place(point)).collect();
    let all = Series { dot: 2, has_line: false, ..Series::line("all points", 0, places(part.points().collect())) };
    Some(log_log(x, y, &[all, Series::line("Pareto front", 1, places(part.pareto_front()))]))
}

fn place(point: &Point) -> (f64, f64) {
    (point.ms().value, point.error().value)
}

fn axes<'a>(curves: impl Iterator<Item = &'a Curve>) -> Option<(Axis, Axis)> {
    let points: Vec<(f64, f64)> =
        curves.flat_map(|curve| &curve.points).map(place).filter(|(ms, error)| *ms > 0.0 && *error > 0.0).collect();
    let percent = |error: f64| format!("{} %", (100.0 * error * 1e6).round() / 1e6);
    let x = Axis { name: "time", range: around(points.iter().map(|point| point.0)), label: words::tick };
    let y = Axis { name: "relative RMS error", range: around(points.iter().map(|point| point.1)), label: percent };
    (!points.is_empty()).then_some((x, y))
}
