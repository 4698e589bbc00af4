//! The tables of `docs/trees.md`, made anew: `cargo xtask tables`, or
//! `cargo run -p rigident --example tree_tables -- [NAME...] [--write] [--check]`.
//!
//! Lives here: one file per study, each a function that gives Markdown. May not live here: anything that ships.

mod names;
mod simulated;
mod staubli;
#[path = "../tables/mod.rs"]
mod tables;

use std::process::ExitCode;

fn main() -> ExitCode {
    tables::main(&tables::Document { file: "docs/trees.md", tables: &names::TABLES, make })
}

fn make(name: &str) -> String {
    match name {
        "simulated-long" => simulated::table(),
        "coloured" => simulated::coloured_table(),
        "nearest" => simulated::nearest_table(),
        "staubli" => staubli::table(),
        other => unreachable!("no maker for {other}"),
    }
}
