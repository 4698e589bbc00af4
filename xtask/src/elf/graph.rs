//! The call graph, read from the instructions.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::program::Program;
use super::thumb::Flow;

/// The ways control leaves a function.
#[derive(Clone, Debug, Default)]
pub struct Exits {
    /// Functions called or jumped to.
    pub to: BTreeSet<usize>,
    /// Addresses of calls through a register whose value is not known.
    pub unknown: Vec<u32>,
    /// Addresses of the compiler's aborts.
    pub traps: Vec<u32>,
}

/// The call graph of a program: one entry for each of its functions.
pub struct Graph {
    pub exits: Vec<Exits>,
}

impl Graph {
    /// Reads every function's instructions.
    pub fn new(program: &Program) -> Self {
        let exits = (0..program.functions.len()).map(|index| exits(program, index)).collect();
        Self { exits }
    }

    /// Returns all functions that can run once `from` is called, each with the function it was first reached
    /// through. Functions that `is_end` marks are reached, but not followed.
    pub fn reachable(&self, from: usize, is_end: impl Fn(usize) -> bool) -> BTreeMap<usize, Option<usize>> {
        let mut reached = BTreeMap::from([(from, None)]);
        let mut waiting = VecDeque::from([from]);
        while let Some(function) = waiting.pop_front() {
            if is_end(function) {
                continue;
            }
            for &next in &self.exits[function].to {
                reached.entry(next).or_insert_with(|| {
                    waiting.push_back(next);
                    Some(function)
                });
            }
        }
        reached
    }
}

/// Returns the way into `to` as names, outermost first.
pub fn path(program: &Program, reached: &BTreeMap<usize, Option<usize>>, to: usize) -> String {
    let mut names = vec![program.functions[to].name.clone()];
    let mut at = to;
    while let Some(Some(from)) = reached.get(&at) {
        names.push(program.functions[*from].name.clone());
        at = *from;
    }
    names.reverse();
    names.join(" → ")
}

fn exits(program: &Program, index: usize) -> Exits {
    let function = &program.functions[index];
    let mut exits = Exits::default();
    let reach = |exits: &mut Exits, at: u32, to: u32| match program.function_at(to & !1) {
        Some(target) if target == index && to & !1 != function.range.start => {}
        Some(target) => {
            exits.to.insert(target);
        }
        None => exits.unknown.push(at),
    };
    let instructions = program.instructions(function);
    for (k, (address, instruction)) in instructions.iter().enumerate() {
        let address = *address;
        // The compiler's table of far jumps: what follows are nothing else, and they are read like all
        // others.
        let is_table = || {
            let mut next = instructions.iter().skip(k + 1).map(|(_, next)| next);
            let inside =
                |flow| matches!(flow, Flow::Jump { to, conditional: false } if function.range.contains(&to));
            next.by_ref().take(2).filter(|next| next.size == 4 && inside(next.flow)).count() == 2
        };
        match instruction.flow {
            Flow::MoveToCounter(_) if is_table() => {}
            Flow::MoveToCounter(_) => exits.unknown.push(address),
            Flow::Next | Flow::Table | Flow::Return => {}
            Flow::Trap => exits.traps.push(address),
            Flow::Jump { to, .. } if function.range.contains(&to) => {}
            Flow::Jump { to, .. } | Flow::Call { to } => reach(&mut exits, address, to),
            Flow::CallRegister(_) | Flow::JumpRegister(_) => exits.unknown.push(address),
        }
    }
    exits
}
