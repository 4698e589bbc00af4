//! The equations of motion: every body's Jacobian, the mass matrix, forces, and the accelerations that
//! follow.
//!
//! A state is places `[s, p, q_P, q_1 … q_n]` and rates `u = [ṡ, ṗ, ω_P, u_1 … u_n]`: s the support's shift,
//! p and q_P place and attitude of P, ω_P in A's axes, u_k the rate of joint k against its parent in link k's
//! axes (one number along the axis of a revolute joint). Attitudes are unit quaternions, Hamilton w, x, y, z;
//! there are no Euler angles anywhere.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};

use hexapod::{BodyParameters, FrameMotion};

use super::{Joint, Suspension, SuspensionError, cross};

/// Places before the joints': s, p, q_P.
pub(super) const PLACES: usize = 10;
/// Rates before the joints': ṡ, ṗ, ω_P.
pub(super) const RATES: usize = 9;

/// A suspension whose springs carry the weight: ready to move.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspended {
    pub(super) made_of: Suspension,
    /// Force of each spring on the platform in the reference pose, upward, N.
    pub(super) preload_n: Vec<f64>,
    /// `R_PL0`.
    pub(super) mount: Matrix3<f64>,
    /// Per joint: the columns of its rate, link's axes, and the first of its rates.
    pub(super) joints: Vec<(Matrix3xX<f64>, usize)>,
    /// Indices of the rates that are free.
    pub(super) free: Vec<usize>,
    /// Number of all rates.
    pub(super) rates: usize,
}

/// A frame's place and rates, how they depend on u, and its accelerations were u̇ = 0; A's axes.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub motion: FrameMotion,
    /// `∂ velocity / ∂ u`.
    pub shift: Matrix3xX<f64>,
    /// `∂ angular rate / ∂ u`.
    pub turn: Matrix3xX<f64>,
}

impl Frame {
    /// Returns a point fixed in the frame: the Jacobian follows `v = v_o + ω × r`.
    fn at(&self, offset: &Vector3<f64>, rotation: &Matrix3<f64>) -> Self {
        let arm = cross(&(self.motion.rotation * offset));
        Self {
            motion: self.motion.fixed_frame(offset, rotation),
            shift: &self.shift - arm * &self.turn,
            turn: self.turn.clone(),
        }
    }

    /// Returns the frame's motion with accelerations for u̇.
    pub fn with(&self, accelerations: &DVector<f64>) -> FrameMotion {
        let mut motion = self.motion;
        motion.acceleration += &self.shift * accelerations;
        motion.angular_acceleration += &self.turn * accelerations;
        motion
    }
}

/// The forces of the springs at one instant, A's axes about P's origin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SpringForces {
    /// Force and moment without loss.
    pub elastic: [Vector3<f64>; 2],
    /// The loss alone.
    pub damping: [Vector3<f64>; 2],
    /// Energy in them, work of the preload included, J.
    pub energy: f64,
}

/// Everything the equations of motion hold at one state.
#[derive(Clone, Debug)]
pub(super) struct Equations {
    /// P, link 0, link 1, …
    pub frames: Vec<Frame>,
    pub springs: SpringForces,
    /// The mass matrix of all rates.
    pub mass: DMatrix<f64>,
    /// Forces without those of the locks, less what u̇ = 0 takes.
    pub force: DVector<f64>,
}

/// Returns the rotation of a quaternion w, x, y, z that need not be quite a unit.
pub(super) fn rotation(q: &[f64]) -> Matrix3<f64> {
    let (w, v) = (q[0], Vector3::new(q[1], q[2], q[3]));
    let square = w * w + v.norm_squared();
    let turn = (w * w - v.norm_squared()) * Matrix3::identity() + 2.0 * (v * v.transpose() + w * cross(&v));
    turn / square
}

/// Returns `a ⊗ b`.
fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

impl Suspended {
    /// Returns what it is made of.
    pub fn suspension(&self) -> &Suspension {
        &self.made_of
    }

    /// Returns the number of places and rates of a state.
    pub(super) fn size(&self) -> (usize, usize) {
        (PLACES + 4 * self.joints.len(), self.rates)
    }

    /// Returns gravity, A's axes, m/s².
    pub(super) fn gravity(&self) -> Vector3<f64> {
        Vector3::new(0.0, 0.0, -self.made_of.gravity_mps2)
    }

    /// Returns the bodies, in the order of the frames: the platform, link 0, link 1, …
    pub(super) fn bodies(&self) -> impl Iterator<Item = &BodyParameters> {
        let s = &self.made_of;
        [&s.platform, &s.base].into_iter().chain(s.links.iter().map(|l| &l.body))
    }

