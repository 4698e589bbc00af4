//! UART0, the link to the host: a CMSDK port, one byte deep, driven by interrupts on both sides.

use core::num::NonZeroU32;
use core::ptr;

use rigident_cortex_m::interrupts::{mask, pend, unmask};
use rigident_cortex_m::serial::Queues;

/// Interrupt number of a received byte.
pub const RECEIVED: u16 = 0;
/// Interrupt number of a sent byte.
pub const SENT: u16 = 1;

const BASE: usize = 0x4000_4000;
const DATA: usize = BASE;
const STATE: usize = BASE + 0x04;
const CONTROL: usize = BASE + 0x08;
const INTERRUPT: usize = BASE + 0x0C;
const BAUD_DIVIDER: usize = BASE + 0x10;

const TRANSMIT_FULL: u32 = 1;
const RECEIVE_FULL: u32 = 1 << 1;
/// Transmitter and receiver on, each with its interrupt.
const ALL_ON: u32 = 0b1111;
const TRANSMIT_INTERRUPT: u32 = 1;
const RECEIVE_INTERRUPT: u32 = 1 << 1;

/// The link to the host.
pub static QUEUES: Queues = Queues::new();

fn read(register: usize) -> u32 {
    // SAFETY: the address of a 32-bit device register of this board.
    unsafe { ptr::read_volatile(register as *const u32) }
}

fn write(register: usize, value: u32) {
    // SAFETY: the address of a 32-bit device register of this board.
    unsafe { ptr::write_volatile(register as *mut u32, value) }
}

/// Switches the port on.
pub fn start() {
    // The emulator has no baud rate, but refuses to run with a divider under 16.
    const DIVIDER: NonZeroU32 = NonZeroU32::new(16).unwrap();
    write(BAUD_DIVIDER, DIVIDER.get());
    write(CONTROL, ALL_ON);
    unmask(RECEIVED);
    unmask(SENT);
}

/// Takes bytes from the host into `buffer`. Returns their number.
pub fn receive(buffer: &mut [u8]) -> usize {
    let n = QUEUES.receive(buffer);
    if n > 0 {
        // The interrupt masks itself when the queue is full; with room again, let it check once more.
        unmask(RECEIVED);
        pend(RECEIVED);
    }
    n
}

/// Has what is queued for the host sent.
pub fn send() {
    // The interrupt handler is the only one to take bytes out.
    pend(SENT);
}

/// Waits until everything queued has left the port.
pub fn flush() {
    while !QUEUES.to_host.is_empty() || read(STATE) & TRANSMIT_FULL != 0 {
        cortex_m::asm::nop();
    }
}

/// Takes one byte in an interrupt, and masks the interrupt while there is no room for it: the sender is then
/// held up.
pub fn on_received() {
    if QUEUES.from_host.room() == 0 {
        mask(RECEIVED);
        return;
    }
    // Cleared before the byte is read, since reading lets the next one in.
    write(INTERRUPT, RECEIVE_INTERRUPT);
    if read(STATE) & RECEIVE_FULL != 0 {
        // The register is 32 bits wide, its upper 24 read as zero.
        QUEUES.from_host.push(read(DATA) as u8);
    }
}

/// Sends in an interrupt until the port or the queue says stop.
pub fn on_sent() {
    write(INTERRUPT, TRANSMIT_INTERRUPT);
    while read(STATE) & TRANSMIT_FULL == 0 {
        let Some(byte) = QUEUES.to_host.pop() else { break };
        write(DATA, u32::from(byte));
    }
}
