//! The command line as a whole.

use clap::{Args, Parser, Subcommand};

use crate::commands::body::arguments::Body;
use crate::commands::calibrate::arguments::{Calibrate, Verify};
use crate::commands::demo_arguments::Demo;
use crate::commands::device_arguments::{Completions, Configure, Doctor, Info, Man, Monitor, Ports};
use crate::commands::factor::arguments::{MakeFactor, Merge, Solve};
use crate::commands::identify::arguments::Identify;
use crate::commands::import::arguments::{Convert, Import};
use crate::commands::live::arguments::Live;
use crate::commands::montecarlo_arguments::Montecarlo;
use crate::commands::plan::arguments::{Plan, Statics, Workspace};
use crate::commands::predict::arguments::{Predict, Summary, Validate};
use crate::commands::replay::arguments::Replay;
use crate::commands::run::arguments::Run;
use crate::commands::ui::arguments::Ui;
use crate::commands::vibration::arguments::Vibration;
use crate::commands::watch::arguments::Watch;
use crate::options::trees::{BenchCommand, ModelCommand};

/// Tells the inertial parameters of a body from its wrench and motion: mass, centre of mass, inertia tensor,
/// each with a 95 % uncertainty, or that the data do not identify it.
#[derive(Parser, Debug)]
#[command(
    name = "rigident",
    version,
    after_help = "Without a command: `rigident demo`.\n\nExit status: 0 every asked-for parameter is \
                  identified, 1 partly or not identified, 2 bad input or usage, 3 link or hardware failure, \
                  130 ended by a second Ctrl-C; the first ends with 1.\n\nExamples:\n  rigident demo\n  \
                  rigident identify bracket.csv --estimate m,mc\n  rigident run --port /dev/ttyACM0 --rig \
                  bracket.rig.toml --platform tcp://192.168.1.20:7447"
)]
pub struct Arguments {
    /// What to do
    #[command(subcommand)]
    pub command: Option<Command>,
}

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
    /// Reduce recordings to an information factor: all they say of the body, in a few hundred numbers
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
