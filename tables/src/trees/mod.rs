//! The tables of `docs/trees.md` and of `docs/joint-offsets.md`.
//!
//! One file per study, each a function that gives Markdown.

mod errors;
mod joint_offsets;
mod masses;
mod model_check;
mod predict;
mod signal_noise;
mod simulated;
mod staubli;
mod watch;

use crate::document::{Document, Table};

/// The document and its tables, in its order.
pub const DOCUMENT: Document = Document {
    file: "docs/trees.md",
    tables: &[
        Table { name: "signal-noise-long", make: signal_noise::table },
        Table { name: "simulated-long", make: simulated::table },
        Table { name: "coloured", make: simulated::coloured_table },
        Table { name: "tree-errors-long", make: errors::table },
        Table { name: "nearest", make: simulated::nearest_table },
        Table { name: "model-check-long", make: model_check::table },
        Table { name: "staubli", make: staubli::table },
        Table { name: "predict", make: predict::table },
    ],
};

/// The document of mass properties.
pub const MASSES: Document = Document {
    file: "docs/masses.md",
    tables: &[
        Table { name: "masses-long", make: masses::table },
        Table { name: "watch-long", make: watch::table },
    ],
};

/// The document of joint offsets.
pub const JOINT_OFFSETS: Document = Document {
    file: "docs/joint-offsets.md",
    tables: &[
        Table { name: "joint-refusals-long", make: joint_offsets::refusals },
        Table { name: "joint-offsets-long", make: joint_offsets::table },
    ],
};
