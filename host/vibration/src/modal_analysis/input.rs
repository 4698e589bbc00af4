//! The input, and the reasons for which there may be no result.

use nalgebra::DMatrix;

/// A recorded free decay: after the release, without any drive.
#[derive(Clone, Copy, Debug)]
pub struct FreeDecay<'a> {
    /// Samples per second; the time between samples is the same everywhere.
    pub rate_hz: f64,
    /// One row for each sample and one column for each channel, each in its own unit; an offset may be
    /// constant.
    pub samples: &'a DMatrix<f64>,
    /// Names of the channels, for what is said of them.
    pub names: &'a [&'a str],
}

/// The subject of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The number of modes that there are, if it is known: six for a platform on springs.
    pub modes: Option<usize>,
    /// The most modes that are searched for where their number is not given.
    pub most: usize,
    /// The unit of each channel when the shape is brought to unit norm, in the channel's unit; all one if it
    /// is empty.
    pub scales: Vec<f64>,
    /// Modes lie between these frequencies, Hz.
    pub band_hz: Option<[f64; 2]>,
}

impl Default for Options {
    fn default() -> Self {
        Self { modes: None, most: 8, scales: Vec::new(), band_hz: None }
    }
}

/// The reason that a decay has no modes to tell.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModalError {
    /// Names, scales, rate, band or numbers do not fit together.
    #[error("{0}")]
    Input(String),
    /// A number is missing.
    #[error(
        "channel {channel} has no finite value at {time_s:.3} s: cut the recording there, or leave the \
         channel out"
    )]
    NotFinite {
        /// The channel.
        channel: String,
        /// Time of the first one from the beginning, s.
        time_s: f64,
    },
    /// The channel stops at a limit.
    #[error(
        "channel {channel} is clipped at {limit:.6} from {time_s:.3} s on ({count} samples in all): start \
         with a smaller amplitude, or cut the beginning off"
    )]
    Clipped {
        /// The channel.
        channel: String,
        /// The limit in the channel's unit.
        limit: f64,
        /// Time of the first one from the beginning, s.
        time_s: f64,
        /// Samples at the limit.
        count: usize,
    },
    /// The channel keeps its value while others move.
    #[error(
        "channel {channel} keeps the value {value:.6} for {duration_s:.3} s from {time_s:.3} s on: the \
         sensor or its line stopped; leave the channel out, or cut the recording there"
    )]
    Frozen {
        /// The channel.
        channel: String,
        /// The value, in the channel's unit.
        value: f64,
        /// Time from the beginning, s.
        time_s: f64,
        /// The duration, s.
        duration_s: f64,
    },
    /// The channel repeats its values.
    #[error(
        "channel {channel} repeats each value {times} times: give the recording at the sensor's own rate, \
         {rate_hz:.1} Hz"
    )]
    Repeated {
        /// The channel.
        channel: String,
        /// The number of times.
        times: usize,
        /// The rate of its own values, Hz.
        rate_hz: f64,
    },
    /// There are too few samples.
    #[error("{samples} samples are too few for {channels} channels: record at least {least}")]
    TooFew {
        /// Samples given.
        samples: usize,
        /// Channels given.
        channels: usize,
        /// Samples needed.
        least: usize,
    },
    /// The slowest motion does not come round often enough.
    #[error(
        "{duration_s:.2} s are {cycles:.2} cycles of the only vibration, {hz:.3} Hz: at least {least} are \
         needed; record {needed_s:.1} s or more"
    )]
    TooShort {
        /// The length of the recording, s.
        duration_s: f64,
        /// The frequency of the mode, Hz.
        hz: f64,
        /// The cycles of the mode in the recording.
        cycles: f64,
        /// Cycles needed.
        least: f64,
        /// Length needed, s.
        needed_s: f64,
    },
    /// No vibration is larger than noise.
    #[error(
        "nothing vibrates: no line of the spectrum is larger than the noise around it (the strongest, at \
         {hz:.3} Hz, has {ratio:.1} times its power); release the platform from a larger deflection, or \
         record from the release on"
    )]
    NothingVibrates {
        /// The strongest frequency, Hz.
        hz: f64,
        /// The ratio of its power to that of the noise.
        ratio: f64,
    },
    /// The fit did not end.
    #[error("the fit of {modes} modes did not converge: {reason}")]
    Fit {
        /// Modes tried.
        modes: usize,
        /// Why.
        reason: String,
    },
}

impl FreeDecay<'_> {
    /// Returns the length, s.
    pub fn duration_s(&self) -> f64 {
        self.samples.nrows() as f64 / self.rate_hz
    }

    /// Returns a channel's name.
    pub(super) fn name(&self, channel: usize) -> String {
        self.names.get(channel).map_or_else(|| format!("{channel}"), |name| (*name).to_owned())
    }
}
