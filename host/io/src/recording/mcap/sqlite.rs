//! Bags of ROS 2 as SQLite databases, `.db3`: a table of topics, and one of their messages.
//!
//! A database is a program: its schema holds views, triggers and expressions of whoever wrote it. Only plain
//! tables are read, within limits of length, memory and time.

use std::time::{Duration, Instant};

use rusqlite::config::DbConfig;
use rusqlite::limits::Limit;
use rusqlite::{Connection, ErrorCode, MAIN_DB};

use super::container::{Channel, Contents, Message};
use crate::stop;

/// The first bytes of a database.
const MAGIC: &[u8] = b"SQLite format 3\0";
/// The most messages of a bag.
const MOST_MESSAGES: usize = 1 << 26;
/// The longest message, bytes.
const LONGEST: i32 = 1 << 28;
/// A small bag may take this long.
const LEAST_PATIENCE: Duration = Duration::from_secs(10);
/// Bytes a second that even a slow machine reads of a bag.
const SLOWEST: u64 = 4 << 20;
/// Steps of SQLite's machine between two checks of the clock.
const LOOK_EVERY: i32 = 10_000;

/// The topics and messages of a bag.
#[derive(Debug, Default)]
pub(super) struct Stored {
    channels: Vec<(u16, Channel)>,
    messages: Vec<(u16, u64, Vec<u8>)>,
    /// The damaged parts of the files that it was put together from.
    pub(super) damage: Vec<String>,
    /// One of them was not ended by its writer.
    pub(super) incomplete: bool,
}

/// Returns true if the bytes begin as a database does.
pub(super) fn is_database(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Opens a database of a stranger.
fn opened(bytes: &[u8]) -> Result<Connection, rusqlite::Error> {
    let mut database = Connection::open_in_memory()?;
    database.set_limit(Limit::SQLITE_LIMIT_LENGTH, LONGEST)?;
    database.set_limit(Limit::SQLITE_LIMIT_SQL_LENGTH, 1 << 16)?;
    database.set_limit(Limit::SQLITE_LIMIT_EXPR_DEPTH, 64)?;
    database.set_limit(Limit::SQLITE_LIMIT_ATTACHED, 0)?;
    database.set_limit(Limit::SQLITE_LIMIT_WORKER_THREADS, 0)?;
    database.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
    database.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)?;
    database.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false)?;
    database.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false)?;
    database.deserialize_read_exact(MAIN_DB, bytes, bytes.len(), true)?;
    // Nothing is written beside it.
    database.execute_batch("PRAGMA temp_store = MEMORY")?;
    let patience = LEAST_PATIENCE + Duration::from_secs(bytes.len() as u64 / SLOWEST);
    let begun = Instant::now();
    database.progress_handler(LOOK_EVERY, Some(move || stop::is_asked() || begun.elapsed() > patience))?;
    Ok(database)
}

/// Says why a database is not read.
fn failed(error: rusqlite::Error) -> String {
    match error.sqlite_error_code() {
        Some(ErrorCode::OperationInterrupted) if stop::is_asked() => {
            "it was left while it was read, as you said".to_owned()
        }
        Some(ErrorCode::OperationInterrupted) => {
            "as a bag of ROS 2 (.db3) it takes far longer to read than a bag of its size does: it is none"
                .to_owned()
        }
        Some(ErrorCode::TooBig) => format!("it holds a message or a text of more than {LONGEST} bytes"),
        _ => format!("as a bag of ROS 2 (.db3) it is damaged or cut off: {error}"),
    }
}

/// Refuses a view, or anything else that is no table, in place of one.
fn check_table(database: &Connection, name: &str) -> Result<(), String> {
    let mut found = database
        .prepare(
            "SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name = ?1 AND sql NOT LIKE \
                  'CREATE VIRTUAL%'",
        )
        .map_err(failed)?;
    let tables: i64 = found.query_row([name], |row| row.get(0)).map_err(failed)?;
    if tables == 1 { Ok(()) } else { Err(format!("it is no bag of ROS 2 (.db3): it has no table {name}")) }
}

