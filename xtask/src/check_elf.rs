//! The verb `check-elf`: no double precision in the firmware, no panic within reach of its sample path.
//!
//! Each check is also run on a firmware built with a planted offender, which it must find.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::elf::graph::{self, Graph};
use crate::elf::program::{Function, Program};
use crate::elf::thumb::{Flow, Instruction};
use crate::firmware::{self, Board, WATCH};
use crate::process::Steps;
use crate::toolchain::{self, Core};

/// The functions that take one sample, or one frame of a tree or of a robot that is watched, from the drivers
/// to the factor. The last is in the image that watches alone.
pub const PATHS: [&str; 3] = ["rigident_sample_path", "rigident_frame_path", "rigident_watch_path"];

/// What to check.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Check this ELF alone, without building and without planted offenders.
    #[arg(long)]
    pub elf: Option<PathBuf>,
}

/// Runs both checks on the firmware, then on the planted offenders.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    if let Some(elf) = &options.elf {
        let program = Program::read(elf)?;
        let has = |path: &&str| program.function_of_symbol(path).is_some();
        let paths: Vec<&str> = PATHS.iter().copied().filter(has).collect();
        if paths.is_empty() {
            bail!("{} has none of {}: it is no firmware of this project", elf.display(), PATHS.join(", "));
        }
        return check_paths(elf, &paths);
    }
    let core = toolchain::choose(core)?;
    let mut steps = Steps::default();
    run_steps(&mut steps, core);
    steps.finish()
}

/// Runs the checks as named steps.
pub fn run_steps(steps: &mut Steps, core: Core) {
    steps.run("check-elf", || check_file(&firmware::build(core, &[])?));
    steps.run("check-elf, with the watch", || check_watch_file(&firmware::build_watch(core)?));
    steps.run("check-elf, STM32F405", || {
        // Frames of trees have no way into it.
        check_paths(&firmware::build_for(Board::F405, core, &[])?, &PATHS[..1])
    });
    steps.run("check-elf, STM32F405 with the watch", || {
        check_paths(&firmware::build_for(Board::F405, core, &[WATCH])?, &[PATHS[0], PATHS[2]])
    });
    steps.run("check-elf finds planted double precision", || {
        let program = Program::read(&firmware::build(core, &["plant-double"])?)?;
        expect_offender("plant-double", &double_precision(&program))
    });
    steps.run("check-elf finds a planted panic", || {
        let program = Program::read(&firmware::build(core, &["plant-panic"])?)?;
        expect_offender("plant-panic", &unwelcome_within_reach(&program, PATHS[0])?.0)
    });
}

/// Runs both checks on the standard firmware, which does not watch.
pub fn check_file(elf: &Path) -> Result<()> {
    check_paths(elf, &PATHS[..2])
}

/// Does both checks on the firmware that watches robots.
pub fn check_watch_file(elf: &Path) -> Result<()> {
    check_paths(elf, &PATHS)
}

fn check_paths(elf: &Path, paths: &[&str]) -> Result<()> {
    let program = Program::read(elf)?;
    let mut offenders = double_precision(&program);
    offenders.extend(short_handlers(&program));
    let mut clean = Vec::new();
    for root in paths {
        let (on_path, reached) = unwelcome_within_reach(&program, root)?;
        offenders.extend(on_path);
        clean.push(format!("no panic among the {reached} functions within reach of {root}"));
    }
    if !offenders.is_empty() {
        bail!("\n    {}", offenders.join("\n    "));
    }
    println!("no double-precision helper among {} functions", program.functions.len());
    println!("{}", clean.join("\n"));
    Ok(())
}

fn expect_offender(feature: &str, offenders: &[String]) -> Result<()> {
    if offenders.is_empty() {
        bail!("the offender that feature {feature} plants was not found");
    }
    println!("found, as it should be:\n    {}", offenders.join("\n    "));
    Ok(())
}

/// Handlers that return within this many instructions: one of one or two beside its return may lose the
/// result of a division or root that it interrupts (Arm's erratum 776924 of the Cortex-M4).
const SHORT: usize = 3;

/// Exceptions and interrupts whose handlers are too short.
fn short_handlers(program: &Program) -> Vec<String> {
    let vectors = program.vectors.clone().step_by(4).enumerate();
    let handlers = vectors.skip(2).filter_map(|(number, at)| {
        let function = program.function_at(program.word(at)? & !1)?;
        let function = &program.functions[function];
        is_short(&program.instructions(function)).then(|| (function.name.clone(), number))
    });
    let mut first = std::collections::BTreeMap::new();
    handlers.for_each(|(name, number)| {
        first.entry(name).or_insert(number);
    });
    let offender =
        |(name, number)| format!("a handler of {SHORT} instructions or less: {name}, exception {number}");
    first.into_iter().map(offender).collect()
}

