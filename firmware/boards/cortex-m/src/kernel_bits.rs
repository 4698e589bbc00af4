//! The factor's kernels on numbers that need no generator, and a digest of every bit of what they make.
//!
//! This file is also compiled for the host (`hil-sim/tests/integration/kernel_bits.rs`), which compares.

use rigident_shared::factor::{BodyCascade, InformationFactor};
use rigident_shared::spatial::Position;

/// Returns the digests of a body's cascade of 10 and of 16 parameters, and of factors of 19 and 25
/// parameters.
pub fn digests() -> [u32; 4] {
    [body::<10>(), body::<16>(), given::<19>(), given::<25>()]
}

/// Returns a value between −1 and 1, different for each number.
fn value(number: u32) -> f32 {
    (number.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 23) as f32 - 1.0
}

/// Returns FNV-1a over the bits of the factor's entries.
fn digest<const N: usize>(factor: &InformationFactor<f32, N>) -> u32 {
    let rows = (0..N).flat_map(|i| factor.row(i));
    rows.chain([factor.residual_sum_of_squares()])
        .flat_map(|entry| entry.to_bits().to_le_bytes())
        .fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

#[inline(never)]
fn body<const N: usize>() -> u32 {
    let mut cascade = BodyCascade::<f32, N>::new();
    let lever_arm = Position::new(0.06, -0.04, 0.02);
    let weights = [0.2, 0.2, 0.1, 2.6, 2.2, 2.2];
    for sample in 0..500 {
        cascade.absorb(&core::array::from_fn(|k| 3.0 * value(18 * sample + k as u32)), &lever_arm, &weights);
    }
    digest(&cascade.factor())
}

#[inline(never)]
fn given<const N: usize>() -> u32 {
    let mut factor = InformationFactor::<f32, N>::new();
    for block in 0..40 {
        let number = |j: usize, i: usize| (block * 26 + j as u32) * 6 + i as u32;
        let columns: [[f32; 6]; N] = core::array::from_fn(|j| core::array::from_fn(|i| value(number(j, i))));
        factor.absorb::<6>(&columns, &core::array::from_fn(|i| value(number(25, i))));
    }
    digest(&factor)
}
