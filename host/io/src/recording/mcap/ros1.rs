//! Bags of ROS 1 (`.bag`, version 2.0): their records, and their messages as ROS 2 encodes them, so that all
//! that is read of one is read of the other. After the ROS wiki's *Bags/Format/2.0*.

use std::collections::HashMap;
use std::io::Read;

use super::cdr::CdrWriter;
use super::container::Channel;
use super::sqlite::Stored;
use super::{bzip2, folder};

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// A message's encoding where its type is none that is read: it is not stored.
const OTHER: &str = "ros1";

mod op {
    pub const MESSAGE: u8 = 2;
    pub const CHUNK: u8 = 5;
    pub const CONNECTION: u8 = 7;
}

/// A part of a message.
#[derive(Clone, Copy, Debug)]
enum Part {
    /// `std_msgs/Header`.
    Header,
    /// This many `float64`.
    Numbers(usize),
    /// `string`.
    Text,
    /// `string[]`.
    Texts,
    /// `float64[]`.
    List,
    /// An array of messages of these parts.
    Each(&'static [Part]),
}

/// Returns the parts of a type that is read, and the name of the type in ROS 2.
fn parts(kind: &str) -> Option<(&'static [Part], &'static str)> {
    use Part::{Each, Header, List, Numbers, Text, Texts};
    Some(match kind {
        "geometry_msgs/WrenchStamped" => (&[Header, Numbers(6)], "geometry_msgs/msg/WrenchStamped"),
        "sensor_msgs/Imu" => (&[Header, Numbers(37)], "sensor_msgs/msg/Imu"),
        "sensor_msgs/JointState" => (&[Header, Texts, List, List, List], "sensor_msgs/msg/JointState"),
        "geometry_msgs/PoseStamped" => (&[Header, Numbers(7)], "geometry_msgs/msg/PoseStamped"),
        "geometry_msgs/AccelStamped" => (&[Header, Numbers(6)], "geometry_msgs/msg/AccelStamped"),
        "geometry_msgs/QuaternionStamped" => (&[Header, Numbers(4)], "geometry_msgs/msg/QuaternionStamped"),
        "geometry_msgs/Vector3Stamped" => (&[Header, Numbers(3)], "geometry_msgs/msg/Vector3Stamped"),
        "tf2_msgs/TFMessage" | "tf/tfMessage" => {
            (&[Each(&[Header, Text, Numbers(7)])], "tf2_msgs/msg/TFMessage")
        }
        _ => return None,
    })
}

/// Returns true if bytes begin as a bag of ROS 1 does.
pub(super) fn is_bag(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#ROSBAG V")
}

/// Takes what is stored off the front of bytes.
struct Cursor<'a> {
    rest: &'a [u8],
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        Some(taken)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take(4)?.try_into().ok().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.take(8)?.try_into().ok().map(f64::from_le_bytes)
    }

    fn block(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()? as usize;
        self.take(length)
    }
}

/// A record: the fields of its header, and its data.
struct Record<'a> {
    fields: HashMap<&'a [u8], &'a [u8]>,
    data: &'a [u8],
}

impl<'a> Record<'a> {
    /// Takes the next record; `None` if it is cut off.
    fn next(cursor: &mut Cursor<'a>) -> Option<Self> {
        let fields = fields(cursor.block()?)?;
        Some(Self { fields, data: cursor.block()? })
    }

    fn op(&self) -> Option<u8> {
        self.fields.get(b"op".as_slice())?.first().copied()
    }

    fn u32(&self, name: &str) -> Option<u32> {
        (*self.fields.get(name.as_bytes())?).try_into().ok().map(u32::from_le_bytes)
    }

    fn text(&self, name: &str) -> Option<String> {
        self.fields.get(name.as_bytes()).map(|text| String::from_utf8_lossy(text).into_owned())
    }
}

fn fields(bytes: &[u8]) -> Option<HashMap<&[u8], &[u8]>> {
    let (mut cursor, mut found) = (Cursor { rest: bytes }, HashMap::new());
    while !cursor.rest.is_empty() {
        let field = cursor.block()?;
        let at = field.iter().position(|byte| *byte == b'=')?;
        found.insert(field.get(..at)?, field.get(at + 1..)?);
    }
    Some(found)
}

