//! Numbers in three processors' formats.

use super::error::C3dError;

/// The processor that wrote the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Processor {
    /// Little-endian, IEEE.
    Intel,
    /// Little-endian, floating numbers as a VAX has them.
    Dec,
    /// Big-endian, IEEE.
    Mips,
}

impl Processor {
    pub(super) fn of(code: u8) -> Option<Self> {
        match code {
            84 => Some(Self::Intel),
            85 => Some(Self::Dec),
            86 => Some(Self::Mips),
            _ => None,
        }
    }

    /// Returns who that is.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Intel => "Intel",
            Self::Dec => "DEC",
            Self::Mips => "MIPS (SGI)",
        }
    }

    /// Returns whether the header's frame rate is one in this format.
    pub(super) fn fits(self, head: &[u8]) -> bool {
        let rate = Bytes { file: head, processor: self }.f32(20, "the header");
        rate.is_ok_and(|rate| (1.0..100_000.0).contains(&rate))
    }
}

/// A file and how to read its numbers.
#[derive(Clone, Copy)]
pub(super) struct Bytes<'a> {
    pub(super) file: &'a [u8],
    pub(super) processor: Processor,
}

impl<'a> Bytes<'a> {
    /// Returns the given number of bytes from a place on.
    pub(super) fn slice(
        file: &'a [u8],
        at: usize,
        count: usize,
        what: &'static str,
    ) -> Result<&'a [u8], C3dError> {
        at.checked_add(count).and_then(|end| file.get(at..end)).ok_or(C3dError::Truncated {
            what,
            needed: (at as u64).saturating_add(count as u64),
            bytes: file.len() as u64,
        })
    }

    fn array<const N: usize>(&self, at: usize, what: &'static str) -> Result<[u8; N], C3dError> {
        let mut array = [0; N];
        array.copy_from_slice(Self::slice(self.file, at, N, what)?);
        Ok(array)
    }

    pub(super) fn u8(&self, at: usize, what: &'static str) -> Result<u8, C3dError> {
        self.array::<1>(at, what).map(|[byte]| byte)
    }

    pub(super) fn u16(&self, at: usize, what: &'static str) -> Result<u16, C3dError> {
        let array = self.array(at, what)?;
        Ok(if self.processor == Processor::Mips {
            u16::from_be_bytes(array)
        } else {
            u16::from_le_bytes(array)
        })
    }

    pub(super) fn i16(&self, at: usize, what: &'static str) -> Result<i16, C3dError> {
        self.u16(at, what).map(|word| word as i16)
    }

    pub(super) fn f32(&self, at: usize, what: &'static str) -> Result<f32, C3dError> {
        let array: [u8; 4] = self.array(at, what)?;
        Ok(match self.processor {
            Processor::Intel => f32::from_le_bytes(array),
            Processor::Mips => f32::from_be_bytes(array),
            // The upper word comes first, and the exponent counts from two more.
            Processor::Dec => {
                let [a, b, c, d] = array;
                f32::from_le_bytes([c, d, a, b]) / 4.0
            }
        })
    }
}
