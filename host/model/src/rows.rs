//! The rows of a model in motion, from numbers for its joints.
//!
//! Coordinates are in the order of the links: an angle (rad) or length (m) each, two angles for a universal
//! joint, a quaternion w, x, y, z for a spherical one, position and quaternion for a free one. Rates
//! likewise: rad/s or m/s, a spherical joint's angular rate in link axes, a free joint's velocity of the
//! origin and angular rate, in link axes.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use rigident_shared::tree::motion::{self, BaseMotion, LinkState, Screw};
use rigident_shared::tree::rows::{self, Workspace};
use rigident_shared::tree::{Joint, JointMotion, Link, TreeError, momentum};

/// Rows that are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rows {
    /// Six of the base link.
    Base,
    /// One for each freedom of a joint.
    Joint,
    /// Both.
    Both,
}

/// A tree with room for its motion and its rows.
#[derive(Clone, Debug)]
pub struct Moving {
    links: Vec<Link<f64>>,
    states: Vec<LinkState<f64>>,
    screws: Vec<Screw<f64>>,
    first: Vec<usize>,
    coordinates: usize,
    base: BaseMotion<f64>,
    base_rows: Vec<f64>,
    joint_rows: Vec<f64>,
    all_rows: Vec<f64>,
    momentum: MomentumRows,
}

/// Rows in two parts: what is smoothed, and what is differentiated, by the same filter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MomentumRows {
    /// Six base rows, then those of the joints, `10 · links` columns each.
    pub smoothed: Vec<f64>,
    /// Six base rows, then those of the joints, in the shape of `smoothed`.
    pub differentiated: Vec<f64>,
}

impl Moving {
    /// Returns a tree at rest.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn new(links: Vec<Link<f64>>) -> Result<Self, TreeError> {
        rigident_shared::tree::joint::check(&links)?;
        let freedoms: usize = links.iter().skip(1).map(|l| l.joint.freedoms()).sum();
        let columns = 10 * links.len();
        Ok(Self {
            states: vec![LinkState::zero(); links.len()],
            screws: vec![Screw { weights: [0.0; 6], changes: [0.0; 6] }; freedoms],
            first: vec![0; links.len() + 1],
            coordinates: links.iter().skip(1).map(|l| l.joint.coordinates()).sum(),
            base: BaseMotion::still([0.0; 3]),
            base_rows: vec![0.0; 6 * columns],
            joint_rows: vec![0.0; freedoms * columns],
            all_rows: vec![0.0; (6 + freedoms) * columns],
            momentum: MomentumRows::default(),
            links,
        })
    }

    /// Columns of every row: ten for each link.
    pub fn columns(&self) -> usize {
        10 * self.links.len()
    }

    /// Rates of all joints.
    pub fn freedoms(&self) -> usize {
        self.screws.len()
    }

    /// Positions of all joints.
    pub fn coordinates(&self) -> usize {
        self.coordinates
    }

    /// Brings every joint to a position, rate and acceleration, and the base to a motion.
    ///
    /// # Errors
    /// [`TreeError::Lengths`] if the numbers are too many or too few.
    pub fn set(
        &mut self,
        positions: &[f64],
        rates: &[f64],
        accelerations: &[f64],
        base: &BaseMotion<f64>,
    ) -> Result<(), TreeError> {
        if positions.len() != self.coordinates
            || rates.len() != self.screws.len()
            || accelerations.len() != self.screws.len()
        {
            return Err(TreeError::Lengths);
        }
        let (mut q, mut v, mut dv) = (positions, rates, accelerations);
        self.base = *base;
        if let Some(root) = self.states.first_mut() {
            *root = LinkState {
                rate: base.rate,
                angular_acceleration: base.angular_acceleration,
                specific_force: base.specific_force,
                ..LinkState::zero()
            };
        }
        for (i, link) in self.links.iter().enumerate().skip(1) {
            let (own_q, rest_q) = q.split_at(link.joint.coordinates());
            let (own_v, rest_v) = v.split_at(link.joint.freedoms());
            let (own_dv, rest_dv) = dv.split_at(link.joint.freedoms());
            (q, v, dv) = (rest_q, rest_v, rest_dv);
            let (before, rest) = self.states.split_at_mut(i);
            let (Some(parent), Some(state)) = (before.get(link.parent), rest.first_mut()) else {
                return Err(TreeError::Order(i));
            };
            // Most joints turn: their motion goes on into the state at once.
            if let (Joint::Revolute(axis), [q], [v], [dv]) = (&link.joint, own_q, own_v, own_dv) {
                motion::step_turning(parent, &JointMotion::revolute(link, axis, q.sin_cos(), *v, *dv), state);
            } else {
                motion::step(parent, &joint_motion(link, own_q, own_v, own_dv), state);
            }
        }
        Ok(())
    }

    /// Returns the links.
    pub fn links(&self) -> &[Link<f64>] {
        &self.links
    }

    /// Returns the motion of every link.
    pub fn states(&self) -> &[LinkState<f64>] {
        &self.states
    }

    /// Returns the attitude of link `i`, base axes ← link axes, and its origin in the base's frame, m.
    pub fn place(&self, i: usize) -> Option<(Matrix3<f64>, [f64; 3])> {
        self.states.get(i).map(|s| (s.rotation, s.position.into()))
    }

    /// Returns the attitude of link `i`, base axes ← link axes, and its angular rate, link axes, rad/s.
    pub fn turning(&self, i: usize) -> Option<(Matrix3<f64>, Vector3<f64>)> {
        self.states.get(i).map(|s| (s.rotation, s.rotation.tr_mul(&s.rate)))
    }

    /// Brings the joints' screws to the present motion and returns them, about the root's origin in its axes,
    /// freedom by freedom.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn screws(&mut self) -> Result<&[Screw<f64>], TreeError> {
        Workspace { screws: &mut self.screws, first: &mut self.first }.fill(&self.links, &self.states)?;
        Ok(&self.screws)
    }

    /// Returns the freedoms between link `i` and the root, by their numbers.
    pub fn freedoms_above(&self, i: usize) -> Vec<usize> {
        let mut first: Vec<usize> = vec![0, 0];
        for link in self.links.iter().skip(1) {
            first.push(first.last().copied().unwrap_or(0) + link.joint.freedoms());
        }
        let (mut above, mut at) = (Vec::new(), i);
        while let (true, Some(link)) = (at > 0, self.links.get(at)) {
            above.extend(first[at]..first[at + 1]);
            at = link.parent;
        }
        above
    }

    /// Returns the six base rows, row by row: N, N m on the base in its axes.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn base_rows(&mut self) -> Result<&[f64], TreeError> {
        self.make(Rows::Base)?;
        Ok(&self.base_rows)
    }

    /// Returns the joints' rows, row by row: N m, or N of what slides.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn joint_rows(&mut self) -> Result<&[f64], TreeError> {
        self.make(Rows::Joint)?;
        Ok(&self.joint_rows)
    }

    /// Returns the six base rows and then the joints', row by row: a floating base's generalised forces
    /// depend on all of them.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn all_rows(&mut self) -> Result<&[f64], TreeError> {
        self.make(Rows::Both)?;
        Ok(&self.all_rows)
    }

    fn make(&mut self, wanted: Rows) -> Result<(), TreeError> {
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx2") {
            // SAFETY: this processor has AVX2.
            return unsafe { self.make_by_avx2(wanted) };
        }
        self.make_by_any(wanted)
    }

    /// Makes rows as [`Moving::make_by_any`] does, by the same operations on four numbers at once: the same
    /// bits.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn make_by_avx2(&mut self, wanted: Rows) -> Result<(), TreeError> {
        self.make_by_any(wanted)
    }

    #[inline(always)]
    fn make_by_any(&mut self, wanted: Rows) -> Result<(), TreeError> {
        let mut room = Workspace { screws: &mut self.screws, first: &mut self.first };
        match wanted {
            Rows::Base => rows::base_rows(&self.states, &mut self.base_rows),
            Rows::Joint => rows::joint_rows(&self.links, &self.states, &mut room, &mut self.joint_rows),
            Rows::Both => rows::all_rows(&self.links, &self.states, &mut room, &mut self.all_rows),
        }
    }

    /// Returns the six base rows and then the joints', as far as they are wanted, without accelerations; the
    /// others are zero, or those that were [given back](Moving::give_back).
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn momentum_rows(&mut self, wanted: Rows) -> Result<MomentumRows, TreeError> {
        let length = (6 + self.screws.len()) * self.columns();
        let mut out = std::mem::take(&mut self.momentum);
        out.smoothed.resize(length, 0.0);
        out.differentiated.resize(length, 0.0);
        let (base_s, joints_s) = out.smoothed.split_at_mut(6 * self.columns());
        let (base_d, joints_d) = out.differentiated.split_at_mut(6 * self.columns());
        if wanted != Rows::Joint {
            momentum::base_rows(&self.states, &self.base, base_s, base_d)?;
        }
        if wanted != Rows::Base {
            let mut room = Workspace { screws: &mut self.screws, first: &mut self.first };
            momentum::joint_rows(&self.links, &self.states, &self.base, &mut room, joints_s, joints_d)?;
        }
        Ok(out)
    }

    /// Takes rows of [`Moving::momentum_rows`] back, whose room serves for the next ones. Entries of links
    /// that are not beyond a joint must be zero as they were.
    pub fn give_back(&mut self, rows: MomentumRows) {
        self.momentum = rows;
    }
}

