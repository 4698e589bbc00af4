//! Signs by chance that are the same on every machine.

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
