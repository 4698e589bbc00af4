//! Marks, the emulated clock as a counter of instructions, and the line that a case prints.

use core::arch::asm;
use core::hint::black_box;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use semihosting::{eprintln, print, println};

/// With `-icount shift=0` an instruction takes a nanosecond, and a tick of 25 MHz forty.
const INSTRUCTIONS_PER_TICK: u32 = 40;
/// The counter's width.
const TICKS: u32 = 0x00FF_FFFF;

/// Counts of samples by their ticks, the last by all longer ones; in RAM of the board outside of what the
/// firmware is allowed.
const COUNTS: usize = 8192;
const COUNTS_AT: usize = 0x21C0_0000;

/// Holds what to run: everything, or no more than the marked stretches.
pub struct Bench {
    /// The emulator writes every instruction down; the long search for the worst sample is left to the other
    /// run.
    traced: bool,
    counts: &'static mut [u32; COUNTS],
}

impl Bench {
    /// Starts the counter and makes sure that it counts instructions.
    pub fn start(mut counter: SYST, traced: bool) -> Self {
        counter.set_clock_source(SystClkSource::Core);
        counter.set_reload(TICKS);
        counter.clear_current();
        counter.enable_counter();
        if !clock_counts_instructions() {
            give_up("this count needs the emulator to run with -icount shift=0");
        }
        // SAFETY: the board has RAM there, aligned; nothing is linked to it, no other part of the bench uses
        // it, and the counter, of which there is one, is taken for good. Any bits are counts.
        let counts = unsafe { &mut *(COUNTS_AT as *mut [u32; COUNTS]) };
        Self { traced, counts }
    }

    /// Measures `samples` samples between two marks, then, sample by sample, the worst of `search` more.
    /// Prints
    /// `{"part":"kernel","n":10,"samples":1000,"instructions_per_sample":1234.5,"worst_of":20000,"worst_instructions":2560,
    /// "histogram":[[1120,18000],[2560,2000]]}`: samples of the search by their instructions, to one tick.
    pub fn case(&mut self, part: &str, n: usize, samples: u32, search: u32, mut sample: impl FnMut()) {
        self.case_of(part, n, samples, search, |count| {
            for _ in 0..count {
                bench_sample();
                sample();
            }
        });
    }

    /// Measures, as [`Self::case`] does, a run that goes through many samples by itself; the trace cannot
    /// separate them.
    pub fn case_of(&mut self, part: &str, n: usize, samples: u32, search: u32, mut run: impl FnMut(u32)) {
        let marked = || {
            bench_begin();
            run(samples);
            bench_end();
        };
        let tenths = 10 * u64::from(INSTRUCTIONS_PER_TICK) * u64::from(ticks(marked)) / u64::from(samples);
        let search = if self.traced { 0 } else { search };
        self.counts.fill(0);
        let mut worst = 0;
        for _ in 0..search {
            let taken = ticks(|| run(1));
            worst = worst.max(taken);
            if let Some(count) = self.counts.get_mut((taken as usize).min(COUNTS - 1)) {
                *count += 1;
            }
        }
        print!(
            "{{\"part\":\"{part}\",\"n\":{n},\"samples\":{samples},\"instructions_per_sample\":{}.{},\"worst_of\":{search},\"worst_instructions\":{},\"histogram\":[",
            tenths / 10,
            tenths % 10,
            worst * INSTRUCTIONS_PER_TICK
        );
        let taken = self.counts.iter().enumerate().filter(|(_, count)| **count > 0);
        for (k, (ticks, count)) in taken.enumerate() {
            let comma = if k > 0 { "," } else { "" };
            print!("{comma}[{},{count}]", ticks * INSTRUCTIONS_PER_TICK as usize);
        }
        println!("]}}");
    }
}

/// Ends the run with a reason.
pub fn give_up(reason: &str) -> ! {
    eprintln!("{reason}");
    semihosting::process::exit(1)
}

/// Marks where `cargo xtask bench-target` starts counting in the emulator's trace.
#[inline(never)]
#[unsafe(no_mangle)]
extern "C" fn bench_begin() {
    // SAFETY: does nothing; unlike an empty body it is not merged with other functions.
    unsafe { asm!("nop", options(nomem, nostack)) };
}

/// Marks where it stops. The same instructions as `bench_begin` would let the compiler merge the two.
#[inline(never)]
#[unsafe(no_mangle)]
extern "C" fn bench_end() {
    // SAFETY: does nothing.
    unsafe { asm!("nop", "nop", options(nomem, nostack)) };
}

/// Marks where a sample begins.
#[inline(never)]
#[unsafe(no_mangle)]
extern "C" fn bench_sample() {
    // SAFETY: does nothing.
    unsafe { asm!("nop", "nop", "nop", options(nomem, nostack)) };
}

fn ticks(run: impl FnOnce()) -> u32 {
    let before = SYST::get_current();
    black_box(run)();
    // It counts down, and wraps.
    before.wrapping_sub(SYST::get_current()) & TICKS
}

/// Times a loop of a known number of instructions. Returns true if the clock counts them.
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
