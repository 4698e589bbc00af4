//! The form of a record in flash: a header that says who wrote it, a payload, a check sum.
//!
//! | part | bytes | |
//! |---|---|---|
//! | magic | 4 | `RGST` |
//! | kind | 1 | 1 settings, 2 checkpoint |
//! | format | 1 | `FORMAT` |
//! | length | 2 | of the payload |
//! | schema | 8 | of the messages and of what is recorded |
//! | firmware | 4 | CRC-32 of the firmware's sources |
//! | run | 4 | number of the run |
//! | payload | | postcard; of a checkpoint, numbers of the factor behind it |
//! | CRC-32 | 4 | ISO-HDLC, over everything before it |
//!
//! Numbers are little-endian. Magic, format, length and CRC are outside of postcard, so that a record of any
//! other firmware is distinguished from a damaged one.

use crc::{CRC_32_ISO_HDLC, Crc};

/// Bytes before the payload.
pub(crate) const HEADER_BYTES: usize = 24;
/// Bytes after it.
const CHECK_BYTES: usize = 4;
/// Bytes of the longest record: a checkpoint of two links with the wrench offset.
pub const RECORD_BYTES: usize = 1792;
/// Version of the header.
const FORMAT: u8 = 1;
const MAGIC: [u8; 4] = *b"RGST";

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Tells what a record holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordKind {
    /// The settings of a run.
    Settings = 1,
    /// The rows absorbed up to some reading.
    Checkpoint = 2,
}

/// Tells who wrote a record: only what the same firmware wrote is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Writer {
    /// The schema of the messages and of what is recorded.
    pub schema: u64,
    /// CRC-32 of the firmware's sources.
    pub firmware: u32,
}

/// Tells why bytes are no record to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordError {
    /// The bytes are not what was written, or never were a record.
    Damaged,
    /// Other firmware wrote it; CRC-32 of its sources.
    OtherFirmware(u32),
}

/// A record that was found whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<'a> {
    /// Number of the run.
    pub run: u32,
    /// The payload.
    pub payload: &'a [u8],
}

/// Makes a record around the first `length` bytes that follow the header in `bytes`. `None` if there is no
/// room.
pub fn seal(bytes: &mut [u8], kind: RecordKind, writer: Writer, run: u32, length: usize) -> Option<&[u8]> {
    let end = HEADER_BYTES.checked_add(length)?;
    let [m, a, g, c] = MAGIC;
    let [low, high] = u16::try_from(length).ok()?.to_le_bytes();
    let first = [m, a, g, c, kind as u8, FORMAT, low, high];
    let rest = writer.schema.to_le_bytes().into_iter().chain(writer.firmware.to_le_bytes());
    let header = first.into_iter().chain(rest).chain(run.to_le_bytes());
    bytes.get_mut(..HEADER_BYTES)?.iter_mut().zip(header).for_each(|(slot, byte)| *slot = byte);
    let check = CRC32.checksum(bytes.get(..end)?).to_le_bytes();
    bytes.get_mut(end..)?.first_chunk_mut::<CHECK_BYTES>().map(|slot| *slot = check)?;
    bytes.get(..end + CHECK_BYTES)
}

/// Reads a record of this kind.
///
/// # Errors
/// [`RecordError`] says why not.
pub fn open(bytes: &[u8], kind: RecordKind, writer: Writer) -> Result<Record<'_>, RecordError> {
    let whole = bytes.split_last_chunk::<CHECK_BYTES>().filter(|(body, check)| {
        let length = body.get(6..8).and_then(|length| length.try_into().ok()).map(u16::from_le_bytes);
        body.starts_with(&MAGIC)
            && length.is_some_and(|length| HEADER_BYTES + usize::from(length) == body.len())
            && CRC32.checksum(body).to_le_bytes() == **check
    });
    let (header, payload) =
        whole.and_then(|(body, _)| body.split_first_chunk::<HEADER_BYTES>()).ok_or(RecordError::Damaged)?;
    let [_, _, _, _, of_kind, format, _, _, rest @ ..] = *header;
    let [s0, s1, s2, s3, s4, s5, s6, s7, f0, f1, f2, f3, run @ ..] = rest;
    let found = Writer {
        schema: u64::from_le_bytes([s0, s1, s2, s3, s4, s5, s6, s7]),
        firmware: u32::from_le_bytes([f0, f1, f2, f3]),
    };
    if format != FORMAT || found != writer {
        return Err(RecordError::OtherFirmware(found.firmware));
    }
    if of_kind != kind as u8 {
        return Err(RecordError::Damaged);
    }
    Ok(Record { run: u32::from_le_bytes(run), payload })
}

#[cfg(test)]
mod tests {
    use super::*;

    const WRITER: Writer = Writer { schema: 0x0102_0304_0506_0708, firmware: 0xA0B0_C0D0 };

    fn record() -> ([u8; 64], usize) {
        let mut bytes = [0; 64];
        bytes[HEADER_BYTES..HEADER_BYTES + 5].copy_from_slice(b"hello");
        let length = seal(&mut bytes, RecordKind::Settings, WRITER, 7, 5).unwrap().len();
        (bytes, length)
    }

    #[test]
    fn a_record_comes_back() {
        let (bytes, length) = record();
        let opened = open(&bytes[..length], RecordKind::Settings, WRITER);
        assert_eq!(opened, Ok(Record { run: 7, payload: b"hello" }));
        assert_eq!(&bytes[..8], b"RGST\x01\x01\x05\x00");
    }

    #[test]
    fn any_changed_bit_and_any_lost_byte_is_damage() {
        let (bytes, length) = record();
        for bit in 0..8 * length {
            let mut bytes = bytes;
            bytes[bit / 8] ^= 1 << (bit % 8);
            let opened = open(&bytes[..length], RecordKind::Settings, WRITER);
            assert_eq!(opened, Err(RecordError::Damaged), "bit {bit}");
        }
        for short in 0..length {
            assert_eq!(open(&bytes[..short], RecordKind::Settings, WRITER), Err(RecordError::Damaged));
        }
    }

    #[test]
    fn a_record_of_another_build_or_kind_is_not_read() {
        let (bytes, length) = record();
        let by = |writer| open(&bytes[..length], RecordKind::Settings, writer);
        assert_eq!(by(Writer { firmware: 1, ..WRITER }), Err(RecordError::OtherFirmware(WRITER.firmware)));
        assert_eq!(by(Writer { schema: 1, ..WRITER }), Err(RecordError::OtherFirmware(WRITER.firmware)));
        assert_eq!(open(&bytes[..length], RecordKind::Checkpoint, WRITER), Err(RecordError::Damaged));
    }
}