/// Returns first three of some numbers, zero where there are fewer.
fn three(v: &[f64], from: usize) -> [f64; 3] {
    std::array::from_fn(|k| v.get(from + k).copied().unwrap_or(0.0))
}

fn matrix(q: &[f64]) -> Matrix3<f64> {
    match q {
        [w, x, y, z] => {
            UnitQuaternion::from_quaternion(Quaternion::new(*w, *x, *y, *z)).to_rotation_matrix().into_inner()
        }
        _ => Matrix3::identity(),
    }
}

/// Returns a joint's motion from its share of the numbers.
#[inline(always)]
fn joint_motion(link: &Link<f64>, q: &[f64], v: &[f64], dv: &[f64]) -> JointMotion<f64> {
    match (&link.joint, q, v, dv) {
        (Joint::Revolute(axis), [q], [v], [dv]) => JointMotion::revolute(link, axis, q.sin_cos(), *v, *dv),
        (Joint::Prismatic(axis), [q], [v], [dv]) => JointMotion::prismatic(link, axis, *q, *v, *dv),
        (Joint::Universal(a, b), [qa, qb], [va, vb], [da, db]) => {
            JointMotion::universal(link, [a, b], [qa.sin_cos(), qb.sin_cos()], [*va, *vb], [*da, *db])
        }
        (Joint::Spherical, q, v, dv) => JointMotion::spherical(link, &matrix(q), three(v, 0), three(dv, 0)),
        (Joint::Free, q, v, dv) => JointMotion::free(
            link,
            three(q, 0),
            &matrix(q.get(3..).unwrap_or_default()),
            [three(v, 0), three(v, 3)],
            [three(dv, 0), three(dv, 3)],
        ),
        _ => JointMotion::rest(link),
    }
}
