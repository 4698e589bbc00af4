//! The commands that the browser's page calls, as the program for it has them: no others, so that it is
//! small.

use std::process::ExitCode;

use clap::Subcommand;

use crate::commands::body::arguments::Body;
use crate::commands::identify::arguments::Identify;
use crate::commands::import::arguments::Import;
use crate::{Failure, certificate, commands};

/// The commands; those of the command line have the same names and options.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Identify the body of a recording, in batch, with the same pipeline in double precision
    Identify(Box<Identify>),
    /// Show how files of other programs are understood, and write a rig file that says so
    Import(Import),
    /// Identify a person from motion capture and force plates
    Body(Body),
}

/// Returns the command line as it is: none of these commands needs the simulated rig.
pub(crate) fn without_missing(command: clap::Command) -> clap::Command {
    command
}

/// Does what a command line asks for.
///
/// # Errors
/// Fails as the command does, or if there is none.
pub(crate) fn dispatch(command: Option<Command>) -> Result<ExitCode, Failure> {
    match command {
        Some(Command::Identify(a)) => {
            certificate::check_output(&a.output)?;
            commands::identify::of_words(*a)
        }
        Some(Command::Import(a)) if a.look => commands::import::look::run(&a),
        Some(Command::Import(a)) => commands::import::run(&a),
        Some(Command::Body(a)) => commands::body::run(&a),
        None => Err(Failure::input("the page calls a command: identify, import or body")),
    }
}
