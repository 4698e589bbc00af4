use std::fmt;
use std::process::ExitCode;

use rigident::application::Error;
use rigident_io::recording::RecordingError;
use rigident_io::rig::RigFileError;
use rigident_shared::printable;

use crate::screen::terms::in_own_terms;

/// Why a command ends without an answer: its exit status and a message that says what happened, where, and
/// what to do.
#[derive(Debug)]
pub struct Failure {
    status: ExitStatus,
    message: String,
    place: Option<Place>,
}

/// The place of an error in a file or in arrays; what does not apply is `None`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    /// The file's or the recording's name.
    pub file: Option<String>,
    /// Line of the file, from 1.
    pub line: Option<u64>,
    /// Index in a column that was given as an array, from 0.
    pub index: Option<u64>,
    /// Name of the column of a recording, or the key of a rig file.
    pub column: Option<String>,
}

/// Exit statuses of the program: docs/formats.md has them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExitStatus {
    /// Everything that was asked for is identified, or done.
    Identified = 0,
    /// Some of it is not identified, a check found something, or Ctrl-C was pressed before the end.
    NotIdentified = 1,
    /// The input or the usage is bad.
    Input = 2,
    /// The link or the hardware failed.
    Link = 3,
    /// A second Ctrl-C ended the program.
    Interrupted = 130,
}

impl ExitStatus {
    /// Every exit status.
    pub const ALL: [Self; 5] =
        [Self::Identified, Self::NotIdentified, Self::Input, Self::Link, Self::Interrupted];

    /// Returns [`ExitStatus::Identified`] where all is well, [`ExitStatus::NotIdentified`] otherwise.
    pub fn of(good: bool) -> Self {
        if good { Self::Identified } else { Self::NotIdentified }
    }
}

impl From<ExitStatus> for ExitCode {
    fn from(status: ExitStatus) -> Self {
        Self::from(status as u8)
    }
}

impl Failure {
    fn new(status: ExitStatus, message: impl fmt::Display) -> Self {
        Self { status, message: worded(&message.to_string()), place: None }
    }

    /// Returns the failure of bad input or usage.
    pub fn input(message: impl fmt::Display) -> Self {
        Self::new(ExitStatus::Input, message)
    }

    /// Returns the failure of a link or of hardware.
    pub fn link(message: impl fmt::Display) -> Self {
        Self::new(ExitStatus::Link, message)
    }

    /// Returns the failure of Ctrl-C before there was anything to keep.
    pub fn interrupted(message: impl fmt::Display) -> Self {
        Self::new(ExitStatus::NotIdentified, message)
    }

    /// Returns the failure with the unfinished action before its message.
    #[must_use]
    pub fn context(mut self, doing: impl fmt::Display) -> Self {
        self.message = worded(&format!("{doing}: {}", self.message));
        self
    }

    /// Returns the same failure, followed by what is left.
    #[must_use]
    pub fn after(mut self, left: &str) -> Self {
        self.message = worded(&format!("{}\n{left}", self.message.trim_end()));
        self
    }

    /// Returns the same failure, at the place of an error of the application, if that has one.
    pub(crate) fn at_place_of(self, error: &Error) -> Self {
        match error {
            Error::Recording(error) => Self { place: place_of(error), ..self },
            Error::Of { error, .. } | Error::Assuming { error, .. } => self.at_place_of(error),
            _ => self,
        }
    }

    /// Returns where it is, if it is at a place of a recording or of a rig file.
    pub fn place(&self) -> Option<&Place> {
        self.place.as_ref()
    }

    /// Returns its exit status.
    pub fn status(&self) -> ExitStatus {
        self.status
    }

    /// Returns the exit status of the failure.
    pub fn exit_code(&self) -> ExitCode {
        self.status.into()
    }
}

/// Words a message in the terms of the command line. Names in it are as strangers wrote them: nothing of them
/// steers a terminal, a log or a notebook.
fn worded(message: &str) -> String {
    printable::lines(&in_own_terms(message)).to_string()
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl From<RecordingError> for Failure {
    fn from(error: RecordingError) -> Self {
        Self { place: place_of(&error), ..Self::input(&error) }
    }
}

impl From<RigFileError> for Failure {
    fn from(error: RigFileError) -> Self {
        Self::from(RecordingError::Rig(error))
    }
}

fn place_of(error: &RecordingError) -> Option<Place> {
    let place = match error {
        RecordingError::At { name, line, column, .. } => {
            Place { file: Some(name.clone()), line: Some(*line), column: column.clone(), index: None }
        }
        RecordingError::Cell { name, index, column, .. } => {
            Place { file: Some(name.clone()), line: None, column: Some(column.clone()), index: Some(*index) }
        }
        RecordingError::Rig(RigFileError::Value { file, line, key, .. }) => Place {
            file: file.clone(),
            line: line.map(|line| line as u64),
            column: Some(key.clone()),
            index: None,
        },
        RecordingError::Rig(RigFileError::Syntax { file, place, .. }) => {
            Place { file: file.clone(), line: place.map(|(line, _)| line as u64), ..Place::default() }
        }
        RecordingError::Unreadable { path: file, .. }
        | RecordingError::Rig(RigFileError::Unreadable { path: file, .. })
        | RecordingError::NotARecording { name: file, .. }
        | RecordingError::Columns { name: file, .. }
        | RecordingError::Message { name: file, .. } => {
            Place { file: Some(file.clone()), ..Place::default() }
        }
        RecordingError::UnknownKind(_)
        | RecordingError::SavedElsewhere { .. }
        | RecordingError::NotWritten(_)
        | RecordingError::Exists(_)
        | RecordingError::Unwritable { .. } => {
            return None;
        }
    };
    Some(place)
}
