//! A bench as a page: how close every pass comes to the device's limits, and the charts; all numbers fold away.

use maud::{Markup, html};

use super::pass::Pass;
use super::table::text;
use super::{Bench, chart as charts};
use crate::measure::compaction;
use crate::output::page::{chart, page, table};
use crate::output::words::duration;

pub(crate) fn html(bench: &Bench) -> String {
    let title = format!("Speed of photonmill on {}", bench.device);
    let content = html! {
        header {
            h1 { (title) }
            p.soft { "photonmill " (bench.photonmill) ", driver " (bench.driver) ", Vulkan " (bench.vulkan) ". " code { (bench.request.command) } }
        }
        @if !bench.passes.is_empty() { (passes(&bench.passes)) }
        @if let Some(map) = &bench.compaction {
            h2 { "Fastest builder by photon count and survival" }
            (chart(Some(compaction::chart::draw(map)), "Each cell has the fastest builder, its speed relative to one atomic per thread, and the builders that are not significantly slower."))
        }
        @if let Some(scale) = &bench.scale {
            @for series in scale.series.iter().filter(|series| !series.steps.is_empty()) {
                h2 { "Time by number of " (series.over) }
                (chart(Some(charts::draw(series)), ""))
            }
        }
        @if !bench.left_out.is_empty() { h2 { "Not measured" } ul { @for line in &bench.left_out { li { (line) } } } }
        details { summary { "All numbers" } div.scroll { pre { (text(bench)) } } }
    };
    page(&title, &content)
}

/// A bar for each pass: the share of the device's limit that it reaches.
fn passes(passes: &[Pass]) -> Markup {
    let head = html! { tr { th.name { "Pass" } th { "time" } th { "least time the device allows" } th { "share of the limit" } } };
    let row = |pass: &Pass| {
        html! {
            tr {
                th scope="row" { (pass.name) }
                td { (duration(pass.ms.median)) }
                td { (pass.limit.map_or_else(|| "-".to_owned(), |limit| duration(limit.ms))) }
                td.share {
                    @if let Some(share) = pass.fraction {
                        div { i style={ "width:" (format!("{:.1}", (100.0 * share).min(100.0))) "%" } {} } (format!("{:.0} %", 100.0 * share))
                    }
                }
            }
        }
    };
    html! {
        h2 { "How near the limits of the device" }
        @for of_workload in passes.chunk_by(|one, other| one.workload == other.workload) {
            h3 { (of_workload[0].workload) }
            (table(&head, &html! { @for pass in of_workload { (row(pass)) } }))
        }
    }
}
