//! Charts of the paper's times and those measured here.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::Reproduction;
use super::experiments::{Implementation, Pass, TotalTime, series};
use super::published;
use crate::output::svg::{Axis, COLOURS, Chart, SCALE, Series, TEXT, decades, log_log, svg};
use crate::output::words;
use crate::settings::Gather;

/// Time against photons, both logarithmic, of table 1.
pub(crate) fn totals(found: &Reproduction) -> Option<Chart> {
    let published = published::TABLE_1.map(|(rounds, ms)| (f64::from(rounds * published::PHOTONS), ms));
    let names = ["here, brute force", "here, grid", "here, grid, large rounds"];
    let here = series(&found.request).into_iter().zip(names).zip(1..).map(|(((photons, gather), name), colour)| {
        Series::line(name, colour, found.totals_of(photons, gather).map(TotalTime::point).collect())
    });
    let series: Vec<Series> = std::iter::once(Series::line("2008", 0, published.into())).chain(here).collect();
    let range = |of: fn(&(f64, f64)) -> f64| decades(series.iter().flat_map(|series| &series.points).map(of));
    let x = Axis { name: "photons", range: range(|point| point.0), label: |photons| words::count(photons as u64) };
    let y = Axis { name: "time", range: range(|point| point.1), label: words::tick };
    (!found.totals.is_empty()).then(|| log_log(&x, &y, &series))
}

/// A pass of a builder at the paper's size.
struct Row {
    name: String,
    published_ms: Option<f64>,
    ms: f64,
}

/// Both passes of every builder at the paper's size, each beside what the paper measured.
pub(crate) fn running_times(found: &Reproduction) -> Option<Chart> {
    let row = |implementation: Implementation, pass: Pass| {
        let time = found.running_time(published::PHOTONS, published::BOUNCES, implementation, pass)?;
        let grid = if pass == Pass::Rendering(Gather::Grid) { ", grid" } else { "" };
        Some(Row {
            name: format!("{}{grid}: {}", pass.name(), implementation.described()),
            published_ms: time.published_ms(),
            ms: time.ms.median,
        })
    };
    let rows: Vec<Row> = Pass::ALL.iter().flat_map(|pass| found.implementations().into_iter().filter_map(|one| row(one, *pass))).collect();
    (!rows.is_empty()).then(|| Chart::of_one_size(draw_running_times(&rows)))
}

fn draw_running_times(rows: &[Row]) -> String {
    let [then_colour, now_colour, ..] = COLOURS;
    let x = decades(rows.iter().flat_map(|row| row.published_ms.into_iter().chain([row.ms])));
    let text = |horizontal| TextStyle::from(("sans-serif", TEXT)).pos(Pos::new(horizontal, VPos::Center));
    svg((760, 88 + 26 * rows.len() as u32), |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(14)
            .margin_right(50)
            .margin_top(40)
            .x_label_area_size(34)
            .y_label_area_size(250)
            .build_cartesian_2d(x.clone().log_scale(), 0.0..rows.len() as f64)?;
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
        for (place, row) in rows.iter().rev().enumerate() {
            let y = place as f64 + 0.5;
            let name = Text::new(row.name.clone(), (-10, 0), text(HPos::Right));
            chart.plotting_area().draw(&(EmptyElement::at((x.start, y)) + name))?;
            if let Some(then) = row.published_ms {
                chart.draw_series([PathElement::new([(then, y), (row.ms, y)], SCALE.mix(0.6))])?;
                chart.draw_series([Circle::new((then, y), 5, then_colour.filled())])?;
            }
            chart.draw_series([Circle::new((row.ms, y), 5, now_colour.filled())])?;
        }
        for (left, name, colour) in [(276, "2008", then_colour), (366, "here", now_colour)] {
            area.draw(&Circle::new((left, 20), 5, colour.filled()))?;
            area.draw(&Text::new(name, (left + 12, 20), text(HPos::Left)))?;
        }
        Ok(())
    })
}