/// Reads a bag.
///
/// # Errors
/// Says why it is none. Of one that was not ended what is whole is read.
pub(super) fn read(bytes: &[u8]) -> Result<Stored, String> {
    let Some(rest) = bytes.strip_prefix(MAGIC) else {
        return Err(
            "it is a bag of ROS 1 of another version than 2.0: `rosbag fix` or `rosbag reindex` renews it"
                .to_owned(),
        );
    };
    let mut bag = Bag { stored: Stored::default(), connections: HashMap::new(), packed: 0, unpacked: 0 };
    let mut cursor = Cursor { rest };
    while !cursor.rest.is_empty() {
        let Some(record) = Record::next(&mut cursor) else {
            bag.stored.incomplete = true;
            break;
        };
        match record.op() {
            Some(op::CHUNK) => bag.chunk(&record)?,
            Some(_) => bag.take(&record)?,
            None => return Err("as a bag of ROS 1 it is damaged: a record says not what it is".to_owned()),
        }
    }
    Ok(bag.stored)
}

/// The data read of a bag so far.
struct Bag {
    stored: Stored,
    /// Channel and parts of the messages by the number of the connection.
    connections: HashMap<u32, (u16, Option<&'static [Part]>)>,
    packed: usize,
    unpacked: usize,
}

impl Bag {
    fn chunk(&mut self, record: &Record<'_>) -> Result<(), String> {
        let packing = record.text("compression").unwrap_or_default();
        let size = record.u32("size").unwrap_or(0) as usize;
        self.packed += record.data.len();
        self.unpacked = self.unpacked.saturating_add(size);
        if folder::is_too_much(self.packed, self.unpacked) {
            return Err("its chunks unpack to more than sensors record".to_owned());
        }
        let found = match packing.as_str() {
            "none" => Ok(record.data.to_vec()),
            "bz2" => bzip2::unpack(record.data, size),
            "lz4" => unpack_lz4(record.data, size),
            other => {
                return Err(format!(
                    "its chunks are packed as {other:?}, which is not read: `rosbag decompress` unpacks them"
                ));
            }
        };
        match found {
            Ok(plain) => {
                let mut cursor = Cursor { rest: &plain };
                while !cursor.rest.is_empty() {
                    let Some(record) = Record::next(&mut cursor) else {
                        self.stored.damage.push("a chunk ends within a record".to_owned());
                        break;
                    };
                    self.take(&record)?;
                }
            }
            Err(reason) => self.stored.damage.push(format!("a chunk: {reason}")),
        }
        Ok(())
    }

