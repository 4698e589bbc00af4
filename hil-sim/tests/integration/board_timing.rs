//! No sample is lost while a board estimates: the firmware's drivers and its interrupts' side against the
//! register models, with the times of a board.
//!
//! Both sensors signal every millisecond. The converter holds two conversions; the model holds one, so that
//! the second is here. A transfer takes 30 µs on a bus of 10.5 MHz. The main loop stands still for 6 ms four
//! times a second: an estimate in one go on a Cortex-M4F at 168 MHz takes 3 to 6 ms.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use rigident_firmware::Sensor;
use rigident_firmware::capture::{Answering, Capture, Captured, Lost, Order, Place, Ring, Samples};
use rigident_firmware::drivers::ads131m08::{AdcConfig, Ads131m08};
use rigident_firmware::drivers::imu::Imu;
use rigident_sim::devices;

const US: u64 = 1_000;
const MS: u64 = 1_000 * US;
const PERIOD: u64 = MS;
/// The IMU's edges lie this much later.
const IMU_LATER: u64 = 300 * US;
const TRANSFER: u64 = 30 * US;
const HANDLING: u64 = 40 * US;
const ESTIMATE: u64 = 6 * MS;
const ESTIMATES_EVERY: u64 = 250 * MS;
const END: u64 = 20_000 * MS;
/// The smallest steps of both sensors, so that numbers come back exactly.
const STEP_V: f64 = 1.2 / 64.0 / 8_388_608.0;

/// The chips on the bus. Conversion and packet k carry k.
struct Chips {
    converter: devices::Ads131m08,
    held: VecDeque<u32>,
    /// Conversions that nobody read in time.
    dropped: u32,
    imu: devices::Icm42688,
}

impl Chips {
    fn convert(&mut self, number: u32) {
        if self.held.len() == 2 {
            self.held.pop_front();
            self.dropped += 1;
        }
        self.held.push_back(number);
    }

    fn transfer(&mut self, sensor: Sensor, bytes: &mut [u8]) {
        if sensor == Sensor::LoadCell {
            if let Some(number) = self.held.pop_front() {
                self.converter.convert(&[f64::from(number) * STEP_V; 8]);
            }
            self.converter.transfer(bytes);
        } else {
            self.imu.transfer(bytes);
        }
    }
}

type Shared = Rc<RefCell<Chips>>;

struct Wire(Shared, Sensor);

impl ErrorType for Wire {
    type Error = Infallible;
}

impl SpiDevice for Wire {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        match operations {
            [Operation::TransferInPlace(bytes)] => self.0.borrow_mut().transfer(self.1, bytes),
            [Operation::Write(bytes)] => self.0.borrow_mut().transfer(self.1, &mut bytes.to_vec()),
            _ => panic!("not one transfer"),
        }
        Ok(())
    }
}

struct NoWait;

impl DelayNs for NoWait {
    fn delay_ns(&mut self, _: u32) {}
}

fn chips() -> Shared {
    let (converter, imu) = (devices::Ads131m08::new(), devices::Icm42688::new());
    Rc::new(RefCell::new(Chips { converter, held: VecDeque::new(), dropped: 0, imu }))
}

const CONFIG: AdcConfig = AdcConfig { rate_hz: 1000, gain: 64 };

/// The fate of edges while the main loop is elsewhere.
struct Interrupts<'a> {
    chips: Shared,
    capture: Capture<'a>,
    transfer: Option<(u64, Order)>,
    next_edges: [u64; 2],
    signalled: [u32; 2],
}

impl Interrupts<'_> {
    fn begin(&mut self, now: u64, order: Option<Order>) {
        if let Some(order) = order {
            assert!(self.transfer.replace((now + TRANSFER, order)).is_none(), "one transfer at a time");
        }
    }

    /// Runs everything up to this time, in its order.
    fn run_until(&mut self, until: u64) {
        loop {
            let ended = self.transfer.map_or(u64::MAX, |(at, _)| at);
            let [load_cell, imu] = self.next_edges;
            let now = ended.min(load_cell).min(imu);
            if now > until {
                return;
            }
            let order = if now == ended {
                let (_, order) = self.transfer.take().unwrap();
                let mut bytes = order.request.to_vec();
                self.chips.borrow_mut().transfer(order.sensor, &mut bytes);
                self.capture.on_read(&bytes)
            } else if now == load_cell {
                self.signalled[0] += 1;
                self.chips.borrow_mut().convert(self.signalled[0]);
                self.next_edges[0] += PERIOD;
                self.capture.on_edge(Sensor::LoadCell, ticks(now), false)
            } else {
                self.signalled[1] += 1;
                let force = f64::from(self.signalled[1] % 100) * 0.5;
                self.chips.borrow_mut().imu.sample(now, [force, 0.0, 0.0], [0.0; 3], 25.0);
                self.next_edges[1] += PERIOD;
                self.capture.on_edge(Sensor::Imu, ticks(now), false)
            };
            self.begin(now, order);
        }
    }
}

fn ticks(time_ns: u64) -> u32 {
    (time_ns / 250) as u32
}

