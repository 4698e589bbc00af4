use std::fmt;
use std::process::ExitCode;

/// Why a command ends without an answer: its exit status and a message that says what happened, where, and
/// what to do.
#[derive(Debug)]
pub struct Failure {
    status: ExitStatus,
    message: String,
}

/// Exit statuses of the program: docs/formats.md has them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExitStatus {
    /// Everything that was asked for is identified, or done.
    Identified = 0,
    /// Some of it is not identified, a check found something, or Ctrl-C came before the end.
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
    /// Bad input or usage.
    pub fn input(message: impl fmt::Display) -> Self {
        Self { status: ExitStatus::Input, message: message.to_string() }
    }

    /// Link or hardware failure.
    pub fn link(message: impl fmt::Display) -> Self {
        Self { status: ExitStatus::Link, message: message.to_string() }
    }

    /// Ctrl-C before there was anything to keep.
    pub fn interrupted(message: impl fmt::Display) -> Self {
        Self { status: ExitStatus::NotIdentified, message: message.to_string() }
    }

    /// The same failure, preceded by what was being done.
    #[must_use]
    pub fn context(mut self, doing: impl fmt::Display) -> Self {
        self.message = format!("{doing}: {}", self.message);
        self
    }

    /// Returns the same failure, followed by what is left.
    #[must_use]
    pub fn after(mut self, left: &str) -> Self {
        self.message = format!("{}\n{left}", self.message.trim_end());
        self
    }

    /// Its exit status.
    pub fn exit_code(&self) -> ExitCode {
        self.status.into()
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}
