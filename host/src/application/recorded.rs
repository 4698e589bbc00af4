//! The form in which jobs take a recording: one file, or several with clocks of their own.

use std::path::{Path, PathBuf};

use super::{Caller, Error, ListingError, Notice};
use rigident_identify::problem::clocks::StreamSet;
use rigident_io::recording::mcap::folder::is_bag_folder;
use rigident_io::recording::{Recording, extension, is_text, rig_path};
use rigident_io::rig::RigFile;

/// The rig file that lists the streams that a live run recorded, in its folder.
pub const STREAMS: &str = "streams.rig.toml";

/// The form in which a job takes a recording.
#[derive(Clone, Debug)]
pub enum Recorded {
    /// A file, a rig file that lists several, or their folder.
    File(PathBuf),
    /// A recording in memory, with its rig.
    Memory(Box<Recording>),
}

impl From<&str> for Recorded {
    fn from(path: &str) -> Self {
        Self::File(path.into())
    }
}

impl From<PathBuf> for Recorded {
    fn from(path: PathBuf) -> Self {
        Self::File(path)
    }
}

impl From<&Path> for Recorded {
    fn from(path: &Path) -> Self {
        Self::File(path.to_owned())
    }
}

impl From<Recording> for Recorded {
    fn from(recording: Recording) -> Self {
        Self::Memory(Box::new(recording))
    }
}

impl Recorded {
    /// Returns its path, or its name.
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Memory(recording) => recording.name.clone(),
        }
    }
}

/// Returns the files with clocks of their own that a path names: a rig file that lists `[[stream]]` files, or
/// their folder, `rig` listing them; `None` of a single recording.
///
/// # Errors
/// A listing that cannot be read, or is not given as one.
pub fn stream_set(path: &Path, rig: Option<&Path>) -> Result<Option<StreamSet>, Error> {
    if is_bag_folder(path) && listing(path, rig).is_none() {
        return Ok(None);
    }
    let set = match rig {
        None if is_rig_file(path) => StreamSet::load(path, None),
        Some(_) if is_rig_file(path) => return Err(ListingError::TwoRigs(path.to_owned()).into()),
        Some(rig) if path.is_dir() => StreamSet::load(rig, Some(path)),
        None if path.is_dir() => return Err(ListingError::Folder(path.to_owned()).into()),
        _ => {
            if let Some(listing) = listing(path, rig) {
                return Err(ListingError::OneOfSeveral { listing, given: path.to_owned() }.into());
            }
            return Ok(None);
        }
    };
    Ok(Some(set?))
}

/// Returns the rig file, or the folder, by which a path names several files with clocks of their own; `None`
/// of a single recording.
pub fn listing_of(path: &Path, rig: Option<&Path>) -> Option<PathBuf> {
    // A bag is one recording, unless a rig file lists its topics.
    let is_folder = path.is_dir() && !is_bag_folder(path);
    let given = (is_rig_file(path) || is_folder).then(|| rig.filter(|_| is_folder).unwrap_or(path));
    given.map(Path::to_owned).or_else(|| listing(path, rig))
}

/// Refuses several files with clocks of their own where one recording is needed; `job` is the name of what
/// needs it.
///
/// # Errors
/// [`ListingError::NotSingle`].
pub fn refuse_several(path: &Path, rig: Option<&Path>, job: &'static str) -> Result<(), Error> {
    let several = |listing| ListingError::NotSingle { given: path.to_owned(), listing, job };
    listing_of(path, rig).map_or(Ok(()), |listing| Err(several(listing).into()))
}

/// Returns the rig file of a recording if it lists `[[stream]]` files. One that cannot be read is another's
/// to complain of.
fn listing(path: &Path, rig: Option<&Path>) -> Option<PathBuf> {
    let rig = rig.map_or_else(|| rig_path(path), Path::to_owned);
    RigFile::load(&rig).is_ok_and(|file| !file.stream.is_empty()).then_some(rig)
}

/// Returns the names of joints that a recording has positions of, by its columns.
pub fn joints_of(recording: &Recording) -> Vec<String> {
    let names = recording.extra.iter().map(|(name, _)| name.as_str());
    let also = |joint: &str, units: [&str; 2]| {
        units.iter().any(|unit| recording.extra.iter().any(|(name, _)| *name == format!("{joint}_{unit}")))
    };
    names
        .filter_map(|name| {
            let (joint, units) = match name.strip_suffix("_rad") {
                Some(joint) => (joint, ["radps", "nm"]),
                None => (name.strip_suffix("_m")?, ["mps", "n"]),
            };
            also(joint, units).then(|| joint.to_owned())
        })
        .collect()
}

/// Returns what to say of columns of a recording of several links that have no part where one body is
/// identified.
pub(super) fn left_out_columns(recording: &Recording, joints: &[String]) -> Option<Notice> {
    let mut columns: Vec<String> = Vec::new();
    for (j, imu) in recording.imus.iter().enumerate().skip(1) {
        if imu.accel.is_some() || imu.gyro.is_some() {
            columns.push(format!("imu{j}_…"));
        }
    }
    columns.extend(recording.attitudes.iter().filter(|(j, _)| *j > 0).map(|(j, _)| format!("q{j}_…")));
    columns.extend(joints.iter().map(|joint| format!("{joint}_…")));
    (!columns.is_empty()).then_some(Notice::ColumnsLeftOut(columns))
}

/// Says where the columns of a recording were found, if neither its names nor a rig file say it.
pub(super) fn assumed_columns(recording: &Recording, caller: &Caller<'_>) -> Option<String> {
    let assumed = recording.assumed.as_ref()?;
    Some(caller.words(&Notice::ColumnsAssumed(assumed.to_string())))
}

/// Returns the recording that a path names where files with clocks of their own are taken: of a folder that
/// `live` wrote its streams.
pub fn listed(path: PathBuf) -> PathBuf {
    let streams = path.join(STREAMS);
    if streams.is_file() { streams } else { named(path) }
}

/// Returns the one file that a path names: of a folder that `demo`, `run` or `live` wrote the one beside
/// their result, else the path.
pub fn named(path: PathBuf) -> PathBuf {
    let names = ["run.mcap", "demo.mcap", "demo.csv", "live.mcap"];
    let own = names.iter().map(|name| path.join(name)).find(|file| file.is_file());
    own.filter(|_| path.join("result.json").is_file()).unwrap_or(path)
}

/// Returns true if a file holds a recording, or lists the files of one, by its name.
pub fn is_recording(path: &Path) -> bool {
    is_rig_file(path)
        || path.is_dir()
        || is_text(&extension(path))
        || matches!(
            extension(path).as_str(),
            "mcap" | "db3" | "bag" | "parquet" | "mat" | "tdms" | "xlsx" | "xlsm"
        )
}

/// Returns true if a path is a rig file's, by its name.
pub fn is_rig_file(path: &Path) -> bool {
    path.to_string_lossy().ends_with(".rig.toml")
}
