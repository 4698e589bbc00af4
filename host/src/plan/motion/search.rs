//! The search for the motion of the greatest merit (the largest `log det M`) inside the limits: an interior-point method, a quasi-Newton step
//! (limited-memory BFGS, two-loop recursion of Nocedal) at a time, from several random beginnings on all cores.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use super::barrier::Barrier;
use super::family::Family;
use super::information::{Information, Instrument, Variation, log_determinant};

/// Weights of the barrier, one after the other, and steps with each.
const WEIGHTS: [(f64, usize); 3] = [(0.1, 60), (0.01, 120), (0.001, 200)];
/// Pairs that the quasi-Newton method remembers.
const MEMORY: usize = 15;

/// What is made large.
pub trait Merit: Sync {
    /// A figure of merit of the information and its derivative Q by it, `d merit = tr(Q dM)`; `None` where something is
    /// left undetermined.
    fn of(&self, information: &Information) -> Option<(f64, Information)>;
}

/// `log det M`: D-optimality.
#[derive(Clone, Copy, Debug)]
pub struct Volume;

impl Merit for Volume {
    fn of(&self, information: &Information) -> Option<(f64, Information)> {
        log_determinant(information)
    }
}

/// What is sought.
#[derive(Clone, Debug)]
pub struct Problem<M = Volume> {
    /// The motions.
    pub family: Family,
    /// The limits.
    pub barrier: Barrier,
    /// The load cell.
    pub instrument: Instrument,
    /// What the rest of the experiment tells.
    pub beforehand: Information,
    /// What is made large.
    pub merit: M,
}

/// A motion under way.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Of the family.
    pub coefficients: Vec<f64>,
    /// `log det M`, or whatever else is made large.
    pub merit: f64,
}

impl<M: Merit> Problem<M> {
    /// `weight Σ barrier − merit`, its gradient, and the merit; `None` outside the limits.
    pub fn cost(&self, z: &[f64], weight: f64) -> Option<(f64, Vec<f64>, f64)> {
        let mut information = self.beforehand;
        let mut walls = Vec::with_capacity(self.family.instants());
        let mut sum = 0.0;
        for k in 0..self.family.instants() {
            let c = self.family.coordinates(z, k);
            let state = c.plate_state();
            let mut variation = Variation::default();
            sum += self.barrier.at(&state, weight, &mut variation)?;
            sum += self.instrument.barrier(&state, weight, &mut variation)?;
            self.instrument.add(&state, self.family.times(k), &mut information);
            walls.push((c, state, variation));
        }
        let (merit, slope) = self.merit.of(&information)?;
        let mut gradient = vec![0.0; self.family.len()];
        for (k, (c, state, wall)) in walls.iter().enumerate() {
            let worth = self.instrument.worth(state, &slope, self.family.times(k));
            let total = Variation {
                place: wall.place - worth.place,
                velocity: wall.velocity - worth.velocity,
                acceleration: wall.acceleration - worth.acceleration,
                turn: std::array::from_fn(|i| wall.turn[i] - worth.turn[i]),
            };
            self.family.pull_back(&total.coordinates(c), k, &mut gradient);
        }
        Some((weight * sum - merit, gradient, merit))
    }

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
        let mut z: Vec<f64> = (0..self.family.len()).map(|_| uniform()).collect();
        for _ in 0..60 {
            if self.cost(&z, 1.0).is_some() {
                return Some(z);
            }
            z.iter_mut().for_each(|v| *v *= 0.8);
        }
        None
    }

    /// From one random beginning. `None` if not even a tiny motion is inside the limits.
    pub fn descend(&self, seed: u64, stop: &AtomicBool) -> Option<Found> {
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
                if gain < 1e-5 {
                    break;
                }
            }
        }
        Some(Found { coefficients: z, merit })
    }

    /// From so many random beginnings, on every core; the best first. `done` is told how many have ended.
    pub fn search(&self, starts: usize, stop: &AtomicBool, mut done: impl FnMut(usize, f64)) -> Vec<Found> {
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
                        let ended = self.descend(start as u64 + 1, stop);
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

/// Downhill, by the two-loop recursion.
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
