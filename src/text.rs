//! What messages and reports have in common: counts with their nouns, typed values, and why a file was refused.

use std::fmt::Display;
use std::io;

/// `1 round`, `2 rounds`.
pub(crate) fn counted(count: impl Display, noun: &str) -> String {
    let count = count.to_string();
    let plural = if count == "1" { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

/// Characters of a typed value that a message repeats.
const MOST_ECHOED: usize = 120;

/// A value as it was typed; of a long one the beginning and the end.
pub fn echo(typed: impl Display) -> String {
    const END: usize = 40;
    let typed = typed.to_string();
    let letters: Vec<char> = typed.chars().collect();
    if letters.len() <= MOST_ECHOED {
        return typed;
    }
    let part = |letters: &[char]| letters.iter().collect::<String>();
    format!("{}...{}", part(&letters[..MOST_ECHOED - END]), part(&letters[letters.len() - END..]))
}

/// Text from a file, as it may be printed.
pub(crate) fn one_line(text: &str) -> String {
    echo(text.replace(|letter: char| letter.is_control(), " "))
}

/// A share, three significant digits.
pub(crate) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let decimals = if percent == 0.0 { 0 } else { (2 - percent.abs().log10().floor() as i32).clamp(0, 6) };
    format!("{percent:.*} %", decimals as usize)
}

/// A length that is small, in the unit that suits it.
pub(crate) fn in_metres(metres: f64) -> String {
    match metres {
        ..0.01 => format!("{:.2} mm", 1e3 * metres),
        _ => format!("{metres:.2} m"),
    }
}

/// The first few of some names.
pub(crate) fn some_of(names: impl ExactSizeIterator<Item = impl ToString>) -> String {
    const MOST: usize = 5;
    let more = names.len().saturating_sub(MOST);
    let first: Vec<String> = names.take(MOST).map(|name| name.to_string()).collect();
    first.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}

/// Why the system refuses a file, or a name for one.
pub(crate) fn refusal(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "there is no such file".to_owned(),
        io::ErrorKind::AlreadyExists => "something of this name is there".to_owned(),
        kind => kind.to_string(),
    }
}

/// A word as a shell takes it.
pub(crate) fn quoted(word: String) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || "_-./:,=+%@".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) { word } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_the_right_number() {
        assert_eq!([0, 1, 2, 11].map(|count| counted(count, "round")), ["0 rounds", "1 round", "2 rounds", "11 rounds"]);
    }

    #[test]
    fn shares_have_three_digits() {
        assert_eq!([0.0, 0.001234, 0.05, 0.9996, 12.0].map(percent), ["0 %", "0.123 %", "5.00 %", "100.0 %", "1200 %"]);
    }

    #[test]
    fn text_from_files_is_one_line() {
        assert_eq!(one_line("a\nb\u{1b}[2Jc"), "a b [2Jc");
    }

    #[test]
    fn long_values_keep_beginning_and_end() {
        assert_eq!(echo("scene.glb"), "scene.glb");
        let long = echo(format!("\u{e4}{}.glb", "x".repeat(5000)));
        assert!(long.chars().count() <= MOST_ECHOED + 3 && long.starts_with("\u{e4}xx") && long.ends_with("xx.glb"), "{long}");
    }
}
