//! Time over size, both logarithmic, one line per pass, as SVG.

use super::scale::{self, Scale};
use crate::output::svg::{Axis, Chart, Series, decades, log_log};
use crate::output::words;

/// A file for each series.
pub(crate) fn all(scale: &Scale) -> impl Iterator<Item = (String, Vec<u8>)> {
    let measured = scale.series.iter().filter(|series| !series.steps.is_empty());
    measured.map(|series| (format!("scale-{}.svg", series.over), draw(series).as_file()))
}

pub(crate) fn draw(series: &scale::Series) -> Chart {
    let lines = series.growth.iter().enumerate().map(|(number, growth)| {
        let label = format!("{}: power {:.3} \u{b1} {:.3}", growth.pass, growth.power.value, growth.power.error);
        let points = scale::times_of(&series.steps, &growth.pass).into_iter().map(|(size, ms)| (size, ms.max(1e-6)));
        Series::line(label, number + 1, points.collect())
    });
    let lines: Vec<Series> = lines.collect();
    let times = series.steps.iter().flat_map(|step| &step.passes).map(|pass| pass.ms.median.max(1e-6));
    let sizes = decades(series.steps.iter().map(|step| step.size as f64));
    let x = Axis { name: series.over, range: sizes, label: |size| words::count(size as u64) };
    log_log(&x, &Axis { name: "time on the device", range: decades(times), label: words::tick }, &lines)
}
