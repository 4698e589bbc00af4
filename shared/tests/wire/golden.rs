//! One golden frame per message: what is on the line, byte by byte.
//!
//! `OVERWRITE_GOLDENS=1 cargo test -p rigident-shared --test wire` writes them anew; a difference is
//! then a change of the wire and belongs into CHANGELOG.md.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::{env, fs};

use crate::samples::{self, Message, samples};
use postcard_schema::Schema;
use postcard_schema::schema::DataModelType;
use rigident_shared::wire::frame::MAX_FRAME;
use rigident_shared::wire::{
    Answer, Command, Decoder, ErrorCode, Kind, PROTOCOL_VERSION, Reply, SCHEMA_HASH, Telemetry,
    asks_to_watch, encode, encode_payload,
};

const SEQUENCE: u16 = 0x00a5;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

fn overwrite() -> bool {
    env::var_os("OVERWRITE_GOLDENS").is_some_and(|v| v == "1")
}

fn frame_of(message: &Message) -> Vec<u8> {
    let mut bytes = [0; MAX_FRAME];
    let length = match message {
        Message::Command(m) => encode(Kind::Command, SEQUENCE, m, &mut bytes),
        Message::Answer(m) => encode(Kind::Answer, SEQUENCE, m, &mut bytes),
        Message::Telemetry(m) => encode(Kind::Telemetry, SEQUENCE, m, &mut bytes),
        Message::Stream(m) => encode_payload(Kind::Stream, SEQUENCE, m, &mut bytes),
    };
    bytes[..length.unwrap()].to_vec()
}

fn to_hex(bytes: &[u8]) -> String {
    let mut text = String::new();
    for line in bytes.chunks(32) {
        line.iter().for_each(|b| write!(text, "{b:02x}").unwrap());
        text.push('\n');
    }
    text
}

fn from_hex(text: &str) -> Vec<u8> {
    let digits: String = text.split_whitespace().collect();
    (0..digits.len() / 2).map(|i| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).unwrap()).collect()
}

#[test]
fn golden_bytes() {
    let mut expected_files = BTreeSet::new();
    for (name, message) in samples() {
        let path = folder().join(format!("{name}.hex"));
        assert!(expected_files.insert(path.clone()), "two samples are called {name}");
        if overwrite() {
            fs::write(&path, to_hex(&frame_of(&message))).unwrap();
        }
        let golden = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert_eq!(to_hex(&frame_of(&message)), golden, "{name}: the wire has changed");
        assert_eq!(understood(&from_hex(&golden)), message, "{name}");
    }
    let found: BTreeSet<PathBuf> = fs::read_dir(folder()).unwrap().map(|e| e.unwrap().path()).collect();
    expected_files.insert(folder().join("schema_hash.hex"));
    assert_eq!(found, expected_files, "a golden file belongs to no sample");
}

fn understood(bytes: &[u8]) -> Message {
    let mut decoder = Decoder::new();
    for byte in bytes {
        if let Some(frame) = decoder.push(*byte) {
            let frame = frame.unwrap();
            assert_eq!(frame.sequence, SEQUENCE);
            return match frame.kind {
                Kind::Command => Message::Command(frame.message().unwrap()),
                Kind::Answer => Message::Answer(frame.message().unwrap()),
                Kind::Telemetry => Message::Telemetry(frame.message().unwrap()),
                Kind::Stream => Message::Stream(frame.payload.to_vec()),
            };
        }
    }
    panic!("no frame in {bytes:02x?}");
}

#[test]
fn the_schema_hash_moves_only_with_the_schema() {
    let path = folder().join("schema_hash.hex");
    let text = format!("{PROTOCOL_VERSION:02x} {SCHEMA_HASH:016x}\n");
    if overwrite() {
        fs::write(&path, &text).unwrap();
    }
    assert_eq!(fs::read_to_string(&path).unwrap(), text, "the messages have changed");
}

