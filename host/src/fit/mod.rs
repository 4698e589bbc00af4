//! The information factor on the host, and the fit that fills it.
//!
//! Every method ends in rows `A φ = y ± σ` ([`RowSource`]). Rows are absorbed into a [`Factor`]; every question is a
//! function of the factor. This room knows nothing of files, bodies or screens.

mod estimate;
#[cfg(test)]
mod examples;
mod factor;
pub mod factor_file;
mod fingerprint;
mod noise_check;
mod parameter;
pub mod pool;
pub mod prior;
mod result;
mod source;
mod standard;
pub mod tare;

pub use estimate::{COVERAGE_95, Estimate, Measured, Noise};
pub use factor::{Factor, Solution};
pub use fingerprint::Fingerprint;
pub use noise_check::{Judgement, RowSet, judge};
pub use parameter::{Channel, Kind, Owner, Parameter};
pub use result::{
    Autocorrelation, BlockResidual, ChannelFit, Convergence, Counts, Fit, Forgotten, NoiseCheck, Prior,
    PriorStatement,
};
pub use source::{RowSource, SampleRows, Timing};
