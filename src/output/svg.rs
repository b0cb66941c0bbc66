//! Charts as SVG that takes its text colour from the page around it, drawn for a wide page and for a narrow one.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::combinators::{BindKeyPoints, IntoLogRange};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Lines of the scale; the page gives them its own colour.
pub(crate) const SCALE: RGBColor = RGBColor(0x99, 0x99, 0x98);

/// Colours that the colour-blind distinguish (Okabe and Ito 2008); the first, grey, is for what the others are compared with. The style sheet
/// has brighter ones for dark pages.
pub(crate) const COLOURS: [RGBColor; 7] = [
    RGBColor(0x80, 0x80, 0x80),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xb0, 0x8c, 0x00),
    RGBColor(0x3a, 0x9b, 0xd6),
];

/// Size of letters.
pub(crate) const TEXT: u32 = 16;

pub(crate) type Drawn<T> = Result<T, DrawingAreaErrorKind<std::io::Error>>;

/// A chart for wide pages, and one for narrow ones where it is not the same.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chart {
    pub wide: String,
    pub narrow: Option<String>,
}

impl Chart {
    /// Of a chart that scrolls where the page is narrow.
    pub(crate) fn of_one_size(wide: String) -> Chart {
        Chart { wide, narrow: None }
    }

    /// As a file of its own.
    pub(crate) fn as_file(&self) -> Vec<u8> {
        self.wide.replacen("<svg ", "<svg xmlns=\"http://www.w3.org/2000/svg\" style=\"background:#fff\" ", 1).into_bytes()
    }
}

/// A logarithmic axis.
pub(crate) struct Axis {
    pub name: &'static str,
    pub range: Range<f64>,
    pub label: fn(f64) -> String,
}

/// Points of one colour.
#[derive(Clone)]
pub(crate) struct Series {
    pub label: String,
    pub colour: RGBColor,
    pub points: Vec<(f64, f64)>,
    pub dot: u32,
    /// What a line joins; points that noise moves have none.
    pub line: Vec<(f64, f64)>,
    /// Corners of the area of uncertainty; empty: it is not drawn.
    pub band: Vec<(f64, f64)>,
}

impl Series {
    /// A line through dots, in one of [`COLOURS`].
    pub(crate) fn line(label: impl Into<String>, colour: usize, points: Vec<(f64, f64)>) -> Series {
        Series { line: points.clone(), ..Series::dots(label, colour, points) }
    }

    pub(crate) fn dots(label: impl Into<String>, colour: usize, points: Vec<(f64, f64)>) -> Series {
        let colour = COLOURS[colour % COLOURS.len()];
        Series { label: label.into(), colour, points, dot: 4, line: Vec::new(), band: Vec::new() }
    }
}

/// How large a chart is, and where it has its labels.
struct Layout {
    width: u32,
    height: u32,
    /// Beside the ends of lines, in a margin so wide; 0: in a legend below.
    labels: u32,
    /// Along each axis, at most.
    ticks: usize,
}

const WIDE: Layout = Layout { width: 900, height: 460, labels: 230, ticks: 10 };
const NARROW: Layout = Layout { width: 400, height: 340, labels: 0, ticks: 5 };

/// All series over two logarithmic axes. What lies above or below the axes is drawn at their ends.
pub(crate) fn log_log(x: &Axis, y: &Axis, series: &[Series]) -> Chart {
    Chart { wide: draw(x, y, series, &WIDE), narrow: Some(draw(x, y, series, &NARROW)) }
}

