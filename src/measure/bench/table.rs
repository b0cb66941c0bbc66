//! A bench as text: the device's rates, and every pass with its limit.

use super::Bench;
use super::pass::Pass;
use super::rates::Rates;
use super::scale::{Growth, PassTime, Series};
use crate::output::words::lower_case;
use crate::timings::Spread;

pub fn text(bench: &Bench) -> String {
    let mut text = format!("{}, driver {}, Vulkan {}\n{}\n\n", bench.device, bench.driver, bench.vulkan, bench.request.command);
    rates(&mut text, &bench.rates);
    passes(&mut text, &bench.passes);
    if let Some(map) = &bench.compaction {
        text += &format!("\n{}", map.text());
    }
    bench.scale.iter().flat_map(|scale| &scale.series).for_each(|series| growth(&mut text, series));
    bench.left_out.iter().for_each(|line| text += &format!("not measured: {line}\n"));
    text
}

fn growth(text: &mut String, Series { over, steps, growth }: &Series) {
    *text += &format!("\n{over:<14} {:>14} {:>16} {:>16}\n", "", "bytes used", "bytes planned");
    for step in steps {
        *text += &format!("{:<14} {:>14} {:>16} {:>16}\n", step.size, "", step.peak_bytes, step.stated_bytes);
        for PassTime { pass, ms } in &step.passes {
            *text += &format!("  {pass:<12} {:>10.4} ms ({:.4} to {:.4}, {} runs)\n", ms.median, ms.min, ms.max, ms.repeats);
        }
    }
    for Growth { pass, from, power, power_off, logarithm_off } in growth {
        *text += &format!(
            "{pass}: time grows as {over} to the power {:.3} +- {:.3} from {from} {over} on (RMS error of this fit {:.1} %, of a logarithmic fit {:.1} %)\n",
            power.value,
            power.error,
            100.0 * power_off,
            100.0 * logarithm_off
        );
    }
}

/// Three significant digits and a thousands' letter: 4.80 T.
fn scaled(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let (unit, letter) =
        [(1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k")].into_iter().find(|(unit, _)| value >= *unit).unwrap_or((1.0, ""));
    let value = value / unit;
    let decimals = (2.0 - value.log10().floor().clamp(0.0, 2.0)) as usize;
    format!("{value:.decimals$}{letter}")
}

fn rates(text: &mut String, rates: &Rates) {
    let mut line = |name: &str, rate: &Spread, unit: &str| {
        *text += &format!("{name:<34} {:>9}{unit}  ({} to {})\n", scaled(rate.median), scaled(rate.min), scaled(rate.max));
    };
    for copy in &rates.copies {
        line(&format!("copy, {}B read and written", scaled(copy.moved_bytes as f64)), &copy.rate, "B/s");
    }
    line("dependent dispatches", &rates.dispatches, "/s");
    line("float additions, multiplications", &rates.float_operations, "/s");
    line("integer products (32 x 32 bits)", &rates.integer_products, "/s");
    line("random reads of 32 bytes", &rates.random_reads, "/s");
    line("atomics on many counters", &rates.spread_atomics, "/s");
    line("atomics on one counter", &rates.single_atomics, "/s");
    line("one counter, atomic per subgroup", &rates.counter_additions, "/s");
}

fn passes(text: &mut String, passes: &[Pass]) {
    let or_dash = |shown: Option<String>| shown.unwrap_or_else(|| "-".to_owned());
    for of_workload in passes.chunk_by(|a, b| a.workload == b.workload) {
        *text += &format!(
            "\n{}\n  {:<18} {:>10} {:>19} {:>11} {:>11} {:>10} {:>8} {:<8} items\n",
            of_workload[0].workload, "pass", "ms", "min to max", "items/s", "bytes/s", "limit ms", "of limit", "bound by"
        );
        for pass in of_workload {
            *text += &format!(
                "  {:<18} {:>10.4} {:>19} {:>11} {:>11} {:>10} {:>8} {:<8} {}\n",
                pass.name,
                pass.ms.median,
                format!("{:.4} to {:.4}", pass.ms.min, pass.ms.max),
                or_dash(pass.items_per_second.map(scaled)),
                or_dash(pass.bytes_per_second.map(scaled)),
                or_dash(pass.limit.map(|limit| format!("{:.4}", limit.ms))),
                or_dash(pass.fraction.map(|fraction| format!("{:.1} %", 100.0 * fraction))),
                pass.limit.map_or_else(String::new, |limit| lower_case(limit.by)),
                pass.work.map_or("", |work| work.item),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_have_three_digits_and_a_letter() {
        assert_eq!([4.8e12, 2.04e10, 999e6, 1234.0, 0.5, f64::NAN].map(scaled), ["4.80 T", "20.4 G", "999 M", "1.23 k", "0.50", "-"]);
    }
}
