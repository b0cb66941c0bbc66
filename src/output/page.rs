//! Pages as HTML in one file that loads nothing.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::svg::Chart;

/// A whole page.
pub(crate) fn page(title: &str, content: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(include_str!("page.css"))) }
            }
            body { main { (content) } }
        }
    };
    page.into_string()
}

/// A chart with what it shows; nothing where nothing was drawn.
pub(crate) fn chart(drawn: Option<Chart>, caption: &str) -> Markup {
    html! {
        @if let Some(drawn) = drawn {
            figure {
                @match drawn.narrow {
                    Some(narrow) => { div.wide { (PreEscaped(drawn.wide)) } div.narrow { (PreEscaped(narrow)) } },
                    None => div.scroll { div.wide.alone { (PreEscaped(drawn.wide)) } },
                }
                @if !caption.is_empty() { figcaption { p { (caption) } } }
            }
        }
    }
}

/// Why times of a software device are no times of a GPU, and what `more` follows from it.
pub(crate) fn software_notice(more: &str) -> Markup {
    html! {
        p.notice { strong { "This device is software." } " It runs Vulkan on the CPU, so 'GPU' times on this page are CPU times." (more) }
    }
}

/// A picture within the page, of a `kind` such as 'png'.
pub(crate) fn picture(kind: &str, file: &[u8], (width, height): (u32, u32), alt: &str) -> Markup {
    html! { img src={ "data:image/" (kind) ";base64," (STANDARD.encode(file)) } width=(width) height=(height) alt=(alt); }
}

/// A table that scrolls by itself where the page is narrow.
pub(crate) fn table(head: &Markup, body: &Markup) -> Markup {
    html! {
        div.scroll { table { thead { (head) } tbody { (body) } } }
    }
}

/// Commands that repeat measurements, folded.
pub(crate) fn commands<'a>(commands: impl Iterator<Item = &'a String>) -> Markup {
    html! {
        details { summary { "Commands" } @for command in commands { p { code { (command) } } } }
    }
}