fn draw(x: &Axis, y: &Axis, series: &[Series], layout: &Layout) -> String {
    let (bottom, top) = (y.range.start, y.range.end);
    let within = |points: &[(f64, f64)]| points.iter().map(|point| (point.0, point.1.clamp(bottom, top))).collect::<Vec<_>>();
    let series: Vec<&Series> = series.iter().filter(|series| !series.points.is_empty()).collect();
    let legend = if layout.labels == 0 { LEGEND_LINE * series.len() as u32 } else { 0 };
    svg((layout.width, layout.height + legend), |area| {
        let (plane, legend) = area.split_vertically(layout.height);
        let mut chart = ChartBuilder::on(&plane)
            .margin(8)
            .margin_top(16)
            .margin_right(layout.labels.max(24))
            .x_label_area_size(50)
            .y_label_area_size(if layout.labels == 0 { 66 } else { 80 })
            .build_cartesian_2d(
                x.range.clone().log_scale().with_key_points(ticks(&x.range, layout.ticks)),
                y.range.clone().log_scale().with_key_points(ticks(&y.range, 9)),
            )?;
        chart
            .configure_mesh()
            .bold_line_style(SCALE.mix(0.4))
            .light_line_style(SCALE.mix(0.0))
            .axis_style(SCALE)
            .label_style(("sans-serif", TEXT - 1))
            .axis_desc_style(("sans-serif", TEXT - 1))
            .x_desc(x.name)
            .y_desc(y.name)
            .x_label_formatter(&|value| (x.label)(*value))
            .y_label_formatter(&|value| (y.label)(*value))
            .draw()?;
        for Series { colour, points, dot, line, band, .. } in &series {
            chart.draw_series([Polygon::new(within(band), colour.mix(0.2).filled())])?;
            chart.draw_series(LineSeries::new(within(line), colour.stroke_width(3)))?;
            chart.draw_series(within(points).into_iter().map(|point| Circle::new(point, *dot, colour.filled())))?;
        }
        if layout.labels == 0 {
            for (number, Series { label, colour, .. }) in series.iter().enumerate() {
                let at = (12, 12 + (LEGEND_LINE * number as u32) as i32);
                legend.draw(&PathElement::new([at, (at.0 + 22, at.1)], colour.stroke_width(4)))?;
                legend.draw(&text(label.clone(), (at.0 + 30, at.1)))?;
            }
            return Ok(());
        }
        let edge = (layout.width - layout.labels) as i32;
        let ends: Vec<(i32, i32)> =
            series.iter().map(|series| chart.backend_coord(within(&series.points).last().expect("not empty"))).collect();
        let labels: Vec<Vec<String>> = series.iter().map(|series| lines_of(&series.label, LETTERS)).collect();
        let heights: Vec<i32> = labels.iter().map(|lines| LABEL_LINE * lines.len() as i32 + 4).collect();
        let places = apart(&ends.iter().map(|end| end.1).collect::<Vec<_>>(), &heights, layout.height as i32);
        for (number, lines) in labels.into_iter().enumerate() {
            let (end, middle, colour) = (ends[number], places[number], series[number].colour);
            area.draw(&PathElement::new([(end.0 + 6, end.1), (edge + 4, middle), (edge + 10, middle)], colour.mix(0.7).stroke_width(1)))?;
            let first = middle - LABEL_LINE * (lines.len() as i32 - 1) / 2;
            for (place, line) in lines.into_iter().enumerate() {
                area.draw(&text(line, (edge + 14, first + LABEL_LINE * place as i32)))?;
            }
        }
        Ok(())
    })
}

const LEGEND_LINE: u32 = 22;
/// Height of a line of a label beside its curve, and letters in it.
const LABEL_LINE: i32 = 17;
const LETTERS: usize = 26;

fn text<'a>(words: String, at: (i32, i32)) -> Text<'a, (i32, i32), String> {
    Text::new(words, at, TextStyle::from(("sans-serif", TEXT - 1)).pos(Pos::new(HPos::Left, VPos::Center)))
}

/// Words in lines of at most so many letters.
fn lines_of(words: &str, most: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words.split(' ') {
        let line = lines.last_mut().expect("there is one");
        if line.is_empty() {
            word.clone_into(line);
        } else if line.chars().count() + 1 + word.chars().count() <= most {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_owned());
        }
    }
    lines
}

