//! Limits of joints, as robot descriptions state them.

/// Limits of a joint of one freedom; `None` where nothing is stated. Units are those of a turning joint; a
/// sliding one has m for rad and N for N m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Least and largest position, rad.
    pub position: Option<[f64; 2]>,
    /// Largest rate, rad/s.
    pub velocity: Option<f64>,
    /// Largest effort, N m.
    pub effort: Option<f64>,
}

impl Limits {
    /// Returns limits as files write them: numbers that limit nothing are none.
    pub(super) fn of(lower: f64, upper: f64, velocity: f64, effort: f64) -> Self {
        let positive = |v: f64| Some(v).filter(|v| v.is_finite() && *v > 0.0);
        let is_range = lower.is_finite() && upper.is_finite() && lower < upper;
        Self {
            position: is_range.then_some([lower, upper]),
            velocity: positive(velocity),
            effort: positive(effort),
        }
    }
}
