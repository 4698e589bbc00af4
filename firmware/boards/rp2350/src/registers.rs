//! Registers of the RP2350 (data sheet, chapters of the blocks); every block has aliases that set and clear
//! bits.

pub use rigident_cortex_m::registers::{Register, wait_for};

const SET: usize = 0x2000;
const CLEAR: usize = 0x3000;

/// Returns the register at an offset in a block.
const fn at(block: usize, offset: usize) -> Register {
    // SAFETY: this module alone calls it, with addresses of the data sheet; none of them names memory.
    unsafe { Register::new(block + offset) }
}

/// Sets bits.
pub fn set(register: Register, bits: u32) {
    at(register.address(), SET).write(bits);
}

/// Clears bits.
pub fn clear(register: Register, bits: u32) {
    at(register.address(), CLEAR).write(bits);
}

const CLOCKS: usize = 0x4001_0000;
pub const CLK_REF_CTRL: Register = at(CLOCKS, 0x30);
pub const CLK_REF_SELECTED: Register = at(CLOCKS, 0x38);
pub const CLK_SYS_CTRL: Register = at(CLOCKS, 0x3c);
pub const CLK_SYS_SELECTED: Register = at(CLOCKS, 0x44);
pub const CLK_PERI_CTRL: Register = at(CLOCKS, 0x48);

const RESETS: usize = 0x4002_0000;
pub const RESETS_RESET: Register = at(RESETS, 0x00);
pub const RESETS_DONE: Register = at(RESETS, 0x08);

const IO_BANK0: usize = 0x4002_8000;
pub const GPIO0_CTRL: Register = at(IO_BANK0, 0x04);
pub const GPIO1_CTRL: Register = at(IO_BANK0, 0x0c);

const PADS_BANK0: usize = 0x4003_8000;
pub const GPIO0_PAD: Register = at(PADS_BANK0, 0x04);
pub const GPIO1_PAD: Register = at(PADS_BANK0, 0x08);

const XOSC: usize = 0x4004_8000;
pub const XOSC_CTRL: Register = at(XOSC, 0x00);
pub const XOSC_STATUS: Register = at(XOSC, 0x04);
pub const XOSC_STARTUP: Register = at(XOSC, 0x0c);

const PLL_SYS: usize = 0x4005_0000;
pub const PLL_CS: Register = at(PLL_SYS, 0x00);
pub const PLL_PWR: Register = at(PLL_SYS, 0x04);
pub const PLL_FBDIV: Register = at(PLL_SYS, 0x08);
pub const PLL_PRIM: Register = at(PLL_SYS, 0x0c);

const UART0: usize = 0x4007_0000;
pub const UART_DR: Register = at(UART0, 0x00);
pub const UART_FR: Register = at(UART0, 0x18);
pub const UART_IBRD: Register = at(UART0, 0x24);
pub const UART_FBRD: Register = at(UART0, 0x28);
pub const UART_LCR_H: Register = at(UART0, 0x2c);
pub const UART_CR: Register = at(UART0, 0x30);
pub const UART_IMSC: Register = at(UART0, 0x38);
pub const UART_ICR: Register = at(UART0, 0x44);

const TIMER0: usize = 0x400b_0000;
pub const TIMER_RAWH: Register = at(TIMER0, 0x24);
pub const TIMER_RAWL: Register = at(TIMER0, 0x28);

const TICKS: usize = 0x4010_8000;
pub const TICKS_TIMER0_CTRL: Register = at(TICKS, 0x18);
pub const TICKS_TIMER0_CYCLES: Register = at(TICKS, 0x1c);
pub const TICKS_WATCHDOG_CTRL: Register = at(TICKS, 0x30);
pub const TICKS_WATCHDOG_CYCLES: Register = at(TICKS, 0x34);

const PSM: usize = 0x4001_8000;
pub const PSM_WDSEL: Register = at(PSM, 0x08);

const WATCHDOG: usize = 0x400d_8000;
pub const WATCHDOG_CTRL: Register = at(WATCHDOG, 0x00);
pub const WATCHDOG_LOAD: Register = at(WATCHDOG, 0x04);
pub const WATCHDOG_REASON: Register = at(WATCHDOG, 0x08);
/// Words that only power coming on and the RUN pin clear; the boot ROM uses the other four.
pub const WATCHDOG_SCRATCH: [Register; 4] =
    [at(WATCHDOG, 0x0c), at(WATCHDOG, 0x10), at(WATCHDOG, 0x14), at(WATCHDOG, 0x18)];

/// The core's faults, by kinds.
pub const SCB_CFSR: Register = at(0xe000_ed28, 0);
