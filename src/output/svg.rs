//! Charts as SVG that takes its text colour from the page around it.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::prelude::*;

/// Lines of the scale; the page gives them its own colour.
pub const SCALE: RGBColor = RGBColor(0x99, 0x99, 0x98);

/// Colours that stand out on white and on black alike; the first is for what the others are compared with.
pub const COLOURS: [RGBColor; 7] = [
    RGBColor(0x8a, 0x8a, 0x8a),
    RGBColor(0xd9, 0x5f, 0x02),
    RGBColor(0x1b, 0x8f, 0xd6),
    RGBColor(0x2c, 0xa0, 0x5a),
    RGBColor(0xb3, 0x5c, 0xc9),
    RGBColor(0xc9, 0xa2, 0x27),
    RGBColor(0xe0, 0x4f, 0x6d),
];

/// Size of letters.
pub const TEXT: u32 = 17;

const WIDTH: u32 = 760;
/// Heights of the plane of two axes, and of a line of the legend below it.
const PLANE: u32 = 410;
const LEGEND: u32 = 22;

pub type Drawn<T> = Result<T, DrawingAreaErrorKind<std::io::Error>>;

/// A logarithmic axis.
pub struct Axis {
    pub name: &'static str,
    pub range: Range<f64>,
    pub label: fn(f64) -> String,
}

/// Points of one colour.
pub struct Series {
    pub label: String,
    pub colour: RGBColor,
    pub points: Vec<(f64, f64)>,
    pub dot: u32,
    pub has_line: bool,
    /// Corners of the area of uncertainty; empty: it is not drawn.
    pub band: Vec<(f64, f64)>,
}

impl Series {
    /// A line through dots, in one of [`COLOURS`].
    pub fn line(label: impl Into<String>, colour: usize, points: Vec<(f64, f64)>) -> Series {
        let colour = COLOURS[colour % COLOURS.len()];
        Series { label: label.into(), colour, points, dot: 4, has_line: true, band: Vec::new() }
    }
}

/// All series over two logarithmic axes, and a legend. What lies above or below the axes is drawn at their ends.
pub fn log_log(x: Axis, y: Axis, series: &[Series]) -> String {
    let (bottom, top) = (y.range.start, y.range.end);
    let within = |points: &[(f64, f64)]| points.iter().map(|point| (point.0, point.1.clamp(bottom, top))).collect::<Vec<_>>();
    let series: Vec<&Series> = series.iter().filter(|series| !series.points.is_empty()).collect();
    svg((WIDTH, PLANE + LEGEND * series.len() as u32), |area| {
        // The legend has room of its own, as curves fill the plane.
        let (plane, legend) = area.split_vertically(PLANE);
        let mut chart = ChartBuilder::on(&plane)
            .margin(14)
            .margin_right(64)
            .x_label_area_size(52)
            .y_label_area_size(84)
            .build_cartesian_2d(x.range.log_scale(), y.range.log_scale())?;
        chart
            .configure_mesh()
            .bold_line_style(SCALE.mix(0.45))
            .light_line_style(SCALE.mix(0.0))
            .axis_style(SCALE)
            .label_style(("sans-serif", TEXT))
            .axis_desc_style(("sans-serif", TEXT))
            .x_desc(x.name)
            .y_desc(y.name)
            .x_label_formatter(&|value| labelled(*value, x.label))
            .y_label_formatter(&|value| labelled(*value, y.label))
            .draw()?;
        for (number, Series { label, colour, points, dot, has_line, band }) in series.into_iter().enumerate() {
            let points = within(points);
            chart.draw_series([Polygon::new(within(band), colour.mix(0.18).filled())])?;
            let line = if *has_line { points.clone() } else { Vec::new() };
            chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?;
            chart.draw_series(points.into_iter().map(|point| Circle::new(point, *dot, colour.filled())))?;
            let at = (100, 8 + (LEGEND * number as u32) as i32);
            legend.draw(&PathElement::new([at, (at.0 + 24, at.1)], colour.stroke_width(3)))?;
            legend.draw(&Text::new(label.clone(), (at.0 + 34, at.1 - 8), ("sans-serif", TEXT)))?;
        }
        Ok(())
    })
}

/// Ones, twos and fives have a label: all nine of a decade would lie on each other.
fn labelled(value: f64, label: fn(f64) -> String) -> String {
    let digit = (value / 10f64.powf(value.log10().floor() + 1e-9)).round();
    if [1.0, 2.0, 5.0, 10.0].contains(&digit) { label(value) } else { String::new() }
}

/// Whole decades around all values.
pub fn decades(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = extremes(values);
    let low = low.log10().floor();
    10f64.powf(low)..10f64.powf(high.log10().ceil().max(low + 1.0))
}

/// A little wider than all values. Scales have marks around powers of ten only, so there is one.
pub fn around(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = extremes(values);
    let power = 10f64.powf((low * high).sqrt().log10().round());
    (low / 1.3).min(power / 1.05)..(high * 1.3).max(power * 1.05)
}

/// The least and the largest of values above 0.
pub fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)))
}

/// Draws, and makes the SVG fit for being part of a page: it scales with its box, and names no
/// address.
pub fn svg(size: (u32, u32), draw: impl FnOnce(&DrawingArea<SVGBackend, Shift>) -> Drawn<()>) -> String {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        draw(&area).and_then(|()| area.present()).expect("drawing into memory cannot fail");
    }
    text.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1).replacen("<svg ", "<svg role=\"img\" ", 1)
}

/// A chart of a page as a file of its own.
pub fn as_file(drawn: &str) -> Vec<u8> {
    drawn.replacen("<svg ", "<svg xmlns=\"http://www.w3.org/2000/svg\" style=\"background:#fff\" ", 1).into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_on_decades() {
        assert_eq!(decades([2130.0, 105_640.0].into_iter()), 1e3..1e6);
        assert_eq!(decades([100.0].into_iter()), 1e2..1e3);
    }
}
