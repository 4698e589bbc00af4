use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::Failure;

/// The folder that a command writes into. Nothing in it is ever overwritten.
#[derive(Debug, Clone)]
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// `wanted` if it is new or empty; without it, a new folder `rigident-NAME-…` under the current one.
    ///
    /// # Errors
    /// The folder holds something, or cannot be made.
    pub fn new(wanted: Option<&Path>, name: &str) -> Result<Self, Failure> {
        let Some(path) = wanted else { return Self::numbered(name) };
        fs::create_dir_all(path)
            .map_err(|e| Failure::input(format!("folder {} cannot be made: {e}", path.display())))?;
        let mut entries = fs::read_dir(path)
            .map_err(|e| Failure::input(format!("folder {} cannot be read: {e}", path.display())))?;
        if entries.next().is_some() {
            return Err(Failure::input(format!(
                "folder {} is not empty and nothing is overwritten: give --out another one",
                path.display()
            )));
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

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
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

/// Temporary files are private unless told otherwise; an answer is not.
fn readable_by_others() -> tempfile::Builder<'static, 'static> {
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