/// Returns, for each sensor, the samples signalled, and those lost by the count. Every sample that comes must
/// have its own time.
fn with_the_ring(estimate: u64) -> ([u32; 2], [u32; 2]) {
    let chips = chips();
    let place = Place::new(None);
    let device = |sensor| Answering::new(Wire(Rc::clone(&chips), sensor), sensor, &place);
    let (mut adc, mut imu) = (Ads131m08::new(device(Sensor::LoadCell)), Imu::new(device(Sensor::Imu)));
    adc.bring_up(&mut NoWait, &CONFIG).unwrap();
    imu.bring_up(&mut NoWait, 1000).unwrap();
    let (mut ring, lost) = (Ring::new(), Lost::new());
    let (filled, taken) = ring.split();
    let (capture, mut samples) = (Capture::new(filled, &lost), Samples::new(taken, &lost));
    let next_edges = [PERIOD, PERIOD + IMU_LATER];
    let mut interrupts =
        Interrupts { chips: Rc::clone(&chips), capture, transfer: None, next_edges, signalled: [0; 2] };
    let order = interrupts.capture.listen([true, true, false]);
    interrupts.begin(0, order);
    let (mut now, mut next_estimate, mut came) = (0, ESTIMATES_EVERY, [0_u32; 2]);
    let mut counted = [0; 2];
    while now < END {
        interrupts.run_until(now);
        if now >= next_estimate {
            next_estimate += ESTIMATES_EVERY;
            now += estimate;
        } else if let Some(sample) = samples.take() {
            take(sample, &place, &mut adc, &mut imu, &mut came);
            now += HANDLING;
        } else {
            now += 10 * US;
        }
        for ((_, new), sum) in samples.newly_lost().into_iter().zip(&mut counted) {
            *sum += new;
        }
    }
    interrupts.run_until(now);
    while let Some(sample) = samples.take() {
        take(sample, &place, &mut adc, &mut imu, &mut came);
    }
    for ((_, new), sum) in samples.newly_lost().into_iter().zip(&mut counted) {
        *sum += new;
    }
    // A last one of each may still be on its way.
    let missing = [0, 1].map(|k| interrupts.signalled[k] - came[k] - counted[k]);
    assert!(missing.iter().all(|m| *m <= 1), "{missing:?} neither came nor were counted");
    assert_eq!(chips.borrow().dropped, 0);
    (interrupts.signalled, counted)
}

type Device<'a> = Answering<'a, Wire>;

fn take(
    sample: Captured,
    place: &Place,
    adc: &mut Ads131m08<Device>,
    imu: &mut Imu<Device>,
    came: &mut [u32; 2],
) {
    place.set(Some(sample));
    if sample.sensor == Sensor::LoadCell {
        let number = adc.read_frame().unwrap().codes[0] as u32;
        assert_eq!(sample.ticks, ticks(u64::from(number) * PERIOD));
        came[0] += 1;
    } else {
        let force = imu.read().unwrap().unwrap().specific_force_mps2[0];
        let number = (u64::from(sample.ticks) * 250 - IMU_LATER) / PERIOD;
        assert!((force - (number % 100) as f32 * 0.5).abs() < 2e-3, "{force} of packet {number}");
        came[1] += 1;
    }
    assert!(place.get().is_none(), "the driver asks for a sample in another way than the interrupts");
}

#[test]
fn with_the_ring_no_sample_is_lost_while_the_board_estimates() {
    let (signalled, lost) = with_the_ring(ESTIMATE);
    // The IMU's last edge lies behind the end.
    assert_eq!((signalled, lost), ([20_000, 19_999], [0, 0]));
}

/// A main loop that stands still for longer than the ring has room loses samples. Each is counted, and those
/// that arrive have their own times.
#[test]
fn samples_without_room_in_the_ring_are_counted_exactly() {
    let (signalled, lost) = with_the_ring(90 * MS);
    // Of 180 samples in 90 ms 143 find room, four times a second.
    let expected = (180 - 143) * (END / ESTIMATES_EVERY) as u32;
    let sum = lost[0] + lost[1];
    assert!(sum.abs_diff(expected) <= 4 * (END / ESTIMATES_EVERY) as u32 / 2, "{lost:?} of {signalled:?}");
    assert!(lost[0] > 0 && lost[1] > 0);
}

/// The way without a ring: edges are counted, the main loop reads what the converter still holds.
#[test]
fn without_the_ring_samples_are_lost_and_the_count_is_exact() {
    let chips = chips();
    let mut adc = Ads131m08::new(Wire(Rc::clone(&chips), Sensor::LoadCell));
    adc.bring_up(&mut NoWait, &CONFIG).unwrap();
    let (mut now, mut next_edge, mut next_estimate) = (0, PERIOD, ESTIMATES_EVERY);
    let (mut signalled, mut pending, mut lost, mut came) = (0_u32, 0_u32, 0, Vec::new());
    while now < END {
        while next_edge <= now {
            signalled += 1;
            pending += 1;
            chips.borrow_mut().convert(signalled);
            next_edge += PERIOD;
        }
        if now >= next_estimate {
            next_estimate += ESTIMATES_EVERY;
            now += ESTIMATE;
            continue;
        }
        let reads = pending.min(2);
        lost += pending - reads;
        pending = 0;
        for _ in 0..reads {
            came.push(adc.read_frame().unwrap().codes[0] as u32);
            now += TRANSFER + HANDLING;
        }
        now += 10 * US;
    }
    assert_eq!(lost, chips.borrow().dropped);
    assert_eq!(came.len() as u32 + lost, signalled);
    assert!(came.is_sorted_by(|a, b| a < b));
    // Each estimate begins at an edge and ends at one, six periods later: of seven conversions two are left.
    let estimates = (END / ESTIMATES_EVERY - 1) as u32;
    assert_eq!(lost, (ESTIMATE / PERIOD + 1 - 2) as u32 * estimates);
}
