//! ICM-42688-P: accelerometer and gyro with a FIFO, on SPI (TDK data sheet DS-000347).
//!
//! One [`Icm42688::transfer`] is one transaction, chip select low to high: an address byte (top bit set to
//! read), then data with the address counting up, except at FIFO_DATA, which stays. Modelled: the five
//! register banks, soft reset, power modes, output data rates, full scales, the data registers, the FIFO in
//! its three modes with packets 1 to 4, its count in bytes or records and either byte order, watermark,
//! overflow, interrupt status, timestamps. Not modelled: filters (their delay belongs to [`crate::sensors`]),
//! start-up times, FSYNC, APEX, self-test, low-power averaging.
//!
//! A 20-bit packet always spans ±16 g and ±2000 °/s; of its 20 bits the accelerometer fills 18, the gyro 19.

use std::collections::VecDeque;

const BANK_SEL: u8 = 0x76;
const DEVICE_CONFIG: u8 = 0x11;
const FIFO_CONFIG: u8 = 0x16;
const TEMP_DATA1: u8 = 0x1D;
const INT_STATUS: u8 = 0x2D;
const FIFO_COUNTH: u8 = 0x2E;
const FIFO_COUNTL: u8 = 0x2F;
const FIFO_DATA: u8 = 0x30;
const SIGNAL_PATH_RESET: u8 = 0x4B;
const INTF_CONFIG0: u8 = 0x4C;
const PWR_MGMT0: u8 = 0x4E;
const GYRO_CONFIG0: u8 = 0x4F;
const ACCEL_CONFIG0: u8 = 0x50;
const TMST_CONFIG: u8 = 0x54;
const FIFO_CONFIG1: u8 = 0x5F;
const FIFO_CONFIG2: u8 = 0x60;
const FIFO_CONFIG3: u8 = 0x61;
const INT_SOURCE0: u8 = 0x65;
const WHO_AM_I: u8 = 0x75;

const INT_RESET_DONE: u8 = 1 << 4;
const INT_DATA_READY: u8 = 1 << 3;
const INT_FIFO_THRESHOLD: u8 = 1 << 2;
const INT_FIFO_FULL: u8 = 1 << 1;

const FIFO_BYTES: usize = 2048;
const STANDARD_GRAVITY_MPS2: f64 = hexapod::STANDARD_GRAVITY_MPS2;

/// The inertial measurement unit.
#[derive(Clone, Debug)]
pub struct Icm42688 {
    banks: [[u8; 128]; 5],
    fifo: VecDeque<Vec<u8>>,
    /// Bytes of the packet that is being read.
    reading: VecDeque<u8>,
    status: u8,
    latched_count: u16,
    last_sample_ns: Option<u64>,
    /// State of the transaction on its way: nothing yet, or the address that is next and whether it is read.
    addressed: Option<(u8, bool)>,
}

impl Default for Icm42688 {
    fn default() -> Self {
        Self::new()
    }
}

impl Icm42688 {
    /// Returns the IMU as it comes out of power-on reset: both sensors off.
    pub fn new() -> Self {
        let mut device = Self {
            banks: [[0; 128]; 5],
            fifo: VecDeque::new(),
            reading: VecDeque::new(),
            status: 0,
            latched_count: 0,
            last_sample_ns: None,
            addressed: None,
        };
        device.reset();
        device
    }

    fn reset(&mut self) {
        *self = Self {
            banks: [[0; 128]; 5],
            fifo: VecDeque::new(),
            reading: VecDeque::new(),
            status: INT_RESET_DONE,
            latched_count: 0,
            last_sample_ns: None,
            addressed: None,
        };
        let defaults: [(usize, u8, u8); 16] = [
            (0, 0x13, 0x05),
            (0, WHO_AM_I, 0x47),
            (0, INTF_CONFIG0, 0x30),
            (0, 0x4D, 0x91),
            (0, GYRO_CONFIG0, 0x06),
            (0, ACCEL_CONFIG0, 0x06),
            (0, 0x51, 0x16),
            (0, 0x52, 0x11),
            (0, 0x53, 0x0D),
            (0, TMST_CONFIG, 0x23),
            (0, 0x64, 0x10),
            (0, INT_SOURCE0, 0x10),
            (1, 0x0B, 0xA0),
            (1, 0x0C, 0x0D),
            (1, 0x0D, 0xAA),
            (1, 0x0E, 0x80),
        ];
        for (bank, address, value) in defaults {
            self.banks[bank][usize::from(address)] = value;
        }
    }

