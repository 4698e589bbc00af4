//! Questions and answers.

use std::io;
use std::time::Duration;

use hexapod::gcs::{GcsPosition, STOP, is_whole_answer};

use crate::platform::PATIENCE;
use crate::platform::address::Wire;
use crate::platform::clock::Clock;
use crate::platform::{PlatformError, Said, Trace};

/// The longest answer taken.
const ANSWER_BYTES: usize = 1 << 16;
/// The command that asks for an error number.
const ERROR: &str = "ERR?";
/// The time that a controller that was commanded to stop may take to answer.
const SOON: Duration = Duration::from_millis(500);

/// A line to a controller.
pub(super) struct Line {
    wire: Box<dyn Wire>,
    address: String,
    /// The trace in which all that goes over it is noted.
    pub(super) trace: Option<Trace>,
    clock: Clock,
}

impl Line {
    pub(super) fn new(wire: Box<dyn Wire>, address: String, clock: Clock) -> Self {
        Self { wire, address, trace: None, clock }
    }

    fn lost(&self, command: &str, reason: impl ToString) -> PlatformError {
        PlatformError::Lost {
            address: self.address.clone(),
            command: command.to_owned(),
            reason: reason.to_string(),
        }
    }

    /// Says a command that has no answer.
    pub(super) fn tell(&mut self, command: &str) -> Result<(), PlatformError> {
        self.write(format!("{command}\n").as_bytes(), command)
    }

    fn write(&mut self, bytes: &[u8], command: &str) -> Result<(), PlatformError> {
        self.trace.iter().for_each(|trace| trace(Said::Command(command)));
        self.wire.write_all(bytes).and_then(|()| self.wire.flush()).map_err(|e| self.lost(command, e))
    }

    /// Asks. Returns all lines of the answer.
    pub(super) fn ask(&mut self, question: &str) -> Result<String, PlatformError> {
        self.ask_within(question, PATIENCE)
    }

    fn ask_within(&mut self, question: &str, within: Duration) -> Result<String, PlatformError> {
        self.tell(question)?;
        Ok(String::from_utf8_lossy(&self.bytes(question, within)?).into_owned())
    }

    /// Asks by a single byte, which is named `#n`.
    pub(super) fn ask_byte(&mut self, byte: u8) -> Result<Vec<u8>, PlatformError> {
        let name = format!("#{byte}");
        self.write(&[byte], &name)?;
        self.bytes(&name, PATIENCE)
    }

    /// Stops all motion abruptly.
    pub(super) fn stop(&mut self) -> Result<(), PlatformError> {
        self.write(&[STOP], "#24 (stop)")
    }

    /// Reads an answer, which ends at a line's end without a space before it.
    fn bytes(&mut self, question: &str, within: Duration) -> Result<Vec<u8>, PlatformError> {
        let deadline_s = self.clock.now_s() + within.as_secs_f64();
        let (mut answer, mut byte) = (Vec::new(), [0]);
        while self.clock.now_s() < deadline_s && answer.len() < ANSWER_BYTES {
            match self.wire.read(&mut byte) {
                Ok(0) => return Err(self.lost(question, "it closed the connection")),
                Ok(_) => {
                    answer.extend(byte);
                    if is_whole_answer(&answer) {
                        answer.pop();
                        let reply = String::from_utf8_lossy(&answer);
                        self.trace.iter().for_each(|trace| trace(Said::Reply(&reply)));
                        return Ok(answer);
                    }
                }
                Err(e)
                    if matches!(
                        e.kind(),
                        io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
                    ) => {}
                Err(e) => return Err(self.lost(question, e)),
            }
        }
        Err(self.lost(question, format!("no whole answer within {} s", within.as_secs_f64())))
    }

    /// Checks for the controller's error since the last time, blamed on a command.
    pub(super) fn check(&mut self, command: &str) -> Result<(), PlatformError> {
        self.check_within(command, PATIENCE)
    }

    /// Checks as [`Self::check`] does, of a plate that is to come to rest: a late answer must not hold back
    /// what is tried next.
    pub(super) fn check_soon(&mut self, command: &str) -> Result<(), PlatformError> {
        self.check_within(command, SOON)
    }

    fn check_within(&mut self, command: &str, within: Duration) -> Result<(), PlatformError> {
        let answer = self.ask_within(ERROR, within)?;
        match answer.trim().parse() {
            Ok(0) => Ok(()),
            Ok(code) => Err(PlatformError::Controller { command: command.to_owned(), code }),
            Err(_) => Err(self.nonsense(ERROR, &answer)),
        }
    }

    /// Says a command and asks for the result.
    pub(super) fn order(&mut self, command: &str) -> Result<(), PlatformError> {
        self.tell(command)?;
        self.check(command)
    }

    pub(super) fn nonsense(&self, question: &str, answer: &str) -> PlatformError {
        PlatformError::Refused(format!("its answer to {question} is not understood: {answer:?}"))
    }

    /// Asks for numbers of the six axes, `X=1.5` a line.
    pub(super) fn six(&mut self, question: &str) -> Result<[f64; 6], PlatformError> {
        let answer = self.ask(question)?;
        match GcsPosition::read_answer(&answer) {
            Some(position) => Ok(position.0),
            None => Err(self.nonsense(question, &answer)),
        }
    }
}
