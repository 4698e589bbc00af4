//! ADS131M08: eight simultaneously sampled 24-bit ΔΣ converters; six of them read the gauges.
//!
//! Facts relied on (TI data sheet SBAS950): 24-bit words, most significant byte first; a frame is a command
//! or response word, eight channel words and a CRC word; a response comes one frame after its command; RREG
//! is `101a aaaa annn nnnn`, WREG `011a aaaa annn nnnn`; CRC-16-CCITT, seed 0xFFFF, over all words before it;
//! with RX_CRC_EN a command, with the data of a WREG, is followed by its own CRC; 16-bit words are in the
//! upper bits above zeros; full scale ±1.2 V / gain; rate = 4.096 MHz / OSR. With REG_CRC_EN the converter
//! watches its own registers: REG_MAP in STATUS says that their CRC has changed, by a write or
//! by itself; F_RESYNC that the filters began anew; DRDYn that channel n has a conversion that was not read.
//! STATUS in an answer clears the first two.
//! The CRC of every frame is checked, and so are the zeros beneath it: a sample with a changed bit is an
//! error, never a value.
//!
//! The converter holds two conversions. [`Ads131m08::bring_up`] empties that buffer; from then on every
//! conversion has to be read, or each later frame is one conversion older than its signal.

use crc::{CRC_16_CMS, CRC_16_IBM_3740, Crc, NoTable};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;

const WORD: usize = 3;
const CHANNELS: usize = 8;
/// Bytes of a frame.
pub const FRAME: usize = WORD * (1 + CHANNELS + 1);
/// The frame that reads a sample: whoever reads one for the driver sends this.
pub const READ: [u8; FRAME] = command(NULL);

const CRC16: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);
/// The other one that the converter may be set to (CRC_TYPE), slow and small.
const OTHER_CRC16: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_CMS);
/// Bytes of a frame of the longest words.
const LONGEST_FRAME: usize = 4 * (1 + CHANNELS + 1);

const NULL: u16 = 0x0000;
const RESET: u16 = 0x0011;
const UNLOCK: u16 = 0x0655;
/// Answer to a reset: the last digit is the number of channels.
const RESET_DONE: u16 = 0xff28;
/// Conversions that the converter holds.
const BUFFERED: usize = 2;
const ID: u8 = 0x00;
const MODE: u8 = 0x02;
const CLOCK: u8 = 0x03;
const GAIN1: u8 = 0x04;
const GAIN2: u8 = 0x05;

const STATUS_RESYNCED: u16 = 1 << 14;
const STATUS_REGISTERS: u16 = 1 << 13;
const STATUS_CRC_ERROR: u16 = 1 << 12;
const STATUS_RESET: u16 = 1 << 10;
/// The bits that a frame with a sample must not set.
const STATUS_BAD: u16 = STATUS_RESYNCED | STATUS_REGISTERS | STATUS_CRC_ERROR | STATUS_RESET;
/// DRDYn of all channels.
const STATUS_FRESH: u16 = 0xff;
/// CRC of registers and of input on, CCITT, 24-bit words, SPI timeout on; writing it clears the RESET flag.
const MODE_VALUE: u16 = 1 << 13 | 1 << 12 | 0b01 << 8 | 1 << 4;
/// All channels, high resolution.
const CLOCK_BASE: u16 = 0xff << 8 | 0b10;

/// Full scale at gain 1, V.
const FULL_SCALE_V: f32 = 1.2;
/// Codes at full scale.
const FULL_SCALE_CODES: f32 = 8_388_608.0;

/// Holds how the converter is to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AdcConfig {
    /// 250, 500, 1000, 2000 or 4000 samples per second.
    pub rate_hz: u32,
    /// Gain of the first six channels: 1, 2, 4, … 128. The others have gain 1.
    pub gain: u8,
}

