//! The verb `bench-target`: what a sample costs on the target, counted in the emulator.
//!
//! The board's `bench` binary runs each case between two marks. It runs twice: once as it is, counting its own
//! instructions by the emulated clock, and once traced instruction by instruction, which gives the mix and, by
//! the model of [`cycles`], an estimate of Cortex-M4 cycles. The two counts must agree.

mod cycles;
mod trace;

use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use crate::elf::program::Program;
use crate::firmware;
use crate::process;
use crate::setup;
use crate::toolchain::{self, Core};
use cycles::Cost;

/// The bench binary of the board crate.
const BINARY: &str = "bench";
/// How far the two ways of counting may be apart: the emulated clock ticks once in 40 instructions, and the
/// marks themselves cost a few.
const AGREEMENT: f64 = 0.005;

/// The clock and the rate for which a share of the processor is stated.
const CLOCK_HZ: f64 = 168e6;
const RATE_HZ: f64 = 1000.0;

/// How to print.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Print the JSON of FORMATS on standard output instead of a table.
    #[arg(long)]
    pub json: bool,
}

/// One case as the bench binary reports it, a line of JSON each.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Reported {
    part: String,
    n: u32,
    samples: u64,
    instructions_per_sample: f64,
}

/// One entry of the JSON.
#[derive(Clone, Debug, Serialize)]
struct Entry {
    n: u32,
    instructions_per_sample: f64,
    estimated_cycles_m4: f64,
    path_instructions_per_sample: f64,
    path_estimated_cycles_m4: f64,
    flash_bytes: u64,
    ram_bytes: u64,
}

/// Builds, runs, compares the two counts and prints.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    setup::system_packages()?;
    let core = toolchain::choose(core)?;
    let firmware = Program::read(&firmware::build(core, &[])?)?;
    let bench = firmware::build_binary(core, BINARY, &[])?;
    let reported = reported(&bench)?;
    let costs = trace::regions(&Program::read(&bench)?)?;
    if costs.len() != reported.len() {
        bail!("the bench binary reports {} cases, but {} were traced", reported.len(), costs.len());
    }
    for (case, cost) in reported.iter().zip(&costs) {
        let traced = cost.instructions() as f64 / case.samples as f64;
        if (traced - case.instructions_per_sample).abs() > AGREEMENT * case.instructions_per_sample {
            bail!(
                "{} with N = {}: {} instructions a sample by the emulated clock, but {traced:.1} in the trace",
                case.part,
                case.n,
                case.instructions_per_sample
            );
        }
    }
    let entries = entries(&reported, &costs, &firmware)?;
    if options.json {
        println!("{}", serde_json::to_string(&entries)?);
    } else {
        print_tables(&reported, &costs, &entries);
    }
    Ok(())
}

/// Runs the binary as it is and reads what it says.
fn reported(bench: &Path) -> Result<Vec<Reported>> {
    let text = process::output(&mut trace::emulator(bench))?;
    let cases: Vec<Reported> = text.lines().filter_map(parse_case).collect();
    if cases.is_empty() { bail!("the bench binary reported no case") } else { Ok(cases) }
}

fn parse_case(line: &str) -> Option<Reported> {
    serde_json::from_str(line).ok()
}

fn entries(reported: &[Reported], costs: &[Cost], firmware: &Program) -> Result<Vec<Entry>> {
    let mut sizes: Vec<u32> = reported.iter().map(|case| case.n).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let find = |name: &str, n: u32| {
        let index = reported.iter().position(|case| case.part == name && case.n == n);
        let index = index.with_context(|| format!("the bench binary has no case {name} {n}"))?;
        let samples = reported[index].samples as f64;
        let rounded = |value: f64| (value / samples * 10.0).round() / 10.0;
        anyhow::Ok((rounded(costs[index].instructions() as f64), rounded(costs[index].cycles as f64)))
    };
    sizes
        .into_iter()
        .map(|n| {
            let (kernel, path) = (find("kernel", n)?, find("path", n)?);
            Ok(Entry {
                n,
                instructions_per_sample: kernel.0,
                estimated_cycles_m4: kernel.1,
                path_instructions_per_sample: path.0,
                path_estimated_cycles_m4: path.1,
                flash_bytes: firmware.memory.flash,
                ram_bytes: firmware.memory.ram,
            })
        })
        .collect()
}

fn print_tables(reported: &[Reported], costs: &[Cost], entries: &[Entry]) {
    println!(
        "| N | kernel: instructions | cycles, estimated | whole path: instructions | cycles, estimated |"
    );
    println!("|---|---|---|---|---|");
    for e in entries {
        println!(
            "| {} | {:.0} | {:.0} | {:.0} | {:.0} |",
            e.n,
            e.instructions_per_sample,
            e.estimated_cycles_m4,
            e.path_instructions_per_sample,
            e.path_estimated_cycles_m4
        );
    }
    for e in entries {
        let share = e.path_estimated_cycles_m4 * RATE_HZ / CLOCK_HZ;
        println!(
            "\nN = {}: {:.1} % of a processor at 168 MHz, for 1000 samples a second",
            e.n,
            100.0 * share
        );
    }
    println!("\nInstructions per sample, by kind:\n");
    let heads: Vec<String> = reported.iter().map(|case| format!("{} {}", case.part, case.n)).collect();
    println!("| | {} |", heads.join(" | "));
    println!("|---|{}", "---|".repeat(heads.len()));
    for kind in cycles::KINDS {
        let counts: Vec<String> = reported
            .iter()
            .zip(costs)
            .map(|(case, cost)| format!("{:.1}", cost.count(kind) as f64 / case.samples as f64))
            .collect();
        println!("| {kind} | {} |", counts.join(" | "));
    }
    println!("\nCycles: {}", cycles::MODEL);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reported_case_is_read_and_other_output_is_not() {
        let line = r#"{"part":"kernel","n":16,"samples":10,"instructions_per_sample":420.5}"#;
        let expected = Reported { part: "kernel".into(), n: 16, samples: 10, instructions_per_sample: 420.5 };
        assert_eq!(parse_case(line), Some(expected));
        assert_eq!(parse_case("hello"), None);
        assert_eq!(parse_case(r#"{"part":"kernel"}"#), None);
    }
}
