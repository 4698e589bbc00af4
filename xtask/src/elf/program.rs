//! Functions and memory of a linked program, read from its symbols, its mapping symbols and its segments.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use object::{
    Object, ObjectSection, ObjectSegment, ObjectSymbol, SectionFlags, SectionKind, SymbolKind, elf,
};

use super::thumb::{self, Instruction};

/// A function, by its address range.
#[derive(Clone, Debug)]
pub struct Function {
    /// Demangled, without the hash; for a shared address the first name in the alphabet.
    pub name: String,
    /// Every symbol at this address, as the linker has it.
    pub symbols: Vec<String>,
    pub range: Range<u32>,
}

/// Sizes of what the program occupies, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// Everything that is programmed, initial values of variables included.
    pub flash: u64,
    /// Static variables, stack not included.
    pub ram: u64,
}

/// A linked program.
pub struct Program {
    pub path: PathBuf,
    pub functions: Vec<Function>,
    pub memory: Memory,
    /// The exception vectors: the initial stack pointer, Reset, then one handler each.
    pub vectors: Range<u32>,
    /// Address of every symbol that is defined.
    pub symbols: BTreeMap<String, u32>,
    segments: Vec<(u32, Vec<u8>)>,
    /// Addresses at which literal pools begin and end: `true` where data begin.
    marks: BTreeMap<u32, bool>,
}

impl Program {
    /// Reads an ELF with its symbols.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        Self::parse(path, &bytes).with_context(|| format!("{} is no program for the target", path.display()))
    }

    fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let file = object::File::parse(bytes)?;
        if file.architecture() != object::Architecture::Arm {
            bail!("it is for {:?}", file.architecture());
        }
        let mut code = Vec::new();
        let mut memory = Memory { flash: 0, ram: 0 };
        let mut vectors = 0..0;
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags, .. } = section.flags() else { continue };
            if !sh_flags.contains(elf::SHF_ALLOC) {
                continue;
            }
            let range = section.address() as u32..(section.address() + section.size()) as u32;
            if section.name() == Ok(".vector_table") {
                vectors = range.clone();
            }
            let empty = matches!(section.kind(), SectionKind::UninitializedData);
            if !empty {
                memory.flash += section.size();
            }
            if sh_flags.contains(elf::SHF_WRITE) {
                memory.ram += section.size();
            }
            if sh_flags.contains(elf::SHF_EXECINSTR) {
                code.push(range);
            }
        }
        let mut symbols = BTreeMap::new();
        let mut marks = BTreeMap::new();
        let mut starts: BTreeMap<u32, (u32, Vec<String>)> = BTreeMap::new();
        for symbol in file.symbols() {
            let (Ok(name), address) = (symbol.name(), symbol.address() as u32) else { continue };
            if name.starts_with("$t") || name.starts_with("$d") {
                marks.insert(address, name.starts_with("$d"));
            } else if !symbol.is_undefined() && !name.is_empty() {
                symbols.insert(name.to_owned(), address);
                let start = address & !1;
                if symbol.kind() == SymbolKind::Text && code.iter().any(|range| range.contains(&start)) {
                    let entry = starts.entry(start).or_default();
                    entry.0 = entry.0.max(symbol.size() as u32);
                    entry.1.push(name.to_owned());
                }
            }
        }
        let functions = functions(&starts, &code);
        if functions.is_empty() {
            bail!("it has no symbols");
        }
        let segments = file
            .segments()
            .map(|segment| Ok((segment.address() as u32, segment.data()?.to_vec())))
            .collect::<Result<_>>()?;
        Ok(Self { path: path.to_owned(), functions, memory, vectors, symbols, segments, marks })
    }

    /// Returns the function that holds an address.
    pub fn function_at(&self, address: u32) -> Option<usize> {
        let after = self.functions.partition_point(|function| function.range.start <= address);
        let index = after.checked_sub(1)?;
        self.functions[index].range.contains(&address).then_some(index)
    }

    /// Returns the function of that linker symbol.
    pub fn function_of_symbol(&self, symbol: &str) -> Option<usize> {
        self.symbols.get(symbol).and_then(|&address| self.function_at(address & !1))
    }

    /// Returns the instruction at an address.
    pub fn instruction(&self, address: u32) -> Option<Instruction> {
        let first = self.halfword(address)?;
        Some(thumb::decode(address, first, self.halfword(address + 2).unwrap_or(0)))
    }

    /// Returns a function's instructions in order of address, literal pools left out.
    pub fn instructions(&self, function: &Function) -> Vec<(u32, Instruction)> {
        let mut found = Vec::new();
        let mut address = function.range.start;
        while address < function.range.end {
            if let Some(end) = self.data_until(address) {
                address = end.min(function.range.end);
                continue;
            }
            let Some(instruction) = self.instruction(address) else { break };
            found.push((address, instruction));
            address += instruction.size;
        }
        found
    }

    /// Returns a word of the program's memory.
    pub fn word(&self, address: u32) -> Option<u32> {
        Some(u32::from(self.halfword(address)?) | u32::from(self.halfword(address + 2)?) << 16)
    }

    fn halfword(&self, address: u32) -> Option<u16> {
        self.segments.iter().find_map(|(begin, bytes)| {
            let at = address.checked_sub(*begin)? as usize;
            Some(u16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]))
        })
    }

    /// Returns where the data end that hold this address; `None` where there is code.
    fn data_until(&self, address: u32) -> Option<u32> {
        let (_, is_data) = self.marks.range(..=address).next_back()?;
        is_data.then(|| {
            self.marks.range(address + 1..).find(|(_, data)| !**data).map_or(u32::MAX, |(&at, _)| at)
        })
    }
}

fn functions(starts: &BTreeMap<u32, (u32, Vec<String>)>, code: &[Range<u32>]) -> Vec<Function> {
    let mut found = Vec::new();
    for (&start, (size, names)) in starts {
        let section_end = code.iter().find(|range| range.contains(&start)).map_or(start, |range| range.end);
        let next = starts.range(start + 1..).next().map_or(section_end, |(&next, _)| next.min(section_end));
        // Assembly may leave the size out.
        let end = if *size == 0 { next } else { start + size };
        let mut names = names.clone();
        names.sort();
        let name = names.first().map_or_else(String::new, |name| readable(name));
        found.push(Function { name, symbols: names, range: start..end });
    }
    found
}

/// Returns a symbol demangled, without its hash.
pub fn readable(symbol: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(symbol))
}