    /// Changes bits of a register of bank 0, as a discharge may do it.
    pub fn disturb(&mut self, address: u8, bits: u8) {
        self.banks[0][usize::from(address & 0x7F)] ^= bits;
    }

    /// Returns true while pin INT1 is up: latched, as its driver sets it, until INT_STATUS is read.
    pub fn signals(&self) -> bool {
        // Bits 1 to 4 of INT_SOURCE0 enable the same bits of INT_STATUS.
        self.status & self.register(INT_SOURCE0) & (INT_DATA_READY | INT_FIFO_THRESHOLD | INT_FIFO_FULL) != 0
    }

    fn register(&self, address: u8) -> u8 {
        self.banks[0][usize::from(address & 0x7F)]
    }

    fn bank(&self) -> usize {
        usize::from(self.register(BANK_SEL) & 7).min(4)
    }

    /// Returns the samples per second, by the faster of the two sensors in low-noise mode; `None` while both
    /// are off.
    pub fn rate_hz(&self) -> Option<f64> {
        let power = self.register(PWR_MGMT0);
        let gyro = (power >> 2 & 3 == 3).then(|| rate_of(self.register(GYRO_CONFIG0))).flatten();
        let accel = (power & 3 >= 2).then(|| rate_of(self.register(ACCEL_CONFIG0))).flatten();
        match (gyro, accel) {
            (Some(g), Some(a)) => Some(g.max(a)),
            (one, other) => one.or(other),
        }
    }

    /// Takes a sample at `time_ns`: specific force m/s², angular rate rad/s, along the IMU's axes. Returns
    /// whether pin INT1 announces it.
    pub fn sample(&mut self, time_ns: u64, accel: [f64; 3], gyro: [f64; 3], temperature_c: f64) -> bool {
        let power = self.register(PWR_MGMT0);
        let (accel_on, gyro_on) = (power & 3 >= 2, power >> 2 & 3 == 3);
        if !accel_on && !gyro_on {
            return false;
        }
        // Full scales of the data registers: ±16 g and ±2000 °/s, halved by each step of FS_SEL.
        let accel_full =
            16.0 * STANDARD_GRAVITY_MPS2 / f64::from(1u32 << (self.register(ACCEL_CONFIG0) >> 5).min(3));
        let gyro_full = 2000_f64.to_radians() / f64::from(1u32 << (self.register(GYRO_CONFIG0) >> 5));
        let accel_16 = accel.map(|a| code(a / accel_full, 15) as i16);
        let gyro_16 = gyro.map(|g| code(g / gyro_full, 15) as i16);
        let temperature_16 = code((temperature_c - 25.0) * 132.48 / 32768.0, 15) as i16;
        let off = i16::MIN;
        let mut words = [temperature_16, off, off, off, off, off, off];
        if accel_on {
            words[1..4].copy_from_slice(&accel_16);
        }
        if gyro_on {
            words[4..7].copy_from_slice(&gyro_16);
        }
        for (i, word) in words.into_iter().enumerate() {
            let at = usize::from(TEMP_DATA1) + 2 * i;
            let pair = self.ordered(word as u16);
            self.banks[0][at..at + 2].copy_from_slice(&pair);
        }
        let stamp = self.timestamp(time_ns);
        self.last_sample_ns = Some(time_ns);
        self.status |= INT_DATA_READY;
        self.push_packet(
            accel_on.then_some((accel, accel_16)),
            gyro_on.then_some((gyro, gyro_16)),
            temperature_c,
            stamp,
        );
        self.signals()
    }

    /// Returns two bytes in the order SENSOR_DATA_ENDIAN asks for.
    fn ordered(&self, word: u16) -> [u8; 2] {
        if self.register(INTF_CONFIG0) & 0x10 != 0 { word.to_be_bytes() } else { word.to_le_bytes() }
    }

