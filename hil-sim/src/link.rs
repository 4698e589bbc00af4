//! A serial line that misbehaves.
//!
//! Lives here: [`FaultyLink`], a wrapper around any byte link that drops, flips, duplicates and delays what
//! passes, from a seed. May not live here: what the bytes mean; the one thing it knows is that a zero byte
//! ends a frame. Next:
//! [`crate::runner`], whose microcontrollers it can wrap.

use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A byte stream in both directions.
pub trait ByteLink {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// Any error of the line; bytes that were sent cannot be taken back.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Takes what has arrived, at most `buffer.len()` bytes, waiting up to `timeout` for the first. 0:
    /// nothing arrived. With an empty buffer nothing is taken, and the other end goes on for `timeout`.
    ///
    /// # Errors
    /// Any error of the line.
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize>;
}

impl<L: ByteLink + ?Sized> ByteLink for Box<L> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        (**self).read(buffer, timeout)
    }
}

/// The frequencies of faults, as probabilities from 0 to 1, the same in both directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkFaults {
    /// A byte vanishes.
    pub drop_byte: f64,
    /// One bit of a byte is inverted.
    pub flip_bit: f64,
    /// A byte comes twice.
    pub duplicate_byte: f64,
    /// A frame vanishes.
    pub drop_frame: f64,
    /// A frame comes twice.
    pub duplicate_frame: f64,
    /// A frame is overtaken by the next one.
    pub delay_frame: f64,
}

impl LinkFaults {
    /// Returns faults of a line on which everything happens, each to one frame in `n` or to one byte in
    /// `100 n`.
    pub fn one_in(n: u32) -> Self {
        let frame = 1.0 / f64::from(n.max(1));
        let byte = 0.01 * frame;
        Self {
            drop_byte: byte,
            flip_bit: byte,
            duplicate_byte: byte,
            drop_frame: frame,
            duplicate_frame: frame,
            delay_frame: frame,
        }
    }
}

/// The faults so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkStatistics {
    /// Bytes that passed through, before faults.
    pub bytes: u64,
    /// Frames that passed through, before faults.
    pub frames: u64,
    /// Bytes that vanished.
    pub dropped_bytes: u64,
    /// Bits that were inverted.
    pub flipped_bits: u64,
    /// Bytes that arrived twice.
    pub duplicated_bytes: u64,
    /// Frames that vanished.
    pub dropped_frames: u64,
    /// Frames that arrived twice.
    pub duplicated_frames: u64,
    /// Frames that were overtaken.
    pub delayed_frames: u64,
}

/// One direction of the line.
#[derive(Debug)]
struct Direction {
    rng: ChaCha8Rng,
    /// The frame under way.
    frame: Vec<u8>,
    held: Option<Vec<u8>>,
    statistics: LinkStatistics,
}

impl Direction {
    fn new(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self { rng, frame: Vec::new(), held: None, statistics: LinkStatistics::default() }
    }

    fn happens(&mut self, probability: f64) -> bool {
        // 53 random bits as a number in [0, 1).
        let unit = (self.rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        unit < probability
    }

    /// Passes `bytes` on to `out`. Frames go on when they are whole.
    fn pass(&mut self, faults: &LinkFaults, bytes: &[u8], out: &mut impl Extend<u8>) {
        for &byte in bytes {
            self.frame.push(byte);
            if byte == 0 {
                self.end_of_frame(faults, out);
            }
        }
    }

    fn end_of_frame(&mut self, faults: &LinkFaults, out: &mut impl Extend<u8>) {
        self.statistics.frames += 1;
        self.statistics.bytes += self.frame.len() as u64;
        let whole = std::mem::take(&mut self.frame);
        let mut frame = Vec::with_capacity(whole.len());
        for mut byte in whole {
            if self.happens(faults.drop_byte) {
                self.statistics.dropped_bytes += 1;
                continue;
            }
            if self.happens(faults.flip_bit) {
                self.statistics.flipped_bits += 1;
                byte ^= 1 << (self.rng.next_u32() % 8);
            }
            if self.happens(faults.duplicate_byte) {
                self.statistics.duplicated_bytes += 1;
                frame.push(byte);
            }
            frame.push(byte);
        }
        if self.happens(faults.drop_frame) {
            self.statistics.dropped_frames += 1;
            frame.clear();
        }
        if self.happens(faults.duplicate_frame) && !frame.is_empty() {
            self.statistics.duplicated_frames += 1;
            frame.extend_from_within(..);
        }
        // A held frame goes out behind the one that overtook it.
        match self.held.take() {
            Some(late) => out.extend(frame.into_iter().chain(late)),
            None if !frame.is_empty() && self.happens(faults.delay_frame) => {
                self.statistics.delayed_frames += 1;
                self.held = Some(frame);
            }
            None => out.extend(frame),
        }
    }
}

/// A line with faults in both directions. A frame is only passed on when its closing zero has been seen.
#[derive(Debug)]
pub struct FaultyLink<L> {
    inner: L,
    faults: LinkFaults,
    outward: Direction,
    inward: Direction,
    arrived: VecDeque<u8>,
}

impl<L: ByteLink> FaultyLink<L> {
    /// Wraps `inner`. The same seed and traffic give the same faults.
    pub fn new(inner: L, faults: LinkFaults, seed: u64) -> Self {
        let (outward, inward) = (Direction::new(seed, 0), Direction::new(seed, 1));
        Self { inner, faults, outward, inward, arrived: VecDeque::new() }
    }

