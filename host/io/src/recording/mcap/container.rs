//! The MCAP container, read from beginning to end, as far as it goes.
//!
//! A recording that was cut off (power, a full disk, a killed program) has no footer and no index, and its
//! last record is torn. So nothing here needs them: records are taken in their order, a torn or damaged one
//! is noted, and everything whole is given out.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Read;

/// First and last eight bytes of an MCAP file.
pub const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', 0x30, b'\r', b'\n'];

/// A chunk that claims to unpack to more than this is damaged or hostile.
const LARGEST_CHUNK: u64 = 1 << 28;
/// All chunks of a file together unpack to no more than this, or to this many times the file's length:
/// sensors are noisy, and noise does not pack.
const LARGEST_TOTAL: u64 = 1 << 28;
const MOST_PACKED: u64 = 64;
const CRC: crc::Crc<u32, crc::Table<16>> = crc::Crc::<u32, crc::Table<16>>::new(&crc::CRC_32_ISO_HDLC);

/// A chunk says its length twice: a damaged length of its record does not hide what follows.
const MISFRAMED: &str = "the length of a chunk is damaged";

mod opcode {
    pub const HEADER: u8 = 0x01;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const ATTACHMENT: u8 = 0x09;
    pub const METADATA: u8 = 0x0C;
    pub const DATA_END: u8 = 0x0F;
}

/// A stream of messages of one type.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Channel {
    /// Topic.
    pub topic: String,
    /// Name of the message type; empty if the channel has none.
    pub schema: String,
    /// Encoding of the messages, `cdr` for ROS 2.
    pub encoding: String,
    /// The number of its type in a file that numbers types.
    pub(super) schema_id: u16,
}

/// A message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Message<'a> {
    /// Key of its channel in [`Contents::channels`].
    pub channel: u16,
    /// The time of recording, ns.
    pub log_time: u64,
    /// The message as it is encoded.
    pub data: &'a [u8],
}

/// The data of a file or of unpacked chunks, as records borrow them.
#[derive(Debug, Default)]
pub struct Unpacked<'a> {
    sections: Vec<Cow<'a, [u8]>>,
    header: Option<(String, String)>,
    attachments: Vec<(String, Cow<'a, [u8]>)>,
    metadata: Vec<(String, Vec<(String, String)>)>,
    damage: Vec<String>,
    complete: bool,
}

/// Everything in a file.
#[derive(Debug, Default)]
pub struct Contents<'u> {
    /// Profile of the header, `ros2` for bags.
    pub profile: &'u str,
    /// Program that wrote it.
    pub library: &'u str,
    /// Channels by their number.
    pub channels: HashMap<u16, Channel>,
    /// Messages in the order of the file.
    pub messages: Vec<Message<'u>>,
    /// Attachments by name.
    pub attachments: Vec<(&'u str, &'u [u8])>,
    /// Metadata records: name, then keys and values.
    pub metadata: &'u [(String, Vec<(String, String)>)],
    /// The damaged parts that were skipped.
    pub damage: Vec<String>,
    /// The recording was ended by its writer.
    pub complete: bool,
}

/// The bytes do not begin as an MCAP file does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("it does not begin as an MCAP file does")]
pub struct NotMcap;

/// Takes fields off the front of a record.
#[derive(Debug, Clone, Copy)]
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, length: u64) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(usize::try_from(length).ok()?)?;
        self.0 = rest;
        Some(taken)
    }

    fn u16(&mut self) -> Option<u16> {
        self.bytes(2)?.try_into().ok().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.bytes(4)?.try_into().ok().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.bytes(8)?.try_into().ok().map(u64::from_le_bytes)
    }

    fn text(&mut self) -> Option<&'a str> {
        let length = self.u32()?;
        std::str::from_utf8(self.bytes(u64::from(length))?).ok()
    }

    fn map(&mut self) -> Option<Vec<(String, String)>> {
        let length = self.u32()?;
        let mut entries = Fields(self.bytes(u64::from(length))?);
        let mut map = Vec::new();
        while !entries.0.is_empty() {
            map.push((entries.text()?.to_owned(), entries.text()?.to_owned()));
        }
        Some(map)
    }

    /// Returns opcode and content of the next record; `None` at the end, or where it is torn.
    fn record(&mut self) -> Option<(u8, Fields<'a>)> {
        let mut ahead = *self;
        let opcode = *ahead.bytes(1)?.first()?;
        let length = ahead.u64()?;
        let content = ahead.bytes(length)?;
        *self = ahead;
        Some((opcode, Fields(content)))
    }
}

