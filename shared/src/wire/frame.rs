//! Frames: COBS, header, CRC-32. No I/O; bytes in, frames out.

use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::messages::PROTOCOL_VERSION;

/// The longest payload.
pub const MAX_PAYLOAD: usize = 1024;
const HEADER: usize = 4;
const CHECK: usize = 4;
const MAX_RAW: usize = HEADER + MAX_PAYLOAD + CHECK;
/// The longest frame on the line: one COBS code byte in 254, and the closing zero.
pub const MAX_FRAME: usize = MAX_RAW + MAX_RAW.div_ceil(254) + 1;

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Tells what a frame carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Host to device; answered once.
    Command = 0,
    /// Device to host, in answer to a command.
    Answer = 1,
    /// Device to host, unasked.
    Telemetry = 2,
    /// Host to device: a frame of a robot that is watched ([`super::watch_frame`]). Never answered.
    Stream = 3,
}

/// Tells why bytes between two zeros are not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecodeError {
    /// More bytes than the longest frame.
    TooLong,
    /// The bytes are not COBS, or shorter than header and check.
    Malformed,
    /// The check does not fit: a byte was lost or changed.
    Check,
    /// The other side speaks another protocol version.
    Version(u8),
    /// The kind is unknown.
    UnknownKind(u8),
    /// The payload is not the message it should be.
    Payload,
}

/// A message does not fit into a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge;

/// A checked frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Tells what it carries.
    pub kind: Kind,
    /// The frame's number in its series.
    pub sequence: u16,
    /// The frame's payload: a message in postcard, or a frame of a robot that is watched.
    pub payload: &'a [u8],
}

impl Frame<'_> {
    /// Returns the message in the payload.
    ///
    /// # Errors
    /// [`DecodeError::Payload`] if it is not a whole message of this type.
    pub fn message<M: DeserializeOwned>(&self) -> Result<M, DecodeError> {
        match postcard::take_from_bytes(self.payload) {
            Ok((message, [])) => Ok(message),
            _ => Err(DecodeError::Payload),
        }
    }
}

/// Writes a frame into `out`. Returns the number of bytes that are used.
///
/// # Errors
/// [`TooLarge`] if the payload or the frame does not fit.
pub fn encode<M: Serialize>(
    kind: Kind,
    sequence: u16,
    message: &M,
    out: &mut [u8],
) -> Result<usize, TooLarge> {
    let mut raw = [0_u8; MAX_RAW];
    let payload = raw.get_mut(HEADER..HEADER + MAX_PAYLOAD).ok_or(TooLarge)?;
    let length = postcard::to_slice(message, payload).map_err(|_| TooLarge)?.len();
    finish(kind, sequence, &mut raw, length, out)
}

/// Writes a frame with this payload into `out` and returns how many bytes of it are used.
///
/// # Errors
/// [`TooLarge`] if the payload or the frame does not fit.
pub fn encode_payload(kind: Kind, sequence: u16, payload: &[u8], out: &mut [u8]) -> Result<usize, TooLarge> {
    let mut raw = [0_u8; MAX_RAW];
    let place = raw.get_mut(HEADER..HEADER + MAX_PAYLOAD).and_then(|all| all.get_mut(..payload.len()));
    place.ok_or(TooLarge)?.copy_from_slice(payload);
    finish(kind, sequence, &mut raw, payload.len(), out)
}

/// Puts header and check around a payload of this length, and writes the frame into `out`.
fn finish(
    kind: Kind,
    sequence: u16,
    raw: &mut [u8; MAX_RAW],
    payload: usize,
    out: &mut [u8],
) -> Result<usize, TooLarge> {
    let [low, high] = sequence.to_le_bytes();
    if let Some(header) = raw.first_chunk_mut::<HEADER>() {
        *header = [PROTOCOL_VERSION, kind as u8, low, high];
    }
    let used = HEADER + payload;
    let check = CRC32.checksum(raw.get(..used).ok_or(TooLarge)?);
    raw.get_mut(used..used + CHECK).ok_or(TooLarge)?.copy_from_slice(&check.to_le_bytes());
    let raw = raw.get(..used + CHECK).ok_or(TooLarge)?;
    if out.len() < cobs::max_encoding_length(raw.len()) + 1 {
        return Err(TooLarge);
    }
    let length = cobs::encode(raw, out);
    *out.get_mut(length).ok_or(TooLarge)? = 0;
    Ok(length + 1)
}

/// Collects bytes until a zero ends a frame.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    incoming: Vec<u8, MAX_FRAME>,
    /// The last frame, which the caller borrows.
    decoded: Vec<u8, MAX_FRAME>,
    overflow: bool,
}

impl Decoder {
    /// Returns a decoder at the start of a frame.
    #[must_use]
    pub const fn new() -> Self {
        Self { incoming: Vec::new(), decoded: Vec::new(), overflow: false }
    }

