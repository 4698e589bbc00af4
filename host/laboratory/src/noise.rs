//! Random numbers that are the same on every machine.

/// Steele's splitmix64 and Box and Muller's transformation: the same noise for a seed on every machine.
pub(super) struct Noise(pub(super) Option<u64>);

impl Noise {
    /// Returns a number between 0 and 1.
    pub(super) fn uniform(&mut self) -> f64 {
        let state = self.0.get_or_insert(0);
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a normal number of standard deviation `sigma`; zero without a seed.
    pub(super) fn normal(&mut self, sigma: f64) -> f64 {
        if self.0.is_none() || sigma == 0.0 {
            return 0.0;
        }
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        sigma * radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}
