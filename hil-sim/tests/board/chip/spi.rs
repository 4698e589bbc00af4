//! SPI1 and streams 0 and 3 of DMA2: RM0090, sections 28 and 10.

use rigident_sim::devices::Device;

use super::{Machine, PS};

/// A fault on the sensors' bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusFault {
    /// The clock line is held: no bit comes in.
    Clock,
    /// The line from the sensors is held low, or high.
    Data(bool),
    /// One byte in this many has a bit inverted.
    Noise(u64),
}

const RXNE: u32 = 1;
const TXE: u32 = 1 << 1;
const OVR: u32 = 1 << 6;
const BSY: u32 = 1 << 7;
const ENABLED: u32 = 1;
const ENDED: u32 = 1 << 5;
const DIRECT_ERROR: u32 = 1 << 2;
/// SPI1 is channel 3 of both streams (table 43).
const CHANNEL: u32 = 3;

#[derive(Clone, Copy, Default)]
struct Stream {
    control: u32,
    count: u32,
    reload: u32,
    peripheral: usize,
    memory: usize,
    done: u32,
    /// Flags, of this stream alone, as those of stream 0.
    flags: u32,
}

#[derive(Default)]
pub struct Spi {
    control: [u32; 2],
    received: Option<u8>,
    waits: Option<u8>,
    /// A byte on its way, and when its last bit is in.
    shifts: Option<(u8, u64)>,
    overrun: bool,
    read_while_overrun: bool,
    streams: [Stream; 2],
    /// Faults, from when to when, ps.
    pub faults: Vec<(BusFault, u64, u64)>,
}

impl Spi {
    pub(super) fn reset(&mut self) {
        self.reset_port();
        self.reset_dma();
    }

    pub(super) fn reset_port(&mut self) {
        *self = Self { streams: self.streams, faults: std::mem::take(&mut self.faults), ..Self::default() };
    }

    pub(super) fn reset_dma(&mut self) {
        self.streams = Default::default();
    }

    /// Returns true while bits are on their way.
    pub(super) fn is_clocking(&self) -> bool {
        self.shifts.is_some()
    }

    /// Returns true if stream 0 interrupts.
    pub(super) fn waits(&self) -> bool {
        let stream = &self.streams[0];
        let asks = |bit: u32, flag: u32| stream.control >> bit & 1 != 0 && stream.flags & flag != 0;
        asks(4, ENDED) || asks(2, 1 << 3) || asks(1, DIRECT_ERROR) || asks(3, 1 << 4)
    }

    pub(super) fn next(&self) -> Option<u64> {
        self.shifts.map(|(_, at)| at)
    }

    fn status(&self) -> u32 {
        (u32::from(self.received.is_some()) * RXNE)
            | (u32::from(self.waits.is_none()) * TXE)
            | (u32::from(self.overrun) * OVR)
            | (u32::from(self.shifts.is_some() || self.waits.is_some()) * BSY)
    }

    /// Flags of a stream at their places in the register.
    fn places(k: usize) -> u32 {
        if k == 0 { 0 } else { 22 }
    }
}

impl Machine {
    fn bus_fault(&self) -> Option<BusFault> {
        let now = self.now;
        self.spi.faults.iter().find(|(_, from, to)| (*from..*to).contains(&now)).map(|(fault, ..)| *fault)
    }

    fn begin_byte(&mut self) {
        let on = self.spi.control[0] & 1 << 6 != 0;
        if let (true, None, Some(byte)) = (on, self.spi.shifts, self.spi.waits) {
            self.spi.waits = None;
            let divider = f64::from(2_u32 << (self.spi.control[0] >> 3 & 7));
            let time = (8.0 * divider / self.clocks.apb2_hz() * PS as f64) as u64;
            // A clock that is held ends no byte; it goes on when it is let go, if the port is still at it.
            let held = self.bus_fault() == Some(BusFault::Clock);
            let until =
                self.spi.faults.iter().filter(|(f, ..)| *f == BusFault::Clock).map(|(.., to)| *to).max();
            let ends = if held { until.unwrap_or(self.now) + time } else { self.now + time };
            self.spi.shifts = Some((byte, ends));
        }
    }

