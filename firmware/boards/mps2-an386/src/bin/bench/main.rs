//! Counts instructions per sample: run with `-icount shift=0`, where one instruction takes one virtual
//! nanosecond and SysTick, at 25 MHz, ticks once in forty.
//!
//! Prints one JSON object per line:
//! `{"part":"kernel","n":10,"samples":1000,"instructions_per_sample":1234.5}`.
//! `kernel`: one aligned reading, without filter, through screening, mounting, regressor and whitening into the
//! factor as six rows. `path`: one frame of the load cell's converter and one packet of the IMU, from the bytes on
//! the bus through drivers, calibration, alignment and a filter of 0.1 s at 1 kHz into the factor, six rows every
//! tenth sample; the bus itself is a copy.
#![no_std]
#![no_main]

mod sensors;

use core::arch::asm;
use core::hint::black_box;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
// Start-up, panic handler and interrupts' home.
use mps2_an386 as _;
use rigident_firmware::{Event, Instrument, Sensor};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::estimator::{Estimator, EstimatorConfig};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
use rigident_shared::wire::{
    Command, ImuSettings, Kind, LoadCellSettings, Settings, Source, StateName, TelemetrySettings, encode,
    frame,
};
use semihosting::{eprintln, println};

/// What the firmware logs would stand between the lines.
#[defmt::global_logger]
struct Silent;

// SAFETY: nothing is kept, so there is nothing to be entered twice.
unsafe impl defmt::Logger for Silent {
    fn acquire() {}
    unsafe fn flush() {}
    unsafe fn release() {}
    unsafe fn write(_: &[u8]) {}
}

const INSTRUCTIONS_PER_TICK: u32 = 40;
/// The counter's width.
const TICKS: u32 = 0x00FF_FFFF;
/// Different readings, gone through again and again.
const READINGS: usize = 64;
const SAMPLES: u32 = 1000;
/// Noise of the platform thesis\' load cell, N and N m.
const CHANNEL_SIGMA: [f32; 6] = [5.05, 5.05, 10.1, 0.383, 0.459, 0.459];

#[entry]
fn main() -> ! {
    let mut core = cortex_m::Peripherals::take().expect("taken once");
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(TICKS);
    core.SYST.clear_current();
    core.SYST.enable_counter();

    if !clock_counts_instructions() {
        give_up("this count needs the emulator to run with -icount shift=0");
    }
    let readings = readings();
    kernel::<10>(&readings);
    kernel::<16>(&readings);
    path(10);
    path(16);
    semihosting::process::exit(0)
}

fn give_up(reason: &str) -> ! {
    eprintln!("{reason}");
    semihosting::process::exit(1)
}

fn kernel<const N: usize>(readings: &[Reading<f32>; READINGS]) {
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

fn path(n: usize) {
    let known_offset = (n == 10).then_some([0.0; 6]);
    let mut instrument = Instrument::new("bench", sensors::Adc::new(), sensors::Imu::new(), sensors::NoWait);
    let mut bytes = [0; frame::MAX_FRAME];
    for (sequence, command) in [Command::Configure(settings(known_offset)), Command::Start].iter().enumerate()
    {
        let length = encode(Kind::Command, sequence as u16, command, &mut bytes).expect("it fits");
        instrument.on_bytes(&bytes[..length], 0);
    }
    if instrument.app().state().0 != StateName::Running {
        give_up("the firmware does not run");
    }
    let mut time_ns = 0;
    let mut sample = || {
        time_ns += 630_000;
        instrument.on_event(Event { sensor: Sensor::Imu, capture_time_ns: time_ns });
        time_ns += 370_000;
        instrument.on_event(Event { sensor: Sensor::LoadCell, capture_time_ns: time_ns });
    };
    // Until the filter is full and the factor no longer empty.
    (0..200).for_each(|_| sample());
    report("path", n, || (0..SAMPLES).for_each(|_| sample()));
    if instrument.app().state().0 != StateName::Running {
        give_up("the firmware has stopped");
    }
}

fn settings(known_offset_n_nm: Option<[f32; 6]>) -> Settings {
    Settings {
        rate_hz: 1000.0,
        source: Source::Sensors,
        imu: ImuSettings {
            rate_hz: 1000.0,
            rotation_wxyz: [0.92, 0.20, -0.10, 0.32],
            position_m: [0.06, -0.04, 0.02],
            accel_scale: [1.0; 3],
            accel_bias_mps2: [0.0; 3],
            gyro_bias_radps: [0.0; 3],
            group_delay_ns: 600_000,
            range_mps2: 157.0,
            range_radps: 34.0,
        },
        load_cell: LoadCellSettings {
            calibration: core::array::from_fn(|i| core::array::from_fn(|j| if i == j { 1e5 } else { 3e3 })),
            noise_n_nm: CHANNEL_SIGMA,
            known_offset_n_nm,
            group_delay_ns: 1_500_000,
            range_n_nm: [1e6; 6],
        },
        filter_width_s: 0.1,
        row_every: 10,
        stop: None,
        telemetry: TelemetrySettings { estimate_every_blocks: 0, stream_readings: false },
        frozen_after: 50,
        host_timeout_ms: 0,
    }
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
