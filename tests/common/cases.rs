//! The number of cases that a test draws. Where every combination of settings would take minutes, most of all to compile pipelines, tests draw
//! some, and with `SHEETSPLAT_EVERY_CASE` all. `.ci/run --all` sets it for random scenes.

use std::sync::LazyLock;

/// Whether tests draw every combination.
pub(crate) fn every_case() -> bool {
    static EVERY: LazyLock<bool> = LazyLock::new(|| std::env::var_os("SHEETSPLAT_EVERY_CASE").is_some());
    *EVERY
}

/// The number of random cases that a test draws: a few, or all.
pub(crate) fn cases(few: usize, all: usize) -> usize {
    if every_case() { all } else { few }
}

/// One of the choices of a second setting for the case with some number, in turns; or every one.
pub(crate) fn in_turns<T: Clone, const N: usize>(number: usize, choices: [T; N]) -> Vec<T> {
    if every_case() { choices.into() } else { vec![choices[number % N].clone()] }
}

/// Rows of choices, one for each setting, in which every choice of a setting meets every choice of every other. `counts` says how many choices
/// each setting has, and a row holds their numbers. Two settings that are wrong together are found by far fewer images than all combinations have.
/// With [`every_case`] the rows are all combinations.
pub(crate) fn pairs<const N: usize>(counts: [usize; N]) -> Vec<[usize; N]> {
    if every_case() {
        return combinations(counts);
    }
    let mut missing: Vec<[(usize, usize); 2]> = Vec::new();
    for second in 1..N {
        for first in 0..second {
            for a in 0..counts[first] {
                missing.extend((0..counts[second]).map(|b| [(first, a), (second, b)]));
            }
        }
    }
    let mut rows = Vec::new();
    while let Some(&seed) = missing.first() {
        let mut row: [Option<usize>; N] = [None; N];
        for (setting, choice) in seed {
            row[setting] = Some(choice);
        }
        // Each further setting takes the choice that meets the most new ones; among equals they take turns.
        for setting in 0..N {
            let news = |choice: usize| {
                let meets = |(s, c): (usize, usize)| if s == setting { c == choice } else { row[s] == Some(c) };
                missing
                    .iter()
                    .filter(|pair| pair.iter().any(|one| one.0 == setting) && pair.iter().all(|&one| meets(one)))
                    .count()
            };
            if row[setting].is_none() {
                let turns = (0..counts[setting]).map(|turn| (turn + rows.len()) % counts[setting]);
                row[setting] = turns.rev().max_by_key(|&choice| news(choice));
            }
        }
        let row = row.map(|choice| choice.expect("every setting has a choice"));
        missing.retain(|pair| pair.iter().any(|&(setting, choice)| row[setting] != choice));
        rows.push(row);
    }
    rows
}

/// All rows of choices.
fn combinations<const N: usize>(counts: [usize; N]) -> Vec<[usize; N]> {
    let row = |number: usize| {
        let mut rest = number;
        counts.map(|count| {
            let choice = rest % count;
            rest /= count;
            choice
        })
    };
    (0..counts.iter().product()).map(row).collect()
}

#[test]
fn rows_hold_every_pair() {
    let counts = [7, 3, 2, 2];
    let rows = pairs(counts);
    for (second, first) in (1..4).flat_map(|second| (0..second).map(move |first| (second, first))) {
        for (a, b) in (0..counts[first]).flat_map(|a| (0..counts[second]).map(move |b| (a, b))) {
            assert!(rows.iter().any(|row| row[first] == a && row[second] == b), "{first}: {a}, {second}: {b}");
        }
    }
    assert!(every_case() || rows.len() <= 24, "{} rows", rows.len());
}