    /// Returns P, link 0, link 1, … at a state.
    pub(super) fn frames(&self, state: &DVector<f64>) -> Vec<Frame> {
        let (places, rates) = self.size();
        let u = state.rows(places, rates);
        let three = |at: usize| Vector3::new(u[at], u[at + 1], u[at + 2]);
        let (mut shift, mut turn) = (Matrix3xX::zeros(rates), Matrix3xX::zeros(rates));
        shift.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
        turn.fixed_view_mut::<3, 3>(0, 6).fill_with_identity();
        let motion = FrameMotion {
            position: Vector3::new(state[3], state[4], state[5]),
            velocity: three(3),
            acceleration: Vector3::zeros(),
            rotation: rotation(&state.as_slice()[6..10]),
            angular_rate: three(6),
            angular_acceleration: Vector3::zeros(),
        };
        let platform = Frame { motion, shift, turn };
        let base = platform.at(&Vector3::from(self.made_of.mount.position_m), &self.mount);
        let mut frames = vec![platform, base];
        for (k, link) in self.made_of.links.iter().enumerate() {
            let (columns, first) = &self.joints[k];
            let q = &state.as_slice()[PLACES + 4 * k..PLACES + 4 * k + 4];
            let mut frame = frames[link.parent + 1].at(&Vector3::from(link.joint_m), &rotation(q));
            // ω = ω_p + R s u, and with u̇ = 0 its derivative gains ω_p × R s u, for R s u turns with the
            // link.
            let axes = frame.motion.rotation * columns;
            let relative = &axes * u.rows(*first, columns.ncols());
            frame.motion.angular_acceleration += frame.motion.angular_rate.cross(&relative);
            frame.motion.angular_rate += relative;
            frame.turn.columns_mut(*first, columns.ncols()).copy_from(&axes);
            frames.push(frame);
        }
        frames
    }

    /// Returns the springs' forces with P as given, the support shifted by `support_m` and moving at
    /// `support_mps`.
    pub(super) fn springs(
        &self,
        platform: &FrameMotion,
        support_m: &Vector3<f64>,
        support_mps: &Vector3<f64>,
    ) -> SpringForces {
        let mut sum = SpringForces::default();
        for (spring, preload) in self.made_of.springs.iter().zip(&self.preload_n) {
            let at = Vector3::from(spring.at_m);
            let anchor = platform.fixed_frame(&at, &Matrix3::identity());
            let (d, rate) = (anchor.position - at - support_m, anchor.velocity - support_mps);
            let axis = Vector3::from(spring.axis).normalize();
            let along = |v: &Vector3<f64>, axial: f64, lateral: f64| {
                lateral * v + (axial - lateral) * axis.dot(v) * axis
            };
            let linear = spring.factor * along(&d, spring.axial_npm, spring.lateral_npm);
            let cubic = spring.cubic_npm3 * d.norm_squared() * d;
            let preload = Vector3::new(0.0, 0.0, *preload);
            let force = preload - linear - cubic;
            let loss = -along(&rate, spring.axial_nspm, spring.lateral_nspm);
            let arm = anchor.position - platform.position;
            sum.elastic[0] += force;
            sum.elastic[1] += arm.cross(&force);
            sum.damping[0] += loss;
            sum.damping[1] += arm.cross(&loss);
            // ∫ (K d + k₃ |d|² d − f0) · dd
            sum.energy += 0.5 * linear.dot(&d) + 0.25 * cubic.dot(&d) - preload.dot(&d);
        }
        sum
    }

    /// Returns the force on the support of all but the platform's springs, and its energy; N, J.
    pub(super) fn under_support(&self, shift: &Vector3<f64>, rate: &Vector3<f64>) -> (Vector3<f64>, f64) {
        let Some(support) = self.made_of.support else { return (Vector3::zeros(), 0.0) };
        let linear = Vector3::from(support.stiffness_npm).component_mul(shift);
        let loss = Vector3::from(support.damping_nspm).component_mul(rate);
        // At rest it carries its weight, and the platform's preload, which its springs press it down with.
        let preload = Vector3::z() * self.preload_n.iter().sum::<f64>();
        (preload - linear - loss, 0.5 * linear.dot(shift) - preload.dot(shift))
    }

    /// Returns where the support is and how it moves.
    pub(super) fn support(&self, state: &DVector<f64>) -> [Vector3<f64>; 2] {
        let places = self.size().0;
        [0, places].map(|at| Vector3::new(state[at], state[at + 1], state[at + 2]))
    }

