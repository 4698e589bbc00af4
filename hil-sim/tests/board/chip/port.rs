//! USART2 and the line to the host: RM0090, section 30.

use std::collections::VecDeque;

use super::{Machine, PS};

const RXNE: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TXE: u32 = 1 << 7;
const ORE: u32 = 1 << 3;
const FE: u32 = 1 << 1;
/// Bits of a byte on the line: start, eight, stop.
const BITS: f64 = 10.0;
/// Rates that differ by more than this are no longer understood (table 143, 3.3 % less what the host is off).
const TOLERANCE: f64 = 0.03;

pub struct Port {
    control: u32,
    divider: u32,
    received: Option<u8>,
    overrun: bool,
    framing: bool,
    seen: bool,
    waits: Option<u8>,
    sends: Option<(u8, u64)>,
    /// Bytes on their way from the host, and when the first of them is in.
    from_host: VecDeque<u8>,
    next_byte: Option<u64>,
    /// Bytes that have come out.
    pub to_host: Vec<u8>,
    /// Rate of the host's adapter, baud.
    pub host_baud: f64,
    /// One byte in this many of those from the host is another; noise makes bytes, so often, ps: from when to
    /// when.
    pub noise: Option<(u64, u64, u64)>,
    next_noise: Option<u64>,
    pub overruns: u64,
}

impl Default for Port {
    fn default() -> Self {
        Self {
            control: 0,
            divider: 0,
            received: None,
            overrun: false,
            framing: false,
            seen: false,
            waits: None,
            sends: None,
            from_host: VecDeque::new(),
            next_byte: None,
            to_host: Vec::new(),
            host_baud: 921_600.0,
            noise: None,
            next_noise: None,
            overruns: 0,
        }
    }
}

impl Port {
    pub(super) fn reset(&mut self) {
        (self.control, self.divider, self.received, self.waits, self.sends) = (0, 0, None, None, None);
        (self.overrun, self.framing, self.seen) = (false, false, false);
    }

    fn status(&self) -> u32 {
        (u32::from(self.received.is_some()) * RXNE)
            | (u32::from(self.waits.is_none()) * TXE)
            | (u32::from(self.waits.is_none() && self.sends.is_none()) * TC)
            | (u32::from(self.overrun) * ORE)
            | (u32::from(self.framing) * FE)
    }

    pub(super) fn waits(&self) -> bool {
        let status = self.status();
        let asks = |bit: u32, flags: u32| self.control & bit != 0 && status & flags != 0;
        asks(1 << 5, RXNE | ORE) || asks(1 << 7, TXE) || asks(1 << 6, TC)
    }

    pub(super) fn next(&self) -> Option<u64> {
        [self.sends.map(|(_, at)| at), self.next_byte, self.next_noise].into_iter().flatten().min()
    }
}

impl Machine {
    fn baud(&self) -> f64 {
        let hz = self.clocks.apb1_hz();
        let (mantissa, fraction) = (f64::from(self.port.divider >> 4), f64::from(self.port.divider & 0xf));
        if self.port.control & 1 << 15 != 0 {
            hz / (8.0 * (mantissa + fraction / 8.0).max(0.125))
        } else {
            hz / (16.0 * (mantissa + fraction / 16.0).max(0.0625))
        }
    }

    /// Returns true if host and chip have nearly the same rate.
    pub fn understands(&self) -> bool {
        (self.baud() / self.port.host_baud - 1.0).abs() < TOLERANCE
    }

    /// Sends from the host.
    pub fn host_sends(&mut self, bytes: &[u8]) {
        self.port.from_host.extend(bytes);
        if self.port.next_byte.is_none() {
            self.port.next_byte = Some(self.now + self.host_byte());
        }
    }

    /// Returns the number of bytes that the host has still to send.
    pub fn host_backlog(&self) -> usize {
        self.port.from_host.len()
    }

    /// Lets noise on the line from the host begin and end, a byte of it every so often, ps.
    pub fn add_noise(&mut self, from: u64, to: u64, every: u64) {
        self.port.noise = Some((from, to, every));
        self.port.next_noise = Some(from);
    }

    fn host_byte(&self) -> u64 {
        (BITS / self.port.host_baud * PS as f64) as u64
    }

    pub(super) fn look_at_line(&mut self) {
        if let Some((byte, _)) = self.port.sends.filter(|(_, at)| *at <= self.now) {
            let wired = self.pins.is_peripheral(0, 2, 7);
            let byte = if self.understands() { byte } else { self.draw(256) as u8 };
            if wired {
                self.port.to_host.push(byte);
            }
            self.port.sends = None;
            self.begin_sending();
        }
        if self.port.next_byte.is_some_and(|at| at <= self.now) {
            let byte = self.port.from_host.pop_front().unwrap_or_default();
            self.port.next_byte = (!self.port.from_host.is_empty()).then(|| self.now + self.host_byte());
            self.arrives(byte, !self.understands());
        }
        if self.port.next_noise.is_some_and(|at| at <= self.now) {
            let Some((_, to, every)) = self.port.noise else { return };
            let (byte, broken) = (self.draw(256) as u8, self.draw(2) == 0);
            let next = self.now + every / 2 + self.draw(every);
            self.port.next_noise = (next < to).then_some(next);
            self.arrives(byte, broken);
        }
    }

    fn arrives(&mut self, byte: u8, broken: bool) {
        // The receiver is on, and has its clock and its pin.
        let listens = self.port.control & (1 << 13 | 1 << 2) == 1 << 13 | 1 << 2 && self.clocks.feeds(2, 17);
        if !listens || !self.pins.is_peripheral(0, 3, 7) {
            return;
        }
        let byte = if broken { self.draw(256) as u8 } else { byte };
        if self.port.received.is_some() {
            self.port.overrun = true;
            self.port.overruns += 1;
        } else {
            self.port.received = Some(byte);
            self.port.framing = broken;
        }
    }

    fn begin_sending(&mut self) {
        let on = self.port.control & (1 << 13 | 1 << 3) == 1 << 13 | 1 << 3;
        if let (true, None, Some(byte)) = (on, self.port.sends, self.port.waits) {
            self.port.waits = None;
            let time = (BITS / self.baud() * PS as f64) as u64;
            self.port.sends = Some((byte, self.now + time));
        }
    }

    pub(super) fn read_port(&mut self, offset: usize) -> u32 {
        if !self.clocks.feeds(2, 17) {
            return 0;
        }
        match offset {
            0x00 => {
                self.port.seen = true;
                self.port.status()
            }
            0x04 => {
                // Clears the errors that the state had shown.
                if std::mem::take(&mut self.port.seen) {
                    (self.port.overrun, self.port.framing) = (false, false);
                }
                u32::from(self.port.received.take().unwrap_or_default())
            }
            0x08 => self.port.divider,
            0x0c => self.port.control,
            _ => 0,
        }
    }

    pub(super) fn write_port(&mut self, offset: usize, value: u32) {
        if !self.clocks.feeds(2, 17) {
            return self.breach("USART2 is written without its clock");
        }
        match offset {
            0x04 => {
                if self.port.waits.replace(value as u8).is_some() {
                    self.breach("a byte to the host is written over another");
                }
                self.begin_sending();
            }
            0x08 => self.port.divider = value,
            0x0c => {
                if self.port.control & 1 << 13 != 0 && value & 1 << 13 == 0 && self.port.sends.is_some() {
                    self.breach("USART2 is switched off within a byte");
                    self.port.sends = None;
                }
                self.port.control = value;
                self.begin_sending();
            }
            _ => self.breach(format!("USART2 {offset:#x} is written")),
        }
    }
}