impl<'a> Unpacked<'a> {
    /// Unpacks the chunks of a file.
    ///
    /// # Errors
    /// It is not an MCAP file.
    pub fn new(file: &'a [u8]) -> Result<Self, NotMcap> {
        let mut rest = Fields(file.strip_prefix(&MAGIC).ok_or(NotMcap)?);
        let mut unpacked = Self::default();
        let mut room = LARGEST_TOTAL.max((file.len() as u64).saturating_mul(MOST_PACKED));
        loop {
            let before = rest;
            let Some((op, mut fields)) = rest.record() else {
                let Some((records, after)) = misframed_chunk(before, &mut room) else { break };
                unpacked.damage.push(MISFRAMED.to_owned());
                unpacked.sections.push(records);
                rest = after;
                continue;
            };
            match op {
                opcode::HEADER => {
                    unpacked.header =
                        fields.text().zip(fields.text()).map(|(p, l)| (p.to_owned(), l.to_owned()));
                }
                opcode::CHUNK => match chunk(fields, &mut room) {
                    Ok(records) => unpacked.sections.push(records),
                    Err(reason) => match misframed_chunk(before, &mut room) {
                        Some((records, after)) => {
                            unpacked.damage.push(MISFRAMED.to_owned());
                            unpacked.sections.push(records);
                            rest = after;
                        }
                        None => unpacked.damage.push(reason),
                    },
                },
                opcode::ATTACHMENT => match attachment(fields) {
                    Some(found) => unpacked.attachments.push(found),
                    None => unpacked.damage.push("an attachment is damaged".to_owned()),
                },
                opcode::METADATA => match fields.text().map(str::to_owned).zip(fields.map()) {
                    Some(found) => unpacked.metadata.push(found),
                    None => unpacked.damage.push("a metadata record is damaged".to_owned()),
                },
                opcode::DATA_END => unpacked.complete = true,
                _ => {}
            }
        }
        // Schemas, channels and messages outside of chunks: the file itself is a section too.
        unpacked.sections.insert(0, Cow::Borrowed(file.get(MAGIC.len()..).unwrap_or_default()));
        Ok(unpacked)
    }

    /// Returns what the records say.
    pub fn contents(&self) -> Contents<'_> {
        let mut schemas = HashMap::new();
        let mut contents = Contents {
            attachments: self.attachments.iter().map(|(name, data)| (name.as_str(), &**data)).collect(),
            metadata: &self.metadata,
            damage: self.damage.clone(),
            complete: self.complete,
            ..Contents::default()
        };
        if let Some((profile, library)) = &self.header {
            (contents.profile, contents.library) = (profile, library);
        }
        let mut unreadable = 0_usize;
        for section in &self.sections {
            let mut rest = Fields(section);
            while let Some((op, fields)) = rest.record() {
                let read = match op {
                    opcode::SCHEMA => schema(fields).map(|(id, name)| {
                        schemas.insert(id, name);
                    }),
                    opcode::CHANNEL => channel(fields).map(|(id, channel)| {
                        contents.channels.insert(id, channel);
                    }),
                    opcode::MESSAGE => message(fields).map(|message| contents.messages.push(message)),
                    _ => Some(()),
                };
                unreadable += usize::from(read.is_none());
            }
        }
        for channel in contents.channels.values_mut() {
            if let Some(name) = schemas.get(&channel.schema_id) {
                channel.schema.clone_from(name);
            }
        }
        let before = contents.messages.len();
        let channels = &contents.channels;
        contents.messages.retain(|message| channels.contains_key(&message.channel));
        let homeless = before - contents.messages.len();
        if unreadable > 0 {
            contents.damage.push(format!("{unreadable} records are damaged"));
        }
        if homeless > 0 {
            contents.damage.push(format!("{homeless} messages belong to no channel"));
        }
        contents
    }
}

fn schema(mut fields: Fields<'_>) -> Option<(u16, String)> {
    Some((fields.u16()?, fields.text()?.to_owned()))
}

fn channel(mut fields: Fields<'_>) -> Option<(u16, Channel)> {
    let (id, schema_id) = (fields.u16()?, fields.u16()?);
    let topic = fields.text()?.to_owned();
    let encoding = fields.text()?.to_owned();
    Some((id, Channel { topic, schema: String::new(), encoding, schema_id }))
}

