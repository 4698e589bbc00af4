//! The search for the motion of the greatest merit inside limits: an interior-point method, a quasi-Newton
//! step (limited-memory BFGS, two-loop recursion of Nocedal) at a time, from several random beginnings on all
//! cores.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Duration;

/// Weights of the barrier, one after the other, and steps with each.
const WEIGHTS: [(f64, usize); 3] = [(0.1, 60), (0.01, 120), (0.001, 200)];
/// Pairs that the quasi-Newton method stores.
const MEMORY: usize = 15;

/// A motion under way.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The coefficients of the family.
    pub coefficients: Vec<f64>,
    /// `log det M`, or whatever else is made large.
    pub merit: f64,
}

/// Motions with coefficients, limits and something that is to be large.
pub trait Descent: Sync {
    /// Returns the number of coefficients.
    fn len(&self) -> usize;

    /// Returns true if there is nothing to be found.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the least gain of a step that another one follows.
    fn least_gain(&self) -> f64 {
        1e-5
    }

    /// Returns `weight Σ barrier − merit`, its gradient, and the merit; `None` outside the limits.
    fn cost(&self, z: &[f64], weight: f64) -> Option<(f64, Vec<f64>, f64)>;

    /// Returns a random beginning inside the limits, as large as they let it be within a quarter; `None` if
    /// not even a tiny one is.
    fn begin(&self, seed: u64) -> Option<Vec<f64>> {
        // SplitMix64 (Steele, Lea, Flood 2014), uniform within ±1.
        let mut state = seed;
        let mut uniform = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut x = state;
            x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let mut z: Vec<f64> = (0..self.len()).map(|_| uniform()).collect();
        for _ in 0..60 {
            if self.cost(&z, 1.0).is_some() {
                return Some(z);
            }
            z.iter_mut().for_each(|v| *v *= 0.8);
        }
        None
    }

    /// Descends from one random beginning. `None` if not even a tiny motion is inside the limits.
    fn descend(&self, seed: u64, stop: &AtomicBool) -> Option<Found> {
        let mut z = self.begin(seed)?;
        let mut merit = f64::NEG_INFINITY;
        for (weight, steps) in WEIGHTS {
            let (mut cost, mut gradient, reached) = self.cost(&z, weight)?;
            merit = reached;
            let mut pairs: VecDeque<(Vec<f64>, Vec<f64>)> = VecDeque::new();
            for _ in 0..steps {
                if stop.load(Ordering::Relaxed) {
                    return Some(Found { coefficients: z, merit });
                }
                let direction = direction(&gradient, &pairs);
                let slope = dot(&direction, &gradient);
                let mut length = 1.0;
                let next = loop {
                    let trial: Vec<f64> = z.iter().zip(&direction).map(|(z, d)| z + length * d).collect();
                    match self.cost(&trial, weight) {
                        Some(there) if there.0 <= cost + 1e-4 * length * slope => break Some((trial, there)),
                        _ if length < 1e-8 => break None,
                        _ => length *= 0.4,
                    }
                };
                let Some((trial, (lower, new_gradient, reached))) = next else { break };
                let step: Vec<f64> = trial.iter().zip(&z).map(|(a, b)| a - b).collect();
                let change: Vec<f64> = new_gradient.iter().zip(&gradient).map(|(a, b)| a - b).collect();
                if dot(&step, &change) > 1e-12 * dot(&change, &change) {
                    pairs.push_back((step, change));
                    if pairs.len() > MEMORY {
                        pairs.pop_front();
                    }
                }
                let gain = cost - lower;
                (z, cost, gradient, merit) = (trial, lower, new_gradient, reached);
                if gain < self.least_gain() {
                    break;
                }
            }
        }
        Some(Found { coefficients: z, merit })
    }

    /// Searches from the given number of random beginnings, the first by `seed` and the next ones by the
    /// numbers after it, on every core; the best first. `done` receives the number of those that have ended.
    fn search(
        &self,
        starts: usize,
        seed: u64,
        stop: &AtomicBool,
        mut done: impl FnMut(usize, f64),
    ) -> Vec<Found> {
        let next = AtomicUsize::new(0);
        let cores = std::thread::available_parallelism().map_or(1, usize::from).min(starts);
        let mut found: Vec<(usize, Found)> = Vec::new();
        std::thread::scope(|scope| {
            let (sender, results) = mpsc::channel();
            for _ in 0..cores {
                let (sender, next) = (sender.clone(), &next);
                scope.spawn(move || {
                    loop {
                        let start = next.fetch_add(1, Ordering::Relaxed);
                        if start >= starts || (start > 0 && stop.load(Ordering::Relaxed)) {
                            break;
                        }
                        let ended = self.descend(seed.wrapping_add(start as u64), stop);
                        if sender.send((start, ended)).is_err() {
                            break;
                        }
                    }
                });
            }
            drop(sender);
            let mut ended = 0;
            loop {
                match results.recv_timeout(Duration::from_millis(100)) {
                    Ok((start, result)) => {
                        ended += 1;
                        found.extend(result.map(|f| (start, f)));
                    }
                    Err(mpsc::RecvTimeoutError::Timeout) => {}
                    Err(mpsc::RecvTimeoutError::Disconnected) => break,
                }
                done(ended, found.iter().map(|(_, f)| f.merit).fold(f64::NEG_INFINITY, f64::max));
            }
        });
        // By value, then by beginning: the same answer on any number of cores.
        found.sort_by(|(i, a), (j, b)| b.merit.total_cmp(&a.merit).then(i.cmp(j)));
        found.into_iter().map(|(_, f)| f).collect()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Returns the direction downhill, by the two-loop recursion.
fn direction(gradient: &[f64], pairs: &VecDeque<(Vec<f64>, Vec<f64>)>) -> Vec<f64> {
    let mut q: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut shares = Vec::with_capacity(pairs.len());
    for (step, change) in pairs.iter().rev() {
        let share = dot(step, &q) / dot(step, change);
        q.iter_mut().zip(change).for_each(|(q, y)| *q -= share * y);
        shares.push(share);
    }
    let scale = match pairs.back() {
        Some((step, change)) => dot(step, change) / dot(change, change),
        // A first step of a tenth of a coefficient.
        None => 0.1 / dot(gradient, gradient).sqrt().max(f64::MIN_POSITIVE),
    };
    q.iter_mut().for_each(|v| *v *= scale);
    for ((step, change), share) in pairs.iter().zip(shares.iter().rev()) {
        let back = dot(change, &q) / dot(step, change);
        q.iter_mut().zip(step).for_each(|(q, s)| *q += (share - back) * s);
    }
    q
}
