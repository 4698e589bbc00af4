//! The verb `bench-target`: what a sample costs on the target, counted in the emulator.
//!
//! The board's `bench` binary runs each case between two marks. It runs twice: once as it is, counting its
//! own instructions by the emulated clock, and once traced, which gives the mix and, by
//! the model of [`cycles`], an estimate of Cortex-M4 cycles. The two counts must agree. What is printed:
//! [`table`]; how many samples take how much:
//! [`histogram`]; what it may cost: [`budget`].

mod budget;
mod cycles;
mod histogram;
mod table;
mod trace;

use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use crate::elf::program::Program;
use crate::emulator::{BENCH, emulator};
use crate::firmware;
use crate::process;
use crate::setup;
use crate::size;
use crate::toolchain::{self, Core};
use histogram::Histogram;
use trace::Stretch;

/// The part of the bench that is the baseline.
const C_PART: &str = "C Householder";
/// Parts that are a whole path, and how often one is gone.
const PATHS: [(&str, f64); 3] = [("path", 1000.0), ("frame path", 100.0), ("tracked frame path", 100.0)];
/// The path of a robot that is watched; its N is that of links, and no kernel has it.
const WATCH_PATH: &str = "watch path";
/// The distance allowed between the two ways of counting: the emulated clock ticks once in 40 instructions,
/// and the marks themselves cost a few.
const AGREEMENT: f64 = 0.005;

/// How to print.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Print the JSON of FORMATS on standard output instead of a table.
    #[arg(long)]
    pub json: bool,
    /// Compare with a dense Householder in C; needs arm-none-eabi-gcc, which is installed as root.
    #[arg(long)]
    pub baseline: bool,
}

/// The feature that links the C code, and what compiles it.
const BASELINE: &str = "c-baseline";
const C_COMPILER: (&str, &str) = ("arm-none-eabi-gcc", "gcc-arm-none-eabi");

/// One case as the bench binary reports it, a line of JSON each.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Reported {
    part: String,
    n: u32,
    samples: u64,
    instructions_per_sample: f64,
    /// Samples of the search for the worst, and what that took: to one tick of the emulated clock.
    worst_of: u64,
    worst_instructions: u64,
    /// Instructions of these samples, to one tick, and how many took them.
    histogram: Vec<(u64, u64)>,
}

/// A case by both counts.
struct Case {
    reported: Reported,
    stretch: Stretch,
}

impl Case {
    fn name(&self) -> String {
        format!("{} {}", self.reported.part, self.reported.n)
    }

    /// Instructions per sample, by the trace.
    fn instructions(&self) -> f64 {
        self.per_sample(self.stretch.cost.instructions())
    }

    /// Returns the estimated cycles per sample.
    fn cycles(&self) -> f64 {
        self.per_sample(self.stretch.cost.cycles)
    }

    /// Instructions of the worst sample of both runs.
    fn worst_instructions(&self) -> u64 {
        self.reported.worst_instructions.max(self.stretch.most_instructions)
    }

    fn per_sample(&self, total: u64) -> f64 {
        (total as f64 / self.reported.samples as f64 * 10.0).round() / 10.0
    }

    fn check(&self) -> Result<()> {
        let (traced, clock) = (self.instructions(), self.reported.instructions_per_sample);
        if (traced - clock).abs() > AGREEMENT * clock {
            bail!(
                "{}: {clock} instructions a sample by the emulated clock, but {traced} in the trace",
                self.name()
            );
        }
        Ok(())
    }
}

/// One entry of the JSON.
#[derive(Clone, Debug, Serialize)]
struct Entry {
    n: u32,
    instructions_per_sample: f64,
    estimated_cycles_m4: f64,
    #[serde(flatten)]
    path: Option<PathEntry>,
    #[serde(flatten)]
    baseline: Option<BaselineEntry>,
    flash_bytes: u64,
    ram_bytes: u64,
    worst_stack_bytes: u64,
}

/// The part of an entry that only sizes with a whole path have: that of a sample, or of a frame of a tree.
#[derive(Clone, Debug, Serialize)]
struct PathEntry {
    path_rate_hz: f64,
    path_instructions_per_sample: f64,
    path_estimated_cycles_m4: f64,
    path_worst_instructions: u64,
    path_worst_estimated_cycles_m4: u64,
    #[serde(flatten)]
    histogram: Option<Histogram>,
}