    /// Sets the faults from now on.
    pub fn set_faults(&mut self, faults: LinkFaults) {
        self.faults = faults;
    }

    /// Returns what has gone wrong: on the way out, on the way in.
    pub fn statistics(&self) -> (LinkStatistics, LinkStatistics) {
        (self.outward.statistics, self.inward.statistics)
    }

    /// Returns the line inside.
    pub fn inner(&mut self) -> &mut L {
        &mut self.inner
    }
}

impl<L: ByteLink> ByteLink for FaultyLink<L> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut out = Vec::with_capacity(bytes.len());
        self.outward.pass(&self.faults, bytes, &mut out);
        if out.is_empty() { Ok(()) } else { self.inner.write(&out) }
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if buffer.is_empty() {
            return self.inner.read(buffer, timeout);
        }
        let deadline = Instant::now() + timeout;
        while self.arrived.is_empty() {
            let mut chunk = vec![0; buffer.len().max(64)];
            let left = deadline.saturating_duration_since(Instant::now());
            let n = self.inner.read(&mut chunk, left)?;
            if n == 0 {
                // Silence: what was held back comes now, late but whole.
                self.arrived.extend(self.inward.held.take().into_iter().flatten());
                break;
            }
            self.inward.pass(&self.faults, &chunk[..n], &mut self.arrived);
        }
        let n = buffer.len().min(self.arrived.len());
        for (to, from) in buffer.iter_mut().zip(self.arrived.drain(..n)) {
            *to = from;
        }
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives back what was written.
    #[derive(Debug, Default)]
    struct Echo(VecDeque<u8>);

    impl ByteLink for Echo {
        fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.0.extend(bytes);
            Ok(())
        }

        fn read(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<usize> {
            let n = buffer.len().min(self.0.len());
            buffer.iter_mut().zip(self.0.drain(..n)).for_each(|(to, from)| *to = from);
            Ok(n)
        }
    }

    fn frames(count: u8) -> Vec<u8> {
        (1..=count).flat_map(|k| [k, k ^ 0x55 | 1, 0xA5, k, 0]).collect()
    }

    fn through(faults: LinkFaults, seed: u64, sent: &[u8]) -> (Vec<u8>, LinkStatistics, LinkStatistics) {
        let mut link = FaultyLink::new(Echo::default(), faults, seed);
        let (mut got, mut buffer) = (Vec::new(), [0; 7]);
        for piece in sent.chunks(11) {
            link.write(piece).unwrap();
        }
        for _ in 0..2000 {
            let n = link.read(&mut buffer, Duration::ZERO).unwrap();
            got.extend_from_slice(&buffer[..n]);
        }
        let (outward, inward) = link.statistics();
        (got, outward, inward)
    }

    #[test]
    fn without_faults_every_byte_passes_in_order() {
        let sent = frames(200);
        assert_eq!(through(LinkFaults::default(), 1, &sent).0, sent);
    }

    #[test]
    fn the_same_seed_makes_the_same_faults() {
        let (sent, faults) = (frames(200), LinkFaults::one_in(10));
        assert_eq!(through(faults, 3, &sent), through(faults, 3, &sent));
        assert_ne!(through(faults, 3, &sent).0, through(faults, 4, &sent).0);
    }

    #[test]
    fn every_kind_of_fault_happens_about_as_often_as_asked() {
        let sent: Vec<u8> = frames(250).repeat(4);
        let (_, out, _) = through(LinkFaults::one_in(10), 5, &sent);
        // 1000 frames at 1/10: 100 expected, standard deviation 9.5; 5000 bytes at 1/1000: 5 expected.
        assert_eq!((out.frames, out.bytes), (1000, 5000));
        assert!((60..140).contains(&out.dropped_frames), "{out:?}");
        assert!((50..130).contains(&out.duplicated_frames), "{out:?}");
        assert!((40..130).contains(&out.delayed_frames), "{out:?}");
        assert!(out.dropped_bytes > 0 && out.flipped_bits > 0 && out.duplicated_bytes > 0, "{out:?}");
    }

    #[test]
    fn a_delayed_frame_is_overtaken_by_one_and_never_lost() {
        let faults = LinkFaults { delay_frame: 1.0, ..LinkFaults::default() };
        // Out and in, every odd frame waits for the next: twice swapped is straight again.
        let sent = frames(4);
        let (got, out, inward) = through(faults, 1, &sent);
        assert_eq!((out.delayed_frames, inward.delayed_frames), (2, 2));
        assert_eq!(got, sent);
        let mut link = FaultyLink::new(Echo::default(), faults, 1);
        link.write(&[1, 0, 2, 0]).unwrap();
        assert_eq!(link.inner().0, [2, 0, 1, 0]);
    }
}
