//! The IMU: an ICM-42688-P through the published driver `icm426xx`.
//!
//! Settings of that driver: ±16 g and ±2000 °/s; both sensors in low-noise mode at one rate; first-order
//! filters of half the rate behind anti-alias filters of 42 Hz (up to 100 samples per second), 84 Hz (200),
//! 213 Hz (500), 488 Hz (1000), 997 Hz (2000), 1962 Hz (4000), so that 25 and 50 samples per second are
//! aliased; 20-bit FIFO packets, one per data-ready signal; a full FIFO takes no more. Of the 20 bits the
//! accelerometer fills 18, 1.2e-3 m/s², and the gyro 19, 1.33e-4 rad/s (data sheet DS-000347). The noise that
//! the data sheet gives is 70 µg/√Hz and 2.8 mdps/√Hz.
//!
//! Additions of this adapter: a bus whose failures the published driver does not see while it initialises,
//! because it keeps the bus for ever when that fails ([`Wire`]); every field that it sets is read back; the
//! gyro's start-up is waited for; a backlog in the FIFO is passed over, because a sample is dated by its
//! signal; the temperature has the scale of 20-bit packets.

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use icm426xx::{Config, Error, ICM42688, OutputDataRate, Ready};

/// Read flag and address of WHO_AM_I, and what it holds.
const WHO_AM_I: u8 = 0x80 | 0x75;
const ICM_42688_P: u8 = 0x47;
/// SIGNAL_PATH_RESET and its bit that empties the FIFO.
const FLUSH_FIFO: [u8; 2] = [0x4b, 1 << 1];
/// REG_BANK_SEL, the same in every bank.
const BANK_SELECT: u8 = 0x76;
/// Times that a chip is asked who it is, or set up, before it is given up.
const TRIES: usize = 3;
/// The gyro has to be on for 45 ms before it is used or switched off again.
const START_UP_MS: u32 = 50;
/// Packets in a full FIFO: 2 KiB of 20 bytes.
pub const FIFO_PACKETS: u8 = 102;
/// Bytes of a packet.
const PACKET: u16 = 20;
/// The bytes that the published driver sends for a sample, and whoever reads one for it: read from INT_STATUS
/// on, which is followed by the FIFO's count and its oldest packet.
pub const READ: [u8; 24] = {
    let mut request = [0; 24];
    request[0] = 0x80 | 0x2d;
    request
};
/// INT_STATUS: the FIFO was full.
const FIFO_FULL: u8 = 1 << 1;

/// Returns whether the FIFO held more than the packet that was read, by what [`READ`] brought. A full one is
/// left to the driver, which empties it.
pub fn holds_more(read: &[u8]) -> bool {
    let [_, status, high, low, ..] = read else { return false };
    let count = u16::from_be_bytes([*high, *low]);
    status & FIFO_FULL == 0 && count > PACKET && count != u16::MAX
}

/// Has what [`READ`] brought say that the FIFO held one packet: those behind it were read by somebody else.
pub fn holds_one(read: &mut [u8]) {
    let more = holds_more(read);
    if let (true, [_, _, high, low, ..]) = (more, read) {
        [*high, *low] = PACKET.to_be_bytes();
    }
}

/// Tells what went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImuError<E> {
    /// The bus failed.
    Bus(E),
    /// Another chip answers.
    WrongId,
    /// A register does not hold what was written.
    Verify {
        /// The register's bank and address.
        register: (u8, u8),
        /// Written, in the bits that matter.
        wrote: u8,
        /// Read back, in these bits.
        read: u8,
    },
    /// The FIFO was full: samples were lost. It has been emptied.
    Overflow,
    /// A packet without both sensors: the chip has lost its settings, or nothing answers.
    Packet,
    /// Initialisation failed half-way or was never done; the device must be restarted.
    NotReady,
    /// No such rate.
    BadRate(u32),
}

/// One sample, in the IMU's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Specific force, m/s².
    pub specific_force_mps2: [f32; 3],
    /// Angular rate, rad/s.
    pub angular_rate_radps: [f32; 3],
    /// Temperature of the chip, °C.
    pub temperature_c: f32,
}

/// The bus as the published driver sees it. While it initialises nothing fails: the first failure is stored
/// for the adapter, and WHO_AM_I, which the adapter has checked and will check again, reads as it should.
struct Wire<SPI: ErrorType> {
    spi: SPI,
    initialises: bool,
    failed: Option<SPI::Error>,
}

