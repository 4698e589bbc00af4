//! The way the springs carry the weight: preloads, and the rest that a posture finds.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};

use super::dynamics::{PLACES, RATES, Suspended, rotation};
use super::{Start, Suspension, SuspensionError};

/// A shift or turn of which forces' differences are taken, m and rad. Truncation is its square, rounding
/// `ε · 1000 N / 1e-5 m = 2e-8 N/m`.
const STEP: f64 = 1e-5;

impl Suspension {
    /// Returns the suspension with springs that carry the weight: upright preloads, of least norm, that make
    /// the reference pose with the joints in this posture (parent's axes ← link's axes, w, x, y, z, in the
    /// order of the links) a rest.
    pub fn at_rest(&self, joint_wxyz: &[[f64; 4]]) -> Result<Suspended, SuspensionError> {
        self.check()?;
        let mut joints: Vec<(Matrix3xX<f64>, usize)> = Vec::new();
        let mut rates = RATES;
        for link in &self.links {
            let columns = Suspended::columns(&link.joint);
            let first = rates;
            rates += columns.ncols();
            joints.push((columns, first));
        }
        let mut free: Vec<usize> = Vec::new();
        if self.support.is_some() {
            free.extend(0..3);
        }
        free.extend((0..6).filter(|k| !self.locked[*k]).map(|k| 3 + k));
        for ((columns, first), link) in joints.iter().zip(&self.links) {
            if !link.locked {
                free.extend(*first..first + columns.ncols());
            }
        }
        let mut found = Suspended {
            made_of: self.clone(),
            preload_n: vec![0.0; self.springs.len()],
            mount: self.mount.rotation().unwrap_or_else(Matrix3::identity),
            joints,
            free,
            rates,
        };
        let state = found.state(&Start::resting(joint_wxyz))?;
        found.preload_n = found.carrying(&state)?;
        found.check_mass(&state)?;
        Ok(found)
    }
}

impl Suspended {
    /// Preloads that carry the weight in a state: the least norm that satisfies `Σ f = W`,
    /// `Σ a × f z = moment of W`.
    fn carrying(&self, state: &DVector<f64>) -> Result<Vec<f64>, SuspensionError> {
        let (mut weight, mut moment) = (0.0, Vector3::zeros());
        for (body, frame) in self.bodies().zip(self.frames(state)) {
            let pull = body.mass_kg * self.made_of.gravity_mps2;
            let com = frame.motion.position + frame.motion.rotation * Vector3::from(body.com_m);
            weight += pull;
            moment += com.cross(&Vector3::new(0.0, 0.0, pull));
        }
        let springs = &self.made_of.springs;
        let arms =
            DMatrix::from_fn(3, springs.len(), |r, c| [1.0, springs[c].at_m[1], -springs[c].at_m[0]][r]);
        let wanted = DVector::from_vec(vec![weight, moment.x, moment.y]);
        if springs.is_empty() {
            return Err(SuspensionError::NoPreload { moment_nm: weight });
        }
        let preload = arms.clone().svd(true, true).solve(&wanted, 1e-9).unwrap_or_else(|_| wanted.clone());
        let left = (arms * &preload - &wanted).amax();
        if left <= 1e-9 * weight.abs() {
            Ok(preload.as_slice().to_vec())
        } else {
            Err(SuspensionError::NoPreload { moment_nm: left })
        }
    }

    /// Preloads of the springs in the reference pose, upward, N.
    pub fn preload_n(&self) -> &[f64] {
        &self.preload_n
    }

    /// Returns the platform with other preloads, upward, N, one for each spring: of a spring that has
    /// settled, say.
    pub fn with_preload_n(mut self, preload_n: &[f64]) -> Result<Self, SuspensionError> {
        if preload_n.len() != self.preload_n.len() || preload_n.iter().any(|f| !f.is_finite()) {
            return Err(SuspensionError::Figure { what: "the preload".to_string() });
        }
        self.preload_n = preload_n.to_vec();
        Ok(self)
    }

