//! All commands: which there are, which function does which, and those that a build without the simulated rig
//! leaves out. The twin for the browser's page is `page.rs`.

use std::process::ExitCode;

use clap::{Args, Subcommand};
use rigident::application::recorded::{named, refuse_several};

use crate::commands::body::arguments::Body;
use crate::commands::calibrate::arguments::{Calibrate, Verify};
use crate::commands::demo_arguments::Demo;
use crate::commands::device_arguments::{Completions, Configure, Doctor, Info, Man, Monitor, Ports};
use crate::commands::factor::arguments::{MakeFactor, Merge, Solve};
use crate::commands::identify::arguments::Identify;
use crate::commands::import::arguments::{Convert, Import};
use crate::commands::live::arguments::Live;
use crate::commands::montecarlo_arguments::Montecarlo;
#[cfg(feature = "simulator")]
use crate::commands::montecarlo_arguments::Repeated;
use crate::commands::plan::arguments::{Plan, Planned, Statics, Workspace};
use crate::commands::predict::arguments::{Predict, Summary, Validate};
use crate::commands::replay::arguments::Replay;
use crate::commands::run::arguments::Run;
use crate::commands::ui::arguments::Ui;
use crate::commands::vibration::arguments::Vibration;
use crate::commands::watch::arguments::Watch;
use crate::options::trees::{BenchCommand, ModelCommand};
use crate::{Failure, certificate, commands, screen};

/// The commands.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Identify a simulated body on a simulated platform, firmware included
    Demo(Demo),
    /// Take a recording through the firmware: in-process, emulated, or on a board
    Replay(Replay),
    /// Have the firmware watch a link of a robot in motion: what was picked up or lost, when, and how much
    Watch(Watch),
    /// Identify the body of a recording, in batch, with the same pipeline in double precision
    Identify(Identify),
    /// Compare estimators of the centre of mass on a recording's still poses
    Statics(Statics),
    /// Predict wrench or efforts of a recording's motion by a result or a model
    Predict(Predict),
    /// Compare what results and models predict of a recording with what was measured
    Validate(Validate),
    /// Sum up several runs of one body: mean, scatter, and whether the runs' uncertainties explain it
    Summary(Summary),
    /// Calibrate what measures with a body of known properties
    Calibrate(Calibrate),
    /// Compare what a rig measures of a reference body with what is known of it: pass or fail
    Verify(Verify),
    /// Reduce recordings to an information factor: all they say of the body, in some 20 kB
    Factor(MakeFactor),
    /// Merge factors of several runs of one body, in any order
    Merge(Merge),
    /// Identify the body of a factor
    Solve(Solve),
    /// List the serial ports, and which of them a device answers on
    Ports(Ports),
    /// Tell what a device is, its firmware, its state and what it has counted
    Info(Info),
    /// Read a device's settings, or send those of a rig or a file, the differences shown
    Configure(Configure),
    /// Look whether what a device needs is here: ports, permissions, emulator, firmware, clocks
    Doctor(Doctor),
    /// Run an experiment on a rig: warm-up, zero, still poses, motion, drift check
    Run(Run),
    /// Identify a body live from sensors that are on the network or on a line, moved by hand or by anything
    Live(Live),
    /// Watch an experiment as it runs: parameters with their intervals, the weakest direction, sensors, link
    Monitor(Monitor),
    /// Serve the page to this computer and open it: a recording is chosen, looked at and identified in the
    /// browser
    Ui(Ui),
    /// Convert a recording between CSV and MCAP without loss
    Convert(Convert),
    /// Show how files of other programs are understood, and write a rig file that says so
    Import(Import),
    /// Repeat a simulated experiment with fresh noise: bias, spread and coverage, against the Cramér–Rao
    /// bound
    Montecarlo(Montecarlo),
    /// Map where the platform can be tilted to
    Workspace(Workspace),
    /// Plan what to do with the platform before it moves
    Plan(Plan),
    /// Identify a person from motion capture and force plates
    Body(Body),
    /// Identify what swings on a platform that springs carry
    Vibration(Vibration),
    /// Look at a tree of links: robot description, rig file or person
    Model(ModelCommand),
    /// Print the JSON Schema of a file that this program reads or writes
    Schema(SchemaOf),
    /// Time what is computed, beside other libraries
    Bench(BenchCommand),
    /// Print the completions of a shell
    Completions(Completions),
    /// Write the manual's pages
    Man(Man),
}

/// `rigident schema`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Examples:\n  rigident schema result\n  rigident schema rig > rig.schema.json")]
pub struct SchemaOf {
    /// Which file: a rig file, `result.json`, or a plan
    #[arg(value_name = "FILE", value_parser = clap::builder::PossibleValuesParser::new(rigident::schema::NAMES))]
    pub file: String,
}

/// Returns the command line as it is where nothing is left out.
#[cfg(feature = "simulator")]
pub(crate) fn without_missing(command: clap::Command) -> clap::Command {
    command
}

/// Says in the help what this build cannot do.
#[cfg(not(feature = "simulator"))]
pub(crate) fn without_missing(command: clap::Command) -> clap::Command {
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
    certificate::check_output(output)
}

/// Does what a command line asks for.
///
/// # Errors
/// Fails as the command does.
pub(crate) fn dispatch(command: Option<Command>) -> Result<ExitCode, Failure> {
    check_folder(command.as_ref())?;
    match command {
        #[cfg(feature = "simulator")]
        None => commands::demo::run(&commands::demo_arguments::Demo::bare()),
        #[cfg(feature = "simulator")]
        Some(Command::Demo(a)) => commands::demo::run(&a),
        #[cfg(not(feature = "simulator"))]
        None | Some(Command::Demo(_)) => Err(needs_simulator("`rigident demo`")),
        Some(Command::Identify(a)) => commands::identify::of_words(a),
        Some(Command::Replay(mut a)) => {
            a.recording = named(a.recording);
            a.output.evidence = certificate::evidence(&a.recording, a.rig.as_deref(), &a.tare.tare);
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
            a.output.evidence = certificate::evidence(&a.factor, a.rig.as_deref(), &a.tare.tare);
            commands::factor::solve(&a)
        }
        Some(Command::Ports(a)) => commands::ports::run(&a),
        Some(Command::Info(a)) => commands::info::run(&a),
        Some(Command::Configure(a)) => commands::configure::run(&a),
        Some(Command::Monitor(a)) => commands::monitor::run(&a),
        Some(Command::Doctor(a)) => commands::doctor::run(&a),
        Some(Command::Completions(a)) => commands::completions::completions(&a),
        Some(Command::Man(a)) => commands::completions::man(&a),
        Some(Command::Ui(a)) => commands::ui::run(&a),
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

/// Returns the failure of something that this build cannot do.
#[cfg(not(feature = "simulator"))]
fn needs_simulator(what: &str) -> Failure {
    Failure::input(format!(
        "{what} needs the simulated rig, and this program was built without it: build it with the feature \
         `simulator`"
    ))
}

/// Runs `rigident schema`.
fn schema(arguments: &SchemaOf) -> Result<ExitCode, Failure> {
    let schema = rigident::schema::schema(&arguments.file)
        .ok_or_else(|| Failure::input(format!("there is no schema of {:?}", arguments.file)))?;
    screen::outcome::say_as_it_is(format_args!("{schema:#}"));
    Ok(ExitCode::SUCCESS)
}

/// Runs `rigident convert`.
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
