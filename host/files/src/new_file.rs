//! Files that are whole or not there, and never take another's place.

use std::fs::File;
use std::io::{BufWriter, Error, ErrorKind, Write};
use std::path::Path;

/// Why a new file is not written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NewFileError {
    /// Something of that name is there: a file, a folder, or a link, wherever that leads.
    #[error("{0} is there already, and nothing is overwritten: give another name, or move it away")]
    Exists(String),
    /// It cannot be written.
    #[error("{path} cannot be written: {reason}; nothing was left half-written")]
    Unwritable {
        /// The file.
        path: String,
        /// The message of the system.
        reason: String,
    },
}

/// Refuses a name that is taken, by a link that leads nowhere too.
///
/// # Errors
/// [`NewFileError::Exists`].
pub fn check_new(path: &Path) -> Result<(), NewFileError> {
    match path.symlink_metadata() {
        Ok(_) => Err(NewFileError::Exists(path.display().to_string())),
        Err(_) => Ok(()),
    }
}

/// Writes a new file: into a temporary one in the same folder, flushed to the disk, then given its name.
///
/// # Errors
/// A file of that name is there, or the system refuses (a full disk); then nothing is left of the new one.
pub fn write_new<E: Into<RefusedWrite>>(
    path: &Path,
    write: impl FnOnce(BufWriter<File>) -> Result<BufWriter<File>, E>,
) -> Result<(), NewFileError> {
    let refused = |e: &Error| NewFileError::Unwritable {
        path: path.display().to_string(),
        reason: match e.kind() {
            ErrorKind::StorageFull => format!("the disk is full ({e}); make room or write elsewhere"),
            _ => e.to_string(),
        },
    };
    // Found out now rather than after a long job; the rename below checks again.
    check_new(path)?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (file, temporary) = tempfile::Builder::new()
        .prefix(".rigident-")
        .permissions_like_new()
        .tempfile_in(folder)
        .map_err(|e| refused(&e))?
        .into_parts();
    let written = write(BufWriter::new(file)).map_err(|e| refused(&e.into().0))?;
    let file = written.into_inner().map_err(|e| refused(e.error()))?;
    file.sync_all().map_err(|e| refused(&e))?;
    temporary.persist_noclobber(path).map_err(|e| match e.error.kind() {
        ErrorKind::AlreadyExists => NewFileError::Exists(path.display().to_string()),
        _ => refused(&e.error),
    })
}

/// Writes a new file from text that is in memory.
///
/// # Errors
/// Fails as [`write_new`] does.
pub fn write_new_text(path: &Path, text: &str) -> Result<(), NewFileError> {
    write_new_bytes(path, text.as_bytes())
}

/// Writes a new file from bytes that are in memory.
///
/// # Errors
/// Fails as [`write_new`] does.
pub fn write_new_bytes(path: &Path, bytes: &[u8]) -> Result<(), NewFileError> {
    write_new(path, |mut file| {
        file.write_all(bytes)?;
        Ok::<_, Error>(file)
    })
}

/// The error of a writer when it cannot go on.
#[derive(Debug)]
pub struct RefusedWrite(pub Error);

impl From<Error> for RefusedWrite {
    fn from(error: Error) -> Self {
        Self(error)
    }
}

/// Temporary files are private; a recording is to be as readable as any new file.
trait PermissionsLikeNew {
    fn permissions_like_new(&mut self) -> &mut Self;
}

impl PermissionsLikeNew for tempfile::Builder<'_, '_> {
    #[cfg(unix)]
    fn permissions_like_new(&mut self) -> &mut Self {
        use std::os::unix::fs::PermissionsExt;
        // The process' umask is taken off by the system.
        self.permissions(std::fs::Permissions::from_mode(0o666))
    }

    #[cfg(not(unix))]
    fn permissions_like_new(&mut self) -> &mut Self {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> usize {
        std::fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn nothing_is_overwritten_and_nothing_half_written_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        write_new_text(&path, "one").unwrap();
        assert_eq!(write_new_text(&path, "two"), Err(NewFileError::Exists(path.display().to_string())));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "one");
        let full = write_new(&folder.path().join("b.csv"), |mut file| {
            file.write_all(&[b'x'; 100_000])?;
            Err(Error::from(ErrorKind::StorageFull))
        });
        let message = full.unwrap_err().to_string();
        assert!(message.contains("disk is full") && message.contains("half-written"), "{message}");
        assert_eq!(names(folder.path()), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_that_leads_nowhere_is_not_written_through() {
        let folder = tempfile::tempdir().unwrap();
        let (link, target) = (folder.path().join("a.script"), folder.path().join("target"));
        std::os::unix::fs::symlink(&target, &link).unwrap();
        let exists = Err(NewFileError::Exists(link.display().to_string()));
        assert_eq!(check_new(&link), exists);
        assert_eq!(write_new_text(&link, "text"), exists);
        assert!(!target.exists());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_device_is_said_and_leaves_nothing() {
        use std::io::BufWriter;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("b.csv");
        let result = write_new(&path, |_| {
            let mut full = BufWriter::new(std::fs::OpenOptions::new().write(true).open("/dev/full")?);
            full.write_all(b"more than fits")?;
            full.flush()?;
            Ok::<_, Error>(full)
        });
        assert!(result.unwrap_err().to_string().contains("disk is full"));
        assert_eq!(names(folder.path()), 0);
    }
}
