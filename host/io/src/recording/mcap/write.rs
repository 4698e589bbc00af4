//! Recordings to MCAP, row by row.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{Seek, Write};
use std::path::Path;

use mcap::records::MessageHeader;

use super::messages::{
    ImuValues, write_array, write_imu, write_numbers, write_pose, write_quaternion, write_text,
};
use super::schemas::{self, MessageType};
use super::{
    COMMANDED_TOPIC, GAUGES_TOPIC, GRAVITY_TOPIC, METADATA, PLATFORM_TOPIC, RIG_ATTACHMENT, ROW_TOPIC,
    WRENCH_TOPIC, attitude_topic, imu_topic,
};
use crate::behind::Behind;
use crate::recording::Recording;
use crate::rig::RigFile;

/// After this many rows they go to the disk as one chunk; a killed program loses no more than these,
const ROWS_PER_CHUNK: usize = 250;
/// and no more than this much time, ns.
const TIME_PER_CHUNK_NS: u64 = 1_000_000_000;

/// Why a recording cannot be written on. What was written before stays readable.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file is there already.
    #[error("{0} is there already, and nothing is overwritten: give another name")]
    Exists(String),
    /// The system refuses.
    #[error("the recording cannot be written on: {}; what was written before can be read", said(.0))]
    Io(#[from] std::io::Error),
    /// The container refuses.
    #[error("{0}")]
    Container(String),
    /// A row has other columns than the first.
    #[error("row {row} has other columns than the first: {topics} of {expected} are there")]
    Columns {
        /// The row, from 1.
        row: usize,
        /// Topics it has.
        topics: usize,
        /// Topics of the first.
        expected: usize,
    },
}

fn said(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
            format!("the disk is full ({error}): make room, or record elsewhere")
        }
        _ => error.to_string(),
    }
}

impl From<mcap::McapError> for WriteError {
    fn from(error: mcap::McapError) -> Self {
        match error {
            mcap::McapError::Io(error) => Self::Io(error),
            other => Self::Container(other.to_string()),
        }
    }
}

/// The text before the first row.
#[derive(Debug, Clone, Default)]
pub struct Head<'a> {
    /// The rig file: σ for the messages' covariances.
    pub rig: RigFile,
    /// Text of the rig file, attached.
    pub rig_text: Option<&'a str>,
    /// Rows are still poses without time.
    pub is_static: bool,
    /// `key = value` comments.
    pub comments: &'a [(String, String)],
    /// Names of the CSV columns, in order, if it matters.
    pub order: &'a [String],
}

/// One row; every row of a recording has the same groups.
#[derive(Debug, Clone, Default)]
pub struct Row<'a> {
    /// Time, ns; the row's number for still poses.
    pub time_ns: u64,
    /// Time in s, where nanoseconds do not hold it.
    pub exact_time_s: Option<f64>,
    /// Wrench on the body in S, N and N m.
    pub wrench: Option<[f64; 6]>,
    /// IMUs in order, in their own axes.
    pub imus: &'a [ImuValues],
    /// Gravity vector in S, m/s².
    pub gravity: Option<[f64; 3]>,
    /// Gauges, V.
    pub gauges: Option<[f64; 6]>,
    /// Measured pose of the plate: x, y, z, qw, qx, qy, qz.
    pub platform: Option<[f64; 7]>,
    /// Commanded pose of the plate.
    pub commanded: Option<[f64; 7]>,
    /// Attitudes of links relative to S, w, x, y, z.
    pub attitudes: &'a [(usize, [f64; 4])],
    /// Other columns: name and cell.
    pub extra: &'a [(&'a str, &'a str)],
}

/// Writes a recording as it is taken.
pub struct McapWriter<W: Write + Seek> {
    inner: mcap::Writer<W>,
    rig: RigFile,
    channels: HashMap<String, u16>,
    schemas: HashMap<&'static str, u16>,
    rows: usize,
    /// Topics of the first row.
    topics: usize,
    /// Time of the chunk's first row; `None` before it.
    chunk_from_ns: Option<u64>,
    is_static: bool,
}

impl<W: Write + Seek> std::fmt::Debug for McapWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("McapWriter").field("rows", &self.rows).finish_non_exhaustive()
    }
}

impl McapWriter<Behind> {
    /// Creates a new file under its final name, written in a thread of its own: bytes that reach the disk can
    /// be read even if the program is killed.
    ///
    /// # Errors
    /// [`WriteError`]; a file that is there is left as it is.
    pub fn create(path: &Path, head: &Head<'_>) -> Result<Self, WriteError> {
        let file = File::create_new(path).map_err(|e| match e.kind() {
            std::io::ErrorKind::AlreadyExists => WriteError::Exists(path.display().to_string()),
            _ => WriteError::Io(e),
        })?;
        Self::new(Behind::file(file), head)
    }

