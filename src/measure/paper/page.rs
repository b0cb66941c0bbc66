//! The page: all results in one file that loads nothing.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};

use super::bench::PATIENCE;
use super::experiments::{LARGE_REPEATS, LONGEST_PASS_MS, LeftOut, Pass, RunningTime, TotalTime, series};
use super::figures::Figure;
use super::verdicts;
use super::{Reproduction, chart as charts, published};
use crate::output::page::{chart, commands, page, software_notice, table};
use crate::output::words::{count, duration, number, times};
use crate::settings::Gather;
use crate::text::counted;

const TITLE: &str = "Photon Mapping On The GPU, measured again";

pub fn html(found: &Reproduction) -> String {
    let content = html! {
        (head(found))
        (standing(found))
        (figures(found))
        (running_times(found))
        (table_1(found))
        (choices())
    };
    page(TITLE, &content)
}

fn head(found: &Reproduction) -> Markup {
    html! {
        header {
            h1 { (TITLE) }
            p { "Every figure and table of Scott Grauer-Gray's paper, reproduced with photonmill " (env!("CARGO_PKG_VERSION")) " and compared with the published numbers." }
            @if !found.complete {
                p.notice { strong { "Incomplete." } " The run was interrupted; this page shows the experiments that were complete." }
            }
            dl {
                dt { "Hardware in 2008" }
                dd { (published::HARDWARE) }
                dt { "Hardware here" }
                @match &found.machine.device {
                    Some(device) => dd { (device.name) "; driver " (device.driver) },
                    None => dd { "no Vulkan device" },
                }
                dt { "CPU builder" }
                dd { (found.machine.cpu) }
                dt { "Seed" }
                dd { "1 for all runs; generator rand48 (the paper's) at the paper's size, philox at the large size" }
                dt { "Sizes" }
                dd { (count(u64::from(published::PHOTONS))) " photons per round (the paper's size) and " (count(u64::from(found.request.large))) " photons per round (the large size)" }
            }
            (device_notice(found))
        }
    }
}

fn device_notice(found: &Reproduction) -> Markup {
    html! {
        @match &found.machine.device {
            None => p.notice { "No Vulkan device was found. Figures and times come from the CPU builder only." },
            Some(device) => {
                @if device.is_cpu {
                    (software_notice(" A comparison of GPU with CPU compares two programs on one processor."))
                }
                @if !device.has_timestamps {
                    p.notice { "This device has no timestamps. Times of single passes are unknown, and whole runs are timed by the host's clock." }
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
                p { "Too few experiments were completed to say." }
            }
            p { "These statements are computed from this run's measurements. The paper's size is 5000 photons and 2 bounces; the other sizes have 15 bounces, more photons, or both. Times within " (((verdicts::MARGIN - 1.0) * 100.0).round()) " % of each other count as equal." }
            @for verdict in &verdicts {
                h3 {
                    (verdict.topic)
                    @if let Some(standing) = verdict.standing {
                        " " span class={ "standing " (standing.class()) } { (standing.words()) }
                    }
                }
                p { (verdict.text) }
            }
        }
    }
}

fn figures(found: &Reproduction) -> Markup {
    html! {
        section id="figures" {
            h2 { "Figures 1 to 4" }
            p { "All figures use 5000 photons per round, rand48 and seed 1. A sorted grid finds the photons near a point; its sums are bit-identical to those of the paper's scan of the whole list." }
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
                    summary { "Commands" }
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
                "The map pass emits and traces photons; the rendering pass estimates the light at 5 × 64 × 64 points. "
                "GPU times come from the device's timestamps, CPU times from the host's clock. "
                "Each time is the median of up to " (counted(found.request.repeats, "run")) " (up to " (found.request.repeats.min(LARGE_REPEATS)) " at the large size); the fastest and slowest run stand below it. "
                "The builders run alternately. The first run of each case creates pipelines and is not counted. "
                "Warm-up work before each run brings the device to its full clock (" code { "--warm-up" } "). "
                "A case that takes longer than " (PATIENCE.as_secs()) " s in all is repeated less often; if its first run alone takes that long, that run is shown. "
                a href="#all-times" { "The table of all times" } " gives the number of runs."
            }
            h3 { "At the paper's size" }
            p { (count(u64::from(published::PHOTONS))) " photons, " (published::BOUNCES) " bounces, brute force: every point tests the whole photon list, including empty slots." }
            (beside_published(found))
            (chart(
                charts::running_times(found),
                "Both passes at the paper's size on a logarithmic scale. Grey: published in 2008. Orange: measured here. The paper has no grid."
            ))
            h3 id="all-times" { "All sizes" }
            p {
                "The large size uses philox. Rand48 gives each of N photons every Nth number (leap-frogging); "
                "these streams are strongly correlated when N is a power of two. "
                "Grid times include sorting the photons into the grid."
            }
            (all_times(found))
            (left_out(&found.passes_left_out, LONGEST_PASS_MS, "the same rendering pass at the paper's size"))
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

fn table_1(found: &Reproduction) -> Markup {
    let large = format!("Grid, {} photons per round (philox)", count(u64::from(found.request.large)));
    let titles = ["Brute force, as in the paper", "The same photons, sorted into a grid", &large];
    html! {
        section id="table-1" {
            h2 { "Table 1: time against photons" }
            p { "The modified implementation with rounds of 5000 photons, 15 bounces, radius 0.025 m and Phong walls of shininess 5. Each row is one run. A short row follows an uncounted run that creates the pipelines. 'GPU' is the device time of all rounds; 'wall' is the time of the whole run, including the creation of buffers." }
            @for ((photons, gather), title) in series(&found.request).into_iter().zip(titles) {
                (totals_of(found, photons, gather, title))
            }
            (left_out(&found.totals_left_out, found.request.longest_ms, "the time per round of the previous row"))
            (chart(
                charts::totals(found),
                "Run time against photons, both scales logarithmic. A slope of 1 means that time is proportional to photons."
            ))
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

fn choices() -> Markup {
    html! {
        section id="choices" {
            h2 { "What the paper leaves open" }
            p { "photonmill has an option for each of these choices. This page uses the defaults:" }
            ul {
                li { "The lights are discs of radius 0.05 m and 1 W each, flush with the floor and the left wall at their centres. They neither block photons nor change the reflectance of their wall." }
                li { "'Uniform in all directions' is taken as equal intensity over the hemisphere, not as Lambertian emission." }
                li { "The 64 × 64 points of a wall are the centres of its texels." }
                li { "The eye for the Phong weight is at (0, 0, 1) m, in front of the opening. The weight uses the mirror direction; negative cosines count as 0." }
                li { "A photon is stored where it is reflected, at most once per bounce. The illumination of a point is the number of photons within the radius divided by 90 (by 10 per round in figure 4 and table 1); values of 1 and more are shown as white." }
            }
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
        assert!(page.contains("Incomplete") && page.contains("No Vulkan device was found"));
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
