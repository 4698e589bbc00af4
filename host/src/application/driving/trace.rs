//! The agreement, the motion driven, and all that went over the line to a platform: recorded in a file,
//! line by line.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use serde_json::{Value, json};

use super::DrivingError;
use rigident_device::platform::{Said, Trace};
use rigident_io::behind::Behind;

/// A file of JSON objects, one a line: `t_s` since it was begun, and one other key that names what it is.
#[derive(Clone)]
pub struct TraceFile {
    file: Arc<Mutex<Behind>>,
    path: PathBuf,
    begun: Instant,
}

impl TraceFile {
    /// Creates a new file, whose time begins now.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn create(path: PathBuf) -> Result<Self, DrivingError> {
        let file =
            File::create_new(&path).map_err(|error| DrivingError::File { path: path.clone(), error })?;
        Ok(Self { file: Arc::new(Mutex::new(Behind::file(file))), path, begun: Instant::now() })
    }

    /// Returns where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Notes something under a name.
    pub fn note(&self, name: &str, value: &Value) {
        let line = json!({ "t_s": self.begun.elapsed().as_secs_f64(), name: value });
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        // A disk that is full ends the recording, which says so; nothing that moves waits for this file.
        let _ = writeln!(file, "{line}").and_then(|()| file.flush());
    }

    /// Returns what notes commands and replies as they go.
    pub fn of_the_line(&self) -> Trace {
        let own = self.clone();
        Arc::new(move |said| match said {
            Said::Command(command) => own.note("command", &json!(command)),
            Said::Reply(reply) => own.note("reply", &json!(reply)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_has_its_time_and_its_kind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.jsonl");
        let trace = TraceFile::create(path.clone()).unwrap();
        trace.note("consent", &json!({ "by": "--yes" }));
        let line = trace.of_the_line();
        line(Said::Command("#5"));
        line(Said::Reply("0"));
        drop((line, trace));
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(lines[0]["consent"]["by"], "--yes");
        assert_eq!((&lines[1]["command"], &lines[2]["reply"]), (&json!("#5"), &json!("0")));
        assert!(lines.windows(2).all(|two| two[0]["t_s"].as_f64() <= two[1]["t_s"].as_f64()));
        assert!(TraceFile::create(path).is_err(), "nothing is overwritten");
    }
}
