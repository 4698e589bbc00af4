//! Names of the tables.

/// In the order of `docs/trees.md`.
pub const TABLES: [&str; 3] = ["simulated-long", "nearest", "staubli"];
