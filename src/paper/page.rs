//! The page: everything that was found, in one file that loads nothing.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::bench::PATIENCE;
use super::experiments::{Builder, LONGEST_PASS_MS, LeftOut, Pass, RunningTime, TotalTime};
use super::figures::Figure;
use super::verdicts::{self, Standing};
use super::{Reproduction, chart, published};
use crate::output::words::{count, duration, number, times};
use crate::settings::{Gather, Variant};

pub fn html(found: &Reproduction) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "Photon Mapping On The GPU, measured again" }
                style { (PreEscaped(include_str!("../output/page.css"))) }
            }
            body {
                main {
                    (head(found))
                    (standing(found))
                    (figures(found))
                    (running_times(found))
                    (table_1(found))
                    (choices())
                }
            }
        }
    };
    page.into_string()
}

fn head(found: &Reproduction) -> Markup {
    html! {
        header {
            h1 { "Photon Mapping On The GPU, measured again" }
            p { "Every figure and table of Scott Grauer-Gray's paper, made anew with photonmill " (env!("CARGO_PKG_VERSION")) " and set beside the published numbers." }
            @if !found.complete {
                p.notice { strong { "Incomplete." } " The run was ended before its last experiment; what is here was finished before that." }
            }
            dl {
                dt { "Then" }
                dd { (published::HARDWARE) }
                dt { "Here" }
                @match &found.machine.device {
                    Some(device) => dd { (device.name) "; driver " (device.driver) },
                    None => dd { "no Vulkan device" },
                }
                dt { "CPU builder" }
                dd { (found.machine.cpu) }
                dt { "Seed" }
                dd { "1 throughout; rand48, the paper's generator, at the paper's size, and philox at the large size" }
                dt { "Sizes" }
                dd { (count(u64::from(published::PHOTONS))) " photons as in the paper, and " (count(u64::from(found.request.large))) " photons a round" }
            }
            (device_notice(found))
        }
    }
}

fn device_notice(found: &Reproduction) -> Markup {
    html! {
        @match &found.machine.device {
            None => p.notice { "Vulkan was not found here. Figures come from the CPU builder, and only its times are known." },
            Some(device) => {
                @if device.is_cpu {
                    p.notice { strong { "This device is software." } " It runs Vulkan on the CPU, so every 'GPU' time on this page is the time of a CPU, and comparing GPU with CPU compares two programs on one processor." }
                }
                @if !device.has_timestamps {
                    p.notice { "This device has no timestamps. Times of single passes on it are not known, and whole runs are timed by the host's clock." }
                }
            }
        }
    }
}

fn standing(found: &Reproduction) -> Markup {
    let verdicts = verdicts::all(found);
    html! {
        section id="standing" {
            h2 { "What still holds from 2008, and what does not" }
            @if verdicts.is_empty() {
                p { "Too little was measured to say." }
            }
            p { "Every sentence is made of this run's numbers. The paper's size is 5000 photons and 2 bounces; the other sizes have 15 bounces, more photons, or both. Times within " (((verdicts::MARGIN - 1.0) * 100.0).round()) " % of each other count as equal." }
            @for verdict in &verdicts {
                h3 {
                    (verdict.topic)
                    @if let Some(standing) = verdict.standing {
                        " " span class={ "standing " (standing_class(standing)) } { (standing.words()) }
                    }
                }
                p { (verdict.text) }
            }
        }
    }
}

fn standing_class(standing: Standing) -> &'static str {
    match standing {
        Standing::Holds => "holds",
        Standing::HoldsInPart => "in-part",
        Standing::NoLonger => "no-longer",
    }
}

fn figures(found: &Reproduction) -> Markup {
    html! {
        section id="figures" {
            h2 { "Figures 1 to 4" }
            p { "All with 5000 photons a round, rand48 and seed 1. Photons near a point are found through the sorted grid, which gives the same sums as the paper's step through the whole list, to the bit." }
            @for figure in &found.figures {
                (self::figure(figure))
            }
        }
    }
}

fn figure(figure: &Figure) -> Markup {
    html! {
        figure {
            img src={ "data:image/png;base64," (STANDARD.encode(&figure.png)) } width=(figure.width) height=(figure.height) alt={ "The open box: " (figure.title) };
            figcaption {
                p { strong { "Figure " (figure.number) ": " (figure.title) "." } " " (figure.caption) }
                details {
                    summary { "Repeat it" }
                    @for frame in &figure.frames {
                        p { (frame.label) ": " code { (frame.command) } }
                    }
                }
            }
        }
    }
}

