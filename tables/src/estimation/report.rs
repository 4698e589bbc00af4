//! Running the jobs of a table, and writing its numbers.

use std::sync::Mutex;

/// A part of a table that can be made by itself.
pub type Job<'a, T> = Box<dyn FnOnce() -> T + Send + 'a>;

/// Returns what independent jobs give, in their order, on all cores.
pub fn in_parallel<T: Send>(jobs: Vec<Job<'_, T>>) -> Vec<T> {
    let count = jobs.len();
    let queue = Mutex::new(jobs.into_iter().enumerate());
    let done = Mutex::new(Vec::with_capacity(count));
    let work = || {
        loop {
            let next = queue.lock().expect("no job panics while it holds the queue").next();
            let Some((index, job)) = next else { return };
            let result = job();
            done.lock().expect("pushing does not panic").push((index, result));
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            // A factor of 128 parameters and its solution are on the stack.
            let thread = std::thread::Builder::new().stack_size(64 << 20);
            thread.spawn_scoped(scope, work).expect("there is memory for a thread");
        }
    });
    let mut done = done.into_inner().expect("no thread holds it");
    done.sort_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Writes two significant digits, as one would write them.
pub fn short(value: f64) -> String {
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    if value == 0.0 || (1e-3..999.5).contains(&value.abs()) {
        let digits = if value == 0.0 { 0.0 } else { 1.0 - value.abs().log10().floor() };
        return format!("{value:.*}", digits.max(0.0) as usize);
    }
    format!("{value:.1e}").replace(".0e", "e")
}
