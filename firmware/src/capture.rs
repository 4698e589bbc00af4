//! Samples that a board's interrupts read while the application works.
//!
//! The converter holds two conversions, an estimate takes longer. So a data-ready edge is served at once: the
//! interrupt has the bus clock the sample out ([`Capture`]) into a ring, with the time that a timer latched
//! at the edge, and the drivers find it there ([`Answering`]) whenever the application comes to it. A sample
//! that is not stored is counted ([`Lost`]). Nothing here knows registers: a board and the simulator run the
//! same code.
//!
//! ```text
//! edge ─▶ Capture::on_edge ─▶ Order ─▶ transfer ─▶ Capture::on_read ─▶ ring ─▶ Answering ─▶ driver
//! ```

use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};

use embedded_hal::spi::{Error, ErrorKind, ErrorType, Operation, SpiDevice};
use heapless::spsc::{Consumer, Producer, Queue};

use crate::app::Sensor;
use crate::drivers::{ads131m08, imu};

/// Bytes of the longest transfer that reads a sample.
pub const MAX_CAPTURED: usize = ads131m08::FRAME;
/// Sensors that signal samples by edges: load cell, IMU, second IMU.
const EDGES: usize = 3;
/// Samples that the ring holds, less one. The main loop is away for longest while a checkpoint is written:
/// [`LONGEST_AWAY_NS`], in which each sensor signals a sample every [`SHORTEST_PERIOD_NS`]. A test derives
/// it.
const ROOM: usize = 144;
/// The flash takes 100 µs a word at most (data sheet of the STM32F405, table of its flash), and interrupts
/// come between words.
const WORD_NS: u64 = 100_000;
/// Words of the longest record that is stored.
const RECORD_WORDS: u64 = 1792 / 4;
/// The longest that a main loop does not come round, ns.
pub const LONGEST_AWAY_NS: u64 = WORD_NS * RECORD_WORDS;
/// The least time between the samples that each of the sensors signals, ns: 1 kHz.
pub const SHORTEST_PERIOD_NS: u64 = 1_000_000;
/// Polls, of one millisecond each, that a transfer may take: two of them whole. It takes 30 µs.
const TRANSFER_LOOKS: u8 = 3;
/// Conversions that the converter may hold from before.
const STALE_CONVERSIONS: u8 = 2;

/// A sample as it arrived over the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Captured {
    /// Tells which sensor.
    pub sensor: Sensor,
    /// The timer's count that was latched at the edge.
    pub ticks: u32,
    /// The bytes received; only as many bytes as were ordered.
    pub bytes: [u8; MAX_CAPTURED],
}

/// The ring between the interrupts and the application.
pub type Ring = Queue<Captured, ROOM>;

/// Samples that were signalled and are lost, of load cell, IMU and second IMU. They only grow, and wrap.
#[derive(Debug, Default)]
pub struct Lost([AtomicU32; EDGES]);

impl Lost {
    /// Returns the count of none.
    #[must_use]
    pub const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; EDGES])
    }

    /// Returns how many there are.
    pub fn counts(&self) -> [u32; EDGES] {
        core::array::from_fn(|k| self.0.get(k).map_or(0, |count| count.load(Ordering::Relaxed)))
    }

    fn add(&self, sensor: Sensor, count: u32) {
        if let Some(slot) = self.0.get(sensor as usize) {
            // One side alone writes, and not every core has an atomic sum.
            slot.store(slot.load(Ordering::Relaxed).wrapping_add(count), Ordering::Relaxed);
        }
    }
}

/// The bytes to be clocked out of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Order {
    /// Tells which sensor is to be selected.
    pub sensor: Sensor,
    /// The bytes to be sent.
    pub request: &'static [u8],
}

/// Returns what reads a sample of a sensor: the bytes that its driver sends for it.
fn request(sensor: Sensor) -> &'static [u8] {
    match sensor {
        Sensor::LoadCell => &ads131m08::READ,
        _ => &imu::READ,
    }
}

/// Counts transfers that brought nothing: those that did not end in time, and those that ended with an error.
/// They only grow, and wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Failures {
    /// Given up because they did not end.
    pub overdue: u32,
    /// Ended with an error of the bus.
    pub failed: u32,
}

/// Reads that empty a sensor of what it holds. An IMU's signal stays until it is read once.
fn stale(sensor: Sensor) -> u8 {
    if sensor == Sensor::LoadCell { STALE_CONVERSIONS } else { 1 }
}

/// An edge that waits, or is served.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Edge {
    /// The timer's count.
    ticks: u32,
    /// Edges since the sensor was served, of which this is the last.
    count: u8,
}

/// Tells what is to be done of one sensor.
#[derive(Clone, Copy, Default)]
struct Line {
    /// An edge waits, latched at this count.
    edge: Option<Edge>,
    /// The number of reads to be discarded first: what they bring is older than any edge that is known.
    stale: u8,
}

