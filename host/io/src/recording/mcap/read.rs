//! MCAP files to recordings: those of our own here, bags recorded elsewhere in [`super::bag`].

use std::collections::{BTreeMap, HashMap};

use rigident_shared::printable;

use super::cdr::CdrError;
use super::container::{Channel, Contents, Message, Unpacked};
use super::folder::Files;
use super::messages::{ImuValues, read_array, read_imu, read_numbers, read_pose, read_quaternion, read_text};
use super::sqlite::{self, Stored};
use super::{
    COMMANDED_TOPIC, GAUGES_TOPIC, GRAVITY_TOPIC, METADATA, PLATFORM_TOPIC, RIG_ATTACHMENT, ROW_TOPIC,
    WRENCH_TOPIC, topic_number,
};
use super::{bag, folder, ros1, topic};
use crate::recording::columns::{Cells, MOST_LINKS, is_printable};
use crate::recording::time;
use crate::recording::{Recording, RecordingError, stem};
use crate::rig::RigFile;

impl Recording {
    /// Reads the bytes of an MCAP file. `label` is the file's name, for messages; a rig file that is given,
    /// with its text, takes the place of the one inside. A recording of our own is in the notation already,
    /// so that `columns` and `wrench_sign` of a given rig file do not apply to it; to bags recorded elsewhere
    /// `wrench_sign` applies.
    ///
    /// # Errors
    /// [`RecordingError`] with topic and message.
    pub fn from_mcap_bytes(
        label: &str,
        bytes: &[u8],
        rig: Option<(&RigFile, &str)>,
    ) -> Result<Self, RecordingError> {
        Self::of_bag(label, &Bag::open(label, bytes)?, rig)
    }

    /// Reads the files of a bag, as [`Recording::from_mcap_bytes`] does one.
    pub(in crate::recording) fn from_bag_files(
        label: &str,
        files: &Files,
        rig: Option<(&RigFile, &str)>,
    ) -> Result<Self, RecordingError> {
        let mut bags =
            files.bytes.iter().map(|bytes| Bag::open(label, bytes)).collect::<Result<Vec<_>, _>>()?;
        let bag = match bags.len() {
            1 if !files.packed_messages => bags.swap_remove(0),
            _ => Bag::Stored(together(label, &bags, files.packed_messages)?),
        };
        Self::of_bag(label, &bag, rig)
    }

    fn of_bag(label: &str, bag: &Bag<'_>, rig: Option<(&RigFile, &str)>) -> Result<Self, RecordingError> {
        let not = |reason: String| RecordingError::NotARecording { name: label.to_owned(), reason };
        let contents = bag.contents(label)?;
        let mut recording = Self { name: stem(label), ..Self::default() };
        let attached = contents
            .attachments
            .iter()
            .find(|(name, _)| *name == RIG_ATTACHMENT || name.ends_with(".rig.toml"));
        if let Some((rig, text)) = rig {
            recording.rig = rig.clone();
            recording.rig_text = Some(text.to_owned());
        } else if let Some((name, text)) = attached {
            let text =
                std::str::from_utf8(text).map_err(|_| not(format!("its attachment {name} is not text")))?;
            recording.rig = RigFile::parse(text)
                .map_err(|e| RecordingError::Rig(e.of_file(&format!("{name} inside {label}"))))?;
            recording.rig_text = Some(text.to_owned());
        }
        if !contents.complete {
            recording.warnings.push(
                "the recording was not ended by its writer (cut off, or still being written): what is whole \
                 of it is used"
                    .to_owned(),
            );
        }
        recording.warnings.extend(contents.damage.iter().map(|d| format!("damaged: {d}; it is left out")));
        let ours = contents.metadata.iter().any(|(name, _)| name == METADATA);
        if ours {
            read_own(label, &contents, &mut recording)?;
            let given = recording.rig.recording.clone();
            recording.rig.recording.wrench_sign = Default::default();
            if rig.is_some() && given.wrench_sign != recording.rig.recording.wrench_sign {
                recording.warnings.push(
                    "wrench_sign in the rig file is not applied: a recording of this program is in the \
                     on-body sign already"
                        .to_owned(),
                );
            }
        } else if let Some(topic) = topic::joint_states(&contents).filter(|_| !bag::has_wrench(&contents)) {
            let columns = topic::columns(label, &contents, topic)?;
            let read = Self::of_cells(label, &columns, &recording.rig)?;
            recording.warnings.extend(read.warnings);
            let (rig_text, warnings) = (recording.rig_text, recording.warnings);
            return Ok(Self { rig_text, warnings, ..read });
        } else {
            bag::read(label, &contents, &mut recording)?;
        }
        if recording.rows() == 0 {
            return Err(not("it holds no readings".to_owned()));
        }
        if let Some(name) = recording.column_names().iter().find(|name| !is_printable(name)) {
            let shown = printable::name(name).to_string();
            return Err(not(format!("its column {shown:?} has control characters, or is too long")));
        }
        recording.settle(label)
    }
}

