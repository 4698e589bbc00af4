//! The tables of `docs/platform.md`, made anew: `cargo xtask tables`, or
//! `cargo run -p rigident --example platform_tables -- [NAME...] [--long] [--write] [--check]`.
//!
//! Lives here: one file per study, each a function that gives Markdown, beside the paper's figures where it has some. May
//! not live here: anything that ships.

mod adaptive;
mod experiment;
mod motions;
mod names;
mod poses_estimators;
mod poses_montecarlo;
mod poses_objectives;
mod poses_reduction;
mod poses_search;
mod poses_stroke;
mod poses_table_12;
mod still_poses;
#[path = "../tables/mod.rs"]
mod tables;
mod workspace;

use std::process::ExitCode;

fn main() -> ExitCode {
    tables::main(&tables::Document { file: "docs/platform.md", tables: &names::TABLES, make })
}

fn make(name: &str) -> String {
    match name {
        "workspace" => workspace::table(),
        "adaptive" => adaptive::table(),
        "poses-search" => poses_search::table(),
        "poses-table-12" => poses_table_12::table(),
        "poses-stroke" => poses_stroke::table(),
        "poses-objectives" => poses_objectives::table(),
        "poses-montecarlo" => poses_montecarlo::table(),
        "poses-reduction" => poses_reduction::table(),
        "poses-estimators" => poses_estimators::table(),
        "experiment" => experiment::table(),
        "motions-compared" => motions::comparison(),
        "motions-montecarlo" => motions::montecarlo(),
        other => unreachable!("no maker for {other}"),
    }
}
