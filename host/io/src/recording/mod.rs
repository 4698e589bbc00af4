//! A recording in memory: columns by group, in the notation's units and signs.
//!
//! This room reads and writes recordings, in text ([`csv`], with [`columns`] and [`time`]), memory
//! ([`arrays`]) or messages ([`mcap`]);
//! [`convert`] goes between them. Each complaint names file, line and column. What the numbers mean for a
//! body is decided elsewhere.

pub mod arrays;
pub mod channels;
mod columnar;
pub mod columns;
pub mod conventions;
pub mod convert;
pub mod csv;
pub mod error;
pub mod import;
pub mod mcap;
pub mod new_file;
pub mod overview;
mod settle;
mod sheet;
pub(crate) mod text;
pub mod time;

use std::path::{Path, PathBuf};

use self::columns::{Group, Known, TIME};
pub use self::error::RecordingError;
use crate::rig::{RigFile, files_outside};

/// A step longer than this many periods is a gap.
const GAP: f64 = 1.5;

/// Columns of one IMU; its halves may be missing one by one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImuColumns {
    /// Specific force, IMU axes, m/s².
    pub accel: Option<Vec<[f64; 3]>>,
    /// Angular rate, IMU axes, rad/s.
    pub gyro: Option<Vec<[f64; 3]>>,
}

/// A recording. Its numbers and its rig file are in the notation: SI, wrench on the body, columns by their
/// own names, whatever the file that it was read from said.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// The name of the recording, without folder and ending.
    pub name: String,
    /// The rig that it was taken with.
    pub rig: RigFile,
    /// Text of the rig file it was read with, if there was one.
    pub rig_text: Option<String>,
    /// Rows are still poses without time.
    pub is_static: bool,
    /// Times, ns, strictly increasing; empty for still poses. Negative times in the file count from the
    /// first.
    pub time_ns: Vec<u64>,
    /// Times as the file has them, s, where nanoseconds do not hold them.
    pub exact_time_s: Option<Vec<f64>>,
    /// Measured rate, 1/s.
    pub rate_hz: Option<f64>,
    /// Wrench on the body in S, N and N m.
    pub wrench: Option<Vec<[f64; 6]>>,
    /// IMUs by the number of their link.
    pub imus: Vec<ImuColumns>,
    /// Gravity vector in S, m/s².
    pub gravity: Option<Vec<[f64; 3]>>,
    /// Attitudes w, x, y, z of S, to axes with z up, that the gravity columns were made of; empty: of none.
    pub gravity_attitudes: Vec<[f64; 4]>,
    /// Gauge voltages, V.
    pub gauges: Option<Vec<[f64; 6]>>,
    /// Measured pose of the platform: x, y, z, qw, qx, qy, qz.
    pub platform: Option<Vec<[f64; 7]>>,
    /// Commanded pose of the platform.
    pub commanded: Option<Vec<[f64; 7]>>,
    /// Attitude of link j relative to S, w, x, y, z.
    pub attitudes: Vec<(usize, Vec<[f64; 4]>)>,
    /// Groups that were made of others and are no sensor's own readings: they may rest, to the last digit.
    pub derived: Vec<Group>,
    /// Other columns, stored as they are.
    pub extra: Vec<(String, Vec<String>)>,
    /// `key = value` of the comment lines, values as TOML writes them; a line that is no such pair has an
    /// empty key.
    pub comments: Vec<(String, String)>,
    /// Names of the columns in the order of the file; empty if it does not matter.
    pub order: Vec<String>,
    /// The warnings of the reading.
    pub warnings: Vec<String>,
    /// The places of the columns, if found by the names and units that another program gave them: in words.
    pub assumed: Option<String>,
    /// Line of the first row in the file, if it is not the one after comments and header.
    pub first_line: Option<u64>,
}

