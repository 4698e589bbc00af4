//! USART2, the link to the host: 921 600 baud unless the host asks for more, 8N1, driven by interrupts on
//! both sides.

use rigident_cortex_m::interrupts::{free, pend, unmask};
use rigident_cortex_m::serial::Queues;

use crate::clock::Clocks;
use crate::pins::{HOST_RX, HOST_TX};
use crate::registers::{USART2_BRR, USART2_CR1, USART2_DR, USART2_SR, lines};

/// Rate of the link.
pub const BAUD: u32 = 921_600;
/// The fastest that serial adapters commonly do.
const MOST_BAUD: u32 = 3_000_000;
/// The pins' function.
const FUNCTION: u32 = 7;

const OVERRUN: u32 = 1 << 3;
const RECEIVED: u32 = 1 << 5;
const CAN_SEND: u32 = 1 << 7;
const SENT: u32 = 1 << 6;
/// A bit is eight samples long instead of sixteen: for rates above a sixteenth of the clock.
const EIGHT: u32 = 1 << 15;
const ON: u32 = 1 << 13 | 1 << 3 | 1 << 2;
const RECEIVE_INTERRUPT: u32 = 1 << 5;
const SEND_INTERRUPT: u32 = 1 << 7;

/// The link to the host.
pub static QUEUES: Queues = Queues::new();

/// Switches the port on.
pub fn start(clocks: &Clocks) {
    QUEUES.clear();
    HOST_TX.peripheral(FUNCTION, 0);
    // Pulled up: a line that is not there is silent.
    HOST_RX.peripheral(FUNCTION, 1);
    run_at(clocks, BAUD);
    unmask(lines::USART2);
}

/// Returns the fastest rate by these clocks, baud.
pub fn fastest(clocks: &Clocks) -> u32 {
    MOST_BAUD.min(clocks.usart_hz / 8)
}

/// Returns whether everything has left the port.
pub fn has_sent() -> bool {
    QUEUES.to_host.is_empty() && USART2_SR.read() & SENT != 0
}

/// Changes the rate as soon as all that was to be sent has left the port, and returns whether it has.
pub fn change_rate(clocks: &Clocks, baud: u32) -> bool {
    // With interrupts held back the handler does not send meanwhile.
    free(|_| {
        let done = QUEUES.to_host.is_empty() && USART2_SR.read() & SENT != 0;
        if done {
            USART2_CR1.write(0);
            run_at(clocks, baud);
        }
        done
    })
}

fn run_at(clocks: &Clocks, baud: u32) {
    let divider = (clocks.usart_hz + baud / 2) / baud.max(1);
    let eight = divider < 16;
    // In sixteenths; in eighths the last place of the fraction is left out.
    USART2_BRR.write(if eight { (divider & !7) << 1 | divider & 7 } else { divider });
    USART2_CR1.write(ON | RECEIVE_INTERRUPT | if eight { EIGHT } else { 0 });
}

/// Takes bytes from the host into `buffer` and returns how many there were.
pub fn receive(buffer: &mut [u8]) -> usize {
    let count = QUEUES.receive(buffer);
    if count > 0 {
        // The interrupt goes silent when the queue is full; with room again, let it look once more.
        pend(lines::USART2);
    }
    count
}

/// Has what is queued for the host sent.
pub fn send() {
    // The interrupt handler is the only one to take bytes out.
    pend(lines::USART2);
}

/// Handles the port's interrupt: takes bytes that have come and sends those that can be sent. A full queue
/// leaves a byte where it is; the next one overruns it, which is counted, and the host repeats a command that
/// is not answered.
pub fn on_interrupt() {
    let mut listen = true;
    loop {
        let state = USART2_SR.read();
        if state & (RECEIVED | OVERRUN) == 0 {
            break;
        }
        if QUEUES.from_host.room() == 0 {
            listen = false;
            break;
        }
        if state & OVERRUN != 0 {
            QUEUES.overrun();
        }
        // The data are the lower eight bits; reading them after the state clears an overrun, too.
        let byte = USART2_DR.read() as u8;
        if state & RECEIVED != 0 {
            QUEUES.from_host.push(byte);
        }
    }
    while USART2_SR.read() & CAN_SEND != 0 {
        let Some(byte) = QUEUES.to_host.pop() else { break };
        USART2_DR.write(u32::from(byte));
    }
    let receive = if listen { RECEIVE_INTERRUPT } else { 0 };
    let send = if QUEUES.to_host.is_empty() { 0 } else { SEND_INTERRUPT };
    USART2_CR1.change(RECEIVE_INTERRUPT | SEND_INTERRUPT, receive | send);
}
