//! Executed instructions, from the emulator's own trace through a named pipe.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::ops::Range;
use std::path::Path;
use std::process::Stdio;

use anyhow::{Context, Result, bail};

use super::cycles::Cost;
use crate::elf::program::Program;
use crate::elf::thumb::Instruction;
use crate::emulator::{BENCH, emulator};
use crate::places;
use crate::process;

/// Functions of the bench binary that it calls around each case. What lies between is counted.
const BEGIN: &str = "bench_begin";
const END: &str = "bench_end";
/// The function that the bench calls at the beginning of each sample. Its own instructions are not counted.
const SAMPLE: &str = "bench_sample";

/// A stretch between the two marks.
#[derive(Clone, Debug, Default)]
pub struct Stretch {
    /// All of it.
    pub cost: Cost,
    /// Instructions and estimated cycles of the sample that took the most cycles.
    pub worst: (u64, u64),
    /// Instructions of the sample that took the most instructions; it need not be the same one.
    pub most_instructions: u64,
    /// Instructions and cycles when the sample began that is being counted.
    begun: Option<(u64, u64)>,
}

impl Stretch {
    fn so_far(&self) -> (u64, u64) {
        (self.cost.instructions(), self.cost.cycles)
    }

    fn end_sample(&mut self) {
        let (instructions, cycles) = self.so_far();
        if let Some((i, c)) = self.begun.take() {
            self.most_instructions = self.most_instructions.max(instructions - i);
            if cycles - c > self.worst.1 {
                self.worst = (instructions - i, cycles - c);
            }
        }
    }

    fn begin_sample(&mut self) {
        self.end_sample();
        self.begun = Some(self.so_far());
    }
}

/// Returns what each stretch between the two marks cost, in the order they ran.
pub fn stretches(program: &Program) -> Result<Vec<Stretch>> {
    let mark = |symbol: &str| {
        let index = program.function_of_symbol(symbol);
        let index = index.with_context(|| format!("{} has no symbol {symbol}", program.path.display()))?;
        anyhow::Ok(program.functions[index].range.clone())
    };
    let marks = Marks { begin: mark(BEGIN)?.start, end: mark(END)?.start, sample: mark(SAMPLE)? };
    let folder = places::own().join("trace");
    std::fs::create_dir_all(&folder)?;
    let pipe = folder.join(format!("pipe-{}", std::process::id()));
    process::output(process::command("mkfifo", &folder).arg(&pipe))?;
    let log = File::create(folder.join("output.txt"))?;
    let mut child = emulator(&program.path, &[BENCH, "traced"])
        .args(["-d", "in_asm,exec,nochain", "-D"])
        .arg(&pipe)
        .stdout(Stdio::from(log.try_clone()?))
        .stderr(Stdio::from(log))
        .spawn()
        .context("cannot start qemu-system-arm")?;
    let counted =
        File::open(&pipe).map_err(anyhow::Error::from).and_then(|file| count(file, program, &marks));
    std::fs::remove_file(&pipe)?;
    if counted.is_err() {
        child.kill()?;
    }
    let status = child.wait()?;
    let counted = counted?;
    if status.success() {
        Ok(counted)
    } else {
        bail!("the traced emulator ended with {status}: {}", said(&folder)?)
    }
}

fn said(folder: &Path) -> Result<String> {
    let mut text = String::new();
    let mut file = File::open(folder.join("output.txt"))?;
    file.rewind()?;
    file.read_to_string(&mut text)?;
    Ok(text)
}

/// The places of the marks.
struct Marks {
    begin: u32,
    end: u32,
    sample: Range<u32>,
}

fn count(trace: impl Read, program: &Program, marks: &Marks) -> Result<Vec<Stretch>> {
    let mut lines = BufReader::with_capacity(1 << 20, trace);
    let mut line = Vec::new();
    let mut counter = Counter { program, marks, found: Vec::new(), open: None, last: None };
    // What the emulator translated last; every block by where its translation is; the block that comes next.
    let mut translated: Option<Block> = None;
    let mut blocks: HashMap<u64, Block> = HashMap::new();
    let mut waiting: Option<Block> = None;
    loop {
        line.clear();
        if lines.read_until(b'\n', &mut line)? == 0 {
            break;
        }
        if let Some((place, address)) = executed(&line) {
            if let Some(block) = translated.take_if(|block| block.address == address) {
                blocks.insert(place, block);
            }
            let block = *blocks.get(&place).context("a block was executed that was not translated")?;
            if let Some(before) = waiting.replace(block) {
                counter.block(before)?;
            }
        } else if line.starts_with(STOPPED) {
            waiting = None;
        } else if line.starts_with(b"IN:") {
            translated = None;
        } else if let Some(address) = listed(&line) {
            translated.get_or_insert(Block { address, instructions: 0 }).instructions += 1;
        }
    }
    Ok(counter.found)
}

