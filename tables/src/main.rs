//! Makes the tables of Rigident's documents anew:
//! `cargo xtask tables [NAME...] [--long] [--write] [--check]`.
//!
//! One module per document, one file per study. Everything is drawn from fixed seeds. Nothing here ships.

mod document;
mod estimation;
mod faults;
mod people;
mod platform;
mod trees;

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use document::{DOCUMENTS, Document, Table};

#[derive(Parser)]
#[command(name = "cargo xtask tables", about = "Makes the tables of the documents")]
struct Arguments {
    /// Only these tables; all that do not take long, if none is named.
    names: Vec<String>,
    /// The ones that take minutes, too.
    #[arg(long)]
    long: bool,
    /// Put them into the documents; tables that were not made stay as they are.
    #[arg(long)]
    write: bool,
    /// Change nothing: see whether the documents have a place for every table and no other, and whether those
    /// named are what this command makes.
    #[arg(long)]
    check: bool,
    /// Only the cases of docs/faults.md whose names hold this; prints them, and fails if one goes wrong.
    #[arg(long)]
    fault: Option<String>,
    /// Only the cases of docs/faults.md that take a minute; likewise.
    #[arg(long)]
    short_faults: bool,
}

impl Arguments {
    fn names(&self, table: &Table) -> bool {
        self.names.iter().any(|name| name == table.name)
    }
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

fn run(arguments: &Arguments) -> Result<(), String> {
    if arguments.fault.is_some() || arguments.short_faults {
        let extent = if arguments.short_faults { faults::Extent::SHORT } else { faults::Extent::LONG };
        return faults::run(arguments.fault.as_deref(), extent);
    }
    let known: Vec<&str> = DOCUMENTS.iter().flat_map(|d| d.tables).map(|table| table.name).collect();
    if let Some(stranger) = arguments.names.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(format!("there is no table {stranger}; there are {}", known.join(", ")));
    }
    DOCUMENTS.iter().try_for_each(|document| {
        if arguments.check { check(document, arguments) } else { make(document, arguments) }
    })
}

/// Compares the document with what its tables' makers give.
fn check(document: &Document, arguments: &Arguments) -> Result<(), String> {
    let text = document.read()?;
    document.complaint(&text).map_or(Ok(()), Err)?;
    for table in document.tables.iter().filter(|table| arguments.names(table)) {
        if document::replaced(&text, table.name, &(table.make)()).as_ref() != Some(&text) {
            return Err(format!("table {} of {} is not what this command makes", table.name, document.file));
        }
    }
    Ok(())
}

/// Makes the tables asked for, prints them, and writes them if asked to.
fn make(document: &Document, arguments: &Arguments) -> Result<(), String> {
    let by_default =
        |table: &Table| arguments.names.is_empty() && (arguments.long || !table.name.ends_with("-long"));
    for table in document.tables.iter().filter(|table| by_default(table) || arguments.names(table)) {
        let begun = Instant::now();
        let markdown = (table.make)();
        eprintln!("{}: {:.1} s", table.name, begun.elapsed().as_secs_f64());
        println!("<!-- table: {} -->\n{}\n", table.name, markdown.trim());
        if arguments.write {
            let text = document::replaced(&document.read()?, table.name, &markdown)
                .ok_or_else(|| format!("{} has no place for {}", document.file, table.name))?;
            document.write(&text)?;
        }
    }
    Ok(())
}