fn running_times(found: &Reproduction) -> Markup {
    html! {
        section id="running-times" {
            h2 { "Running times (section 4.3)" }
            p {
                "The map pass emits photons and bounces them; the rendering pass estimates the light at 5 × 64 × 64 points. "
                "Times of the device are its own timestamps, those of the CPU builder are wall time. "
                "The first run of each case is dropped, as it makes pipelines; then the median of " (found.request.repeats) " runs, at the large size of at most 3, the builders in turn, with the shortest and longest run below it. "
                "A card that idled runs at a low clock, so it is kept busy before each run (--warm-up). "
                "A case whose runs take longer than " (PATIENCE.as_secs()) " s together is repeated less, and one whose first run alone does keeps that run; " a href="#all-times" { "the table of all times" } " says how often."
            }
            h3 { "At the paper's size" }
            p { (count(u64::from(published::PHOTONS))) " photons, " (published::BOUNCES) " bounces, brute force: every point steps through the whole photon list, empty slots included." }
            (beside_published(found))
            @if let Some(chart) = chart::running_times(found) {
                figure.chart {
                    div.scroll { (PreEscaped(chart)) }
                    figcaption { p { "Both passes at the paper's size, on a logarithmic scale: grey as published, orange here. The grid has no counterpart in the paper." } }
                }
            }
            h3 id="all-times" { "All sizes" }
            p {
                "At the large size the random numbers are philox's. Rand48 is dealt out to photons by leap-frogging, each taking every Nth number; "
                "with a power of two as N those streams are almost regular, and the paper's size is the only one that needs the paper's generator. "
                "The grid's time includes sorting the photons into it."
            }
            (all_times(found))
            (left_out(&found.passes_left_out, LONGEST_PASS_MS, "the same rendering pass at the paper's size"))
        }
    }
}

/// The paper's comparison: each builder, each pass, then and here.
fn beside_published(found: &Reproduction) -> Markup {
    let passes = [(Pass::Map, None), (Pass::Rendering, Some(Gather::Brute))];
    let time = |builder: Builder, (pass, gather): (Pass, Option<Gather>)| {
        found.running_time(published::PHOTONS, published::BOUNCES, builder, pass, gather)
    };
    html! {
        div.scroll { table {
            thead {
                tr { th.name rowspan="2" { "Builder" } th colspan="3" { "Map pass, ms" } th colspan="3" { "Rendering pass, ms" } }
                tr { @for _ in passes { th { "2008" } th { "here" } th { "2008 / here" } } }
            }
            tbody {
                @for builder in found.builders() {
                    tr {
                        th scope="row" { (described(builder)) }
                        @for pass in passes {
                            @let time = time(builder, pass);
                            @let then = time.and_then(RunningTime::published_ms);
                            td { (exact(then)) }
                            td { (spread(time)) }
                            td { (ratio(then, time.map(|time| time.ms.median))) }
                        }
                    }
                }
            }
        } }
    }
}

fn all_times(found: &Reproduction) -> Markup {
    html! {
        div.scroll { table {
            thead {
                tr {
                    th { "Photons" } th { "Bounces" } th.name { "Builder" } th { "Photons stored" }
                    th { "Map, ms" } th { "Brute force, ms" } th { "Grid, ms" } th { "Runs" }
                }
            }
            tbody {
                @for (photons, bounces) in found.sizes() {
                    @for builder in found.builders() {
                        @let time = |pass, gather| found.running_time(photons, bounces, builder, pass, gather);
                        @let map = time(Pass::Map, None);
                        @let brute = time(Pass::Rendering, Some(Gather::Brute));
                        @let grid = time(Pass::Rendering, Some(Gather::Grid));
                        @if let Some(map) = map.or(brute).or(grid) {
                            tr {
                                td { (count(u64::from(photons))) } td { (bounces) } th scope="row" { (described(builder)) } td { (count(map.stored)) }
                                td { (spread(time(Pass::Map, None))) } td { (spread(brute)) } td { (spread(grid)) }
                                td { (runs([brute, grid])) }
                            }
                        }
                    }
                }
            }
        } }
        details {
            summary { "Repeat them" }
            @for time in found.running_times.iter().filter(|time| time.pass == Pass::Rendering) {
                p { code { (time.command) } }
            }
        }
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
            p { "Left out, as " (known) " predicts more than " (duration(limit_ms)) ":" }
            ul {
                @for left_out in experiments {
                    li { (left_out.what) ": about " (duration(left_out.predicted_ms)) }
                }
            }
        }
    }
}

fn table_1(found: &Reproduction) -> Markup {
    let (small, large) = (published::PHOTONS, found.request.large);
    html! {
        section id="table-1" {
            h2 { "Table 1: time against photons" }
            p { "Rounds of 5000 photons, 15 bounces, radius 0.025 m, Phong walls of shininess 5; the modified implementation. Each row is one run, after one that is dropped. 'GPU' is the device's time in rounds, 'wall' the whole run with its buffers." }
            (totals_of(found, small, Gather::Brute, "Brute force, as in the paper"))
            (totals_of(found, small, Gather::Grid, "The same photons, sorted into a grid"))
            (totals_of(found, large, Gather::Grid, &format!("Grid, {} photons a round (philox)", count(u64::from(large)))))
            (left_out(&found.totals_left_out, found.request.longest_ms, "a round of the row before"))
            @if let Some(chart) = chart::totals(found) {
                figure.chart {
                    div.scroll { (PreEscaped(chart)) }
                    figcaption { p { "Time of the whole implementation against photons, both scales logarithmic: a line that climbs one decade of time with each decade of photons is time in proportion to them." } }
                }
            }
        }
    }
}

