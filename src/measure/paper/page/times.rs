//! Running times and table 1, beside what the paper printed.

use maud::{Markup, html};

use crate::measure::paper::bench::PATIENCE;
use crate::measure::paper::experiments::{LARGE_REPEATS, LONGEST_PASS_MS, LeftOut, Pass, RunningTime, TotalTime, series};
use crate::measure::paper::{Reproduction, chart as charts, published};
use crate::output::page::{chart, commands, table};
use crate::output::words::{count, duration, number, times};
use crate::settings::Gather;
use crate::text::counted;

pub(crate) fn running_times(found: &Reproduction) -> Markup {
    html! {
        section id="running-times" {
            h2 { "Running times (section 4.3)" }
            p {
                "The map pass emits and traces photons; the rendering pass estimates the light at 5 × 64 × 64 points. "
                "At the paper's size: " (count(u64::from(published::PHOTONS))) " photons, " (published::BOUNCES) " bounces, brute force. "
                "Each time is a median; the fastest and slowest run stand below it."
            }
            (beside_published(found))
            (chart(
                charts::running_times(found),
                "Both passes at the paper's size on a logarithmic scale: published in 2008, and measured here. The paper has no grid."
            ))
            details {
                summary { "All sizes" }
                p {
                    "The large size uses philox. Rand48 gives each of N photons every Nth number (leap-frogging); "
                    "these streams are strongly correlated when N is a power of two. "
                    "Grid times include sorting the photons into the grid."
                }
                (all_times(found))
                (left_out(&found.passes_left_out, LONGEST_PASS_MS, "the same rendering pass at the paper's size"))
            }
            details {
                summary { "How times are measured" }
                p {
                    "GPU times come from the device's timestamps, CPU times from the host's clock. "
                    "Brute force tests every point against the whole photon list, including empty slots. "
                    "Each case has up to " (counted(found.request.repeats, "run")) " (up to " (found.request.repeats.min(LARGE_REPEATS)) " at the large size). "
                    "The builders run alternately. The first run of each case creates pipelines and is not counted. "
                    "Warm-up work before each run brings the device to its full clock (" code { "--warm-up" } "). "
                    "A case that takes longer than " (PATIENCE.as_secs()) " s in all is repeated less often; if its first run alone takes that long, that run is shown. "
                    "The table of all sizes gives the number of runs."
                }
            }
        }
    }
}

/// The paper's comparison: each builder, each pass, then and here.
fn beside_published(found: &Reproduction) -> Markup {
    let passes = [Pass::Map, Pass::Rendering(Gather::Brute)];
    let head = html! {
        tr { th.name rowspan="2" { "Implementation" } th colspan="3" { "Map pass, ms" } th colspan="3" { "Rendering pass, ms" } }
        tr { @for _ in passes { th { "2008" } th { "here" } th { "2008 / here" } } }
    };
    let body = html! {
        @for implementation in found.implementations() {
            tr {
                th scope="row" { (implementation.described()) }
                @for pass in passes {
                    @let time = found.running_time(published::PHOTONS, published::BOUNCES, implementation, pass);
                    @let then = time.and_then(RunningTime::published_ms);
                    td { (exact(then)) } td { (spread(time)) } td { (ratio(then, time.map(|time| time.ms.median))) }
                }
            }
        }
    };
    table(&head, &body)
}

fn all_times(found: &Reproduction) -> Markup {
    let head = html! {
        tr {
            th { "Photons" } th { "Bounces" } th.name { "Implementation" } th { "Photons stored" }
            th { "Map, ms" } th { "Brute force, ms" } th { "Grid, ms" } th { "Runs" }
        }
    };
    let body = html! {
        @for (photons, bounces) in found.sizes() {
            @for implementation in found.implementations() {
                @let [map, brute, grid] = Pass::ALL.map(|pass| found.running_time(photons, bounces, implementation, pass));
                @if let Some(any) = map.or(brute).or(grid) {
                    tr {
                        td { (count(u64::from(photons))) } td { (bounces) } th scope="row" { (implementation.described()) } td { (count(any.stored)) }
                        td { (spread(map)) } td { (spread(brute)) } td { (spread(grid)) } td { (runs([brute, grid])) }
                    }
                }
            }
        }
    };
    html! {
        (table(&head, &body))
        (commands(found.running_times.iter().filter(|time| time.pass != Pass::Map).map(|time| &time.command)))
    }
}

