//! Registers of the RP2350 (data sheet, chapters of the blocks); every block has aliases that set and clear bits.

use core::ptr;

/// A 32-bit register.
#[derive(Clone, Copy)]
pub struct Register(usize);

const SET: usize = 0x2000;
const CLEAR: usize = 0x3000;

impl Register {
    const fn at(block: usize, offset: usize) -> Self {
        Self(block + offset)
    }

    /// Returns what it holds.
    pub fn read(self) -> u32 {
        // SAFETY: only this module makes registers: it is the aligned address of one.
        unsafe { ptr::read_volatile(self.0 as *const u32) }
    }

    /// Gives it a value.
    pub fn write(self, value: u32) {
        // SAFETY: only this module makes registers: it is the aligned address of one.
        unsafe { ptr::write_volatile(self.0 as *mut u32, value) }
    }

    /// Sets bits.
    pub fn set(self, bits: u32) {
        Self(self.0 + SET).write(bits);
    }

    /// Clears bits.
    pub fn clear(self, bits: u32) {
        Self(self.0 + CLEAR).write(bits);
    }
}

/// Waits until the bits under `mask` are `wanted`, for so many looks at most; whether they are.
pub fn wait_for(register: Register, mask: u32, wanted: u32, looks: u32) -> bool {
    (0..looks).any(|_| register.read() & mask == wanted)
}

const CLOCKS: usize = 0x4001_0000;
pub const CLK_REF_CTRL: Register = Register::at(CLOCKS, 0x30);
pub const CLK_REF_SELECTED: Register = Register::at(CLOCKS, 0x38);
pub const CLK_SYS_CTRL: Register = Register::at(CLOCKS, 0x3c);
pub const CLK_SYS_SELECTED: Register = Register::at(CLOCKS, 0x44);
pub const CLK_PERI_CTRL: Register = Register::at(CLOCKS, 0x48);

const RESETS: usize = 0x4002_0000;
pub const RESETS_RESET: Register = Register::at(RESETS, 0x00);
pub const RESETS_DONE: Register = Register::at(RESETS, 0x08);

const IO_BANK0: usize = 0x4002_8000;
pub const GPIO0_CTRL: Register = Register::at(IO_BANK0, 0x04);
pub const GPIO1_CTRL: Register = Register::at(IO_BANK0, 0x0c);

const PADS_BANK0: usize = 0x4003_8000;
pub const GPIO0_PAD: Register = Register::at(PADS_BANK0, 0x04);
pub const GPIO1_PAD: Register = Register::at(PADS_BANK0, 0x08);

const XOSC: usize = 0x4004_8000;
pub const XOSC_CTRL: Register = Register::at(XOSC, 0x00);
pub const XOSC_STATUS: Register = Register::at(XOSC, 0x04);
pub const XOSC_STARTUP: Register = Register::at(XOSC, 0x0c);

const PLL_SYS: usize = 0x4005_0000;
pub const PLL_CS: Register = Register::at(PLL_SYS, 0x00);
pub const PLL_PWR: Register = Register::at(PLL_SYS, 0x04);
pub const PLL_FBDIV: Register = Register::at(PLL_SYS, 0x08);
pub const PLL_PRIM: Register = Register::at(PLL_SYS, 0x0c);

const UART0: usize = 0x4007_0000;
pub const UART_DR: Register = Register::at(UART0, 0x00);
pub const UART_FR: Register = Register::at(UART0, 0x18);
pub const UART_IBRD: Register = Register::at(UART0, 0x24);
pub const UART_FBRD: Register = Register::at(UART0, 0x28);
pub const UART_LCR_H: Register = Register::at(UART0, 0x2c);
pub const UART_CR: Register = Register::at(UART0, 0x30);
pub const UART_IMSC: Register = Register::at(UART0, 0x38);
pub const UART_ICR: Register = Register::at(UART0, 0x44);

const TIMER0: usize = 0x400b_0000;
pub const TIMER_RAWH: Register = Register::at(TIMER0, 0x24);
pub const TIMER_RAWL: Register = Register::at(TIMER0, 0x28);

const TICKS: usize = 0x4010_8000;
pub const TICKS_TIMER0_CTRL: Register = Register::at(TICKS, 0x18);
pub const TICKS_TIMER0_CYCLES: Register = Register::at(TICKS, 0x1c);
