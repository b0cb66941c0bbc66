//! What folds away on the page: every measurement, and how it was made.

use maud::{Markup, html};

use super::findings::{Row, clock, equal_error, equal_time};
use super::point::{Curve, Point};
use super::{Part, Study, chart as charts};
use crate::measure::compaction::{self, Map};
use crate::measure::interval::CONFIDENCE_IN_WORDS;
use crate::output::page::{chart, table};
use crate::output::words::{count, duration, times};
use crate::text::percent;

pub(crate) fn of_builders(map: &Map) -> Markup {
    let is_scene = map.cells.iter().all(|cell| cell.scene.is_some());
    html! {
        details {
            summary { h2 { @if is_scene { "Fastest builder by photon count" } @else { "Fastest builder by photon count and survival" } } }
            p {
                "Time to trace and store photons over " (map.bounces) " bounces"
                @if is_scene { " in the scene. " } @else { " in a closed room. At every wall a given share of the photons survives. " }
                "Each cell shows the fastest builder, its speed relative to one atomic per thread, and, below, the builders that are not significantly slower. "
                "All builders gave the same result: bit-identical stored photons up to a million, and above that the same numbers of photons stored and absorbed at each bounce."
            }
            (chart(Some(compaction::chart::draw(map)), ""))
            details {
                summary { "All times" }
                pre { (map.text()) }
            }
        }
    }
}

pub(crate) fn of_part(part: &Part) -> Markup {
    html! {
        details {
            summary { h2 { "All measurements: " (part.quantity) } }
            p { "Reference: " (part.reference) ". Its own error is " (percent(part.reference_error)) "; errors below " (percent(part.least_error)) " are not reliable." }
            ul { @for sentence in part.sentences() { li { (sentence) } } }
            (chart(
                charts::overview(part),
                "All points. The line is the Pareto front: the points that no other point beats in both time and error."
            ))
            (front(part))
            @if let Some((ms, rows)) = equal_time(part) {
                (equal(&format!("Error after {}", duration(ms)), "error", &rows, percent))
            }
            @if let Some((error, rows)) = equal_error(part) {
                (equal(&format!("Time to reach {}", percent(error)), "time", &rows, duration))
            }
            @if let Some(default) = &part.default { (points(default)) }
            @for comparison in &part.comparisons {
                h3 { (comparison.axis.name()) }
                (chart(charts::of_axis(&comparison.curves), ""))
                @for curve in &comparison.curves { (points(curve)) }
            }
        }
    }
}

fn front(part: &Part) -> Markup {
    let head = html! { tr { th.name { "Pareto front" } th { "rounds" } th { "time" } th { "error" } } };
    let body = html! {
        @for (curve, point) in part.pareto_front() {
            tr { th scope="row" { (curve.label) } td { (point.rounds) } td { (duration(point.ms().value)) } td { (percent(point.error().value)) } }
        }
    };
    table(&head, &body)
}

/// All configurations at the same time or the same error.
fn equal(title: &str, what: &str, rows: &[Row], show: impl Fn(f64) -> String) -> Markup {
    let head = html! { tr { th.name { (title) } th { (what) } th { (CONFIDENCE_IN_WORDS) " interval" } th { "relative to base" } } };
    let body = html! {
        @for Row { name, value, ratio } in rows {
            tr {
                th scope="row" { (name) }
                @match value {
                    Ok(value) => {
                        td { (show(value.value)) }
                        td { @if value.low > 0.0 && value.low < value.high && value.high.is_finite() { (show(value.low)) " to " (show(value.high)) } }
                    },
                    Err(why) => { td { (why) } td {} },
                }
                td { (ratio.map_or_else(String::new, times)) }
            }
        }
    };
    html! {
        (table(&head, &body))
        p { "Each option was measured alternately with the base; ratios compare these runs." }
    }
}

fn points(curve: &Curve) -> Markup {
    let head = html! { tr { th { "rounds" } th { "photons" } th { "time (median)" } th { "fastest to slowest" } th { "wall" } th { "error" } th { (CONFIDENCE_IN_WORDS) " interval" } th { "noise" } th { "bias" } } };
    html! {
        details {
            summary { (curve.label) ": all points" }
            (table(&head, &html! { @for point in &curve.points { (row(point)) } }))
            @for point in &curve.points { p { code { (point.command) } } }
        }
    }
}

fn row(point: &Point) -> Markup {
    let (ms, error, bias) = (point.ms(), point.error(), point.bias());
    html! {
        tr {
            td { (point.rounds) }
            td { (count(point.photons)) }
            td { (duration(ms.value)) " " small { (clock(point)) } }
            td { (duration(ms.low)) " to " (duration(ms.high)) }
            td { (duration(point.wall())) }
            td { (percent(error.value)) }
            td { @if error.high.is_finite() { (percent(error.low)) " to " (percent(error.high)) } @else { "unknown" } }
            td { (percent(point.noise())) }
            td { @if bias.low > 0.0 { (percent(bias.value)) } @else if bias.high.is_finite() { "at most " (percent(bias.high)) } @else { "unknown" } }
        }
    }
}

pub(crate) fn how(study: &Study) -> Markup {
    html! {
        details {
            summary { h2 { "How this was measured" } }
            ul {
                li { "Error: RMS difference from the reference, relative to the RMS of the reference. The contribution of the reference's own noise is subtracted." }
                li { "Noise is the error that differs between runs with different seeds. Bias is the error that they share. Both are computed from the " (study.request.repeats) " runs of a point. Intervals and bands are " (CONFIDENCE_IN_WORDS) " confidence intervals (Student's t over those runs); few runs give wide bands." }
                li { "Time: device time of all rounds by timestamps, without set-up; the CPU builder uses the host's clock. Warm-up work before each run brings the device to its full clock. The time of a point is the median of its runs; the fastest and the slowest run show the drift of the clock." }
                li { "Times to reach an error are interpolated linearly between points on logarithmic scales, and never extrapolated." }
                li { "Each command repeats the first run of its point. The other runs use the seeds that follow." }
                li { "Pixels that show a light source directly are excluded from the error of images. This page has " (count(study.parts.iter().flat_map(Part::points).count() as u64)) " points." }
            }
        }
    }
}
