//! Commands that a program calls in its own process: what they would print is returned, and nothing ends the
//! process.
//!
//! Lives here: the call; what a thread that runs one keeps is in [`crate::kept`]. May not live here: what a
//! command does; it is the same function as on the command line, so that the numbers are the same.

use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::arguments::Arguments;
use crate::commands::{factor, identify};
use crate::dispatch::{Command, dispatch};
use crate::kept;
use crate::kept::Stopped;
use crate::{ExitStatus, Failure, in_one_line, parse, status_of};
use rigident_io::recording::Recording;

/// Holds what a command did that was called in this process.
#[derive(Debug)]
pub struct Called {
    /// The exit status that the command line would have ended with.
    pub status: ExitStatus,
    /// The text that would be on standard output.
    pub output: String,
    /// Lines that would be on standard error: warnings and notes.
    pub messages: Vec<String>,
    /// Why there is no answer, if there is none.
    pub failure: Option<Failure>,
}

/// Calls a command with the words of its command line, the program's name left out.
///
/// `recording` takes the place of the recording that `identify` and `factor` name; their word for it is then
/// not read. Where `stop` becomes true, a plan returns the best so far and other commands end at their next
/// stage with a failure. Nothing is printed, and progress is not shown. A panic of the command goes on in the
/// caller.
pub fn call<W: Into<OsString>>(
    words: impl IntoIterator<Item = W>,
    recording: Option<Recording>,
    stop: Arc<AtomicBool>,
) -> Called {
    kept::begin(stop);
    let words = std::iter::once(OsString::from("rigident")).chain(words.into_iter().map(Into::into));
    let ended = catch_unwind(AssertUnwindSafe(|| parse(words).map(|parsed| run(parsed, recording))));
    let (mut output, messages) = kept::end().map(|kept| (kept.output, kept.messages)).unwrap_or_default();
    let (status, failure) = match ended {
        Ok(Ok(Ok(code))) => (status_of(code), None),
        Ok(Ok(Err(failure))) => (failure.status(), Some(failure)),
        Ok(Err(error)) if error.use_stderr() => {
            let failure = Failure::input(in_one_line(&error.to_string()));
            (failure.status(), Some(failure))
        }
        // Help, or the version.
        Ok(Err(error)) => {
            output = error.to_string();
            (ExitStatus::Identified, None)
        }
        Err(payload) => {
            let failure = stopped(payload);
            (failure.status(), Some(failure))
        }
    };
    Called { status, output, messages, failure }
}

fn run(arguments: Arguments, recording: Option<Recording>) -> Result<ExitCode, Failure> {
    match (arguments.command, recording) {
        (command, None) => dispatch(command),
        (Some(Command::Identify(a)), Some(recording)) => identify::of_recording(&a, recording),
        (Some(Command::Factor(a)), Some(recording)) => factor::make_of(&a, recording),
        (_, Some(_)) => {
            Err(Failure::input("this command takes no recording from memory: identify and factor do"))
        }
    }
}

/// Returns the failure of a command that was stopped; any other panic goes on.
fn stopped(payload: Box<dyn Any + Send>) -> Failure {
    match payload.downcast::<Stopped>() {
        Ok(_) => Failure::interrupted("stopped before there was an answer"),
        Err(other) => resume_unwind(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_shared::printable;

    const BRACKET: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/bracket.csv");

    fn called(words: &[&str], stop: bool) -> Called {
        call(words, None, Arc::new(AtomicBool::new(stop)))
    }

    #[test]
    fn a_name_that_steers_is_refused_on_every_way_in() {
        for word in ["a\nmovej([0]).csv", "\u{1b}]0;x\u{7}.csv", "a\u{202e}vsc.exe", "a\u{9b}2J"] {
            for words in [
                vec!["identify", word],
                vec!["identify", "a.csv", "--model", word],
                vec!["merge", "a.factor", "-o", word],
                vec!["model", "check", word],
            ] {
                let refused = called(&words, false);
                let said = refused.failure.unwrap().to_string();
                assert!(said.contains("has control characters"), "{said:?}");
                assert!(!said.chars().any(printable::steers), "{said:?}");
            }
        }
    }

    #[test]
    fn an_answer_is_returned_and_a_refusal_has_status_and_place() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let good = called(&["identify", BRACKET, "--json", "--out", &out.display().to_string()], false);
        assert_eq!(good.status, ExitStatus::Identified, "{good:?}");
        let object: serde_json::Value = serde_json::from_str(&good.output).unwrap();
        assert_eq!(object["status"], "identified");
        let file = std::fs::read_to_string(out.join("result.json")).unwrap();
        assert_eq!(file.trim(), good.output.trim());

        let bad = folder.path().join("bad.csv");
        let text = std::fs::read_to_string(BRACKET).unwrap().replacen("28.1008", "nan", 1);
        std::fs::write(&bad, text).unwrap();
        let bad = called(&["identify", &bad.display().to_string()], false);
        assert_eq!((bad.status, bad.output.as_str()), (ExitStatus::Input, ""));
        let place = bad.failure.unwrap().place().cloned().unwrap();
        assert_eq!((place.line, place.column.as_deref()), (Some(3), Some("fz_n")));

        let usage = called(&["identify", "--no-such-option"], false);
        assert_eq!(usage.status, ExitStatus::Input);
        assert!(usage.failure.unwrap().to_string().contains("--no-such-option"));
        assert!(called(&["--version"], false).output.starts_with("rigident "));
        // A thread prints again once the call is over.
        assert!(!kept::is_called());
    }

    #[test]
    fn a_call_that_is_stopped_ends_with_a_failure() {
        let stopped = called(&["identify", BRACKET, "--json"], true);
        assert_eq!(stopped.status, ExitStatus::NotIdentified);
        assert!(stopped.failure.is_some() && stopped.output.is_empty());
    }
}
