//! Whether the attitudes have gravity where the accelerometer feels it.
//!
//! At rest `R_SA (−g) = a`; in motion a has an acceleration besides, which changes its length as much as its
//! direction: of an acceleration without a preferred direction, and of noise, √2 times as much falls across
//! gravity as along it. A wrong frame, and a clock that is far off, turn the direction and leave the length.

use nalgebra::{Matrix3, Vector3};

use super::skew::Instant;

/// Angles below this are mounting and bias, rad.
const SMALL_RAD: f64 = 0.03;
/// Across gravity there is this many times more than what is along it explains: the vibration of a real robot
/// leaves 0.5.
const BEYOND: f64 = 2.5;
/// An accelerometer farther than this from a point that does not move is not taken for explained, m.
const FARTHEST_M: f64 = 0.5;

/// By how much they differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disagreement {
    /// Root mean square of the angle between the two, rad.
    pub angle_rad: f64,
    /// The part of it that noise and acceleration explain, by the length of the specific force, rad.
    pub explained_rad: f64,
}

impl Disagreement {
    /// Over all instants that have both; `None` if none has.
    pub(super) fn of(instants: &[Instant]) -> Option<Self> {
        let both: Vec<(Vector3<f64>, &Instant)> =
            instants.iter().filter_map(|instant| Some((instant.up?, instant))).collect();
        // Turning about a point at −d of S accelerates too: what it explains is no disagreement.
        let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (up, instant) in &both {
            let turning = Matrix3::from_columns(
                &[Vector3::x(), Vector3::y(), Vector3::z()].map(|d| instant.turning(&d)),
            );
            gram += turning.transpose() * turning;
            right += turning.transpose() * (up - instant.force());
        }
        let d = gram.cholesky().map(|c| c.solve(&right)).filter(|d| d.norm() < FARTHEST_M);
        let d = d.unwrap_or_else(Vector3::zeros);
        let (mut angles, mut along) = (0.0, 0.0);
        for (up, instant) in &both {
            let felt = instant.force() + instant.turning(&d);
            angles += up.angle(&felt).powi(2);
            along += (felt.norm() / up.norm() - 1.0).powi(2);
        }
        let count = both.len() as f64;
        (count > 0.0)
            .then(|| Self { angle_rad: (angles / count).sqrt(), explained_rad: (2.0 * along / count).sqrt() })
    }

    /// In words, if it is beyond what noise and acceleration explain.
    pub(super) fn warning(&self, file: &str) -> Option<String> {
        let limit = SMALL_RAD.max(BEYOND * self.explained_rad);
        (self.angle_rad > limit).then(|| {
            format!(
                "gravity by the attitudes of {file} is {:.1} degrees (RMS) from where the accelerometer \
                 feels it; noise and acceleration explain {:.1}: a wrong frame or transposed \
                 rotation_matrix, an A whose z does not point up, a wrong [[imu]] rotation_wxyz, or a clock \
                 that is off by more than the skew's search reaches; do not trust the answer before it is \
                 found",
                self.angle_rad.to_degrees(),
                self.explained_rad.to_degrees()
            )
        })
    }
}
