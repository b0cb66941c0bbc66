//! Numbers as people read them.

/// The name of an enum's value.
pub fn lower_case(value: impl std::fmt::Debug) -> String {
    format!("{value:?}").to_lowercase()
}

/// Three significant digits, thousands grouped by a narrow space.
pub fn number(value: f64) -> String {
    significant(value, 3)
}

/// A whole number, thousands grouped by a narrow space.
pub fn count(value: u64) -> String {
    grouped(&value.to_string())
}

/// Two significant digits and a multiplication sign.
pub fn times(ratio: f64) -> String {
    significant(ratio, 2) + "\u{a0}×"
}

/// Milliseconds, as seconds from one on.
pub fn duration(ms: f64) -> String {
    time(ms, 3)
}

/// A duration of one significant digit, for scales.
pub fn tick(ms: f64) -> String {
    time(ms, 1)
}

fn time(ms: f64, digits: i32) -> String {
    let (value, unit) = if ms < 1000.0 { (ms, "ms") } else { (ms / 1000.0, "s") };
    format!("{}\u{a0}{unit}", significant(value, digits))
}

/// 'a', 'a and b', 'a, b and c'.
pub fn list(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [only] => only.clone(),
        [rest @ .., last] => format!("{} and {last}", rest.join(", ")),
    }
}

fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = digits - 1 - value.abs().log10().floor() as i32;
    let unit = 10f64.powi(-decimals);
    grouped(&format!("{:.*}", decimals.clamp(0, 6) as usize, (value / unit).round() * unit))
}

/// Numbers of five digits and more only, as in the paper.
fn grouped(number: &str) -> String {
    let (whole, fraction) = number.split_once('.').map_or((number, None), |(whole, fraction)| (whole, Some(fraction)));
    let mut text = String::new();
    for (place, digit) in whole.chars().enumerate() {
        if place > 0 && (whole.len() - place).is_multiple_of(3) && whole.len() > 4 {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    if let Some(fraction) = fraction {
        text.push('.');
        text.push_str(fraction);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_significant_digits() {
        let shown = [0.0, 0.001234, 1.7, 11.04, 99.96, 2130.0, 105_640.0].map(number);
        assert_eq!(shown, ["0", "0.00123", "1.70", "11.0", "100.0", "2130", "106\u{202f}000"]);
        assert_eq!([6.47, 0.514, 12.4, 3456.0].map(times), ["6.5\u{a0}×", "0.51\u{a0}×", "12\u{a0}×", "3500\u{a0}×"]);
        assert_eq!(count(4_194_304), "4\u{202f}194\u{202f}304");
        assert_eq!(duration(999.0), "999\u{a0}ms");
        assert_eq!(duration(105_640.0), "106\u{a0}s");
        assert_eq!([0.1, 10.0, 1000.0].map(tick), ["0.1\u{a0}ms", "10\u{a0}ms", "1\u{a0}s"]);
    }

    #[test]
    fn lists_end_in_and() {
        let items = |n: usize| ["a", "b", "c"][..n].iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!([0, 1, 2, 3].map(|n| list(&items(n))), ["", "a", "a and b", "a, b and c"]);
    }
}