    /// Ends a byte, and lets the streams serve the port.
    pub(super) fn look_at_transfer(&mut self) {
        if let Some((byte, _)) = self.spi.shifts.filter(|(_, at)| *at <= self.now) {
            self.spi.shifts = None;
            let answer = self.answer(byte);
            if self.spi.received.is_some() {
                self.spi.overrun = true;
            } else {
                self.spi.received = Some(answer);
            }
            self.serve_streams();
            self.begin_byte();
            self.serve_streams();
        }
    }

    fn answer(&mut self, byte: u8) -> u8 {
        let pins = &self.pins;
        let wired = [5, 6, 7].iter().all(|number| pins.is_peripheral(0, *number, 5));
        if !wired {
            self.breach("bits move while the bus has no pins");
            return 0;
        }
        let Some(device) = self.selected() else { return 0 };
        // The converter's bits are taken at the second edge, the IMU's at the first.
        let second_edge = self.spi.control[0] & 1 != 0;
        let answer = self.rig.exchange(device, byte);
        let answer = match (device, second_edge) {
            (Device::LoadCell, true) | (Device::Imu | Device::SecondImu, false) => answer,
            _ => {
                self.breach("a sensor is read at the other edge of its clock");
                answer.rotate_left(1)
            }
        };
        if device == Device::Imu {
            self.look_at_signals();
        }
        match self.bus_fault() {
            Some(BusFault::Data(high)) => u8::from(high) * 0xff,
            Some(BusFault::Noise(in_so_many)) if self.draw(in_so_many) == 0 => {
                let bit = self.draw(8);
                answer ^ 1 << bit
            }
            _ => answer,
        }
    }

    /// Moves what the port asks for by the streams.
    fn serve_streams(&mut self) {
        if !self.clocks.feeds(0, 22) {
            return;
        }
        let [_, control] = self.spi.control;
        for (k, asked, towards) in [
            (0, control & 1 != 0 && self.spi.received.is_some(), 0),
            (1, control & 2 != 0 && self.spi.waits.is_none(), 1),
        ] {
            let stream = &mut self.spi.streams[k];
            let runs = stream.control & ENABLED != 0
                && stream.control >> 25 & 7 == CHANNEL
                && stream.control >> 6 & 3 == towards
                && stream.peripheral == 0x4001_300c;
            if !asked || !runs || stream.count == 0 {
                continue;
            }
            let steps = if stream.control & 1 << 10 != 0 { stream.done as usize } else { 0 };
            let place = (stream.memory + steps) as *mut u8;
            (stream.count, stream.done) = (stream.count - 1, stream.done + 1);
            // SAFETY: the driver has named statics of at least as many bytes, of atomics; the model runs in
            // the one thread that looks at them.
            unsafe {
                if k == 0 {
                    place.write_volatile(self.spi.received.take().unwrap_or_default());
                } else {
                    self.spi.waits = Some(place.read_volatile());
                }
            }
            let stream = &mut self.spi.streams[k];
            if stream.count == 0 {
                stream.flags |= ENDED;
                stream.control &= !ENABLED;
            }
        }
        self.begin_byte();
    }

    pub(super) fn read_spi(&mut self, offset: usize) -> u32 {
        if !self.clocks.feeds(3, 12) {
            return 0;
        }
        match offset {
            0x00 | 0x04 => self.spi.control[offset / 4],
            0x08 => {
                // A read of the data, then one of the state, clears an overrun.
                let status = self.spi.status();
                if std::mem::take(&mut self.spi.read_while_overrun) {
                    self.spi.overrun = false;
                }
                status
            }
            0x0c => {
                self.spi.read_while_overrun = self.spi.overrun;
                u32::from(self.spi.received.take().unwrap_or_default())
            }
            _ => 0,
        }
    }