impl Recording {
    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        let groups = self.groups().into_iter().map(|(_, rows)| rows);
        let extra = self.extra.iter().map(|(_, cells)| cells.len());
        groups.chain(extra).chain([self.time_ns.len()]).max().unwrap_or(0)
    }

    /// Returns the date and time that the recording states, as RFC 3339 has it: the comment `recorded`.
    pub fn recorded(&self) -> Option<String> {
        let (_, said) = self.comments.iter().find(|(key, _)| key == "recorded")?;
        let date = said.trim_matches('"');
        humantime::parse_rfc3339(date).ok().map(|_| date.to_owned())
    }

    /// Warns of a date that is none: an answer and a factor would go without.
    fn warn_of_date(&mut self) {
        if let Some((_, said)) = self.comments.iter().find(|(key, _)| key == "recorded")
            && self.recorded().is_none()
        {
            self.warnings.push(format!(
                "the comment recorded = {said} is no date, and is left out; write one as \
                 2026-05-01T12:00:00Z (RFC 3339)"
            ));
        }
    }

    /// Returns the groups of columns that the recording has, with their numbers of rows.
    pub fn groups(&self) -> Vec<(Group, usize)> {
        let mut groups = vec![(Group::Wrench, self.wrench.as_ref().map(Vec::len))];
        for (j, imu) in self.imus.iter().enumerate() {
            groups.push((Group::Accel(j), imu.accel.as_ref().map(Vec::len)));
            groups.push((Group::Gyro(j), imu.gyro.as_ref().map(Vec::len)));
        }
        groups.push((Group::Gravity, self.gravity.as_ref().map(Vec::len)));
        groups.push((Group::Gauges, self.gauges.as_ref().map(Vec::len)));
        groups.push((Group::Platform, self.platform.as_ref().map(Vec::len)));
        groups.push((Group::Commanded, self.commanded.as_ref().map(Vec::len)));
        groups.extend(self.attitudes.iter().map(|(j, rows)| (Group::Attitude(*j), Some(rows.len()))));
        groups.into_iter().filter_map(|(group, rows)| Some((group, rows?))).collect()
    }

    /// Returns the name of the recording for messages, with the ending if it is a CSV.
    pub fn file(&self) -> String {
        if self.order.is_empty() { self.name.clone() } else { format!("{}.csv", self.name) }
    }

    /// Returns where a row, counted from 0, is in the file: its line in a CSV.
    pub fn place(&self, row: usize) -> String {
        if self.order.is_empty() {
            return format!("row {}", row + 1);
        }
        // After the comments and the header.
        let first = self.first_line.unwrap_or(2 + self.comments.len() as u64);
        format!("line {}", row as u64 + first)
    }

    /// Returns the names of all columns: in the order of the file they are from, new ones after them.
    pub fn column_names(&self) -> Vec<String> {
        let mut names = Vec::new();
        if !self.is_static {
            names.push(TIME.to_owned());
        }
        names.extend(self.groups().into_iter().flat_map(|(group, _)| group.names()));
        names.extend(self.extra.iter().map(|(name, _)| name.clone()));
        // Stable: columns that the file did not have keep their own order, at the end.
        let place: std::collections::HashMap<&str, usize> =
            self.order.iter().enumerate().map(|(i, name)| (name.as_str(), i)).collect();
        names.sort_by_key(|name| place.get(name.as_str()).copied().unwrap_or(usize::MAX));
        names
    }

    /// Returns the value of a `key = value` comment.
    pub fn comment(&self, key: &str) -> Option<&str> {
        self.comments.iter().find(|(k, _)| k == key).map(|(_, value)| value.as_str())
    }

    /// Returns the rig file as it fits a file in the notation, and its text. There is no text if there was no
    /// rig file and nothing in it differs from the defaults.
    pub fn rig_in_notation(&self) -> (RigFile, Option<String>) {
        let text = match &self.rig_text {
            // Word for word as long as it says the same.
            Some(text) if RigFile::parse(text).as_ref() == Ok(&self.rig) => Some(text.clone()),
            Some(text) => {
                let mut new = self.rig.to_toml();
                new.push_str(
                    "\n# Columns and signs are now those of the notation. The rig file this was made from:\n",
                );
                for line in text.lines() {
                    new.push_str("# ");
                    new.push_str(line);
                    new.push('\n');
                }
                Some(new)
            }
            None if self.rig == RigFile::default() => None,
            None => Some(self.rig.to_toml()),
        };
        (self.rig.clone(), text)
    }

    /// Reads a CSV, Parquet, MAT, TDMS, XLSX, MCAP, `.db3` or `.bag` file, or the folder of a ROS 2 bag. The
    /// rig file is the one given, the one beside it (`NAME.rig.toml`), the one inside it, or none.
    ///
    /// # Errors
    /// [`RecordingError`] says what, where, and what to do.
    pub fn load(path: &Path, rig: Option<&Path>) -> Result<Self, RecordingError> {
        let name = path.file_name().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        let kind = extension(path);
        let is_bag = mcap::folder::is_bag_file(path) || mcap::folder::is_bag_folder(path);
        let is_text = !is_bag && is_text(&kind);
        let has_columns = is_text || columnar::is_columnar(&kind) || sheet::is_workbook(&kind);
        if !has_columns && !is_bag {
            return Err(unknown(path, &kind));
        }
        let unreadable = |e: std::io::Error| RecordingError::Unreadable {
            path: path.display().to_string(),
            reason: e.to_string(),
        };
        // A file of rows is read piece by piece, and once more if that needs care; a stream is there once.
        let in_pieces = is_text && std::fs::metadata(path).is_ok_and(|m| m.is_file());
        let whole = || rigident_files::read_or_pipe(path, rigident_files::MOST_OF_RECORDING);
        let file = in_pieces.then(|| rigident_files::open(path)).transpose().map_err(unreadable)?;
        let bytes = if in_pieces || is_bag { Vec::new() } else { whole().map_err(unreadable)? };
        let beside = rig_path(path);
        let rig_path = rig.unwrap_or(&beside);
        let rig = match rig {
            Some(rig) => Some(RigFile::load_with_text(rig)?),
            None if beside.exists() => Some(RigFile::load_with_text(&beside)?),
            None => None,
        };
        let (rig, text) = rig.unzip();
        let mut recording = if has_columns {
            let own = rig.clone().unwrap_or_default();
            let mut recording = match file.and_then(|file| Self::from_plain_csv(&name, file, &own)) {
                Some(recording) => recording,
                None if in_pieces => Self::from_columns(&name, whole().map_err(unreadable)?, &own)?,
                None => Self::from_columns(&name, bytes, &own)?,
            };
            recording.rig_text.clone_from(&text);
            recording
        } else {
            Self::from_bag_files(&name, &mcap::folder::read(path)?, rig.as_ref().zip(text.as_deref()))?
        };
        if recording.rig_text.is_none() && !recording.imus.is_empty() {
            recording.warnings.push(format!(
                "no rig file ({} is not there): the IMU is taken to sit in the origin of S with its axes, \
                 the wrench to be that on the body",
                beside.display()
            ));
        }
        let outside = text.iter().flat_map(|text| files_outside(text, rig_path));
        recording.warnings.extend(outside);
        recording.warn_of_date();
        Ok(recording)
    }

    /// Reads the bytes of a file of columns: CSV, or by the ending of its name Parquet, MAT, TDMS or an Excel
    /// workbook.
    ///
    /// # Errors
    /// Fails as [`Recording::from_csv_bytes`] and [`Recording::from_arrays`] do.
    pub fn from_columns(file: &str, bytes: Vec<u8>, rig: &RigFile) -> Result<Self, RecordingError> {
        let ending = extension(Path::new(file));
        if sheet::is_workbook(&ending) {
            return Self::from_workbook(file, &bytes, rig);
        }
        if !columnar::is_columnar(&ending) {
            return Self::from_csv_bytes(file, &bytes, rig);
        }
        Self::of_table(file, columnar::columns(file, &ending, bytes)?, rig)
    }

    /// Puts a group's rows in their place.
    pub fn set_group(&mut self, group: Group, columns: &[Vec<f64>]) {
        match group {
            Group::Wrench => self.wrench = Some(rows(columns)),
            Group::Accel(j) => self.imu(j).accel = Some(rows(columns)),
            Group::Gyro(j) => self.imu(j).gyro = Some(rows(columns)),
            Group::Gravity => self.gravity = Some(rows(columns)),
            Group::Gauges => self.gauges = Some(rows(columns)),
            Group::Platform => self.platform = Some(rows(columns)),
            Group::Commanded => self.commanded = Some(rows(columns)),
            Group::Attitude(j) => self.attitudes.push((j, rows(columns))),
        }
    }

    /// Returns the columns of the IMU on link `j`, which are added if they are missing.
    pub(super) fn imu(&mut self, j: usize) -> &mut ImuColumns {
        if self.imus.len() <= j {
            self.imus.resize(j + 1, ImuColumns::default());
        }
        &mut self.imus[j]
    }

    /// Returns the numbers of a group's column; none if it is not there.
    pub(super) fn column(&self, group: Group, k: usize) -> Vec<f64> {
        fn of<const K: usize>(rows: Option<&Vec<[f64; K]>>, k: usize) -> Vec<f64> {
            rows.into_iter().flatten().filter_map(|row| row.get(k)).copied().collect()
        }
        let imu = |j: usize| self.imus.get(j);
        match group {
            Group::Wrench => of(self.wrench.as_ref(), k),
            Group::Accel(j) => of(imu(j).and_then(|imu| imu.accel.as_ref()), k),
            Group::Gyro(j) => of(imu(j).and_then(|imu| imu.gyro.as_ref()), k),
            Group::Gravity => of(self.gravity.as_ref(), k),
            Group::Gauges => of(self.gauges.as_ref(), k),
            Group::Platform => of(self.platform.as_ref(), k),
            Group::Commanded => of(self.commanded.as_ref(), k),
            Group::Attitude(j) => of(self.attitudes.iter().find(|(i, _)| *i == j).map(|(_, rows)| rows), k),
        }
    }

    /// Returns a number of a known column.
    pub fn number(&self, known: Known, row: usize) -> Option<f64> {
        fn get<const K: usize>(rows: Option<&Vec<[f64; K]>>, row: usize, k: usize) -> Option<f64> {
            rows?.get(row)?.get(k).copied()
        }
        let Known::Member(group, k) = known else { return None };
        match group {
            Group::Wrench => get(self.wrench.as_ref(), row, k),
            Group::Accel(j) => get(self.imus.get(j)?.accel.as_ref(), row, k),
            Group::Gyro(j) => get(self.imus.get(j)?.gyro.as_ref(), row, k),
            Group::Gravity => get(self.gravity.as_ref(), row, k),
            Group::Gauges => get(self.gauges.as_ref(), row, k),
            Group::Platform => get(self.platform.as_ref(), row, k),
            Group::Commanded => get(self.commanded.as_ref(), row, k),
            Group::Attitude(j) => {
                get(self.attitudes.iter().find(|(i, _)| *i == j).map(|(_, rows)| rows), row, k)
            }
        }
    }
}

