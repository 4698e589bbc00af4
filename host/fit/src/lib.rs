//! The information factor on the host, and the fit that fills it.
//!
//! Every method ends in rows `A φ = y ± σ` ([`RowSource`]). Rows are filtered to blocks ([`RowBlocks`]) and
//! absorbed into a [`Factor`] by [`fit()`]; every question is a function of the factor. This crate knows
//! nothing of files, bodies or screens.

pub mod autocorrelation;
mod blocked;
mod checks;
mod compensation;
pub mod condition;
mod convergence;
pub mod difference;
mod engine;
mod estimate;
#[cfg(test)]
mod examples;
pub mod explained;
mod factor;
pub mod factor_file;
mod features;
pub mod figures;
mod fingerprint;
mod forgetting;
mod gaussian;
pub mod groups;
mod jacobi;
pub mod lack_of_fit;
mod larger_errors;
mod left_of_rows;
mod linearised;
mod made_blocks;
pub mod motion_selection;
mod noise_check;
mod nuisance;
mod options;
mod other_columns;
pub mod outliers;
mod own_errors;
pub mod parallel;
mod parameter;
pub mod payload;
pub mod pool;
mod prediction;
pub mod prior;
mod progress;
mod reduction;
mod repetition;
mod residual_spectrum;
mod residuals;
mod result;
mod rig_rows;
mod sandwich;
mod shifts;
mod signal_noise;
mod source;
mod standard;
pub mod tare;
mod variance_components;
mod weighing;
mod whitening;

pub use checks::{CheckedRun, Checks};
pub use compensation::{NoiseGram, compensate};
pub use condition::{
    ESTIMATOR_TAPS, FILTER_WIDTH_S, Filter, RowBlocks, SampleCounts, filter_width_s, row_every,
};
pub use engine::{LEAST_EXCITATION, device_estimate, fit, fit_device};
pub use estimate::{COVERAGE_95, Estimate, Measured, Noise, Unjudged};
pub use factor::{Factor, Solution};
pub use fingerprint::{Fingerprint, Identity, READINGS_KEPT};
pub use gaussian::Gaussian;
pub use larger_errors::{ErrorScores, Larger};
pub use noise_check::{Judgement, RowSet, StatedNoise, judge};
pub use nuisance::{
    Agreement, Basis, CONTRADICTED, Effect, ErrorRow, FRICTION, Nuisance, NuisanceFit, Scope, contradict,
};
pub use options::{DeviceFactor, FitError, FitOptions};
pub use other_columns::OtherColumns;
pub use parameter::{Channel, DriveMotion, Kind, Owner, Parameter};
pub use prediction::{
    PredictedBlock, Prediction, plain_factor, plain_factors, plain_least_squares, plain_noise_gram,
};
pub use progress::{Progress, Silent};
pub use result::{
    Autocorrelation, BlockResidual, ChannelFit, Convergence, Counts, Fit, Forgotten, NoiseCheck, Prior,
    PriorStatement, SignalFit,
};
pub use rig_rows::{RigError, RigRows};
pub use source::{RowSource, SampleRows, SignalNoise, Timing};
pub use whitening::{Whitener, Whitening};

#[cfg(test)]
extern crate self as rigident_fit;
#[cfg(test)]
#[path = "../../cli/tests/integration/study_length.rs"]
mod study_length;
