//! The verb `budgets`: measures speed and memory against their limits, side by side with what others use.
//!
//! A figure is a ratio of two programs that ran in turn on this machine, a size, or a count of instructions,
//! because seconds by themselves say as much of the machine as of the program. Building is counted in
//! *reference builds* ([`building`]). The table is in docs/measuring.md.

mod building;
mod device;
mod measure;
mod peers;
mod people;
mod table;

use std::cell::OnceCell;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::places;
use crate::process;
use crate::testing;
use crate::toolchain::Core;

/// Says which figures are measured.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Only figures whose names hold this; may be given several times.
    #[arg(long, value_name = "TEXT")]
    only: Vec<String>,
    /// Put the table into docs/measuring.md; of all figures only.
    #[arg(long, conflicts_with = "only")]
    write: bool,
}

/// A figure with its limit.
#[derive(Clone, Debug, PartialEq)]
struct Figure {
    /// Name, as the table prints it.
    name: String,
    /// The figure in its unit.
    value: f64,
    /// The most that it may be.
    limit: f64,
    /// The origin of the figure, for the reader.
    note: String,
}

impl Figure {
    fn is_met(&self) -> bool {
        self.value <= self.limit
    }
}

/// A group of figures that are measured together.
struct Group {
    /// Names of its figures, for `--only`.
    names: &'static str,
    /// True if it needs the scripts, recordings and robots of `../shared`, which are not ours to publish.
    needs_shared: bool,
    measure: fn(&Setting) -> Result<Vec<Figure>>,
}

/// The setting that every group needs.
struct Setting {
    /// The released program, built from the sources here.
    program: PathBuf,
    /// A folder for recordings and answers.
    folder: PathBuf,
    core: Option<Core>,
    /// Processor seconds of the reference build, once it was made.
    reference_s: OnceCell<f64>,
}

const GROUPS: [Group; 7] = [
    Group { names: "one body, 1 000 000 rows", needs_shared: true, measure: peers::one_body },
    Group { names: "10 000 000 rows, memory", needs_shared: true, measure: peers::memory },
    Group { names: "UR5, 100 000 rows", needs_shared: true, measure: peers::arm },
    Group { names: "rows of robots", needs_shared: true, measure: peers::rows },
    Group {
        names: "a person's 300 000 frames; a merge of 10 000 factors",
        needs_shared: false,
        measure: people::figures,
    },
    Group { names: "device: worst sample", needs_shared: false, measure: device::figures },
    Group { names: "first answer; a changed line; CI", needs_shared: false, measure: building::figures },
];

/// Measures, prints the table, and fails if a limit is exceeded or a figure could not be measured.
///
/// # Errors
/// Names the figures above their limits and the groups that could not be measured.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let chosen = |group: &&Group| {
        options.only.is_empty() || options.only.iter().any(|text| group.names.contains(text.as_str()))
    };
    let groups: Vec<&Group> = GROUPS.iter().filter(chosen).collect();
    if groups.is_empty() {
        let names: Vec<&str> = GROUPS.iter().map(|group| group.names).collect();
        bail!("no figure is named so; there are: {}", names.join(", "));
    }
    let setting = Setting { program: released()?, folder: folder()?, core, reference_s: OnceCell::new() };
    let mut figures = Vec::new();
    let mut failures = Vec::new();
    for group in groups {
        println!("\n=== {}", group.names);
        if group.needs_shared && !places::root().join("../shared/cases/speed").is_dir() && !testing::is_ci() {
            println!("skipped: ../shared/cases/speed is not there");
            continue;
        }
        match (group.measure)(&setting) {
            Ok(found) => {
                found.iter().for_each(|figure| println!("{}", table::line(figure)));
                figures.extend(found);
            }
            Err(error) => {
                println!("not measured: {error:#}");
                failures.push(format!("{}: not measured: {error:#}", group.names));
            }
        }
    }
    println!("\n{}", table::text(&figures));
    if options.write {
        if !failures.is_empty() {
            bail!("docs/measuring.md is left as it is:\n  {}", failures.join("\n  "));
        }
        table::write(&figures)?;
    }
    let above = figures.iter().filter(|figure| !figure.is_met());
    failures.extend(above.map(|f| format!("{}: {:.2}, at most {}", f.name, f.value, f.limit)));
    if failures.is_empty() { Ok(()) } else { bail!("{}", failures.join("\n  ")) }
}

/// Builds the program as people use it.
fn released() -> Result<PathBuf> {
    let mut command = process::cargo(places::root());
    process::run(command.args(["build", "--release", "--package", "rigident-cli", "--bin", "rigident"]))?;
    Ok(places::released("rigident"))
}

/// Returns the folder of recordings and answers; what is in it is used again.
fn folder() -> Result<PathBuf> {
    let folder = places::own().join("budgets");
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_above_its_limit_is_not_met() {
        let figure = |value| Figure { name: "a".into(), value, limit: 1.2, note: String::new() };
        assert!(figure(1.2).is_met());
        assert!(!figure(1.21).is_met() && !figure(f64::NAN).is_met());
    }
}
