//! The assignment of the pins. docs/wiring.md has the same table; a test compares them.

use crate::registers::PORTS;

/// A pin of port A or B.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// 0 is port A, 1 is B.
    port: u8,
    number: u8,
}

impl Pin {
    const fn a(number: u8) -> Self {
        Self { port: 0, number }
    }

    const fn b(number: u8) -> Self {
        Self { port: 1, number }
    }

    /// Returns its number in its port, which is that of its external interrupt, too.
    pub const fn number(self) -> u8 {
        self.number
    }

    /// Returns 0 for port A, 1 for B.
    pub const fn port(self) -> u8 {
        self.port
    }

    /// Drives it high or low.
    pub fn set(self, high: bool) {
        let bit = 1 << self.number;
        if let Some(port) = PORTS.get(usize::from(self.port)) {
            port.set.write(if high { bit } else { bit << 16 });
        }
    }

    /// Makes it an output that is high.
    pub fn output(self) {
        self.set(true);
        self.configure(1, 2, 0, 0);
    }

    /// Makes it a peripheral's, by the number of its alternate function; `pull`: 0 none, 1 up, 2 down.
    pub fn peripheral(self, function: u32, pull: u32) {
        self.configure(2, 2, pull, function);
    }

    fn configure(self, mode: u32, speed: u32, pull: u32, function: u32) {
        let Some(port) = PORTS.get(usize::from(self.port)) else { return };
        let two = 2 * u32::from(self.number);
        let four = 4 * u32::from(self.number % 8);
        if let Some(register) = port.function.get(usize::from(self.number / 8)) {
            register.change(0xf << four, function << four);
        }
        port.speed.change(3 << two, speed << two);
        port.pull.change(3 << two, pull << two);
        port.mode.change(3 << two, mode << two);
    }
}

/// The pin to the host (USART2 TX).
pub const HOST_TX: Pin = Pin::a(2);
/// The pin from the host (USART2 RX).
pub const HOST_RX: Pin = Pin::a(3);
/// Clock of the sensors' bus (SPI1 SCK).
pub const SCK: Pin = Pin::a(5);
/// The pin from the sensors (SPI1 MISO).
pub const MISO: Pin = Pin::a(6);
/// The pin to the sensors (SPI1 MOSI).
pub const MOSI: Pin = Pin::a(7);
/// Selects the load cell's converter.
pub const LOAD_CELL_CS: Pin = Pin::a(4);
/// Selects the IMU.
pub const IMU_CS: Pin = Pin::b(0);
/// Selects the second link's IMU.
pub const SECOND_IMU_CS: Pin = Pin::b(1);
/// The converter has a sample: falls (TIM2 channel 2).
pub const LOAD_CELL_READY: Pin = Pin::a(1);
/// The IMU has a sample: rises (TIM2 channel 3).
pub const IMU_READY: Pin = Pin::b(10);
/// The second link's IMU has a sample: rises (TIM2 channel 1).
pub const SECOND_IMU_READY: Pin = Pin::a(15);