/// Columns to rows; a column that is short or missing leaves zeros, which its reader does not let happen.
fn rows<const K: usize>(columns: &[Vec<f64>]) -> Vec<[f64; K]> {
    let count = columns.iter().map(Vec::len).min().unwrap_or(0);
    let value = |k: usize, row: usize| columns.get(k).and_then(|c| c.get(row)).copied().unwrap_or(0.0);
    (0..count).map(|row| std::array::from_fn(|k| value(k, row))).collect()
}

/// Rows per second: from the median step, refined by the mean of the steps like it. Within 1e-6 of a whole
/// number it is that number: the difference is the rounding of times to nanoseconds.
pub fn measured_rate(time_ns: &[u64]) -> Option<f64> {
    let mut steps: Vec<u64> = time_ns.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = steps.len() / 2;
    steps.get(middle)?;
    let median = *steps.select_nth_unstable(middle).1 as f64;
    let alike = steps.iter().map(|s| *s as f64).filter(|s| (s / median - 1.0).abs() < GAP - 1.0);
    let (count, sum) = alike.fold((0.0, 0.0), |(n, sum), s| (n + 1.0, sum + s));
    let rate = 1e9 * count / sum;
    let whole = rate.round();
    (rate.is_finite() && rate > 0.0).then_some(if (rate / whole - 1.0).abs() < 1e-6 { whole } else { rate })
}

