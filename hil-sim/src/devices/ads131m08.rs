//! ADS131M08: eight simultaneously sampled 24-bit ΔΣ converters on SPI (TI data sheet SBAS950B).
//!
//! One [`Ads131m08::transfer`] is one frame, chip select low to high. The answer to a command is in the first
//! word of the **next** frame; the last word is a CRC over all words before it. Modelled: the register map,
//! NULL, RESET, STANDBY, WAKEUP, LOCK, UNLOCK, RREG, WREG, all word lengths, input and output CRC of both
//! kinds, gain, offset and gain calibration, disabled channels, OSR, the flags of the register map and of a
//! resynchronisation, an oscillator of another frequency; where [`Ads131m08::hold_two`] asks for it, the
//! second level of the output buffer (else a conversion that is not read is overwritten). Not modelled: phase
//! calibration, current detection, global chop, test signals, the value of the register-map CRC, start-up
//! times, and the filter's droop (5e-5 at 5 Hz and 1 kHz).
//!
//! Facts used: full scale ±1.2 V / gain; modulator at half of the 8.192 MHz clock; OSR up to 1024 is a sinc³,
//! beyond that a sinc³ of 1024 followed by an average.

/// Full scale at gain 1, V.
pub const FULL_SCALE_V: f64 = 1.2;
/// Frequency of the oscillator that the data sheet asks for, Hz.
pub const CLOCK_HZ: f64 = 8.192e6;
const CHANNELS: usize = 8;

const ID: usize = 0x00;
const STATUS: usize = 0x01;
const MODE: usize = 0x02;
const CLOCK: usize = 0x03;
const GAIN1: usize = 0x04;
const GAIN2: usize = 0x05;
const CFG: usize = 0x06;
const CH0_CFG: usize = 0x09;
const LAST_WRITABLE: usize = 0x30;

const STATUS_LOCK: u16 = 1 << 15;
const STATUS_RESYNC: u16 = 1 << 14;
const STATUS_REG_MAP: u16 = 1 << 13;
const STATUS_CRC_ERR: u16 = 1 << 12;
const MODE_REG_CRC_EN: u16 = 1 << 13;
const MODE_RX_CRC_EN: u16 = 1 << 12;
const MODE_CRC_ANSI: u16 = 1 << 11;
const MODE_RESET: u16 = 1 << 10;

/// The content that the first words of the next frame hold.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Answer {
    Status,
    Word(u16),
    Registers { address: usize, count: usize },
}

/// The converter.
#[derive(Clone, Debug)]
pub struct Ads131m08 {
    registers: [u16; 64],
    data: [i32; CHANNELS],
    /// DRDYn bits: a conversion that has not been read.
    fresh: u8,
    locked: bool,
    standby: bool,
    crc_error: bool,
    /// F_RESYNC and REG_MAP, which a status that is sent clears.
    flags: u16,
    clock_hz: f64,
    answer: Answer,
    frames: u64,
    flips: Vec<(u64, usize)>,
    /// Conversions that wait behind the one in `data`; see [`Self::hold_two`].
    held: Option<Option<[i32; CHANNELS]>>,
    /// The bytes that are clocked out of the frame on its way, and those that have been clocked in.
    frame: Option<(Vec<u8>, Vec<u8>)>,
}

impl Default for Ads131m08 {
    fn default() -> Self {
        Self::new()
    }
}

impl Ads131m08 {
    /// Returns the converter as it comes out of power-on reset.
    pub fn new() -> Self {
        let mut device = Self {
            registers: [0; 64],
            data: [0; CHANNELS],
            fresh: 0,
            locked: false,
            standby: false,
            crc_error: false,
            flags: 0,
            clock_hz: CLOCK_HZ,
            answer: Answer::Word(0xFF28),
            frames: 0,
            flips: Vec::new(),
            held: None,
            frame: None,
        };
        device.reset();
        device
    }

