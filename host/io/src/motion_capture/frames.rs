//! Names of markers and times of frames, whatever the file.

use std::collections::BTreeMap;

/// Times may be off the rate by this much of a period: they are rounded.
const JITTER: f64 = 0.3;

/// Gives the second and later ones of equal names a number, and says so.
pub(super) fn rename_equal(names: &mut [String], notes: &mut Vec<String>) {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for name in names {
        let count = seen.entry(name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            let new = format!("{name} ({count})");
            notes.push(format!("several points are called {name}: the first counts, and this one is {new}"));
            *name = new;
        }
    }
}

/// Says where a frame, by its number from 0, is not at its time: `first_s` is that of the first one.
///
/// # Errors
/// It is off by more than rounding explains, or no number.
pub(super) fn at_its_time(frame: usize, time_s: f64, first_s: f64, rate_hz: f64) -> Result<(), String> {
    let expected = first_s + frame as f64 / rate_hz;
    if time_s.is_nan() || (time_s - expected).abs() * rate_hz > JITTER {
        return Err(format!(
            "frame {} is at {time_s} s, and by {rate_hz} frames a second at {expected:.4} s",
            frame + 1
        ));
    }
    Ok(())
}
