//! The faults of a sensor, and their times.

use std::ops::Range;

/// A channel of the rig, for faults. Indices are 0-based.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// One component of the wrench, `[Fx, Fy, Fz, Mx, My, Mz]`.
    Wrench(usize),
    /// The load cell as a whole.
    LoadCell,
    /// One axis of the accelerometer.
    Accelerometer(usize),
    /// One axis of the gyro.
    Gyro(usize),
    /// The IMU as a whole.
    Imu,
}

/// One fault. Times are those of the rig's clock, s; use `f64::INFINITY` for one that stays.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// The channel repeats the reading it had when the fault began.
    Frozen {
        /// The one concerned.
        channel: Channel,
        /// The time.
        during: Range<f64>,
    },
    /// The channel reads the upper end of its range.
    Saturated {
        /// The one concerned.
        channel: Channel,
        /// The time.
        during: Range<f64>,
    },
    /// The load cell's offset runs away.
    Drift {
        /// N/s, N m/s.
        rate_n_nm_per_s: [f64; 6],
        /// The time; afterwards what has accumulated stays.
        during: Range<f64>,
    },
    /// The load cell's offset settles: `amplitude · e^(−t / time constant)`.
    WarmUp {
        /// Amplitude at time zero, N, N m.
        amplitude_n_nm: [f64; 6],
        /// s.
        time_constant_s: f64,
    },
    /// The gauges' excitation goes in a straight line from the one of the calibration to `to` times it, and
    /// stays there.
    Excitation {
        /// A ratio; 0: the wire is off.
        to: f64,
        /// The time.
        during: Range<f64>,
    },
    /// Somebody hits the body: half a sine of wrench that the motion knows nothing of.
    Knock {
        /// The time.
        during: Range<f64>,
        /// Peak, N, N m, in S.
        peak_n_nm: [f64; 6],
    },
}

impl Fault {
    /// Returns what the fault adds to the load cell's reading at `time_s`, N, N m.
    pub(super) fn added_wrench(&self, time_s: f64) -> Option<[f64; 6]> {
        let (factor, wrench) = match self {
            Self::Drift { rate_n_nm_per_s, during } => {
                ((time_s.min(during.end) - during.start).max(0.0), rate_n_nm_per_s)
            }
            Self::WarmUp { amplitude_n_nm, time_constant_s } => {
                ((-time_s / time_constant_s).exp(), amplitude_n_nm)
            }
            Self::Knock { during, peak_n_nm } if during.contains(&time_s) => {
                let phase = (time_s - during.start) / (during.end - during.start);
                ((std::f64::consts::PI * phase).sin(), peak_n_nm)
            }
            _ => return None,
        };
        Some(wrench.map(|w| factor * w))
    }

    /// Returns the excitation's ratio to the one of the calibration at `time_s`.
    pub(super) fn excitation(&self, time_s: f64) -> Option<f64> {
        let Self::Excitation { to, during } = self else { return None };
        let part = (time_s - during.start) / (during.end - during.start);
        Some(1.0 + (to - 1.0) * part.clamp(0.0, 1.0))
    }

    /// Returns whether it freezes `channel` at `time_s`.
    pub(super) fn freezes(&self, channel: Channel, time_s: f64) -> bool {
        matches!(self, Self::Frozen { channel: c, during } if c.covers(channel) && during.contains(&time_s))
    }

    /// Returns whether it drives `channel` to the end of its range at `time_s`.
    pub(super) fn saturates(&self, channel: Channel, time_s: f64) -> bool {
        matches!(self, Self::Saturated { channel: c, during } if c.covers(channel) && during.contains(&time_s))
    }
}

impl Channel {
    fn covers(self, one: Channel) -> bool {
        match self {
            Self::LoadCell => matches!(one, Self::Wrench(_)),
            Self::Imu => matches!(one, Self::Accelerometer(_) | Self::Gyro(_)),
            _ => self == one,
        }
    }
}
