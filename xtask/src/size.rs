//! The verb `size`: flash, RAM and worst stack of the firmware, of each image against a golden file, and what
//! flash is promised at most.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use crate::check_elf::is_panic;
use crate::elf::graph::Graph;
use crate::elf::program::Program;
use crate::elf::stack::{self, Depth};
use crate::firmware::{self, Board, WATCH};
use crate::places;
use crate::toolchain::{self, Core};

/// How to compare.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Write the golden file instead of comparing with it.
    #[arg(long)]
    pub overwrite: bool,
    /// Print JSON on standard output.
    #[arg(long)]
    pub json: bool,
    /// Print the way to the deepest stack of every image.
    #[arg(long)]
    pub way: bool,
}

/// Bytes. The two compilers that can build the firmware differ by a little.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Sizes {
    flash_bytes: u64,
    ram_bytes: u64,
    worst_stack_bytes: u64,
}

/// The images that are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Images {
    /// The standard one.
    whole: Sizes,
    /// Sizes without the features `links` and `frames`: one body alone.
    body_only: Sizes,
    /// The one that is flashed: for an STM32F405, one body and two links.
    stm32f405: Sizes,
    /// The emulated board's with the feature `watch`.
    watch: Sizes,
    /// The STM32F405's with the feature `watch`.
    stm32f405_watch: Sizes,
}

impl Images {
    /// Returns each size with its name.
    fn named(&self) -> [(&'static str, Sizes); 5] {
        [
            ("whole image", self.whole),
            ("image for one body alone", self.body_only),
            ("image for an STM32F405", self.stm32f405),
            ("image with the watch", self.watch),
            ("image with the watch for an STM32F405", self.stm32f405_watch),
        ]
    }
}

/// Flash at most: of the whole image, of the one for a body alone, of the STM32F405's, and of those that
/// watch robots. Parts with 512 kB are to have room for the STM32F405's.
const MOST_FLASH_BYTES: [u64; 5] = [348_000, 241_000, 316_000, 384_000, 352_000];
/// The distance of a size allowed from the golden file's: a part, and bytes on top for small ones.
const TOLERANCE: (f64, u64) = (0.05, 64);
/// Bytes an exception saves by itself with the floating-point context, and one word to align.
const EXCEPTION_FRAME: u32 = 26 * 4 + 4;

/// Measures, prints and compares.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let core = toolchain::choose(core)?;
    let whole = measure(&firmware::build(core, &[])?, options.way)?;
    let body_only = measure(&firmware::build_body_only(core)?, options.way)?;
    let stm32f405 = measure(&firmware::build_for(Board::F405, core, &[])?, options.way)?;
    let watch = measure(&firmware::build_watch(core)?, options.way)?;
    let stm32f405_watch = measure(&firmware::build_for(Board::F405, core, &[WATCH])?, options.way)?;
    let images = Images { whole, body_only, stm32f405, watch, stm32f405_watch };
    if options.json {
        println!("{}", serde_json::to_string(&images)?);
    } else {
        println!(
            "| bytes | whole image | one body alone | STM32F405 | with the watch | STM32F405 with the watch \
             |\n|---|---|---|---|---|---|"
        );
        let row = |what: &str, of: fn(&Sizes) -> u64| {
            println!(
                "| {what} | {} | {} | {} | {} | {} |",
                of(&whole),
                of(&body_only),
                of(&stm32f405),
                of(&watch),
                of(&stm32f405_watch)
            );
        };
        row("flash", |sizes| sizes.flash_bytes);
        row("RAM, static", |sizes| sizes.ram_bytes);
        row("worst stack, bound by the call graph", |sizes| sizes.worst_stack_bytes);
    }
    hold(&images)?;
    compare(&images, options.overwrite)
}

/// Returns the sizes of a linked image, whose worst stack must find room.
fn measure(elf: &Path, way: bool) -> Result<Sizes> {
    let program = Program::read(elf)?;
    let (main, handlers) = depths(&program)?;
    if way {
        for depth in std::iter::once(&main).chain(&handlers) {
            eprintln!("{} bytes:", depth.bytes);
            depth.way.iter().for_each(|(name, own)| eprintln!("  {own:6}  {name}"));
        }
    }
    let worst = worst_stack(&main, &handlers);
    let room = stack_room(&program)?;
    if worst > room {
        bail!("the worst stack is {worst} bytes, and there is room for {room}");
    }
    Ok(Sizes { flash_bytes: program.memory.flash, ram_bytes: program.memory.ram, worst_stack_bytes: worst })
}

