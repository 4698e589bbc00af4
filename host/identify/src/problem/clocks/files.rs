//! The files of the rig file's `[[stream]]` tables, each as its own clock saw it.

use std::path::Path;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use super::StreamError;
use super::kernel::LEAST_SAMPLES;
use super::stamped::Stamped;
use rigident_files::MOST_OF_RECORDING;
use rigident_io::recording::columns::{Group, Known};
use rigident_io::recording::mcap::read::topic_columns;
use rigident_io::recording::time::Time;
use rigident_io::recording::{Recording, measured_rate};
use rigident_io::rig::{
    LoadCellTable, RecordingTable, RigFile, RotationMatrixTable, StreamTable, files_outside,
};

/// Units that columns of joints end with.
const JOINT_UNITS: [&str; 6] = ["rad", "radps", "nm", "m", "mps", "n"];
/// A matrix is a rotation if its columns' products are those of the unit matrix within this.
const ORTHONORMAL: f64 = 1e-3;

/// One stream.
#[derive(Clone, Debug)]
pub struct Stream {
    /// The file as listed.
    pub file: String,
    /// Capture times of its own clock, stated delays taken off, ns after the first wrench; ascending.
    pub time_ns: Vec<i64>,
    /// Its quantities, column by column.
    pub groups: Vec<(Group, Vec<Vec<f64>>)>,
    /// Attitude of S in A, `R_AS`.
    pub attitude: Option<Vec<UnitQuaternion<f64>>>,
    /// Columns of joints, by name: positions, rates and efforts in the file's units.
    pub joints: Vec<(String, Vec<f64>)>,
    /// Its rate, 1/s.
    pub rate_hz: f64,
    /// Rows that are not used.
    pub discarded: usize,
    /// The way in which its times were made of its stamps.
    pub stamped: Stamped,
}

impl Stream {
    /// Returns what it carries, in words.
    pub fn carries(&self) -> Vec<String> {
        let word = |group: &Group| match group {
            Group::Wrench => "wrench".to_owned(),
            Group::Gauges => "gauges".to_owned(),
            Group::Accel(j) => numbered("accelerometer", *j),
            Group::Gyro(j) => numbered("gyro", *j),
            Group::Attitude(j) => numbered("attitude", *j),
            other => other.names().join(", "),
        };
        let attitude = self.attitude.iter().map(|_| "attitude".to_owned());
        let joints = self.joints.iter().map(|(name, _)| name.clone());
        self.groups.iter().map(|(group, _)| word(group)).chain(attitude).chain(joints).collect()
    }

    fn has(&self, wanted: Group) -> bool {
        self.groups.iter().any(|(group, _)| *group == wanted)
    }
}

fn numbered(word: &str, link: usize) -> String {
    if link == 0 { word.to_owned() } else { format!("{word} {link}") }
}

/// All streams of a rig file.
#[derive(Clone, Debug)]
pub struct StreamSet {
    /// The recording's name: the rig file's.
    pub name: String,
    /// The rig file as it fits the recording on the grid: no streams, columns and signs of the notation.
    pub rig: RigFile,
    /// In the order of the rig file.
    pub streams: Vec<Stream>,
    /// The stream by whose clock the others are set: that of the wrench.
    pub reference: usize,
    /// The warnings.
    pub warnings: Vec<String>,
    /// Clocks that share no origin have been set, or are known to have one.
    pub is_settled: bool,
}

impl StreamSet {
    /// Sets the clocks of streams that do not fit the wrench as they are stamped, by what both see of the
    /// motion; what was found is the first of the warnings. Of a tree, no single body, only where they have
    /// no time in common. Done once.
    ///
    /// # Errors
    /// [`StreamError::NoClock`] if a stream has no time in common with the wrench and nothing aligns them.
    pub fn settle(&mut self, is_body: bool) -> Result<(), StreamError> {
        if !self.is_settled {
            self.is_settled = true;
            let said = super::origin::settle(self, is_body)?;
            self.warnings.splice(0..0, said);
        }
        Ok(())
    }