    fn timestamp(&self, time_ns: u64) -> u16 {
        let config = self.register(TMST_CONFIG);
        let unit_ns = if config & 8 != 0 { 16_000 } else { 1_000 };
        let counted = if config & 4 != 0 {
            self.last_sample_ns.map_or(0, |l| time_ns.saturating_sub(l))
        } else {
            time_ns
        };
        (counted / unit_ns) as u16
    }

    fn push_packet(
        &mut self,
        accel: Option<([f64; 3], [i16; 3])>,
        gyro: Option<([f64; 3], [i16; 3])>,
        temperature_c: f64,
        stamp: u16,
    ) {
        let (mode, config) = (self.register(FIFO_CONFIG) >> 6, self.register(FIFO_CONFIG1));
        if mode == 0 {
            return;
        }
        let high_resolution = config & 0x10 != 0;
        let (with_accel, with_gyro) =
            (config & 1 != 0 || high_resolution, config & 2 != 0 || high_resolution);
        if !with_accel && !with_gyro {
            return;
        }
        // Header: accel, gyro, 20-bit, ODR timestamp in packets that hold both.
        let both = with_accel && with_gyro;
        let mut packet = vec![
            u8::from(with_accel) << 6
                | u8::from(with_gyro) << 5
                | u8::from(high_resolution) << 4
                | if both { 0b10 << 2 } else { 0 },
        ];
        // 20-bit data are 18 bits of ±16 g above two zeros and 19 bits of ±2000 °/s above one.
        // A sensor that is off gives the invalid word.
        let invalid = ([-1 << 19; 3], [i16::MIN; 3]);
        let (wide_accel, accel_16) = accel.map_or(invalid, |(value, word)| {
            (value.map(|a| code(a / (16.0 * STANDARD_GRAVITY_MPS2), 17) << 2), word)
        });
        let (wide_gyro, gyro_16) = gyro
            .map_or(invalid, |(value, word)| (value.map(|g| code(g / 2000_f64.to_radians(), 18) << 1), word));
        for i in 0..3 {
            if with_accel {
                let word = if high_resolution { (wide_accel[i] >> 4) as u16 } else { accel_16[i] as u16 };
                packet.extend_from_slice(&self.ordered(word));
            }
        }
        for i in 0..3 {
            if with_gyro {
                let word = if high_resolution { (wide_gyro[i] >> 4) as u16 } else { gyro_16[i] as u16 };
                packet.extend_from_slice(&self.ordered(word));
            }
        }
        let degrees = temperature_c - 25.0;
        if high_resolution {
            packet.extend_from_slice(&self.ordered(code(degrees * 132.48 / 32768.0, 15) as u16));
        } else {
            packet.push(code(degrees * 2.07 / 128.0, 7) as u8);
        }
        if both {
            packet.extend_from_slice(&self.ordered(stamp));
        }
        if high_resolution {
            for i in 0..3 {
                packet.push(((wide_accel[i] & 0xF) << 4 | wide_gyro[i] & 0xF) as u8);
            }
        }
        if (self.fifo.len() + 1) * packet.len() > FIFO_BYTES {
            self.status |= INT_FIFO_FULL;
            if mode == 1 {
                self.fifo.pop_front();
            } else {
                return;
            }
        }
        self.fifo.push_back(packet);
        let watermark =
            u16::from(self.register(FIFO_CONFIG3) & 0xF) << 8 | u16::from(self.register(FIFO_CONFIG2));
        if watermark > 0 && self.count() >= watermark {
            self.status |= INT_FIFO_THRESHOLD;
        }
    }

    /// Returns what FIFO_COUNT says: bytes, or records.
    fn count(&self) -> u16 {
        let records = self.register(INTF_CONFIG0) & 0x40 != 0;
        let bytes: usize = self.fifo.iter().map(Vec::len).sum();
        (if records { self.fifo.len() } else { bytes }) as u16
    }

    /// Makes one transaction: `bytes` holds what the host sends and receives what the IMU sends.
    pub fn transfer(&mut self, bytes: &mut [u8]) {
        self.select();
        for byte in bytes.iter_mut() {
            *byte = self.exchange(*byte);
        }
        self.deselect();
    }

