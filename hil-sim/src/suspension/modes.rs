//! Stiffness and natural vibration about the rest, joints held.
//!
//! Frequencies and shapes come from differences of the forces in the equations of motion and their mass
//! matrix, so no formula of an estimator is in them.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, SymmetricEigen, Vector3};

use super::dynamics::{RATES, Suspended};
use super::{SuspensionError, cross};

/// A natural vibration of the platform with its joints held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Frequency without damping, Hz.
    pub frequency_hz: f64,
    /// Share of the critical damping, to first order.
    pub damping_ratio: f64,
    /// Shift and turn of P, A's axes, of a vibration whose modal mass is 1 kg (m/√kg, rad/√kg).
    pub shape: [f64; 6],
}

impl Suspended {
    /// Stiffness of the springs alone about the reference pose, without what preload and weight add:
    /// `Σ Gᵀ K G` with `G = [1, −[a]×]`; takes shift and turn of P to force and moment about its origin, A's
    /// axes.
    pub fn spring_stiffness(&self) -> Matrix6<f64> {
        let mut out = Matrix6::zeros();
        for s in &self.made_of.springs {
            let n = Vector3::from(s.axis).normalize();
            let across = s.lateral_npm * Matrix3::identity();
            let k = s.factor * (across + (s.axial_npm - s.lateral_npm) * n * n.transpose());
            let arm = -cross(&Vector3::from(s.at_m));
            let [force, turned] = [k, k * arm];
            let mut add = |r, c, m: Matrix3<f64>| {
                let mut view = out.fixed_view_mut::<3, 3>(r, c);
                view += m;
            };
            add(0, 0, force);
            add(0, 3, turned);
            add(3, 0, arm.transpose() * force);
            add(3, 3, arm.transpose() * turned);
        }
        out
    }

    /// Returns what the preloads add to the stiffness about the reference pose, for they keep their direction
    /// while their anchors turn: `δM = (θ × a) × f0`, so `−Σ [f0]× [a]×` from turns to moments. Symmetric
    /// only together with the weight's part.
    pub fn preload_stiffness(&self) -> Matrix6<f64> {
        let mut out = Matrix6::zeros();
        for (spring, preload) in self.made_of.springs.iter().zip(&self.preload_n) {
            let turned = cross(&Vector3::new(0.0, 0.0, *preload)) * cross(&Vector3::from(spring.at_m));
            let mut view = out.fixed_view_mut::<3, 3>(3, 3);
            view -= turned;
        }
        out
    }

    /// Returns natural vibrations about the rest that the platform finds with the joints held in this
    /// posture, slowest first. A support that is not quite free takes part, and is not in the shapes.
    pub fn modes(&self, joint_wxyz: &[[f64; 4]]) -> Result<Vec<Mode>, SuspensionError> {
        let state = self.resting_state(joint_wxyz)?;
        let rigid = self.rigid();
        let n = rigid.len();
        let stiffness = self.rigid_stiffness(&state);
        let stiffness = 0.5 * (&stiffness + stiffness.transpose());
        let all = self.equations(&state).mass;
        let mass = DMatrix::from_fn(n, n, |r, c| all[(rigid[r], rigid[c])]);
        let lower = mass.cholesky().ok_or(SuspensionError::Massless)?.l();
        // K v = ω² M v becomes L⁻¹ K L⁻ᵀ y = ω² y with v = L⁻ᵀ y.
        let half = lower.solve_lower_triangular(&stiffness).ok_or(SuspensionError::Massless)?;
        let whole = lower.solve_lower_triangular(&half.transpose()).ok_or(SuspensionError::Massless)?;
        let eigen = SymmetricEigen::new(0.5 * (&whole + whole.transpose()));
        let shapes = lower.tr_solve_lower_triangular(&eigen.eigenvectors).ok_or(SuspensionError::Massless)?;
        let damping = self.rigid_damping(&state);
        let mut out = Vec::with_capacity(n);
        for (square, v) in eigen.eigenvalues.iter().zip(shapes.column_iter()) {
            if !(square.is_finite() && *square > 0.0) {
                return Err(SuspensionError::Unstable);
            }
            let mut shape = [0.0; 6];
            for (k, value) in rigid.iter().zip(v.iter()).filter(|(k, _)| **k >= 3) {
                shape[k - 3] = *value;
            }
            let omega = square.sqrt();
            out.push(Mode {
                frequency_hz: omega / std::f64::consts::TAU,
                damping_ratio: v.dot(&(&damping * v)) / (2.0 * omega),
                shape,
            });
        }
        out.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        Ok(out)
    }

    /// Returns `− ∂ force / ∂ rate` of the free rigid coordinates at rest, by central differences.
    fn rigid_damping(&self, state: &DVector<f64>) -> DMatrix<f64> {
        const RATE: f64 = 1e-3;
        let (places, _) = self.size();
        let rigid = self.rigid();
        debug_assert!(rigid.iter().all(|k| *k < RATES));
        let force = |k: usize, u: f64| {
            let mut moving = state.clone();
            moving[places + k] += u;
            self.equations(&moving).force
        };
        let mut out = DMatrix::zeros(rigid.len(), rigid.len());
        for (c, k) in rigid.iter().enumerate() {
            let slope = (force(*k, -RATE) - force(*k, RATE)) / (2.0 * RATE);
            for (r, at) in rigid.iter().enumerate() {
                out[(r, c)] = slope[*at];
            }
        }
        out
    }
}
