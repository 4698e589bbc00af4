//! The linked program: its functions, their instructions, who calls whom, and how much stack that takes.
//!
//! Lives here: reading an ELF for Armv7E-M and judging it. What may not: building or running it.
//! Start with `program`, then `thumb` (the decoder), `graph` and `stack`.

pub mod graph;
pub mod program;
pub mod stack;
pub mod thumb;