    /// Ends the recording and waits until the disk has it.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn close(self) -> Result<(), WriteError> {
        Ok(self.finish()?.close()?)
    }
}

impl<W: Write + Seek> McapWriter<W> {
    /// Begins a recording.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn new(to: W, head: &Head<'_>) -> Result<Self, WriteError> {
        // Chunks are made in memory, packed and written whole, at the rows' boundaries.
        let inner = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("rigident ", env!("CARGO_PKG_VERSION")))
            .compression(Some(mcap::Compression::Zstd))
            .chunk_size(None)
            .disable_seeking(true)
            .create(to)?;
        let mut writer = Self {
            inner,
            rig: head.rig.clone(),
            channels: HashMap::new(),
            schemas: HashMap::new(),
            rows: 0,
            topics: 0,
            chunk_from_ns: None,
            is_static: head.is_static,
        };
        let list = |value: &dyn Fn() -> Result<String, serde_json::Error>| {
            value().map_err(|e| WriteError::Container(e.to_string()))
        };
        let mut metadata = BTreeMap::from([
            ("version".to_owned(), "1".to_owned()),
            ("static".to_owned(), head.is_static.to_string()),
        ]);
        if !head.order.is_empty() {
            metadata.insert("columns".to_owned(), list(&|| serde_json::to_string(head.order))?);
        }
        writer.inner.write_metadata(&mcap::records::Metadata { name: METADATA.to_owned(), metadata })?;
        writer.note(head.comments)?;
        if let Some(text) = head.rig_text {
            writer.inner.attach(&mcap::Attachment {
                log_time: 0,
                create_time: 0,
                name: RIG_ATTACHMENT.to_owned(),
                media_type: "application/toml".to_owned(),
                data: text.as_bytes().into(),
            })?;
        }
        writer.inner.flush()?;
        Ok(writer)
    }

    /// Adds `key = value` comments; values as TOML writes them.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn note(&mut self, comments: &[(String, String)]) -> Result<(), WriteError> {
        if comments.is_empty() {
            return Ok(());
        }
        let text = serde_json::to_string(comments).map_err(|e| WriteError::Container(e.to_string()))?;
        let metadata = BTreeMap::from([("comments".to_owned(), text)]);
        Ok(self.inner.write_metadata(&mcap::records::Metadata { name: METADATA.to_owned(), metadata })?)
    }

    /// Rows written so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Writes a row.
    ///
    /// # Errors
    /// [`WriteError`]; a row with other columns than the first is not written.
    pub fn append(&mut self, row: &Row<'_>) -> Result<(), WriteError> {
        let topics = [
            row.wrench.is_some(),
            row.gravity.is_some(),
            row.gauges.is_some(),
            row.platform.is_some(),
            row.commanded.is_some(),
        ];
        let topics = topics.into_iter().filter(|t| *t).count() + row.imus.len() + row.attitudes.len();
        if self.rows == 0 {
            self.topics = topics;
        } else if topics != self.topics {
            return Err(WriteError::Columns { row: self.rows + 1, topics, expected: self.topics });
        }
        let t = row.time_ns;
        if let Some(wrench) = &row.wrench {
            self.message(t, WRENCH_TOPIC, &schemas::WRENCH_STAMPED, &write_numbers(t, "S", wrench))?;
        }
        for (j, values) in row.imus.iter().enumerate() {
            if values.accel.is_none() && values.gyro.is_none() {
                continue;
            }
            let noise = self.rig.imu_on(j);
            let (accel, gyro) = noise.map_or((None, None), |i| (i.accel_noise_mps2, i.gyro_noise_radps));
            let data = write_imu(t, &format!("U{j}"), values, accel, gyro);
            self.message(t, &imu_topic(j), &schemas::IMU, &data)?;
        }
        if let Some(gravity) = &row.gravity {
            self.message(t, GRAVITY_TOPIC, &schemas::VECTOR3_STAMPED, &write_numbers(t, "S", gravity))?;
        }
        if let Some(gauges) = &row.gauges {
            self.message(t, GAUGES_TOPIC, &schemas::FLOAT64_ARRAY, &write_array("gauge_v", gauges))?;
        }
        for (topic, pose) in [(PLATFORM_TOPIC, &row.platform), (COMMANDED_TOPIC, &row.commanded)] {
            if let Some(pose) = pose {
                self.message(t, topic, &schemas::POSE_STAMPED, &write_pose(t, "A", pose))?;
            }
        }
        for (j, q) in row.attitudes {
            let data = write_quaternion(t, "S", q);
            self.message(t, &attitude_topic(*j), &schemas::QUATERNION_STAMPED, &data)?;
        }
        if row.exact_time_s.is_some() || !row.extra.is_empty() {
            let text = row_text(row).map_err(|e| WriteError::Container(e.to_string()))?;
            self.message(t, ROW_TOPIC, &schemas::STRING, &write_text(&text))?;
        }
        self.rows += 1;
        // By the rows' own times: the file does not depend on how fast it is written.
        let from = *self.chunk_from_ns.get_or_insert(t);
        let is_long = !self.is_static && t.saturating_sub(from) >= TIME_PER_CHUNK_NS;
        if is_long || self.rows.is_multiple_of(ROWS_PER_CHUNK) { self.flush() } else { Ok(()) }
    }

    /// Hands all rows so far to the system.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.chunk_from_ns = None;
        Ok(self.inner.flush()?)
    }

    /// Writes index and footer.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn finish(mut self) -> Result<W, WriteError> {
        self.inner.finish()?;
        let mut to = self.inner.into_inner();
        to.flush()?;
        Ok(to)
    }

    fn message(
        &mut self,
        time_ns: u64,
        topic: &str,
        kind: &MessageType,
        data: &[u8],
    ) -> Result<(), WriteError> {
        let channel_id = match self.channels.get(topic) {
            Some(id) => *id,
            None => {
                let schema = match self.schemas.get(kind.name) {
                    Some(id) => *id,
                    None => {
                        let id = self.inner.add_schema(kind.name, "ros2msg", kind.text().as_bytes())?;
                        self.schemas.insert(kind.name, id);
                        id
                    }
                };
                let id = self.inner.add_channel(schema, topic, "cdr", &BTreeMap::new())?;
                self.channels.insert(topic.to_owned(), id);
                id
            }
        };
        // Readers want the number of the message on its topic; it may wrap.
        let header = MessageHeader {
            channel_id,
            sequence: self.rows as u32,
            log_time: time_ns,
            publish_time: time_ns,
        };
        Ok(self.inner.write_to_known_channel(&header, data)?)
    }
}

