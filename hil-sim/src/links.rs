//! Several bodies hanging on each other: how they move when their joints swing, and what wrench that takes.
//!
//! Lives here: a joint that swings ([`Swing`]), the second link of a rig ([`SecondLink`]) and whole trees
//! ([`Tree`]). May not live here: regressors or anything else from the estimator's side; every body has
//! Newton's and Euler's equations of its own ([`hexapod`]). Before this: [`hexapod`]; next: [`crate::rig`].

use nalgebra::{Matrix3, Vector3};

use hexapod::Mounting;
use hexapod::{BodyParameters, FrameMotion};

/// An eased swing begins and ends within this time, s.
const EASED_S: f64 = 2.0;

/// Turns about x, then y, then z, each a sine of time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Swing {
    /// Amplitudes, rad.
    pub amplitude_rad: [f64; 3],
    /// Frequencies, Hz.
    pub frequency_hz: [f64; 3],
    /// Phases at time zero, rad.
    pub phase_rad: [f64; 3],
}

/// A joint at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState {
    /// Parent's axes ← link's axes.
    pub rotation: Matrix3<f64>,
    /// Rate against the parent, link's axes, rad/s.
    pub rate: Vector3<f64>,
    /// Derivative of the rate's components, rad/s².
    pub acceleration: Vector3<f64>,
}

impl Swing {
    /// Returns angles, rates and accelerations about x, y and z at `time_s`.
    fn angles(&self, time_s: f64) -> [(f64, f64, f64); 3] {
        std::array::from_fn(|k| {
            let w = std::f64::consts::TAU * self.frequency_hz[k];
            let (sin, cos) = (w * time_s + self.phase_rad[k]).sin_cos();
            let amplitude = self.amplitude_rad[k];
            (amplitude * sin, amplitude * w * cos, -amplitude * w * w * sin)
        })
    }

    /// Returns the joint at `time_s`.
    pub fn at(&self, time_s: f64) -> JointState {
        Self::joint(self.angles(time_s))
    }

    /// Returns the joint at `time_s` of a motion of `duration_s` that begins and ends at rest, at no angle.
    pub fn eased(&self, time_s: f64, duration_s: f64) -> JointState {
        let t = time_s.clamp(0.0, duration_s);
        // q = x³ (10 − 15 x + 6 x²), whose first two derivatives vanish at both ends.
        let x = (t.min(duration_s - t) / EASED_S).clamp(0.0, 1.0);
        let towards = if 2.0 * t < duration_s { 1.0 } else { -1.0 } / EASED_S;
        let q = x * x * x * (10.0 + x * (6.0 * x - 15.0));
        let dq = 30.0 * (x * (1.0 - x)).powi(2) * towards;
        let ddq = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / (EASED_S * EASED_S);
        Self::joint(self.angles(t).map(|(a, v, c)| (q * a, q * v + dq * a, q * c + 2.0 * dq * v + ddq * a)))
    }

    /// Makes the state of a joint from angles, rates and accelerations about x, then y, then z.
    fn joint([a, b, c]: [(f64, f64, f64); 3]) -> JointState {
        let about = |k: usize, angle: f64| {
            let (s, c) = angle.sin_cos();
            let mut r = Matrix3::identity();
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            (r[(i, i)], r[(i, j)], r[(j, i)], r[(j, j)]) = (c, -s, s, c);
            r
        };
        let (rx, ry, rz) = (about(0, a.0), about(1, b.0), about(2, c.0));
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        // ω = Rzᵀ Ryᵀ x ȧ + Rzᵀ y ḃ + z ċ, and d/dt (Rᵀ v) = Rᵀ v̇ − ω × Rᵀ v about the turning axis.
        let inner = ry.tr_mul(&x);
        let first = rz.tr_mul(&inner);
        let first_change = rz.tr_mul(&(-b.1 * y.cross(&inner))) - c.1 * z.cross(&first);
        let second = rz.tr_mul(&y);
        let second_change = -c.1 * z.cross(&second);
        JointState {
            rotation: rx * ry * rz,
            rate: first * a.1 + second * b.1 + z * c.1,
            acceleration: first * a.2 + first_change * a.1 + second * b.2 + second_change * b.1 + z * c.2,
        }
    }

    /// Returns the joint's attitude, w, x, y, z with w not negative.
    pub fn attitude_wxyz(&self, time_s: f64) -> [f64; 4] {
        quaternion(&self.at(time_s).rotation)
    }
}