    fn reset(&mut self) {
        self.registers = [0; 64];
        self.registers[ID] = 0x2800;
        self.registers[MODE] = 0x0510;
        self.registers[CLOCK] = 0xFF0E;
        self.registers[CFG] = 0x0600;
        for channel in 0..CHANNELS {
            self.registers[CH0_CFG + 5 * channel + 3] = 0x8000;
        }
        self.data = [0; CHANNELS];
        self.held = self.held.map(|_| None);
        (self.fresh, self.locked, self.standby, self.crc_error) = (0, false, false, false);
        self.flags = 0;
    }

    /// Returns how many frames have passed since power-on.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Inverts one bit on its way to the host: bit `bit` (0 is the first one on the wire) of the `ahead`-th
    /// frame from now (0 is the next).
    pub fn flip_bit(&mut self, ahead: u64, bit: usize) {
        self.flips.push((self.frames + ahead, bit));
    }

    /// Sets the frequency of the oscillator, Hz.
    pub fn set_clock_hz(&mut self, clock_hz: f64) {
        self.clock_hz = clock_hz;
    }

    /// Changes bits of a register, as a discharge may do it.
    pub fn disturb(&mut self, address: usize, bits: u16) {
        if let Some(register) = self.registers.get_mut(address) {
            *register ^= bits;
            self.note_registers();
        }
    }

    /// Gives a pulse to the SYNC pin: the filters begin anew.
    pub fn resynchronise(&mut self) {
        self.flags |= STATUS_RESYNC;
    }

    /// Gives the output buffer two levels, as the chip's (data sheet 8.5.1.9.1): a conversion that nobody has
    /// read waits behind the one before it, and a third takes the place of the second.
    pub fn hold_two(&mut self) {
        self.held = Some(None);
    }

    fn note_registers(&mut self) {
        if self.registers[MODE] & MODE_REG_CRC_EN != 0 {
            self.flags |= STATUS_REG_MAP;
        }
    }

    fn oversampling(&self) -> f64 {
        128.0 * f64::from(1u32 << ((self.registers[CLOCK] >> 2) & 7))
    }

    /// Conversions per second, as the CLOCK register says; `None` in standby.
    pub fn rate_hz(&self) -> Option<f64> {
        (!self.standby).then(|| 0.5 * self.clock_hz / self.oversampling())
    }

    /// Returns the group delay of the digital filter at the present OSR, s.
    pub fn group_delay_s(&self) -> f64 {
        Self::filter_delay_s(self.oversampling())
    }

    /// Returns the group delay at a data rate, s: `(3 (N − 1) / 2 + N (K − 1) / 2) / f_mod`, a sinc³ of N ≤
    /// 1024 followed by an average of K.
    pub fn group_delay_at_s(rate_hz: f64) -> f64 {
        Self::filter_delay_s(0.5 * CLOCK_HZ / rate_hz)
    }

    fn filter_delay_s(oversampling: f64) -> f64 {
        let n = oversampling.min(1024.0);
        let k = oversampling / n;
        (1.5 * (n - 1.0) + 0.5 * n * (k - 1.0)) / (0.5 * CLOCK_HZ)
    }

    fn gain(&self, channel: usize) -> f64 {
        let register = self.registers[if channel < 4 { GAIN1 } else { GAIN2 }];
        f64::from(1u32 << ((register >> (4 * (channel % 4))) & 7))
    }

    /// Ends a conversion of these voltages at the inputs.
    pub fn convert(&mut self, inputs_v: &[f64; CHANNELS]) {
        if self.standby {
            return;
        }
        let mut data = [0; CHANNELS];
        for (channel, volts) in inputs_v.iter().enumerate() {
            let enabled = self.registers[CLOCK] >> (8 + channel) & 1 == 1;
            data[channel] = if enabled { self.code(channel, *volts) } else { 0 };
        }
        match &mut self.held {
            Some(held) if self.fresh != 0 => {
                // Full: the oldest goes.
                if let Some(second) = held.replace(data) {
                    self.data = second;
                }
            }
            _ => self.data = data,
        }
        self.fresh = (self.registers[CLOCK] >> 8) as u8;
    }