fn message(mut fields: Fields<'_>) -> Option<Message<'_>> {
    let channel = fields.u16()?;
    fields.u32()?;
    let log_time = fields.u64()?;
    fields.u64()?;
    Some(Message { channel, log_time, data: fields.0 })
}

fn attachment(mut fields: Fields<'_>) -> Option<(String, Cow<'_, [u8]>)> {
    let whole = fields.0;
    fields.u64()?;
    fields.u64()?;
    let name = fields.text()?.to_owned();
    fields.text()?;
    let length = fields.u64()?;
    let data = fields.bytes(length)?;
    let checked = whole.len() - fields.0.len();
    let crc = fields.u32()?;
    (crc == 0 || crc == CRC.checksum(whole.get(..checked)?)).then_some((name, Cow::Borrowed(data)))
}

/// Returns the records in a chunk, unpacked and checked. The unpacked bytes are taken off the `room`.
fn chunk<'a>(mut fields: Fields<'a>, room: &mut u64) -> Result<Cow<'a, [u8]>, String> {
    let damaged = || "a chunk is damaged".to_owned();
    let mut head = || {
        fields.u64()?;
        fields.u64()?;
        let (size, crc, compression) = (fields.u64()?, fields.u32()?, fields.text()?);
        let length = fields.u64()?;
        let packed = fields.bytes(length)?;
        // Bytes after it are another record's: the length of this one is wrong.
        fields.0.is_empty().then_some((size, crc, compression, packed))
    };
    let (size, crc, compression, packed) = head().ok_or_else(damaged)?;
    if !compression.is_empty() {
        if size > LARGEST_CHUNK.min(*room) {
            return Err(format!("a chunk claims to hold {size} bytes"));
        }
        *room -= size;
    }
    let records = match compression {
        "" => Cow::Borrowed(packed),
        "zstd" => Cow::Owned(
            zstd::Decoder::with_buffer(packed)
                .map_err(|_| damaged())
                .and_then(|decoder| read_all(decoder, size))?,
        ),
        "lz4" => Cow::Owned(read_all(lz4_flex::frame::FrameDecoder::new(packed), size)?),
        other => return Err(format!("a chunk is packed by {other:?}, which is not known here")),
    };
    if records.len() as u64 != size || (crc != 0 && crc != CRC.checksum(&records)) {
        return Err("a chunk is damaged: its check sum does not fit".to_owned());
    }
    Ok(records)
}

fn read_all(packed: impl Read, size: u64) -> Result<Vec<u8>, String> {
    let mut records = Vec::new();
    packed
        .take(size + 1)
        .read_to_end(&mut records)
        .map_err(|e| format!("a chunk cannot be unpacked: {e}"))?;
    Ok(records)
}