/// Returns whether the sample that was read after `again` others belongs to the edge. One edge is the first
/// sample's: a signal that stays up makes none for those that follow. Of several edges the last one is the
/// last sample's, if there are as many.
fn is_dated(edge: Edge, again: u8, more: bool) -> bool {
    if edge.count <= 1 { again == 0 } else { !more && (again == 0 || again + 1 == edge.count) }
}

/// Tells what the bus does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Bus {
    Free,
    /// The application has it.
    Held,
    /// A sample is read: of which edge, and how often it was read again. Without an edge it is thrown away.
    Reads {
        sensor: Sensor,
        edge: Option<Edge>,
        again: u8,
    },
}

/// The interrupts' side: serves edges one after the other, the oldest sensor first.
///
/// Every method must be called with the interrupts held back that call the others.
pub struct Capture<'a> {
    ring: Producer<'a, Captured>,
    lost: &'a Lost,
    lines: [Line; EDGES],
    bus: Bus,
    listening: [bool; EDGES],
    /// Checks the transfer on its way.
    looks: u8,
    /// The last transfer failed: the next one waits for a check, so that a bus that is broken takes no more
    /// than that.
    pauses: bool,
    failures: Failures,
}

impl<'a> Capture<'a> {
    /// Returns a side that serves no edge yet: see [`Self::listen`].
    pub fn new(ring: Producer<'a, Captured>, lost: &'a Lost) -> Self {
        Self {
            ring,
            lost,
            lines: [Line::default(); EDGES],
            bus: Bus::Free,
            listening: [false; EDGES],
            looks: 0,
            pauses: false,
            failures: Failures::default(),
        }
    }

    /// Returns how many transfers have failed.
    pub const fn failures(&self) -> Failures {
        self.failures
    }

    /// Looks at the transfer on its way, and is to be called every millisecond. Returns true if it is
    /// overdue: the board is to stop it and to reset its bus, and then to call [`Self::on_overdue`].
    #[must_use]
    pub fn on_look(&mut self) -> bool {
        if !matches!(self.bus, Bus::Reads { .. }) {
            return false;
        }
        self.looks = self.looks.saturating_add(1);
        self.looks >= TRANSFER_LOOKS
    }

    /// Goes on after a pause; to be called every millisecond, too.
    pub fn after_look(&mut self) -> Option<Order> {
        self.pauses = false;
        self.next()
    }

    /// Notes that the transfer on its way was stopped.
    pub fn on_overdue(&mut self) -> Option<Order> {
        self.failures.overdue = self.failures.overdue.wrapping_add(1);
        self.give_up();
        None
    }

    /// Serves edges of these sensors from now on, and of no other. What they hold from before is thrown away,
    /// by the order that is returned and those that follow.
    pub fn listen(&mut self, sensors: [bool; EDGES]) -> Option<Order> {
        let ways = self.lines.iter_mut().zip(&mut self.listening).zip(sensors).enumerate();
        for (k, ((line, listening), wanted)) in ways {
            if wanted && !*listening {
                let sensor = if k == Sensor::LoadCell as usize { Sensor::LoadCell } else { Sensor::Imu };
                *line = Line { edge: None, stale: stale(sensor) };
            } else if !wanted {
                *line = Line::default();
            }
            *listening = wanted;
        }
        self.next()
    }

    /// Takes a data-ready edge that was latched at this count. `missed`: the timer says that it was not the
    /// only one.
    pub fn on_edge(&mut self, sensor: Sensor, ticks: u32, missed: bool) -> Option<Order> {
        let k = sensor as usize;
        let (true, Some(line)) = (self.listening.get(k).is_some_and(|l| *l), self.lines.get_mut(k)) else {
            return None;
        };
        // Of an IMU its FIFO tells, when it is read.
        if sensor == Sensor::LoadCell && (missed || line.edge.is_some()) {
            // The older conversion waits in the converter, and its time is not known.
            self.lost.add(sensor, 1);
            line.stale = line.stale.max(STALE_CONVERSIONS - 1);
        }
        let before = line.edge.map_or(0, |edge| edge.count);
        line.edge = Some(Edge { ticks, count: before.saturating_add(1 + u8::from(missed)) });
        self.next()
    }

    /// Takes what an order brought.
    pub fn on_read(&mut self, bytes: &[u8]) -> Option<Order> {
        let Bus::Reads { sensor, edge, again } = self.bus else { return None };
        self.bus = Bus::Free;
        let more = sensor != Sensor::LoadCell && imu::holds_more(bytes) && again < imu::FIFO_PACKETS;
        if let Some(edge) = edge {
            if is_dated(edge, again, more) {
                self.keep(sensor, edge.ticks, bytes);
            } else {
                self.lost.add(sensor, 1);
            }
        }
        if more {
            return Some(self.read(sensor, edge, again + 1));
        }
        self.next()
    }

    fn keep(&mut self, sensor: Sensor, ticks: u32, bytes: &[u8]) {
        let mut captured = Captured { sensor, ticks, bytes: [0; MAX_CAPTURED] };
        captured.bytes.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        if sensor != Sensor::LoadCell {
            imu::holds_one(&mut captured.bytes);
        }
        if self.ring.enqueue(captured).is_err() {
            self.lost.add(sensor, 1);
        }
    }

