//! Names of the tables.

/// In the order of `docs/trees.md`.
pub const TABLES: [&str; 4] = ["simulated-long", "coloured", "nearest", "staubli"];
