//! A frame of a tree in motion, as a source of frames clocks it out: from motion capture and force plates say.
//!
//! | part | bytes | |
//! |---|---|---|
//! | mark | 2 | `F7 3E` |
//! | version | 1 | 1 |
//! | links | 1 | n, the base included |
//! | number | 4 | little-endian, one more with every frame |
//! | base | 60 | 15 f32 LE: wrench (6, N and N m, on the base at S), specific force (3), rate (3), its derivative (3), in S |
//! | each further link | 40 | 10 f32 LE: attitude `R_SL` (w, x, y, z), rate (3), its derivative (3), in the link's axes |
//! | CRC-32 | 4 | little-endian, ISO-HDLC, over everything before it |
//!
//! At 15 links and 100 frames a second 63 kB/s: a serial line of 1 Mbit/s holds it, 115200 do not.

use crc::{CRC_32_ISO_HDLC, Crc};

use super::links::MAX_LINKS;

const MARK: [u8; 2] = [0xF7, 0x3E];
const VERSION: u8 = 1;
/// Bytes before the numbers.
const HEADER: usize = 8;
const CHECK: usize = 4;
/// Numbers of the base.
pub const BASE_NUMBERS: usize = 15;
/// Numbers of every further link.
pub const LINK_NUMBERS: usize = 10;
/// Bytes of the longest frame.
pub const MAX_TREE_FRAME: usize = tree_frame_bytes(MAX_LINKS);

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Bytes of a frame of so many links.
pub const fn tree_frame_bytes(links: usize) -> usize {
    HEADER + 4 * (BASE_NUMBERS + LINK_NUMBERS * links.saturating_sub(1)) + CHECK
}

/// Tells why bytes are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeFrameError {
    /// Too short, another mark or version, or the check does not fit.
    Damaged,
    /// It has so many links, and others were expected.
    Links(u8),
}

/// A frame whose check fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeFrame<'a> {
    /// Its number.
    pub number: u32,
    /// Wrench, specific force, rate, angular acceleration.
    pub base: [f32; BASE_NUMBERS],
    links: &'a [u8],
}

impl<'a> TreeFrame<'a> {
    /// The frame that `bytes` begin with, of a tree of so many links.
    ///
    /// # Errors
    /// [`TreeFrameError`]; that of another tree is told apart although its end may not have been clocked.
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
        let frame = bytes.get(..tree_frame_bytes(links)).ok_or(DAMAGED)?;
        let (body, check) = frame.split_last_chunk::<CHECK>().ok_or(DAMAGED)?;
        if CRC32.checksum(body) != u32::from_le_bytes(*check) {
            return Err(DAMAGED);
        }
        let (base, links) =
            body.get(HEADER..).and_then(|b| b.split_at_checked(4 * BASE_NUMBERS)).ok_or(DAMAGED)?;
        Ok(Self { number: u32::from_le_bytes(*number), base: numbers(base), links })
    }

    /// The numbers of the links after the base: attitude, rate, angular acceleration.
    pub fn links(&self) -> impl Iterator<Item = [f32; LINK_NUMBERS]> + '_ {
        self.links.as_chunks::<{ 4 * LINK_NUMBERS }>().0.iter().map(|link| numbers(link))
    }

    /// Writes a frame into `out`; how many bytes of it are used. `None` if it does not fit or there are too many links.
    pub fn encode(
        number: u32,
        base: &[f32; BASE_NUMBERS],
        links: &[[f32; LINK_NUMBERS]],
        out: &mut [u8],
    ) -> Option<usize> {
        let count = u8::try_from(links.len() + 1).ok().filter(|n| usize::from(*n) <= MAX_LINKS)?;
        let length = tree_frame_bytes(usize::from(count));
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
    fn a_frame_comes_back_and_every_damaged_one_is_told() {
        let base = core::array::from_fn(|k| k as f32 - 7.5);
        let links: [[f32; LINK_NUMBERS]; 2] =
            core::array::from_fn(|i| core::array::from_fn(|k| (10 * i + k) as f32 * 0.125));
        let mut bytes = [0; MAX_TREE_FRAME];
        let n = TreeFrame::encode(0x0102_0304, &base, &links, &mut bytes).unwrap();
        assert_eq!((n, n), (tree_frame_bytes(3), 8 + 60 + 80 + 4));
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
        assert_eq!(tree_frame_bytes(15), 632);
    }
}