    /// Takes a connection or a message.
    fn take(&mut self, record: &Record<'_>) -> Result<(), String> {
        match record.op() {
            Some(op::CONNECTION) => {
                let (Some(number), Some(topic)) = (record.u32("conn"), record.text("topic")) else {
                    return Err(
                        "as a bag of ROS 1 it is damaged: a connection has no number or topic".to_owned()
                    );
                };
                let stated = fields(record.data).unwrap_or_default();
                let kind =
                    stated.get(b"type".as_slice()).map(|kind| String::from_utf8_lossy(kind).into_owned());
                let kind = kind.unwrap_or_default();
                let known = parts(&kind);
                let schema = known.map_or(kind, |(_, schema)| schema.to_owned());
                let encoding = if known.is_some() { "cdr" } else { OTHER }.to_owned();
                let channel =
                    self.stored.channel(&Channel { topic, schema, encoding, ..Channel::default() })?;
                self.connections.insert(number, (channel, known.map(|(parts, _)| parts)));
            }
            Some(op::MESSAGE) => {
                let own = record.u32("conn").and_then(|conn| self.connections.get(&conn));
                let Some((channel, Some(parts))) = own else { return Ok(()) };
                let time = record.fields.get(b"time".as_slice()).copied().unwrap_or_default();
                let mut time = Cursor { rest: time };
                let (Some(seconds), Some(ns)) = (time.u32(), time.u32()) else {
                    return Err("as a bag of ROS 1 it is damaged: a message has no time".to_owned());
                };
                let mut writer = CdrWriter::default();
                match encoded(parts, &mut Cursor { rest: record.data }, &mut writer) {
                    Some(()) => {
                        let log_time = u64::from(seconds) * 1_000_000_000 + u64::from(ns);
                        self.stored.add(*channel, log_time, writer.finish())?;
                    }
                    None => self.stored.damage.push("a message that is shorter than its type".to_owned()),
                }
            }
            _ => {}
        }
        Ok(())
    }
}

fn unpack_lz4(bytes: &[u8], size: usize) -> Result<Vec<u8>, String> {
    let mut plain = Vec::new();
    let reader = lz4_flex::frame::FrameDecoder::new(bytes);
    reader.take(size as u64).read_to_end(&mut plain).map_err(|error| format!("lz4: {error}"))?;
    if plain.len() == size { Ok(plain) } else { Err("lz4: it is cut off".to_owned()) }
}

/// Writes the parts of a message as ROS 2 encodes them; `None` if it is cut off.
fn encoded(parts: &[Part], from: &mut Cursor<'_>, to: &mut CdrWriter) -> Option<()> {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    for part in parts {
        match part {
            Part::Header => {
                // ROS 2 has no number of the message.
                from.u32()?;
                let (seconds, ns) = (from.u32()?, from.u32()?);
                to.i32(i32::try_from(seconds).unwrap_or(i32::MAX)).u32(ns).string(&text(from.block()?));
            }
            Part::Numbers(count) => {
                for _ in 0..*count {
                    to.f64s(&[from.f64()?]);
                }
            }
            Part::Text => {
                to.string(&text(from.block()?));
            }
            Part::Texts => {
                let count = from.u32()?;
                to.u32(count);
                for _ in 0..count {
                    to.string(&text(from.block()?));
                }
            }
            Part::List => {
                let count = from.u32()?;
                to.u32(count);
                for _ in 0..count {
                    to.f64s(&[from.f64()?]);
                }
            }
            Part::Each(parts) => {
                let count = from.u32()?;
                to.u32(count);
                for _ in 0..count {
                    encoded(parts, from, to)?;
                }
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::recording::mcap::read::topic_columns;
    use crate::recording::{Recording, RecordingError};

    /// Bags of rosbags, a library for Python; `fuzz/make_tables.py` writes them.
    fn bytes(name: &str) -> Vec<u8> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/recording_bag");
        std::fs::read(folder.join(name)).unwrap()
    }

    fn read(bytes: &[u8]) -> Result<Recording, RecordingError> {
        Recording::from_mcap_bytes("run.bag", bytes, None)
    }

    #[test]
    fn bags_of_ros_1_are_read_however_they_are_packed() {
        let mut before: Option<Recording> = None;
        for name in ["ros1.bag", "ros1_bz2.bag", "ros1_lz4.bag"] {
            let bytes = bytes(name);
            let recording = read(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(recording.rows(), 40, "{name}");
            for (row, (time, own)) in
                recording.time_ns.iter().zip(recording.wrench.as_ref().unwrap()).enumerate()
            {
                assert_eq!(*time, 1_795_169_553_000_000_000 + 2_000_000 * row as u64);
                let wanted: [f64; 6] = std::array::from_fn(|k| (10 * row + k) as f64 / 8.0);
                assert_eq!(*own, wanted, "{name}, row {row}");
            }
            let imu = &recording.imus[0];
            assert_eq!(imu.accel.as_ref().unwrap()[7], [7.0, -7.5, 9.5]);
            assert_eq!(imu.gyro.as_ref().unwrap()[7], [0.7, -0.25, 0.125]);
            let column = |topic: &str, name: &str, row: usize| {
                let columns = topic_columns("run.bag", &bytes, topic).unwrap();
                columns.iter().find(|(own, _)| own == name).unwrap().1[row].parse::<f64>().unwrap()
            };
            assert_eq!(column("/joint_states", "elbow_rad", 3), 3.25);
            assert_eq!(column("/joint_states", "elbow_nm", 3), -3.0);
            assert_eq!(column("/tf#tool0", "x_m", 3), 0.375);
            assert_eq!(column("/tf#tool0", "qw", 3), 1.0);
            if let Some(before) = &before {
                assert_eq!((&before.wrench, &before.imus), (&recording.wrench, &recording.imus));
            }
            before = Some(recording);
        }
    }

    #[test]
    fn bags_that_are_cut_off_or_damaged_end_in_words() {
        let whole = bytes("ros1_lz4.bag");
        for length in (13..whole.len()).step_by(37) {
            let _ = read(&whole[..length]);
        }
        let said = read(&[b"#ROSBAG V1.2\n", &whole[13..]].concat()).unwrap_err().to_string();
        assert!(said.contains("rosbag reindex"), "{said}");
        // What is whole of one that was not ended is used.
        let plain = bytes("ros1.bag");
        let cut = read(&plain[..plain.len() - 40]).unwrap();
        assert!(cut.rows() == 40 && cut.warnings.iter().any(|w| w.contains("not ended by its writer")));
        let mut swollen = plain.clone();
        let at = swollen.windows(5).position(|w| w == b"size=").unwrap() + 5;
        swollen[at..at + 4].copy_from_slice(&[255; 4]);
        let said = read(&swollen).unwrap_err().to_string();
        assert!(said.contains("more than sensors record"), "{said}");
    }
}