/// Returns true if a function returns within [`SHORT`] instructions. One that loops, or ends elsewhere, does
/// not return.
fn is_short(instructions: &[(u32, Instruction)]) -> bool {
    let returns = instructions.iter().position(|(_, instruction)| instruction.flow == Flow::Return);
    returns.is_some_and(|position| position < SHORT)
}

/// Helpers for double-precision arithmetic that are linked, whoever calls them.
fn double_precision(program: &Program) -> Vec<String> {
    program
        .functions
        .iter()
        .filter(|function| function.symbols.iter().any(|symbol| is_double_helper(symbol)))
        .map(|function| format!("double precision: {}", function.name))
        .collect()
}

/// Returns true for names of the run-time ABI (IHI 0043, 4.1.2) and of compiler-rt: arithmetic on, to or from
/// double.
fn is_double_helper(symbol: &str) -> bool {
    let plain = crate::elf::program::readable(symbol);
    let name = plain.rsplit("::").next().unwrap_or(&plain);
    if let Some(rest) = name.strip_prefix("__aeabi_") {
        return rest.starts_with('d') && !rest.starts_with("div")
            || ["f2d", "i2d", "ui2d", "l2d", "ul2d"].contains(&rest);
    }
    let Some(rest) = name.strip_prefix("__") else { return false };
    // adddf3, ltdf2, fixdfsi, floatsidf, extendsfdf2, truncdfsf2, powidf2, with or without `vfp` behind.
    [
        "df2", "df3", "dfsi", "dfdi", "dfti", "sidf", "didf", "tidf", "dfsf2", "df2vfp", "df3vfp", "dfsi4",
        "df4",
    ]
    .iter()
    .any(|end| rest.ends_with(end))
}

/// Returns panics, aborts and calls of unknown target within reach of a function, and the number of functions
/// that are.
fn unwelcome_within_reach(program: &Program, root: &str) -> Result<(Vec<String>, usize)> {
    let root = program
        .function_of_symbol(root)
        .with_context(|| format!("{} has no symbol {root}", program.path.display()))?;
    let graph = Graph::new(program);
    let reached = graph.reachable(root, |index| is_panic(&program.functions[index]));
    let mut found = Vec::new();
    for &index in reached.keys() {
        let way = graph::path(program, &reached, index);
        if is_panic(&program.functions[index]) {
            found.push(format!("a panic: {way}"));
            continue;
        }
        for address in &graph.exits[index].traps {
            found.push(format!("an abort at {address:#x}: {way}"));
        }
        for address in &graph.exits[index].unknown {
            found.push(format!("a call through a register at {address:#x}, of unknown target: {way}"));
        }
    }
    Ok((found, reached.len()))
}

/// Returns whether a function is part of panicking: `core`'s and defmt's, and what they end in.
pub fn is_panic(function: &Function) -> bool {
    const PARTS: [&str; 10] = [
        "core::panicking",
        "rust_begin_unwind",
        "rust_panic",
        "unwrap_failed",
        "expect_failed",
        "_fail_rt",
        "slice_index_fail",
        "len_mismatch_fail",
        "defmt::export::panic",
        "_defmt_panic",
    ];
    std::iter::once(&function.name)
        .chain(&function.symbols)
        .any(|name| PARTS.iter().any(|part| name.contains(part)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elf::thumb;

    /// Decodes half-words, as they are in memory.
    fn decoded(halfwords: &[u16]) -> Vec<(u32, Instruction)> {
        let mut found = Vec::new();
        let mut at = 0;
        while let Some(first) = halfwords.get(at) {
            let instruction =
                thumb::decode(2 * at as u32, *first, halfwords.get(at + 1).copied().unwrap_or(0));
            found.push((2 * at as u32, instruction));
            at += instruction.size as usize / 2;
        }
        found
    }

    #[test]
    fn a_handler_that_returns_at_once_is_short_and_one_that_loops_or_works_is_not() {
        // bx lr; nop, bx lr; push {r7, lr}, mov r7, sp, pop {r7, pc}.
        for short in [&[0x4770][..], &[0xbf00, 0x4770], &[0xb580, 0x466f, 0xbd80]] {
            assert!(is_short(&decoded(short)), "{short:x?}");
        }
        // b .; and one that reads a register before it returns.
        for long in [&[0xe7fe][..], &[0xb580, 0x466f, 0x6800, 0x6001, 0xbd80]] {
            assert!(!is_short(&decoded(long)), "{long:x?}");
        }
    }
}
