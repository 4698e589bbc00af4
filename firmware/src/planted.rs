//! Offenders that the checks of the release binary must find. Compiled in by their features alone.

use core::hint::black_box;

/// Computes in double precision.
#[cfg(feature = "plant-double")]
pub fn double(x: f32) {
    black_box(f64::from(black_box(x)) * 1.1);
}

/// Uses an index that no compiler can prove to be in bounds.
#[cfg(feature = "plant-panic")]
pub fn panic(values: &[f32], index: usize) {
    black_box(values[black_box(index)]);
}
