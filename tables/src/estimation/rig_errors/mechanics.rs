//! A body on a load cell that turns about the cell's origin, by Newton's and Euler's laws: no regressor.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Rotation3, Vector3};

/// Gravity, m/s².
pub const GRAVITY: f64 = 9.80665;

/// A rigid body, axes of S.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    pub mass: f64,
    pub com: Vector3<f64>,
    /// About the centre of mass.
    pub inertia: Matrix3<f64>,
}

impl Body {
    /// Returns the body of `docs/estimation.md`: 3.2 kg.
    pub fn lab() -> Self {
        Self {
            mass: 3.2,
            com: Vector3::new(0.03, -0.02, 0.08),
            inertia: Matrix3::new(0.02, 0.002, -0.001, 0.002, 0.025, 0.0015, -0.001, 0.0015, 0.015),
        }
    }

    /// Returns the body without a point mass that was part of it.
    pub fn without(&self, mass: f64, at: &Vector3<f64>) -> Self {
        let left = self.mass - mass;
        let com = (self.com * self.mass - at * mass) / left;
        let point =
            |m: f64, d: &Vector3<f64>| (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * m;
        let origin = self.inertia + point(self.mass, &self.com) - point(mass, at);
        Self { mass: left, com, inertia: origin - point(left, &com) }
    }

    /// Returns force and moment that the load cell has to exert about the origin of S.
    pub fn wrench(&self, state: &State) -> (Vector3<f64>, Vector3<f64>) {
        let force = state.force_at(&self.com) * self.mass;
        let turning = self.inertia * state.acceleration + state.rate.cross(&(self.inertia * state.rate));
        (force, turning + self.com.cross(&force))
    }

    /// Returns mass, centre of mass, first moments and the tensor about the centre of mass: the quantities
    /// that are examined.
    pub fn quantities(&self) -> Quantities {
        let i = &self.inertia;
        let moment = self.com * self.mass;
        [
            self.mass,
            moment.x,
            moment.y,
            moment.z,
            self.com.x,
            self.com.y,
            self.com.z,
            i[(0, 0)],
            i[(1, 1)],
            i[(2, 2)],
            i[(1, 2)],
            i[(2, 0)],
            i[(0, 1)],
        ]
    }
}

/// m, mc, c, I about the centre of mass (xx, yy, zz, yz, zx, xy).
pub type Quantities = [f64; 13];

/// The motion of S at an instant, in its own axes.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// The rotation from S to the world.
    pub attitude: Matrix3<f64>,
    /// Specific force at the origin, m/s².
    pub force: Vector3<f64>,
    /// rad/s
    pub rate: Vector3<f64>,
    /// rad/s²
    pub acceleration: Vector3<f64>,
}

impl State {
    /// Returns the specific force at a point of S.
    pub fn force_at(&self, at: &Vector3<f64>) -> Vector3<f64> {
        self.force + self.acceleration.cross(at) + self.rate.cross(&self.rate.cross(at))
    }
}

/// Roll, pitch and yaw as sums of sines: axis, amplitude (rad), frequency (Hz), phase (rad).
#[derive(Clone, Debug)]
pub struct Motion {
    sines: Vec<(usize, f64, f64, f64)>,
    /// A time at which all of it is at rest, from and to, s.
    rest: Option<[f64; 2]>,
}

/// Time in which a motion stops, and in which it goes on, s.
const STOPS_S: f64 = 1.0;

impl Motion {
    /// Returns a motion of ±0.5 rad about all axes, 0.2 to 1.6 Hz.
    pub fn lab() -> Self {
        Self::of(vec![
            (0, 0.25, 0.2, 0.1),
            (0, 0.15, 0.7, 1.0),
            (0, 0.1, 1.6, 1.3),
            (1, 0.25, 0.3, 2.0),
            (1, 0.15, 0.9, 0.3),
            (1, 0.1, 1.4, 0.5),
            (2, 0.25, 0.4, 0.7),
            (2, 0.15, 0.8, 1.7),
            (2, 0.1, 1.2, 2.7),
        ])
    }

    fn of(sines: Vec<(usize, f64, f64, f64)>) -> Self {
        Self { sines, rest: None }
    }

    /// Returns the same motion, which stops before a rest and goes on after it.
    pub fn with_rest(self, from_s: f64, to_s: f64) -> Self {
        Self { rest: Some([from_s, to_s]), ..self }
    }

