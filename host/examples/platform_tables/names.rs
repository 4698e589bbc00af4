//! Which tables `docs/platform.md` has.

/// On the command line and in the document's markers, in the document's order. Those that end in `-long` are made only
/// when named or with `--long`.
pub const TABLES: [&str; 12] = [
    "workspace",
    "poses-search",
    "poses-table-12",
    "poses-stroke",
    "poses-objectives",
    "poses-montecarlo",
    "poses-reduction",
    "poses-estimators",
    "experiment",
    "motions-compared",
    "motions-montecarlo",
    "adaptive",
];
