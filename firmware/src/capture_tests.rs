//! The interrupts' side against a converter that holds two conversions, written for these tests.

extern crate std;

use std::collections::VecDeque;
use std::vec::Vec;

use super::*;

/// A bus with a converter that numbers its conversions, and an IMU that numbers its packets.
#[derive(Default)]
struct Sensors {
    conversions: VecDeque<u8>,
    packets: VecDeque<u8>,
    /// Conversions that the converter has dropped by itself.
    dropped: u32,
}

impl Sensors {
    fn convert(&mut self, number: u8) {
        if self.conversions.len() == 2 {
            self.conversions.pop_front();
            self.dropped += 1;
        }
        self.conversions.push_back(number);
    }

    /// Returns what an order brings. Without a new conversion the last one comes again; an empty FIFO says
    /// so.
    fn serve(&mut self, order: Order) -> Vec<u8> {
        let mut bytes = order.request.to_vec();
        if order.sensor == Sensor::LoadCell {
            bytes[0] = self.conversions.pop_front().unwrap_or(0);
        } else {
            let count = 20 * self.packets.len() as u16;
            bytes[1] = 0;
            bytes[2..4].copy_from_slice(&count.to_be_bytes());
            bytes[4] = self.packets.pop_front().unwrap_or(0x80);
        }
        bytes
    }

    /// Serves orders until there are none.
    fn run(&mut self, capture: &mut Capture, mut order: Option<Order>) {
        while let Some(next) = order {
            let bytes = self.serve(next);
            order = capture.on_read(&bytes);
        }
    }
}

const ALL: [bool; EDGES] = [true; EDGES];
const LOAD_CELL: [bool; EDGES] = [true, false, false];

#[test]
fn the_requests_are_those_of_the_drivers() {
    // The CRC of a NULL command, worked out bit by bit: x¹⁶ + x¹² + x⁵ + 1, seed all ones.
    let crc = [0_u8; 3].iter().flat_map(|byte| (0..8).rev().map(move |bit| byte >> bit & 1)).fold(
        0xffff_u16,
        |crc, bit| {
            let out = crc >> 15 ^ u16::from(bit);
            crc << 1 ^ if out == 1 { 0x1021 } else { 0 }
        },
    );
    let mut expected = [0; MAX_CAPTURED];
    expected[3..5].copy_from_slice(&crc.to_be_bytes());
    assert_eq!(request(Sensor::LoadCell), expected);
    assert_eq!(request(Sensor::Imu).len(), 24);
    assert_eq!(request(Sensor::SecondImu)[0], 0xad);
}

#[test]
fn old_samples_of_a_sensor_are_thrown_away() {
    let (mut ring, lost) = (Ring::new(), Lost::new());
    let (producer, consumer) = ring.split();
    let (mut capture, mut samples) = (Capture::new(producer, &lost), Samples::new(consumer, &lost));
    let mut sensors = Sensors::default();
    for number in 1..=9 {
        sensors.convert(number);
        sensors.packets.push_back(number);
        assert_eq!(capture.on_edge(Sensor::LoadCell, 0, false), None, "nobody listens");
    }
    let order = capture.listen([true, true, false]);
    sensors.run(&mut capture, order);
    assert_eq!((samples.take(), lost.counts()), (None, [0; EDGES]));
    sensors.convert(10);
    sensors.packets.push_back(11);
    for (sensor, ticks) in [(Sensor::LoadCell, 100), (Sensor::Imu, 101)] {
        let order = capture.on_edge(sensor, ticks, false);
        sensors.run(&mut capture, order);
    }
    let first = samples.take().unwrap();
    assert_eq!((first.sensor, first.ticks, first.bytes[0]), (Sensor::LoadCell, 100, 10));
    let second = samples.take().unwrap();
    assert_eq!((second.sensor, second.ticks, second.bytes[4]), (Sensor::Imu, 101, 11));
    assert_eq!(samples.take(), None);
    // Nobody listens any more: an edge does nothing.
    capture.listen([false; EDGES]);
    assert_eq!(capture.on_edge(Sensor::Imu, 102, false), None);
}

#[test]
fn edges_wait_while_the_bus_is_taken_and_keep_their_times() {
    let (mut ring, lost) = (Ring::new(), Lost::new());
    let (producer, consumer) = ring.split();
    let (mut capture, mut samples) = (Capture::new(producer, &lost), Samples::new(consumer, &lost));
    let mut sensors = Sensors::default();
    let order = capture.listen(ALL);
    sensors.run(&mut capture, order);
    assert!(capture.hold());
    sensors.convert(1);
    sensors.packets.push_back(2);
    assert_eq!(capture.on_edge(Sensor::Imu, 7, false), None);
    assert_eq!(capture.on_edge(Sensor::LoadCell, 8, false), None);
    let order = capture.release();
    // A sample is being read: the application has to wait.
    assert!(order.is_some() && !capture.hold());
    sensors.run(&mut capture, order);
    let taken: Vec<_> = core::iter::from_fn(|| samples.take()).map(|c| (c.sensor, c.ticks)).collect();
    assert_eq!(taken, [(Sensor::LoadCell, 8), (Sensor::Imu, 7)]);
}