impl<SPI: ErrorType> ErrorType for Wire<SPI> {
    type Error = SPI::Error;
}

impl<SPI: SpiDevice> SpiDevice for Wire<SPI> {
    // One piece of code for the sixty transfers of a bring-up.
    #[inline(never)]
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), SPI::Error> {
        if self.initialises { self.kindly(operations) } else { self.spi.transaction(operations) }
    }
}

impl<SPI: SpiDevice> Wire<SPI> {
    #[cold]
    fn kindly(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), SPI::Error> {
        let asks_who = matches!(operations, [Operation::TransferInPlace([WHO_AM_I, _])]);
        if let Err(error) = self.spi.transaction(operations) {
            self.failed.get_or_insert(error);
        }
        if let (true, [Operation::TransferInPlace([_, id])]) = (asks_who, operations) {
            *id = ICM_42688_P;
        }
        Ok(())
    }

    #[inline(never)]
    fn read(&mut self, register: u8) -> Result<u8, SPI::Error> {
        let mut bytes = [0x80 | register, 0];
        self.spi.transfer_in_place(&mut bytes)?;
        let [_, value] = bytes;
        Ok(value)
    }

    /// Asks who is there, a few times: a transfer may suffer.
    fn identify(&mut self) -> Result<(), ImuError<SPI::Error>> {
        let mut last = ImuError::WrongId;
        for _ in 0..TRIES {
            // Whoever failed half-way may have left another bank selected.
            let selected = self.spi.write(&[BANK_SELECT, 0]);
            match selected.and_then(|()| self.read(WHO_AM_I & !0x80)) {
                Ok(ICM_42688_P) => return Ok(()),
                Ok(_) => last = ImuError::WrongId,
                Err(error) => last = ImuError::Bus(error),
            }
        }
        Err(last)
    }

    /// Reads back what the published driver has written, and leaves bank 0 selected.
    fn verify(&mut self, rate: OutputDataRate) -> Result<(), ImuError<SPI::Error>> {
        let mut selected = 0;
        let mut wrong = None;
        for (bank, address, mask, wrote) in written(rate) {
            if bank != selected {
                self.spi.write(&[BANK_SELECT, bank]).map_err(ImuError::Bus)?;
                selected = bank;
            }
            let read = self.read(address).map_err(ImuError::Bus)? & mask;
            if read != wrote {
                wrong.get_or_insert(ImuError::Verify { register: (bank, address), wrote, read });
            }
        }
        self.spi.write(&[BANK_SELECT, 0]).map_err(ImuError::Bus)?;
        wrong.map_or(Ok(()), Err)
    }
}

/// Returns what the registers hold that the published driver sets: bank, address, the bits that matter, and
/// these (data sheet, sections 14 to 16). The last one of bank 0 selects it, and comes last, so that a chip
/// which stayed elsewhere shows.
fn written(rate: OutputDataRate) -> [(u8, u8, u8, u8); 26] {
    use OutputDataRate as Rate;
    // ODR, and DELT, DELTSQR and BITSHIFT of the anti-alias filter.
    let (odr, delt, squared, shift) = match rate {
        Rate::Hz4000 => (0b0100, 37, 1376_u16, 4_u8),
        Rate::Hz2000 => (0b0101, 21, 440, 6),
        Rate::Hz1000 => (0b0110, 11, 122, 8),
        Rate::Hz500 => (0b1111, 5, 25, 10),
        Rate::Hz200 => (0b0111, 2, 4, 13),
        Rate::Hz100 => (0b1000, 1, 1, 15),
        Rate::Hz50 => (0b1001, 1, 1, 15),
        _ => (0b1010, 1, 1, 15),
    };
    let [high, low] = squared.to_be_bytes();
    [
        (1, 0x0b, 0x03, 0),
        (1, 0x0c, 0x3f, delt),
        (1, 0x0d, 0xff, low),
        (1, 0x0e, 0xff, shift << 4 | high),
        (1, 0x7b, 0x06, 0),
        (2, 0x03, 0x7f, delt << 1),
        (2, 0x04, 0xff, low),
        (2, 0x05, 0xff, shift << 4 | high),
        // INT1: latched, push-pull, active high.
        (0, 0x14, 0x07, 0x07),
        // A full FIFO takes no more.
        (0, 0x16, 0xc0, 0xc0),
        (0, 0x4c, 0x73, 0x33),
        (0, 0x4d, 0xc0, 0x40),
        // Both sensors in low-noise mode, the thermometer on.
        (0, 0x4e, 0x2f, 0x0f),
        (0, 0x4f, 0xef, odr),
        (0, 0x50, 0xef, odr),
        (0, 0x51, 0x0c, 0),
        (0, 0x52, 0xff, 0),
        (0, 0x53, 0x18, 0),
        // Packets of 20 bits of both sensors, a signal for each.
        (0, 0x5f, 0x3f, 0x37),
        (0, 0x60, 0xff, 20),
        (0, 0x61, 0x0f, 0),
        (0, 0x63, 0x0c, 0x08),
        (0, 0x64, 0x10, 0),
        (0, 0x65, 0x0e, 0x04),
        (0, WHO_AM_I & !0x80, 0xff, ICM_42688_P),
        (0, BANK_SELECT, 0x07, 0),
    ]
}