/// Returns the columns of one topic of a bag, MCAP, `.db3` or `.bag`, a row a message.
///
/// # Errors
/// [`RecordingError`]: it is no bag, or the topic is not there or none that is read.
pub fn topic_columns(label: &str, bytes: &[u8], topic: &str) -> Result<Vec<Cells>, RecordingError> {
    topic::columns(label, &Bag::open(label, bytes)?.contents(label)?, topic)
}

/// A bag of either kind.
enum Bag<'a> {
    Mcap(Unpacked<'a>),
    Stored(Stored),
}

impl<'a> Bag<'a> {
    /// Opens the bytes of a bag, by how they begin.
    fn open(label: &str, bytes: &'a [u8]) -> Result<Self, RecordingError> {
        let not = |reason: String| RecordingError::NotARecording { name: label.to_owned(), reason };
        if sqlite::is_database(bytes) {
            return sqlite::Stored::new(bytes).map(Self::Stored).map_err(not);
        }
        if ros1::is_bag(bytes) {
            return ros1::read(bytes).map(Self::Stored).map_err(not);
        }
        Unpacked::new(bytes).map(Self::Mcap).map_err(|e| not(e.to_string()))
    }

    /// Returns what is in it; names of topics and types, which messages quote, are printable.
    fn contents(&self, label: &str) -> Result<Contents<'_>, RecordingError> {
        let contents = match self {
            Self::Mcap(unpacked) => unpacked.contents(),
            Self::Stored(stored) => stored.contents(),
        };
        let names =
            |c: &Channel| [&c.topic, &c.schema, &c.encoding].into_iter().all(|t| printable::is_name(t));
        match contents.channels.values().find(|channel| !names(channel)) {
            None => Ok(contents),
            Some(channel) => Err(RecordingError::Columns {
                name: label.to_owned(),
                reason: format!(
                    "the topic {:?} has a name or a type with control characters, or of more than {} bytes",
                    printable::name(&channel.topic).to_string(),
                    printable::LONGEST_NAME
                ),
            }),
        }
    }
}