    /// Reads the files that a rig file lists from a folder, by default the rig file's own.
    ///
    /// # Errors
    /// [`StreamError`] says which file, and what to do.
    pub fn load(rig_path: &Path, folder: Option<&Path>) -> Result<Self, StreamError> {
        let (rig, text) = RigFile::load_with_text(rig_path)?;
        let beside = rig_path.parent().unwrap_or(Path::new(""));
        let folder = folder.unwrap_or(beside);
        let rig_name = rig_path.display().to_string();
        if rig.stream.is_empty() {
            return Err(StreamError::None(rig_name));
        }
        let files = rig
            .stream
            .iter()
            .map(|table| {
                rigident_files::read(&folder.join(&table.file), MOST_OF_RECORDING).map_err(|e| {
                    StreamError::Missing {
                        rig: rig_name.clone(),
                        file: table.file.clone(),
                        folder: if folder.as_os_str().is_empty() {
                            ".".into()
                        } else {
                            folder.display().to_string()
                        },
                        reason: e.to_string(),
                    }
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let name = rig_path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let mut set = Self::from_bytes(name.strip_suffix(".rig.toml").unwrap_or(&name), &rig, &files)?;
        set.warnings.extend(files_outside(&text, rig_path));
        Ok(set)
    }

    /// From the contents of the files, in the order of the rig file's streams.
    ///
    /// # Errors
    /// As [`StreamSet::load`].
    pub fn from_bytes(name: &str, rig: &RigFile, files: &[Vec<u8>]) -> Result<Self, StreamError> {
        if rig.recording.is_static {
            return Err(StreamError::Static);
        }
        let raw = rig
            .stream
            .iter()
            .zip(files)
            .map(|(table, bytes)| Raw::read(rig, table, bytes))
            .collect::<Result<Vec<_>, _>>()?;
        let reference = raw
            .iter()
            .position(|r| r.stream.has(Group::Wrench))
            .or_else(|| raw.iter().position(|r| r.stream.has(Group::Gauges)));
        let reference = reference.ok_or(StreamError::NoWrench)?;
        let origin = raw.get(reference).and_then(|r| r.time_ns.first()).copied().unwrap_or(0);
        let mut set = Self {
            name: name.to_owned(),
            rig: rig.clone(),
            streams: Vec::new(),
            reference,
            warnings: Vec::new(),
            is_settled: false,
        };
        set.rig = on_grid(rig);
        for mut raw in raw {
            let delay_ns = (1e9 * raw.delay_s(rig)).round() as i128;
            raw.stream.time_ns = raw
                .time_ns
                .iter()
                .map(|t| i64::try_from(t - origin - delay_ns).unwrap_or(i64::MAX))
                .collect();
            raw.stream.stamped.begin_s = 1e-9 * (origin + delay_ns) as f64;
            if raw.calibration.is_some() {
                set.rig.load_cell.calibration = raw.calibration;
            }
            let mut stream = raw.stream;
            screen(&mut stream, rig, &mut set.warnings);
            if stream.time_ns.len() < LEAST_SAMPLES {
                return Err(StreamError::TooFew {
                    file: stream.file,
                    samples: stream.time_ns.len(),
                    needed: LEAST_SAMPLES,
                });
            }
            set.warnings.extend(raw.warnings);
            set.refuse_repeated(&stream)?;
            set.streams.push(stream);
        }
        Ok(set)
    }

    fn refuse_repeated(&self, new: &Stream) -> Result<(), StreamError> {
        let twice = |what: String, first: &Stream| StreamError::Twice {
            what,
            first: first.file.clone(),
            second: new.file.clone(),
        };
        for old in &self.streams {
            if let Some((group, _)) = new.groups.iter().find(|(group, _)| old.has(*group)) {
                let names = group.names();
                return Err(twice(names.join(", "), old));
            }
            if old.attitude.is_some() && new.attitude.is_some() {
                return Err(twice("the attitude".to_owned(), old));
            }
            let of_joint = |name: &String| old.joints.iter().any(|(other, _)| other == name);
            if let Some((name, _)) = new.joints.iter().find(|(name, _)| of_joint(name)) {
                return Err(twice(name.clone(), old));
            }
        }
        Ok(())
    }
}

/// A stream before the clocks are compared.
struct Raw {
    stream: Stream,
    time_ns: Vec<i128>,
    calibration: Option<[[f64; 6]; 6]>,
    warnings: Vec<String>,
}

impl Raw {
    fn read(rig: &RigFile, table: &StreamTable, bytes: &[u8]) -> Result<Self, StreamError> {
        let own = RigFile {
            recording: RecordingTable {
                wrench_sign: rig.recording.wrench_sign,
                columns: table.columns.clone(),
                decimal: rig.recording.decimal,
                ..RecordingTable::default()
            },
            load_cell: LoadCellTable { calibration: rig.load_cell.calibration, ..LoadCellTable::default() },
            ..RigFile::default()
        };
        let recording = match &table.topic {
            Some(topic) => {
                let columns = topic_columns(&table.file, bytes, topic)?;
                Recording::of_cells(&format!("{} {topic}", table.file), &columns, &own)?
            }
            None => Recording::from_columns(&table.file, bytes.to_vec(), &own)?,
        };
        let attitude = match &table.rotation_matrix {
            Some(matrix) => Some(matrices(&recording, matrix, &table.file)?),
            None => platform_attitude(&recording, rig, &table.file)?,
        };
        let groups: Vec<(Group, Vec<Vec<f64>>)> = recording
            .groups()
            .into_iter()
            // The attitude of the plate is used above.
            .filter(|(group, _)| !matches!(group, Group::Platform | Group::Commanded))
            .map(|(group, rows)| {
                let column = |k: usize| {
                    let value = |row: usize| recording.number(Known::Member(group, k), row).unwrap_or(0.0);
                    (0..rows).map(value).collect()
                };
                let mut columns: Vec<Vec<f64>> = (0..group.names().len()).map(column).collect();
                if matches!(group, Group::Attitude(_)) {
                    keep_signs(&mut columns);
                }
                (group, columns)
            })
            .collect();
        let time_ns: Vec<i128> = match &recording.exact_time_s {
            Some(seconds) => seconds.iter().map(|s| Time::Seconds(*s).nanoseconds()).collect(),
            None => recording.time_ns.iter().map(|t| i128::from(*t)).collect(),
        };
        let time_ns: Vec<i128> = time_ns.into_iter().map(|ns| on_common_clock(table, ns)).collect();
        let gauges = groups.iter().any(|(group, _)| *group == Group::Gauges);
        Ok(Self {
            calibration: recording.rig.load_cell.calibration.filter(|_| gauges),
            warnings: recording.warnings.iter().map(|w| format!("{}: {w}", table.file)).collect(),
            stream: Stream {
                file: table.file.clone(),
                time_ns: Vec::new(),
                groups,
                attitude,
                joints: joints(&recording, rig),
                rate_hz: measured_rate(&recording.time_ns).unwrap_or(0.0) / table.clock_rate,
                discarded: 0,
                stamped: Stamped {
                    offset_s: table.clock_offset_s,
                    rate: table.clock_rate,
                    ..Stamped::default()
                },
            },
            time_ns,
        })
    }

    /// The group delay that the rig file states for what it carries.
    fn delay_s(&self, rig: &RigFile) -> f64 {
        delay_s(self.stream.groups.iter().map(|(group, _)| *group), rig)
    }
}

/// The group delay that a rig file states for what a stream carries, s.
pub(super) fn delay_s(groups: impl Iterator<Item = Group>, rig: &RigFile) -> f64 {
    let delays = groups.filter_map(|group| match group {
        Group::Wrench | Group::Gauges => Some(rig.load_cell.group_delay_s),
        Group::Accel(j) | Group::Gyro(j) => rig.imu_on(j).map(|imu| imu.group_delay_s),
        _ => None,
    });
    delays.fold(0.0, f64::max)
}

/// A rig file as it fits the recording on the grid.
pub(super) fn on_grid(rig: &RigFile) -> RigFile {
    let mut rig = rig.clone();
    rig.stream.clear();
    rig.recording = RecordingTable {
        gravity_mps2: rig.recording.gravity_mps2,
        rate_hz: rig.recording.rate_hz,
        // What repeats itself was left out before the kernel; attitudes may rest.
        frozen_after: 0,
        ..RecordingTable::default()
    };
    rig
}

/// Returns the time of the common clock for one of a stream's own, ns.
fn on_common_clock(table: &StreamTable, own_ns: i128) -> i128 {
    let moved = 1e9 * table.clock_offset_s + (table.clock_rate - 1.0) * own_ns as f64;
    own_ns.saturating_add(moved.round() as i128)
}

/// Returns the columns that are of joints, by the rig file's `[[joint]]` tables or by their units, as far as
/// they are numbers.
fn joints(recording: &Recording, rig: &RigFile) -> Vec<(String, Vec<f64>)> {
    let named = |name: &str| {
        let sources = rig.joint.iter().flat_map(|table| [&table.position, &table.rate, &table.effort]);
        sources.flatten().any(|source| source.parts().0 == name)
    };
    let by_unit = |name: &str| {
        name.rsplit_once('_').is_some_and(|(joint, unit)| !joint.is_empty() && JOINT_UNITS.contains(&unit))
    };
    let number = |cell: &String| cell.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    recording
        .extra
        .iter()
        .filter(|(name, _)| named(name) || by_unit(name))
        .filter_map(|(name, cells)| Some((name.clone(), cells.iter().map(number).collect::<Option<_>>()?)))
        .collect()
}

/// Turns the signs of quaternions, given by column, so that none jumps: q and −q are the same attitude.
pub(super) fn keep_signs(columns: &mut [Vec<f64>]) {
    let rows = columns.iter().map(Vec::len).min().unwrap_or(0);
    for row in 1..rows {
        let along: f64 = columns.iter().map(|c| c[row - 1] * c[row]).sum();
        if along < 0.0 {
            columns.iter_mut().for_each(|c| c[row] = -c[row]);
        }
    }
}

/// Attitudes from the nine columns of a matrix.
fn matrices(
    recording: &Recording,
    table: &RotationMatrixTable,
    file: &str,
) -> Result<Vec<UnitQuaternion<f64>>, StreamError> {
    let cells = |name: &String| {
        recording.extra.iter().find(|(n, _)| n == name).map(|(_, cells)| cells).ok_or_else(|| {
            StreamError::NoColumn {
                file: file.to_owned(),
                column: name.clone(),
                there: recording.extra.iter().map(|(n, _)| n.as_str()).collect::<Vec<_>>().join(", "),
            }
        })
    };
    let columns = table.columns.iter().map(cells).collect::<Result<Vec<_>, _>>()?;
    let rows = columns.iter().map(|c| c.len()).min().unwrap_or(0);
    (0..rows)
        .map(|row| {
            let mut elements = [0.0; 9];
            for ((element, cells), name) in elements.iter_mut().zip(&columns).zip(&table.columns) {
                let cell = cells.get(row).map_or("", String::as_str);
                let value = cell.parse().ok().filter(|v: &f64| v.is_finite());
                *element = value.ok_or_else(|| StreamError::NotANumber {
                    file: file.to_owned(),
                    row: row + 1,
                    column: name.clone(),
                    cell: cell.to_owned(),
                })?;
            }
            let stated = Matrix3::from_row_slice(&elements);
            let off = (stated.transpose() * stated - Matrix3::identity()).amax();
            let refused =
                |what: String| StreamError::NotARotation { file: file.to_owned(), row: row + 1, what };
            if off > ORTHONORMAL {
                return Err(refused(format!("its columns are {off:.2e} from orthonormal")));
            }
            if stated.determinant() < 0.0 {
                return Err(refused("it is a reflection, determinant −1".to_owned()));
            }
            let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_eps(
                &stated,
                1e-14,
                20,
                Rotation3::from_matrix_unchecked(stated),
            ));
            Ok(if table.is_s_in_a() { rotation } else { rotation.inverse() })
        })
        .collect()
}

/// Attitudes from the measured pose of the plate on which the load cell sits.
fn platform_attitude(
    recording: &Recording,
    rig: &RigFile,
    file: &str,
) -> Result<Option<Vec<UnitQuaternion<f64>>>, StreamError> {
    let Some(poses) = &recording.platform else { return Ok(None) };
    let on_plate = on_plate(rig);
    let rows = poses.iter().enumerate();
    rows.map(|(row, pose)| attitude(pose, &on_plate, file, row)).collect::<Result<Vec<_>, _>>().map(Some)
}

fn quaternion([w, x, y, z]: [f64; 4]) -> nalgebra::Quaternion<f64> {
    nalgebra::Quaternion::new(w, x, y, z)
}

/// `R_PS` of the load cell on the plate.
pub(super) fn on_plate(rig: &RigFile) -> UnitQuaternion<f64> {
    let place = rig.platform.as_ref().and_then(|p| p.load_cell.as_ref());
    place.map_or_else(UnitQuaternion::identity, |place| {
        UnitQuaternion::from_quaternion(quaternion(place.rotation_wxyz))
    })
}

/// `R_AS` by the pose of the plate in a row, counted from 0.
pub(super) fn attitude(
    [_, _, _, w, x, y, z]: &[f64; 7],
    on_plate: &UnitQuaternion<f64>,
    file: &str,
    row: usize,
) -> Result<UnitQuaternion<f64>, StreamError> {
    let q = quaternion([*w, *x, *y, *z]);
    if (q.norm() - 1.0).abs() > ORTHONORMAL {
        let what = format!("the norm of its quaternion is {:.4}", q.norm());
        return Err(StreamError::NotARotation { file: file.to_owned(), row: row + 1, what });
    }
    Ok(UnitQuaternion::from_quaternion(q) * on_plate)
}

/// Takes out rows beyond a sensor's range, or of a channel that repeats itself: after the kernel neither
/// shows any more.
fn screen(stream: &mut Stream, rig: &RigFile, warnings: &mut Vec<String>) {
    let mut bad = vec![false; stream.time_ns.len()];
    let after = usize::from(rig.recording.frozen_after);
    for (group, columns) in &stream.groups {
        // A joint may be at rest.
        if matches!(group, Group::Attitude(_)) {
            continue;
        }
        for (k, column) in columns.iter().enumerate() {
            let range = match group {
                Group::Wrench => rig.load_cell.range_n_nm.and_then(|r| r.get(k).copied()),
                Group::Accel(j) => rig.imu_on(*j).and_then(|imu| imu.range_mps2),
                Group::Gyro(j) => rig.imu_on(*j).and_then(|imu| imu.range_radps),
                _ => None,
            };
            let range = range.unwrap_or(f64::INFINITY);
            let mut row = 0;
            for equal in column.chunk_by(|a, b| a == b) {
                // A quantity that is zero throughout is not measured at all.
                let frozen = after > 0 && equal.len() > after && equal.len() < column.len();
                let beyond = equal.first().is_some_and(|v| v.abs() >= range);
                for flag in bad.iter_mut().skip(row).take(equal.len()) {
                    *flag |= frozen || beyond;
                }
                row += equal.len();
            }
        }
    }
    stream.discarded = bad.iter().filter(|b| **b).count();
    if stream.discarded == 0 {
        return;
    }
    warnings.push(format!(
        "{}: {} rows are not used: a channel is beyond its range or repeats itself more than {} times",
        stream.file, stream.discarded, rig.recording.frozen_after
    ));
    let mut keep = bad.iter().map(|b| !b);
    stream.time_ns.retain(|_| keep.next().unwrap_or(true));
    let groups = stream.groups.iter_mut().flat_map(|(_, columns)| columns);
    for column in groups.chain(stream.joints.iter_mut().map(|(_, column)| column)) {
        let mut keep = bad.iter().map(|b| !b);
        column.retain(|_| keep.next().unwrap_or(true));
    }
    if let Some(attitude) = &mut stream.attitude {
        let mut keep = bad.iter().map(|b| !b);
        attitude.retain(|_| keep.next().unwrap_or(true));
    }
}
