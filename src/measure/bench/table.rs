//! A bench as text: the device's rates, every pass with its limit, and the targets.

use std::fmt::Write;

use super::Bench;
use super::targets::Wanted;
use crate::timings::Spread;

pub fn text(bench: &Bench) -> String {
    let mut text = format!("{}, driver {}, Vulkan {}\n{}\n\n", bench.device, bench.driver, bench.vulkan, bench.request.command);
    rates(&mut text, bench);
    if !bench.passes.is_empty() {
        passes(&mut text, bench);
    }
    if !bench.targets.is_empty() {
        targets(&mut text, bench);
    }
    if let Some(map) = &bench.compaction {
        write!(text, "\n{}", map.text()).unwrap();
    }
    if let Some(scale) = &bench.scale {
        for series in &scale.series {
            writeln!(text, "\n{:<14} {:>14} {:>16} {:>16}", series.over, "", "bytes used", "bytes planned").unwrap();
            for step in &series.steps {
                writeln!(text, "{:<14} {:>14} {:>16} {:>16}", step.size, "", step.peak_bytes, step.stated_bytes).unwrap();
                for pass in &step.passes {
                    writeln!(text, "  {:<12} {}", pass.pass, spread_ms(&pass.ms)).unwrap();
                }
            }
            for growth in &series.growth {
                let (power, from, over) = (growth.power, growth.from, series.over);
                writeln!(
                    text,
                    "{}: time grows as {over} to the power {:.3} +- {:.3} from {from} {over} on (RMS error of this fit {:.1} %, of a logarithmic fit {:.1} %)",
                    growth.pass,
                    power.value,
                    power.error,
                    100.0 * growth.power_off,
                    100.0 * growth.logarithm_off
                )
                .unwrap();
            }
        }
    }
    for line in &bench.left_out {
        writeln!(text, "not measured: {line}").unwrap();
    }
    text
}

/// Three significant digits and a thousands' letter: 4.80 T.
pub fn scaled(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let (unit, letter) =
        [(1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k")].into_iter().find(|(unit, _)| value >= *unit).unwrap_or((1.0, ""));
    let value = value / unit;
    let decimals = if value >= 100.0 {
        0
    } else if value >= 10.0 {
        1
    } else {
        2
    };
    format!("{value:.decimals$}{letter}")
}

/// The same with its unit; seconds below one as milliseconds.
fn quantity(value: f64, unit: &str) -> String {
    match unit {
        _ if !value.is_finite() => "-".to_owned(),
        "/s" => scaled(value) + "/s",
        "s" if value < 1.0 => format!("{:.3} ms", 1e3 * value),
        unit => format!("{value:.2} {unit}"),
    }
}

fn spread_ms(spread: &Spread) -> String {
    format!("{:>10.4} ms ({:.4} to {:.4}, {} runs)", spread.median, spread.min, spread.max, spread.repeats)
}

fn rates(text: &mut String, bench: &Bench) {
    let rates = &bench.rates;
    for copy in &rates.copies {
        let (name, rate) = (format!("copy, {}B read and written", scaled(copy.moved_bytes as f64)), &copy.rate);
        writeln!(text, "{name:<34} {:>9}B/s  ({} to {})", scaled(rate.median), scaled(rate.min), scaled(rate.max)).unwrap();
    }
    for (name, rate, unit) in [
        ("dependent dispatches", &rates.dispatches, "/s"),
        ("float additions, multiplications", &rates.float_operations, "/s"),
        ("integer products (32 x 32 bits)", &rates.integer_products, "/s"),
        ("random reads of 32 bytes", &rates.random_reads, "/s"),
        ("atomics on many counters", &rates.spread_atomics, "/s"),
        ("atomics on one counter", &rates.single_atomics, "/s"),
        ("one counter, atomic per subgroup", &rates.counter_additions, "/s"),
    ] {
        writeln!(text, "{name:<34} {:>9}{unit}  ({} to {})", scaled(rate.median), scaled(rate.min), scaled(rate.max)).unwrap();
    }
}

fn passes(text: &mut String, bench: &Bench) {
    let mut workload = "";
    for pass in &bench.passes {
        if pass.workload != workload {
            workload = &pass.workload;
            writeln!(
                text,
                "\n{workload}\n  {:<18} {:>10} {:>19} {:>11} {:>11} {:>10} {:>8} {:<8} items",
                "pass", "ms", "min to max", "items/s", "bytes/s", "limit ms", "of limit", "bound by"
            )
            .unwrap();
        }
        let range = format!("{:.4} to {:.4}", pass.ms.min, pass.ms.max);
        let optional = |value: Option<f64>| value.map_or("-".to_owned(), scaled);
        let (limit, by) = pass.limit.map_or(("-".to_owned(), ""), |limit| (format!("{:.4}", limit.ms), limit.by.name()));
        writeln!(
            text,
            "  {:<18} {:>10.4} {range:>19} {:>11} {:>11} {limit:>10} {:>8} {by:<8} {}",
            pass.name,
            pass.ms.median,
            optional(pass.items_per_second),
            optional(pass.bytes_per_second),
            pass.fraction.map_or("-".to_owned(), |fraction| format!("{:.1} %", 100.0 * fraction)),
            pass.work.map_or("", |work| work.item),
        )
        .unwrap();
    }
}

fn targets(text: &mut String, bench: &Bench) {
    writeln!(text, "\n{:<14} {:>11} {:>11} {:>9}  work", "target", "found", "limit", "met").unwrap();
    for finding in &bench.targets {
        let target = &finding.target;
        let value = |value: f64| quantity(value, target.unit);
        let wanted = match target.wanted {
            Wanted::AtLeast(least) => format!(">= {}", value(least)),
            Wanted::AtMost(most) => format!("<= {}", value(most)),
        };
        let met = match finding.met {
            Some(true) => "yes",
            Some(false) => "no",
            None => "H200 only",
        };
        let limit = finding.limit.map_or("-".to_owned(), value);
        writeln!(text, "{wanted:<14} {:>11} {limit:>11} {met:>9}  {}", value(finding.found), target.work).unwrap();
        writeln!(text, "{:50}{}{}", "", finding.how, if target.peer == "-" { String::new() } else { format!("; {}", target.peer) })
            .unwrap();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_have_three_digits_and_a_letter() {
        assert_eq!([4.8e12, 2.04e10, 999e6, 1234.0, 0.5, f64::NAN].map(scaled), ["4.80 T", "20.4 G", "999 M", "1.23 k", "0.50", "-"]);
        assert_eq!([quantity(0.0012, "s"), quantity(2.5, "s"), quantity(1.1, "x")], ["1.200 ms", "2.50 s", "1.10 x"]);
        assert_eq!([quantity(2e10, "/s"), quantity(f64::NAN, "x")], ["20.0 G/s", "-"]);
    }
}
