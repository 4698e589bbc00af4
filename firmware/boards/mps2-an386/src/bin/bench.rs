//! Instructions per sample.
#![no_std]
#![no_main]
use cortex_m_rt::entry;
use mps2_an386::exit;

#[entry]
fn main() -> ! {
    exit::success()
}
