//! Known failures of renderers, and the tests that show that they do not happen here: the table of the guide's page on
//! hard cases, which `tests/light/hard_cases.rs` checks.

use super::sources::read;

/// One known failure.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Of a catalogue: rays and triangles (G), sampling (S), random numbers (R), accumulation (A), density estimation (E),
    /// lobes (B), indices (I), scheduling (D), cameras (C), glass (L), many photons (M), families of scenes (F).
    pub number: String,
    /// The tests that show it; none of what cannot occur.
    pub tests: Vec<String>,
}

/// Cases of each group.
pub const COUNTS: [(char, usize); 12] =
    [('G', 18), ('S', 19), ('R', 9), ('A', 11), ('E', 26), ('B', 7), ('I', 8), ('D', 7), ('C', 3), ('L', 8), ('M', 3), ('F', 12)];

/// Cases that cannot occur, as the program has nothing to which they could happen. Once a source has one of these words, that may
/// no longer be so, and the case needs a test.
pub const ABSENT: [(&str, &[&str]); 2] =
    [("G9", &["discriminant", "ray_sphere", "sphere_hit"]), ("A11", &["two_product", "dekker", " fma("])];

/// The rows of the guide's table.
pub fn cases() -> Vec<Case> {
    let page = read("src/guide/hard_cases.md");
    let row = |line: &str| {
        let [number, _, shown] = line.strip_prefix("| ")?.strip_suffix(" |")?.split(" | ").collect::<Vec<_>>().try_into().ok()?;
        let is_case = COUNTS.iter().any(|(group, _)| number.strip_prefix(*group).is_some_and(|rest| rest.parse::<usize>().is_ok()));
        // What stands in backquotes.
        is_case.then(|| Case { number: number.into(), tests: shown.split('`').skip(1).step_by(2).map(String::from).collect() })
    };
    page.lines().filter_map(row).collect()
}