/// Returns the quaternion of a rotation, w not negative.
pub fn quaternion(rotation: &Matrix3<f64>) -> [f64; 4] {
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(*rotation);
    let q = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [q.w, q.i, q.j, q.k].map(|v| sign * v)
}

/// Returns the motion of a frame on a joint at `offset` in a frame that moves, everything in the earth's
/// axes.
pub fn jointed(parent: &FrameMotion, offset: &Vector3<f64>, joint: &JointState) -> FrameMotion {
    let mut motion = parent.fixed_frame(offset, &joint.rotation);
    let turning = motion.rotation * joint.rate;
    motion.angular_acceleration += motion.rotation * joint.acceleration + motion.angular_rate.cross(&turning);
    motion.angular_rate += turning;
    motion
}

/// Carries a wrench on the child's frame over to the parent's origin and axes.
fn carried(wrench: [f64; 6], offset: &Vector3<f64>, rotation: &Matrix3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let [fx, fy, fz, mx, my, mz] = wrench;
    let force = rotation * Vector3::new(fx, fy, fz);
    (force, rotation * Vector3::new(mx, my, mz) + offset.cross(&force))
}

/// A body on a joint that swings, on the body on the load cell, with an IMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondLink {
    /// The body, in the link's frame, whose origin is the joint.
    pub body: BodyParameters,
    /// The joint in S, m.
    pub joint_m: [f64; 3],
    /// The motion of its swing: by the rig's clock, or by the plate's program.
    pub swing: Swing,
    /// True if it swings while the plate's program runs, from rest to rest and from no angle to none; else it
    /// swings always.
    pub with_program: bool,
    /// The second link's IMU in the link's frame.
    pub imu: Mounting,
}

impl SecondLink {
    /// Returns an arm of 6 kg on a ball joint, which swings at some 2 rad/s, always, and is at rest at time
    /// zero.
    pub fn arm() -> Self {
        Self {
            body: BodyParameters {
                mass_kg: 6.0,
                com_m: [0.04, -0.03, 0.12],
                inertia_com_kgm2: [0.12, 0.10, 0.06, 0.01, -0.015, 0.02],
            },
            joint_m: [0.1, -0.05, 0.2],
            swing: Swing {
                amplitude_rad: [0.5, 0.45, 0.6],
                frequency_hz: [0.61, 0.83, 0.47],
                phase_rad: [std::f64::consts::FRAC_PI_2; 3],
            },
            with_program: false,
            imu: Mounting { position_m: [0.03, 0.05, 0.1], rotation_wxyz: [0.8, -0.3, 0.4, 0.2] },
        }
    }

    /// Returns the motion of the second link's frame, by that of S and the position of its joint.
    pub fn motion(&self, sensor: &FrameMotion, joint: &JointState) -> FrameMotion {
        jointed(sensor, &Vector3::from(self.joint_m), joint)
    }

    /// Returns what it adds to the wrench at S's origin, in S; N, N m.
    pub fn wrench(&self, sensor: &FrameMotion, joint: &JointState, gravity: &Vector3<f64>) -> [f64; 6] {
        let own = self.body.wrench(&self.motion(sensor, joint), gravity);
        let (f, m) = carried(own, &Vector3::from(self.joint_m), &joint.rotation);
        [f.x, f.y, f.z, m.x, m.y, m.z]
    }

    /// Returns the base parameters of the pair with a body on S: ten of the first, to which the second's mass
    /// belongs as a point in the joint, and the second's first moments and tensor.
    pub fn base_parameters(&self, first: &BodyParameters) -> [f64; 19] {
        let point =
            BodyParameters { mass_kg: self.body.mass_kg, com_m: self.joint_m, inertia_com_kgm2: [0.0; 6] };
        let mut out = [0.0; 19];
        for ((slot, own), more) in out.iter_mut().zip(first.parameters()).zip(point.parameters()) {
            *slot = own + more;
        }
        for (slot, own) in out.iter_mut().skip(10).zip(self.body.parameters().into_iter().skip(1)) {
            *slot = own;
        }
        out
    }
}

/// One link of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeLink {
    /// Index of the parent, smaller than its own.
    pub parent: usize,
    /// The joint in the parent's frame, m.
    pub joint_m: [f64; 3],
    /// The body, in the link's frame, whose origin is the joint.
    pub body: BodyParameters,
    /// The motion of the joint; of the first link, that of the base against the earth.
    pub swing: Swing,
}

