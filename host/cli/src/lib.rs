//! The commands: arguments in, files and an answer out, an exit status.
//!
//! Lives here: what a user types and sees. May not live here: anything another program could use; that is in
//! the rooms beside this one.
#![forbid(unsafe_code)]

#[macro_use]
mod screen;

mod commands;
mod device;

mod arguments;
mod certificate;
mod folder;
mod in_process;
mod kept;
mod options;

use std::ffi::OsString;
use std::process::ExitCode;
#[cfg(not(target_family = "wasm"))]
use std::sync::atomic::Ordering;

use clap::CommandFactory;
use rigident::application::recorded::{listed, named, refuse_several};

pub use crate::screen::failure::{ExitStatus, Failure, Place};
pub use crate::screen::progress::Progress;
use crate::screen::progress::Stages;
pub use arguments::Arguments;
pub use folder::Folder;
pub use in_process::{Called, call};

use crate::arguments::{Command, SchemaOf};
use crate::commands::import::arguments::Convert;
#[cfg(feature = "simulator")]
use crate::commands::montecarlo_arguments::Repeated;
use crate::commands::plan::arguments::Planned;

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    main_of(std::env::args_os().collect()).into()
}

/// Runs a command line whose first word is the program's name, as the whole of this process: it prints, takes
/// over Ctrl-C, and where the words are none of ours it ends the process. A program that goes on afterwards
/// wants [`call`].
pub fn main_of(words: Vec<OsString>) -> ExitStatus {
    let json = words.iter().skip(1).take_while(|a| *a != "--").any(|a| a == "--json");
    let arguments = match in_process::parse(words) {
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
    let outcome = dispatch(arguments).and_then(|code| match screen::outcome::unwritten() {
        Some(error) => Err(Failure::input(format!(
            "the answer cannot be written to standard output: {error}; make room there, or write it elsewhere"
        ))),
        None => Ok(code),
    });
    match outcome {
        Ok(code) => in_process::status_of(code),
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

/// There are no signals in a browser: its page ends the worker.
#[cfg(target_family = "wasm")]
fn listen_for_interrupts(_: bool) {}

/// The whole command line. A negative number is a value, which each command refuses in its own words, not an
/// unknown option.
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

/// The command line as it is where nothing is left out.
#[cfg(feature = "simulator")]
fn without_missing(command: clap::Command) -> clap::Command {
    command
}

/// Says in the help what this build cannot do.
#[cfg(not(feature = "simulator"))]
fn without_missing(command: clap::Command) -> clap::Command {
    const MISSING: &str = "Not in this build: it needs the simulated rig (feature `simulator`)";
    command
        .mut_subcommand("demo", |demo| demo.about(MISSING))
        .mut_subcommand("montecarlo", |montecarlo| montecarlo.about(MISSING))
        .mut_subcommand("replay", |replay| {
            replay.mut_arg("mcu", |mcu| {
                mcu.help("The port of a device; inproc and qemu need the feature `simulator`")
            })
        })
        .mut_subcommand("watch", |watch| {
            watch.mut_arg("mcu", |mcu| {
                mcu.help("The port of a device; inproc and qemu need the feature `simulator`")
            })
        })
        .mut_subcommand("live", |live| {
            live.mut_arg("mcu", |mcu| {
                mcu.help("The port of a device; inproc and qemu need the feature `simulator`")
            })
        })
}

/// Returns what the parser says, without its hints on usage.
fn in_one_line(said: &str) -> String {
    let first = said.split("\n\n").next().unwrap_or(said);
    first.trim_start_matches("error: ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Refuses a folder that cannot be written into, and a certificate that cannot, before anything is done, or
/// moves.
fn check_folder(command: Option<&Command>) -> Result<(), Failure> {
    let output = match command {
        Some(Command::Demo(a)) => &a.output,
        Some(Command::Identify(a)) => &a.output,
        Some(Command::Replay(a)) => &a.output,
        Some(Command::Run(a)) => &a.output,
        Some(Command::Live(a)) => &a.output,
        Some(Command::Solve(a)) => &a.output,
        _ => return Ok(()),
    };
    certificate::check(output)?;
    output.out.as_deref().map_or(Ok(()), Folder::check)
}

fn dispatch(arguments: Arguments) -> Result<ExitCode, Failure> {
    check_folder(arguments.command.as_ref())?;
    match arguments.command {
        #[cfg(feature = "simulator")]
        None => commands::demo::run(&commands::demo_arguments::Demo::bare()),
        #[cfg(feature = "simulator")]
        Some(Command::Demo(a)) => commands::demo::run(&a),
        #[cfg(not(feature = "simulator"))]
        None | Some(Command::Demo(_)) => Err(needs_simulator("`rigident demo`")),
        Some(Command::Identify(mut a)) => {
            a.recording = listed(a.recording);
            a.output.evidence = certificate::evidence(&a.recording, a.rig.as_deref());
            commands::identify::run(&a)
        }
        Some(Command::Replay(mut a)) => {
            a.recording = named(a.recording);
            a.output.evidence = certificate::evidence(&a.recording, a.rig.as_deref());
            commands::replay::run(&a)
        }
        Some(Command::Watch(mut a)) => {
            a.recording = named(a.recording);
            commands::watch::run(&a)
        }
        Some(Command::Run(a)) => commands::run::run(&a),
        Some(Command::Live(a)) => commands::live::run(&a),
        Some(Command::Calibrate(a)) => commands::calibrate::run(&a),
        Some(Command::Verify(a)) => commands::verify::run(&a),
        Some(Command::Predict(a)) => commands::predict::predict(&a),
        Some(Command::Validate(a)) => commands::predict::validate(&a),
        Some(Command::Factor(a)) => commands::factor::make(&a),
        Some(Command::Merge(a)) => commands::merge::merge(&a),
        Some(Command::Solve(mut a)) => {
            a.output.evidence = certificate::evidence(&a.factor, a.rig.as_deref());
            commands::factor::solve(&a)
        }
        Some(Command::Ports(a)) => commands::ports::run(&a),
        Some(Command::Info(a)) => commands::info::run(&a),
        Some(Command::Configure(a)) => commands::configure::run(&a),
        Some(Command::Monitor(a)) => commands::monitor::run(&a),
        Some(Command::Doctor(a)) => commands::doctor::run(&a),
        Some(Command::Completions(a)) => commands::completions::completions(&a),
        Some(Command::Man(a)) => commands::completions::man(&a),
        #[cfg(not(target_family = "wasm"))]
        Some(Command::Ui(a)) => commands::ui::run(&a),
        #[cfg(target_family = "wasm")]
        Some(Command::Ui(_)) => Err(Failure::input("this is the page already")),
        Some(Command::Convert(a)) => convert(&a),
        Some(Command::Import(a)) if a.look => commands::import::look::run(&a),
        Some(Command::Import(a)) => commands::import::run(&a),
        #[cfg(not(feature = "simulator"))]
        Some(Command::Montecarlo(_)) => Err(needs_simulator("`rigident montecarlo`")),
        #[cfg(feature = "simulator")]
        Some(Command::Montecarlo(a)) => match &a.what {
            Some(Repeated::Poses(poses)) => commands::montecarlo::poses::run(poses),
            Some(Repeated::Motions(motions)) => commands::montecarlo::motions::run(motions),
            Some(Repeated::TwoSteps(motions)) => commands::montecarlo::motions::in_two_steps(motions),
            None => commands::montecarlo::run(&a),
        },
        Some(Command::Statics(a)) => commands::statics::run(&a),
        Some(Command::Summary(a)) => commands::summary::run(&a),
        Some(Command::Workspace(a)) => commands::workspace::run(&a),
        Some(Command::Plan(a)) => match a.what {
            Planned::Poses(a) => commands::plan::poses::run(&a),
            Planned::Motion(a) => commands::plan::motion::run(&a),
            Planned::Compare(a) => commands::plan::motion::compare(&a),
            Planned::Excitation(a) => commands::plan::excitation::run(&a),
        },
        Some(Command::Schema(a)) => schema(&a),
        Some(Command::Model(a)) => commands::model::run(&a),
        Some(Command::Body(a)) => commands::body::run(&a),
        Some(Command::Vibration(a)) => commands::vibration::run(&a),
        Some(Command::Bench(a)) => commands::bench::run(&a),
    }
}

/// Why `what` cannot be done by this build.
#[cfg(not(feature = "simulator"))]
fn needs_simulator(what: &str) -> Failure {
    Failure::input(format!(
        "{what} needs the simulated rig, and this program was built without it: build it with the feature \
         `simulator`"
    ))
}

/// `rigident schema`
fn schema(arguments: &SchemaOf) -> Result<ExitCode, Failure> {
    let schema = rigident::schema::schema(&arguments.file)
        .ok_or_else(|| Failure::input(format!("there is no schema of {:?}", arguments.file)))?;
    screen::outcome::say_as_it_is(format_args!("{schema:#}"));
    Ok(ExitCode::SUCCESS)
}

/// `rigident convert`
fn convert(arguments: &Convert) -> Result<ExitCode, Failure> {
    let Convert { input, output, rig } = arguments;
    refuse_several(input, rig.as_deref(), "convert")?;
    let done =
        rigident_io::recording::convert::convert(input, output, rig.as_deref()).map_err(Failure::input)?;
    for warning in done.warnings {
        tell!("rigident: {warning}");
    }
    let files: Vec<_> = done.files.iter().map(|f| f.display().to_string()).collect();
    screen::outcome::say(format_args!("{} rows in {}", done.rows, files.join(" and ")));
    Ok(ExitCode::SUCCESS)
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
