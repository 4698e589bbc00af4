//! The comparison of two outputs.

use super::cases::{Case, EXCEPTIONS};
use super::seen::{Parameter, Seen};

/// Relative, for numbers of JSON objects and of factors made in double precision.
const TOLERANCE: f64 = 1e-9;

/// One difference.
pub struct Difference {
    /// The difference.
    pub what: String,
    /// The reason for which it differs, where the list of exceptions gives one.
    pub reason: Option<&'static str>,
}

/// Returns all differences; none if the outputs are the same.
pub fn differences(golden: &Seen, now: &Seen, case: &Case) -> Vec<Difference> {
    let mut what = Vec::new();
    if golden.exit != now.exit {
        what.push(format!("exit status {}, was {}", now.exit, golden.exit));
    }
    if golden.status != now.status {
        what.push(format!("status {:?}, was {:?}", now.status, golden.status));
    }
    parameters(golden, now, &mut what);
    numbers(golden, now, &mut what);
    let missing = golden.printed.iter().filter(|line| !now.printed.contains(line));
    what.extend(missing.map(|line| format!("printed no longer: {line}")));
    for (name, entries) in &golden.factors {
        let tolerance = if case.device { 0.0 } else { TOLERANCE };
        factor(name, entries, now, tolerance, &mut what);
    }
    let reason = |what: &str| {
        let fits = |e: &&super::cases::Exception| case.name.starts_with(e.case) && what.starts_with(e.what);
        EXCEPTIONS.iter().find(fits).map(|e| e.reason)
    };
    what.into_iter().map(|what| Difference { reason: reason(&what), what }).collect()
}

fn parameters(golden: &Seen, now: &Seen, what: &mut Vec<String>) {
    for (name, old) in &golden.parameters {
        let Some(new) = now.parameters.get(name) else {
            what.push(format!("parameter {name} is gone"));
            continue;
        };
        let Parameter(state, value, u95) = old;
        if *state != new.0 {
            what.push(format!("parameter {name} is {}, was {state}", new.0));
        }
        // A true zero is as exact as its interval is wide.
        let scale = value.unwrap_or(0.0).abs().max(u95.unwrap_or(0.0));
        for (kind, old, new) in [("value", value, &new.1), ("u95", u95, &new.2)] {
            let same = match (old, new) {
                (Some(old), Some(new)) => (old - new).abs() <= TOLERANCE * scale,
                (None, None) => true,
                _ => false,
            };
            if !same {
                what.push(format!("parameter {name}: {kind} {new:?}, was {old:?}"));
            }
        }
    }
    let added = now.parameters.keys().filter(|name| !golden.parameters.contains_key(*name));
    what.extend(added.map(|name| format!("parameter {name} is new")));
}

/// Compares other numbers; those that another schema lacks are not missed.
fn numbers(golden: &Seen, now: &Seen, what: &mut Vec<String>) {
    for (path, old) in &golden.numbers {
        // Numbers of one array are of one kind: the largest is their scale, so that rounding about zero is
        // not judged.
        let family = path.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.');
        let of_family =
            golden.numbers.iter().filter(|(p, _)| p.starts_with(family) && family.len() < path.len());
        let scale = of_family.map(|(_, v)| v.abs()).fold(old.abs(), f64::max);
        match now.numbers.get(path) {
            Some(new) if (old - new).abs() <= TOLERANCE * scale => {}
            Some(new) => what.push(format!("number {path}: {new:e}, was {old:e}")),
            None if golden.schema != now.schema => {}
            None => what.push(format!("number {path} is gone, was {old:e}")),
        }
    }
}

/// Compares factors: every entry of the golden must be somewhere in the new file, whatever its format.
fn factor(name: &str, entries: &[String], now: &Seen, tolerance: f64, what: &mut Vec<String>) {
    let Some(bytes) = now.files.get(name) else {
        what.push(format!("factor {name} is not written"));
        return;
    };
    let windows: Vec<f64> =
        bytes.windows(8).map(|w| f64::from_le_bytes(w.try_into().unwrap_or_default())).collect();
    let numbers: Vec<f64> =
        entries.iter().map(|hex| f64::from_bits(u64::from_str_radix(hex, 16).unwrap_or(0))).collect();
    let scale = numbers.iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
    let is_there = |old: &f64| {
        windows.iter().any(|new| {
            new.to_bits() == old.to_bits()
                || (tolerance > 0.0 && (old - new).abs() <= tolerance * old.abs().max(1e-6 * scale))
        })
    };
    let lost = numbers.iter().filter(|old| !is_there(old)).count();
    if lost > 0 {
        let kind = if tolerance > 0.0 { "to 1e-9" } else { "bit for bit" };
        what.push(format!("factor {name}: {lost} of {} numbers are not there {kind}", numbers.len()));
    }
}
