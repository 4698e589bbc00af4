//! The verb `tables`: makes the tables of `docs/estimation.md`, `docs/platform.md` and `docs/trees.md` anew.

use anyhow::{Context as _, Result, ensure};

use crate::places;
use crate::process;

/// Which tables, and where they go.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Only these; all that do not take long, if none is named.
    names: Vec<String>,
    /// The ones that take minutes, too.
    #[arg(long)]
    long: bool,
    /// Put them into the documents; tables that were not made stay as they are.
    #[arg(long)]
    write: bool,
    /// Change nothing: see whether the documents have a place for every table and no other, and whether those named are
    /// what this command makes.
    #[arg(long)]
    check: bool,
}

/// The documents with tables, each with the example of the host's crate that makes them.
const DOCUMENTS: [(&str, &str); 3] = [
    ("docs/estimation.md", "estimation_tables"),
    ("docs/platform.md", "platform_tables"),
    ("docs/trees.md", "tree_tables"),
];

/// Runs the studies.
pub fn run(options: &Options) -> Result<()> {
    let mut unknown = options.names.clone();
    for (document, example) in DOCUMENTS {
        let text = std::fs::read_to_string(places::root().join(document)).context(document)?;
        let here = |name: &&String| text.contains(&format!("<!-- table: {name} -->"));
        let names: Vec<_> = options.names.iter().filter(here).collect();
        unknown.retain(|name| !names.contains(&name));
        if !options.names.is_empty() && names.is_empty() {
            continue;
        }
        let mut command = process::cargo(places::root());
        command.args(["run", "--quiet", "--package", "rigident", "--example", example, "--"]);
        command.args(&names);
        let flags = [("--long", options.long), ("--write", options.write), ("--check", options.check)];
        command.args(flags.into_iter().filter(|(_, given)| *given).map(|(flag, _)| flag));
        process::run(&mut command)?;
    }
    ensure!(unknown.is_empty(), "no document has a place for {}", unknown.join(", "));
    Ok(())
}
