//! The folder that `ros2 bag record` makes: `metadata.yaml`, and the files of the bag, split and compressed
//! as that says.

use std::io::Read;
use std::path::{Path, PathBuf};

use rigident_files::{MOST_OF_RECORDING, MOST_OF_TEXT};

use crate::recording::{RecordingError, extension};

/// The file that describes a bag in its folder.
const METADATA: &str = "metadata.yaml";
/// Files of a bag unpack to no more than this each, bytes, or to [`MOST_PACKED`] times their length.
const LARGEST: u64 = 1 << 28;
/// Sensors are noisy, and noise does not pack.
const MOST_PACKED: u64 = 64;

/// The files of a bag, unpacked.
#[derive(Debug, Default)]
pub(in crate::recording) struct Files {
    /// The bytes of each.
    pub(in crate::recording) bytes: Vec<Vec<u8>>,
    /// Each message is packed by itself (zstd).
    pub(in crate::recording) packed_messages: bool,
}

/// The fields used of `metadata.yaml`.
#[derive(Debug, Default, PartialEq, Eq)]
struct Metadata {
    files: Vec<String>,
    format: String,
    mode: String,
}

/// Returns true of a folder that holds a bag: its description, or files of one.
pub fn is_bag_folder(path: &Path) -> bool {
    path.is_dir() && (path.join(METADATA).is_file() || !bags_in(path).is_empty())
}

/// Returns true of a file's name that is that of a bag, packed as a whole or not.
pub(in crate::recording) fn is_bag_file(path: &Path) -> bool {
    match extension(path).as_str() {
        "mcap" | "db3" | "bag" => true,
        "zstd" => {
            path.file_stem().is_some_and(|stem| matches!(extension(Path::new(stem)).as_str(), "mcap" | "db3"))
        }
        _ => false,
    }
}

/// Reads the files of a bag: of a folder all of them in their order, else the file itself.
///
/// # Errors
/// [`RecordingError`]: the folder holds no bag, a file is missing or cannot be read, or its packing is none that is known.
pub(in crate::recording) fn read(path: &Path) -> Result<Files, RecordingError> {
    if !path.is_dir() {
        return Ok(Files { bytes: vec![unpacked(path)?], packed_messages: false });
    }
    let not = |reason: String| RecordingError::NotARecording { name: path.display().to_string(), reason };
    let described = path.join(METADATA);
    let metadata = if described.is_file() {
        let text = rigident_files::read(&described, MOST_OF_TEXT).map_err(|e| unreadable(&described, &e))?;
        metadata(&String::from_utf8_lossy(&text))
    } else {
        Metadata::default()
    };
    let files: Vec<PathBuf> = if metadata.files.is_empty() {
        bags_in(path)
    } else {
        // Older bags name them with their folder.
        let names = metadata.files.iter().filter_map(|file| Path::new(file).file_name());
        names.map(|name| path.join(name)).collect()
    };
    if files.is_empty() {
        return Err(not(
            "its metadata.yaml names no files, and there is no .mcap or .db3 beside it".to_owned()
        ));
    }
    if let Some(missing) = files.iter().find(|file| !file.is_file()) {
        let name = missing.file_name().unwrap_or_default().to_string_lossy();
        return Err(not(format!(
            "its metadata.yaml names {name}, which is not in the folder: copy the whole folder"
        )));
    }
    if !metadata.mode.is_empty() && !metadata.format.is_empty() && metadata.format != "zstd" {
        return Err(not(format!(
            "it is packed as {}, which is not read: ROS 2 packs as zstd; `ros2 bag convert` unpacks it",
            metadata.format
        )));
    }
    let bytes = files.iter().map(|file| unpacked(file)).collect::<Result<_, _>>()?;
    Ok(Files { bytes, packed_messages: metadata.mode.eq_ignore_ascii_case("message") })
}

fn unreadable(path: &Path, error: &std::io::Error) -> RecordingError {
    RecordingError::Unreadable { path: path.display().to_string(), reason: error.to_string() }
}

/// Reads a file, unpacked if its name says that it is packed.
fn unpacked(path: &Path) -> Result<Vec<u8>, RecordingError> {
    let bytes = rigident_files::read_or_pipe(path, MOST_OF_RECORDING).map_err(|e| unreadable(path, &e))?;
    if extension(path) != "zstd" {
        return Ok(bytes);
    }
    unpack(&bytes)
        .map_err(|reason| RecordingError::NotARecording { name: path.display().to_string(), reason })
}

/// Returns true if messages of some bytes, packed, are more than sensors record once they are unpacked.
pub(super) fn is_too_much(packed: usize, unpacked: usize) -> bool {
    unpacked as u64 > LARGEST.saturating_add(MOST_PACKED.saturating_mul(packed as u64))
}

/// Unpacks bytes that zstd packed.
///
/// # Errors
/// They are damaged, or unpack to more than sensors record.
pub(super) fn unpack(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let most = LARGEST.max(MOST_PACKED.saturating_mul(bytes.len() as u64));
    let damaged = |e: std::io::Error| format!("it cannot be unpacked (zstd): {e}");
    let mut out = Vec::new();
    let reader = zstd::Decoder::new(bytes).map_err(damaged)?;
    reader.take(most + 1).read_to_end(&mut out).map_err(damaged)?;
    if out.len() as u64 > most {
        return Err(format!("it unpacks to more than {most} bytes, which no sensor records"));
    }
    Ok(out)
}

