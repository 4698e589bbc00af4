//! A frame of a tree in motion, as a source of frames clocks it out: from motion capture and force plates
//! say.
//!
//! | part | bytes | |
//! |---|---|---|
//! | mark | 2 | `F7 3E` |
//! | version | 1 | 1: the base carries an IMU ([`TreeFrame`]); 2: cameras track the base ([`TrackedFrame`]) |
//! | links | 1 | n, the base included |
//! | number | 4 | little-endian, one more with every frame |
//! | base, version 1 | 60 | 15 f32 LE: wrench (6, N and N m, on the base at S), specific force (3), rate (3), its derivative (3), in S |
//! | base, version 2 | 64 | 16 f32 LE: wrench (6, N and N m, at the base's origin), velocity of that origin (3, m/s), both in the laboratory's axes (z up); attitude (w, x, y, z), rate (3) as of a further link |
//! | base, version 2, on springs | 64 | 16 f32 LE, axes of the platform at rest: shift of O (3, m), vector of the turn (3, rad), velocity of O (3, m/s); the platform's attitude (w, x, y, z) and rate (3) in its own axes |
//! | each further link, version 1 | 40 | 10 f32 LE: attitude `R_SL` (w, x, y, z), rate (3), its derivative (3), in the link's axes |
//! | each further link, version 2 | 28 | 7 f32 LE: attitude (w, x, y, z), laboratory's axes from the link's, rate (3) in the link's axes |
//! | CRC-32 | 4 | little-endian, ISO-HDLC, over everything before it |
//!
//! At 15 links and 100 frames a second 63 kB/s, tracked 47 kB/s: a serial line of 1 Mbit/s holds it, 115200
//! do not.

use crc::{CRC_32_ISO_HDLC, Crc};

use super::links::MAX_LINKS;

const MARK: [u8; 2] = [0xF7, 0x3E];
/// Bytes before the numbers.
const HEADER: usize = 8;
const CHECK: usize = 4;
/// Numbers of the base.
pub const BASE_NUMBERS: usize = 15;
/// Numbers of every further link.
pub const LINK_NUMBERS: usize = 10;
/// Numbers of a base that is tracked.
pub const TRACKED_BASE_NUMBERS: usize = 16;
/// Numbers of every further link of a tree whose base is tracked.
pub const TRACKED_LINK_NUMBERS: usize = 7;
/// Bytes of the longest frame.
pub const MAX_TREE_FRAME: usize = TreeFrame::bytes(MAX_LINKS);

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A frame of a tree whose base carries an IMU.
pub type TreeFrame<'a> = NumberedFrame<'a, 1, BASE_NUMBERS, LINK_NUMBERS>;
/// A frame of a tree whose base cameras track: positions and rates alone.
pub type TrackedFrame<'a> = NumberedFrame<'a, 2, TRACKED_BASE_NUMBERS, TRACKED_LINK_NUMBERS>;

/// Tells why bytes are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeFrameError {
    /// The frame is too short, has another mark or version, or its check does not fit.
    Damaged,
    /// The frame has this number of links, and others were expected.
    Links(u8),
}

/// A frame whose check fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NumberedFrame<'a, const VERSION: u8, const BASE: usize, const LINK: usize> {
    /// The frame's number.
    pub number: u32,
    /// The base's.
    pub base: [f32; BASE],
    links: &'a [u8],
}

impl<'a, const VERSION: u8, const BASE: usize, const LINK: usize> NumberedFrame<'a, VERSION, BASE, LINK> {
    /// Returns the bytes of a frame of the given number of links.
    pub const fn bytes(links: usize) -> usize {
        HEADER + 4 * (BASE + LINK * links.saturating_sub(1)) + CHECK
    }

    /// Returns the frame that `bytes` begin with, of a tree of the given number of links.
    ///
    /// # Errors
    /// [`TreeFrameError`]; that of another tree is distinguished although its end may not have been clocked.
    pub fn decode(bytes: &'a [u8], links: usize) -> Result<Self, TreeFrameError> {
        const DAMAGED: TreeFrameError = TreeFrameError::Damaged;
        let ([m0, m1, version, count, number @ ..], _) =
            bytes.split_first_chunk::<HEADER>().ok_or(DAMAGED)?;
        if [*m0, *m1] != MARK || *version != VERSION {
            return Err(DAMAGED);
        }
        if usize::from(*count) != links {
            return Err(TreeFrameError::Links(*count));
        }
        let frame = bytes.get(..Self::bytes(links)).ok_or(DAMAGED)?;
        let (body, check) = frame.split_last_chunk::<CHECK>().ok_or(DAMAGED)?;
        if CRC32.checksum(body) != u32::from_le_bytes(*check) {
            return Err(DAMAGED);
        }
        let (base, links) = body.get(HEADER..).and_then(|b| b.split_at_checked(4 * BASE)).ok_or(DAMAGED)?;
        Ok(Self { number: u32::from_le_bytes(*number), base: numbers(base), links })
    }