/// The beginning of a line that says: the block of the line before was not executed after all.
const STOPPED: &[u8] = b"Stopped execution of TB chain before";

/// Instructions one behind the other that the emulator executes in one go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Block {
    address: u32,
    instructions: u32,
}

/// Goes through the instructions of the blocks.
struct Counter<'a> {
    program: &'a Program,
    marks: &'a Marks,
    found: Vec<Stretch>,
    open: Option<Stretch>,
    /// The last instruction, which waits until it is known where it led.
    last: Option<(u32, Instruction)>,
}

impl Counter<'_> {
    fn block(&mut self, block: Block) -> Result<()> {
        // The marks begin blocks, as they are called.
        if self.open.is_none() && block.address != self.marks.begin {
            return Ok(());
        }
        let mut address = block.address;
        for _ in 0..block.instructions {
            let instruction = self.program.instruction(address);
            let instruction = instruction.with_context(|| format!("no instruction at {address:#x}"))?;
            self.instruction(address, instruction);
            address += instruction.size;
        }
        Ok(())
    }

    fn instruction(&mut self, address: u32, instruction: Instruction) {
        if let (Some(stretch), Some((at, last))) = (&mut self.open, self.last.take()) {
            stretch.cost.add(last, address != at + last.size);
        }
        if address == self.marks.begin {
            self.open = Some(Stretch::default());
        } else if address == self.marks.end {
            self.found.extend(self.open.take().map(|mut stretch| {
                stretch.end_sample();
                stretch
            }));
        }
        let Some(stretch) = &mut self.open else { return };
        if address == self.marks.sample.start {
            stretch.begin_sample();
        }
        if !self.marks.sample.contains(&address) {
            self.last = Some((address, instruction));
        }
    }
}

/// Returns the block in a line of the trace, `Trace 0: 0x7f… [flags/address/flags/flags] name`: where its
/// translation is, and its address.
fn executed(line: &[u8]) -> Option<(u64, u32)> {
    let text = std::str::from_utf8(line).ok()?.strip_prefix("Trace ")?;
    let (before, inside) = text.split_once('[')?;
    let place = before.trim_end().rsplit_once("0x")?.1;
    let address = inside.split('/').nth(1)?;
    Some((u64::from_str_radix(place, 16).ok()?, u32::from_str_radix(address, 16).ok()?))
}

/// Returns the address in a line of a translated block's listing:
/// `0x0000d512:  b580       push     {r7, lr}`.
fn listed(line: &[u8]) -> Option<u32> {
    let (address, _) = std::str::from_utf8(line).ok()?.strip_prefix("0x")?.split_once(':')?;
    u32::from_str_radix(address, 16).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elf::thumb::decode;

    #[test]
    fn the_sample_of_the_most_instructions_need_not_be_that_of_the_most_cycles() {
        let (divide, moves) = (decode(0, 0xee80, 0x0a81), decode(0, 0x4608, 0));
        let mut stretch = Stretch::default();
        for (instruction, count) in [(divide, 3), (moves, 5), (moves, 4)] {
            stretch.begin_sample();
            (0..count).for_each(|_| stretch.cost.add(instruction, false));
        }
        stretch.end_sample();
        assert_eq!(stretch.worst.0, 3);
        assert_eq!(stretch.most_instructions, 5);
    }

    #[test]
    fn a_block_is_read_from_its_listing_and_from_the_trace() {
        let line = b"Trace 0: 0x7fe710000240 [00800408/00000ea8/00000110/ff020200] main\n";
        assert_eq!(executed(line), Some((0x7fe7_1000_0240, 0xea8)));
        assert_eq!(listed(line), None);
        let line = b"0x0000d512:  b580       push     {r7, lr}\n";
        assert_eq!(listed(line), Some(0xd512));
        assert_eq!(executed(line), None);
    }
}
