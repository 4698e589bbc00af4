//! The commands: arguments in, files and an answer out, an exit status.
//!
//! Lives here: what a user types and sees. May not live here: anything another program could use; that is in
//! the rooms beside this one.
#![forbid(unsafe_code)]

#[cfg_attr(target_family = "wasm", allow(dead_code, reason = "for commands that the page lacks"))]
#[macro_use]
mod screen;

mod commands;
mod device;

mod arguments;
mod certificate;
#[cfg(not(target_family = "wasm"))]
mod dispatch;
mod folder;
#[cfg(not(target_family = "wasm"))]
mod in_process;
mod kept;
#[cfg_attr(target_family = "wasm", allow(dead_code, reason = "for commands that the page lacks"))]
mod options;
#[cfg(target_family = "wasm")]
mod page;

use std::ffi::{OsStr, OsString};
use std::process::ExitCode;
#[cfg(not(target_family = "wasm"))]
use std::sync::atomic::Ordering;

use clap::{CommandFactory, FromArgMatches};
use rigident_shared::printable;

pub use crate::screen::failure::{ExitStatus, Failure, Place};
pub use crate::screen::progress::Progress;
use crate::screen::progress::Stages;
pub use arguments::Arguments;
pub use folder::Folder;
#[cfg(not(target_family = "wasm"))]
pub use in_process::{Called, call};

#[cfg(not(target_family = "wasm"))]
use crate::dispatch::{dispatch, without_missing};
#[cfg(target_family = "wasm")]
use crate::page::{dispatch, without_missing};

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    main_of(std::env::args_os().collect()).into()
}

/// Runs a command line whose first word is the program's name, as the whole of this process: it prints, takes
/// over Ctrl-C, and where the words are none of ours it ends the process. A program that goes on afterwards
/// wants [`call`].
pub fn main_of(words: Vec<OsString>) -> ExitStatus {
    let json = words.iter().skip(1).take_while(|a| *a != "--").any(|a| a == "--json");
    let arguments = match parse(words) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and the version are no failures.
            if json && error.use_stderr() {
                screen::outcome::say_failed(&in_one_line(&error.to_string()));
            }
            error.exit()
        }
    };
    listen_for_interrupts(json);
    let outcome = dispatch(arguments.command).and_then(|code| match screen::outcome::unwritten() {
        Some(error) => Err(Failure::input(format!(
            "the answer cannot be written to standard output: {error}; make room there, or write it elsewhere"
        ))),
        None => Ok(code),
    });
    match outcome {
        Ok(code) => status_of(code),
        Err(failure) => {
            tell!("rigident: {failure}");
            if json {
                screen::outcome::say_failed(&failure.to_string());
            }
            folder::note_failure(&screen::outcome::failed(&failure.to_string()));
            failure.status()
        }
    }
}

/// Has Ctrl-C end a command at its next stage. Without this it would end the program at once, files
/// half-written: a second one still does.
#[cfg(not(target_family = "wasm"))]
fn listen_for_interrupts(json: bool) {
    let handler = ctrlc::set_handler(move || {
        if rigident::device::session::INTERRUPTED.swap(true, Ordering::Relaxed) {
            if json {
                screen::outcome::say_failed("ended by a second Ctrl-C; files may be incomplete");
            }
            std::process::exit(ExitStatus::Interrupted as i32);
        }
        tell!("\nstopping (Ctrl-C again ends at once)");
    });
    if let Err(error) = handler {
        tell!("rigident: Ctrl-C will end the program at once: {error}");
    }
}

/// Does nothing. There are no signals in a browser: its page ends the worker.
#[cfg(target_family = "wasm")]
fn listen_for_interrupts(_: bool) {}

/// Returns the whole command line. A negative number is a value, which each command refuses in its own words,
/// not an unknown option.
fn command() -> clap::Command {
    fn with_numbers(command: clap::Command) -> clap::Command {
        command
            .mut_args(|argument| {
                let takes_a_value = argument.get_action().takes_values() && !argument.is_positional();
                if takes_a_value { argument.allow_negative_numbers(true) } else { argument }
            })
            .mut_subcommands(with_numbers)
    }
    with_numbers(without_missing(Arguments::command()))
}

/// Reads the words of a command line, the program's name first.
///
/// # Errors
/// Returns the errors of clap, requests for help and the version among them.
fn parse(words: impl IntoIterator<Item = OsString>) -> Result<Arguments, clap::Error> {
    let words: Vec<OsString> = words.into_iter().collect();
    if let Some((n, word)) = words.iter().enumerate().skip(1).find(|(_, word)| steers(word)) {
        let shown = word.to_string_lossy();
        let why = format!(
            "argument {n}, '{}', has control characters: names of files go into messages and written files; \
             rename it",
            printable::name(&shown)
        );
        return Err(command().error(clap::error::ErrorKind::InvalidValue, why));
    }
    let mut matches = command().try_get_matches_from(words)?;
    Arguments::from_arg_matches_mut(&mut matches)
}

fn steers(word: &OsStr) -> bool {
    word.to_string_lossy().chars().any(printable::steers)
}

/// Returns the exit status that a code represents.
fn status_of(code: ExitCode) -> ExitStatus {
    let found = ExitStatus::ALL.into_iter().find(|status| ExitCode::from(*status) == code);
    found.unwrap_or(ExitStatus::NotIdentified)
}

/// Returns what the parser says, without its hints on usage.
fn in_one_line(said: &str) -> String {
    let first = said.split("\n\n").next().unwrap_or(said);
    first.trim_start_matches("error: ").split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_negative_number_is_a_value_and_a_parsers_complaint_is_one_line() {
        for line in [
            "rigident plan poses --n 3 --stroke-m -1 --hold-s -2",
            "rigident plan motion --duration-s -5",
            "rigident demo --duration-s -5",
            "rigident workspace --yaw-deg -30 --step-deg -1",
        ] {
            command().try_get_matches_from(line.split(' ')).unwrap();
        }
        let error = command().try_get_matches_from("rigident plan poses --n -1".split(' ')).unwrap_err();
        let said = in_one_line(&error.to_string());
        assert!(
            said.contains("'-1' for '--n <K>'") && !said.contains('\n') && !said.contains("--help"),
            "{said}"
        );
        // The former name of `--keep-going`.
        command().try_get_matches_from("rigident demo --until m=1 --go-on".split(' ')).unwrap();
        // Nothing that was refused is taken now.
        assert!(command().try_get_matches_from("rigident plan poses --n 3 -x".split(' ')).is_err());
        command().debug_assert();
    }
}
