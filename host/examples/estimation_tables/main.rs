//! The tables of `docs/estimation.md`, made anew: `cargo xtask tables`, or
//! `cargo run -p rigident --example estimation_tables -- [NAME...] [--long] [--write] [--check]`.
//!
//! Lives here: one file per study, each a function that gives Markdown and draws everything from fixed seeds;
//! [`problem`] and [`reference`] are what they share. May not live here: anything that ships. The covariance
//! forms in [`covariance_forms`] exist only to show how they fail.

mod coloured_noise;
mod covariance_forms;
mod document;
mod f32_accuracy;
mod filter_response;
mod honest_covariance;
mod montecarlo;
mod problem;
mod reference;
mod report;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;

#[derive(Parser)]
#[command(about = "Makes the tables of docs/estimation.md")]
struct Arguments {
    /// Only these tables; all that do not take long, if none is named.
    names: Vec<String>,
    /// The ones that take minutes, too.
    #[arg(long)]
    long: bool,
    /// Put them into docs/estimation.md; tables that were not made stay as they are.
    #[arg(long)]
    write: bool,
    /// Change nothing: see whether the document has a place for every table and no other, and whether those named are
    /// what this command makes.
    #[arg(long)]
    check: bool,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn document_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/estimation.md")
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

fn run(arguments: &Arguments) -> Result<(), String> {
    let path = document_path();
    let read = || std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()));
    let known = document::TABLES;
    if let Some(stranger) = arguments.names.iter().find(|n| !known.contains(&n.as_str())) {
        return Err(format!("there is no table {stranger}; there are {}", known.join(", ")));
    }
    if arguments.check {
        let text = read()?;
        let differs = |name: &&String| document::replaced(&text, name, &make(name)).as_ref() != Some(&text);
        let differing = || arguments.names.iter().find(differs);
        let complaint = || differing().map(|name| format!("table {name} is not what this command makes"));
        return document::complaint(&text).or_else(complaint).map_or(Ok(()), Err);
    }
    let wanted = known.into_iter().filter(|name| {
        let by_default = arguments.names.is_empty() && (arguments.long || !name.ends_with("-long"));
        by_default || arguments.names.iter().any(|n| n == name)
    });
    for name in wanted {
        let begun = Instant::now();
        let table = make(name);
        eprintln!("{}: {:.1} s", name, begun.elapsed().as_secs_f64());
        println!("<!-- table: {} -->\n{}\n", name, table.trim());
        if arguments.write {
            let text = document::replaced(&read()?, name, &table)
                .ok_or_else(|| format!("{} has no place for {}", path.display(), name))?;
            std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
        }
    }
    Ok(())
}