enum Device<SPI: ErrorType> {
    Bus(Wire<SPI>),
    Ready(ICM42688<Wire<SPI>, Ready>),
    /// The state in which the bus is handed over.
    Between,
}

/// The driver.
pub struct Imu<SPI: ErrorType> {
    device: Device<SPI>,
    /// The rate at which it was set up, and the setting that is looked at next.
    rate: OutputDataRate,
    next_setting: u8,
    errors: u32,
    overflows: u32,
    skipped: u32,
}

impl<SPI: SpiDevice> Imu<SPI> {
    /// Returns a driver on this bus; nothing is sent yet.
    pub const fn new(spi: SPI) -> Self {
        let wire = Wire { spi, initialises: false, failed: None };
        let (rate, next_setting) = (OutputDataRate::Hz1000, 0);
        Self { device: Device::Bus(wire), rate, next_setting, errors: 0, overflows: 0, skipped: 0 }
    }

    /// Reads that failed, overflows included, since this driver was made.
    pub const fn errors(&self) -> u32 {
        self.errors
    }

    /// Returns how often the FIFO was full.
    pub const fn overflows(&self) -> u32 {
        self.overflows
    }

    /// Returns the number of samples passed over because a later one was already there.
    pub const fn skipped(&self) -> u32 {
        self.skipped
    }

    /// Resets the chip, sets it up and reads every setting back, three times if need be: 25, 50, 100, 200,
    /// 500, 1000, 2000 or 4000 samples per second. May be repeated, whatever its earlier result.
    ///
    /// # Errors
    /// No such rate, another chip, a register that does not hold, or the bus.
    pub fn bring_up(&mut self, delay: &mut impl DelayNs, rate_hz: u32) -> Result<(), ImuError<SPI::Error>> {
        let rate = output_data_rate(rate_hz).ok_or(ImuError::BadRate(rate_hz))?;
        self.rate = rate;
        let mut result = Ok(());
        for _ in 0..TRIES {
            result = self.try_bring_up(delay, rate);
            if result.is_ok() {
                break;
            }
        }
        result
    }

    #[inline(never)]
    fn try_bring_up(
        &mut self,
        delay: &mut impl DelayNs,
        rate: OutputDataRate,
    ) -> Result<(), ImuError<SPI::Error>> {
        let mut wire = match core::mem::replace(&mut self.device, Device::Between) {
            Device::Bus(wire) => wire,
            Device::Ready(driver) => driver.release(),
            Device::Between => return Err(ImuError::NotReady),
        };
        if let Err(error) = wire.identify() {
            self.device = Device::Bus(wire);
            return Err(error);
        }
        (wire.initialises, wire.failed) = (true, None);
        let config = Config { rate, ..Config::default() };
        // It cannot fail on this bus; what did is asked for below.
        let mut driver = ICM42688::new(wire).initialize(&mut *delay, config).map_err(error)?;
        delay.delay_ms(START_UP_MS);
        let wire = driver.ll().bus();
        wire.initialises = false;
        let done = match wire.failed.take() {
            Some(error) => Err(ImuError::Bus(error)),
            None => wire.verify(rate),
        };
        let flushed = done.and_then(|()| flush(&mut driver));
        // A chip that is not set up gives no samples.
        self.device = match flushed {
            Ok(()) => Device::Ready(driver),
            Err(_) => Device::Bus(driver.release()),
        };
        flushed
    }

