//! The options of a fit, and the reasons why there may be none.

use nalgebra::DMatrix;
use rigident_shared::conditioning::KernelError;
use rigident_shared::forgetting::Span;

use super::Factor;

/// Settings of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FitOptions {
    /// Forgets older rows with a time constant, or keeps a window; `None`: all rows count.
    pub forgetting: Option<Span<f64>>,
    /// Estimates on the way to the result, about; zero: none.
    pub convergence_points: usize,
    /// True if it is only asked whether the recording can be true: where errors of the rig contradict what is
    /// known of them, no lack of fit is looked for.
    pub verdict_alone: bool,
}

/// The reason that there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Nothing was left to absorb.
    #[error(
        "no usable rows: of {samples} samples {rejected} were rejected, and no stretch of the rest without a \
         gap is as long as the filter of {width_s} s"
    )]
    NoRows {
        /// Samples given.
        samples: u64,
        /// Samples rejected.
        rejected: u64,
        /// Width of the filter, s.
        width_s: f64,
    },
    /// The filter does not fit the rate.
    #[error("at {rate_hz} samples per second there is no filter of {width_s} s: {}", match error {
        KernelError::Invalid => "that is less than three of them; record faster".to_owned(),
        KernelError::TooManyTaps(taps) =>
            format!("that is {taps} of them, more than it has room for; take every second one"),
    })]
    Filter {
        /// Samples per second.
        rate_hz: f64,
        /// Width of the filter, s.
        width_s: f64,
        /// The kernel's error.
        error: KernelError,
    },
    /// A σ is not positive and finite.
    #[error(
        "the noise of channel {channel}, 1 σ = {sigma}, is no positive number: check noise_n_nm in the rig \
         file"
    )]
    Sigma {
        /// Name of the channel.
        channel: String,
        /// The σ.
        sigma: f64,
    },
    /// The span of forgetting does not fit the rows.
    #[error(
        "a time constant or window of {span_s} s cannot be kept: it must be a positive number, longer than \
         the filter of {width_s} s, and still poses have no time to forget by"
    )]
    Forgetting {
        /// The time constant or window, s.
        span_s: f64,
        /// Width of the filter, s.
        width_s: f64,
    },
    /// A device's factor has other parameters.
    #[error("the device's factor has {device} parameters, the model {model}: was it set to another one?")]
    Device {
        /// Parameters of the factor.
        device: usize,
        /// Parameters of the source.
        model: usize,
    },
    /// Parameters or gain errors are not those of the source.
    #[error("{given} numbers for {wanted} columns: were they found in a recording of the same model?")]
    Columns {
        /// Numbers given.
        given: usize,
        /// Columns of the source, or its channels.
        wanted: usize,
    },
}

/// A factor that a device made of the samples of a source.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceFactor {
    /// The factor, columns in the order of the source's parameters, whitened by the σ of the source's
    /// channels.
    pub factor: Factor,
    /// The addition of the noise of the signals to it, N × N; `None`: the device counts none.
    pub gram: Option<DMatrix<f64>>,
}
