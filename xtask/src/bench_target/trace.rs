//! Executed instructions, from the emulator's own trace through a named pipe.

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
/// It calls this one at the beginning of each sample. Its own instructions are not counted.
const SAMPLE: &str = "bench_sample";

/// A stretch between the two marks.
#[derive(Clone, Debug, Default)]
pub struct Stretch {
    /// All of it.
    pub cost: Cost,
    /// Instructions and estimated cycles of the sample that took the most cycles.
    pub worst: (u64, u64),
    /// Instructions and cycles when the sample began that is being counted.
    begun: Option<(u64, u64)>,
}

impl Stretch {
    fn so_far(&self) -> (u64, u64) {
        (self.cost.instructions(), self.cost.cycles)
    }

    fn end_sample(&mut self) {
        let (instructions, cycles) = self.so_far();
        if let Some((i, c)) = self.begun.take()
            && cycles - c > self.worst.1
        {
            self.worst = (instructions - i, cycles - c);
        }
    }

    fn begin_sample(&mut self) {
        self.end_sample();
        self.begun = Some(self.so_far());
    }
}

/// What each stretch between the two marks cost, in the order they ran.
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
        .args(["-singlestep", "-d", "exec,nochain", "-D"])
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

/// Where the marks are.
struct Marks {
    begin: u32,
    end: u32,
    sample: Range<u32>,
}

fn count(trace: impl Read, program: &Program, marks: &Marks) -> Result<Vec<Stretch>> {
    let mut lines = BufReader::with_capacity(1 << 20, trace);
    let mut line = Vec::new();
    let mut found = Vec::new();
    let mut open: Option<Stretch> = None;
    let mut waiting: Option<(u32, Instruction)> = None;
    loop {
        line.clear();
        if lines.read_until(b'\n', &mut line)? == 0 {
            break;
        }
        let Some(address) = executed(&line) else { continue };
        if let (Some(stretch), Some((at, instruction))) = (&mut open, waiting.take()) {
            stretch.cost.add(instruction, address != at + instruction.size);
        }
        if address == marks.begin {
            open = Some(Stretch::default());
        } else if address == marks.end {
            found.extend(open.take().map(|mut stretch| {
                stretch.end_sample();
                stretch
            }));
        }
        let Some(stretch) = &mut open else { continue };
        if address == marks.sample.start {
            stretch.begin_sample();
        }
        if !marks.sample.contains(&address) {
            let instruction = program.instruction(address);
            let instruction = instruction.with_context(|| format!("no instruction at {address:#x}"))?;
            waiting = Some((address, instruction));
        }
    }
    Ok(found)
}

/// The address in a line of the trace: `Trace 0: 0x7f… [flags/address/flags/flags] name`.
fn executed(line: &[u8]) -> Option<u32> {
    let text = std::str::from_utf8(line).ok()?.strip_prefix("Trace ")?;
    let (_, inside) = text.split_once('[')?;
    u32::from_str_radix(inside.split('/').nth(1)?, 16).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_address_is_read_from_a_trace_line() {
        let line = b"Trace 0: 0x7fe710000240 [00800408/00000ea8/00000110/ff020201] main\n";
        assert_eq!(executed(line), Some(0xea8));
        assert_eq!(executed(b"anything else\n"), None);
    }
}