/// Returns the files of a bag in a folder, in the order of their numbers: `run_2.mcap` before `run_10.mcap`.
fn bags_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    // Bags of ROS 1 are files by themselves.
    let is_part = |path: &PathBuf| is_bag_file(path) && extension(path) != "bag" && path.is_file();
    let mut files: Vec<PathBuf> = entries.filter(is_part).collect();
    files.sort_by_key(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        (name.len(), name)
    });
    files
}

/// Takes what is used out of the description; ROS 2 writes a key a line, and a file a line of a list.
fn metadata(text: &str) -> Metadata {
    let mut found = Metadata::default();
    let mut in_files = false;
    for line in text.lines().map(str::trim) {
        let plain = |value: &str| value.trim().trim_matches(['\'', '"']).to_owned();
        if let Some(file) = line.strip_prefix("- ").filter(|_| in_files) {
            found.files.push(plain(file));
            continue;
        }
        let Some((key, value)) = line.split_once(':') else { continue };
        in_files = key == "relative_file_paths";
        match key {
            "compression_format" => found.format = plain(value),
            "compression_mode" => found.mode = plain(value),
            // The list in one line.
            "relative_file_paths" => {
                let list = value.trim().trim_start_matches('[').trim_end_matches(']');
                found.files.extend(list.split(',').map(plain).filter(|file| !file.is_empty()));
            }
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Recording;
    use crate::recording::mcap::messages::write_numbers;

    fn wrench(k: u64) -> [f64; 6] {
        [0.1 * k as f64, 1.0, -2.0, 0.3, 0.02 * k as f64, 0.0]
    }

    /// Writes a database as `ros2 bag record` does; with `packed`, the messages of one topic are compressed
    /// one by one.
    fn database(path: &Path, rows: std::ops::Range<u64>, packed: bool) {
        let bag = rusqlite::Connection::open(path).unwrap();
        bag.execute_batch(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);
             CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);
             INSERT INTO topics VALUES(7, '/ft', 'geometry_msgs/msg/WrenchStamped', 'cdr');",
        )
        .unwrap();
        for k in rows {
            let time = 1_000_000_000 + 10_000_000 * k;
            let data = write_numbers(time, "S", &wrench(k));
            let data = if packed { zstd::encode_all(data.as_slice(), 3).unwrap() } else { data };
            let values = rusqlite::params![time as i64, data];
            bag.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(7, ?1, ?2)", values).unwrap();
        }
    }

    const DESCRIPTION: &str = "rosbag2_bagfile_information:\n  compression_format: ''\n  files:\n  - path: \
                               b.mcap\n  relative_file_paths:\n  - 'run/b.mcap'\n  - a.mcap\n  \
                               storage_identifier: mcap\n";

    #[test]
    fn descriptions_are_read_in_both_forms_of_a_list() {
        let found = metadata(DESCRIPTION);
        assert_eq!(
            found,
            Metadata { files: vec!["run/b.mcap".into(), "a.mcap".into()], ..Metadata::default() }
        );
        let inline = metadata(
            "relative_file_paths: [x_0.db3.zstd, \"x_1.db3.zstd\"]\ncompression_mode: \
             FILE\ncompression_format: zstd",
        );
        assert_eq!(inline.files, ["x_0.db3.zstd", "x_1.db3.zstd"]);
        assert_eq!((inline.mode.as_str(), inline.format.as_str()), ("FILE", "zstd"));
    }

    #[test]
    fn a_folder_is_one_recording_of_all_its_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        std::fs::create_dir(&path).unwrap();
        database(&path.join("b.db3"), 0..60, false);
        database(&path.join("a.db3"), 60..100, false);
        let description = DESCRIPTION.replace(".mcap", ".db3");
        let whole = |path: &Path| {
            let whole = Recording::load(path, None).unwrap();
            assert_eq!(whole.wrench, Some((0..100).map(wrench).collect()));
            whole.name
        };
        // With a description, and by the names alone.
        std::fs::write(path.join(METADATA), &description).unwrap();
        assert!(is_bag_folder(&path));
        assert_eq!(whole(&path), "run");
        std::fs::remove_file(path.join(METADATA)).unwrap();
        whole(&path);
        // Packed as files are.
        let packed = zstd::encode_all(std::fs::read(path.join("b.db3")).unwrap().as_slice(), 3).unwrap();
        std::fs::remove_file(path.join("b.db3")).unwrap();
        std::fs::write(path.join("b.db3.zstd"), &packed).unwrap();
        whole(&path);
        assert_eq!(Recording::load(&path.join("b.db3.zstd"), None).unwrap().rows(), 60);
        std::fs::write(path.join(METADATA), &description).unwrap();
        let said = Recording::load(&path, None).unwrap_err().to_string();
        assert!(said.contains("names b.db3, which is not in the folder"), "{said}");
        assert!(!is_bag_folder(folder.path()));
        // Packed message by message.
        let path = folder.path().join("packed");
        std::fs::create_dir(&path).unwrap();
        database(&path.join("b.db3"), 0..60, true);
        database(&path.join("a.db3"), 60..100, true);
        let mode = description
            .replace("compression_format: ''", "compression_format: zstd\n  compression_mode: MESSAGE");
        std::fs::write(path.join(METADATA), mode).unwrap();
        whole(&path);
    }

    #[test]
    #[ignore = "needs ../shared/cases"]
    fn shared_cases_hold_a_folder_that_is_the_file_within() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/cases/rosbag-folder/mcap");
        let whole = Recording::load(&folder, None).unwrap();
        let file = Recording::load(&folder.join("mcap.mcap"), None).unwrap();
        assert_eq!((whole.rows(), &whole.wrench), (file.rows(), &file.wrench));
        assert!(whole.rows() > 900);
    }
}