impl Stored {
    /// Reads a bag.
    ///
    /// # Errors
    /// Says why it is none.
    pub(super) fn new(bytes: &[u8]) -> Result<Self, String> {
        let database = opened(bytes).map_err(failed)?;
        check_table(&database, "topics")?;
        check_table(&database, "messages")?;
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
            if stored.channels.len() > usize::from(u16::MAX) {
                return Err("it has more topics than numbers for them".to_owned());
            }
            stored.channels.push((id, channel));
        }
        // Put in order here: SQLite would hold all of them while it sorts, and columns that are made of
        // others could be of any size.
        let mut messages =
            database.prepare("SELECT id, topic_id, timestamp, data FROM messages").map_err(failed)?;
        let mut rows = messages.query([]).map_err(failed)?;
        let (mut room, mut numbers) = (bytes.len(), Vec::new());
        while let Some(row) = rows.next().map_err(failed)? {
            let data = row.get_ref(3).and_then(|value| Ok(value.as_blob()?)).map_err(failed)?;
            let message = (|| Ok((row.get::<_, i64>(0)?, row.get::<_, i64>(1)?, row.get::<_, i64>(2)?)))();
            let (number, topic, time) = message.map_err(failed)?;
            if stored.messages.len() == MOST_MESSAGES {
                return Err(format!("it holds more than {MOST_MESSAGES} messages"));
            }
            room = room.checked_sub(data.len()).ok_or("its messages are larger than the file")?;
            let topic = u16::try_from(topic).map_err(|_| format!("it numbers a topic {topic}"))?;
            let time = u64::try_from(time).map_err(|_| format!("a message has the time {time} ns"))?;
            numbers.push((number, stored.messages.len()));
            stored.messages.push((topic, time, data.to_vec()));
        }
        if !numbers.is_sorted() {
            numbers.sort_unstable();
            let mut taken: Vec<_> = stored.messages.into_iter().map(Some).collect();
            stored.messages = numbers.iter().filter_map(|(_, at)| taken.get_mut(*at)?.take()).collect();
        }
        Ok(stored)
    }

    /// Returns the number of a channel, which is there already or is added.
    pub(super) fn channel(&mut self, channel: &Channel) -> Result<u16, String> {
        let same = |own: &Channel| {
            (&own.topic, &own.schema, &own.encoding) == (&channel.topic, &channel.schema, &channel.encoding)
        };
        if let Some((number, _)) = self.channels.iter().find(|(_, own)| same(own)) {
            return Ok(*number);
        }
        let number = u16::try_from(self.channels.len()).map_err(|_| "it has too many topics".to_owned())?;
        self.channels.push((number, channel.clone()));
        Ok(number)
    }

    /// Adds a message of a channel.
    pub(super) fn add(&mut self, channel: u16, log_time: u64, data: Vec<u8>) -> Result<(), String> {
        if self.messages.len() == MOST_MESSAGES {
            return Err(format!("it holds more than {MOST_MESSAGES} messages"));
        }
        self.messages.push((channel, log_time, data));
        Ok(())
    }

    /// Returns what is in it.
    pub(super) fn contents(&self) -> Contents<'_> {
        let messages = self.messages.iter();
        Contents {
            profile: "ros2",
            channels: self.channels.iter().cloned().collect(),
            messages: messages
                .map(|(channel, log_time, data)| Message { channel: *channel, log_time: *log_time, data })
                .collect(),
            complete: !self.incomplete,
            damage: self.damage.clone(),
            ..Contents::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOPICS: &str =
        "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);
        INSERT INTO topics VALUES (1, '/a', 'b', 'cdr');";
    const MESSAGES: &str =
        "CREATE TABLE messages (id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB);
        INSERT INTO messages VALUES (2, 1, 20, x'02'), (1, 1, 10, x'01');";

    fn read(sql: &str) -> Result<Stored, String> {
        let mut database = Connection::open_in_memory().unwrap();
        database.execute_batch(sql).unwrap();
        Stored::new(&database.serialize(MAIN_DB).unwrap())
    }

    #[test]
    fn a_bag_of_tables_is_read_in_the_order_of_its_numbers() {
        let stored = read(&format!("{TOPICS}{MESSAGES}")).unwrap();
        assert_eq!(stored.channels.len(), 1);
        assert_eq!(stored.messages, [(1, 10, vec![1]), (1, 20, vec![2])]);
    }

    /// Databases that run without end, or make messages of any size out of nothing.
    #[test]
    fn a_hostile_database_ends_in_words_within_seconds() {
        let endless = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x+1 FROM c)";
        let many = "INSERT INTO messages(id, topic_id, timestamp) WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL \
                    SELECT x+1 FROM c WHERE x < 1000) SELECT x, 1, x FROM c;";
        for (sql, part) in [
            (
                format!(
                    "CREATE VIEW topics AS {endless} SELECT x AS id, '/a' AS name, 'b' AS type, 'cdr' AS \
                     serialization_format FROM c WHERE x < 0;{MESSAGES}"
                ),
                "no table topics",
            ),
            (
                format!(
                    "{TOPICS}CREATE VIEW messages AS {endless} SELECT x AS id, 1 AS topic_id, x AS \
                     timestamp, zeroblob(500000000) AS data FROM c;"
                ),
                "no table messages",
            ),
            (
                format!(
                    "{TOPICS}CREATE TABLE messages (id INTEGER, topic_id INTEGER, timestamp INTEGER, data \
                     BLOB AS (zeroblob(200000000)));{many}"
                ),
                "larger than the file",
            ),
            (
                format!(
                    "{TOPICS}CREATE TABLE messages (id INTEGER, topic_id INTEGER, timestamp INTEGER, data \
                     BLOB AS (zeroblob(900000000)));{many}"
                ),
                "more than 268435456 bytes",
            ),
            ("CREATE TABLE topics (id)".to_owned(), "no table messages"),
        ] {
            let begun = Instant::now();
            let said = read(&sql).map(|_| ()).unwrap_err();
            assert!(said.contains(part), "{said}");
            assert!(begun.elapsed() < Duration::from_secs(5), "{said}");
        }
    }

    /// A computation of SQLite ends at the deadline.
    #[test]
    fn a_computation_without_end_is_interrupted() {
        let mut database =
            opened(&Connection::open_in_memory().unwrap().serialize(MAIN_DB).unwrap()).unwrap();
        let already = Instant::now();
        database
            .progress_handler(LOOK_EVERY, Some(move || already.elapsed() > Duration::from_millis(50)))
            .unwrap();
        let endless = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x+1 FROM c) SELECT count(*) FROM c";
        let error = database.query_row(endless, [], |row| row.get::<_, i64>(0)).unwrap_err();
        assert_eq!(error.sqlite_error_code(), Some(ErrorCode::OperationInterrupted));
        assert!(failed(error).contains("far longer"));
    }
}