    pub(super) fn write_spi(&mut self, offset: usize, value: u32) {
        if !self.clocks.feeds(3, 12) {
            return self.breach("SPI1 is written without its clock");
        }
        match offset {
            0x00 => {
                let before = self.spi.control[0];
                if before & value & 1 << 6 != 0 && (before ^ value) & 0x3b != 0 {
                    self.breach("SPI1 is changed while it is on");
                }
                if before & 1 << 6 != 0 && value & 1 << 6 == 0 && self.spi.is_clocking() {
                    // Section 28.3.8: not before the last bit. The byte is lost, and the sensor has half of
                    // it.
                    self.breach("SPI1 is switched off within a byte");
                    self.spi.shifts = None;
                }
                self.spi.control[0] = value;
                self.begin_byte();
            }
            0x04 => {
                self.spi.control[1] = value;
                self.serve_streams();
            }
            0x0c => {
                self.spi.waits = Some(value as u8);
                self.begin_byte();
            }
            _ => self.breach(format!("SPI1 {offset:#x} is written")),
        }
    }

    pub(super) fn read_dma(&mut self, offset: usize) -> u32 {
        match offset {
            0x00 => (0..2).fold(0, |all, k| all | self.spi.streams[k].flags << Spi::places(k)),
            0x10..=0x27 | 0x58..=0x6f => {
                let (k, offset) = if offset < 0x28 { (0, offset - 0x10) } else { (1, offset - 0x58) };
                let stream = &self.spi.streams[k];
                match offset {
                    0x00 => stream.control,
                    0x04 => stream.count,
                    0x14 => 0x21,
                    _ => 0,
                }
            }
            _ => 0,
        }
    }

    pub(super) fn write_dma(&mut self, offset: usize, value: u32) {
        if !self.clocks.feeds(0, 22) {
            return self.breach("DMA2 is written without its clock");
        }
        match offset {
            0x08 => {
                for (k, stream) in self.spi.streams.iter_mut().enumerate() {
                    stream.flags &= !(value >> Spi::places(k));
                }
            }
            0x10..=0x27 | 0x58..=0x6f => {
                let (k, offset) = if offset < 0x28 { (0, offset - 0x10) } else { (1, offset - 0x58) };
                self.write_stream(k, offset, value);
            }
            _ => self.breach(format!("DMA2 {offset:#x} is written")),
        }
    }

    fn write_stream(&mut self, k: usize, offset: usize, value: u32) {
        let stream = &mut self.spi.streams[k];
        let runs = stream.control & ENABLED != 0;
        match offset {
            0x00 if runs && value & ENABLED != 0 && value != stream.control => {
                self.breach("a stream is changed while it runs");
            }
            0x00 => {
                let begins = !runs && value & ENABLED != 0;
                let stops = runs && value & ENABLED == 0;
                stream.control = value;
                if begins {
                    let flags = stream.flags;
                    (stream.count, stream.done) = (stream.reload, 0);
                    if flags != 0 {
                        // Section 10.3.17: all flags of the stream are to be cleared first.
                        self.breach("a stream is begun with flags of the last transfer");
                    }
                    self.serve_streams();
                } else if stops {
                    // Section 10.3.14: the end of a stream that was stopped is reported, too.
                    stream.flags |= ENDED;
                }
            }
            0x04 => {
                if runs {
                    self.breach("a stream is changed while it runs");
                } else {
                    (stream.count, stream.reload) = (value & 0xffff, value & 0xffff);
                }
            }
            0x14 => {}
            _ => self.breach("a stream's address is written as a number"),
        }
    }

    pub(super) fn name_memory(&mut self, register: usize, memory: usize) {
        let Some((k, offset)) = (match register.wrapping_sub(0x4002_6400) {
            offset @ (0x18 | 0x1c) => Some((0, offset - 0x10)),
            offset @ (0x60 | 0x64) => Some((1, offset - 0x58)),
            _ => None,
        }) else {
            return self.breach(format!("memory is named to {register:#x}"));
        };
        let stream = &mut self.spi.streams[k];
        if stream.control & ENABLED != 0 {
            return self.breach("a stream is changed while it runs");
        }
        if offset == 0x08 { stream.peripheral = memory } else { stream.memory = memory }
    }
}
