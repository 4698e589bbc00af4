//! Worst stack by the call graph: the deepest sum of frames, from what each function's instructions push.
//!
//! A bound, not an estimate: every push of a function counts, whichever branch it is on, and a jump out of a
//! function counts as a call. Panics are left out: they are entered once and do not come back.

use anyhow::{Result, bail};

use super::graph::Graph;
use super::program::Program;

/// The deepest way down from a function.
#[derive(Clone, Debug, Default)]
pub struct Depth {
    pub bytes: u32,
    /// Functions on the way, outermost first, with their frames.
    pub way: Vec<(String, u32)>,
}

/// Returns the bytes that a function's own instructions push.
pub fn frame(program: &Program, function: usize) -> u32 {
    program.instructions(&program.functions[function]).iter().map(|(_, instruction)| instruction.pushed).sum()
}

/// Returns the worst stack from `root` down, `is_end` marking functions that are not entered.
///
/// # Errors
/// Recursion, or a call whose target is not known: no bound can be given then.
pub fn worst(program: &Program, graph: &Graph, root: usize, is_end: &dyn Fn(usize) -> bool) -> Result<Depth> {
    let mut known: Vec<Option<Depth>> = vec![None; program.functions.len()];
    descend(program, graph, root, is_end, &mut Vec::new(), &mut known)
}

fn descend(
    program: &Program,
    graph: &Graph,
    at: usize,
    is_end: &dyn Fn(usize) -> bool,
    above: &mut Vec<usize>,
    known: &mut Vec<Option<Depth>>,
) -> Result<Depth> {
    if let Some(depth) = &known[at] {
        return Ok(depth.clone());
    }
    let name = &program.functions[at].name;
    if above.contains(&at) {
        bail!("{name} calls itself: its stack has no bound");
    }
    if let Some(address) = graph.exits[at].unknown.first() {
        bail!("{name} calls through a register at {address:#x}: its stack has no bound");
    }
    above.push(at);
    let mut deepest = Depth::default();
    for &next in graph.exits[at].to.iter().filter(|&&next| !is_end(next)) {
        let depth = descend(program, graph, next, is_end, above, known)?;
        if depth.bytes > deepest.bytes {
            deepest = depth;
        }
    }
    above.pop();
    let own = frame(program, at);
    deepest.bytes += own;
    deepest.way.insert(0, (name.clone(), own));
    known[at] = Some(deepest.clone());
    Ok(deepest)
}
