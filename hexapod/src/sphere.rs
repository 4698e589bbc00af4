//! A motion whose angular velocity and acceleration point everywhere while one point of the plate stays
//! still.
//!
//! The plate is turned from where it is by the rotation vector `ρ(t) n(t)` in its own axes,
//! `ρ = A e(t) sin 2πft` with the soft envelope e, while the unit vector n winds from one pole of the sphere
//! to the other.

use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use super::envelope::{envelope, envelope_peaks};
use super::kinematics::{Coordinates, PlateState};
use super::rotation::{rotation_from_rpy, rpy_from_rotation};

/// What a [`super::Segment::Sphere`] does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Sphere {
    /// s, both ramps included.
    pub duration_s: f64,
    /// s, at most half of the duration.
    pub ramp_s: f64,
    /// Largest angle of the turn, rad; less than a quarter turn.
    pub amplitude_rad: f64,
    /// Of the turn to and fro, Hz.
    pub frequency_hz: f64,
    /// How often the axis winds around the plate's z on its way from pole to pole.
    pub turns: f64,
    /// The point that stays where it is, in P, m.
    pub still_point_m: [f64; 3],
}

impl Sphere {
    /// Checks that it makes sense.
    pub(super) fn check(&self) -> Result<(), &'static str> {
        if !(self.ramp_s > 0.0 && 2.0 * self.ramp_s <= self.duration_s) {
            return Err("its ramp must be longer than zero and at most half of its duration");
        }
        let numbers = [self.frequency_hz, self.turns];
        if !numbers.iter().chain(&self.still_point_m).all(|v| v.is_finite()) {
            return Err("a number of its sphere is not finite");
        }
        if self.amplitude_rad.abs() < std::f64::consts::FRAC_PI_2 {
            Ok(())
        } else {
            Err("its sphere turns by a quarter turn or more")
        }
    }

    /// Returns the rates of the axis' polar and azimuth angles, rad/s.
    fn winding(&self) -> [f64; 2] {
        [std::f64::consts::PI, std::f64::consts::TAU * self.turns].map(|angle| angle / self.duration_s)
    }

    /// Returns the coordinates `t` after the beginning, which was at rest at `from`.
    pub(super) fn coordinates(&self, from: &[f64; 6], t: f64) -> Coordinates {
        let [x, y, z, roll, pitch, yaw] = *from;
        let begin = rotation_from_rpy([roll, pitch, yaw]);
        let Motion { turn, rate, acceleration } = self.motion(t);
        let rotation = begin * turn;
        let arm = Vector3::from(self.still_point_m);
        // x + R c stands still.
        let (whirl, spin) = (rate.cross(&arm), acceleration.cross(&arm) + rate.cross(&rate.cross(&arm)));
        let state = PlateState {
            rpy: Vector3::from(rpy_from_rotation(&rotation)),
            position: Vector3::new(x, y, z) + begin * arm - rotation * arm,
            velocity: -(rotation * whirl),
            acceleration: -(rotation * spin),
            rotation,
            angular_rate: rate,
            angular_acceleration: acceleration,
        };
        Coordinates::of_state(&state)
    }

    /// Returns the motion by `ω = ρ' n + sin ρ n' − (1 − cos ρ) n×n'` in the plate's axes.
    fn motion(&self, t: f64) -> Motion {
        let [e0, e1, e2] = envelope(t, self.duration_s, self.ramp_s);
        let w = std::f64::consts::TAU * self.frequency_hz;
        let ((s, c), a) = ((w * t).sin_cos(), self.amplitude_rad);
        let rho = a * e0 * s;
        let rho1 = a * (e1 * s + e0 * w * c);
        let rho2 = a * (e2 * s + 2.0 * e1 * w * c - e0 * w * w * s);
        let [p, q] = self.winding();
        let ((sp, cp), (sq, cq)) = ((p * t).sin_cos(), (q * t).sin_cos());
        let n = Vector3::new(sp * cq, sp * sq, cp);
        let n1 = Vector3::new(p * cp * cq - q * sp * sq, p * cp * sq + q * sp * cq, -p * sp);
        let n2 = Vector3::new(
            -(p * p + q * q) * sp * cq - 2.0 * p * q * cp * sq,
            -(p * p + q * q) * sp * sq + 2.0 * p * q * cp * cq,
            -p * p * cp,
        );
        let (sin, cos) = rho.sin_cos();
        let (cross1, cross2) = (n.cross(&n1), n.cross(&n2));
        Motion {
            turn: *Rotation3::new(rho * n).matrix(),
            rate: rho1 * n + sin * n1 - (1.0 - cos) * cross1,
            acceleration: rho2 * n + rho1 * (1.0 + cos) * n1 + sin * n2
                - sin * rho1 * cross1
                - (1.0 - cos) * cross2,
        }
    }

    /// Bounds of `|x'''|` and of the second derivative of the angular rate (A), in a ramp or between them.
    pub(super) fn third_derivatives(&self, ramping: bool) -> [f64; 2] {
        let w = std::f64::consts::TAU * self.frequency_hz.abs();
        let a = self.amplitude_rad.abs();
        let [e1, e2, e3] = if ramping { envelope_peaks(self.ramp_s) } else { [0.0; 3] };
        let r1 = a * (e1 + w);
        let r2 = a * (e2 + 2.0 * e1 * w + w * w);
        let r3 = a * (e3 + 3.0 * e2 * w + 3.0 * e1 * w * w + w * w * w);
        // Every component of n along a fixed direction is a trigonometric polynomial of at most these rates
        // together, and no greater than one (Bernstein).
        let [p, q] = self.winding().map(f64::abs);
        let [n1, n2, n3] = [1, 2, 3].map(|k| (p + q).powi(k));
        let (s, c) = (a.sin(), 1.0 - a.cos());
        let rate = r1 + (s + c) * n1;
        let acceleration = r2 + 2.0 * r1 * n1 + (s + c) * n2 + s * r1 * n1;
        let own = r3
            + (3.0 * r2 + s * r1 * r1) * n1
            + 3.0 * r1 * n2
            + s * n3
            + (r1 * r1 + s * r2) * n1
            + 2.0 * s * r1 * n2
            + c * (n1 * n2 + n3);
        // d²ω/dt² in A is that in P and ω × ω̇.
        let second = own + rate * acceleration;
        let arm = Vector3::from(self.still_point_m).norm();
        [arm * (second + 3.0 * rate * acceleration + rate.powi(3)), second]
    }
}

/// Rotation since the beginning, angular rate and acceleration, in the plate's axes.
struct Motion {
    turn: Matrix3<f64>,
    rate: Vector3<f64>,
    acceleration: Vector3<f64>,
}