/// Returns a chunk whose record has no credible length, by the length inside it, and the bytes after it.
fn misframed_chunk<'a>(rest: Fields<'a>, room: &mut u64) -> Option<(Cow<'a, [u8]>, Fields<'a>)> {
    let mut fields = rest;
    if fields.bytes(1)? != [opcode::CHUNK] {
        return None;
    }
    fields.u64()?;
    let content = fields;
    fields.u64()?;
    fields.u64()?;
    fields.u64()?;
    fields.u32()?;
    fields.text()?;
    let length = fields.u64()?;
    fields.bytes(length)?;
    let content = content.0.get(..content.0.len() - fields.0.len())?;
    chunk(Fields(content), room).ok().map(|records| (records, fields))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(op: u8, content: &[u8]) -> Vec<u8> {
        let mut bytes = vec![op];
        bytes.extend((content.len() as u64).to_le_bytes());
        bytes.extend(content);
        bytes
    }

    fn text(text: &str) -> Vec<u8> {
        let mut bytes = (text.len() as u32).to_le_bytes().to_vec();
        bytes.extend(text.as_bytes());
        bytes
    }

    /// Returns a schema, a channel, and a message of three bytes.
    fn records() -> Vec<u8> {
        let schema = [&[7, 0][..], &text("some/msg/Type"), &text("ros2msg"), &text("string data\n")].concat();
        let channel = [&[3, 0, 7, 0][..], &text("/topic"), &text("cdr"), &0_u32.to_le_bytes()].concat();
        let message =
            [&[3, 0][..], &1_u32.to_le_bytes(), &42_u64.to_le_bytes(), &42_u64.to_le_bytes(), b"abc"]
                .concat();
        [record(0x03, &schema), record(0x04, &channel), record(0x05, &message)].concat()
    }

    fn chunk_record(compression: &str, plain: &[u8], packed: &[u8]) -> Vec<u8> {
        let content = [
            &[0; 16][..],
            &(plain.len() as u64).to_le_bytes(),
            &CRC.checksum(plain).to_le_bytes(),
            &text(compression),
            &(packed.len() as u64).to_le_bytes(),
            packed,
        ]
        .concat();
        record(0x06, &content)
    }

    fn file(sections: &[Vec<u8>]) -> Vec<u8> {
        let header = [text("ros2"), text("somebody")].concat();
        [MAGIC.to_vec(), record(0x01, &header), sections.concat(), record(0x0F, &[0; 4]), MAGIC.to_vec()]
            .concat()
    }

    fn has_the_message(bytes: &[u8]) -> bool {
        let unpacked = Unpacked::new(bytes).unwrap();
        let contents = unpacked.contents();
        matches!(contents.messages[..], [Message { channel: 3, log_time: 42, data: b"abc" }])
            && contents.channels[&3].topic == "/topic"
            && contents.channels[&3].schema == "some/msg/Type"
    }

    #[test]
    fn messages_are_found_with_and_without_chunks_and_packing() {
        let plain = records();
        let lz4 = {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            std::io::Write::write_all(&mut encoder, &plain).unwrap();
            encoder.finish().unwrap()
        };
        let zstd = zstd::encode_all(&plain[..], 1).unwrap();
        for section in [
            plain.clone(),
            chunk_record("", &plain, &plain),
            chunk_record("lz4", &plain, &lz4),
            chunk_record("zstd", &plain, &zstd),
        ] {
            let bytes = file(&[section]);
            assert!(has_the_message(&bytes));
            let unpacked = Unpacked::new(&bytes).unwrap();
            assert!(unpacked.complete && unpacked.contents().profile == "ros2");
        }
    }

    #[test]
    fn a_torn_file_gives_its_whole_part() {
        let plain = records();
        let whole = file(&[chunk_record("", &plain, &plain), chunk_record("", &plain, &plain)]);
        let chunk = chunk_record("", &plain, &plain).len();
        let header = MAGIC.len() + 9 + 4 + "ros2".len() + 4 + "somebody".len();
        for cut in MAGIC.len()..header + 2 * chunk {
            let unpacked = Unpacked::new(&whole[..cut]).unwrap();
            assert!(!unpacked.complete);
            let whole_chunks = cut.saturating_sub(header) / chunk;
            assert_eq!(unpacked.contents().messages.len(), whole_chunks, "{cut}");
        }
        assert_eq!(Unpacked::new(b"t_s,fx_n\n").unwrap_err(), NotMcap);
    }

    #[test]
    fn a_flipped_bit_in_a_chunk_is_noticed() {
        let plain = records();
        let mut bytes = file(&[chunk_record("", &plain, &plain)]);
        let end = bytes.len() - 30;
        bytes[end] ^= 1;
        let unpacked = Unpacked::new(&bytes).unwrap();
        assert!(unpacked.contents().messages.is_empty());
        assert!(unpacked.contents().damage[0].contains("check sum"));
    }

    #[test]
    fn a_damaged_length_of_a_chunk_hides_nothing() {
        let plain = records();
        for byte in 0..8 {
            for value in [0, 1, 0x7F, 0xFF] {
                let mut first = chunk_record("", &plain, &plain);
                first[1 + byte] ^= value;
                let bytes = file(&[first, chunk_record("", &plain, &plain)]);
                assert_eq!(Unpacked::new(&bytes).unwrap().contents().messages.len(), 2, "{byte} {value}");
            }
        }
    }

    #[test]
    fn chunks_that_unpack_to_a_multitude_are_refused_together() {
        // Each is within the limit of one chunk and hardly takes room in the file.
        let zeros = vec![0; LARGEST_TOTAL as usize / 4];
        let packed = zstd::encode_all(&zeros[..], 1).unwrap();
        assert!(packed.len() < zeros.len() / 1000);
        let bytes = file(&vec![chunk_record("zstd", &zeros, &packed); 6]);
        let unpacked = Unpacked::new(&bytes).unwrap();
        let held: usize = unpacked.sections.iter().map(|s| s.len()).sum();
        assert!(held <= LARGEST_TOTAL as usize + bytes.len());
        assert_eq!(unpacked.damage.len(), 2);
    }

    #[test]
    fn lengths_beyond_the_file_are_no_danger() {
        let bomb = chunk_record("zstd", &[], &[]);
        for at in 0..bomb.len() {
            let mut section = bomb.clone();
            section[at] = 0xFF;
            let bytes = file(&[section]);
            let _ = Unpacked::new(&bytes).unwrap().contents();
        }
    }
}