    /// Takes a byte. At the end of a frame, the frame or what is wrong with it; zeros between frames are
    /// nothing.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame<'_>, DecodeError>> {
        if byte != 0 {
            if self.incoming.push(byte).is_err() {
                self.overflow = true;
            }
            return None;
        }
        core::mem::swap(&mut self.incoming, &mut self.decoded);
        self.incoming.clear();
        if core::mem::take(&mut self.overflow) {
            return Some(Err(DecodeError::TooLong));
        }
        if self.decoded.is_empty() {
            return None;
        }
        Some(decode(&mut self.decoded))
    }
}

fn decode(encoded: &mut [u8]) -> Result<Frame<'_>, DecodeError> {
    let length = cobs::decode_in_place(encoded).map_err(|_| DecodeError::Malformed)?;
    let raw = encoded.get(..length).ok_or(DecodeError::Malformed)?;
    let (body, sum) = raw.split_last_chunk::<CHECK>().ok_or(DecodeError::Malformed)?;
    let ([version, kind, low, high], payload) =
        body.split_first_chunk::<HEADER>().ok_or(DecodeError::Malformed)?;
    if CRC32.checksum(body) != u32::from_le_bytes(*sum) {
        return Err(DecodeError::Check);
    }
    if *version != PROTOCOL_VERSION {
        return Err(DecodeError::Version(*version));
    }
    let kind = match kind {
        0 => Kind::Command,
        1 => Kind::Answer,
        2 => Kind::Telemetry,
        3 => Kind::Stream,
        other => return Err(DecodeError::UnknownKind(*other)),
    };
    Ok(Frame { kind, sequence: u16::from_le_bytes([*low, *high]), payload })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::messages::{Command, Reply};

    fn frame(sequence: u16) -> ([u8; MAX_FRAME], usize) {
        let mut out = [0; MAX_FRAME];
        let n = encode(Kind::Command, sequence, &Command::Heartbeat, &mut out).unwrap();
        (out, n)
    }

    fn decoded(decoder: &mut Decoder, bytes: &[u8]) -> std::vec::Vec<Result<(Kind, u16), DecodeError>> {
        bytes.iter().filter_map(|b| decoder.push(*b).map(|r| r.map(|f| (f.kind, f.sequence)))).collect()
    }

    #[test]
    fn encoded_messages_are_decoded() {
        let (bytes, n) = frame(0x00ff);
        assert!(bytes[..n - 1].iter().all(|b| *b != 0));
        let mut decoder = Decoder::new();
        let mut message = None;
        for byte in &bytes[..n] {
            if let Some(frame) = decoder.push(*byte) {
                message = Some(frame.unwrap().message::<Command>().unwrap());
            }
        }
        assert_eq!(message, Some(Command::Heartbeat));
    }

    #[test]
    fn every_single_changed_or_lost_byte_is_noticed_and_the_next_frame_is_whole() {
        let (bytes, n) = frame(7);
        let (next, m) = frame(8);
        for position in 0..n {
            for change in [0x01_u8, 0x80, 0xff] {
                let mut damaged = bytes[..n].to_vec();
                damaged[position] ^= change;
                damaged.extend(&next[..m]);
                let seen = decoded(&mut Decoder::new(), &damaged);
                assert!(!seen.contains(&Ok((Kind::Command, 7))), "{position}");
                // A changed closing zero runs two frames into one.
                assert!(position == n - 1 || seen.last() == Some(&Ok((Kind::Command, 8))), "{position}");
            }
            let mut lost = bytes[..n].to_vec();
            lost.remove(position);
            lost.push(0);
            lost.extend(&next[..m]);
            let seen = decoded(&mut Decoder::new(), &lost);
            assert_eq!(seen.last(), Some(&Ok((Kind::Command, 8))));
            assert!(position == n - 1 || !seen.contains(&Ok((Kind::Command, 7))));
        }
    }

    #[test]
    fn endless_garbage_is_one_error() {
        let mut decoder = Decoder::new();
        assert!(decoded(&mut decoder, &[0x55; 5 * MAX_FRAME]).is_empty());
        assert_eq!(decoded(&mut decoder, &[0]), [Err(DecodeError::TooLong)]);
        let (bytes, n) = frame(1);
        assert_eq!(decoded(&mut decoder, &bytes[..n]), [Ok((Kind::Command, 1))]);
    }

    #[test]
    fn another_version_is_distinguished_from_a_damaged_frame() {
        let raw = [PROTOCOL_VERSION + 1, 0, 0, 0];
        let mut body = raw.to_vec();
        body.extend(CRC32.checksum(&raw).to_le_bytes());
        let mut line = [0; 32];
        let n = cobs::encode(&body, &mut line);
        assert_eq!(
            decoded(&mut Decoder::new(), &line[..=n]),
            [Err(DecodeError::Version(PROTOCOL_VERSION + 1))]
        );
    }

    #[test]
    fn a_payload_with_bytes_left_over_is_refused() {
        let frame = Frame { kind: Kind::Answer, sequence: 0, payload: &[0, 0, 0, 0, 0, 0] };
        assert_eq!(frame.message::<Reply>().err(), Some(DecodeError::Payload));
    }

    extern crate std;
}