    /// Notes that a transfer failed: its sample is lost.
    pub fn on_failed(&mut self) -> Option<Order> {
        self.failures.failed = self.failures.failed.wrapping_add(1);
        self.give_up();
        None
    }

    /// Loses the sample on its way, and whatever the sensor holds: what comes next would be dated by
    /// another's edge, and an IMU that is not read holds its signal up for ever.
    fn give_up(&mut self) {
        let Bus::Reads { sensor, edge, .. } = self.bus else { return };
        self.bus = Bus::Free;
        self.pauses = true;
        let Some(line) = self.lines.get_mut(sensor as usize) else { return };
        let waiting = line.edge.take();
        line.stale = stale(sensor);
        self.lost.add(sensor, u32::from(edge.is_some()) + u32::from(waiting.is_some()));
    }

    /// Gives the bus to the application, unless a sample is being read. Edges wait meanwhile.
    pub fn hold(&mut self) -> bool {
        let free = !matches!(self.bus, Bus::Reads { .. });
        if free {
            self.bus = Bus::Held;
        }
        free
    }

    /// Takes the bus back.
    pub fn release(&mut self) -> Option<Order> {
        if self.bus == Bus::Held {
            self.bus = Bus::Free;
        }
        self.next()
    }

    fn next(&mut self) -> Option<Order> {
        if self.bus != Bus::Free || self.pauses {
            return None;
        }
        for sensor in [Sensor::LoadCell, Sensor::Imu, Sensor::SecondImu] {
            let Some(line) = self.lines.get_mut(sensor as usize) else { continue };
            if line.stale > 0 {
                line.stale -= 1;
                return Some(self.read(sensor, None, 0));
            }
            if let Some(edge) = line.edge.take() {
                return Some(self.read(sensor, Some(edge), 0));
            }
        }
        None
    }

    fn read(&mut self, sensor: Sensor, edge: Option<Edge>, again: u8) -> Order {
        self.bus = Bus::Reads { sensor, edge, again };
        self.looks = 0;
        Order { sensor, request: request(sensor) }
    }
}

/// The application's side: the ring's other end, and what a driver is to find.
pub struct Samples<'a> {
    ring: Consumer<'a, Captured>,
    lost: &'a Lost,
    reported: [u32; EDGES],
}

impl<'a> Samples<'a> {
    /// Returns the other end of this ring, with this count.
    pub fn new(ring: Consumer<'a, Captured>, lost: &'a Lost) -> Self {
        Self { ring, reported: lost.counts(), lost }
    }

    /// Takes the oldest sample out. Put it where [`Answering`] finds it, then tell the application.
    pub fn take(&mut self) -> Option<Captured> {
        self.ring.dequeue()
    }

    /// Forgets what is in the ring, and what was lost until now.
    pub fn clear(&mut self) {
        while self.ring.dequeue().is_some() {}
        self.reported = self.lost.counts();
    }

    /// Returns how many samples of each sensor were lost since this was asked for the last time.
    pub fn newly_lost(&mut self) -> [(Sensor, u32); EDGES] {
        let counts = self.lost.counts();
        let before = core::mem::replace(&mut self.reported, counts);
        let new =
            |k: usize| counts.get(k).zip(before.get(k)).map_or(0, |(now, then)| now.wrapping_sub(*then));
        [(Sensor::LoadCell, new(0)), (Sensor::Imu, new(1)), (Sensor::SecondImu, new(2))]
    }
}

/// The place of the sample that a driver is to find next.
pub type Place = Cell<Option<Captured>>;

/// A sensor as its driver sees it: a request for a sample is answered with the captured one, everything else
/// goes over the bus.
pub struct Answering<'a, S> {
    spi: S,
    sensor: Sensor,
    place: &'a Place,
}

impl<'a, S> Answering<'a, S> {
    /// Returns the sensor over this bus, with captured samples in this place.
    pub const fn new(spi: S, sensor: Sensor, place: &'a Place) -> Self {
        Self { spi, sensor, place }
    }

    /// Answers with the captured sample, if these operations ask for it; returns whether they did.
    fn captured(&self, operations: &mut [Operation<'_, u8>]) -> bool {
        let [Operation::TransferInPlace(bytes)] = operations else { return false };
        if *bytes != request(self.sensor) {
            return false;
        }
        let Some(captured) = self.place.get().filter(|captured| captured.sensor == self.sensor) else {
            return false;
        };
        self.place.set(None);
        bytes.iter_mut().zip(captured.bytes).for_each(|(to, from)| *to = from);
        true
    }
}

impl<S: ErrorType> ErrorType for Answering<'_, S> {
    type Error = ErrorKind;
}

impl<S: SpiDevice> SpiDevice for Answering<'_, S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        if self.captured(operations) {
            return Ok(());
        }
        self.spi.transaction(operations).map_err(|error| error.kind())
    }
}

#[cfg(test)]
#[path = "capture_tests.rs"]
mod tests;
