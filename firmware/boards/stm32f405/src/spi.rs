//! SPI1, the sensors' bus: a transfer at once for the drivers, and one by DMA for the interrupts.

use core::sync::atomic::{AtomicU8, Ordering, fence};

use embedded_hal::spi::Operation;
use rigident_firmware::Sensor;
use rigident_firmware::capture::{MAX_CAPTURED, Order};

use crate::pins::{IMU_CS, LOAD_CELL_CS, MISO, MOSI, Pin, SCK, SECOND_IMU_CS};
use crate::registers::{
    DMA2_FROM_SPI1, DMA2_LIFCR, DMA2_LISR, DMA2_TO_SPI1, RCC_RSTR, SPI1_CR1, SPI1_CR2, SPI1_DR, SPI1_SR,
    wait_for,
};
use crate::time::Wait;

/// The pins' function.
const FUNCTION: u32 = 5;

/// Master, an eighth of its bus (10.5 or 12 MHz), chip selects by hand; idle low.
const MASTER: u32 = 1 << 9 | 1 << 8 | 0b010 << 3 | 1 << 2;
const ON: u32 = 1 << 6;
/// Bits are taken at the second edge: the converter's way. The IMUs' is the first.
const SECOND_EDGE: u32 = 1;

const CAN_SEND: u32 = 1 << 1;
const RECEIVED: u32 = 1;
const BUSY: u32 = 1 << 7;
const BOTH_BY_DMA: u32 = 0b11;

/// Channel 3, memory counts on, an end and an error interrupt; to the peripheral: also that direction.
const FROM: u32 = 3 << 25 | 1 << 10 | 1 << 4 | 1 << 2;
const TO: u32 = 3 << 25 | 1 << 10 | 1 << 6;
/// All flags of streams 0 and 3.
const FLAGS: u32 = 0x3d | 0x3d << 22;
const ENDED: u32 = 1 << 5;
/// Errors of a transfer and of the direct mode, of both.
const BAD: u32 = (1 << 3 | 1 << 2) | (1 << 3 | 1 << 2) << 22;
/// A byte arrived before the last one was read.
const OVERRUN: u32 = 1 << 6;
/// SPI1, of the peripherals of APB2.
const RESET: u32 = 1 << 12;

/// A byte takes 130 cycles, a read five.
const LOOKS: u32 = 1_000;

/// The buffer in which the DMA stores received bytes.
static BYTES: [AtomicU8; MAX_CAPTURED] = [const { AtomicU8::new(0) }; MAX_CAPTURED];
/// The bytes that it sends: in RAM, for flash cannot be read while a word is programmed.
static REQUEST: [AtomicU8; MAX_CAPTURED] = [const { AtomicU8::new(0) }; MAX_CAPTURED];

/// The bus did not come round in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Late;

/// Gives the pins to the bus.
pub fn start() {
    for pin in [LOAD_CELL_CS, IMU_CS, SECOND_IMU_CS] {
        pin.output();
    }
    SCK.peripheral(FUNCTION, 0);
    MOSI.peripheral(FUNCTION, 0);
    // Pulled down: a sensor that is not there reads zero.
    MISO.peripheral(FUNCTION, 2);
}

fn chip_select(sensor: Sensor) -> Pin {
    match sensor {
        Sensor::Imu => IMU_CS,
        Sensor::SecondImu => SECOND_IMU_CS,
        Sensor::LoadCell | Sensor::Frames => LOAD_CELL_CS,
    }
}

fn select(sensor: Sensor) {
    let mode = if sensor == Sensor::LoadCell { MASTER | SECOND_EDGE } else { MASTER };
    // The edge may only be changed while it is off.
    SPI1_CR1.write(mode);
    SPI1_CR1.write(mode | ON);
    chip_select(sensor).set(false);
}

/// Ends what was begun with [`select`]. Where bits do not come to their end the port is reset before anything
/// moves.
fn deselect(sensor: Sensor) {
    if wait_for(SPI1_SR, BUSY, 0, LOOKS) {
        chip_select(sensor).set(true);
    } else {
        abort();
    }
}

