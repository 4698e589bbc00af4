//! The limits of the cost of a sample: promised limits, held by the verb.

use anyhow::{Result, bail};

use super::{Case, WATCH_PATH};

/// Part, N, instructions and estimated cycles per sample at most.
const BUDGETS: [(&str, u32, f64, f64); 12] = [
    ("kernel", 10, 1165.0, 1680.0),
    ("kernel", 16, 2700.0, 3900.0),
    ("dense", 19, 5500.0, f64::INFINITY),
    ("dense", 36, 19_000.0, f64::INFINITY),
    ("dense", 128, 240_000.0, f64::INFINITY),
    ("path", 10, 2000.0, 3200.0),
    // Half of 168 MHz at 1 kHz, and for frames at 100 Hz.
    ("path", 19, f64::INFINITY, 84_000.0),
    ("path", 25, f64::INFINITY, 84_000.0),
    ("path with drivers", 25, f64::INFINITY, 84_000.0),
    ("frame path", 128, f64::INFINITY, 840_000.0),
    ("tracked frame path", 128, f64::INFINITY, 840_000.0),
    // Half of 168 MHz at 500 Hz.
    (WATCH_PATH, 30, f64::INFINITY, 168_000.0),
];

/// Part, N, and instructions of the worst sample at most: steps of the stop check, slices of an estimate and
/// all else that happens with it.
const WORST: [(&str, u32, u64); 6] = [
    // Slices of a check and pieces of a row block, evened out: at 4 kHz a sample has 42 000 cycles of 168
    // MHz.
    ("path", 10, 6_000),
    ("path", 16, 11_000),
    ("path with estimates", 10, 10_300),
    ("path with estimates", 16, 11_200),
    ("path", 19, 44_000),
    ("path", 25, 65_000),
];

/// Holds every budgeted case against its budget.
///
/// # Errors
/// Names all that are above it, and those that nobody measured.
pub fn check(cases: &[Case]) -> Result<()> {
    let worst = WORST.iter().filter_map(|(part, n, most)| {
        let Some(case) = cases.iter().find(|c| c.reported.part == *part && c.reported.n == *n) else {
            return Some(format!("{part} {n} is not measured"));
        };
        let worst = case.worst_instructions();
        (worst > *most).then(|| format!("{}: {worst} instructions for the worst sample", case.name()))
    });
    let broken: Vec<String> = BUDGETS
        .iter()
        .filter_map(|(part, n, most_instructions, most_cycles)| {
            let Some(case) = cases.iter().find(|c| c.reported.part == *part && c.reported.n == *n) else {
                return Some(format!("{part} {n} is not measured"));
            };
            let (instructions, cycles) = (case.instructions(), case.cycles());
            (instructions > *most_instructions || cycles > *most_cycles)
                .then(|| format!("{}: {instructions} instructions and {cycles} cycles a sample", case.name()))
        })
        .chain(worst)
        .collect();
    if broken.is_empty() { Ok(()) } else { bail!("not what is promised: {}", broken.join("; ")) }
}
