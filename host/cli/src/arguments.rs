//! The command line as a whole.

use clap::Parser;

#[cfg(not(target_family = "wasm"))]
use crate::dispatch::Command;
#[cfg(target_family = "wasm")]
use crate::page::Command;

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
