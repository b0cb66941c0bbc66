//! What fields of requests are called. Messages of the library name them in backticks, as in "use a smaller `radius`"; whoever shows a
//! message writes them as its readers do.

use super::options::row;

/// Fields that are of other requests than that of a scene, or of a command alone.
const OTHERS: &[&str] = &[
    "atlas",
    "budget",
    "device",
    "devices",
    "display",
    "error_image",
    "fail_above",
    "irradiance",
    "judge",
    "memory",
    "only",
    "output",
    "partial",
    "points",
    "preview",
    "radiosity",
    "reference_samples",
    "repeats",
    "replay",
    "scene",
    "side",
    "snapshot",
    "texels_per_metre",
    "validate",
];

/// Whether a word is the name of a field.
pub(crate) fn is_field(word: &str) -> bool {
    row(word).is_some_and(|row| row.field == word) || OTHERS.contains(&word)
}

/// A text with each field that it names in backticks as `spell` writes it.
pub fn spelled(text: &str, spell: impl Fn(&str) -> String) -> String {
    let mut spelled = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('`') {
        spelled.push_str(before);
        match after.split_once('`').filter(|(word, _)| is_field(word)) {
            Some((field, after)) => {
                spelled.push_str(&spell(field));
                rest = after;
            }
            None => {
                spelled.push('`');
                rest = after;
            }
        }
    }
    spelled + rest
}

/// As options of the program.
pub(crate) fn as_option(field: &str) -> String {
    format!("--{}", field.replace('_', "-"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_spelled_and_nothing_else_is() {
        let text = "use a smaller `radius` or `caustic_radius` 1, as `photonmill plan` says of `all`";
        assert_eq!(spelled(text, as_option), "use a smaller --radius or --caustic-radius 1, as `photonmill plan` says of `all`");
        assert_eq!(spelled("a`b: `error` last: `time`", |field| format!("{field}=")), "a`b: error= last: time=");
    }
}