/// Where labels of these heights are, as near to the places that they belong to as they can without lying on each other.
fn apart(wanted: &[i32], heights: &[i32], end: i32) -> Vec<i32> {
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by_key(|number| wanted[*number]);
    let mut places = vec![0; wanted.len()];
    let mut free = 0;
    for &number in &order {
        let half = heights[number] / 2;
        places[number] = wanted[number].max(free + half);
        free = places[number] + half;
    }
    let mut limit = end;
    for &number in order.iter().rev() {
        let half = heights[number] / 2;
        places[number] = places[number].min(limit - half);
        limit = places[number] - half;
    }
    places
}

/// Ones, twos and fives of each decade within a range; fewer where they are more than so many.
fn ticks(range: &Range<f64>, most: usize) -> Vec<f64> {
    let all = |digits: &[f64], step: usize| -> Vec<f64> {
        let decades = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
        let decades = decades.filter(|decade| decade.rem_euclid(step as i32) == 0);
        let values = decades.flat_map(|decade| digits.iter().map(move |digit| power(decade) * digit));
        values.filter(|value| (range.start * 0.999..range.end * 1.001).contains(value)).collect()
    };
    let choices = [(&[1.0, 2.0, 5.0][..], 1), (&[1.0, 3.0], 1), (&[1.0], 1), (&[1.0], 2), (&[1.0], 3)];
    choices.into_iter().map(|(digits, step)| all(digits, step)).find(|ticks| ticks.len() <= most).unwrap_or_default()
}

/// 10^n, the nearest number to it.
fn power(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().expect("a number was written")
}

/// Whole decades around all values.
pub(crate) fn decades(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = extremes(values);
    let low = low.log10().floor();
    10f64.powf(low)..10f64.powf(high.log10().ceil().max(low + 1.0))
}

/// A little wider than all values, and wide enough to have a mark or two.
pub(crate) fn around(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = extremes(values);
    let wider = (3.0 * low / high).max(1.0).sqrt();
    low / 1.3 / wider..high * 1.3 * wider
}

/// The least and the largest of values above 0.
pub(crate) fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)))
}

/// Draws, and makes the SVG fit for being part of a page: it scales with its box, and names no
/// address.
pub(crate) fn svg(size: (u32, u32), draw: impl FnOnce(&DrawingArea<SVGBackend, Shift>) -> Drawn<()>) -> String {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        draw(&area).and_then(|()| area.present()).expect("drawing into memory cannot fail");
    }
    text.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1).replacen("<svg ", "<svg role=\"img\" ", 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_on_decades() {
        assert_eq!(decades([2130.0, 105_640.0].into_iter()), 1e3..1e6);
        assert_eq!(decades([100.0].into_iter()), 1e2..1e3);
    }

    #[test]
    fn marks_are_ones_twos_and_fives_as_far_as_there_is_room() {
        assert_eq!(ticks(&(0.9..30.0), 9), [1.0, 2.0, 5.0, 10.0, 20.0]);
        assert_eq!(ticks(&(0.01..0.2), 9), [0.01, 0.02, 0.05, 0.1, 0.2]);
        assert_eq!(ticks(&(0.9..1100.0), 5), [1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(ticks(&(1e-3..1e6), 5), [1e-2, 1.0, 1e2, 1e4, 1e6]);
        // A range of one value still has marks.
        assert!(!ticks(&around([3.3].into_iter()), 9).is_empty());
    }

    #[test]
    fn labels_do_not_lie_on_each_other() {
        let places = apart(&[50, 52, 390, 54], &[20, 20, 20, 40], 400);
        assert_eq!(places, [50, 70, 390, 100]);
        let places = apart(&[395, 398], &[20, 20], 400);
        assert_eq!(places, [370, 390]);
        assert_eq!(lines_of("a shrinking radius and more", 12), ["a shrinking", "radius and", "more"]);
    }
}