    /// Returns the numbers of the links after the base.
    pub fn links(&self) -> impl Iterator<Item = [f32; LINK]> + '_ {
        self.links.chunks_exact(4 * LINK).map(numbers)
    }

    /// Writes a frame into `out`. Returns the number of bytes that are used. `None` if it does not fit or
    /// there are too many links.
    pub fn encode(number: u32, base: &[f32; BASE], links: &[[f32; LINK]], out: &mut [u8]) -> Option<usize> {
        let count = u8::try_from(links.len() + 1).ok().filter(|n| usize::from(*n) <= MAX_LINKS)?;
        let length = Self::bytes(usize::from(count));
        let (body, check) = out.get_mut(..length)?.split_last_chunk_mut::<CHECK>()?;
        let (header, rest) = body.split_first_chunk_mut::<HEADER>()?;
        let [m0, m1] = MARK;
        let [a, b, c, d] = number.to_le_bytes();
        *header = [m0, m1, VERSION, count, a, b, c, d];
        let values = base.iter().chain(links.as_flattened());
        for (slot, value) in rest.as_chunks_mut::<4>().0.iter_mut().zip(values) {
            *slot = value.to_le_bytes();
        }
        *check = CRC32.checksum(body).to_le_bytes();
        Some(length)
    }
}

fn numbers<const N: usize>(bytes: &[u8]) -> [f32; N] {
    let mut out = [0.0; N];
    for (number, bytes) in out.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *number = f32::from_le_bytes(*bytes);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_comes_back_and_every_damaged_one_is_refused() {
        let base = core::array::from_fn(|k| k as f32 - 7.5);
        let links: [[f32; LINK_NUMBERS]; 2] =
            core::array::from_fn(|i| core::array::from_fn(|k| (10 * i + k) as f32 * 0.125));
        let mut bytes = [0; MAX_TREE_FRAME];
        let n = TreeFrame::encode(0x0102_0304, &base, &links, &mut bytes).unwrap();
        assert_eq!((n, n), (TreeFrame::bytes(3), 8 + 60 + 80 + 4));
        assert_eq!(bytes[..8], [0xF7, 0x3E, 1, 3, 4, 3, 2, 1]);
        let frame = TreeFrame::decode(&bytes, 3).unwrap();
        assert_eq!((frame.number, frame.base), (0x0102_0304, base));
        assert!(frame.links().eq(links));
        assert_eq!(TreeFrame::decode(&bytes, 4), Err(TreeFrameError::Links(3)));
        assert_eq!(TreeFrame::decode(&bytes[..n - 1], 3), Err(TreeFrameError::Damaged));
        for bit in 0..8 * n {
            let mut damaged = bytes;
            damaged[bit / 8] ^= 1 << (bit % 8);
            let wrong = TreeFrame::decode(&damaged, 3).unwrap_err();
            assert!((24..32).contains(&bit) || wrong == TreeFrameError::Damaged, "{bit}");
        }
        assert_eq!(TreeFrame::encode(0, &base, &[[0.0; LINK_NUMBERS]; 16], &mut bytes), None);
        assert_eq!((TreeFrame::bytes(15), TrackedFrame::bytes(15)), (632, 468));
    }

    #[test]
    fn frames_of_another_kind_are_recognised_by_their_version() {
        let base: [f32; TRACKED_BASE_NUMBERS] = core::array::from_fn(|k| k as f32 - 7.5);
        let links = [core::array::from_fn(|k| k as f32 * 0.125); 14];
        let mut bytes = [0; MAX_TREE_FRAME];
        let n = TrackedFrame::encode(7, &base, &links, &mut bytes).unwrap();
        let frame = TrackedFrame::decode(&bytes[..n], 15).unwrap();
        assert_eq!((frame.number, frame.base, frame.links().count()), (7, base, 14));
        assert!(frame.links().eq(links));
        assert_eq!(TreeFrame::decode(&bytes, 15), Err(TreeFrameError::Damaged));
    }
}
