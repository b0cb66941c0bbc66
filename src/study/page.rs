//! The page: everything that was found, in one file that loads nothing.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::findings::{self, Row, clock, equal_error, equal_time, percent};
use super::point::{Curve, Point};
use super::{Part, Study, chart};
use crate::compaction::{self, Map};
use crate::output::words::{count, duration, number, times};

pub fn html(study: &Study) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "What accuracy costs in time: " (study.request.scene) }
                style { (PreEscaped(include_str!("../output/page.css"))) }
            }
            body {
                main {
                    (head(study))
                    @for part in &study.parts {
                        (of_part(part))
                    }
                    @if let Some(map) = &study.compaction {
                        (of_builders(map))
                    }
                    (how(study))
                }
            }
        }
    };
    page.into_string()
}

fn head(study: &Study) -> Markup {
    let request = &study.request;
    html! {
        header {
            h1 { "What accuracy costs in time: " (request.scene) }
            p { "Relative root mean square error against time, for every choice that photonmill " (study.photonmill) " offers on this scene." }
            @if !study.complete {
                p.notice { strong { "Incomplete." } " The study was ended before its last point. The same command goes on from here." }
            }
            @if study.is_cpu {
                p.notice { strong { "This device is software." } " It runs Vulkan on the CPU, so every 'GPU' time on this page is the time of a CPU." }
            }
            dl {
                dt { "Device" }
                dd { (study.device) "; driver " (study.driver) }
                dt { "Photons a round" }
                dd { (count(u64::from(request.photons))) ", where the configuration says nothing else" }
                dt { "Runs of a point" }
                dd { (request.repeats) ", with the seeds " (request.seed) " to " (request.seed + u64::from(request.repeats) - 1) }
            }
        }
    }
}

fn of_builders(map: &Map) -> Markup {
    html! {
        section {
            h2 { "Who wins where" }
            p {
                "Time to trace and store photons of " (map.bounces) " bounces in a closed room that lets a share of them go on at every wall. "
                "In each field the fastest builder, how many times sooner it is done than with one atomic a thread, and, below, "
                "who cannot be told from it. All builders stored the same photons to the bit, up to a million of them; of more the same "
                "number met each fate at each bounce."
            }
            figure { (PreEscaped(compaction::chart::draw(map))) }
            details {
                summary { "All times" }
                pre { (map.text()) }
            }
        }
    }
}

fn of_part(part: &Part) -> Markup {
    html! {
        section {
            h2 { (part.quantity) }
            p { "Reference: " (part.reference) "; known to " (percent(part.reference_error)) ". Errors below that are not to be trusted." }
            ul { @for sentence in part.sentences() { li { (sentence) } } }
            @if let Some(drawn) = chart::overview(part) {
                figure {
                    div.scroll { (PreEscaped(drawn)) }
                    figcaption { "All points; the line joins those that no other beats in both time and error." }
                }
            }
            (front(part))
            @if let Some((ms, rows)) = equal_time(part) {
                (table(&format!("Equal time: the error after {}", duration(ms)), "error", &rows, percent))
            }
            @if let Some((error, rows)) = equal_error(part) {
                (table(&format!("Equal error: the time to {}", percent(error)), "time", &rows, duration))
            }
            @for comparison in &part.comparisons {
                h3 { (comparison.axis.name()) }
                @if let Some(drawn) = chart::of_axis(&comparison.curves) {
                    figure { div.scroll { (PreEscaped(drawn)) } }
                }
                @for curve in &comparison.curves { (points(curve)) }
            }
        }
    }
}

fn front(part: &Part) -> Markup {
    html! {
        div.scroll {
            table {
                thead { tr { th.name { "On the Pareto front" } th { "rounds" } th { "time" } th { "error" } } }
                tbody {
                    @for (curve, point) in part.pareto_front() {
                        tr { th scope="row" { (curve.label) } td { (point.rounds) } td { (duration(point.ms().value)) } td { (percent(point.error().value)) } }
                    }
                }
            }
        }
    }
}

fn table(title: &str, what: &str, rows: &[Row], show: impl Fn(f64) -> String) -> Markup {
    html! {
        div.scroll {
            table {
                thead { tr { th.name { (title) } th { (what) } th { (findings::words_of_confidence()) } th { "over the base" } } }
                tbody {
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
                }
            }
        }
        p { "Ratios are to the base that was measured in turn with the choice." }
    }
}

fn points(curve: &Curve) -> Markup {
    html! {
        details {
            summary { (curve.label) ": every point" }
            div.scroll {
                table {
                    thead { tr { th { "rounds" } th { "photons" } th { "time (median)" } th { "least to most" } th { "wall" } th { "error" } th { (findings::words_of_confidence()) } th { "noise" } th { "bias" } } }
                    tbody { @for point in &curve.points { (row(point)) } }
                }
            }
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
            td { @if bias.low > 0.0 { (percent(bias.value)) } @else { "at most " (if bias.high.is_finite() { percent(bias.high) } else { "unknown".to_owned() }) } }
        }
    }
}

fn how(study: &Study) -> Markup {
    html! {
        section {
            h2 { "How this was measured" }
            ul {
                li { "Error: root of the mean squared difference from the reference over the reference's root mean square. What the reference's own noise adds is taken off." }
                li { "Noise is what runs with different seeds differ by, and bias what they have in common; both come from the " (study.request.repeats) " runs of a point. Intervals and bands hold the truth with " (findings::words_of_confidence()) " by Student's distribution over those runs; few runs make wide bands." }
                li { "Time: all rounds by the device's timestamps, without set-up; the host's clock for the CPU builder. A card that idled runs at a low clock, so it is kept busy before each run. The middle of the runs counts, and the least and the most show how the clock drifts." }
                li { "Times to an error lie on straight lines between points on logarithmic scales, and are given only between errors that were measured." }
                li { "Every command repeats the first run of its point; the others have the seeds that follow." }
                li { "A picture leaves out pixels in which a light is seen straight. " (number(study.parts.iter().map(|part| part.curves().map(|curve| curve.points.len()).sum::<usize>()).sum::<usize>() as f64)) " points in all." }
            }
        }
    }
}
