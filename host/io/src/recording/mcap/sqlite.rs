//! Bags of ROS 2 as SQLite databases, `.db3`: a table of topics, and one of their messages.

use rusqlite::{Connection, MAIN_DB};

use super::container::{Channel, Contents, Message};

/// The first bytes of a database.
const MAGIC: &[u8] = b"SQLite format 3\0";
/// The most messages of a bag.
const MOST_MESSAGES: usize = 1 << 26;

/// The topics and messages of a bag.
#[derive(Debug, Default)]
pub(super) struct Stored {
    channels: Vec<(u16, Channel)>,
    messages: Vec<(u16, u64, Vec<u8>)>,
}

/// Returns true if the bytes begin as a database does.
pub(super) fn is_database(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

impl Stored {
    /// Reads a bag.
    ///
    /// # Errors
    /// Says why it is none.
    pub(super) fn new(bytes: &[u8]) -> Result<Self, String> {
        let failed = |e: rusqlite::Error| format!("as a bag of ROS 2 (.db3) it is damaged or cut off: {e}");
        let mut database = Connection::open_in_memory().map_err(failed)?;
        database.deserialize_read_exact(MAIN_DB, bytes, bytes.len(), true).map_err(failed)?;
        let mut stored = Self::default();
        let mut topics =
            database.prepare("SELECT id, name, type, serialization_format FROM topics").map_err(failed)?;
        let found = topics.query_map([], |row| {
            let channel = Channel {
                topic: row.get(1)?,
                schema: row.get(2)?,
                encoding: row.get(3)?,
                ..Channel::default()
            };
            Ok((row.get::<_, i64>(0)?, channel))
        });
        for topic in found.map_err(failed)? {
            let (id, channel) = topic.map_err(failed)?;
            let id = u16::try_from(id).map_err(|_| format!("it numbers a topic {id}"))?;
            stored.channels.push((id, channel));
        }
        let mut messages =
            database.prepare("SELECT topic_id, timestamp, data FROM messages ORDER BY id").map_err(failed)?;
        let mut rows = messages.query([]).map_err(failed)?;
        while let Some(row) = rows.next().map_err(failed)? {
            let message = (|| Ok((row.get::<_, i64>(0)?, row.get::<_, i64>(1)?, row.get(2)?)))();
            let (topic, time, data) = message.map_err(failed)?;
            if stored.messages.len() == MOST_MESSAGES {
                return Err(format!("it holds more than {MOST_MESSAGES} messages"));
            }
            let topic = u16::try_from(topic).map_err(|_| format!("it numbers a topic {topic}"))?;
            let time = u64::try_from(time).map_err(|_| format!("a message has the time {time} ns"))?;
            stored.messages.push((topic, time, data));
        }
        Ok(stored)
    }

    /// What is in it.
    pub(super) fn contents(&self) -> Contents<'_> {
        let messages = self.messages.iter();
        Contents {
            profile: "ros2",
            channels: self.channels.iter().cloned().collect(),
            messages: messages
                .map(|(channel, log_time, data)| Message { channel: *channel, log_time: *log_time, data })
                .collect(),
            complete: true,
            ..Contents::default()
        }
    }
}
