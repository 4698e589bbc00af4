//! A static model of Cortex-M4 cycles, applied to the instructions that were executed.
//!
//! Source: Cortex-M4 Technical Reference Manual r0p1, tables 3-1 and 7-1. Memory without wait states.

use std::collections::BTreeMap;

use crate::elf::thumb::{Class, Flow, Instruction};

/// The model in words, printed with every figure it gives.
pub const MODEL: &str = "an estimate, no measurement. One cycle for an integer or float operation; VMLA and \
VFMA 3, VDIV and VSQRT 14, integer division 12; a load 2 and a store 1, but a load right after a load or \
store 1; several words 1 + words; a taken branch 3 (pipeline refill of 2), one not taken 1; a float result \
used by the next instruction 1 more. Memory without wait states.";

/// Kinds in the order they are printed.
pub const KINDS: [&str; 12] = [
    "integer",
    "integer division",
    "load",
    "store",
    "several words",
    "float add, multiply, compare, move",
    "float multiply-accumulate",
    "float division",
    "float square root",
    "float to or from integer register",
    "branch, taken or not",
    "other",
];

/// The cost of a stretch of execution.
#[derive(Clone, Debug, Default)]
pub struct Cost {
    counts: BTreeMap<&'static str, u64>,
    /// Estimated cycles.
    pub cycles: u64,
    last: Option<Instruction>,
}

impl Cost {
    /// Adds an executed instruction; `jumped` says that the next one is not the one behind it.
    pub fn add(&mut self, instruction: Instruction, jumped: bool) {
        *self.counts.entry(kind(instruction.class)).or_default() += 1;
        self.cycles += self.stall(&instruction) + own_cycles(&instruction, self.last.as_ref(), jumped);
        self.last = Some(instruction);
    }

    /// Returns how many of a kind were executed.
    pub fn count(&self, kind: &str) -> u64 {
        self.counts.get(kind).copied().unwrap_or(0)
    }

    /// Returns how many were executed.
    pub fn instructions(&self) -> u64 {
        self.counts.values().sum()
    }

    /// Returns the cycles by which an instruction stalls: a float result that the very next instruction uses
    /// is a cycle late.
    fn stall(&self, next: &Instruction) -> u64 {
        let made = self.last.and_then(|last| last.float).map(|registers| registers.to);
        let used = next.float.map_or([crate::elf::thumb::NONE; 3], |registers| registers.from);
        u64::from(made.is_some_and(|register| used.contains(&register)))
    }
}

fn kind(class: Class) -> &'static str {
    match class {
        Class::Integer => KINDS[0],
        Class::IntegerDivide => KINDS[1],
        Class::Load | Class::FloatLoad => KINDS[2],
        Class::Store | Class::FloatStore => KINDS[3],
        Class::LoadMany(_) | Class::StoreMany(_) => KINDS[4],
        Class::Float => KINDS[5],
        Class::FloatMultiplyAccumulate => KINDS[6],
        Class::FloatDivide => KINDS[7],
        Class::FloatRoot => KINDS[8],
        Class::FloatMove => KINDS[9],
        Class::Branch => KINDS[10],
        Class::System => KINDS[11],
    }
}

fn own_cycles(instruction: &Instruction, last: Option<&Instruction>, jumped: bool) -> u64 {
    const REFILL: u64 = 2;
    let is_single =
        |class| matches!(class, Class::Load | Class::Store | Class::FloatLoad | Class::FloatStore);
    let pipelined = last.is_some_and(|last| is_single(last.class));
    let base = match instruction.class {
        Class::Load | Class::FloatLoad => 2 - u64::from(pipelined),
        Class::LoadMany(words) | Class::StoreMany(words) => 1 + u64::from(words),
        Class::IntegerDivide => 12,
        Class::FloatMultiplyAccumulate => 3,
        Class::FloatDivide | Class::FloatRoot => 14,
        Class::Branch if instruction.flow == Flow::Table => 2,
        _ => 1,
    };
    let leaves = instruction.flow != Flow::Next && jumped;
    base + if leaves { REFILL } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elf::thumb::decode;

    fn cost(words: &[(u16, u16)]) -> Cost {
        let mut cost = Cost::default();
        for &(first, second) in words {
            cost.add(decode(0, first, second), false);
        }
        cost
    }

    #[test]
    fn consecutive_loads_are_pipelined() {
        // ldr r0, [r1]; ldr r2, [r3]: 2 + 1.
        assert_eq!(cost(&[(0x6808, 0), (0x681a, 0)]).cycles, 3);
    }

    #[test]
    fn a_float_result_used_at_once_costs_a_cycle_more() {
        let add = (0xee30, 0x0a81); // vadd.f32 s0, s1, s2
        let uses = (0xee20, 0x1a20); // vmul.f32 s2, s0, s1
        let other = (0xee21, 0x1aa1); // vmul.f32 s2, s3, s3
        assert_eq!(cost(&[add, uses]).cycles, 3);
        assert_eq!(cost(&[add, other]).cycles, 2);
    }

    #[test]
    fn division_and_root_take_fourteen() {
        assert_eq!(cost(&[(0xee80, 0x0a81)]).cycles, 14);
        assert_eq!(cost(&[(0xeeb1, 0x0ac0)]).cycles, 14);
    }
}