#[test]
fn lost_samples_are_counted_and_later_ones_have_their_own_times() {
    let (mut ring, lost) = (Ring::new(), Lost::new());
    let (producer, consumer) = ring.split();
    let (mut capture, mut samples) = (Capture::new(producer, &lost), Samples::new(consumer, &lost));
    let mut sensors = Sensors::default();
    let order = capture.listen(LOAD_CELL);
    sensors.run(&mut capture, order);
    // The interrupt was late: two conversions, one latch.
    sensors.convert(1);
    sensors.convert(2);
    let order = capture.on_edge(Sensor::LoadCell, 20, true);
    sensors.run(&mut capture, order);
    let kept = samples.take().unwrap();
    assert_eq!((kept.ticks, kept.bytes[0], lost.counts()), (20, 2, [1, 0, 0]));
    // A transfer failed.
    sensors.convert(3);
    let order = capture.on_edge(Sensor::LoadCell, 30, false).unwrap();
    sensors.serve(order);
    assert_eq!((capture.on_failed(), lost.counts()), (None, [2, 0, 0]));
    let order = capture.after_look();
    sensors.run(&mut capture, order);
    // The application does not come: the ring fills, all others are counted.
    for number in 0..250 {
        sensors.convert(number);
        let order = capture.on_edge(Sensor::LoadCell, u32::from(number), false);
        sensors.run(&mut capture, order);
    }
    let kept: Vec<_> = core::iter::from_fn(|| samples.take()).collect();
    assert!(kept.iter().all(|c| c.ticks == u32::from(c.bytes[0])));
    assert_eq!(kept.len(), ROOM - 1);
    assert_eq!(kept.len() as u32 + lost.counts()[0] - 2, 250);
    assert_eq!(samples.newly_lost()[0], (Sensor::LoadCell, 2 + 250 - kept.len() as u32));
    assert_eq!(samples.newly_lost().map(|(_, count)| count), [0; EDGES]);
}

/// The signal stays up until the FIFO is read, so that the second packet of two makes no edge. With the first
/// one's time it would be a period early.
#[test]
fn of_packets_that_wait_the_one_is_kept_whose_edge_it_was() {
    let (mut ring, lost) = (Ring::new(), Lost::new());
    let (producer, consumer) = ring.split();
    let (mut capture, mut samples) = (Capture::new(producer, &lost), Samples::new(consumer, &lost));
    let mut sensors = Sensors::default();
    let order = capture.listen([false, true, false]);
    sensors.run(&mut capture, order);
    // Edges while the bus is taken, packets, and of which edge which packet comes.
    for (edges, packets, kept, newly_lost) in [
        (&[5][..], &[1, 2, 3][..], Some((5, 1)), 2),
        (&[6], &[4], Some((6, 4)), 0),
        (&[7, 8], &[5, 6], Some((8, 6)), 1),
        (&[9, 10], &[7], Some((10, 7)), 0),
        (&[11, 12], &[8, 9, 10], None, 3),
    ] {
        assert!(capture.hold());
        let before = lost.counts()[1];
        for edge in edges {
            assert_eq!(capture.on_edge(Sensor::Imu, *edge, false), None);
        }
        sensors.packets.extend(packets);
        let order = capture.release();
        sensors.run(&mut capture, order);
        let taken = samples.take();
        assert_eq!(taken.map(|c| (c.ticks, c.bytes[4])), kept, "{edges:?}");
        // The driver is not to search for those that were read here.
        assert!(taken.is_none_or(|c| !imu::holds_more(&c.bytes)));
        assert_eq!((lost.counts()[1] - before, samples.take()), (newly_lost, None), "{edges:?}");
    }
    // A line that is stuck high says that there is always more: it is not believed for ever.
    let mut order = capture.on_edge(Sensor::Imu, 6, false);
    let mut reads = 0;
    while order.is_some() {
        order = capture.on_read(&[0, 0, 0x7f, 0xff, 0, 0]);
        reads += 1;
    }
    assert_eq!(reads, 1 + usize::from(imu::FIFO_PACKETS));
}

