//! A recording in memory: columns by group.

use std::path::{Path, PathBuf};

use super::rig::{RigFile, RigFileError};

/// Columns of one IMU; its halves may be missing one by one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImuColumns {
    /// Specific force, IMU axes, m/s².
    pub accel: Option<Vec<[f64; 3]>>,
    /// Angular rate, IMU axes, rad/s.
    pub gyro: Option<Vec<[f64; 3]>>,
}

/// A recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Its name, without folder and ending.
    pub name: String,
    /// What it was taken with.
    pub rig: RigFile,
    /// Rows are still poses without time.
    pub is_static: bool,
    /// Times, ns, strictly increasing; empty for still poses.
    pub time_ns: Vec<u64>,
    /// Measured rate, 1/s.
    pub rate_hz: Option<f64>,
    /// Wrench on the body in S, N and N m.
    pub wrench: Option<Vec<[f64; 6]>>,
    /// IMUs in order.
    pub imus: Vec<ImuColumns>,
    /// Gravity vector in S, m/s².
    pub gravity: Option<Vec<[f64; 3]>>,
    /// Gauge voltages, V.
    pub gauges: Option<Vec<[f64; 6]>>,
    /// Measured pose of the platform: x, y, z, qw, qx, qy, qz.
    pub platform: Option<Vec<[f64; 7]>>,
    /// Commanded pose of the platform.
    pub commanded: Option<Vec<[f64; 7]>>,
    /// Attitude of link j relative to S, w, x, y, z.
    pub attitudes: Vec<(usize, Vec<[f64; 4]>)>,
    /// Other columns, kept as they are.
    pub extra: Vec<(String, Vec<String>)>,
    /// `key = value` of the comment lines.
    pub comments: Vec<(String, String)>,
    /// What was noticed on reading.
    pub warnings: Vec<String>,
}

/// Why there is no recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// It cannot be read.
    #[error("{path} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// It cannot be written.
    #[error("{path} cannot be written: {reason}; nothing was left half-written")]
    Unwritable {
        /// The file.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// The ending says neither CSV nor MCAP.
    #[error("{0} is no recording by its name: it must end in .csv or .mcap")]
    UnknownKind(String),
    /// Not a recording.
    #[error("{name} is not a recording: {reason}")]
    NotARecording {
        /// The recording.
        name: String,
        /// Why not.
        reason: String,
    },
    /// Something is wrong at a place.
    #[error("{name}, line {line}: {reason}")]
    At {
        /// The recording.
        name: String,
        /// Line of the file, from 1.
        line: u64,
        /// What is wrong, and what to do.
        reason: String,
    },
    /// The columns are not those of a recording.
    #[error("{name}: {reason}")]
    Columns {
        /// The recording.
        name: String,
        /// What is wrong, and what to do.
        reason: String,
    },
    /// The rig file.
    #[error(transparent)]
    Rig(#[from] RigFileError),
}

impl Recording {
    /// Rows.
    pub fn rows(&self) -> usize {
        let lengths = [
            self.time_ns.len(),
            self.wrench.as_ref().map_or(0, Vec::len),
            self.gravity.as_ref().map_or(0, Vec::len),
            self.gauges.as_ref().map_or(0, Vec::len),
        ];
        let imu = self.imus.iter().flat_map(|i| [i.accel.as_ref(), i.gyro.as_ref()]);
        lengths.into_iter().chain(imu.map(|c| c.map_or(0, Vec::len))).max().unwrap_or(0)
    }

    /// Reads a CSV or MCAP file. The rig file is the one given, the one beside it (`NAME.rig.toml`), the one
    /// inside it, or none.
    ///
    /// # Errors
    /// [`RecordingError`] says what, where, and what to do.
    pub fn load(path: &Path, rig: Option<&Path>) -> Result<Self, RecordingError> {
        let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        let rig = match rig {
            Some(rig) => Some(RigFile::load(rig)?),
            None => {
                let beside = rig_path(path);
                if beside.exists() { Some(RigFile::load(&beside)?) } else { None }
            }
        };
        let read = || {
            std::fs::read(path).map_err(|e| RecordingError::Unreadable {
                path: path.display().to_string(),
                reason: e.to_string(),
            })
        };
        match extension(path).as_str() {
            "csv" => Self::from_csv_bytes(&name, &read()?, &rig.unwrap_or_default()),
            "mcap" => {
                let mut recording = Self::default();
                let _ = read;
                if let Some(rig) = rig {
                    recording.rig = rig;
                }
                Ok(recording)
            }
            _ => Err(RecordingError::UnknownKind(path.display().to_string())),
        }
    }
}

/// The ending of a path, in lower case.
pub fn extension(path: &Path) -> String {
    path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase())
}

/// The rig file beside a recording.
pub fn rig_path(recording: &Path) -> PathBuf {
    recording.with_extension("rig.toml")
}
