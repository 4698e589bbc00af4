//! What the commands take as a recording: one file, or several with clocks of their own.

use std::path::{Path, PathBuf};

use super::Failure;
use rigident::problem::clocks::StreamSet;
use rigident_io::recording::mcap::folder::is_bag_folder;
use rigident_io::recording::{Recording, extension, is_text, rig_path};
use rigident_io::rig::RigFile;

/// Returns the files with clocks of their own that a path stands for: a rig file that lists `[[stream]]` files, or their
/// folder, `rig` listing them; `None` of a single recording.
///
/// # Errors
/// Bad input: a listing that cannot be read, or is not given as one.
pub(super) fn stream_set(path: &Path, rig: Option<&Path>) -> Result<Option<StreamSet>, Failure> {
    if is_bag_folder(path) && listing(path, rig).is_none() {
        return Ok(None);
    }
    let set = match rig {
        None if is_rig_file(path) => StreamSet::load(path, None),
        Some(_) if is_rig_file(path) => {
            return Err(Failure::input(format!(
                "{} is a rig file itself, whose [[stream]] files are the recording: give it without --rig",
                path.display()
            )));
        }
        Some(rig) if path.is_dir() => StreamSet::load(rig, Some(path)),
        None if path.is_dir() => {
            return Err(Failure::input(format!(
                "{} is a folder without a bag of ROS 2 (metadata.yaml with .mcap or .db3): of files with clocks of their own give the \
                 rig file that lists them as [[stream]] by --rig",
                path.display()
            )));
        }
        _ => {
            if let Some(listing) = listing(path, rig) {
                let listing = listing.display();
                return Err(Failure::input(format!(
                    "{listing} lists several files as one recording ([[stream]]): give the rig file itself, {listing}, in place of {}",
                    path.display()
                )));
            }
            return Ok(None);
        }
    };
    set.map(Some).map_err(Failure::input)
}

/// Names of joints that a recording has positions of, by its columns.
pub(super) fn joints_of(recording: &Recording) -> Vec<String> {
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

/// What of a recording of several links has no part where one body is identified.
pub(super) fn left_out_columns(recording: &Recording, joints: &[String]) -> Option<String> {
    let mut columns: Vec<String> = Vec::new();
    for (j, imu) in recording.imus.iter().enumerate().skip(1) {
        if imu.accel.is_some() || imu.gyro.is_some() {
            columns.push(format!("imu{j}_…"));
        }
    }
    columns.extend(recording.attitudes.iter().filter(|(j, _)| *j > 0).map(|(j, _)| format!("q{j}_…")));
    columns.extend(joints.iter().map(|joint| format!("{joint}_…")));
    (!columns.is_empty()).then(|| {
        format!(
            "one rigid body is identified, and columns of other links are not used: {}. Several links need [[link]] tables in \
             the rig file, or --model",
            columns.join(", ")
        )
    })
}

/// Returns where the columns of a recording were found, if neither its names nor a rig file say it.
pub(super) fn assumed_columns(recording: &Recording) -> Option<String> {
    let assumed = recording.assumed.as_ref()?;
    Some(format!(
        "{assumed}; the wrench is taken to be that on the body. `rigident import` writes a rig file that says so, to be changed"
    ))
}

/// The rig file that lists the streams of [`super::live`].
pub(super) const STREAMS: &str = "streams.rig.toml";

/// Returns the recording that a path names where files with clocks of their own are taken: of a folder that `live` wrote its
/// streams.
pub(super) fn listed(path: PathBuf) -> PathBuf {
    let streams = path.join(STREAMS);
    if streams.is_file() { streams } else { named(path) }
}

/// Returns the one file that a path names: of a folder that `demo`, `run` or `live` wrote the one beside their result, else the path.
pub(super) fn named(path: PathBuf) -> PathBuf {
    let names = ["run.mcap", "demo.mcap", "demo.csv", "live.mcap"];
    let own = names.iter().map(|name| path.join(name)).find(|file| file.is_file());
    own.filter(|_| path.join("result.json").is_file()).unwrap_or(path)
}

/// Whether a file holds a recording, or lists the files of one; by its name.
pub(super) fn is_recording(path: &Path) -> bool {
    is_rig_file(path)
        || path.is_dir()
        || is_text(&extension(path))
        || matches!(extension(path).as_str(), "mcap" | "db3" | "parquet" | "mat")
}

/// Whether a path is a rig file's, by its name.
pub(super) fn is_rig_file(path: &Path) -> bool {
    path.to_string_lossy().ends_with(".rig.toml")
}

/// Refuses several files with clocks of their own where one recording is needed.
///
/// # Errors
/// Bad input.
pub(super) fn refuse_streams(path: &Path, rig: Option<&Path>, command: &str) -> Result<(), Failure> {
    let given = (is_rig_file(path) || path.is_dir()).then(|| rig.filter(|_| path.is_dir()).unwrap_or(path));
    let Some(listing) = given.map(Path::to_owned).or_else(|| listing(path, rig)) else { return Ok(()) };
    Err(Failure::input(format!(
        "{} is no single recording: `rigident {command}` takes one CSV or MCAP file of one clock; several files with clocks \
         of their own, which a rig file lists as [[stream]], are for `rigident identify`, `factor` and `--tare`: `rigident \
         identify {}`",
        path.display(),
        if listing.is_dir() {
            format!("{} --rig RIG", path.display())
        } else {
            listing.display().to_string()
        }
    )))
}

/// The rig file of a recording if it lists `[[stream]]` files. One that cannot be read is another's to complain of.
fn listing(path: &Path, rig: Option<&Path>) -> Option<std::path::PathBuf> {
    let rig = rig.map_or_else(|| rig_path(path), Path::to_owned);
    RigFile::load(&rig).is_ok_and(|file| !file.stream.is_empty()).then_some(rig)
}
