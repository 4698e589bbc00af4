//! SPI1, the sensors' bus: a transfer at once for the drivers, and one by DMA for the interrupts.

use core::sync::atomic::{AtomicU8, Ordering};

use embedded_hal::spi::Operation;
use rigident_firmware::Sensor;
use rigident_firmware::capture::{MAX_CAPTURED, Order};

use crate::pins::{IMU_CS, LOAD_CELL_CS, MISO, MOSI, Pin, SCK, SECOND_IMU_CS};
use crate::registers::{
    DMA2_FROM_SPI1, DMA2_LIFCR, DMA2_LISR, DMA2_TO_SPI1, SPI1_CR1, SPI1_CR2, SPI1_DR, SPI1_SR, wait_for,
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
const ENABLED: u32 = 1;
/// All flags of streams 0 and 3.
const FLAGS: u32 = 0x3d | 0x3d << 22;
const ENDED: u32 = 1 << 5;

/// A byte takes 130 cycles, a look five.
const LOOKS: u32 = 1_000;

/// Where the DMA leaves what comes.
static BYTES: [AtomicU8; MAX_CAPTURED] = [const { AtomicU8::new(0) }; MAX_CAPTURED];

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

fn deselect(sensor: Sensor) {
    wait_for(SPI1_SR, BUSY, 0, LOOKS);
    chip_select(sensor).set(true);
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
    // The DMA writes into a static of atomics, and reads a static; neither is longer than `count`.
    for (stream, memory, control) in
        [(DMA2_FROM_SPI1, BYTES.as_ptr() as u32, FROM), (DMA2_TO_SPI1, order.request.as_ptr() as u32, TO)]
    {
        stream.count.write(count);
        stream.peripheral.write(SPI1_DR.address() as u32);
        stream.memory.write(memory);
        stream.control.write(control);
        stream.control.write(control | ENABLED);
    }
    SPI1_CR2.write(BOTH_BY_DMA);
}

/// Ends a transfer by DMA and returns what came; `None` if it failed.
pub fn finished(sensor: Sensor) -> Option<[u8; MAX_CAPTURED]> {
    let ended = DMA2_LISR.read() & ENDED != 0;
    for stream in [DMA2_FROM_SPI1, DMA2_TO_SPI1] {
        stream.control.change(ENABLED, 0);
        // It stays on until what it has begun is done.
        wait_for(stream.control, ENABLED, 0, LOOKS);
    }
    DMA2_LIFCR.write(FLAGS);
    SPI1_CR2.write(0);
    deselect(sensor);
    ended.then(|| core::array::from_fn(|k| BYTES.get(k).map_or(0, |byte| byte.load(Ordering::Relaxed))))
}