/// Returns the messages of several files as those of one, unpacked if each is packed by itself. Channels of
/// the same topic are one.
fn together(label: &str, bags: &[Bag<'_>], packed: bool) -> Result<Stored, RecordingError> {
    let not = |reason: String| RecordingError::NotARecording { name: label.to_owned(), reason };
    let mut all = Stored::default();
    let (mut before, mut after) = (0, 0);
    for bag in bags {
        let contents = bag.contents(label)?;
        let mut numbers = HashMap::new();
        for (number, channel) in &contents.channels {
            numbers.insert(*number, all.channel(channel).map_err(not)?);
        }
        all.incomplete |= !contents.complete;
        all.damage.extend(contents.damage);
        for message in &contents.messages {
            let Some(channel) = numbers.get(&message.channel) else { continue };
            let data =
                if packed { folder::unpack(message.data).map_err(not)? } else { message.data.to_vec() };
            (before, after) = (before + message.data.len(), after + data.len());
            if folder::is_too_much(before, after) {
                return Err(not("its messages unpack to more than sensors record".to_owned()));
            }
            all.add(*channel, message.log_time, data).map_err(not)?;
        }
    }
    Ok(all)
}

/// The messages of a topic, decoded: log time and value.
pub(super) type Series<V> = Vec<(u64, V)>;

/// Returns the error of a message that cannot be used, with its place.
pub(super) fn refuse(label: &str, topic: &str, n: usize, reason: impl Into<String>) -> RecordingError {
    RecordingError::Message {
        name: label.to_owned(),
        topic: topic.to_owned(),
        message: n + 1,
        reason: reason.into(),
    }
}

/// Decodes a topic's messages and checks that their numbers are finite.
pub(super) fn series<'c, V>(
    label: &str,
    topic: &str,
    messages: &[&Message<'c>],
    decode: impl Fn(&'c [u8]) -> Result<V, CdrError>,
    numbers: impl Fn(&V) -> Vec<f64>,
) -> Result<Series<V>, RecordingError> {
    messages
        .iter()
        .enumerate()
        .map(|(n, message)| {
            let value = decode(message.data).map_err(|e| refuse(label, topic, n, e.to_string()))?;
            match numbers(&value).iter().find(|v| !v.is_finite()) {
                Some(bad) => Err(refuse(label, topic, n, format!("{bad} is not a finite number"))),
                None => Ok((message.log_time, value)),
            }
        })
        .collect()
}

/// Returns all numbers that an IMU measured.
pub(super) fn imu_numbers(values: &ImuValues) -> Vec<f64> {
    values.accel.into_iter().chain(values.gyro).flatten().collect()
}

/// Messages by topic, in the order of the file.
pub(super) fn by_topic<'m, 'c>(contents: &'m Contents<'c>) -> BTreeMap<&'m str, Vec<&'m Message<'c>>> {
    let mut topics: BTreeMap<&str, Vec<&Message<'c>>> = BTreeMap::new();
    for message in &contents.messages {
        if let Some(channel) = contents.channels.get(&message.channel) {
            topics.entry(channel.topic.as_str()).or_default().push(message);
        }
    }
    topics
}

/// The content of `/rigident/row` beside the numbers.
#[derive(serde::Deserialize)]
struct RowText {
    t_s: Option<String>,
    #[serde(default)]
    columns: BTreeMap<String, String>,
}

/// Times at which every group has a message: the rows. A row that a torn or damaged chunk took a part of is
/// none.
struct Rows {
    /// Row by time.
    of_time: HashMap<u64, usize>,
}

impl Rows {
    fn arrange<V: Copy>(&self, series: &Series<V>, or: V) -> Vec<V> {
        let mut values = vec![or; self.of_time.len()];
        for (time, value) in series {
            if let Some(slot) = self.of_time.get(time).and_then(|row| values.get_mut(*row)) {
                *slot = *value;
            }
        }
        values
    }
}

fn read_own(label: &str, contents: &Contents<'_>, recording: &mut Recording) -> Result<(), RecordingError> {
    read_metadata(label, contents, recording)?;
    let topics = by_topic(contents);
    let rows = find_rows(label, &topics, recording)?;
    for (topic, messages) in &topics {
        read_topic(label, topic, messages, &rows, recording)?;
    }
    recording.attitudes.sort_by_key(|(j, _)| *j);
    Ok(())
}

fn read_metadata(
    label: &str,
    contents: &Contents<'_>,
    recording: &mut Recording,
) -> Result<(), RecordingError> {
    let damaged = |what: &str| RecordingError::NotARecording {
        name: label.to_owned(),
        reason: format!("its metadata are damaged ({what})"),
    };
    for (key, value) in contents.metadata.iter().filter(|(name, _)| name == METADATA).flat_map(|(_, map)| map)
    {
        match key.as_str() {
            "version" if value != "1" => {
                return Err(RecordingError::NotARecording {
                    name: label.to_owned(),
                    reason: format!("it was written by a later version of this program (layout {value})"),
                });
            }
            "static" => recording.rig.recording.is_static |= value == "true",
            "columns" => recording.order = serde_json::from_str(value).map_err(|_| damaged("columns"))?,
            "comments" => {
                let more: Vec<(String, String)> =
                    serde_json::from_str(value).map_err(|_| damaged("comments"))?;
                recording.comments.extend(more);
            }
            _ => {}
        }
    }
    Ok(())
}

fn find_rows(
    label: &str,
    topics: &BTreeMap<&str, Vec<&Message<'_>>>,
    recording: &mut Recording,
) -> Result<Rows, RecordingError> {
    let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
    for (topic, messages) in topics {
        for (n, pair) in messages.windows(2).enumerate() {
            if pair[1].log_time <= pair[0].log_time {
                let (before, after) = (time::text(pair[0].log_time), time::text(pair[1].log_time));
                return Err(refuse(
                    label,
                    topic,
                    n + 1,
                    format!("time goes from {before} s to {after} s: it must increase"),
                ));
            }
        }
        for message in messages {
            *counts.entry(message.log_time).or_default() += 1;
        }
    }
    let whole: Vec<u64> =
        counts.iter().filter(|(_, count)| **count == topics.len()).map(|(time, _)| *time).collect();
    if whole.len() < counts.len() {
        recording.warnings.push(format!(
            "{} of {} rows are incomplete and left out",
            counts.len() - whole.len(),
            counts.len()
        ));
    }
    if !recording.rig.recording.is_static {
        recording.time_ns.clone_from(&whole);
    }
    Ok(Rows { of_time: whole.into_iter().enumerate().map(|(row, time)| (time, row)).collect() })
}

fn read_topic(
    label: &str,
    topic: &str,
    messages: &[&Message<'_>],
    rows: &Rows,
    recording: &mut Recording,
) -> Result<(), RecordingError> {
    match topic {
        WRENCH_TOPIC => {
            let series = series(label, topic, messages, |b| Ok(read_numbers::<6>(b)?.value), |v| v.to_vec())?;
            recording.wrench = Some(rows.arrange(&series, [0.0; 6]));
        }
        GRAVITY_TOPIC => {
            let series = series(label, topic, messages, |b| Ok(read_numbers::<3>(b)?.value), |v| v.to_vec())?;
            recording.gravity = Some(rows.arrange(&series, [0.0; 3]));
        }
        GAUGES_TOPIC => {
            let series = series(label, topic, messages, read_array, |v| v.to_vec())?;
            recording.gauges = Some(rows.arrange(&series, [0.0; 6]));
        }
        PLATFORM_TOPIC | COMMANDED_TOPIC => {
            let series = series(label, topic, messages, |b| Ok(read_pose(b)?.value), |v| v.to_vec())?;
            let poses = Some(rows.arrange(&series, [0.0; 7]));
            if topic == PLATFORM_TOPIC { recording.platform = poses } else { recording.commanded = poses }
        }
        ROW_TOPIC => read_row_texts(label, messages, rows, recording)?,
        _ => {
            let imu = topic_number(topic, "/imu", "").filter(|j| *j < MOST_LINKS);
            let link = topic_number(topic, "/link", "/attitude").filter(|j| *j < MOST_LINKS);
            if let Some(j) = imu {
                let series = series(label, topic, messages, |b| Ok(read_imu(b)?.value), imu_numbers)?;
                let values = rows.arrange(&series, ImuValues::default());
                let columns = recording.imu(j);
                columns.accel = values.iter().map(|v| v.accel).collect();
                columns.gyro = values.iter().map(|v| v.gyro).collect();
            } else if let Some(j) = link {
                let series =
                    series(label, topic, messages, |b| Ok(read_quaternion(b)?.value), |v| v.to_vec())?;
                recording.attitudes.push((j, rows.arrange(&series, [0.0; 4])));
            }
        }
    }
    Ok(())
}

fn read_row_texts(
    label: &str,
    messages: &[&Message<'_>],
    rows: &Rows,
    recording: &mut Recording,
) -> Result<(), RecordingError> {
    let mut cells: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut exact = vec![None; rows.of_time.len()];
    for (n, message) in messages.iter().enumerate() {
        let Some(row) = rows.of_time.get(&message.log_time).copied() else { continue };
        let text = read_text(message.data).map_err(|e| refuse(label, ROW_TOPIC, n, e.to_string()))?;
        let text: RowText =
            serde_json::from_str(text).map_err(|e| refuse(label, ROW_TOPIC, n, e.to_string()))?;
        if let Some(slot) = exact.get_mut(row) {
            *slot = text.t_s.and_then(|t| t.parse::<f64>().ok());
        }
        for (name, cell) in text.columns {
            let column = cells.entry(name).or_insert_with(|| vec![String::new(); rows.of_time.len()]);
            if let Some(slot) = column.get_mut(row) {
                *slot = cell;
            }
        }
    }
    recording.exact_time_s = exact.into_iter().collect();
    if recording.exact_time_s.as_ref().is_some_and(Vec::is_empty) {
        recording.exact_time_s = None;
    }
    let place: HashMap<&str, usize> =
        recording.order.iter().enumerate().map(|(i, name)| (name.as_str(), i)).collect();
    let mut extra: Vec<(String, Vec<String>)> = cells.into_iter().collect();
    extra.sort_by_key(|(name, _)| place.get(name.as_str()).copied().unwrap_or(usize::MAX));
    recording.extra = extra;
    Ok(())
}
