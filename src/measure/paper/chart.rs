//! Charts as SVG that takes its text colour from the page around it.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::experiments::{Implementation, Pass, TotalTime};
use super::{Reproduction, published};
use crate::output::svg::{Drawn, SCALE, TEXT, decades, svg};
use crate::output::words;
use crate::settings::{Builder, Gather};

/// Colours that stand out on white and on black alike, and apart from each other without hue.
const PAPER: RGBColor = RGBColor(0x8a, 0x8a, 0x8a);
const BRUTE: RGBColor = RGBColor(0xd9, 0x5f, 0x02);
const GRID: RGBColor = RGBColor(0x1b, 0x8f, 0xd6);
const LARGE: RGBColor = RGBColor(0x2c, 0xa0, 0x5a);
/// Time against photons, both logarithmic, of table 1.
pub fn totals(found: &Reproduction) -> Option<String> {
    let line = |totals: Vec<&TotalTime>| totals.iter().map(|total| (total.photons() as f64, total.best_ms())).collect::<Vec<_>>();
    let (small, large) = (published::PHOTONS, found.request.large);
    let paper = published::TABLE_1.iter().map(|(rounds, ms)| (f64::from(rounds * small), *ms)).collect();
    let series = [
        ("2008", PAPER, paper),
        ("here, brute force", BRUTE, line(found.totals_of(small, Gather::Brute).collect())),
        ("here, grid", GRID, line(found.totals_of(small, Gather::Grid).collect())),
        ("here, grid, large rounds", LARGE, line(found.totals_of(large, Gather::Grid).collect())),
    ];
    if found.totals.is_empty() { None } else { Some(svg((760, 440), |area| draw_totals(area, &series))) }
}

type Series<'a> = (&'a str, RGBColor, Vec<(f64, f64)>);

fn draw_totals(area: &DrawingArea<SVGBackend, Shift>, series: &[Series]) -> Drawn<()> {
    let points = || series.iter().flat_map(|(_, _, points)| points.iter().copied());
    let x = decades(points().map(|(photons, _)| photons));
    let y = decades(points().map(|(_, ms)| ms));
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .margin_right(50)
        .x_label_area_size(52)
        .y_label_area_size(84)
        .build_cartesian_2d(x.log_scale(), y.log_scale())?;
    chart
        .configure_mesh()
        .bold_line_style(SCALE.mix(0.45))
        .light_line_style(SCALE.mix(0.0))
        .axis_style(SCALE)
        .label_style(("sans-serif", TEXT))
        .axis_desc_style(("sans-serif", TEXT))
        .x_desc("photons")
        .y_desc("time")
        .x_label_formatter(&|photons| words::count(*photons as u64))
        .y_label_formatter(&|ms| words::tick(*ms))
        .draw()?;
    for (name, colour, points) in series.iter().filter(|(_, _, points)| !points.is_empty()) {
        let colour = *colour;
        chart
            .draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(2)));
        chart.draw_series(points.iter().map(|point| Circle::new(*point, 4, colour.filled())))?;
    }
    chart.configure_series_labels().position(SeriesLabelPosition::UpperLeft).margin(12).label_font(("sans-serif", TEXT)).draw()
}

/// Both passes of every builder at the paper's size, each beside what the paper measured.
pub fn running_times(found: &Reproduction) -> Option<String> {
    let rows: Vec<(String, Option<f64>, f64)> =
        [(Pass::Map, None), (Pass::Rendering, Some(Gather::Brute)), (Pass::Rendering, Some(Gather::Grid))]
            .into_iter()
            .flat_map(|(pass, gather)| {
                found.implementations().into_iter().filter_map(move |implementation| row(found, implementation, pass, gather))
            })
            .collect();
    if rows.is_empty() {
        return None;
    }
    let height = 88 + 26 * rows.len() as u32;
    Some(svg((760, height), |area| draw_running_times(area, &rows)))
}

/// Name, published and measured milliseconds.
fn row(found: &Reproduction, implementation: Implementation, pass: Pass, gather: Option<Gather>) -> Option<(String, Option<f64>, f64)> {
    let time = found.running_time(published::PHOTONS, published::BOUNCES, implementation, pass, gather)?;
    let pass = match gather {
        Some(Gather::Grid) => "rendering, grid".to_owned(),
        _ => pass.name().to_owned(),
    };
    let name = if implementation.builder == Builder::Atomic { "modified (atomic)".to_owned() } else { implementation.name() };
    Some((format!("{pass}: {name}"), time.published_ms(), time.ms.median))
}

fn draw_running_times(area: &DrawingArea<SVGBackend, Shift>, rows: &[(String, Option<f64>, f64)]) -> Drawn<()> {
    let x = decades(rows.iter().flat_map(|(_, then, now)| then.iter().chain([now]).copied().collect::<Vec<_>>()));
    let last = rows.len() as f64;
    let place = |row: usize| last - row as f64 - 0.5;
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .margin_right(50)
        .margin_top(40)
        .x_label_area_size(34)
        .y_label_area_size(250)
        .build_cartesian_2d(x.clone().log_scale(), 0.0..last)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .bold_line_style(SCALE.mix(0.45))
        .light_line_style(SCALE.mix(0.0))
        .axis_style(SCALE)
        .label_style(("sans-serif", TEXT))
        .x_label_formatter(&|ms| words::tick(*ms))
        .draw()?;
    let text = |anchor| TextStyle::from(("sans-serif", TEXT)).pos(anchor);
    use plotters::style::text_anchor::{HPos, Pos, VPos};
    for (row, (name, then, now)) in rows.iter().enumerate() {
        let y = place(row);
        let style = text(Pos::new(HPos::Right, VPos::Center));
        chart.plotting_area().draw(&(EmptyElement::at((x.start, y)) + Text::new(name.clone(), (-10, 0), style)))?;
        if let Some(then) = then {
            chart.draw_series([PathElement::new([(*then, y), (*now, y)], SCALE.mix(0.6))])?;
            chart.draw_series([Circle::new((*then, y), 5, PAPER.filled())])?;
        }
        chart.draw_series([Circle::new((*now, y), 5, BRUTE.filled())])?;
    }
    for (column, (name, colour)) in [("2008", PAPER), ("here", BRUTE)].into_iter().enumerate() {
        let at = (276 + 90 * column as i32, 20);
        area.draw(&Circle::new(at, 5, colour.filled()))?;
        area.draw(&Text::new(name, (at.0 + 12, at.1), text(Pos::new(HPos::Left, VPos::Center))))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;

    #[test]
    fn charts_name_their_series_and_no_address() {
        let found = sample::reproduction();
        let drawn = totals(&found).unwrap() + &running_times(&found).unwrap();
        assert!(drawn.contains("here, brute force") && drawn.contains("map: naive"));
        assert!(!drawn.contains("http"));
    }

    #[test]
    fn nothing_measured_is_no_chart() {
        let mut found = sample::reproduction();
        found.totals.clear();
        found.running_times.clear();
        assert!(totals(&found).is_none() && running_times(&found).is_none());
    }
}