/// Returns the names of an enum's variants, out of its schema.
fn variants<M: Schema>() -> BTreeSet<&'static str> {
    match M::SCHEMA.ty {
        DataModelType::Enum(variants) => variants.iter().map(|v| v.name).collect(),
        other => panic!("not an enum: {other:?}"),
    }
}

#[test]
fn no_message_is_without_a_golden() {
    let [mut commands, mut replies, mut errors, mut telemetry] = [const { BTreeSet::new() }; 4];
    let name = |debug: String| debug.split([' ', '(', '{']).next().unwrap().to_owned();
    for (_, message) in samples() {
        match message {
            Message::Command(m) => commands.insert(name(format!("{m:?}"))),
            Message::Answer(Ok(m)) => replies.insert(name(format!("{m:?}"))),
            Message::Answer(Err(m)) => errors.insert(name(format!("{m:?}"))),
            Message::Telemetry(m) => telemetry.insert(name(format!("{m:?}"))),
            Message::Stream(_) => true,
        };
    }
    let owned = |names: BTreeSet<&str>| names.into_iter().map(str::to_owned).collect::<BTreeSet<_>>();
    assert_eq!(commands, owned(variants::<Command>()));
    assert_eq!(replies, owned(variants::<Reply>()));
    assert_eq!(errors, owned(variants::<ErrorCode>()));
    assert_eq!(telemetry, owned(variants::<Telemetry>()));
}

#[test]
fn error_numbers_are_the_documented_ones() {
    let numbers: Vec<u16> = samples()
        .into_iter()
        .filter_map(|(_, message)| match message {
            Message::Answer(Answer::Err(code)) => Some(code.number()),
            _ => None,
        })
        .collect();
    assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 8, 9, 10, 11]);
}

/// The bytes of every command that tells of a robot to watch are known as such, and of no other.
#[test]
fn commands_of_the_watch_are_known_by_their_bytes() {
    let mut asked = Vec::new();
    for (name, message) in samples() {
        let Message::Command(command) = message else { continue };
        let bytes = frame_of(&Message::Command(command));
        let body = cobs_undone(&bytes[..bytes.len() - 1]);
        if asks_to_watch(&body[4..body.len() - 4]) {
            asked.push(name);
        }
    }
    assert_eq!(asked, ["command_configure_watch", "command_watch_link", "command_line_rate"]);
}

/// Undoes COBS as its definition says: a code byte n is n − 1 bytes and, unless n is 255, a zero.
fn cobs_undone(mut line: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    while let [code, rest @ ..] = line {
        let (block, after) = rest.split_at(usize::from(*code) - 1);
        out.extend_from_slice(block);
        if *code != 0xff && !after.is_empty() {
            out.push(0);
        }
        line = after;
    }
    out
}

/// Returns the reflected CRC-32, computed bit by bit.
fn crc_32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

#[test]
fn the_frame_is_that_of_the_module_page() {
    for (name, message) in samples() {
        let bytes = frame_of(&message);
        let (zero, line) = bytes.split_last().unwrap();
        assert!(*zero == 0 && !line.contains(&0), "{name}");
        let raw = cobs_undone(line);
        let (body, check) = raw.split_last_chunk::<4>().unwrap();
        assert_eq!(crc_32(body), u32::from_le_bytes(*check), "{name}");
        let kind = match message {
            Message::Command(_) => 0,
            Message::Answer(_) => 1,
            Message::Telemetry(_) => 2,
            Message::Stream(_) => 3,
        };
        assert_eq!(body[..4], [PROTOCOL_VERSION, kind, 0xa5, 0x00], "{name}");
    }
    // The published check value of this CRC.
    assert_eq!(crc_32(b"123456789"), 0xcbf4_3926);
}

#[test]
fn the_longest_messages_fit_into_a_frame() {
    for (name, message) in samples::longest() {
        assert!(frame_of(&message).len() <= MAX_FRAME, "{name}");
    }
}
