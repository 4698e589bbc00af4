//! Everything that is said: on standard output and standard error, progress, failures, words for reasons.

#[macro_use]
pub(crate) mod tell;

#[cfg(not(target_family = "wasm"))]
pub(crate) mod confirm;
pub(crate) mod failure;
pub(crate) mod outcome;
pub(crate) mod progress;
pub(crate) mod question;
pub(crate) mod terms;
pub(crate) mod worded;
