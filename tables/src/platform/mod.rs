//! The tables of `docs/platform.md`.
//!
//! One file per study, each a function that gives Markdown, beside the paper's figures where it has some.

mod adaptive;
mod adaptive_corners;
mod experiment;
mod hazards;
mod motions;
mod poses_estimators;
mod poses_montecarlo;
mod poses_objectives;
mod poses_reduction;
mod poses_search;
mod poses_stroke;
mod poses_table_12;
mod safety;
mod still_poses;
mod workspace;

use crate::document::{Document, Table};

/// The document and its tables, in its order.
pub const DOCUMENT: Document = Document {
    file: "docs/platform.md",
    tables: &[
        Table { name: "workspace", make: workspace::table },
        Table { name: "poses-search", make: poses_search::table },
        Table { name: "poses-table-12", make: poses_table_12::table },
        Table { name: "poses-stroke", make: poses_stroke::table },
        Table { name: "poses-objectives", make: poses_objectives::table },
        Table { name: "poses-montecarlo", make: poses_montecarlo::table },
        Table { name: "poses-reduction", make: poses_reduction::table },
        Table { name: "poses-estimators", make: poses_estimators::table },
        Table { name: "experiment", make: experiment::table },
        Table { name: "motions-compared", make: motions::comparison },
        Table { name: "motions-montecarlo", make: motions::montecarlo },
        Table { name: "two-steps-long", make: motions::two_steps },
        Table { name: "adaptive", make: adaptive::table },
        Table { name: "adaptive-corners-long", make: adaptive_corners::table },
        Table { name: "safety-long", make: safety::table },
    ],
};

/// The tables of `docs/safety.md`.
pub const SAFETY: Document = Document {
    file: "docs/safety.md",
    tables: &[
        Table { name: "stops", make: hazards::stops },
        Table { name: "hazards-long", make: hazards::table },
    ],
};
