//! Sensors that cost next to nothing: registers that hold values, and samples made beforehand.

use core::convert::Infallible;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use rigident_shared::wire::tree_frame::{
    LINK_NUMBERS, MAX_TREE_FRAME, TRACKED_LINK_NUMBERS, TrackedFrame, TreeFrame,
};
#[cfg(feature = "watch")]
use rigident_shared::wire::{Kind, WatchFrame, encode_payload, watch_frame::MAX_WATCH_FRAME};

/// Different samples, gone through again and again.
const SAMPLES: usize = 64;
const ADC_FRAME: usize = 30;
const IMU_ANSWER: usize = 24;

/// An ADS131M08.
pub struct Adc {
    registers: [u16; 64],
    /// Tells what the next frame begins with, if not a status.
    answer: Option<u16>,
    frames: [[u8; ADC_FRAME]; SAMPLES],
    next: usize,
}

impl Adc {
    pub fn new() -> Self {
        let mut registers = [0; 64];
        registers[0] = 0x2808;
        let frames = core::array::from_fn(|k| {
            let mut frame = [0; ADC_FRAME];
            // Status: words of 24 bits, a fresh sample on every channel.
            frame[..2].copy_from_slice(&0x01FF_u16.to_be_bytes());
            for (channel, word) in frame.as_chunks_mut::<3>().0[1..9].iter_mut().enumerate() {
                let code = wave(k, 11 + 2 * channel) + 700_000 * i32::from(channel == 2);
                let [_, a, b, c] = code.to_be_bytes();
                *word = [a, b, c];
            }
            sealed(frame)
        });
        Self { registers, answer: None, frames, next: 0 }
    }

    fn exchange(&mut self, frame: &mut [u8; ADC_FRAME]) {
        let command = u16::from_be_bytes([frame[0], frame[1]]);
        let address = usize::from(command >> 7 & 63);
        let reply = self.answer.take();
        match command >> 13 {
            0b101 => self.answer = Some(self.registers[address]),
            0b011 => {
                self.registers[address] = u16::from_be_bytes([frame[3], frame[4]]);
                self.answer = Some(0b010 << 13 | command & 0x1FFF);
            }
            _ if command == 0x0011 => self.answer = Some(0xFF28),
            _ => {}
        }
        *frame = match reply {
            Some(word) => {
                let mut frame = [0; ADC_FRAME];
                frame[..2].copy_from_slice(&word.to_be_bytes());
                sealed(frame)
            }
            None => {
                self.next = (self.next + 1) % SAMPLES;
                self.frames[self.next]
            }
        };
    }
}

impl ErrorType for Adc {
    type Error = Infallible;
}

impl SpiDevice for Adc {
    fn transaction(&mut self, parts: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        if let [Operation::TransferInPlace(bytes)] = parts
            && let Some(frame) = bytes.first_chunk_mut()
        {
            self.exchange(frame);
        }
        Ok(())
    }
}

/// An ICM-42688-P.
pub struct Imu {
    registers: [u8; 128],
    answers: [[u8; IMU_ANSWER]; SAMPLES],
    next: usize,
}

const WHO_AM_I: usize = 0x75;
/// First of interrupt status, FIFO count and FIFO, which are read in one go.
const INT_STATUS: u8 = 0x2D;

impl Imu {
    pub fn new() -> Self {
        let mut registers = [0; 128];
        registers[WHO_AM_I] = 0x47;
        let answers = core::array::from_fn(|k| {
            let mut bytes = [0; IMU_ANSWER];
            // Watermark reached, 20 bytes, a packet with accelerometer and gyro in 20 bits.
            bytes[1..5].copy_from_slice(&[0x04, 0, 20, 0b0111_1000]);
            for (axis, word) in bytes[5..17].as_chunks_mut::<2>().0.iter_mut().enumerate() {
                let code = wave(k, 31 + 2 * axis) / 64 + 2000 * i32::from(axis == 2);
                *word = (code as i16).to_be_bytes();
            }
            bytes
        });
        Self { registers, answers, next: 0 }
    }
}

