//! The page: pictures, three sentences, a chart and a table in one file that loads nothing; the rest folds away.

use maud::{Markup, PreEscaped, html};

use super::findings::{Choice, Effect, between, ratio};
use super::strip::{Frame, Strip};
use super::{Part, Study, chart as charts, details, summary};
use crate::measure::interval::Interval;
use crate::output::page::{chart, page, picture, software_notice, table};
use crate::output::words::duration;
use crate::text::{counted, percent};

pub(crate) fn html(study: &Study) -> String {
    let title = format!("What accuracy costs in time: {}", study.title);
    let (main, others) = study.parts.split_first().map_or((None, &[][..]), |(main, others)| (Some(main), others));
    let content = html! {
        (head(study, &title))
        @if let Some(part) = main {
            @if let Some(strip) = &part.strip { (pictures(strip, part.least_error)) }
            @for sentence in summary::sentences(study, part) { p.lead { (sentence) } }
            (chart(charts::main(study, part), "Error against time on logarithmic scales. Bands are 95 % confidence intervals; a line is drawn only where they are narrow. Errors that the reference cannot judge are left out."))
            @if !study.request.peers.is_empty() {
                p.soft { "Other programs' times are of the machine that their file was made on, and on the open box of lamps by the cosine law." }
            }
            (choices(part))
        }
        @for part in others {
            details {
                summary { h2 { "What each choice buys: " (part.quantity) } }
                (chart(charts::main(study, part), ""))
                (choices(part))
            }
        }
        @for part in &study.parts { (details::of_part(part)) }
        @if let Some(map) = &study.compaction { (details::of_builders(map)) }
        (details::how(study))
    };
    page(&title, &content)
}

fn head(study: &Study, title: &str) -> Markup {
    html! {
        header {
            h1 { (title) }
            p.soft { "photonmill " (study.photonmill) " on " (study.device) ", driver " (study.driver) ". "
                (counted(study.parts.iter().flat_map(Part::points).count(), "point")) ", each of " (counted(study.request.repeats as usize, "run")) "." }
            @if !study.complete {
                p.notice { strong { "Incomplete." } " The study was interrupted. The same command continues it." }
            }
            @if study.is_cpu { (software_notice("")) }
        }
    }
}

fn pictures(strip: &Strip, least: f64) -> Markup {
    let full = percent(strip.scale);
    html! {
        div.strip {
            @for frame in &strip.frames { (self::frame(frame, least)) }
        }
        p.scale { "darker, -" (full) span style="background:linear-gradient(90deg,#0072b2,#fff,#d55e00)" {} "brighter, +" (full) " of the mean" }
        @if !strip.frames.is_empty() { (slider(strip)) }
    }
}

fn frame(frame: &Frame, least: f64) -> Markup {
    html! {
        div {
            (picture("png", &frame.picture, frame.size, &format!("The picture at an error of {}", known_error(frame.error, least))))
            (picture("png", &frame.difference, frame.size, "Its difference from the reference in false colours"))
            strong { (asked(frame)) } " in " strong { (duration(frame.ms)) }
            div.soft { "true error " (known_error(frame.error, least)) ", " (counted(frame.rounds as usize, "round")) }
        }
    }
}

/// Smaller ones say more of the reference.
fn known_error(error: f64, least: f64) -> String {
    if error < least { format!("below {}", percent(least)) } else { percent(error) }
}

/// A round number.
fn asked(frame: &Frame) -> String {
    format!("{}\u{a0}%", 100.0 * frame.asked)
}

/// Any two pictures, one over the other up to a line that can be moved.
fn slider(strip: &Strip) -> Markup {
    let names: Vec<String> = strip.frames.iter().map(asked).chain(["reference".to_owned()]).collect();
    let last = names.len() - 1;
    let choice = |id: &str, chosen: usize| {
        html! {
            select id=(id) { @for (number, name) in names.iter().enumerate() { option value=(number) selected[number == chosen] { (name) } } }
        }
    };
    html! {
        figure {
            p.pick { "Compare " (choice("left", 0)) " with " (choice("right", last)) }
            div.compare {
                img id="below" alt="The picture chosen on the right";
                img id="above" alt="The picture chosen on the left";
            }
            input id="line" type="range" min="0" max="100" value="50" aria-label="Where the left picture ends";
            div hidden id="reference" { (picture("png", &strip.reference, strip.frames[0].size, "The reference")) }
            script { (PreEscaped(SLIDER)) }
        }
    }
}