/// Returns why a file of an ending is not read.
fn unknown(path: &Path, ending: &str) -> RecordingError {
    let path = path.display().to_string();
    let advice = match ending {
        "xlsb" | "xls" | "ods" => ".xlsx, or CSV; separator, decimal mark and encoding are found",
        "tdms_index" => "the .tdms file beside it; this one is its index",
        _ => return RecordingError::UnknownKind(path),
    };
    RecordingError::SavedElsewhere { path, advice }
}

/// Returns true for the ending of a table in text, as [`extension`] gives it.
pub fn is_text(ending: &str) -> bool {
    matches!(ending, "csv" | "tsv" | "txt" | "lvm" | "asc" | "dat" | "log")
}

/// Returns the ending of a path, in lower case.
pub fn extension(path: &Path) -> String {
    path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase())
}

/// Returns a comment that says something in words: a key in the manner of TOML, a text in quotes.
pub fn comment_in_words(what: &str, said: &str) -> (String, String) {
    let mut key = String::new();
    for letter in what.chars() {
        if letter.is_ascii_alphanumeric() {
            key.push(letter.to_ascii_lowercase());
        } else if !key.is_empty() && !key.ends_with('_') {
            key.push('_');
        }
    }
    // A JSON string is a TOML string too, and always on one line.
    (key.trim_end_matches('_').to_owned(), serde_json::Value::from(said).to_string())
}