impl ErrorType for Imu {
    type Error = Infallible;
}

impl SpiDevice for Imu {
    fn transaction(&mut self, parts: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        if let [Operation::TransferInPlace(bytes)] = &mut *parts
            && bytes.first() == Some(&(0x80 | INT_STATUS))
            && let Some(sample) = bytes.first_chunk_mut()
        {
            self.next = (self.next + 1) % SAMPLES;
            *sample = self.answers[self.next];
            return Ok(());
        }
        // A register address, then values that are written or read.
        let mut address = None;
        for part in parts {
            let (out, back): (&[u8], &mut [u8]) = match part {
                Operation::Write(out) => (out, &mut []),
                Operation::Read(back) => (&[], back),
                Operation::Transfer(back, out) => (out, back),
                Operation::TransferInPlace(both) => {
                    for byte in both.iter_mut() {
                        self.clock(&mut address, byte);
                    }
                    continue;
                }
                Operation::DelayNs(_) => continue,
            };
            for k in 0..out.len().max(back.len()) {
                let mut byte = out.get(k).copied().unwrap_or(0);
                self.clock(&mut address, &mut byte);
                if let Some(slot) = back.get_mut(k) {
                    *slot = byte;
                }
            }
        }
        Ok(())
    }
}

impl Imu {
    fn clock(&mut self, address: &mut Option<u8>, byte: &mut u8) {
        let Some(at) = address else {
            *address = Some(*byte);
            return;
        };
        let register = &mut self.registers[usize::from(*at & 0x7F)];
        if *at & 0x80 != 0 {
            *byte = *register;
        } else {
            *register = *byte;
        }
        *at = *at & 0x80 | (*at + 1) & 0x7F;
    }
}

/// Different frames, gone through again and again: more than a case takes, so that their numbers follow one
/// another.
pub const FRAMES: usize = 96;
/// Links of the human.
pub const TREE_LINKS: usize = 15;
/// Links of the humanoid that is watched.
#[cfg(feature = "watch")]
pub const WATCHED_LINKS: usize = 30;
/// RAM of the board outside of what the firmware is allowed: a real source of frames has its own.
const FRAMES_AT: usize = 0x2180_0000;

/// A source of frames of a human in motion.
pub struct Frames {
    frames: &'static [[u8; MAX_TREE_FRAME]; FRAMES],
    next: usize,
}

impl Frames {
    /// Returns room for the frames.
    fn place() -> &'static mut [[u8; MAX_TREE_FRAME]; FRAMES] {
        let place = FRAMES_AT as *mut [[u8; MAX_TREE_FRAME]; FRAMES];
        // SAFETY: the board has RAM there, nothing is linked to it, bytes need no alignment, and no other
        // reference into it is in use. It is written before it is referred to.
        unsafe {
            place.write_bytes(0, 1);
            &mut *place
        }
    }

    pub fn new(tracked: bool) -> Self {
        let frames = Self::place();
        let mut state = 11_u32;
        // In [−1, 1).
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 9) as f32 / 4_194_304.0 - 1.0
        };
        for (number, frame) in frames.iter_mut().enumerate() {
            let base: [f32; 15] = core::array::from_fn(|k| random() * if k < 6 { 100.0 } else { 4.0 });
            let links: [[f32; LINK_NUMBERS]; TREE_LINKS] = core::array::from_fn(|_| {
                // A rotation from its half tangents.
                let [x, y, z] = [random(), random(), random()];
                let n2 = 1.0 + x * x + y * y + z * z;
                // Heron's root from above.
                let mut root = 0.5 * (1.0 + n2);
                for _ in 0..6 {
                    root = 0.5 * (root + n2 / root);
                }
                let mut link = [0.0; LINK_NUMBERS];
                link[..4].copy_from_slice(&[1.0 / root, x / root, y / root, z / root]);
                link[4..].fill_with(|| 3.0 * random());
                link
            });
            let (number, [first, others @ ..]) = (number as u32, &links);
            if tracked {
                let poses =
                    others.map(|link| core::array::from_fn::<_, TRACKED_LINK_NUMBERS, _>(|k| link[k]));
                let base = core::array::from_fn(|k| if k < 9 { base[k] } else { first[k - 9] });
                let _ = TrackedFrame::encode(number, &base, &poses, frame);
            } else {
                let _ = TreeFrame::encode(number, &base, others, frame);
            }
        }
        Self { frames, next: 0 }
    }
}

