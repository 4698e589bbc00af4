//! Processor seconds and memory of a program as a whole.

use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, bail};

use crate::process;

/// The resources that a program used.
#[derive(Clone, Copy, Debug, Default)]
pub struct Used {
    /// Processor time, user's and system's, of the program and of those that it started and waited for, s.
    pub processor_s: f64,
    /// Time by the clock, s.
    pub clock_s: f64,
    /// The most memory that it had, MB; of the program alone.
    pub memory_mb: f64,
}

/// The time between two samples of memory. The figure read is the system's own maximum, so that no peak falls
/// between two samples but the last one's.
const EVERY: Duration = Duration::from_millis(5);

/// Runs a program to its end without its output.
///
/// # Errors
/// It cannot be started, or ends with another status than `expected`.
pub fn run(command: &mut Command, expected: &[i32]) -> Result<Used> {
    let shown = process::shown(command);
    eprintln!("$ {shown}");
    let before = process::processor_time().context("the system does not report processor time")?;
    let begun = std::time::Instant::now();
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .with_context(|| format!("cannot start `{shown}`"))?;
    let place = format!("/proc/{}/status", child.id());
    let mut memory_kb = 0.0_f64;
    let status = loop {
        let text = std::fs::read_to_string(&place).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let now = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        memory_kb = memory_kb.max(now.unwrap_or(0.0));
        if let Some(status) = child.try_wait()? {
            break status;
        }
        std::thread::sleep(EVERY);
    };
    let clock_s = begun.elapsed().as_secs_f64();
    let after = process::processor_time().context("the system does not report processor time")?;
    if !status.code().is_some_and(|code| expected.contains(&code)) {
        bail!("`{shown}` ended with {status}");
    }
    Ok(Used { processor_s: (after - before).as_secs_f64(), clock_s, memory_mb: memory_kb * 1024.0 / 1e6 })
}

/// Runs two programs in turn, `times` each, and returns the medians of their processor seconds.
///
/// # Errors
/// See [`run`].
pub fn in_turn(times: usize, ours: impl Fn() -> Command, theirs: impl Fn() -> Command) -> Result<[f64; 2]> {
    let mut found = [Vec::new(), Vec::new()];
    for _ in 0..times {
        // An answer that is contradicted or lacks something ends with 1 or 3: the work is the same.
        found[0].push(run(&mut ours(), &[0, 1, 3])?.processor_s);
        found[1].push(run(&mut theirs(), &[0])?.processor_s);
    }
    Ok(found.map(median))
}

/// Returns the middle of some numbers; NaN of none.
pub fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_fails_is_an_error_and_one_that_computes_has_used_something() {
        assert!(run(&mut Command::new("false"), &[0]).is_err());
        let mut busy = Command::new("sh");
        let used = run(busy.args(["-c", "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done"]), &[0]).unwrap();
        assert!(used.processor_s > 0.0 && used.memory_mb > 0.1 && used.clock_s > 0.0, "{used:?}");
    }

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert!(median(Vec::new()).is_nan());
    }
}
