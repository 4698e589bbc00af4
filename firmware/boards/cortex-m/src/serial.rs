//! A serial port's two queues, between its interrupts and the main loop.

use core::ops::DerefMut;
use core::sync::atomic::{AtomicU32, Ordering};

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use rigident_firmware::{Instrument, Path};

use crate::interrupts;
use crate::ring::Ring;

/// The queues of the link to the host.
pub struct Queues {
    /// Holds what the host has said: a full frame of the wire and some, so that one command at a time never
    /// fills it.
    pub from_host: Ring<2048>,
    /// Holds what the firmware has to say.
    pub to_host: Ring<4096>,
    /// Counts times that bytes from the host found no room; it wraps.
    overruns: AtomicU32,
}

impl Queues {
    /// Returns both, empty.
    #[must_use]
    pub const fn new() -> Self {
        Self { from_host: Ring::new(), to_host: Ring::new(), overruns: AtomicU32::new(0) }
    }

    /// Forgets what is in both.
    pub fn clear(&self) {
        while self.from_host.pop().is_some() || self.to_host.pop().is_some() {}
    }

    /// Notes that bytes from the host found no room. Called from the port's interrupt only.
    pub fn overrun(&self) {
        self.overruns.store(self.overruns.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }

    /// Returns how often that has happened since it was `before`, which becomes what it is now.
    pub fn newly_overrun(&self, before: &mut u32) -> u32 {
        let now = self.overruns.load(Ordering::Relaxed);
        now.wrapping_sub(core::mem::replace(before, now))
    }

    /// Takes bytes from the host into `buffer` and returns how many there were.
    pub fn receive(&self, buffer: &mut [u8]) -> usize {
        let mut count = 0;
        for slot in buffer {
            let Some(byte) = self.from_host.pop() else { break };
            *slot = byte;
            count += 1;
        }
        count
    }

    /// Moves what the firmware has to say into its queue, as far as there is room, and returns whether there
    /// was something. The port's interrupt has to be woken then.
    pub fn fill<P, A, I, F, D>(&self, instrument: &mut Instrument<P, A, I, F, D>, chunk: &mut [u8]) -> bool
    where
        P: DerefMut<Target = Path>,
        A: SpiDevice,
        I: SpiDevice,
        F: SpiDevice,
        D: DelayNs,
    {
        let mut moved = false;
        loop {
            let room = self.to_host.room().min(chunk.len());
            let Some(free) = chunk.get_mut(..room) else { return moved };
            let count = instrument.poll_tx(free);
            if count == 0 {
                return moved;
            }
            free.iter().take(count).for_each(|byte| {
                // There is room for all of them.
                self.to_host.push(*byte);
            });
            moved = true;
        }
    }

    /// Sleeps until an interrupt, unless the host has sent something meanwhile.
    pub fn wait(&self) {
        // With interrupts held back an interrupt still ends the sleep: none slips in between look and sleep.
        interrupts::free(|_| {
            if self.from_host.is_empty() {
                interrupts::sleep();
            }
        });
    }
}

impl Default for Queues {
    fn default() -> Self {
        Self::new()
    }
}
