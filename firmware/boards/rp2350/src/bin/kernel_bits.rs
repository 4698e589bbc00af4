//! Prints the digests of the factor's kernels on a Cortex-M33.
#![no_std]
#![no_main]

use core::panic::PanicInfo;

use cortex_m_rt::entry;
use rigident_cortex_m::kernel_bits::digests;
use semihosting::println;

#[entry]
fn main() -> ! {
    for digest in digests() {
        println!("{digest:08x}");
    }
    semihosting::process::exit(0)
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    semihosting::process::exit(101)
}
