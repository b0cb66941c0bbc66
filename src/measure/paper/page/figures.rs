//! Figures: labelled panels, what the paper's figure shows, and whether the same is seen here.

use maud::{Markup, html};

use super::summary::badge;
use crate::measure::paper::figures::{Figure, letter};
use crate::measure::paper::{Reproduction, verdicts};
use crate::output::page::picture;

pub(crate) fn figures(found: &Reproduction) -> Markup {
    html! {
        section id="figures" {
            h2 { "Figures 1 to 4" }
            p { "All figures use 5000 photons per round, rand48 and seed 1. White is full illumination." }
            @for figure in &found.figures { (self::figure(found, figure)) }
        }
    }
}

fn figure(found: &Reproduction, figure: &Figure) -> Markup {
    let columns = match figure.panels.len() {
        2 => "two",
        5 => "one-and-four",
        _ => "three",
    };
    html! {
        h3 { "Figure " (figure.number) ": " (figure.title) }
        div class={ "panels " (columns) } {
            @for (place, panel) in figure.panels.iter().enumerate() {
                @let label = format!("({}) {}", letter(place), panel.label);
                figure {
                    (picture("png", &panel.png, (panel.side as u32, panel.side as u32), &format!("The open box, figure {} {label}", figure.number)))
                    figcaption { (label) }
                }
            }
        }
        div.beside {
            div { h4 { "In the paper" } p { (figure.published) } }
            div {
                @if let Some(verdict) = verdicts::of_figure(found, figure.number) {
                    h4 {
                        "Here"
                        @if let Some(standing) = verdict.standing { " " (badge(standing, standing.words_for_figures())) }
                    }
                    p { (verdict.text) }
                }
            }
        }
        details {
            summary { "What to look for, and commands" }
            p { (figure.caption) }
            @for frame in &figure.frames {
                p { (frame.label) ": " code { (frame.command) } }
            }
        }
    }
}
