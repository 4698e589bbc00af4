//! Which tables `docs/estimation.md` has.

/// On the command line and in the document's markers, in the document's order. Those that end in `-long` are made only
/// when named or with `--long`.
pub const TABLES: [&str; 7] = [
    "filter-response",
    "f32-accuracy",
    "f32-accuracy-long",
    "covariance-forms",
    "honest-covariance",
    "coloured-noise",
    "montecarlo",
];