    /// Returns a state of places and rates.
    pub(super) fn state(&self, start: &Start) -> Result<DVector<f64>, SuspensionError> {
        let figure = |what: String| SuspensionError::Figure { what };
        let links = self.joints.len();
        if start.joint_wxyz.len() != links || start.joint_rate_radps.len() != links {
            let given = start.joint_wxyz.len().min(start.joint_rate_radps.len());
            return Err(SuspensionError::Joints { given, links });
        }
        let (places, rates) = self.size();
        let mut state = DVector::zeros(places + rates);
        let unit = |q: &[f64; 4], what: String| {
            let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            if norm.is_finite() && norm > 0.0 { Ok(q.map(|v| v / norm)) } else { Err(figure(what)) }
        };
        for k in 0..3 {
            state[k] = start.support_m[k];
            state[3 + k] = start.position_m[k];
            state[places + 3 + k] = start.velocity_mps[k];
            state[places + 6 + k] = start.rate_radps[k];
        }
        let attitude = unit(&start.rotation_wxyz, "the platform's attitude".to_string())?;
        state.rows_mut(6, 4).copy_from_slice(&attitude);
        for (k, (columns, first)) in self.joints.iter().enumerate() {
            let q = unit(&start.joint_wxyz[k], format!("the rotation of joint {}", k + 1))?;
            let rate = Vector3::from(start.joint_rate_radps[k]);
            let vector = Vector3::new(q[1], q[2], q[3]);
            // What a revolute joint cannot do is what its axis leaves of the quaternion's vector and of the
            // rate.
            let beside = |v: &Vector3<f64>| (v - columns * columns.tr_mul(v)).norm();
            if columns.ncols() < 3 && (beside(&vector) > 1e-9 || beside(&rate) > 1e-9 * (1.0 + rate.norm())) {
                return Err(SuspensionError::OffAxis { link: k + 1 });
            }
            state.rows_mut(PLACES + 4 * k, 4).copy_from_slice(&q);
            state.rows_mut(places + first, columns.ncols()).copy_from(&columns.tr_mul(&rate));
        }
        if state.iter().any(|v| !v.is_finite()) {
            return Err(figure("the start".to_string()));
        }
        if self.made_of.support.is_none() && start.support_m != [0.0; 3] {
            return Err(figure("a shift of a support that is not there".to_string()));
        }
        match (0..rates).find(|k| state[places + k] != 0.0 && !self.free.contains(k)) {
            Some(k) if k < RATES => {
                Err(SuspensionError::LockedMoves { what: format!("coordinate {} of the platform", k - 3) })
            }
            Some(_) => Err(SuspensionError::LockedMoves { what: "a joint".to_string() }),
            None => Ok(state),
        }
    }

    /// Indices of the free rates of support and platform.
    pub(super) fn rigid(&self) -> Vec<usize> {
        self.free.iter().copied().filter(|k| *k < RATES).collect()
    }

    /// Returns a state with support and platform shifted, and the platform turned about A's axes, by `by`
    /// along the rigid rates.
    fn displaced(&self, state: &DVector<f64>, by: &[(usize, f64)]) -> DVector<f64> {
        let mut out = state.clone();
        let mut turn = Vector3::zeros();
        for (k, much) in by {
            if *k < 6 { out[*k] += much } else { turn[k - 6] += much }
        }
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(turn);
        let old = nalgebra::Quaternion::new(state[6], state[7], state[8], state[9]);
        let new = turn.quaternion() * old;
        out.rows_mut(6, 4).copy_from_slice(&[new.w, new.i, new.j, new.k]);
        out
    }

    /// Returns `− ∂ force / ∂ place` of the free rigid coordinates, joints held, by central differences.
    pub(super) fn rigid_stiffness(&self, state: &DVector<f64>) -> DMatrix<f64> {
        let rigid = self.rigid();
        let force = |k: usize, h: f64| self.equations(&self.displaced(state, &[(k, h)])).force;
        let mut out = DMatrix::zeros(rigid.len(), rigid.len());
        for (c, k) in rigid.iter().enumerate() {
            let slope = (force(*k, -STEP) - force(*k, STEP)) / (2.0 * STEP);
            for (r, at) in rigid.iter().enumerate() {
                out[(r, c)] = slope[*at];
            }
        }
        out
    }

    /// Returns where support and platform rest with the joints held in this posture: Newton's steps from the
    /// reference pose.
    pub(super) fn resting_state(&self, joint_wxyz: &[[f64; 4]]) -> Result<DVector<f64>, SuspensionError> {
        let mut state = self.state(&Start::resting(joint_wxyz))?;
        let rigid = self.rigid();
        for _ in 0..20 {
            let force = self.equations(&state).force;
            let force = DVector::from_fn(rigid.len(), |r, _| force[rigid[r]]);
            let step = self.rigid_stiffness(&state).lu().solve(&force).ok_or(SuspensionError::Unstable)?;
            let small = step.amax() < 1e-13;
            // Far from rest a whole step may overshoot.
            let step = step.map(|s| s.clamp(-0.1, 0.1));
            let by: Vec<(usize, f64)> = rigid.iter().copied().zip(step.iter().copied()).collect();
            state = self.displaced(&state, &by);
            if small {
                break;
            }
        }
        if state.iter().all(|v| v.is_finite()) { Ok(state) } else { Err(SuspensionError::Unstable) }
    }

    /// Returns the start at rest where the platform finds its own with the joints held in this posture.
    pub fn resting(&self, joint_wxyz: &[[f64; 4]]) -> Result<Start, SuspensionError> {
        let state = self.resting_state(joint_wxyz)?;
        let q = nalgebra::Rotation3::from_matrix_unchecked(rotation(&state.as_slice()[6..10]));
        let matrix = q.into_inner();
        Ok(Start {
            position_m: [state[3], state[4], state[5]],
            rotation_wxyz: crate::links::quaternion(&matrix),
            support_m: [state[0], state[1], state[2]],
            ..Start::resting(joint_wxyz)
        })
    }
}
