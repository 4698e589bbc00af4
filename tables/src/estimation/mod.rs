//! The tables of `docs/estimation.md`, `docs/calibration.md` and `docs/diagnosis.md`.
//!
//! One file per study, each a function that gives Markdown and draws everything from fixed seeds; [`problem`]
//! and
//! [`mod@reference`] are what they share. The covariance forms in [`covariance_forms`] exist only to show how
//! they fail.

mod change;
mod coloured_noise;
mod covariance_forms;
mod estimators;
mod f32_accuracy;
mod faults;
mod few_poses;
mod filter_response;
mod honest_covariance;
mod merging;
mod montecarlo;
mod problem;
mod reference;
mod report;
mod rig_errors;
mod signal_noise;

pub use problem::Normal;

use crate::document::{Document, Table};

/// The document and its tables, in its order.
pub const DOCUMENT: Document = Document {
    file: "docs/estimation.md",
    tables: &[
        Table { name: "filter-response", make: filter_response::table },
        Table { name: "f32-accuracy", make: f32_accuracy::table },
        Table { name: "f32-accuracy-long", make: f32_accuracy::long_table },
        Table { name: "covariance-forms", make: covariance_forms::table },
        Table { name: "honest-covariance", make: honest_covariance::table },
        Table { name: "few-poses-long", make: few_poses::table },
        Table { name: "coloured-noise", make: coloured_noise::table },
        Table { name: "montecarlo", make: montecarlo::table },
        Table { name: "noise-sweep-long", make: signal_noise::table },
        Table { name: "noise-sweep-1khz-long", make: signal_noise::fast_table },
        Table { name: "estimators-long", make: estimators::table },
        Table { name: "rig-errors-long", make: rig_errors::table },
        Table { name: "rig-errors-all-long", make: rig_errors::all_table },
        Table { name: "change", make: change::table },
        Table { name: "not-rigid", make: change::not_rigid_table },
        Table { name: "merging-long", make: merging::table },
        Table { name: "merging-hundred-long", make: merging::hundred_table },
        Table { name: "merging-unlike-long", make: merging::unlike_table },
        Table { name: "merging-tare-long", make: merging::tare_table },
        Table { name: "merging-machines-long", make: merging::machines_table },
    ],
};

/// The document of the reference body and its table.
pub const CALIBRATION: Document = Document {
    file: "docs/calibration.md",
    tables: &[Table { name: "calibration-long", make: rig_errors::calibration_table }],
};

/// The document of recordings that cannot be true and its tables.
pub const DIAGNOSIS: Document = Document {
    file: "docs/diagnosis.md",
    tables: &[
        Table { name: "faults-body-long", make: faults::body_table },
        Table { name: "faults-published-long", make: faults::published_table },
        Table { name: "faults-tree-long", make: faults::tree_table },
        Table { name: "honest-long", make: faults::honest_table },
        Table { name: "honest-noise-long", make: faults::noise_table },
    ],
};
