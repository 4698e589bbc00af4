//! The limits of a machine whose joints are not published: how far and how fast its plate goes.

use serde::{Deserialize, Serialize};

use super::kinematics::PlateState;

/// The distance that a plate goes to either side of its reference pose, and how fast, as its maker says.
/// Nothing is known of legs: whether they reach a pose, bend, collide or carry what is on the plate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Travel {
    /// Along x, y, z, m.
    pub shift_m: [f64; 3],
    /// Ranges of roll, pitch, yaw, rad; a pitch stays below a right angle.
    pub turn_rad: [f64; 3],
    /// All of it can be used at once. Else each holds with the other axes at zero, and the shares of what is
    /// used of them together are at most one.
    pub together: bool,
    /// Highest speed of the plate's origin, m/s.
    pub speed_mps: Option<f64>,
    /// Highest angular rate of the plate, rad/s.
    pub rate_radps: Option<f64>,
}

impl Travel {
    /// Returns what each axis has, m and rad.
    pub fn ranges(&self) -> [f64; 6] {
        let ([x, y, z], [roll, pitch, yaw]) = (self.shift_m, self.turn_rad);
        [x, y, z, roll, pitch, yaw]
    }

    /// Returns the share of the travel that these distances from the reference pose use, m and rad.
    pub fn share(&self, away: &[f64; 6]) -> f64 {
        let shares = away.iter().zip(self.ranges()).map(|(away, range)| away.abs() / range);
        // What is no number stays so.
        let larger = |most: f64, share: f64| if share > most || share.is_nan() { share } else { most };
        if self.together { shares.fold(0.0, larger) } else { shares.sum() }
    }

    /// Returns a bound of the share within `half` seconds of a state; `speed` and `rate` bound the velocity
    /// of each axis of the plate's origin, m/s, and the angular rate, rad/s, there. `|roll'|` and `|yaw'|`
    /// are at most `|ω| / cos pitch`.
    pub(super) fn most(&self, state: &PlateState, half: f64, speed: [f64; 3], rate: f64) -> f64 {
        let steepest = state.rpy.y.abs() + rate * half;
        if steepest >= std::f64::consts::FRAC_PI_2 {
            return f64::INFINITY;
        }
        let turned = rate / steepest.cos();
        let [x, y, z] = speed;
        let changes = [x, y, z, turned, rate, turned];
        let at = state.pose().coordinates();
        self.share(&std::array::from_fn(|k| at[k].abs() + changes[k] * half))
    }

    /// Returns the same with a share of how far the plate goes.
    #[must_use]
    pub fn reaching(&self, share: f64) -> Self {
        Self {
            shift_m: self.shift_m.map(|v| v * share),
            turn_rad: self.turn_rad.map(|v| v * share),
            ..self.clone()
        }
    }

    /// Returns the same with a share of how fast it goes.
    #[must_use]
    pub fn slower(&self, share: f64) -> Self {
        Self {
            speed_mps: self.speed_mps.map(|v| v * share),
            rate_radps: self.rate_radps.map(|v| v * share),
            ..self.clone()
        }
    }
}
