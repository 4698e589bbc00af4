//! Files that are read whole: regular ones, up to a size.

use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// The most bytes of a recording that is read whole.
pub const MOST_OF_RECORDING: u64 = 4 << 30;
/// The most bytes of a text: a rig file, a model, a result, a plan.
pub const MOST_OF_TEXT: u64 = 64 << 20;
/// The most bytes of a mesh.
pub const MOST_OF_MESH: u64 = 512 << 20;

/// Opens a regular file. Devices and pipes are refused before they are opened: some never end, and others
/// wait.
///
/// # Errors
/// Fails if the system refuses, or if the path is no regular file.
pub fn open(path: &Path) -> Result<File> {
    check(&std::fs::metadata(path)?)?;
    let file = File::open(path)?;
    // It may have become another one meanwhile.
    check(&file.metadata()?)?;
    Ok(file)
}

/// Opens a regular file or a pipe: a path on a command line may be the output of another program.
///
/// # Errors
/// Fails if the system refuses, or if the path is a device or a folder.
pub fn open_or_pipe(path: &Path) -> Result<File> {
    if is_pipe(&std::fs::metadata(path)?) { File::open(path) } else { open(path) }
}

#[cfg(unix)]
fn is_pipe(found: &Metadata) -> bool {
    std::os::unix::fs::FileTypeExt::is_fifo(&found.file_type())
}

#[cfg(not(unix))]
fn is_pipe(_: &Metadata) -> bool {
    false
}

fn check(found: &Metadata) -> Result<()> {
    if found.is_file() {
        Ok(())
    } else if found.is_dir() {
        Err(ErrorKind::IsADirectory.into())
    } else {
        Err(Error::new(
            ErrorKind::InvalidInput,
            "it is no regular file, but a device or a pipe: copy what it gives into a file",
        ))
    }
}

/// Reads a regular file of at most `most` bytes.
///
/// # Errors
/// Fails as [`open`] does, or if the file is larger than `most`.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    all_of(open(path)?, most)
}

/// Reads a regular file, or all that comes through a pipe, of at most `most` bytes.
///
/// # Errors
/// Fails as [`open_or_pipe`] does, or if there are more than `most` bytes.
pub fn read_or_pipe(path: &Path, most: u64) -> Result<Vec<u8>> {
    all_of(open_or_pipe(path)?, most)
}

fn all_of(file: File, most: u64) -> Result<Vec<u8>> {
    let size = file.metadata()?.len();
    let mut bytes = Vec::new();
    if size <= most {
        bytes
            .try_reserve_exact(usize::try_from(size).unwrap_or(usize::MAX))
            .map_err(|_| ErrorKind::OutOfMemory)?;
        file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    }
    if size > most || bytes.len() as u64 > most {
        let size = size.max(bytes.len() as u64);
        let why = format!("it has {size} bytes, and files of its kind are read up to {most}");
        return Err(Error::new(ErrorKind::FileTooLarge, why));
    }
    Ok(bytes)
}

/// Reads a regular file of at most [`MOST_OF_TEXT`] bytes as text.
///
/// # Errors
/// Fails as [`read`] does, or if the file is no UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    let bytes = read(path, MOST_OF_TEXT)?;
    String::from_utf8(bytes)
        .map_err(|_| Error::new(ErrorKind::InvalidData, "stream did not contain valid UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_files_and_folders_are_refused() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("a.toml");
        std::fs::write(&path, "four").unwrap();
        assert_eq!(read(&path, 4).unwrap(), b"four");
        assert_eq!(read_text(&path).unwrap(), "four");
        assert_eq!(read(&path, 3).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read(place.path(), 4).unwrap_err().kind(), ErrorKind::IsADirectory);
        std::fs::write(&path, b"\xff").unwrap();
        assert_eq!(read_text(&path).unwrap_err().kind(), ErrorKind::InvalidData);
        // A file that says that it has a terabyte takes no room.
        let sparse = File::create(&path).unwrap();
        if sparse.set_len(1 << 40).is_ok() {
            assert_eq!(read(&path, MOST_OF_RECORDING).unwrap_err().kind(), ErrorKind::FileTooLarge);
        }
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_pipes_are_refused_and_do_not_wait() {
        let place = tempfile::tempdir().unwrap();
        let pipe = place.path().join("pipe.toml");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let zeros = place.path().join("zeros.toml");
        std::os::unix::fs::symlink("/dev/zero", &zeros).unwrap();
        for path in [&pipe, &zeros] {
            let said = read_text(path).unwrap_err();
            assert_eq!(said.kind(), ErrorKind::InvalidInput, "{said}");
            assert!(said.to_string().contains("no regular file"), "{said}");
        }
    }
}