/// Tells what went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdcError<E> {
    /// The bus failed.
    Bus(E),
    /// A frame's CRC does not fit. Both as the frame's last word: the CRC above eight zeros.
    Crc {
        /// Computed here.
        expected: u32,
        /// The check sum in the frame.
        got: u32,
    },
    /// Another chip answers, or none: its answer to a reset, or its ID register.
    WrongId(u16),
    /// A register does not hold what was written.
    Verify {
        /// The register's address.
        register: u8,
        /// Written.
        wrote: u16,
        /// Read back.
        read: u16,
    },
    /// The converter has restarted by itself: its registers are at their defaults.
    DeviceReset,
    /// The converter refused a command: its CRC had suffered on the way.
    InputCrc,
    /// The converter's registers have changed by themselves: gain or rate may be others.
    Registers,
    /// The converter's filters began anew, by a pulse on its SYNC pin: this conversion is not settled.
    Resynced,
    /// The frame brings a conversion again that was read before: DRDY fell without a new one.
    Stale,
    /// No such rate.
    BadRate(u32),
    /// No such gain.
    BadGain(u8),
}

/// One sample of all channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AdcFrame {
    /// Signed codes.
    pub codes: [i32; CHANNELS],
    /// The STATUS register.
    pub status: u16,
    /// Bit c: channel c is at an end of its range, so its input may lie beyond.
    pub saturated: u8,
}

impl AdcFrame {
    /// Returns the first six channels in volts at the converter's input, amplified by the `gain` of
    /// [`AdcConfig`].
    pub fn gauges_v(&self, gain: u8) -> [f32; 6] {
        let volts = FULL_SCALE_V / FULL_SCALE_CODES / f32::from(gain);
        let [a, b, c, d, e, f, _, _] = self.codes;
        [a, b, c, d, e, f].map(|code| code as f32 * volts)
    }

    /// Returns the seventh channel in volts at the converter's input: what a divider leaves of the gauges'
    /// excitation. It is not amplified.
    pub fn excitation_v(&self) -> f32 {
        let [.., excitation, _] = self.codes;
        excitation as f32 * (FULL_SCALE_V / FULL_SCALE_CODES)
    }
}

/// The driver.
#[derive(Debug)]
pub struct Ads131m08<SPI> {
    spi: SPI,
    crc_errors: u32,
}

impl<SPI: SpiDevice> Ads131m08<SPI> {
    /// Returns a driver on this bus; nothing is sent yet.
    pub const fn new(spi: SPI) -> Self {
        Self { spi, crc_errors: 0 }
    }

    /// Returns the number of frames whose CRC did not fit, since this driver was made.
    pub const fn crc_errors(&self) -> u32 {
        self.crc_errors
    }