/// The C Householder on given rows.
#[derive(Clone, Debug, Serialize)]
struct BaselineEntry {
    baseline_instructions_per_sample: f64,
    baseline_estimated_cycles_m4: f64,
}

/// Returns whether the C compiler of [`Options::baseline`] is here already.
pub fn can_compile_baseline() -> bool {
    process::is_installed(C_COMPILER.0)
}

/// Builds, runs, compares the two counts and prints.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    setup::system_packages()?;
    let core = toolchain::choose(core)?;
    let firmware = Program::read(&firmware::build(core, &[])?)?;
    if options.baseline && !can_compile_baseline() {
        setup::apt_install(&[C_COMPILER.1])?;
    }
    let features: &[&str] = if options.baseline { &[firmware::WATCH, BASELINE] } else { &[firmware::WATCH] };
    let bench = firmware::build_binary(core, BENCH, features)?;
    let reported = reported(&bench)?;
    let stretches = trace::stretches(&Program::read(&bench)?)?;
    if stretches.len() != reported.len() {
        bail!("the bench binary reports {} cases, but {} were traced", reported.len(), stretches.len());
    }
    let cases: Vec<Case> =
        reported.into_iter().zip(stretches).map(|(reported, stretch)| Case { reported, stretch }).collect();
    cases.iter().try_for_each(Case::check)?;
    let entries = entries(&cases, &firmware)?;
    if options.json {
        println!("{}", serde_json::to_string(&entries)?);
    } else {
        table::print(&cases, &entries);
    }
    budget::check(&cases)
}

/// Runs the binary as it is and reads what it says.
fn reported(bench: &Path) -> Result<Vec<Reported>> {
    let text = process::output(&mut emulator(bench, &[BENCH]))?;
    let cases: Vec<Reported> = text.lines().filter_map(parse_case).collect();
    if cases.is_empty() { bail!("the bench binary reported no case") } else { Ok(cases) }
}

fn parse_case(line: &str) -> Option<Reported> {
    serde_json::from_str(line).ok()
}

/// Returns one entry for every size that has a kernel of its own: a body's, or that of given rows.
fn entries(cases: &[Case], firmware: &Program) -> Result<Vec<Entry>> {
    let find =
        |part: &str, n: u32| cases.iter().find(|case| case.reported.part == part && case.reported.n == n);
    let worst_stack_bytes = size::stack_bound(firmware)?;
    let of_kernels = cases.iter().filter(|case| case.reported.part != WATCH_PATH);
    let mut sizes: Vec<u32> = of_kernels.map(|case| case.reported.n).collect();
    sizes.sort_unstable();
    sizes.dedup();
    sizes
        .into_iter()
        .map(|n| {
            let kernel = find("kernel", n).or_else(|| find("dense", n));
            let kernel = kernel.with_context(|| format!("the bench binary has no kernel for N = {n}"))?;
            Ok(Entry {
                n,
                instructions_per_sample: kernel.instructions(),
                estimated_cycles_m4: kernel.cycles(),
                path: PATHS.iter().find_map(|(part, rate)| Some((find(part, n)?, *rate))).map(
                    |(path, rate)| PathEntry {
                        path_rate_hz: rate,
                        path_instructions_per_sample: path.instructions(),
                        path_estimated_cycles_m4: path.cycles(),
                        path_worst_instructions: path.worst_instructions(),
                        path_worst_estimated_cycles_m4: path.stretch.worst.1,
                        histogram: Histogram::of(&path.reported.histogram),
                    },
                ),
                baseline: find(C_PART, n).map(|c| BaselineEntry {
                    baseline_instructions_per_sample: c.instructions(),
                    baseline_estimated_cycles_m4: c.cycles(),
                }),
                flash_bytes: firmware.memory.flash,
                ram_bytes: firmware.memory.ram,
                worst_stack_bytes,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reported_case_is_read_and_other_output_is_not() {
        let line = r#"{"part":"kernel","n":16,"samples":10,"instructions_per_sample":420.5,"worst_of":7,"worst_instructions":640,"histogram":[[400,6],[640,1]]}"#;
        let expected = Reported {
            part: "kernel".into(),
            n: 16,
            samples: 10,
            instructions_per_sample: 420.5,
            worst_of: 7,
            worst_instructions: 640,
            histogram: vec![(400, 6), (640, 1)],
        };
        assert_eq!(parse_case(line), Some(expected));
        assert_eq!(parse_case("hello"), None);
        assert_eq!(parse_case(r#"{"part":"kernel"}"#), None);
    }
}
