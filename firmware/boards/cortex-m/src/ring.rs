//! A byte queue between an interrupt and the main loop.

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// Queue of up to `N` bytes; `N` is a power of two. One side pushes, the other pops; neither waits.
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    // Both only grow, and wrap with the machine word; their difference is the number of bytes held.
    pushed: AtomicUsize,
    popped: AtomicUsize,
}

impl<const N: usize> Ring<N> {
    /// Returns an empty ring.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N.is_power_of_two(), "the indices wrap by masking") };
        Self {
            bytes: [const { AtomicU8::new(0) }; N],
            pushed: AtomicUsize::new(0),
            popped: AtomicUsize::new(0),
        }
    }

    /// Returns the number of bytes held.
    pub fn len(&self) -> usize {
        self.pushed.load(Ordering::Acquire).wrapping_sub(self.popped.load(Ordering::Acquire))
    }

    /// Returns whether nothing is held.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of bytes that fit.
    pub fn room(&self) -> usize {
        N - self.len()
    }

    /// Appends a byte; says whether there was room. Called from one side only.
    pub fn push(&self, byte: u8) -> bool {
        if self.room() == 0 {
            return false;
        }
        let at = self.pushed.load(Ordering::Relaxed);
        if let Some(slot) = self.bytes.get(at & (N - 1)) {
            slot.store(byte, Ordering::Relaxed);
        }
        self.pushed.store(at.wrapping_add(1), Ordering::Release);
        true
    }

    /// Takes the oldest byte. Called from one side only.
    pub fn pop(&self) -> Option<u8> {
        if self.is_empty() {
            return None;
        }
        let at = self.popped.load(Ordering::Relaxed);
        let byte = self.bytes.get(at & (N - 1)).map(|slot| slot.load(Ordering::Relaxed));
        self.popped.store(at.wrapping_add(1), Ordering::Release);
        byte
    }
}

impl<const N: usize> Default for Ring<N> {
    fn default() -> Self {
        Self::new()
    }
}
