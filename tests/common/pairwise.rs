//! Pairwise coverings: few combinations of several settings in which every two values of different settings meet.

/// Places of values, a row a combination, of settings that have so many values each. Each row takes, setting by setting, the
/// value with which it has most pairs that no row before had.
pub fn pairwise(value_counts: &[usize]) -> Vec<Vec<usize>> {
    let mut open: Vec<[(usize, usize); 2]> = Vec::new();
    for (b, &count) in value_counts.iter().enumerate() {
        for (a, before) in value_counts[..b].iter().enumerate() {
            open.extend((0..*before).flat_map(|x| (0..count).map(move |y| [(a, x), (b, y)])));
        }
    }
    let mut rows = Vec::new();
    while let Some(first) = open.first().copied() {
        let mut row = vec![None; value_counts.len()];
        first.into_iter().for_each(|(setting, value)| row[setting] = Some(value));
        for setting in (0..value_counts.len()).filter(|setting| !first.iter().any(|(given, _)| given == setting)) {
            let met = |value: &usize| {
                let has = |(of, wanted): (usize, usize)| if of == setting { wanted == *value } else { row[of] == Some(wanted) };
                open.iter().filter(|pair| pair.iter().all(|one| has(*one))).count()
            };
            row[setting] = (0..value_counts[setting]).rev().max_by_key(met);
        }
        let row: Vec<usize> = row.into_iter().map(|value| value.expect("every setting has a value")).collect();
        open.retain(|pair| pair.iter().any(|(setting, value)| row[*setting] != *value));
        rows.push(row);
    }
    rows
}

#[test]
fn every_two_values_meet() {
    for counts in [[4, 2, 2, 6], [2, 6, 6, 6], [3, 3, 3, 3], [1, 1, 1, 2]] {
        let rows = pairwise(&counts);
        for (a, b) in (0..4).flat_map(|b| (0..b).map(move |a| (a, b))) {
            for (x, y) in (0..counts[a]).flat_map(|x| (0..counts[b]).map(move |y| (x, y))) {
                assert!(rows.iter().any(|row| row[a] == x && row[b] == y), "{counts:?}: {x} of {a} and {y} of {b}");
            }
        }
        let all: usize = counts.iter().product();
        assert!(rows.len() <= all && (all < 24 || rows.len() <= all / 2), "{counts:?}: {} of {all}", rows.len());
    }
}
