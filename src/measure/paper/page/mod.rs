//! The page: all results in one file that loads nothing.

mod figures;
mod summary;
mod times;

use maud::{Markup, PreEscaped, html};

use super::{Reproduction, published, verdicts};
use crate::output::page::{page, software_notice};
use crate::output::words::count;

const TITLE: &str = "Photon Mapping On The GPU, measured again";

pub(crate) fn html(found: &Reproduction) -> String {
    let content = html! {
        style { (PreEscaped(include_str!("page.css"))) }
        (head(found))
        (summary::summary(&verdicts::all(found)))
        (figures::figures(found))
        (times::running_times(found))
        (times::table_1(found))
        (choices())
    };
    page(TITLE, &content)
}

fn head(found: &Reproduction) -> Markup {
    html! {
        header {
            h1 { (TITLE) }
            p { "Every figure and table of Scott Grauer-Gray's paper of 2008, computed again with photonmill " (env!("CARGO_PKG_VERSION")) " and compared with the published numbers." }
            @if !found.complete {
                p.notice { strong { "Incomplete." } " The run was interrupted; this page shows the experiments that were complete." }
            }
            dl {
                dt { "2008" }
                dd { (published::HARDWARE) }
                dt { "Here" }
                @match &found.device {
                    Some(device) => dd { (device.name) "; driver " (device.driver) },
                    None => dd { "no Vulkan device" },
                }
                dt { "CPU here" }
                dd { (found.cpu) }
                dt { "Sizes" }
                dd { (count(u64::from(published::PHOTONS))) " photons per round and 2 bounces as in the paper; other sizes have " (count(u64::from(found.request.large))) " photons per round, 15 bounces, or both" }
            }
            (device_notice(found))
        }
    }
}

fn device_notice(found: &Reproduction) -> Markup {
    html! {
        @match &found.device {
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

fn choices() -> Markup {
    html! {
        section id="choices" {
            h2 { "What the paper leaves open" }
            details {
                summary { "The choices of this page; photonmill has an option for each" }
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::paper::sample;

    #[test]
    fn the_page_has_everything_and_loads_nothing() {
        let mut found = sample::reproduction();
        found.device.as_mut().unwrap().name = "<b>&\"device".to_owned();
        let page = html(&found);
        for address in ["http", "@import", "url(", "<link", "<script"] {
            assert!(!page.contains(address), "{address} in the page");
        }
        let sources: Vec<&str> = page.split("src=\"").skip(1).collect();
        assert_eq!(sources.len(), found.figures.len());
        assert!(sources.iter().all(|source| source.starts_with("data:")));
        assert!(page.contains("&lt;b&gt;&amp;&quot;device") && !page.contains("<b>"), "names are escaped");
        // Published numbers beside measured ones, the series of both charts, and what was left out.
        let shown = ["1.7", "3000", "105\u{202f}640", "photonmill --preset rounds --rounds 50 --gather brute", "This device is software"];
        for shown in shown.into_iter().chain(["here, brute force", "map: naive", "a long run: about 100\u{a0}s"]) {
            assert!(page.contains(shown), "{shown} is not on the page");
        }
        assert!(!page.contains("Incomplete"));
        // Every finding is a row with its verdict.
        let verdicts = verdicts::all(&found);
        assert_eq!(page.matches("<details class=\"claim\">").count(), verdicts.len());
        assert_eq!(page.matches("class=\"standing ").count(), verdicts.iter().filter(|verdict| verdict.standing.is_some()).count());
    }

    #[test]
    fn the_page_says_what_it_lacks() {
        let mut found = sample::reproduction();
        found.complete = false;
        found.running_times.clear();
        found.totals.clear();
        found.figures.clear();
        let page = html(&found);
        assert!(page.contains("Incomplete") && page.contains("Too few experiments were completed to say."));
        assert!(!page.contains("Beyond the paper") && !page.contains("<svg"), "nothing is said or drawn of what was not measured");
        found.device = None;
        assert!(html(&found).contains("No Vulkan device was found"));
    }
}