/// A DMA that has stopped must not hold the bus for ever.
#[test]
fn a_transfer_that_does_not_end_is_given_up_and_sampling_goes_on() {
    let (mut ring, lost) = (Ring::new(), Lost::new());
    let (producer, consumer) = ring.split();
    let (mut capture, mut samples) = (Capture::new(producer, &lost), Samples::new(consumer, &lost));
    let mut sensors = Sensors::default();
    let order = capture.listen([true, true, false]);
    sensors.run(&mut capture, order);
    for _ in 0..9 {
        assert!(!capture.on_look(), "nothing is on its way");
        assert_eq!(capture.after_look(), None);
    }
    sensors.packets.push_back(1);
    assert!(capture.on_edge(Sensor::Imu, 10, false).is_some());
    sensors.convert(2);
    assert_eq!(capture.on_edge(Sensor::LoadCell, 11, false), None);
    let looks = (1..9).find(|_| {
        let _ = capture.after_look();
        capture.on_look()
    });
    assert_eq!(looks, Some(usize::from(TRANSFER_LOOKS)));
    assert!(!capture.hold(), "the board has not stopped it yet");
    assert_eq!(capture.on_overdue(), None);
    assert!(capture.hold(), "the application can have the bus again");
    assert_eq!(capture.release(), None, "a bus that is broken takes one try a millisecond");
    let order = capture.after_look();
    assert!(order.is_some());
    sensors.run(&mut capture, order);
    // The conversion has retained its time; the packet, whose signal would have stayed up, is lost and read.
    assert_eq!(samples.take().map(|c| (c.sensor, c.ticks)), Some((Sensor::LoadCell, 11)));
    assert_eq!((samples.take(), lost.counts(), sensors.packets.len()), (None, [0, 1, 0], 0));
    assert_eq!(capture.failures(), Failures { overdue: 1, failed: 0 });
    sensors.packets.push_back(3);
    let order = capture.on_edge(Sensor::Imu, 20, false);
    sensors.run(&mut capture, order);
    assert_eq!(samples.take().map(|c| (c.ticks, c.bytes[4])), Some((20, 3)));
}

/// The conversion that is left in the converter after a transfer that failed is older than the next edge.
#[test]
fn no_conversion_is_dated_by_a_later_edge_after_a_failed_transfer() {
    for was_read in [false, true] {
        let (mut ring, lost) = (Ring::new(), Lost::new());
        let (producer, consumer) = ring.split();
        let (mut capture, mut samples) = (Capture::new(producer, &lost), Samples::new(consumer, &lost));
        let mut sensors = Sensors::default();
        let order = capture.listen(LOAD_CELL);
        sensors.run(&mut capture, order);
        sensors.convert(1);
        let order = capture.on_edge(Sensor::LoadCell, 1, false).unwrap();
        if was_read {
            sensors.serve(order);
        }
        capture.on_failed();
        let order = capture.after_look();
        sensors.run(&mut capture, order);
        for number in 2..9 {
            sensors.convert(number);
            let order = capture.on_edge(Sensor::LoadCell, u32::from(number), false);
            sensors.run(&mut capture, order);
            let sample = samples.take().unwrap();
            assert_eq!(sample.ticks, u32::from(sample.bytes[0]), "read before it failed: {was_read}");
        }
        assert_eq!((lost.counts(), capture.failures().failed), ([1, 0, 0], 1));
    }
}

/// The longest checkpoint stops the main loop for this many samples of three sensors, which the ring has room
/// for.
#[test]
fn the_ring_has_room_for_three_sensors_while_the_longest_checkpoint_is_written() {
    assert_eq!(RECORD_WORDS * 4, crate::storage::record::RECORD_BYTES as u64);
    let samples = EDGES as u64 * LONGEST_AWAY_NS.div_ceil(SHORTEST_PERIOD_NS);
    assert!(samples < ROOM as u64, "{samples} samples in {} ms", LONGEST_AWAY_NS / 1_000_000);
}

struct Direct(u32);

impl ErrorType for Direct {
    type Error = ErrorKind;
}

impl SpiDevice for Direct {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        self.0 += 1;
        if let [Operation::TransferInPlace(bytes)] = operations {
            bytes.fill(0xee);
        }
        Ok(())
    }
}

#[test]
fn a_request_is_answered_once_with_the_captured_sample_and_all_else_goes_over_the_bus() {
    let place = Place::new(None);
    let mut device = Answering::new(Direct(0), Sensor::LoadCell, &place);
    let captured = Captured { sensor: Sensor::LoadCell, ticks: 1, bytes: [0x55; MAX_CAPTURED] };
    // That of another sensor is left where it is.
    place.set(Some(Captured { sensor: Sensor::Imu, ..captured }));
    let mut bytes = ads131m08::READ;
    device.transfer_in_place(&mut bytes).unwrap();
    assert!(bytes == [0xee; MAX_CAPTURED] && place.get().is_some());
    place.set(Some(captured));
    let mut other = [1, 2, 3];
    device.transfer_in_place(&mut other).unwrap();
    assert_eq!((other, device.spi.0), ([0xee; 3], 2));
    for expected in [0x55, 0xee] {
        let mut bytes = ads131m08::READ;
        device.transfer_in_place(&mut bytes).unwrap();
        assert_eq!(bytes, [expected; MAX_CAPTURED]);
    }
    assert_eq!(device.spi.0, 3);
}
