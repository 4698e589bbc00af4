//! Counts instructions per sample: run with `-icount shift=0`, where one instruction takes one virtual
//! nanosecond. Prints one JSON object per case and line; `cargo xtask bench-target` reads them. The parts:
//!
//! - `kernel`: one reading of a body at full weight, regressor included, into the cascade;
//! - `dense`: six given rows of N parameters into one factor;
//! - `path`: what the application does with one reading of each sensor, as decoded from the bus, in the
//!   default configuration at 1 kHz: a filter of 0.1 s, six rows every tenth reading, the stop rule set,
//!   nothing sent;
//! - `path with drivers`: the same from the bytes on the bus;
//! - `path with estimates`, `path with all telemetry`: `path` and what is sent to the host, by default, four
//!   times a second and of every reading;
//! - `frame path`: a frame of the 34-DOF human from the bytes on the bus to the factor of 128 parameters;
//! - `watch path`: a frame of a humanoid of 30 links that is watched, a step of its test included;
//! - `C Householder`, with the feature `c-baseline`: given rows as in `dense`, by the textbook's algorithm in
//!   C.
//!
//! With the argument `traced` the search for the worst sample is left out. With `panic` or `fault` nothing is
//! counted: the run ends so, for the test of the exit status.
#![no_std]
#![no_main]

#[cfg(feature = "c-baseline")]
mod baseline;
mod kernels;
mod measure;
mod path;
mod sensors;

use cortex_m_rt::entry;
use measure::Bench;
use rigident_firmware::Path;
// Start-up, panic handler and interrupts' home.
use mps2_an386 as _;
use semihosting::experimental::env;

/// Swallows what the firmware logs: it would be between the lines.
#[defmt::global_logger]
struct Silent;

// SAFETY: nothing is stored, so there is nothing to be entered twice.
unsafe impl defmt::Logger for Silent {
    fn acquire() {}
    unsafe fn flush() {}
    unsafe fn release() {}
    unsafe fn write(_: &[u8]) {}
}

#[entry]
fn main() -> ! {
    let core = cortex_m::Peripherals::take().expect("taken once");
    let arguments = env::args::<64>().expect("semihosting gives a command line");
    let word = (&arguments).skip(1).find_map(Result::ok);
    assert!(word != Some("panic"), "this panic was asked for");
    if word == Some("fault") {
        cortex_m::asm::udf();
    }
    let mut bench = Bench::start(core.SYST, word == Some("traced"));
    kernels::body::<10>(&mut bench);
    kernels::body::<16>(&mut bench);
    kernels::dense::<19, 69>(&mut bench);
    kernels::dense::<25, 60>(&mut bench);
    kernels::dense::<36, 40>(&mut bench);
    kernels::dense::<128, 31>(&mut bench);
    #[cfg(feature = "c-baseline")]
    baseline::all(&mut bench);
    let path = cortex_m::singleton!(: Path = Path::EMPTY).expect("taken once");
    for n in [10, 16, 19, 25] {
        path::decoded(&mut bench, path, n);
    }
    for n in [10, 16, 19, 25] {
        path::with_drivers(&mut bench, path, n);
    }
    for n in [10, 16, 19, 25] {
        path::with_telemetry(&mut bench, path, n);
    }
    path::frames(&mut bench, path, false);
    path::frames(&mut bench, path, true);
    #[cfg(feature = "watch")]
    path::watch(&mut bench, path);
    semihosting::process::exit(0)
}
