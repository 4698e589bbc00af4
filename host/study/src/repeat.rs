//! Repeats an experiment many times, on every core.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::time::Duration;

/// Runs `runs` experiments on every core, and returns what they gave in the order of the runs.
///
/// Their seeds follow from `seed` alone. `done` receives how many are done; `stop` ends early with what there
/// is.
///
/// # Errors
/// The first experiment that failed: its seed, and why.
pub(super) fn repeat<O: Send, E: Send>(
    runs: u64,
    seed: u64,
    stop: &AtomicBool,
    done: &mut dyn FnMut(u64),
    experiment: impl Fn(u64) -> Result<O, E> + Sync,
) -> Result<Vec<O>, (u64, E)> {
    let (next, failed) = (AtomicU64::new(0), AtomicBool::new(false));
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get() as u64).min(runs.max(1));
    let mut outcomes: Vec<(u64, O)> = Vec::new();
    let mut failure = None;
    std::thread::scope(|scope| {
        let (sender, results) = mpsc::channel();
        for _ in 0..cores {
            let (sender, next, failed, experiment) = (sender.clone(), &next, &failed, &experiment);
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) && !failed.load(Ordering::Relaxed) {
                    let run = next.fetch_add(1, Ordering::Relaxed);
                    if run >= runs {
                        break;
                    }
                    // Campaigns of different seeds share no experiment below 2³² runs.
                    let seed = (seed << 32).wrapping_add(run);
                    if sender.send((run, seed, experiment(seed))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        loop {
            match results.recv_timeout(Duration::from_millis(100)) {
                Ok((run, _, Ok(outcome))) => outcomes.push((run, outcome)),
                Ok((_, seed, Err(error))) => {
                    failed.store(true, Ordering::Relaxed);
                    failure.get_or_insert((seed, error));
                }
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => break,
            }
            done(outcomes.len() as u64);
        }
    });
    if let Some(failure) = failure {
        return Err(failure);
    }
    // Sums in the order of the runs: the same bits on any number of cores.
    outcomes.sort_unstable_by_key(|(run, _)| *run);
    Ok(outcomes.into_iter().map(|(_, outcome)| outcome).collect())
}