fn totals_of(found: &Reproduction, photons_per_round: u32, gather: Gather, title: &str) -> Markup {
    let totals: Vec<&TotalTime> = found.totals_of(photons_per_round, gather).collect();
    let has_published = totals.iter().any(|total| total.published_ms().is_some());
    html! {
        @if !totals.is_empty() {
            h3 { (title) }
            div.scroll { table {
                thead { tr {
                    th { "Photons" } th { "Rounds" }
                    @if has_published { th { "2008, ms" } }
                    th { "GPU, ms" } th { "wall, ms" }
                    @if has_published { th { "2008 / wall" } }
                    th { "photons a second" }
                } }
                tbody {
                    @for total in &totals {
                        tr {
                            td { (count(total.photons())) } td { (total.rounds) }
                            @if has_published { td { (exact(total.published_ms())) } }
                            td { (total.gpu_ms.map_or_else(|| "–".to_owned(), number)) } td { (number(total.wall_ms)) }
                            @if has_published { td { (ratio(total.published_ms(), Some(total.wall_ms))) } }
                            td { (number(total.photons() as f64 / (total.wall_ms / 1e3))) }
                        }
                    }
                }
            } }
            details {
                summary { "Repeat it" }
                @for total in &totals {
                    p { code { (total.command) } }
                }
            }
        }
    }
}

fn choices() -> Markup {
    html! {
        section id="choices" {
            h2 { "What the paper leaves open" }
            p { "Each of these is an option of photonmill; here they are its defaults." }
            ul {
                li { "The lights are discs of radius 0.05 m and 1 W each, flush in the centres of the floor and the left wall; a disc neither blocks its wall nor changes it." }
                li { "'Uniform in all directions' is read as the same intensity over the whole hemisphere, not Lambertian." }
                li { "The 64 × 64 points of a wall lie at the centres of its texels." }
                li { "The eye of the Phong weight is at (0, 0, 1) m, in front of the opening; the reflected direction is the mirrored one; negative cosines count nothing." }
                li { "A photon is stored where it is reflected, at most once a bounce; the illumination is the photons within the radius over 90 (over 10 a round in figure 4 and table 1), and 1 and more is shown as full." }
            }
        }
    }
}

fn described(builder: Builder) -> String {
    match (builder.variant, builder.threads) {
        (Variant::Naive, _) => "naive (slots)".to_owned(),
        (Variant::Atomic, _) => "modified (atomic)".to_owned(),
        (Variant::Cpu, 1) => "CPU, 1 thread".to_owned(),
        (Variant::Cpu, threads) => format!("CPU, {threads} threads"),
        (variant, _) => variant.name().to_owned(),
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

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;

    #[test]
    fn the_page_loads_nothing() {
        let page = html(&sample::reproduction());
        for address in ["http://", "https://", "@import", "url(", "<link", "<script"] {
            assert!(!page.contains(address), "{address} in the page");
        }
        let sources: Vec<&str> = page.split("src=\"").skip(1).collect();
        assert_eq!(sources.len(), sample::reproduction().figures.len());
        assert!(sources.iter().all(|source| source.starts_with("data:")));
    }

    #[test]
    fn names_are_escaped() {
        let mut found = sample::reproduction();
        found.machine.device.as_mut().unwrap().name = "<b>&\"device".to_owned();
        let page = html(&found);
        assert!(page.contains("&lt;b&gt;&amp;&quot;device") && !page.contains("<b>"));
    }

    #[test]
    fn the_page_says_what_it_lacks() {
        let mut found = sample::reproduction();
        assert!(!html(&found).contains("Incomplete"));
        assert!(html(&found).contains("This device is software"));
        found.complete = false;
        found.machine.device = None;
        let page = html(&found);
        assert!(page.contains("Incomplete") && page.contains("Vulkan was not found here"));
    }

    #[test]
    fn what_was_left_out_is_named() {
        assert!(html(&sample::reproduction()).contains("a long run: about 100\u{a0}s"));
    }

    #[test]
    fn published_numbers_stand_beside_measured_ones() {
        let page = html(&sample::reproduction());
        for shown in ["1.7", "3000", "105\u{202f}640", "photonmill --preset rounds --rounds 50 --gather brute"] {
            assert!(page.contains(shown), "{shown} is not on the page");
        }
    }
}