fn exchange(byte: u8) -> Result<u8, Late> {
    if !wait_for(SPI1_SR, CAN_SEND, CAN_SEND, LOOKS) {
        return Err(Late);
    }
    SPI1_DR.write(u32::from(byte));
    if !wait_for(SPI1_SR, RECEIVED, RECEIVED, LOOKS) {
        return Err(Late);
    }
    Ok(SPI1_DR.read() as u8)
}

/// Does operations under one chip select, at once. The bus must be the caller's.
pub fn transact(sensor: Sensor, operations: &mut [Operation<'_, u8>]) -> Result<(), Late> {
    select(sensor);
    // What an abandoned transfer has left.
    let _ = SPI1_DR.read();
    let done = operations.iter_mut().try_for_each(operate);
    deselect(sensor);
    done
}

fn operate(operation: &mut Operation<'_, u8>) -> Result<(), Late> {
    match operation {
        Operation::Read(input) => {
            for slot in input.iter_mut() {
                *slot = exchange(0)?;
            }
        }
        Operation::Write(output) => {
            for byte in output.iter() {
                exchange(*byte)?;
            }
        }
        Operation::Transfer(input, output) => {
            for k in 0..input.len().max(output.len()) {
                let byte = exchange(output.get(k).copied().unwrap_or(0))?;
                if let Some(slot) = input.get_mut(k) {
                    *slot = byte;
                }
            }
        }
        Operation::TransferInPlace(both) => {
            for slot in both.iter_mut() {
                *slot = exchange(*slot)?;
            }
        }
        Operation::DelayNs(ns) => embedded_hal::delay::DelayNs::delay_ns(&mut Wait, *ns),
    }
    Ok(())
}

/// Begins what was ordered; [`finished`] follows the interrupt of its end.
pub fn begin(order: &Order) {
    select(order.sensor);
    let _ = SPI1_DR.read();
    DMA2_LIFCR.write(FLAGS);
    let count = order.request.len().min(MAX_CAPTURED) as u32;
    REQUEST.iter().zip(order.request).for_each(|(to, from)| to.store(*from, Ordering::Relaxed));
    // The request is in memory before the DMA reads it.
    fence(Ordering::Release);
    // SAFETY: both are statics of atomics, of `MAX_CAPTURED` bytes, which `count` is no more than; the DMA
    // writes into the first one alone, and what it holds is read after the end.
    unsafe {
        DMA2_FROM_SPI1.begin(BYTES.as_ptr().cast(), count, FROM);
        DMA2_TO_SPI1.begin(REQUEST.as_ptr().cast(), count, TO);
    }
    SPI1_CR2.write(BOTH_BY_DMA);
}

/// Returns whether the transfer has come to an end, good or bad.
pub fn has_ended() -> bool {
    DMA2_LISR.read() & (ENDED | BAD) != 0
}

/// Ends a transfer by DMA and returns what was received; `None` if it failed.
pub fn finished(sensor: Sensor) -> Option<[u8; MAX_CAPTURED]> {
    let flags = DMA2_LISR.read();
    let good = flags & ENDED != 0 && flags & BAD == 0 && SPI1_SR.read() & OVERRUN == 0;
    stop();
    deselect(sensor);
    // What the DMA has written is read after its end.
    fence(Ordering::Acquire);
    good.then(|| core::array::from_fn(|k| BYTES.get(k).map_or(0, |byte| byte.load(Ordering::Relaxed))))
}

fn stop() {
    DMA2_FROM_SPI1.stop();
    DMA2_TO_SPI1.stop();
    DMA2_LIFCR.write(FLAGS);
    SPI1_CR2.write(0);
}

/// Ends a transfer that does not end by itself: both streams stopped, the port reset, nobody selected.
pub fn abort() {
    stop();
    let [.., apb2] = RCC_RSTR;
    apb2.change(0, RESET);
    apb2.change(RESET, 0);
    for pin in [LOAD_CELL_CS, IMU_CS, SECOND_IMU_CS] {
        pin.set(true);
    }
}