    fn code(&self, channel: usize, volts: f64) -> i32 {
        let base = CH0_CFG + 5 * channel;
        let shorted = self.registers[base] & 3 == 1;
        let input = if shorted { 0.0 } else { volts };
        let raw = (input * self.gain(channel) / FULL_SCALE_V * 8_388_608.0)
            .round()
            .clamp(-8_388_608.0, 8_388_607.0);
        let wide = u32::from(self.registers[base + 1]) << 16 | u32::from(self.registers[base + 2]);
        let offset = f64::from((wide as i32) >> 8);
        let gain = u32::from(self.registers[base + 3]) << 8 | u32::from(self.registers[base + 4] >> 8);
        let calibrated = (raw - offset) * f64::from(gain) / 8_388_608.0;
        calibrated.round().clamp(-8_388_608.0, 8_388_607.0) as i32
    }

    fn status(&self) -> u16 {
        let mut word = self.registers[MODE] & 0x0F00 | u16::from(self.fresh) | self.flags;
        if self.locked {
            word |= STATUS_LOCK;
        }
        if self.crc_error {
            word |= STATUS_CRC_ERR;
        }
        word
    }

    fn read_register(&self, address: usize) -> u16 {
        match address {
            STATUS => self.status(),
            _ => self.registers.get(address).copied().unwrap_or(0),
        }
    }

    /// Returns the bytes of a word, as MODE's WLENGTH has it.
    fn word_bytes(&self) -> usize {
        match self.registers[MODE] >> 8 & 3 {
            0 => 2,
            1 => 3,
            _ => 4,
        }
    }

    fn crc(&self, bytes: &[u8]) -> u16 {
        crc16(if self.registers[MODE] & MODE_CRC_ANSI == 0 { 0x1021 } else { 0x8005 }, bytes)
    }

    /// Transfers one frame: `bytes` holds what the host sends and receives what the converter sends.
    pub fn transfer(&mut self, bytes: &mut [u8]) {
        self.select();
        for byte in bytes.iter_mut() {
            *byte = self.exchange(*byte);
        }
        self.deselect();
    }

    /// Lowers chip select: a frame begins.
    pub fn select(&mut self) {
        let mut output = self.output();
        for (_, bit) in self.flips.iter().filter(|(frame, _)| *frame == self.frames) {
            if let Some(byte) = output.get_mut(bit / 8) {
                *byte ^= 0x80 >> (bit % 8);
            }
        }
        self.flips.retain(|(frame, _)| *frame > self.frames);
        self.frames += 1;
        self.frame = Some((output, Vec::with_capacity(30)));
    }

    /// Takes a byte in and gives a byte out.
    pub fn exchange(&mut self, byte: u8) -> u8 {
        let Some((output, input)) = &mut self.frame else { return 0 };
        let answer = output.get(input.len()).copied().unwrap_or(0);
        input.push(byte);
        answer
    }

    /// Raises chip select: the command of the frame is carried out.
    pub fn deselect(&mut self) {
        if let Some((output, input)) = self.frame.take() {
            self.execute(&input, input.len() >= output.len());
        }
    }