    /// Lowers chip select: a transaction begins.
    pub fn select(&mut self) {
        self.addressed = None;
    }

    /// Takes a byte in and gives a byte out.
    pub fn exchange(&mut self, byte: u8) -> u8 {
        let Some((address, read)) = self.addressed else {
            self.addressed = Some((byte & 0x7F, byte & 0x80 != 0));
            return 0;
        };
        let answer = if read {
            self.read(address)
        } else {
            self.write(address, byte);
            0
        };
        let stays = address == FIFO_DATA && self.bank() == 0;
        self.addressed = Some((if stays { address } else { (address + 1) & 0x7F }, read));
        answer
    }

    /// Raises chip select.
    pub fn deselect(&mut self) {
        self.addressed = None;
        // A packet that was not read to its end is lost (FIFO_RESUME_PARTIAL_RD is not modelled).
        self.reading.clear();
    }

    fn read(&mut self, address: u8) -> u8 {
        if self.bank() != 0 && address != BANK_SEL {
            return self.banks[self.bank()][usize::from(address)];
        }
        match address {
            INT_STATUS => std::mem::take(&mut self.status),
            FIFO_COUNTH => {
                self.latched_count = self.count();
                self.count_byte(0)
            }
            FIFO_COUNTL => self.count_byte(1),
            FIFO_DATA => self.read_fifo(),
            _ => self.register(address),
        }
    }

    fn count_byte(&self, i: usize) -> u8 {
        let big = self.register(INTF_CONFIG0) & 0x20 != 0;
        let [a, b] = if big { self.latched_count.to_be_bytes() } else { self.latched_count.to_le_bytes() };
        if i == 0 { a } else { b }
    }

    fn read_fifo(&mut self) -> u8 {
        if self.reading.is_empty() {
            match self.fifo.pop_front() {
                Some(packet) => self.reading.extend(packet),
                // An empty FIFO: a header that says so.
                None => self.reading.extend([0x80]),
            }
        }
        self.status &= !INT_FIFO_THRESHOLD;
        self.reading.pop_front().unwrap_or(0x80)
    }

    fn write(&mut self, address: u8, value: u8) {
        let bank = self.bank();
        if address == BANK_SEL {
            self.banks[0][usize::from(BANK_SEL)] = value & 7;
            return;
        }
        if bank != 0 {
            self.banks[bank][usize::from(address)] = value;
            return;
        }
        match address {
            DEVICE_CONFIG if value & 1 != 0 => self.reset(),
            SIGNAL_PATH_RESET => {
                // Flushes itself and reads back as zero.
                if value & 2 != 0 {
                    self.fifo.clear();
                    self.reading.clear();
                }
            }
            // Data, status, counts and identity cannot be written.
            TEMP_DATA1..=FIFO_DATA | WHO_AM_I => {}
            _ => self.banks[0][usize::from(address)] = value,
        }
    }
}

/// Returns the rate of the ODR field of GYRO_CONFIG0 and ACCEL_CONFIG0, Hz.
fn rate_of(register: u8) -> Option<f64> {
    match register & 0xF {
        0b0001 => Some(32_000.0),
        0b0010 => Some(16_000.0),
        0b0011 => Some(8_000.0),
        0b0100 => Some(4_000.0),
        0b0101 => Some(2_000.0),
        0b0110 => Some(1_000.0),
        0b0111 => Some(200.0),
        0b1000 => Some(100.0),
        0b1001 => Some(50.0),
        0b1010 => Some(25.0),
        0b1011 => Some(12.5),
        0b1111 => Some(500.0),
        _ => None,
    }
}

/// Returns a fraction of full scale as a signed word with `bits` bits besides the sign. The most negative
/// word marks invalid samples and is never given.
fn code(fraction: f64, bits: u32) -> i32 {
    let full = f64::from(1u32 << bits);
    (fraction * full).round().clamp(1.0 - full, full - 1.0) as i32
}

#[cfg(test)]
#[path = "icm42688_tests.rs"]
mod tests;
