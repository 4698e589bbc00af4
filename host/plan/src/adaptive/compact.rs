//! A ball of steel, in place of a body that is not known.

/// Density of the most compact body of a mass, kg/m³ (steel).
const DENSITY: f64 = 7850.0;
/// Distance of the ball's centre of mass from S, in its radii.
const AWAY: f64 = 3.0;

/// The most compact body of a mass: what a relative goal is of before a body is identified.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compact {
    /// The ball's moment of inertia, kg m².
    pub(super) moment_kgm2: f64,
    /// Distance of its centre of mass from S that is reckoned with, m.
    pub(super) away_m: f64,
}

impl Compact {
    /// Returns a ball of steel.
    pub fn of(mass_kg: f64) -> Self {
        let radius = (3.0 * mass_kg / (4.0 * std::f64::consts::PI * DENSITY)).cbrt();
        Self { moment_kgm2: 0.4 * mass_kg * radius * radius, away_m: AWAY * radius }
    }
}