fn row_text(row: &Row<'_>) -> Result<String, serde_json::Error> {
    #[derive(serde::Serialize)]
    struct Text<'a> {
        #[serde(skip_serializing_if = "Option::is_none")]
        t_s: Option<String>,
        #[serde(skip_serializing_if = "BTreeMap::is_empty")]
        columns: BTreeMap<&'a str, &'a str>,
    }
    serde_json::to_string(&Text {
        t_s: row.exact_time_s.map(|t| format!("{t:?}")),
        columns: row.extra.iter().copied().collect(),
    })
}

impl Recording {
    /// Writes the whole recording as MCAP.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write_mcap<W: Write + Seek>(&self, to: W) -> Result<W, WriteError> {
        let (rig, rig_text) = self.rig_in_notation();
        let order = self.column_names();
        let head = Head {
            rig,
            rig_text: rig_text.as_deref(),
            is_static: self.is_static,
            comments: &self.comments,
            order: &order,
        };
        let mut writer = McapWriter::new(to, &head)?;
        for n in 0..self.rows() {
            let imus: Vec<ImuValues> = self
                .imus
                .iter()
                .map(|imu| ImuValues { accel: at(imu.accel.as_ref(), n), gyro: at(imu.gyro.as_ref(), n) })
                .collect();
            let attitudes: Vec<(usize, [f64; 4])> =
                self.attitudes.iter().filter_map(|(j, q)| Some((*j, *q.get(n)?))).collect();
            let extra: Vec<(&str, &str)> = self
                .extra
                .iter()
                .filter_map(|(name, cells)| Some((name.as_str(), cells.get(n)?.as_str())))
                .collect();
            writer.append(&Row {
                time_ns: self.time_ns.get(n).copied().unwrap_or(n as u64 * 1_000_000_000),
                exact_time_s: self.exact_time_s.as_ref().and_then(|t| t.get(n)).copied(),
                wrench: at(self.wrench.as_ref(), n),
                imus: &imus,
                gravity: at(self.gravity.as_ref(), n),
                gauges: at(self.gauges.as_ref(), n),
                platform: at(self.platform.as_ref(), n),
                commanded: at(self.commanded.as_ref(), n),
                attitudes: &attitudes,
                extra: &extra,
            })?;
        }
        writer.finish()
    }
}

fn at<V: Copy>(column: Option<&Vec<V>>, row: usize) -> Option<V> {
    column.and_then(|c| c.get(row)).copied()
}