/// A tree of links whose base is carried about.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    /// The links, base first.
    pub links: Vec<TreeLink>,
    /// Amplitudes of the base's sway, m.
    pub sway_m: [f64; 3],
    /// Frequencies of the base's sway, Hz.
    pub sway_hz: [f64; 3],
    /// Gravity, downward positive, m/s².
    pub gravity_mps2: f64,
}

/// Everything at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeInstant {
    /// Motion of every link.
    pub motions: Vec<FrameMotion>,
    /// Wrench on the base at its origin, in its axes; N, N m.
    pub wrench: [f64; 6],
    /// Specific force at the base's origin, base axes, m/s².
    pub specific_force: [f64; 3],
}

impl Tree {
    /// Returns the tree at `time_s`.
    ///
    /// # Panics
    /// If there is no link, or one precedes its parent.
    pub fn at(&self, time_s: f64) -> TreeInstant {
        let gravity = Vector3::new(0.0, 0.0, -self.gravity_mps2);
        let mut position = Vector3::zeros();
        let (mut velocity, mut acceleration) = (position, position);
        for k in 0..3 {
            let w = std::f64::consts::TAU * self.sway_hz[k];
            let (sin, cos) = (w * time_s + k as f64).sin_cos();
            position[k] = self.sway_m[k] * sin;
            velocity[k] = self.sway_m[k] * w * cos;
            acceleration[k] = -self.sway_m[k] * w * w * sin;
        }
        let ground = FrameMotion {
            position,
            velocity,
            acceleration,
            rotation: Matrix3::identity(),
            angular_rate: Vector3::zeros(),
            angular_acceleration: Vector3::zeros(),
        };
        let mut motions: Vec<FrameMotion> = Vec::with_capacity(self.links.len());
        for (i, link) in self.links.iter().enumerate() {
            let (parent, offset) =
                if i == 0 { (&ground, [0.0; 3]) } else { (&motions[link.parent], link.joint_m) };
            motions.push(jointed(parent, &Vector3::from(offset), &link.swing.at(time_s)));
        }
        let base = motions[0];
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for (link, motion) in self.links.iter().zip(&motions) {
            let rotation = base.rotation.transpose() * motion.rotation;
            let offset = base.rotation.transpose() * (motion.position - base.position);
            let (f, m) = carried(link.body.wrench(motion, &gravity), &offset, &rotation);
            force += f;
            moment += m;
        }
        TreeInstant {
            wrench: [force.x, force.y, force.z, moment.x, moment.y, moment.z],
            specific_force: base.specific_force(&gravity).into(),
            motions,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swing(k: usize) -> Swing {
        let f = |j: usize| 0.3 + 0.11 * ((3 * k + j) % 7) as f64;
        Swing {
            amplitude_rad: [0.5, -0.4, 0.6],
            frequency_hz: [f(0), f(1), f(2)],
            phase_rad: [0.2 * k as f64, 1.0, -0.7],
        }
    }

    fn body(k: f64) -> BodyParameters {
        BodyParameters {
            mass_kg: 1.0 + k,
            com_m: [0.03, -0.05 * k, 0.1],
            inertia_com_kgm2: [0.031, 0.042, 0.025, 0.003, -0.004, 0.006],
        }
    }

    fn tree() -> Tree {
        let link = |parent, k: usize| TreeLink {
            parent,
            joint_m: [0.1, 0.05 * k as f64, 0.2],
            body: body(k as f64),
            swing: swing(k),
        };
        Tree {
            links: vec![link(0, 0), link(0, 1), link(1, 2), link(1, 3)],
            sway_m: [0.1, 0.08, 0.05],
            sway_hz: [0.5, 0.7, 0.9],
            gravity_mps2: 9.81,
        }
    }

    #[test]
    fn rates_and_accelerations_are_the_derivatives_of_attitudes_and_places() {
        let (tree, h) = (tree(), 1e-4);
        for t in [0.3, 1.7, 4.2] {
            let (before, now, after) = (tree.at(t - h), tree.at(t), tree.at(t + h));
            for ((b, n), a) in before.motions.iter().zip(&now.motions).zip(&after.motions) {
                let s = (a.rotation - b.rotation) / (2.0 * h) * n.rotation.transpose();
                let rate = Vector3::new(s.m32 - s.m23, s.m13 - s.m31, s.m21 - s.m12) * 0.5;
                // Truncation h²/6 times the third derivative, some hundred.
                assert!((rate - n.angular_rate).norm() < 1e-6);
                let change = (a.angular_rate - b.angular_rate) / (2.0 * h);
                assert!((change - n.angular_acceleration).norm() < 1e-5);
                assert!(((a.position - b.position) / (2.0 * h) - n.velocity).norm() < 1e-6);
                assert!(((a.velocity - b.velocity) / (2.0 * h) - n.acceleration).norm() < 1e-5);
            }
        }
    }

    #[test]
    fn an_eased_swing_begins_and_ends_at_rest_and_is_the_swing_between() {
        let (swing, h) = (swing(3), 1e-4);
        for t in [0.0, 20.0, -1.0, 25.0] {
            let end = swing.eased(t, 20.0);
            assert_eq!((end.rotation, end.rate), (Matrix3::identity(), Vector3::zeros()));
            assert_eq!(end.acceleration, Vector3::zeros());
        }
        assert_eq!(swing.eased(7.3, 20.0), swing.at(7.3));
        for t in [0.4, 1.1, 1.9, 18.3, 19.5] {
            let [before, now, after] = [t - h, t, t + h].map(|t| swing.eased(t, 20.0));
            let s = now.rotation.transpose() * (after.rotation - before.rotation) / (2.0 * h);
            let rate = Vector3::new(s.m32 - s.m23, s.m13 - s.m31, s.m21 - s.m12) * 0.5;
            assert!((rate - now.rate).norm() < 1e-6, "{t}");
            let change = (after.rate - before.rate) / (2.0 * h);
            assert!((change - now.acceleration).norm() < 1e-5, "{t}");
        }
    }

    #[test]
    fn the_base_s_wrench_is_the_rate_of_change_of_all_momentum() {
        // Linear, and angular about the fixed point where the base's origin is now, gravity's share taken
        // off.
        let (tree, h) = (tree(), 1e-4);
        let momentum = |t: f64, about: Vector3<f64>| {
            let (mut p, mut l) = (Vector3::zeros(), Vector3::zeros());
            for (link, motion) in tree.links.iter().zip(tree.at(t).motions) {
                let com = motion.fixed_frame(&Vector3::from(link.body.com_m), &Matrix3::identity());
                let m = link.body.mass_kg * com.velocity;
                p += m;
                let i = motion.rotation * link.body.inertia_com() * motion.rotation.transpose();
                l += (com.position - about).cross(&m) + i * motion.angular_rate;
            }
            (p, l)
        };
        for t in [0.4, 2.1, 3.3] {
            let now = tree.at(t);
            let base = now.motions[0];
            let (before, after) = (momentum(t - h, base.position), momentum(t + h, base.position));
            let (mut f, mut m) = ((after.0 - before.0) / (2.0 * h), (after.1 - before.1) / (2.0 * h));
            for (link, motion) in tree.links.iter().zip(&now.motions) {
                let weight = Vector3::new(0.0, 0.0, -9.81 * link.body.mass_kg);
                let com = motion.position + motion.rotation * Vector3::from(link.body.com_m);
                f -= weight;
                m -= (com - base.position).cross(&weight);
            }
            let (f, m) = (base.rotation.transpose() * f, base.rotation.transpose() * m);
            for (got, want) in now.wrench.iter().zip([f.x, f.y, f.z, m.x, m.y, m.z]) {
                assert!((got - want).abs() < 1e-4, "{got} {want}");
            }
        }
    }

    #[test]
    fn a_second_link_is_a_tree_of_two() {
        let tree = tree();
        let link = SecondLink {
            body: tree.links[1].body,
            joint_m: tree.links[1].joint_m,
            swing: tree.links[1].swing,
            with_program: false,
            imu: Mounting::IDENTITY,
        };
        let pair = Tree { links: tree.links[..2].to_vec(), ..tree };
        let now = pair.at(0.9);
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        let first = pair.links[0].body.wrench(&now.motions[0], &gravity);
        let second = link.wrench(&now.motions[0], &link.swing.at(0.9), &gravity);
        for ((a, b), sum) in first.iter().zip(second).zip(now.wrench) {
            assert!((a + b - sum).abs() < 1e-12);
        }
    }
}
