//! The lean of force plates.

use nalgebra::Vector2;

/// Plates that lean by less than this are level, rad: 0.6°, 1 % of the weight.
const LEVEL: f64 = 0.6 * std::f64::consts::PI / 180.0;
/// Plates that lean by more than this, rad (2.5°), are on a slope, or have axes of their own.
const SLOPE: f64 = 2.5 * std::f64::consts::PI / 180.0;
/// This many standard deviations are no chance.
const SURE_SD: f64 = 3.0;

/// The tilt of plates, by the mean force under a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tilt {
    /// Mean horizontal force beyond `m Δv / T` over the mean vertical one, x and y: small angles, rad.
    pub lean: Vector2<f64>,
    /// 1 σ of each, rad.
    pub sigma: f64,
    /// The mean horizontal force, N.
    pub force_n: f64,
}

impl Tilt {
    /// Returns true if it is no chance, and more than laboratories level their plates to.
    pub fn is_significant(&self) -> bool {
        self.lean.norm() > LEVEL.max(SURE_SD * self.sigma)
    }

    /// Returns true if it is more than any laboratory overlooks: masses of segments are worth nothing.
    pub fn is_a_slope(&self) -> bool {
        self.lean.norm() > SLOPE.max(SURE_SD * self.sigma)
    }
}
