//! Holds the way in which the times of a stream were made of the stamps of its file.

/// The way in which a stream's times were made of its stamps: `offset_s + rate t_s − begin_s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamped {
    /// The clock that the rig file states.
    pub offset_s: f64,
    /// Seconds of the common clock for one of the stream's.
    pub rate: f64,
    /// The first wrench and the stream's own delay, s of the common clock.
    pub begin_s: f64,
}

impl Default for Stamped {
    fn default() -> Self {
        Self { offset_s: 0.0, rate: 1.0, begin_s: 0.0 }
    }
}
