//! Error against time, both logarithmic: the curves of an axis with their bands, and all points with the Pareto front.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::Part;
use super::point::Curve;
use crate::output::svg::{Drawn, SCALE, TEXT, svg};
use crate::output::words;

/// Colours that stand out on white and on black alike; the first is the base's.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0x8a, 0x8a, 0x8a),
    RGBColor(0xd9, 0x5f, 0x02),
    RGBColor(0x1b, 0x8f, 0xd6),
    RGBColor(0x2c, 0xa0, 0x5a),
    RGBColor(0xb3, 0x5c, 0xc9),
    RGBColor(0xc9, 0xa2, 0x27),
    RGBColor(0xe0, 0x4f, 0x6d),
];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A chart for each axis and one of everything, by names fit for files.
pub fn all(part: &Part) -> Vec<(String, String)> {
    let mut charts: Vec<(String, String)> = overview(part).map(|drawn| ("overview".to_owned(), drawn)).into_iter().collect();
    for comparison in &part.comparisons {
        charts.extend(of_axis(&comparison.curves).map(|drawn| (comparison.axis.name().replace([' ', '\''], "-"), drawn)));
    }
    charts
}

/// A chart of a page as a file of its own.
pub fn alone(drawn: &str) -> String {
    drawn.replacen("<svg ", "<svg xmlns=\"http://www.w3.org/2000/svg\" style=\"background:#fff\" ", 1)
}

/// The curves with their bands; nothing where no time is known.
pub fn of_axis(curves: &[Curve]) -> Option<String> {
    let range = ranges(curves.iter())?;
    let height = 420 + 22 * curves.len() as u32;
    Some(svg((760, height), |area| draw(area, range, curves)))
}

/// Every point, and those that no other beats.
pub fn overview(part: &Part) -> Option<String> {
    let range = ranges(part.curves())?;
    Some(svg((760, 440), |area| draw_overview(area, range, part)))
}

type Range = std::ops::Range<f64>;

/// Of times and errors, a little wider than the points.
fn ranges<'a>(curves: impl Iterator<Item = &'a Curve>) -> Option<(Range, Range)> {
    let points: Vec<(f64, f64)> = curves
        .flat_map(|curve| &curve.points)
        .map(|point| (point.ms().value, point.error().value))
        .filter(|(ms, error)| *ms > 0.0 && *error > 0.0)
        .collect();
    let around = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) = points.iter().map(of).fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)));
        // Scales have marks around powers of ten only, so there must be one.
        let power = 10f64.powf((low * high).sqrt().log10().round());
        (low / 1.3).min(power / 1.05)..(high * 1.3).max(power * 1.05)
    };
    if points.is_empty() { None } else { Some((around(|point| point.0), around(|point| point.1))) }
}

/// Ones, twos and fives have a label: all nine of a decade would lie on each other.
fn labelled(value: f64, show: impl Fn(f64) -> String) -> String {
    let digit = (value / 10f64.powf(value.log10().floor() + 1e-9)).round();
    if [1.0, 2.0, 5.0, 10.0].contains(&digit) { show(value) } else { String::new() }
}

macro_rules! axes {
    ($area:expr, $x:expr, $y:expr) => {{
        let mut chart = ChartBuilder::on($area)
            .margin(14)
            .margin_right(40)
            .x_label_area_size(52)
            .y_label_area_size(84)
            .build_cartesian_2d($x.log_scale(), $y.log_scale())?;
        chart
            .configure_mesh()
            .bold_line_style(SCALE.mix(0.45))
            .light_line_style(SCALE.mix(0.0))
            .axis_style(SCALE)
            .label_style(("sans-serif", TEXT))
            .axis_desc_style(("sans-serif", TEXT))
            .x_desc("time")
            .y_desc("relative RMS error")
            .x_label_formatter(&|ms| labelled(*ms, words::tick))
            .y_label_formatter(&|error| labelled(*error, |error| format!("{} %", (100.0 * error * 1e6).round() / 1e6)))
            .draw()?;
        chart
    }};
}

fn draw(area: &Area, (x, y): (Range, Range), curves: &[Curve]) -> Drawn<()> {
    // The legend has room of its own, as curves fill the plane.
    let (plane, legend) = area.split_vertically(410);
    let mut chart = axes!(&plane, x, y.clone());
    for (number, curve) in curves.iter().enumerate() {
        let colour = COLOURS[number % COLOURS.len()];
        let points: Vec<(f64, f64)> = curve.points.iter().map(|point| (point.ms().value, point.error().value.max(y.start))).collect();
        let low = curve.points.iter().map(|point| (point.ms().value, point.error().low.clamp(y.start, y.end)));
        let high = curve.points.iter().rev().map(|point| (point.ms().value, point.error().high.clamp(y.start, y.end)));
        chart.draw_series([Polygon::new(low.chain(high).collect::<Vec<_>>(), colour.mix(0.18).filled())])?;
        chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))?;
        chart.draw_series(points.iter().map(|point| Circle::new(*point, 3, colour.filled())))?;
        let at = (100, 12 + 22 * number as i32);
        legend.draw(&PathElement::new([at, (at.0 + 24, at.1)], colour.stroke_width(3)))?;
        legend.draw(&Text::new(curve.label.clone(), (at.0 + 34, at.1 - 8), ("sans-serif", TEXT)))?;
    }
    Ok(())
}

fn draw_overview(area: &Area, (x, y): (Range, Range), part: &Part) -> Drawn<()> {
    let mut chart = axes!(area, x, y.clone());
    for curve in part.curves() {
        let points = curve.points.iter().map(|point| (point.ms().value, point.error().value.max(y.start)));
        chart.draw_series(points.map(|point| Circle::new(point, 2, COLOURS[0].mix(0.7).filled())))?;
    }
    let front: Vec<(f64, f64)> =
        part.pareto_front().iter().map(|(_, point)| (point.ms().value, point.error().value.max(y.start))).collect();
    chart.draw_series(LineSeries::new(front.clone(), COLOURS[1].stroke_width(2)))?;
    chart.draw_series(front.into_iter().map(|point| Circle::new(point, 4, COLOURS[1].filled())))?;
    Ok(())
}