const SLIDER: &str = "
const get = id => document.getElementById(id);
const sources = [...document.querySelectorAll('.strip > div > img:first-child'), get('reference').firstChild].map(image => image.src);
const show = () => {
  get('above').src = sources[get('left').value];
  get('below').src = sources[get('right').value];
  get('above').style.clipPath = `inset(0 ${100 - get('line').value}% 0 0)`;
};
['left', 'right', 'line'].forEach(id => get(id).addEventListener('input', show));
show();
";

/// What each choice buys, the fastest first; what noise hides at the end.
fn choices(part: &Part) -> Markup {
    let Some(base) = part.base() else { return html! {} };
    let (single, mut choices): (Vec<Choice>, Vec<Choice>) =
        part.choices().into_iter().partition(|choice| choice.effect == Effect::SinglePoint);
    choices.sort_by(|one, other| one.effect.rank().partial_cmp(&other.effect.rank()).expect("no effect is NaN"));
    let head = html! { tr { th.name { "What each choice buys" } th { "time to the same error" } th { "interval" } th { "faster · slower" } th { "at error" } } };
    let left_out = part.not_measured();
    html! {
        @if !choices.is_empty() { div.choices { (table(&head, &html! { @for choice in &choices { (row(choice)) } })) } }
        @if !single.is_empty() {
            p.soft { "Not compared, as the budget allowed a single point of each (a longer " code { "--budget" } " compares them): "
                (single.iter().map(Choice::name).collect::<Vec<_>>().join("; ")) "." }
        }
        p.soft {
            "Each choice is one change to the base: " (base.label) ". Times are over the base's, measured in turn with it; all intervals of this table together hold with 95 % confidence. "
            "Grey: not significantly different from the base."
        }
        @if !left_out.is_empty() { details { summary { "Not measured" } ul { @for sentence in &left_out { li { (sentence) } } } } }
    }
}

fn row(choice: &Choice) -> Markup {
    let name = choice.name();
    match choice.effect {
        Effect::Differs(error, longer) => measured(&name, error, longer, false),
        Effect::Undecided(error, longer) => measured(&name, error, longer, true),
        Effect::Apart([own, base]) => html! {
            tr { th scope="row" { (name) } td colspan="4" { "reaches " (percent(own.0)) " in " (duration(own.1)) "; the base " (percent(base.0)) " in " (duration(base.1)) } }
        },
        Effect::SinglePoint => html! {},
    }
}

fn measured(name: &str, error: f64, longer: Interval, undecided: bool) -> Markup {
    html! {
        tr.undecided[undecided] {
            th scope="row" { (name) }
            td { (ratio(longer.value)) }
            td { (between(longer, ratio)) }
            td.bar { (bar(longer)) }
            td { (percent(error)) }
        }
    }
}

/// From the middle, which is as fast as the base, to the right where it is slower; the ends are this many times as fast and as slow.
const END_OF_BAR: f64 = 16.0;

fn bar(longer: Interval) -> Markup {
    let place = |ratio: f64| (50.0 + 50.0 * ratio.max(1e-9).ln() / END_OF_BAR.ln()).clamp(0.0, 100.0);
    let (from, to) = (place(longer.value).min(50.0), place(longer.value).max(50.0));
    let (low, high) = (place(longer.low), place(longer.high));
    html! {
        div {
            i.slower[longer.value > 1.0] style={ "left:" (format!("{from:.1}")) "%;width:" (format!("{:.1}", to - from)) "%" } {}
            b style={ "left:" (format!("{low:.1}")) "%;width:" (format!("{:.1}", high - low)) "%" } {}
        }
    }
}