    /// Reads one of its settings back, each time the next one of bank 0: the chip has no check of its own,
    /// and one that a discharge has changed would measure otherwise without a word. To be called now and then
    /// while samples are taken.
    ///
    /// # Errors
    /// It holds something else, three times in a row; a bus that fails says nothing of it.
    #[cold]
    #[inline(never)]
    pub fn look_at_a_setting(&mut self) -> Result<(), ImuError<SPI::Error>> {
        let Device::Ready(driver) = &mut self.device else { return Ok(()) };
        let settings = written(self.rate);
        let in_bank_0 = settings.iter().filter(|(bank, ..)| *bank == 0);
        let Some((bank, address, mask, wrote)) =
            in_bank_0.clone().nth(usize::from(self.next_setting)).copied()
        else {
            self.next_setting = 0;
            return Ok(());
        };
        self.next_setting += 1;
        let mut read = wrote;
        for _ in 0..TRIES {
            match driver.ll().bus().read(address) {
                Ok(value) => read = value & mask,
                Err(_) => return Ok(()),
            }
            if read == wrote {
                return Ok(());
            }
        }
        Err(ImuError::Verify { register: (bank, address), wrote, read })
    }

    /// Reads the sample that the chip has signalled: the newest in its FIFO; `None` if it holds none.
    ///
    /// # Errors
    /// The bus, an overflow, a packet that was not asked for (all counted), or a chip that was not set up.
    #[inline]
    pub fn read(&mut self) -> Result<Option<ImuSample>, ImuError<SPI::Error>> {
        let Device::Ready(driver) = &mut self.device else { return Err(ImuError::NotReady) };
        let result = newest(driver, &mut self.skipped);
        if let Err(error) = &result {
            self.errors = self.errors.saturating_add(1);
            if matches!(error, ImuError::Overflow) {
                self.overflows = self.overflows.saturating_add(1);
                // What is left is old.
                flush(driver)?;
            }
        }
        result
    }
}

/// Returns the newest sample in the FIFO; older ones are counted.
fn newest<SPI: SpiDevice>(
    driver: &mut ICM42688<Wire<SPI>, Ready>,
    skipped: &mut u32,
) -> Result<Option<ImuSample>, ImuError<SPI::Error>> {
    let mut newest = None;
    for _ in 0..FIFO_PACKETS {
        let Some((sample, more)) = driver.read_sample().map_err(error)? else { break };
        let (Some(a), Some(g)) = (sample.accel, sample.gyro) else { return Err(ImuError::Packet) };
        let sample = ImuSample {
            specific_force_mps2: a.into(),
            angular_rate_radps: g.into(),
            temperature_c: temperature_c(sample.temperature_celsius),
        };
        if newest.replace(sample).is_some() {
            *skipped = skipped.saturating_add(1);
        }
        if !more {
            break;
        }
    }
    Ok(newest)
}

/// Returns the temperature, °C. The published driver takes the 16 temperature bits of a 20-bit packet as
/// unsigned and scales them like the 8 bits of the short packets, 2.07 per °C. Back to the bits (a half is
/// added to round), and on by 132.48 per °C.
fn temperature_c(as_short_packet_c: f32) -> f32 {
    let bits = ((as_short_packet_c - 25.0) * 2.07 + 0.5) as u16;
    f32::from(bits.cast_signed()) / 132.48 + 25.0
}

/// Empties the FIFO; a write of its own, because the published one can panic on a wrong register bank.
fn flush<SPI: SpiDevice>(driver: &mut ICM42688<Wire<SPI>, Ready>) -> Result<(), ImuError<SPI::Error>> {
    driver.ll().bus().write(&FLUSH_FIFO).map_err(ImuError::Bus)
}

fn error<E>(error: Error<E>) -> ImuError<E> {
    match error {
        Error::Bus(e) => ImuError::Bus(e),
        Error::WhoAmIMismatch(_) => ImuError::WrongId,
        Error::FifoOverflow => ImuError::Overflow,
    }
}

fn output_data_rate(rate_hz: u32) -> Option<OutputDataRate> {
    Some(match rate_hz {
        25 => OutputDataRate::Hz25,
        50 => OutputDataRate::Hz50,
        100 => OutputDataRate::Hz100,
        200 => OutputDataRate::Hz200,
        500 => OutputDataRate::Hz500,
        1000 => OutputDataRate::Hz1000,
        2000 => OutputDataRate::Hz2000,
        4000 => OutputDataRate::Hz4000,
        _ => return None,
    })
}

#[cfg(test)]
#[path = "imu_tests.rs"]
mod tests;
