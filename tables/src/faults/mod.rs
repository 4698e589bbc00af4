//! The table of `docs/faults.md`: everything that the simulator can make go wrong with a device, its sensors,
//! line, clock, flash and supply, and what becomes of it. `cargo xtask faults`.
//!
//! The list is made from the simulator's types by matches that leave nothing out ([`catalogue`]): a new kind
//! of fault does not compile until it has a case. Cases run against the release image on the emulated board,
//! or in this process where the table says so.

mod catalogue;
mod experiment;
mod mcu;
mod replayed;

use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use catalogue::{Case, cases};
use mcu::Place;

use crate::document::{Document, Table};

/// The table.
pub const DOCUMENT: Document =
    Document { file: "docs/faults.md", tables: &[Table { name: "device-faults-long", make: table }] };

/// A case that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(240);

/// The expected outcome of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// The fault is reported: by a state with a reason, a counter, a refusal, a status or a warning. The
    /// answer is right or withheld.
    Detected,
    /// Nothing of it is noticed in the answer, which is right.
    Survived,
}

/// The result.
pub struct Verdict {
    /// True if it was reported.
    pub detected: bool,
    /// Largest error of a parameter called identified, over its U95; `None`: no number was given.
    pub worst: Option<f64>,
    /// The observations.
    pub words: String,
}

/// An identified number may be off by this many U95: a hundred intervals of 95 % are examined, and this is
/// four standard deviations.
const MOST_OFF: f64 = 2.0;

/// The extent of the run.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Restarts in each case that restarts the device again and again.
    pub restarts: usize,
    /// Only the cases for a usual run of the tests.
    pub short: bool,
}

impl Extent {
    /// Everything.
    pub const LONG: Self = Self { restarts: 1000, short: false };
    /// The extent that takes a minute.
    pub const SHORT: Self = Self { restarts: 20, short: true };
}

/// Runs a case, or says that it hangs.
fn bounded(case: &Case, extent: Extent) -> Result<Verdict, String> {
    let (tell, hear) = mpsc::channel();
    let run = std::sync::Arc::clone(&case.run);
    thread::spawn(move || {
        let verdict = std::panic::catch_unwind(|| run(extent));
        // Whoever listened may be gone.
        let _ = tell.send(verdict);
    });
    let patience = if case.restarts { PATIENCE * 10 } else { PATIENCE };
    match hear.recv_timeout(patience) {
        Ok(Ok(verdict)) => verdict,
        Ok(Err(_)) => Err("a panic".to_owned()),
        Err(_) => Err(format!("no end after {} s: it hangs", patience.as_secs())),
    }
}

/// Returns what is wrong with a verdict, if anything.
fn complaint(case: &Case, verdict: &Verdict) -> Option<String> {
    match verdict.worst {
        Some(worst) if worst.is_nan() || worst > MOST_OFF => {
            return Some(format!("a number is off by {worst:.1} U95 and called identified"));
        }
        _ => {}
    }
    match case.expected {
        Expected::Detected if !verdict.detected => Some("nothing was reported".to_owned()),
        Expected::Survived if verdict.worst.is_none() => Some("no number was given".to_owned()),
        _ => None,
    }
}

/// Runs the cases asked for and prints them: the table's rows and what failed.
fn run_all(only: Option<&str>, extent: Extent) -> (String, Vec<String>) {
    let mut text = "| fault | where | expected | seen | answer |\n|---|---|---|---|---|\n".to_owned();
    let mut failed = Vec::new();
    let wanted = |case: &Case| only.map_or(case.short || !extent.short, |name| case.name.contains(name));
    for case in cases().iter().filter(|case| wanted(case)) {
        let begun = Instant::now();
        let ran = bounded(case, extent);
        let took = begun.elapsed().as_secs_f64();
        let place = match case.place {
            Place::Board => "emulated board",
            Place::Process => "in process",
        };
        let expected = match case.expected {
            Expected::Detected => "detected",
            Expected::Survived => "survived",
        };
        let (words, answer, wrong) = match &ran {
            Ok(verdict) => {
                let answer = match verdict.worst {
                    None => "withheld".to_owned(),
                    Some(worst) if worst <= 1.0 => "inside its interval".to_owned(),
                    Some(worst) => format!("off by {worst:.1} U95"),
                };
                (verdict.words.clone(), answer, complaint(case, verdict))
            }
            Err(error) => (error.clone(), String::new(), Some(error.clone())),
        };
        eprintln!("  {} ({place}): {words}; {answer}; {took:.1} s", case.name);
        if let Some(wrong) = wrong {
            eprintln!("    WRONG: {wrong}");
            failed.push(format!("{}: {wrong}", case.name));
        }
        text += &format!("| {} | {place} | {expected} | {words} | {answer} |\n", case.name);
    }
    (text, failed)
}

/// Returns the whole table.
///
/// # Panics
/// If a fault leads to a wrong number, a panic or a hang, or nobody is informed.
fn table() -> String {
    let (text, failed) = run_all(None, Extent::LONG);
    assert!(failed.is_empty(), "{}", failed.join("; "));
    text
}

/// Runs all cases, or those whose names hold a word, and prints the table.
///
/// # Errors
/// Names the cases that went wrong.
pub fn run(only: Option<&str>, extent: Extent) -> Result<(), String> {
    let (text, failed) = run_all(only, extent);
    if text.lines().count() < 3 {
        let known: Vec<String> = cases().into_iter().map(|case| case.name).collect();
        return Err(format!("no fault of that name; there are: {}", known.join(", ")));
    }
    println!("{text}");
    if failed.is_empty() { Ok(()) } else { Err(failed.join("\n")) }
}
