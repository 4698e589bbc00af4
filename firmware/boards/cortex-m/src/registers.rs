//! A register, and a wait for its bits that ends.

use core::ptr;

/// A 32-bit register of a peripheral.
#[derive(Clone, Copy)]
pub struct Register(usize);

impl Register {
    /// Returns the register at an address.
    ///
    /// # Safety
    /// A 32-bit register must be at the address, which must be a multiple of four. Of those that name memory it must be sound
    /// what is written to them.
    pub const unsafe fn new(address: usize) -> Self {
        Self(address)
    }

    /// Returns what it holds.
    #[inline]
    pub fn read(self) -> u32 {
        // SAFETY: whoever made it promised an aligned register.
        unsafe { ptr::read_volatile(self.0 as *const u32) }
    }

    /// Gives it a value.
    #[inline]
    pub fn write(self, value: u32) {
        // SAFETY: whoever made it promised an aligned register; what is written to those that name memory is said where it is
        // written.
        unsafe { ptr::write_volatile(self.0 as *mut u32, value) }
    }

    /// Clears bits, then sets bits.
    #[inline]
    pub fn change(self, clear: u32, set: u32) {
        self.write(self.read() & !clear | set);
    }

    /// Returns its address.
    #[inline]
    pub fn address(self) -> usize {
        self.0
    }
}

/// Waits until the register's bits under `mask` are `wanted`, for so many looks at most, and returns whether they are. A look
/// takes some five cycles.
#[inline]
pub fn wait_for(register: Register, mask: u32, wanted: u32, looks: u32) -> bool {
    (0..looks).any(|_| register.read() & mask == wanted)
}
