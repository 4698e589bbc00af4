//! The tables of `docs/estimation.md`, made anew: `cargo xtask tables`, or
//! `cargo run -p rigident --example estimation_tables -- [NAME...] [--long] [--write] [--check]`.
//!
//! Lives here: one file per study, each a function that gives Markdown and draws everything from fixed seeds;
//! [`problem`] and [`reference`] are what they share. May not live here: anything that ships. The covariance
//! forms in [`covariance_forms`] exist only to show how they fail.

mod coloured_noise;
mod covariance_forms;
mod f32_accuracy;
mod filter_response;
mod honest_covariance;
mod montecarlo;
mod names;
mod problem;
mod reference;
mod report;
#[path = "../tables/mod.rs"]
mod tables;

use std::process::ExitCode;

fn main() -> ExitCode {
    tables::main(&tables::Document { file: "docs/estimation.md", tables: &names::TABLES, make })
}

fn make(name: &str) -> String {
    match name {
        "covariance-forms" => covariance_forms::table(),
        "filter-response" => filter_response::table(),
        "f32-accuracy" => f32_accuracy::table(),
        "f32-accuracy-long" => f32_accuracy::long_table(),
        "honest-covariance" => honest_covariance::table(),
        "coloured-noise" => coloured_noise::table(),
        "montecarlo" => montecarlo::table(),
        other => unreachable!("no maker for {other}"),
    }
}
