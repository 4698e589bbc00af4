//! White noise of signals: how much there is, and signs by chance, the same on every machine, to make more of it.

use std::collections::VecDeque;

/// Steele's splitmix64, a sign from the top bit of each number.
#[derive(Clone, Debug)]
pub(super) struct Signs(u64);

impl Signs {
    /// Returns the signs of a seed.
    pub(super) fn new(seed: u64) -> Self {
        Self(seed.wrapping_add(1))
    }

    /// Returns 1 or −1.
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        if (z ^ (z >> 31)) >> 63 == 0 { -1.0 } else { 1.0 }
    }
}

/// Returns σ of a sensor, the root mean square over its axes, from sixth differences: motion hardly enters, noise by √924.
pub(super) fn sixth_differences(signals: impl Iterator<Item = [f64; 3]>) -> f64 {
    const BINOMIAL: [f64; 7] = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
    let (mut sum, mut count) = (0.0, 0.0);
    let mut window: VecDeque<[f64; 3]> = VecDeque::with_capacity(BINOMIAL.len());
    for signal in signals {
        if window.len() == BINOMIAL.len() {
            window.pop_front();
        }
        window.push_back(signal);
        if window.len() < BINOMIAL.len() {
            continue;
        }
        let axis = |k: usize| window.iter().zip(BINOMIAL).map(|(v, weight)| weight * v[k]).sum::<f64>();
        let square: f64 = (0..3).map(|k| axis(k).powi(2)).sum();
        if square.is_finite() {
            (sum, count) = (sum + square, count + 3.0 * 924.0);
        }
    }
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}
