//! A register, and a wait for its bits that ends.

#[cfg(target_os = "none")]
use core::ptr;

#[cfg(not(target_os = "none"))]
use crate::model;

/// A 32-bit register of a peripheral.
#[derive(Clone, Copy)]
pub struct Register(usize);

impl Register {
    /// Returns the register at an address.
    ///
    /// # Safety
    /// A 32-bit register must be at the address, which must be a multiple of four, and no value written to it
    /// may harm memory: one that names memory is an [`AddressRegister`].
    pub const unsafe fn new(address: usize) -> Self {
        Self(address)
    }

    /// Returns what it holds.
    #[inline]
    pub fn read(self) -> u32 {
        #[cfg(not(target_os = "none"))]
        return model::read(self.0);
        // SAFETY: whoever made it promised an aligned register.
        #[cfg(target_os = "none")]
        unsafe {
            ptr::read_volatile(self.0 as *const u32)
        }
    }

    /// Gives it a value.
    #[inline]
    pub fn write(self, value: u32) {
        #[cfg(not(target_os = "none"))]
        model::write(self.0, value);
        // SAFETY: whoever made it promised an aligned register that takes any value.
        #[cfg(target_os = "none")]
        unsafe {
            ptr::write_volatile(self.0 as *mut u32, value)
        }
    }

    /// Clears bits, then sets bits.
    #[inline]
    pub fn change(self, clear: u32, set: u32) {
        self.write(self.read() & !clear | set);
    }

    /// Returns its address.
    #[inline]
    pub const fn address(self) -> usize {
        self.0
    }
}

/// A register that names memory which a peripheral reads or writes by itself.
#[derive(Clone, Copy)]
pub struct AddressRegister(Register);

impl AddressRegister {
    /// Returns the register at an address.
    ///
    /// # Safety
    /// See [`Register::new`].
    pub const unsafe fn new(address: usize) -> Self {
        // SAFETY: the caller's promise.
        Self(unsafe { Register::new(address) })
    }

    /// Names memory.
    ///
    /// # Safety
    /// The peripheral's use of the memory from here on must be sound: the memory lives as long, it is long
    /// enough, and all other users of it expect that.
    #[inline]
    pub unsafe fn write(self, address: usize) {
        #[cfg(not(target_os = "none"))]
        model::name_memory(self.0.address(), address);
        #[cfg(target_os = "none")]
        self.0.write(address as u32);
    }
}

/// Waits until the register's bits under `mask` are `wanted`, for a limited number of reads, and returns
/// whether they are. A read takes some five cycles.
#[inline]
pub fn wait_for(register: Register, mask: u32, wanted: u32, looks: u32) -> bool {
    (0..looks).any(|_| register.read() & mask == wanted)
}