    /// Resets the converter, sets it up, reads every register back, and empties its buffer. May be repeated.
    ///
    /// # Errors
    /// No such rate or gain; another chip; a register that does not hold; a CRC either way; the bus.
    #[inline(never)]
    pub fn bring_up(
        &mut self,
        delay: &mut impl DelayNs,
        config: &AdcConfig,
    ) -> Result<(), AdcError<SPI::Error>> {
        let oversampling = oversampling_code(config.rate_hz).ok_or(AdcError::BadRate(config.rate_hz))?;
        if !config.gain.is_power_of_two() || config.gain > 128 {
            return Err(AdcError::BadGain(config.gain));
        }
        // A reset is only taken in a whole frame; one with the CRC reaches a converter that has it on too.
        // What comes back belongs to what was before.
        self.exchange(&mut command(RESET))?;
        delay.delay_ms(1);
        if self.unchecked_answer()? != RESET_DONE {
            self.reset_however_it_is_set()?;
            delay.delay_ms(1);
            let answer = self.unchecked_answer()?;
            if answer != RESET_DONE {
                return Err(AdcError::WrongId(answer));
            }
        }
        let id = self.read_register(ID)?;
        if id >> 8 & 0x0f != CHANNELS as u16 || id >> 12 != 2 {
            return Err(AdcError::WrongId(id));
        }
        let gain = config.gain.trailing_zeros() as u16;
        let gains = gain | gain << 4 | gain << 8 | gain << 12;
        let settings = [
            (MODE, MODE_VALUE),
            (CLOCK, CLOCK_BASE | oversampling << 2),
            (GAIN1, gains),
            // The last two channels see the excitation: at gain 1.
            (GAIN2, gains & 0x00ff),
        ];
        for (register, value) in settings {
            self.write_register(register, value)?;
        }
        // The registers' CRC has been computed anew, 784 bits at 4 MHz; the frames that empty the buffer
        // clear its flag.
        delay.delay_ms(1);
        for _ in 0..BUFFERED {
            match self.read_frame() {
                Ok(_) | Err(AdcError::Registers | AdcError::Resynced | AdcError::Stale) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Returns what comes back, whatever its CRC: a chip with fewer channels has shorter frames, and its name
    /// before that.
    fn unchecked_answer(&mut self) -> Result<u16, AdcError<SPI::Error>> {
        let mut answer = command(NULL);
        self.exchange(&mut answer)?;
        Ok(response(&answer))
    }

    /// Resets a converter whose words or CRC have become others by themselves, or that has been locked: it
    /// takes a reset in a whole frame of its own format alone.
    #[cold]
    #[inline(never)]
    fn reset_however_it_is_set(&mut self) -> Result<(), AdcError<SPI::Error>> {
        for word_bytes in 2..=4 {
            for other_crc in [false, true] {
                for word in [UNLOCK, RESET] {
                    let mut frame = [0; LONGEST_FRAME];
                    let (first, rest) = frame.split_at_mut(word_bytes);
                    first.iter_mut().zip(word.to_be_bytes()).for_each(|(to, from)| *to = from);
                    let check = if other_crc { OTHER_CRC16.checksum(first) } else { CRC16.checksum(first) };
                    rest.iter_mut().zip(check.to_be_bytes()).for_each(|(to, from)| *to = from);
                    self.spi.write(&frame).map_err(AdcError::Bus)?;
                }
            }
        }
        Ok(())
    }

    /// Reads the sample that the converter has signalled.
    ///
    /// # Errors
    /// A CRC that does not fit (counted), a restart of the converter, registers that have changed, a command
    /// that it refused, a conversion that is not settled or not new, the bus.
    #[inline]
    pub fn read_frame(&mut self) -> Result<AdcFrame, AdcError<SPI::Error>> {
        let mut bytes = READ;
        self.frame(&mut bytes)?;
        let [words @ .., _] = words(&bytes);
        let [status, channels @ ..] = words;
        let status = (status >> 8) as u16;
        if status & (STATUS_BAD | STATUS_FRESH) != STATUS_FRESH {
            return Err(refused(status));
        }
        // 24 bits at the top of 32, brought down with their sign.
        let codes = channels.map(|word| (word << 8).cast_signed() >> 8);
        let mut saturated = 0;
        for (channel, code) in codes.iter().enumerate() {
            if !(-8_388_608 < *code && *code < 8_388_607) {
                saturated |= 1 << channel;
            }
        }
        Ok(AdcFrame { codes, status, saturated })
    }

    #[inline(never)]
    fn read_register(&mut self, register: u8) -> Result<u16, AdcError<SPI::Error>> {
        self.answer(read_command(register))?;
        self.answer(command(NULL))
    }

    #[inline(never)]
    fn write_register(&mut self, register: u8, value: u16) -> Result<(), AdcError<SPI::Error>> {
        self.answer(write_command(register, value))?;
        // A write is carried out even with a wrong CRC, perhaps at another address: only its answer tells.
        let answer = self.answer(read_command(register))?;
        if answer != 0b010 << 13 | u16::from(register) << 7 {
            return Err(AdcError::InputCrc);
        }
        let read = self.answer(command(NULL))?;
        if read == value { Ok(()) } else { Err(AdcError::Verify { register, wrote: value, read }) }
    }

    /// Exchanges a frame, in its place, without reading what comes back.
    fn exchange(&mut self, bytes: &mut [u8; FRAME]) -> Result<(), AdcError<SPI::Error>> {
        self.spi.transfer_in_place(bytes).map_err(AdcError::Bus)
    }

    /// Exchanges a frame, in its place, and checks the CRC of what comes back.
    fn frame(&mut self, bytes: &mut [u8; FRAME]) -> Result<(), AdcError<SPI::Error>> {
        self.exchange(bytes)?;
        let [body @ .., high, low, padding] = bytes;
        let got = u32::from_be_bytes([0, *high, *low, *padding]);
        let expected = u32::from(CRC16.checksum(body)) << 8;
        if got == expected {
            Ok(())
        } else {
            self.crc_errors = self.crc_errors.saturating_add(1);
            Err(AdcError::Crc { expected, got })
        }
    }

    /// Returns what a frame with this command gets back.
    fn answer(&mut self, mut bytes: [u8; FRAME]) -> Result<u16, AdcError<SPI::Error>> {
        self.frame(&mut bytes)?;
        Ok(response(&bytes))
    }
}

/// Returns what a status says against the sample below it, the worst first.
#[cold]
#[inline(never)]
fn refused<E>(status: u16) -> AdcError<E> {
    if status & STATUS_RESET != 0 {
        AdcError::DeviceReset
    } else if status & STATUS_REGISTERS != 0 {
        AdcError::Registers
    } else if status & STATUS_CRC_ERROR != 0 {
        AdcError::InputCrc
    } else if status & STATUS_RESYNCED != 0 {
        AdcError::Resynced
    } else {
        AdcError::Stale
    }
}

/// Returns the code for 4.096 MHz / (128 · 2^code); the faster half of the rates is not used.
fn oversampling_code(rate_hz: u32) -> Option<u16> {
    (3..8).find(|code| 32_000 >> code == rate_hz)
}

/// Returns a frame with one command word and its CRC.
const fn command(word: u16) -> [u8; FRAME] {
    let mut frame = [0; FRAME];
    let [a, b] = word.to_be_bytes();
    let [c, d] = CRC16.checksum(&[a, b, 0]).to_be_bytes();
    [frame[0], frame[1], frame[3], frame[4]] = [a, b, c, d];
    frame
}

/// Returns a frame that asks for one register.
fn read_command(register: u8) -> [u8; FRAME] {
    command(0b101 << 13 | u16::from(register) << 7)
}

/// Returns a frame that writes one register, and the CRC over both words.
fn write_command(register: u8, value: u16) -> [u8; FRAME] {
    let mut frame = [0; FRAME];
    put(&mut frame, 0, 0b011 << 13 | u16::from(register) << 7);
    put(&mut frame, 1, value);
    let check = CRC16.checksum(frame.first_chunk::<{ 2 * WORD }>().unwrap_or(&[0; 2 * WORD]));
    put(&mut frame, 2, check);
    frame
}

/// Returns what a frame answers to the command in the frame before it.
fn response(frame: &[u8; FRAME]) -> u16 {
    let [high, low, ..] = frame;
    u16::from_be_bytes([*high, *low])
}

/// Puts a 16-bit word into the upper bits of a frame's word.
fn put(frame: &mut [u8; FRAME], index: usize, word: u16) {
    if let Some([high, low, _]) = frame.as_chunks_mut::<WORD>().0.get_mut(index) {
        [*high, *low] = word.to_be_bytes();
    }
}

/// Returns a frame's ten words.
fn words(frame: &[u8; FRAME]) -> [u32; CHANNELS + 2] {
    let mut words = [0; CHANNELS + 2];
    for (word, [a, b, c]) in words.iter_mut().zip(frame.as_chunks::<WORD>().0) {
        *word = u32::from_be_bytes([0, *a, *b, *c]);
    }
    words
}

#[cfg(test)]
#[path = "ads131m08_tests.rs"]
mod tests;
