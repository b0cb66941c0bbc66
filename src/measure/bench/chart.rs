//! Time over size, both logarithmic, one line per pass, as SVG.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::scale::{Scale, Series};
use crate::measure::study::chart::alone;
use crate::output::svg::{Drawn, SCALE, TEXT, decades, svg};
use crate::output::words;

/// Colours that stand out on white and on black alike.
const COLOURS: [RGBColor; 4] =
    [RGBColor(0xd9, 0x5f, 0x02), RGBColor(0x1b, 0x8f, 0xd6), RGBColor(0x2c, 0xa0, 0x5a), RGBColor(0xb3, 0x5c, 0xc9)];

/// A file for each series.
pub fn all(scale: &Scale) -> Vec<(String, String)> {
    let of_series = |series: &Series| (format!("scale-{}.svg", series.over), alone(&svg((760, 480), |area| draw(area, series))));
    scale.series.iter().filter(|series| !series.steps.is_empty()).map(of_series).collect()
}

fn draw(area: &DrawingArea<SVGBackend, Shift>, series: &Series) -> Drawn<()> {
    let (plane, legend) = area.split_vertically(400);
    let sizes = || series.steps.iter().map(|step| step.size as f64);
    let x = decades(sizes());
    let y = decades(series.steps.iter().flat_map(|step| step.passes.iter().map(|pass| pass.ms.median.max(1e-6))));
    let mut chart = ChartBuilder::on(&plane)
        .margin(14)
        .margin_right(64)
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
        .x_desc(series.over)
        .y_desc("time on the device")
        .x_label_formatter(&|size| words::count(*size as u64))
        .y_label_formatter(&|ms| words::tick(*ms))
        .draw()?;
    for (number, growth) in series.growth.iter().enumerate() {
        let colour = COLOURS[number % COLOURS.len()];
        let points: Vec<(f64, f64)> = series
            .steps
            .iter()
            .filter_map(|step| Some((step.size as f64, step.passes.iter().find(|pass| pass.pass == growth.pass)?.ms.median.max(1e-6))))
            .collect();
        chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))?;
        chart.draw_series(points.into_iter().map(|point| Circle::new(point, 4, colour.filled())))?;
        let at = (100 + 330 * (number as i32 % 2), 14 + 24 * (number as i32 / 2));
        let label = format!("{}: power {:.3} \u{b1} {:.3}", growth.pass, growth.power.value, growth.power.error);
        legend.draw(&PathElement::new([at, (at.0 + 24, at.1)], colour.stroke_width(3)))?;
        legend.draw(&Text::new(label, (at.0 + 34, at.1 - 8), ("sans-serif", TEXT)))?;
    }
    Ok(())
}
