//! The budget of the tests, by work and not by a clock. The program of all other tests writes what each of them asked for
//! (`tests/common/work.rs`); this one runs after it, names the dearest tests, and fails where all together ask for more than is
//! allowed. Who adds a test finds room for it by making another cheaper.

use std::collections::BTreeMap;

/// What all tests together may ask for, on Mesa's lavapipe: a seventh to a half more than they did in November 2026. A thousand
/// pipelines are some ten minutes of compiling on one core.
const BUDGET: [(&str, u64); 5] =
    [("pipelines", 2_600), ("dispatches", 750_000), ("invocations", 550_000_000), ("paths", 2_000_000), ("programs", 800)];

const DEAREST: usize = 10;

/// Counts by test and by what is counted.
type Work = BTreeMap<String, BTreeMap<String, u64>>;

fn read(text: &str) -> Work {
    let mut work = Work::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let [test, what, count] = words[..] else { panic!("{line:?} is no line of it") };
        *work.entry(test.to_owned()).or_default().entry(what.to_owned()).or_default() += count.parse::<u64>().expect("it is a count");
    }
    work
}

fn total(work: &Work, what: &str) -> u64 {
    work.values().filter_map(|of| of.get(what)).sum()
}

/// Tests by the largest of their shares of a budget, the dearest first.
fn by_share(work: &Work) -> Vec<(f64, &str)> {
    let share = |of: &BTreeMap<String, u64>| {
        let shares = BUDGET.iter().map(|(what, budget)| of.get(*what).copied().unwrap_or(0) as f64 / *budget as f64);
        shares.fold(0.0, f64::max)
    };
    let mut shares: Vec<(f64, &str)> = work.iter().map(|(test, of)| (share(of), test.as_str())).collect();
    shares.sort_by(|a, b| b.0.total_cmp(&a.0));
    shares
}

fn check(work: &Work) -> Result<(), String> {
    match BUDGET.iter().find(|(what, budget)| total(work, what) > *budget) {
        Some((what, budget)) => Err(format!("the tests ask for {} {what}, and their budget is {budget}", total(work, what))),
        None => Ok(()),
    }
}

#[test]
fn all_tests_together_keep_to_the_budget() {
    // Where the program lies that those tests start: the file is absent where none has run.
    let test = std::env::current_exe().expect("a program knows where it is");
    let folder = test.ancestors().nth(2).expect("it lies in a folder of the build");
    let text = std::fs::read_to_string(folder.join("work.txt")).unwrap_or_default();
    let work = read(&text);
    let totals: Vec<String> = BUDGET.iter().map(|(what, budget)| format!("{} of {budget} {what}", total(&work, what))).collect();
    println!("All tests together: {}. The dearest, by their largest share of a budget:", totals.join(", "));
    for (share, test) in by_share(&work).into_iter().take(DEAREST) {
        let counts: Vec<String> = work[test].iter().map(|(what, count)| format!("{count} {what}")).collect();
        println!("{:5.1} %  {test}: {}", 100.0 * share, counts.join(", "));
    }
    check(&work).unwrap();
}

#[test]
fn more_than_the_budget_is_noticed() {
    let (what, budget) = BUDGET[0];
    let work = read(&format!("a {what} 3\nb {what} {}\na programs 1\nb {what} 1\n", budget - 4));
    assert_eq!((total(&work, what), work["a"].len(), work["b"][what]), (budget, 2, budget - 3));
    assert!(check(&work).is_ok());
    assert_eq!(by_share(&work)[0].1, "b");
    assert!(check(&read(&format!("a {what} {budget}\nb {what} 1\n"))).unwrap_err().contains(what));
}