    /// Returns how far the motion is at a time, s, how fast it goes, and how that changes: the speed goes
    /// from 1 to 0 and back as `1 − 3x² + 2x³`.
    fn progress(&self, t: f64) -> [f64; 3] {
        let Some([from, to]) = self.rest else { return [t, 1.0, 0.0] };
        let stopping = |x: f64| {
            [
                STOPS_S * (x - x.powi(3) + 0.5 * x.powi(4)),
                1.0 - x * x * (3.0 - 2.0 * x),
                6.0 * x * (x - 1.0) / STOPS_S,
            ]
        };
        let stands = from - STOPS_S + 0.5 * STOPS_S;
        if t < from - STOPS_S {
            [t, 1.0, 0.0]
        } else if t < from {
            let [on, speed, change] = stopping((t - from) / STOPS_S + 1.0);
            [from - STOPS_S + on, speed, change]
        } else if t < to {
            [stands, 0.0, 0.0]
        } else if t < to + STOPS_S {
            // The stop backwards.
            let [on, speed, change] = stopping(1.0 - (t - to) / STOPS_S);
            [stands + 0.5 * STOPS_S - on, speed, -change]
        } else {
            [stands + 0.5 * STOPS_S + t - to - STOPS_S, 1.0, 0.0]
        }
    }

    /// Returns a motion of ±1 rad about all axes, 0.2 to 1.6 Hz, four sines each: accelerations of 20 rad/s²,
    /// of which a tensor is known twice as well.
    pub fn brisk() -> Self {
        let of = |axis: usize, all: [(f64, f64); 4]| all.map(|(hz, phase)| (axis, 0.25, hz, phase));
        Self::of(
            [
                of(0, [(0.31, 0.4), (0.83, 5.1), (1.07, 2.2), (1.45, 3.6)]),
                of(1, [(0.45, 1.9), (0.66, 0.2), (1.19, 4.4), (1.31, 0.9)]),
                of(2, [(0.24, 3.1), (0.74, 2.7), (0.98, 5.8), (1.58, 1.4)]),
            ]
            .concat(),
        )
    }

    /// Returns the state at a time, by the kinematics of the angles' rates.
    pub fn state(&self, t: f64) -> State {
        let [s, speed, change] = self.progress(t);
        let (mut e, mut d, mut dd) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for (axis, amplitude, hz, phase) in &self.sines {
            let (sin, cos) = (TAU * hz * s + phase).sin_cos();
            let slope = amplitude * TAU * hz * cos;
            e[*axis] += amplitude * sin;
            d[*axis] += slope * speed;
            dd[*axis] += slope * change - amplitude * (TAU * hz * speed).powi(2) * sin;
        }
        let ((sa, ca), (sb, cb)) = (e[0].sin_cos(), e[1].sin_cos());
        let rate = Vector3::new(d[0] - d[2] * sb, d[1] * ca + d[2] * sa * cb, -d[1] * sa + d[2] * ca * cb);
        let acceleration = Vector3::new(
            dd[0] - dd[2] * sb - d[2] * d[1] * cb,
            dd[1] * ca - d[1] * d[0] * sa + dd[2] * sa * cb + d[2] * (d[0] * ca * cb - d[1] * sa * sb),
            -dd[1] * sa - d[1] * d[0] * ca + dd[2] * ca * cb - d[2] * (d[0] * sa * cb + d[1] * ca * sb),
        );
        let attitude = *Rotation3::from_euler_angles(e[0], e[1], e[2]).matrix();
        State { attitude, force: attitude.transpose() * Vector3::new(0.0, 0.0, GRAVITY), rate, acceleration }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates are those of the attitude, accelerations those of the rates.
    #[test]
    fn rates_are_derivatives() {
        let h = 1e-5;
        let stops = || Motion::lab().with_rest(4.0, 6.0);
        for (motion, t) in [
            (Motion::lab(), 0.3),
            (Motion::lab(), 11.1),
            (Motion::brisk(), 2.7),
            (stops(), 3.4),
            (stops(), 5.0),
            (stops(), 6.3),
            (stops(), 9.0),
        ] {
            let (now, before, after) = (motion.state(t), motion.state(t - h), motion.state(t + h));
            let spin = now.attitude.transpose() * (after.attitude - before.attitude) / (2.0 * h);
            // Third derivatives are below 1e3 and 1e4.
            assert!((spin - now.rate.cross_matrix()).norm() < 1e3 * h * h);
            assert!(((after.rate - before.rate) / (2.0 * h) - now.acceleration).norm() < 1e4 * h * h);
        }
    }

    /// A body and a point mass that is taken off and put on again weigh the same.
    #[test]
    fn a_point_mass_is_taken_off() {
        let (body, state) = (Body::lab(), Motion::lab().state(1.3));
        let at = Vector3::new(0.1, 0.02, -0.03);
        let (force, moment) = body.without(0.05, &at).wrench(&state);
        let point = state.force_at(&at) * 0.05;
        let (whole, about) = body.wrench(&state);
        assert!((force + point - whole).norm() < 1e-12 && (moment + at.cross(&point) - about).norm() < 1e-12);
    }
}
