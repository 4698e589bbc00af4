//! The findings about a decay beside its modes.

/// A relative change of frequency up to which it is counted in the intervals: 1 % of stiffness.
const COUNTED: f64 = 5e-3;

/// The weight of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The numbers hold; this is to be known.
    Warning,
    /// The modes are not all there, or not those of a linear system: do not go on with them.
    Error,
}

/// Something that was noticed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Finding {
    /// A mode has few cycles, or too few to be distinguished from a drift.
    #[error(
        "the mode at {hz:.3} Hz has {cycles:.1} cycles in the recording{}: record {needed_s:.0} s or more",
        if *is_refused { ", too few to tell it from a drift, and is left out" } else { "" }
    )]
    FewCycles {
        /// The mode's frequency, Hz.
        hz: f64,
        /// Cycles in the recording.
        cycles: f64,
        /// Length for enough cycles, s.
        needed_s: f64,
        /// True if the mode is left out.
        is_refused: bool,
    },
    /// Fewer modes than there are.
    #[error(
        "missing mode: {found} of {wanted} modes were found; none of them moves in the direction \
         {direction}, most of it in {channel}: release the platform with a deflection there, nearer to where \
         the missing mode moves"
    )]
    MissingModes {
        /// Modes that there are.
        wanted: usize,
        /// Modes found, those included that cannot be distinguished.
        found: usize,
        /// The unit vector over scaled channels that the found shapes reach least, in words.
        direction: String,
        /// The unit vector of `direction` in numbers.
        vector: Vec<f64>,
        /// The largest channel of that vector.
        channel: String,
    },
    /// Two modes whose shapes span a plane and are not known one by one; both are left out.
    #[error(
        "two modes too close: {:.4} and {:.4} Hz differ by {distance:.1} standard deviations where \
         {least:.0} are needed, and by {:.4} Hz where the recording resolves {resolution_hz:.4} Hz; both are \
         left out: record longer, damp less, or shift a mass so that their frequencies part",
        hz[0], hz[1], (hz[1] - hz[0]).abs()
    )]
    TooClose {
        /// The frequencies of both, Hz.
        hz: [f64; 2],
        /// Difference of poles by its covariance.
        distance: f64,
        /// The least distance at which modes are given.
        least: f64,
        /// The resolution of the length and the decay, Hz.
        resolution_hz: f64,
        /// Two orthonormal directions over scaled channels that their amplitudes span.
        plane: [Vec<f64>; 2],
    },
    /// A vibration that decays and is none of the modes asked for.
    #[error(
        "a further line at {hz:.3} Hz, {ratio:.1} times the noise, strongest in {channel}: a mode that was \
         not asked for, or a disturbance from outside"
    )]
    OtherLine {
        /// The line's frequency, Hz.
        hz: f64,
        /// The ratio of its size to that of noise at this frequency.
        ratio: f64,
        /// The channel in which it is strongest by noise.
        channel: String,
    },
    /// A vibration that does not decay.
    #[error(
        "a disturbance from outside at {hz:.3} Hz, strongest in {channel}: it does not decay (damping ratio \
         {damping:.6} ± {sd:.6}); it is no mode; switch its source off"
    )]
    Disturbance {
        /// The vibration's frequency, Hz.
        hz: f64,
        /// Damping ratio.
        damping: f64,
        /// Standard deviation of the damping ratio.
        sd: f64,
        /// The channel in which it is strongest by noise.
        channel: String,
    },
    /// The springs are not linear at this amplitude: both signs of it.
    #[error(
        "amplitude too large for linear springs: the frequency {hz:.4} Hz falls by {:.5} % ± {:.5} % from \
         the early part to the late one (limit {:.5} %), and there is a line at {combination} = {line_hz:.3} \
         Hz of {ratio:.5} of the vibration{}; start with an amplitude {smaller_by:.1} times smaller, or cut \
         the beginning off",
        100.0 * shift, 100.0 * shift_sd, 100.0 * limit, counted(*shift, *shift_sd)
    )]
    LargeAmplitude {
        /// Frequency of the mode, Hz.
        hz: f64,
        /// Relative fall of the frequency from the early part to the late one.
        shift: f64,
        /// Standard deviation of the relative fall.
        shift_sd: f64,
        /// The relative shift that would be said.
        limit: f64,
        /// The multiple or sum, in words.
        combination: String,
        /// Frequency of the multiple or sum, Hz.
        line_hz: f64,
        /// The ratio of the line's size to that of the vibration, both weighted by noise.
        ratio: f64,
        /// The factor by which the amplitude is to be smaller for the shift to be as small as the frequency's
        /// standard deviation.
        smaller_by: f64,
    },
    /// A frequency that changes during the decay, without harmonics beyond noise.
    #[error(
        "the frequency {hz:.4} Hz changes by {:.5} % ± {:.5} % from the early part of the decay to the late \
         one (limit {:.5} %): amplitude too large for linear springs, or something settles{}; start with an \
         amplitude {smaller_by:.1} times smaller",
        100.0 * shift, 100.0 * shift_sd, 100.0 * limit, counted(*shift, *shift_sd)
    )]
    FrequencyShift {
        /// Frequency of the mode, Hz.
        hz: f64,
        /// Relative fall of the frequency from the early part to the late one.
        shift: f64,
        /// Standard deviation of the relative fall.
        shift_sd: f64,
        /// The relative shift that would be said.
        limit: f64,
        /// The factor by which the amplitude is to be smaller.
        smaller_by: f64,
    },
    /// A multiple or a sum of frequencies, without a change of frequency beyond noise.
    #[error(
        "a line at {combination} = {line_hz:.3} Hz of {ratio:.5} of the vibration (limit {limit:.5}): \
         springs, or sensors, are not quite linear at this amplitude"
    )]
    Harmonic {
        /// The multiple or sum, in words.
        combination: String,
        /// Frequency of the multiple or sum, Hz.
        line_hz: f64,
        /// The ratio of the line's size to that of the vibration, both weighted by noise.
        ratio: f64,
        /// The ratio that would be said.
        limit: f64,
    },
    /// Noise is stronger around a mode than elsewhere; intervals are wider for it.
    #[error(
        "noise of {channel} around {hz:.3} Hz has {ratio:.1} times the power of its mean; intervals of that \
         mode are wider by that"
    )]
    ColouredNoise {
        /// Frequency of the mode, Hz.
        hz: f64,
        /// The channel.
        channel: String,
        /// Power there by the mean.
        ratio: f64,
    },
    /// A decay that cannot be distinguished from none.
    #[error(
        "the damping of the mode at {hz:.3} Hz is not known: {damping:.6} ± {sd:.6}; record longer if it \
         matters"
    )]
    NoDecay {
        /// The mode's frequency, Hz.
        hz: f64,
        /// Damping ratio.
        damping: f64,
        /// Standard deviation of the damping ratio.
        sd: f64,
    },
    /// A shape that no phase makes real.
    #[error(
        "the mode at {hz:.3} Hz is complex: {:.1} % of its amplitudes are out of phase (noise would give \
         {:.1} %): a mode close by, a delay between channels, or damping out of proportion",
        100.0 * share, 100.0 * noise
    )]
    Complex {
        /// The mode's frequency, Hz.
        hz: f64,
        /// The part that is out of phase.
        share: f64,
        /// The part that noise would give.
        noise: f64,
    },
}

/// Returns whether a change of frequency is small enough to be counted.
fn is_counted(shift: f64, shift_sd: f64) -> bool {
    shift.abs() - 2.0 * shift_sd <= COUNTED
}

/// Says that a change of frequency is counted.
fn counted(shift: f64, shift_sd: f64) -> &'static str {
    if is_counted(shift, shift_sd) { " (counted in the intervals)" } else { "" }
}

impl Finding {
    /// Returns true if a frequency changes during the decay.
    pub fn is_change(&self) -> bool {
        matches!(self, Self::LargeAmplitude { .. } | Self::FrequencyShift { .. })
    }

    /// Returns how much it weighs.
    pub fn severity(&self) -> Severity {
        match self {
            Self::MissingModes { .. } | Self::TooClose { .. } | Self::FewCycles { is_refused: true, .. } => {
                Severity::Error
            }
            Self::LargeAmplitude { shift, shift_sd, .. } | Self::FrequencyShift { shift, shift_sd, .. }
                if !is_counted(*shift, *shift_sd) =>
            {
                Severity::Error
            }
            _ => Severity::Warning,
        }
    }
}
