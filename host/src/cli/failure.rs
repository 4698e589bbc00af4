use std::fmt;
use std::process::ExitCode;

/// Why a command ends without an answer: its exit status and a message that says what happened, where, and
/// what to do.
#[derive(Debug)]
pub struct Failure {
    status: Status,
    message: String,
}

/// Exit statuses of the contract beyond 0 (identified) and 1 (partly or not identified).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Bad input or usage.
    Input = 2,
    /// Link or hardware failure.
    Link = 3,
}

impl Failure {
    /// Bad input or usage.
    pub fn input(message: impl fmt::Display) -> Self {
        Self { status: Status::Input, message: message.to_string() }
    }

    /// Link or hardware failure.
    pub fn link(message: impl fmt::Display) -> Self {
        Self { status: Status::Link, message: message.to_string() }
    }

    /// The same failure, preceded by what was being done.
    #[must_use]
    pub fn context(mut self, doing: impl fmt::Display) -> Self {
        self.message = format!("{doing}: {}", self.message);
        self
    }

    /// Its exit status.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.status as u8)
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}
