//! The factor's kernels: of one body from its signals, and of any N parameters from given rows.

use core::hint::black_box;

use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::estimator::{Estimator, EstimatorConfig};
use rigident_shared::factor::InformationFactor;
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use crate::measure::Bench;

/// Noise of the platform thesis' load cell, N and N m.
pub const CHANNEL_SIGMA: [f32; 6] = [5.05, 5.05, 10.1, 0.383, 0.459, 0.459];
/// Different readings, gone through again and again.
const READINGS: usize = 64;
/// RAM of the board outside of what the firmware is allowed: N = 128 takes 64 KiB for R alone.
const PSRAM: usize = 0x2100_0000;

/// One aligned reading at full weight, without filter, into the cascade.
#[inline(never)]
pub fn body<const N: usize>(bench: &Bench) {
    let readings = readings();
    let config = EstimatorConfig {
        rate_hz: 1000.0,
        filter_width_s: 0.0,
        row_every: 1,
        channel_sigma: CHANNEL_SIGMA,
        known_offset: [0.0; 6],
        mounting: ImuMounting::default(),
        limits: Limits::none(),
    };
    let mut estimator = Estimator::<f32, N, 1>::new(&config).expect("a possible configuration");
    for reading in &readings {
        estimator.absorb(black_box(reading));
    }
    let mut next = readings.iter().cycle();
    bench.case("kernel", N, 1000, 20_000, || {
        if let Some(reading) = next.next() {
            estimator.absorb(black_box(reading));
        }
    });
    black_box(&estimator);
}

/// A motion without zeros: each channel a different triangle wave.
fn readings() -> [Reading<f32>; READINGS] {
    core::array::from_fn(|k| {
        let wave = |period: usize, amplitude: f32| {
            let phase = (k * 7 + period) % period;
            amplitude * (phase as f32 * 2.0 / period as f32 - 0.97)
        };
        Reading {
            time_ns: 1_000_000 * k as u64,
            wrench: Wrench::from_array([
                wave(11, 80.0),
                wave(13, 70.0),
                wave(17, 60.0) + 196.0,
                wave(19, 6.0),
                wave(23, 5.0),
                wave(29, 4.0),
            ]),
            specific_force: SpecificForce::new(wave(31, 3.0), wave(37, 3.0), wave(41, 3.0) + 9.8),
            angular_rate: AngularRate::new(wave(43, 1.0), wave(47, 1.1), wave(53, 1.2)),
        }
    })
}

/// Six given rows of N parameters: columns, and a right-hand side. The factor works in them.
#[repr(C)]
pub struct Rows<const N: usize> {
    columns: [[f32; 6]; N],
    rhs: [f32; 6],
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
    // reference into it lives while this function runs. Every field is written before it is referred to. The factor
    // of no rows is all zeros; made by `new`, copies of it would stand on the stack.
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

/// So many blocks of six until a factor of N parameters has its full rank, and one more.
pub fn until_full_rank(n: usize) -> usize {
    n / 6 + 2
}

/// Six rows into a factor.
#[inline(always)]
pub fn absorb<const N: usize>(factor: &mut InformationFactor<f32, N>, rows: &mut Rows<N>) {
    let Rows { columns, rhs } = black_box(rows);
    factor.absorb::<6>(columns, rhs);
}

/// Six dense rows into one factor, `BLOCKS` times; counted from where the factor has its full rank, since columns
/// that find no row left cost nothing. The rows stand where they are absorbed from: nothing is copied within the count.
#[inline(never)]
pub fn dense<const N: usize, const BLOCKS: usize>(bench: &Bench) {
    with_rows::<N, BLOCKS>(|factor, rows| {
        let mut blocks = rows.iter_mut();
        let mut absorb = || {
            if let Some(rows) = blocks.next() {
                absorb(factor, rows);
            }
        };
        let first = until_full_rank(N);
        (0..first).for_each(|_| absorb());
        bench.case("dense", N, (BLOCKS - first) as u32, 0, absorb);
        black_box(factor);
    });
}

/// Numbers in [−1, 1), the same in every run.
fn random() -> impl FnMut() -> f32 {
    let mut state = 7_u32;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 9) as f32 / 4_194_304.0 - 1.0
    }
}