    /// Returns the frame that is about to be clocked out.
    fn output(&mut self) -> Vec<u8> {
        let width = self.word_bytes();
        let mut out = Vec::with_capacity(10 * width);
        let mut push = |word: u16| {
            out.extend_from_slice(&word.to_be_bytes());
            out.resize(out.len() + width - 2, 0);
        };
        match self.answer {
            Answer::Status => push(self.status()),
            Answer::Word(word) => push(word),
            Answer::Registers { address, count } => {
                push(0xE000 | (address as u16) << 7 | (count as u16 - 1));
                for a in address..address + count {
                    push(self.read_register(a));
                }
            }
        }
        if self.answer == Answer::Status {
            (self.crc_error, self.flags) = (false, 0);
        }
        if !matches!(self.answer, Answer::Registers { .. }) {
            let sign_extended = self.registers[MODE] >> 8 & 3 == 3;
            for sample in self.data {
                let [top, a, b, c] = sample.to_be_bytes();
                match width {
                    2 => out.extend_from_slice(&[a, b]),
                    3 => out.extend_from_slice(&[a, b, c]),
                    _ if sign_extended => out.extend_from_slice(&[top, a, b, c]),
                    _ => out.extend_from_slice(&[a, b, c, 0]),
                }
            }
            // What waited behind it is next.
            match self.held.as_mut().and_then(Option::take) {
                Some(second) => self.data = second,
                None => self.fresh = 0,
            }
        }
        let check = self.crc(&out);
        out.extend_from_slice(&check.to_be_bytes());
        out.resize(out.len() + width - 2, 0);
        out
    }

    fn execute(&mut self, input: &[u8], whole_frame: bool) {
        let width = self.word_bytes();
        let word = |i: usize| match input.get(i * width..i * width + 2) {
            Some(&[high, low]) => Some(u16::from_be_bytes([high, low])),
            _ => None,
        };
        self.answer = Answer::Status;
        let Some(command) = word(0) else { return };
        let (address, count) = (usize::from(command >> 7 & 0x3F), usize::from(command & 0x7F) + 1);
        let writes = command >> 13 == 0b011;
        // The check word follows the command and what it writes.
        let covered = if writes { 1 + count } else { 1 };
        if self.registers[MODE] & MODE_RX_CRC_EN != 0 {
            let sent = word(covered);
            if sent.is_none() || sent != input.get(..covered * width).map(|b| self.crc(b)) {
                self.crc_error = true;
                // A write is carried out all the same (data sheet 8.3.12); nothing else is.
                if !writes {
                    return;
                }
            }
        }
        match command {
            0x0000 => {}
            0x0655 => {
                self.locked = false;
                self.answer = Answer::Word(command);
            }
            _ if command >> 13 == 0b101 => {
                self.answer = match count {
                    1 => Answer::Word(self.read_register(address)),
                    _ => Answer::Registers { address, count },
                };
            }
            _ if self.locked => {}
            0x0011 if whole_frame => {
                self.reset();
                self.answer = Answer::Word(0xFF28);
            }
            0x0011 | 0x0022 | 0x0033 | 0x0555 => {
                self.standby = command == 0x0022 || (self.standby && command != 0x0033);
                self.locked = command == 0x0555;
                self.answer = Answer::Word(command);
            }
            _ if writes => {
                let mut written = 0;
                for i in 0..count {
                    let (Some(value), true) = (word(1 + i), (MODE..=LAST_WRITABLE).contains(&(address + i)))
                    else {
                        break;
                    };
                    self.write_register(address + i, value);
                    written = i;
                }
                if !self.crc_error {
                    self.answer = Answer::Word(0x4000 | (address as u16) << 7 | written as u16);
                }
            }
            _ => {}
        }
    }

    fn write_register(&mut self, address: usize, value: u16) {
        // MODE's RESET bit can only be cleared.
        let sticky = if address == MODE { !MODE_RESET | self.registers[MODE] } else { !0 };
        if let Some(register) = self.registers.get_mut(address) {
            *register = value & sticky;
            self.note_registers();
        }
    }
}

/// Returns CRC-16, seed 0xFFFF, most significant bit first.
fn crc16(polynomial: u16, bytes: &[u8]) -> u16 {
    let mut crc = 0xFFFF_u16;
    for byte in bytes {
        crc ^= u16::from(*byte) << 8;
        for _ in 0..8 {
            crc = if crc & 0x8000 != 0 { crc << 1 ^ polynomial } else { crc << 1 };
        }
    }
    crc
}

#[cfg(test)]
#[path = "ads131m08_tests.rs"]
mod tests;
