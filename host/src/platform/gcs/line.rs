//! Questions and answers.

use std::io;
use std::time::Instant;

use hexapod::gcs::{GcsPosition, STOP, is_whole_answer};

use crate::platform::PlatformError;
use crate::platform::address::{PATIENCE, Wire};

/// The longest answer taken.
const ANSWER_BYTES: usize = 1 << 16;
/// What an error number is asked by.
const ERROR: &str = "ERR?";

/// A line to a controller.
pub(super) struct Line {
    wire: Box<dyn Wire>,
    address: String,
}

impl Line {
    pub(super) fn new(wire: Box<dyn Wire>, address: String) -> Self {
        Self { wire, address }
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
        self.wire.write_all(bytes).and_then(|()| self.wire.flush()).map_err(|e| self.lost(command, e))
    }

    /// Asks; all lines of the answer.
    pub(super) fn ask(&mut self, question: &str) -> Result<String, PlatformError> {
        self.tell(question)?;
        self.answer(question)
    }

    /// Asks by a single byte, which is named `#n`.
    pub(super) fn ask_byte(&mut self, byte: u8) -> Result<Vec<u8>, PlatformError> {
        let name = format!("#{byte}");
        self.write(&[byte], &name)?;
        self.bytes(&name)
    }

    /// Stops all motion.
    pub(super) fn stop(&mut self) -> Result<(), PlatformError> {
        self.write(&[STOP], "#24 (stop)")
    }

    fn answer(&mut self, question: &str) -> Result<String, PlatformError> {
        Ok(String::from_utf8_lossy(&self.bytes(question)?).into_owned())
    }

    /// An answer ends at a line's end without a space before it.
    fn bytes(&mut self, question: &str) -> Result<Vec<u8>, PlatformError> {
        let deadline = Instant::now() + PATIENCE;
        let (mut answer, mut byte) = (Vec::new(), [0]);
        while Instant::now() < deadline && answer.len() < ANSWER_BYTES {
            match self.wire.read(&mut byte) {
                Ok(0) => return Err(self.lost(question, "it closed the connection")),
                Ok(_) => {
                    answer.extend(byte);
                    if is_whole_answer(&answer) {
                        answer.pop();
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
        Err(self.lost(question, format!("no whole answer within {} s", PATIENCE.as_secs())))
    }

    /// The controller's error since the last time, blamed on a command.
    pub(super) fn check(&mut self, command: &str) -> Result<(), PlatformError> {
        let answer = self.ask(ERROR)?;
        match answer.trim().parse() {
            Ok(0) => Ok(()),
            Ok(code) => Err(PlatformError::Controller { command: command.to_owned(), code }),
            Err(_) => Err(self.nonsense(ERROR, &answer)),
        }
    }

    /// Says a command and asks what came of it.
    pub(super) fn order(&mut self, command: &str) -> Result<(), PlatformError> {
        self.tell(command)?;
        self.check(command)
    }

    pub(super) fn nonsense(&self, question: &str, answer: &str) -> PlatformError {
        PlatformError::Refused(format!("its answer to {question} is not understood: {answer:?}"))
    }

    /// Numbers of the six axes, `X=1.5` a line.
    pub(super) fn six(&mut self, question: &str) -> Result<[f64; 6], PlatformError> {
        let answer = self.ask(question)?;
        match GcsPosition::read_answer(&answer) {
            Some(position) => Ok(position.0),
            None => Err(self.nonsense(question, &answer)),
        }
    }
}
