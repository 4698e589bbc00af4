//! Jobs shared out over the cores.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;

/// Returns the number of threads that run at the same time.
pub fn threads() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Numbers that one thread does one after the other.
const RUN: usize = 2048;

/// Does job 0 … `count − 1`, each short, on all cores; results in their order.
pub fn each<R: Send + Clone + Default>(count: usize, job: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let mut all = vec![R::default(); count];
    let runs = Mutex::new(all.chunks_mut(RUN).enumerate());
    map(threads(), threads(), |_| {
        loop {
            let next = runs.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((run, own)) = next else { return };
            own.iter_mut().zip(run * RUN..).for_each(|(to, k)| *to = job(k));
        }
    });
    all
}

/// Does jobs as [`each`] does, and hands on their results in their order; few of them are held at a time.
pub fn in_order<R: Send + Clone + Default>(
    count: usize,
    job: impl Fn(usize) -> R + Sync,
    mut take: impl FnMut(usize, R),
) {
    let many = RUN * 4 * threads();
    for first in (0..count).step_by(many) {
        let own = each(many.min(count - first), |k| job(first + k));
        own.into_iter().enumerate().for_each(|(k, result)| take(first + k, result));
    }
}

/// Does two different jobs, at the same time where there are two cores; returns both results.
pub fn both<A, B: Send>(first: impl FnOnce() -> A, second: impl FnOnce() -> B + Send) -> (A, B) {
    if threads() == 1 {
        return (first(), second());
    }
    thread::scope(|scope| {
        let second = scope.spawn(second);
        (first(), second.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })
}

/// Does job 0 … `count − 1`, each on whichever thread is free; results in the order of the jobs.
pub fn map<R: Send>(threads: usize, count: usize, job: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed);
            if k >= count {
                return done;
            }
            done.push((k, job(k)));
        }
    };
    let mut results = thread::scope(|scope| {
        let others: Vec<_> = (1..threads.min(count)).map(|_| scope.spawn(work)).collect();
        let mut results = work();
        for other in others {
            results.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        results
    });
    results.sort_by_key(|(k, _)| *k);
    results.into_iter().map(|(_, result)| result).collect()
}
