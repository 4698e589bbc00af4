//! The output of every command on standard output.

use std::io::{self, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use crate::screen::terms::in_own_terms;
use crate::{Failure, kept};
use rigident_shared::printable;

/// True once anything has been printed on standard output.
static SAID: AtomicBool = AtomicBool::new(false);

/// Why standard output did not take everything, if it did not.
static UNWRITTEN: OnceLock<String> = OnceLock::new();

/// Prints the output of `--json` of a command that ends without an answer; an object that is out already
/// stays the only one.
pub(crate) fn say_failed(error: &str) {
    if !SAID.load(Ordering::Relaxed) {
        say(failed(error));
    }
}

/// Returns the object of a command that ends without an answer.
pub(crate) fn failed(error: &str) -> serde_json::Value {
    serde_json::json!({ "status": "failed", "error": error.trim_end() })
}

/// Prints a line on standard output in the terms of the command line, or keeps it for the program that called
/// the command. What standard output does not take is in [`unwritten`].
pub(crate) fn say(text: impl std::fmt::Display) {
    say_as_it_is(in_own_terms(&text.to_string()));
}

/// Prints an answer: its object if that is asked for, else its text.
pub(crate) fn say_answer(answer: &(impl Serialize + std::fmt::Display), json: bool) -> Result<(), Failure> {
    if json {
        return say_object(answer);
    }
    say(answer);
    Ok(())
}

/// Prints the object of an answer, a line for each of its values.
pub(crate) fn say_object(answer: &impl Serialize) -> Result<(), Failure> {
    say(serde_json::to_string_pretty(answer).map_err(Failure::input)?);
    Ok(())
}

/// Prints the object of an answer in one line.
pub(crate) fn say_in_one_line(answer: &impl Serialize) -> Result<(), Failure> {
    say(serde_json::to_string(answer).map_err(Failure::input)?);
    Ok(())
}

/// Prints a line, its words as they are: for what describes files or the program.
pub(crate) fn say_as_it_is(text: impl std::fmt::Display) {
    let text = shown(&text.to_string());
    if kept::keep(&text) {
        return;
    }
    SAID.store(true, Ordering::Relaxed);
    if let Err(error) = print(&mut io::stdout().lock(), &text) {
        let _ = UNWRITTEN.set(error.to_string());
    }
}

/// Returns a text as a terminal may have it. An object keeps all that its strings hold, written as JSON
/// escapes it.
fn shown(text: &str) -> String {
    if !text.starts_with('{') {
        return printable::page(text).to_string();
    }
    let escaped = |c: char| match c {
        '\n' | '\t' => c.to_string(),
        c if printable::steers(c) => format!("\\u{:04x}", u32::from(c)),
        c => c.to_string(),
    };
    if text.chars().any(printable::steers) { text.chars().map(escaped).collect() } else { text.to_owned() }
}

/// Says that no model is written, and why.
pub(crate) fn say_not_written(path: &std::path::Path, why: &str) {
    tell!("rigident: --write-model {}: not written: {why}", path.display());
}

/// Why no model is written of a contradicted answer.
pub(crate) const CANNOT_BE_TRUE: &str = "the recording cannot be true";

/// Returns why an answer is not on standard output as a whole, if anything but a reader that went away
/// prevented it.
pub(crate) fn unwritten() -> Option<&'static str> {
    UNWRITTEN.get().map(String::as_str)
}

/// Prints a line. A reader that has gone away is no failure: it has read as much as it wanted.
fn print(to: &mut impl Write, text: &impl std::fmt::Display) -> io::Result<()> {
    match writeln!(to, "{text}").and_then(|()| to.flush()) {
        Err(error) if is_reader_gone(&error) => Ok(()),
        written => written,
    }
}

/// Tells whether nobody reads any more. On Windows a pipe whose reader never connected, or left early, says
/// so by a number that `std` has no kind for: ERROR_PIPE_NOT_CONNECTED.
fn is_reader_gone(error: &io::Error) -> bool {
    const PIPE_NOT_CONNECTED: i32 = 233;
    let is_windows_own = cfg!(windows) && error.raw_os_error() == Some(PIPE_NOT_CONNECTED);
    error.kind() == io::ErrorKind::BrokenPipe || is_windows_own
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Broken(io::ErrorKind);

    impl Write for Broken {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn no_answer_steers_a_terminal_and_an_object_keeps_its_strings() {
        let name = "a\u{1b}[2J\u{9b}8m\u{202e}b";
        assert_eq!(shown(&format!("{name}\n\tx")), "a\u{fffd}[2J\u{fffd}8m\u{fffd}b\n\tx");
        let object = serde_json::json!({ "name": name });
        for text in [object.to_string(), format!("{object:#}")] {
            let said = shown(&text);
            assert!(said.chars().all(|c| c == '\n' || !printable::steers(c)), "{said:?}");
            assert_eq!(serde_json::from_str::<serde_json::Value>(&said).unwrap(), object);
        }
    }

    #[test]
    fn a_full_disk_is_an_error_and_a_reader_that_went_away_is_none() {
        let full = print(&mut Broken(io::ErrorKind::StorageFull), &"answer").unwrap_err();
        assert_eq!(full.kind(), io::ErrorKind::StorageFull);
        print(&mut Broken(io::ErrorKind::BrokenPipe), &"answer").unwrap();
        assert_eq!(is_reader_gone(&io::Error::from_raw_os_error(233)), cfg!(windows));
    }
}