/// Holds the images against what is promised.
fn hold(images: &Images) -> Result<()> {
    let above: Vec<String> = images
        .named()
        .into_iter()
        .zip(MOST_FLASH_BYTES)
        .map(|((what, sizes), most)| (what, sizes, most))
        .filter(|(_, sizes, most)| sizes.flash_bytes > *most)
        .map(|(what, sizes, most)| {
            format!("the {what} takes {} bytes of flash, {most} at most", sizes.flash_bytes)
        })
        .collect();
    if above.is_empty() { Ok(()) } else { bail!("not what is promised: {}", above.join("; ")) }
}

/// Returns the worst stack of a program, bytes.
pub fn stack_bound(program: &Program) -> Result<u64> {
    let (main, handlers) = depths(program)?;
    Ok(worst_stack(&main, &handlers))
}

/// Returns the worst stack of the main program and every handler on top of it and of each other.
fn worst_stack(main: &Depth, handlers: &[Depth]) -> u64 {
    u64::from(main.bytes) + handlers.iter().map(|h| u64::from(h.bytes + EXCEPTION_FRAME)).sum::<u64>()
}

fn golden() -> PathBuf {
    places::root().join("xtask/golden/size.json")
}

fn compare(images: &Images, overwrite: bool) -> Result<()> {
    let path = golden();
    if overwrite {
        std::fs::create_dir_all(path.parent().unwrap_or(places::root()))?;
        return Ok(std::fs::write(&path, serde_json::to_string_pretty(images)? + "\n")?);
    }
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("no {}; make it with `cargo xtask size --overwrite`", path.display()))?;
    let before: Images = serde_json::from_str(&text)?;
    let pairs = before.named().into_iter().zip(images.named());
    let off: Vec<String> =
        pairs.flat_map(|((image, before), (_, now))| differences(image, &before, &now)).collect();
    if off.is_empty() {
        return Ok(());
    }
    bail!("{}; if that is meant, `cargo xtask size --overwrite`", off.join(", "))
}

/// Returns what is further from the golden file than the two compilers are from each other.
fn differences(image: &str, before: &Sizes, now: &Sizes) -> Vec<String> {
    let pairs = [
        ("flash", before.flash_bytes, now.flash_bytes),
        ("RAM", before.ram_bytes, now.ram_bytes),
        ("worst stack", before.worst_stack_bytes, now.worst_stack_bytes),
    ];
    pairs
        .into_iter()
        .filter(|&(_, golden, now)| golden.abs_diff(now) > (golden as f64 * TOLERANCE.0) as u64 + TOLERANCE.1)
        .map(|(what, golden, now)| format!("{image}: {what} was {golden} and is {now}"))
        .collect()
}

/// Returns the bytes between the static variables and the top of the stack.
fn stack_room(program: &Program) -> Result<u64> {
    let address = |symbol: &str| {
        program.symbols.get(symbol).copied().with_context(|| format!("there is no symbol {symbol}"))
    };
    Ok(u64::from(address("_stack_start")?.saturating_sub(address("_stack_end")?)))
}

/// Returns the main program's depth and every exception handler's.
///
/// Handlers are summed up, as if each interrupted the one before: a bound for any priorities.
fn depths(program: &Program) -> Result<(Depth, Vec<Depth>)> {
    let graph = Graph::new(program);
    let is_end = |index: usize| is_panic(&program.functions[index]);
    let root = program.function_of_symbol("Reset").context("there is no Reset handler")?;
    let main = stack::worst(program, &graph, root, &is_end)?;
    let handlers = handlers(program)
        .into_iter()
        .map(|handler| stack::worst(program, &graph, handler, &is_end))
        .collect::<Result<_>>()?;
    Ok((main, handlers))
}

/// Returns the distinct handlers in the vector table, without Reset and the hard fault, which does not
/// return.
fn handlers(program: &Program) -> Vec<usize> {
    const HARD_FAULT: usize = 3;
    let mut found: Vec<usize> = program
        .vectors
        .clone()
        .step_by(4)
        .enumerate()
        .filter(|&(entry, _)| entry >= 2 && entry != HARD_FAULT)
        .filter_map(|(_, address)| program.word(address))
        .filter_map(|handler| program.function_at(handler & !1).filter(|_| handler & 1 == 1))
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}
