use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::Failure;
use crate::screen::terms::in_own_terms;

/// The folder that this process writes its answer into.
static ANSWERED_IN: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Leaves the object of a command that failed in its folder, if it has one by now and no result in it.
pub(crate) fn note_failure(object: &serde_json::Value) {
    let folder = ANSWERED_IN.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(path) = folder {
        // What failed has been reported; a result that is there already says so too.
        let _ = Folder { path }.write_text("result.json", &format!("{object:#}"));
    }
}

/// The folder that a command writes into. Nothing in it is ever overwritten.
#[derive(Debug, Clone)]
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// Returns `wanted` if it is new or empty; without it, makes a new folder `rigident-NAME-…` under the
    /// current one.
    ///
    /// # Errors
    /// The folder holds something, or cannot be made.
    pub fn new(wanted: Option<&Path>, name: &str) -> Result<Self, Failure> {
        let folder = Self::made(wanted, name)?;
        *ANSWERED_IN.lock().unwrap_or_else(PoisonError::into_inner) = Some(folder.path.clone());
        Ok(folder)
    }

    /// Refuses a folder that [`Folder::new`] would refuse because it holds something; nothing is made.
    ///
    /// # Errors
    /// The folder is not empty, or is no folder.
    pub fn check(wanted: &Path) -> Result<(), Failure> {
        match fs::read_dir(wanted) {
            Ok(mut entries) => entries.next().map_or(Ok(()), |_| Err(not_empty(wanted))),
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                Err(Failure::input(format!("folder {} cannot be read: {e}", wanted.display())))
            }
            Err(_) => Ok(()),
        }
    }

    fn made(wanted: Option<&Path>, name: &str) -> Result<Self, Failure> {
        let Some(path) = wanted else { return Self::numbered(name) };
        fs::create_dir_all(path)
            .map_err(|e| Failure::input(format!("folder {} cannot be made: {e}", path.display())))?;
        let mut entries = fs::read_dir(path)
            .map_err(|e| Failure::input(format!("folder {} cannot be read: {e}", path.display())))?;
        if entries.next().is_some() {
            return Err(not_empty(path));
        }
        Ok(Self { path: path.to_owned() })
    }

    fn numbered(name: &str) -> Result<Self, Failure> {
        for number in 1..10_000 {
            let path = PathBuf::from(format!("rigident-{name}-{number:03}"));
            match fs::create_dir(&path) {
                Ok(()) => return Ok(Self { path }),
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(e) => {
                    return Err(Failure::input(format!(
                        "folder {} cannot be made here: {e}; give --out a place to write to",
                        path.display()
                    )));
                }
            }
        }
        Err(Failure::input(format!(
            "ten thousand folders rigident-{name}-… are here: give --out another place"
        )))
    }

    /// Returns where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the path of a file in the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes an answer, or a page of it, in the terms of the command line, otherwise as [`Folder::write`]
    /// does.
    ///
    /// # Errors
    /// Fails as [`Folder::write`] does.
    pub fn write_text(&self, name: &str, text: &str) -> Result<PathBuf, Failure> {
        self.write(name, in_own_terms(text).as_bytes())
    }

    /// Writes a file whole or not at all: into a temporary file beside it, flushed to the disk, then renamed.
    ///
    /// # Errors
    /// The file is there already, or the disk is full or gone; no half file is left.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, Failure> {
        let path = self.file(name);
        let failed = |e: &dyn std::fmt::Display| {
            Failure::input(format!(
                "{} cannot be written: {e}; nothing was left half-written",
                path.display()
            ))
        };
        let mut file = readable_by_others().tempfile_in(&self.path).map_err(|e| failed(&e))?;
        file.write_all(bytes).and_then(|()| file.as_file().sync_all()).map_err(|e| failed(&e))?;
        file.persist_noclobber(&path).map_err(|e| failed(&e.error))?;
        Ok(path)
    }
}

fn not_empty(path: &Path) -> Failure {
    Failure::input(format!(
        "folder {} is not empty and nothing is overwritten: give --out another one",
        path.display()
    ))
}

/// Returns a builder of temporary files that others may read: they are private unless set otherwise, and an
/// answer is not.
fn readable_by_others() -> tempfile::Builder<'static, 'static> {
    #[cfg_attr(not(unix), allow(unused_mut, reason = "permissions are Unix'"))]
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_overwritten() {
        let outer = tempfile::tempdir().unwrap();
        let path = outer.path().join("answers");
        let folder = Folder::new(Some(&path), "x").unwrap();
        folder.write("result.json", b"one").unwrap();
        assert!(folder.write("result.json", b"two").is_err());
        assert_eq!(fs::read(path.join("result.json")).unwrap(), b"one");
        assert_eq!(fs::read_dir(&path).unwrap().count(), 1);
        assert!(Folder::new(Some(&path), "x").is_err());
    }
}
