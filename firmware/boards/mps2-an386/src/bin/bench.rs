//! Counts instructions per sample: run with `-icount shift=0`, where one instruction takes one virtual
//! nanosecond and SysTick, at 25 MHz, ticks once in forty.
//!
//! Prints one JSON object per line:
//! `{"part":"kernel","n":10,"samples":1000,"instructions_per_sample":1234.5}`.
//! `kernel`: one aligned reading, without filter, through screening, mounting, regressor and whitening into the
//! factor as six rows.
#![no_std]
#![no_main]

use core::arch::asm;
use core::hint::black_box;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
// Start-up, panic handler and interrupts' home.
use mps2_an386 as _;
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::estimator::{Estimator, EstimatorConfig};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
use semihosting::println;

const INSTRUCTIONS_PER_TICK: u32 = 40;
/// The counter's width.
const TICKS: u32 = 0x00FF_FFFF;
/// Different readings, gone through again and again.
const READINGS: usize = 64;
const SAMPLES: u32 = 1000;

#[entry]
fn main() -> ! {
    let mut core = cortex_m::Peripherals::take().expect("taken once");
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(TICKS);
    core.SYST.clear_current();
    core.SYST.enable_counter();

    if !clock_counts_instructions() {
        println!("this count needs the emulator to run with -icount shift=0");
        semihosting::process::exit(1);
    }
    let readings = readings();
    kernel::<10>(&readings);
    kernel::<16>(&readings);
    semihosting::process::exit(0)
}

fn kernel<const N: usize>(readings: &[Reading<f32>; READINGS]) {
    let config = EstimatorConfig {
        rate_hz: 1000.0,
        filter_width_s: 0.0,
        row_every: 1,
        channel_sigma: [5.05, 5.05, 10.1, 0.383, 0.459, 0.459],
        known_offset: [0.0; 6],
        mounting: ImuMounting::default(),
        limits: Limits::none(),
    };
    let mut estimator = Estimator::<f32, N, 1>::new(&config).expect("a possible configuration");
    // The first blocks meet zeros and take other branches.
    for reading in readings {
        estimator.absorb(black_box(reading));
    }
    report("kernel", N, || {
        for reading in readings.iter().cycle().take(SAMPLES as usize) {
            estimator.absorb(black_box(reading));
        }
        black_box(&estimator);
    });
}

fn report(part: &str, n: usize, run: impl FnOnce()) {
    let marked = || {
        bench_begin();
        run();
        bench_end();
    };
    let tenths = 10 * u64::from(INSTRUCTIONS_PER_TICK) * u64::from(ticks(marked)) / u64::from(SAMPLES);
    let (whole, tenth) = (tenths / 10, tenths % 10);
    println!(
        "{{\"part\":\"{part}\",\"n\":{n},\"samples\":{SAMPLES},\"instructions_per_sample\":{whole}.{tenth}}}"
    );
}

/// Where `cargo xtask bench-target` starts counting in the emulator's trace.
#[inline(never)]
#[unsafe(no_mangle)]
extern "C" fn bench_begin() {
    // SAFETY: does nothing; unlike an empty body it is not merged with other functions.
    unsafe { asm!("nop", options(nomem, nostack)) };
}

/// Where it stops. The same instructions as `bench_begin` would let the compiler merge the two.
#[inline(never)]
#[unsafe(no_mangle)]
extern "C" fn bench_end() {
    // SAFETY: does nothing.
    unsafe { asm!("nop", "nop", options(nomem, nostack)) };
}

fn ticks(run: impl FnOnce()) -> u32 {
    let before = SYST::get_current();
    run();
    // It counts down, and wraps.
    before.wrapping_sub(SYST::get_current()) & TICKS
}

/// Times a loop of a known number of instructions.
fn clock_counts_instructions() -> bool {
    const ROUNDS: u32 = 400_000;
    let measured = ticks(|| {
        // SAFETY: counts a register down to zero; touches nothing else.
        unsafe {
            asm!("2:", "subs {0}, #1", "bne 2b", inout(reg) ROUNDS => _, options(nomem, nostack));
        }
    });
    measured.abs_diff(2 * ROUNDS / INSTRUCTIONS_PER_TICK) <= 4
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
