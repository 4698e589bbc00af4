//! Copies and clears memory by several words at a time.
//!
//! The compiler calls these functions by their names. Those of `compiler_builtins` take two and a half
//! instructions a word; these take one.

// SAFETY of what is in there: these functions keep to the run-time ABI's contract of their names, and to the
// core's calling convention: they read and write the bytes that they are given and no others.
core::arch::global_asm!(include_str!("memory_armv7em.s"), options(raw));