/// Returns the rig file beside a recording.
pub fn rig_path(recording: &Path) -> PathBuf {
    recording.with_extension("rig.toml")
}

/// Returns a file's name without its ending.
pub(super) fn stem(label: &str) -> String {
    Path::new(label).file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_become_a_key_and_a_value_of_toml() {
        for (what, said) in
            [("Load cell, serial number", "A \"7\""), ("Firmware", "0.1.0"), (" IMU ", "line\nbreak")]
        {
            let (key, value) = comment_in_words(what, said);
            assert!(!value.contains('\n'));
            let table: toml::Table = toml::from_str(&format!("{key} = {value}")).unwrap();
            assert_eq!(table.values().next().and_then(toml::Value::as_str), Some(said));
        }
        assert_eq!(comment_in_words("Load cell, serial number", "").0, "load_cell_serial_number");
    }

    #[test]
    fn the_rate_is_that_of_most_steps() {
        let even: Vec<u64> = (0..100).map(|n| n * 5_000_000).collect();
        assert_eq!(measured_rate(&even), Some(200.0));
        let mut with_gap = even.clone();
        with_gap.extend((0..50).map(|n| 900_000_000_000 + n * 5_000_000));
        assert_eq!(measured_rate(&with_gap), Some(200.0));
        assert_eq!((measured_rate(&[]), measured_rate(&[7])), (None, None));
        // Times whose last digit was rounded: 400.2 is not taken for 400.
        let odd: Vec<u64> = (0..1000).map(|n| (f64::from(n) / 400.2 * 1e9).round() as u64).collect();
        assert!((measured_rate(&odd).unwrap() - 400.2).abs() < 1e-4);
    }
}
