//! Recordings of one rig and of several, merged: the share of truths in the intervals, and how much wider
//! these are for the errors that do not average out.

use rigident::fit::pool::PooledFactor;

use super::report::{Job, in_parallel};

#[path = "../../../host/cli/tests/integration/merging/runs.rs"]
mod runs;

use runs::{Body, Conditions, Errors, factor, larger, noisy_first, off, outside, rms, tared};

/// Rigs that each row draws.
const RIGS: u64 = 24;
/// Rigs of the row of a hundred recordings.
const FEW: u64 = 3;
const MASS_KG: f64 = 3.2;

/// What is merged.
#[derive(Clone, Copy)]
enum Case {
    /// Recordings of one rig.
    One(u64),
    /// As many recordings of each of several rigs.
    Rigs { rigs: u64, each: u64 },
    /// Four of one rig, the first with five times its noise.
    Noisy,
    /// A body of a tenth of its fixture, whose run is taken off.
    Tare,
}

impl Case {
    fn errors(self, rig: u64) -> Errors {
        let body = Body::of_mass(MASS_KG);
        let merged = |files: Vec<PooledFactor>| {
            let pooled = PooledFactor::merged(files, false).expect("recordings of one body fit together");
            off(&pooled.fit(), &body)
        };
        match self {
            Self::One(count) => {
                merged((0..count).map(|k| factor(rig, &body, 1000 * rig + k, &Conditions::STATED)).collect())
            }
            Self::Rigs { rigs, each } => {
                let of = |k: u64| {
                    factor(10_000 + rig * rigs + k / each, &body, 1000 * rig + k, &Conditions::STATED)
                };
                merged((0..rigs * each).map(of).collect())
            }
            Self::Noisy => merged(noisy_first(rig, &body, 1000 * rig)),
            Self::Tare => tared(rig, 1000 * rig),
        }
    }
}

/// Returns the table.
pub fn table() -> String {
    let cases = [
        ("1 recording", Case::One(1)),
        ("4 of one rig", Case::One(4)),
        ("9 of one rig", Case::One(9)),
        ("100 of one rig", Case::One(100)),
        ("1 of each of 9 rigs", Case::Rigs { rigs: 9, each: 1 }),
        ("3 of each of 3 rigs", Case::Rigs { rigs: 3, each: 3 }),
        ("4 of one rig, one with five times its noise", Case::Noisy),
        ("0.64 kg on a fixture of 6.4 kg, taken off", Case::Tare),
    ];
    let mut text = String::from(
        "| recordings | rigs drawn | outside U95, % | rms error, σ | U95 by that of one recording |\n|---|--:|--:|--:|--:|\n",
    );
    let mut single: Vec<Errors> = Vec::new();
    for (name, case) in cases {
        let count = if matches!(case, Case::One(100)) { FEW } else { RIGS };
        let jobs = (0..count).map(|rig| Box::new(move || case.errors(rig)) as Job<'_, _>);
        let all = in_parallel(jobs.collect());
        if single.is_empty() {
            single.clone_from(&all);
        }
        let wider = match case {
            Case::Tare => String::new(),
            _ => format!("{:.2}", larger(&all, &single[..all.len()])),
        };
        let outside = 100.0 * outside(&all);
        text.push_str(&format!("| {name} | {count} | {outside:.1} | {:.2} | {wider} |\n", rms(&all)));
    }
    text
}