    /// Returns the equations `M u̇ = force + locks`, by d'Alembert: `M = Σ Jᵀ diag(m, I) J` over the bodies'
    /// centres of mass.
    pub(super) fn equations(&self, state: &DVector<f64>) -> Equations {
        let (places, rates) = self.size();
        let frames = self.frames(state);
        let (mut mass, mut force) = (DMatrix::zeros(rates, rates), DVector::zeros(rates));
        for (body, frame) in self.bodies().zip(&frames) {
            let com = frame.at(&Vector3::from(body.com_m), &Matrix3::identity());
            let motion = &com.motion;
            let inertia = motion.rotation * body.inertia_com() * motion.rotation.transpose();
            mass.gemm_tr(body.mass_kg, &com.shift, &com.shift, 1.0);
            mass.gemm_tr(1.0, &com.turn, &(inertia * &com.turn), 1.0);
            let pull = body.mass_kg * (self.gravity() - motion.acceleration);
            let spin = inertia * motion.angular_acceleration
                + motion.angular_rate.cross(&(inertia * motion.angular_rate));
            force.gemv_tr(1.0, &com.shift, &pull, 1.0);
            force.gemv_tr(-1.0, &com.turn, &spin, 1.0);
        }
        let [shift, rate] = self.support(state);
        let springs = self.springs(&frames[0].motion, &shift, &rate);
        let (under, _) = self.under_support(&shift, &rate);
        let pushed = under - springs.elastic[0] - springs.damping[0];
        for k in 0..3 {
            mass[(k, k)] += self.made_of.support.map_or(0.0, |s| s.mass_kg);
            force[k] += pushed[k];
            force[3 + k] += springs.elastic[0][k] + springs.damping[0][k];
            force[6 + k] += springs.elastic[1][k] + springs.damping[1][k];
        }
        for (link, (columns, first)) in self.made_of.links.iter().zip(&self.joints) {
            for k in *first..first + columns.ncols() {
                force[k] -= link.damping_nmspr * state[places + k];
            }
        }
        Equations { frames, springs, mass, force }
    }

    /// Returns u̇, with zeros where locked; `None` if the mass matrix of what is free is not positive.
    pub(super) fn accelerations(&self, equations: &Equations) -> Option<DVector<f64>> {
        let n = self.free.len();
        let mass = DMatrix::from_fn(n, n, |r, c| equations.mass[(self.free[r], self.free[c])]);
        let force = DVector::from_fn(n, |r, _| equations.force[self.free[r]]);
        let solved = mass.cholesky()?.solve(&force);
        let mut all = DVector::zeros(self.rates);
        for (r, at) in self.free.iter().enumerate() {
            all[*at] = solved[r];
        }
        Some(all)
    }

    /// Returns the derivative of a state: places' by u, and u̇. Infinite where no mass resists.
    pub(super) fn derivative(&self, state: &DVector<f64>) -> DVector<f64> {
        let (places, rates) = self.size();
        let mut out = DVector::zeros(places + rates);
        for k in 0..6 {
            out[k] = state[places + k];
        }
        let quaternion = |at: usize| std::array::from_fn(|k| state[at + k]);
        let u = |at: usize| state[places + at];
        // q̇ = ½ ω ⊗ q with ω in the outer axes, ½ q ⊗ ω with ω in the inner ones.
        let spin = product([0.0, u(6), u(7), u(8)], quaternion(6));
        for k in 0..4 {
            out[6 + k] = 0.5 * spin[k];
        }
        for (j, (columns, first)) in self.joints.iter().enumerate() {
            let rate = columns * state.rows(places + first, columns.ncols());
            let at = PLACES + 4 * j;
            let spin = product(quaternion(at), [0.0, rate.x, rate.y, rate.z]);
            for k in 0..4 {
                out[at + k] = 0.5 * spin[k];
            }
        }
        match self.accelerations(&self.equations(state)) {
            Some(found) => out.rows_mut(places, rates).copy_from(&found),
            None => out.fill(f64::INFINITY),
        }
        out
    }

    /// Returns the columns of a joint's rate in the link's axes.
    pub(super) fn columns(joint: &Joint) -> Matrix3xX<f64> {
        match joint {
            Joint::Spherical => Matrix3xX::identity(3),
            Joint::Revolute { axis } => Matrix3xX::from_columns(&[Vector3::from(*axis).normalize()]),
        }
    }

    /// Refuses a suspension whose free accelerations cannot be found, before anything moves.
    pub(super) fn check_mass(&self, state: &DVector<f64>) -> Result<(), SuspensionError> {
        self.accelerations(&self.equations(state)).map(|_| ()).ok_or(SuspensionError::Massless)
    }
}
