//! The factor's kernels: of one body from its signals, and of any N parameters from given rows.

use core::hint::black_box;

use rigident_shared::factor::{Block, BodyCascade, InformationFactor};
use rigident_shared::spatial::Position;

use crate::measure::Bench;

/// Noise of the platform thesis' load cell, N and N m.
pub const CHANNEL_SIGMA: [f32; 6] = [5.05, 5.05, 10.1, 0.383, 0.459, 0.459];
/// Different samples, gone through again and again.
const SAMPLES: usize = 64;
/// RAM of the board outside of what the firmware is allowed: N = 128 takes 64 KiB for R alone.
const PSRAM: usize = 0x2100_0000;
/// Tells where the blocks are in it.
const BLOCKS_AT: usize = 0x2140_0000;

/// Specific force, angular rate, angular acceleration and wrench of one instant.
struct Sample {
    specific_force: [f32; 3],
    rate: [f32; 3],
    acceleration: [f32; 3],
    wrench: [f32; 6],
}

/// Measures one sample at full weight into the cascade: products of the rates, lever arm, regressor,
/// whitening, reduction, merges of full levels.
#[inline(never)]
pub fn body<const N: usize>(bench: &mut Bench) {
    let samples = samples();
    let weights = CHANNEL_SIGMA.map(|sigma| 1.0 / sigma);
    let lever_arm = Position::new(0.06, -0.04, 0.02);
    let mut cascade = BodyCascade::<f32, N>::new();
    let mut next = 0;
    let mut run = |count: u32| {
        for _ in 0..count {
            let Some(Sample { specific_force, rate: [x, y, z], acceleration, wrench }) = samples.get(next)
            else {
                return;
            };
            let [ux, uy, uz] = *specific_force;
            let [fx, fy, fz, mx, my, mz] = *wrench;
            let [ax, ay, az] = *acceleration;
            let signals =
                [ux, uy, uz, x * x, y * y, z * z, y * z, z * x, x * y, fx, fy, fz, mx, my, mz, ax, ay, az];
            cascade.absorb(&signals, &lever_arm, &weights);
            next = (next + 1) % SAMPLES;
        }
    };
    // The first blocks meet zeros.
    run(SAMPLES as u32);
    bench.case_of("kernel", N, 1000, 20_000, run);
    black_box(&cascade);
}

/// Returns a motion without zeros: each channel a different triangle wave.
fn samples() -> [Sample; SAMPLES] {
    core::array::from_fn(|k| {
        let wave = |period: usize, amplitude: f32| {
            let phase = (k * 7 + period) % period;
            amplitude * (phase as f32 * 2.0 / period as f32 - 0.97)
        };
        Sample {
            specific_force: [wave(31, 3.0), wave(37, 3.0), wave(41, 3.0) + 9.8],
            rate: [wave(43, 1.0), wave(47, 1.1), wave(53, 1.2)],
            acceleration: [wave(59, 4.0), wave(61, 5.0), wave(67, 3.0)],
            wrench: [
                wave(11, 80.0),
                wave(13, 70.0),
                wave(17, 60.0) + 196.0,
                wave(19, 6.0),
                wave(23, 5.0),
                wave(29, 4.0),
            ],
        }
    })
}

/// Six given rows of N parameters: columns, and a right-hand side. The factor works in them.
#[repr(C)]
pub struct Rows<const N: usize> {
    pub columns: [[f32; 6]; N],
    pub rhs: [f32; 6],
}

/// A factor and all the rows that it will meet, outside of the firmware's RAM.
struct Dense<const N: usize, const BLOCKS: usize> {
    factor: InformationFactor<f32, N>,
    rows: [Rows<N>; BLOCKS],
}

/// Calls `run` with the factor of no rows and `BLOCKS` times six random rows, the same for each call.
pub fn with_rows<const N: usize, const BLOCKS: usize>(
    run: impl FnOnce(&mut InformationFactor<f32, N>, &mut [Rows<N>; BLOCKS]),
) {
    let place = PSRAM as *mut Dense<N, BLOCKS>;
    let mut random = random();
    // SAFETY: the board has 16 MB of RAM there, aligned for anything; nothing is linked to it and no other
    // reference into it lives while this function runs. Every field is written before it is referred to. The
    // factor of no rows is all zeros; made by `new`, copies of it would be on the stack.
    let Dense { factor, rows } = unsafe {
        (&raw mut (*place).factor).write_bytes(0, 1);
        let values = (&raw mut (*place).rows).cast::<f32>();
        for k in 0..BLOCKS * size_of::<Rows<N>>() / size_of::<f32>() {
            values.add(k).write(random());
        }
        &mut *place
    };
    run(factor, rows);
}

/// Returns the number of blocks of six until a factor of N parameters has its full rank, and one more.
pub fn until_full_rank(n: usize) -> usize {
    n / 6 + 2
}

/// Returns the rows of two samples one below the other, as the factor absorbs them.
pub fn block_of<const N: usize>([first, second]: &[Rows<N>; 2]) -> Block<f32, N> {
    let stacked =
        |a: &[f32; 6], b: &[f32; 6]| core::array::from_fn(|i| if i < 6 { a[i] } else { b[i - 6] }).into();
    Block {
        columns: core::array::from_fn(|j| stacked(&first.columns[j], &second.columns[j])),
        rhs: stacked(&first.rhs, &second.rhs),
    }
}

/// Measures six dense rows into one factor, `BLOCKS` times, every second time with the six before; counted
/// from where the factor has its full rank, since columns that find no row left cost nothing. The rows are
/// where they are absorbed from: nothing is copied within the count.
#[inline(never)]
pub fn dense<const N: usize, const BLOCKS: usize>(bench: &mut Bench) {
    with_rows::<N, BLOCKS>(|factor, rows| {
        // SAFETY: RAM behind what `with_rows` uses, for no more blocks than there are rows for; each is
        // written before it is referred to.
        let blocks = unsafe {
            let place = BLOCKS_AT as *mut Block<f32, N>;
            let (pairs, _) = rows.as_chunks::<2>();
            for (k, pair) in pairs.iter().enumerate() {
                place.add(k).write(block_of(pair));
            }
            core::slice::from_raw_parts_mut(place, pairs.len())
        };
        let first = until_full_rank(N).div_ceil(2);
        let (before, counted) = blocks.split_at_mut(first);
        for block in before {
            factor.absorb_block(block);
        }
        let samples = 2 * counted.len() as u32;
        let mut blocks = counted.iter_mut();
        let mut waiting = false;
        bench.case("dense", N, samples, 0, || {
            if waiting && let Some(block) = blocks.next() {
                factor.absorb_block(black_box(block));
            }
            waiting = !waiting;
        });
        black_box(factor);
    });
}

/// Returns a source of numbers in [−1, 1), the same in every run.
fn random() -> impl FnMut() -> f32 {
    let mut state = 7_u32;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 9) as f32 / 4_194_304.0 - 1.0
    }
}
