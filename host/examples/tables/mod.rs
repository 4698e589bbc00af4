//! What every command that makes the tables of a document shares.
//!
//! Lives here: its command line, and a document's markers ([`document`]). May not live here: any study.

pub mod document;

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;

/// A document and who makes its tables.
pub struct Document<'a> {
    /// From the root of the repository.
    pub file: &'a str,
    /// In the document's order. Those that end in `-long` are made only when named or with `--long`.
    pub tables: &'a [&'a str],
    /// Markdown of a table.
    pub make: fn(&str) -> String,
}

#[derive(Parser)]
#[command(about = "Makes the tables of a document")]
struct Arguments {
    /// Only these tables; all that do not take long, if none is named.
    names: Vec<String>,
    /// The ones that take minutes, too.
    #[arg(long)]
    long: bool,
    /// Put them into the document; tables that were not made stay as they are.
    #[arg(long)]
    write: bool,
    /// Change nothing: see whether the document has a place for every table and no other, and whether those named are
    /// what this command makes.
    #[arg(long)]
    check: bool,
}

/// Does what the command line says.
pub fn main(document: &Document) -> ExitCode {
    match run(document, &Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(Document { file, tables: known, make }: &Document, arguments: &Arguments) -> Result<(), String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
    let read = || std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()));
    if let Some(stranger) = arguments.names.iter().find(|n| !known.contains(&n.as_str())) {
        return Err(format!("there is no table {stranger}; there are {}", known.join(", ")));
    }
    if arguments.check {
        let text = read()?;
        let differs = |name: &&String| document::replaced(&text, name, &make(name)).as_ref() != Some(&text);
        let differing = || arguments.names.iter().find(differs);
        let complaint = || differing().map(|name| format!("table {name} is not what this command makes"));
        return document::complaint(&text, known).or_else(complaint).map_or(Ok(()), Err);
    }
    let wanted = known.iter().copied().filter(|name| {
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