/// Runs that count, with brute force and with the grid, if they differ.
fn runs(times: [Option<&RunningTime>; 2]) -> String {
    let mut repeats: Vec<usize> = times.iter().flatten().map(|time| time.ms.repeats).collect();
    repeats.dedup();
    repeats.iter().map(ToString::to_string).collect::<Vec<_>>().join(" and ")
}

fn left_out(experiments: &[LeftOut], limit_ms: f64, known: &str) -> Markup {
    html! {
        @if !experiments.is_empty() {
            p { "Not measured, because " (known) " predicts more than " (duration(limit_ms)) " each:" }
            ul {
                @for left_out in experiments {
                    li { (left_out.what) ": about " (duration(left_out.predicted_ms)) }
                }
            }
        }
    }
}

pub(crate) fn table_1(found: &Reproduction) -> Markup {
    let large = format!("Grid, {} photons per round (philox)", count(u64::from(found.request.large)));
    let titles = ["Brute force, as in the paper", "The same photons, sorted into a grid", &large];
    html! {
        section id="table-1" {
            h2 { "Table 1: time against photons" }
            p { "The modified implementation with rounds of 5000 photons, 15 bounces, radius 0.025 m and Phong walls of shininess 5." }
            (chart(
                charts::totals(found),
                "Run time against photons, both scales logarithmic. A slope of 1 means that time is proportional to photons."
            ))
            details {
                summary { "Every row" }
                p { "Each row is one run. A short row follows an uncounted run that creates the pipelines. 'GPU' is the device time of all rounds; 'wall' is the time of the whole run, including the creation of buffers." }
                @for ((photons, gather), title) in series(&found.request).into_iter().zip(titles) {
                    (totals_of(found, photons, gather, title))
                }
                (left_out(&found.totals_left_out, found.request.longest_ms, "the time per round of the previous row"))
            }
        }
    }
}

fn totals_of(found: &Reproduction, photons_per_round: u32, gather: Gather, title: &str) -> Markup {
    let totals: Vec<&TotalTime> = found.totals_of(photons_per_round, gather).collect();
    let has_published = totals.iter().any(|total| total.published_ms().is_some());
    let head = html! {
        tr {
            th { "Photons" } th { "Rounds" }
            @if has_published { th { "2008, ms" } }
            th { "GPU, ms" } th { "wall, ms" }
            @if has_published { th { "2008 / wall" } }
            th { "photons/s" }
        }
    };
    let body = html! {
        @for total in &totals {
            tr {
                td { (count(total.photons())) } td { (total.rounds) }
                @if has_published { td { (exact(total.published_ms())) } }
                td { (total.gpu_ms.map_or_else(|| "–".to_owned(), number)) } td { (number(total.wall_ms)) }
                @if has_published { td { (ratio(total.published_ms(), Some(total.wall_ms))) } }
                td { (number(total.photons() as f64 / (total.wall_ms / 1e3))) }
            }
        }
    };
    html! {
        @if !totals.is_empty() {
            h3 { (title) }
            (table(&head, &body))
            (commands(totals.iter().map(|total| &total.command)))
        }
    }
}

/// A published number, all its digits.
fn exact(ms: Option<f64>) -> String {
    match ms {
        None => "–".to_owned(),
        Some(ms) if ms.fract() == 0.0 => count(ms as u64),
        Some(ms) => ms.to_string(),
    }
}

/// Median, and below it the extremes.
fn spread(time: Option<&RunningTime>) -> Markup {
    html! {
        @match time {
            None => "–",
            Some(time) => {
                (number(time.ms.median))
                @if time.ms.repeats > 1 { small { (number(time.ms.min)) "–" (number(time.ms.max)) } }
            }
        }
    }
}

fn ratio(then: Option<f64>, here: Option<f64>) -> String {
    then.zip(here).map_or("–".to_owned(), |(then, here)| times(then / here))
}