/// Frames of a humanoid that is watched, as they are on the line, gone through again and again.
#[cfg(feature = "watch")]
pub struct Streamed {
    lines: &'static [[u8; MAX_TREE_FRAME]; FRAMES],
    next: usize,
}

#[cfg(feature = "watch")]
impl Streamed {
    /// Makes the frames: each number is a different triangle wave, as of a motion. Sequence numbers go round
    /// with the frames: each is newer than the last.
    pub fn new() -> Self {
        const STEP: usize = (1 << 16) / FRAMES;
        let lines = Frames::place();
        for (number, line) in lines.iter_mut().enumerate() {
            let swing = |k: usize, size: f32| size * wave(number, 31 + 2 * k) as f32 / 2e5;
            let imu = core::array::from_fn(|k| swing(k, 3.0) + if k == 2 { 9.8 } else { 0.0 });
            let feet: [[f32; 6]; 2] = core::array::from_fn(|foot| {
                core::array::from_fn(|k| match k {
                    2 => 300.0 + swing(6 * foot + 8, 100.0),
                    _ => swing(6 * foot + 6 + k, 3.0),
                })
            });
            let joints: [[f32; 2]; WATCHED_LINKS - 1] =
                core::array::from_fn(|k| [swing(2 * k, 1.5), swing(2 * k + 1, 4.0)]);
            let mut payload = [0; MAX_WATCH_FRAME];
            let length = WatchFrame::encode(number as u32, &imu, &feet, &joints, &mut payload).unwrap_or(0);
            let _ = encode_payload(Kind::Stream, (STEP * number) as u16, &payload[..length], line);
        }
        Self { lines, next: 0 }
    }

    /// Returns the next frame, up to its zero.
    pub fn next(&mut self) -> &'static [u8] {
        let line = &self.lines[self.next];
        self.next = (self.next + 1) % FRAMES;
        let end = line.iter().position(|byte| *byte == 0).unwrap_or(0);
        &line[..=end]
    }
}

impl ErrorType for Frames {
    type Error = Infallible;
}

impl SpiDevice for Frames {
    fn transaction(&mut self, parts: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        if let [Operation::TransferInPlace(bytes)] = parts {
            self.next = (self.next + 1) % FRAMES;
            let length = bytes.len();
            bytes.copy_from_slice(&self.frames[self.next][..length]);
        }
        Ok(())
    }
}

/// Nothing is waited for.
pub struct NoWait;

impl DelayNs for NoWait {
    fn delay_ns(&mut self, _: u32) {}
}

/// Returns a triangle of ±2e5, in codes.
fn wave(k: usize, period: usize) -> i32 {
    let phase = ((k * 7 + period) % period) as i32;
    400_000 * phase / period as i32 - 200_000
}

/// Returns a frame with its CRC-16-CCITT.
fn sealed(mut frame: [u8; ADC_FRAME]) -> [u8; ADC_FRAME] {
    let (body, check) = frame.split_at_mut(ADC_FRAME - 3);
    let crc = body.iter().fold(0xFFFF_u16, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |c, _| c << 1 ^ if c >> 15 == 1 { 0x1021 } else { 0 })
    });
    check[..2].copy_from_slice(&crc.to_be_bytes());
    frame
}
