//! The rows of a model in motion, from numbers for its joints.
//!
//! Coordinates stand in the order of the links: an angle (rad) or length (m) each, two angles for a universal joint, a
//! quaternion w, x, y, z for a spherical one, position and quaternion for a free one. Rates likewise: rad/s or m/s, a
//! spherical joint's angular rate in link axes, a free joint's velocity of the origin and angular rate, in link axes.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use rigident_shared::tree::motion::{self, BaseMotion, LinkState, Screw};
use rigident_shared::tree::rows::{self, Workspace};
use rigident_shared::tree::{Joint, JointMotion, Link, TreeError, momentum};

/// A tree with room for its motion and its rows.
#[derive(Clone, Debug)]
pub struct Moving {
    links: Vec<Link<f64>>,
    motions: Vec<JointMotion<f64>>,
    states: Vec<LinkState<f64>>,
    screws: Vec<Screw<f64>>,
    first: Vec<usize>,
    coordinates: usize,
    base: BaseMotion<f64>,
    base_rows: Vec<f64>,
    joint_rows: Vec<f64>,
    all_rows: Vec<f64>,
}

/// Rows in two parts: what is smoothed, and what is differentiated, by the same filter.
#[derive(Clone, Debug, PartialEq)]
pub struct MomentumRows {
    /// Six base rows, then those of the joints if they were wanted, `10 · links` columns each.
    pub smoothed: Vec<f64>,
    /// The same shape.
    pub differentiated: Vec<f64>,
}

impl Moving {
    /// A tree at rest.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn new(links: Vec<Link<f64>>) -> Result<Self, TreeError> {
        rigident_shared::tree::joint::check(&links)?;
        let freedoms: usize = links.iter().skip(1).map(|l| l.joint.freedoms()).sum();
        let columns = 10 * links.len();
        Ok(Self {
            motions: links.iter().map(JointMotion::rest).collect(),
            states: vec![LinkState::zero(); links.len()],
            screws: vec![Screw { weights: [0.0; 6], changes: [0.0; 6] }; freedoms],
            first: vec![0; links.len() + 1],
            coordinates: links.iter().skip(1).map(|l| l.joint.coordinates()).sum(),
            base: BaseMotion::still([0.0; 3]),
            base_rows: vec![0.0; 6 * columns],
            joint_rows: vec![0.0; freedoms * columns],
            all_rows: vec![0.0; (6 + freedoms) * columns],
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
        for (link, motion) in self.links.iter().zip(&mut self.motions).skip(1) {
            let (own_q, rest_q) = q.split_at(link.joint.coordinates());
            let (own_v, rest_v) = v.split_at(link.joint.freedoms());
            let (own_dv, rest_dv) = dv.split_at(link.joint.freedoms());
            (q, v, dv) = (rest_q, rest_v, rest_dv);
            *motion = joint_motion(link, own_q, own_v, own_dv);
        }
        self.base = *base;
        motion::states(&self.links, &self.motions, base, &mut self.states)
    }

    /// Returns the links.
    pub fn links(&self) -> &[Link<f64>] {
        &self.links
    }

    /// Returns the motion of every link.
    pub fn states(&self) -> &[LinkState<f64>] {
        &self.states
    }

    /// Attitude of link `i`: base axes ← link axes; its origin in the base's frame, m.
    pub fn place(&self, i: usize) -> Option<(Matrix3<f64>, [f64; 3])> {
        self.states.get(i).map(|s| (s.rotation, s.position.into()))
    }

    /// Returns the attitude of link `i`, base axes ← link axes, and its angular rate, link axes, rad/s.
    pub fn turning(&self, i: usize) -> Option<(Matrix3<f64>, Vector3<f64>)> {
        self.states.get(i).map(|s| (s.rotation, s.rotation.tr_mul(&s.rate)))
    }

    /// Brings the joints' screws to the present motion and returns them, about the root's origin in its axes, freedom by freedom.
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

    /// The six base rows, row by row: N, N m on the base in its axes.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn base_rows(&mut self) -> Result<&[f64], TreeError> {
        rows::base_rows(&self.states, &mut self.base_rows)?;
        Ok(&self.base_rows)
    }

    /// The joints' rows, row by row: N m, or N of what slides.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn joint_rows(&mut self) -> Result<&[f64], TreeError> {
        let mut room = Workspace { screws: &mut self.screws, first: &mut self.first };
        rows::joint_rows(&self.links, &self.states, &mut room, &mut self.joint_rows)?;
        Ok(&self.joint_rows)
    }

    /// The six base rows and then the joints', row by row: what a floating base's generalised forces depend on.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn all_rows(&mut self) -> Result<&[f64], TreeError> {
        let mut room = Workspace { screws: &mut self.screws, first: &mut self.first };
        rows::all_rows(&self.links, &self.states, &mut room, &mut self.all_rows)?;
        Ok(&self.all_rows)
    }

    /// Base rows, and joint rows if they are wanted, without accelerations.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn momentum_rows(&mut self, joints: bool) -> Result<MomentumRows, TreeError> {
        let length = (6 + if joints { self.screws.len() } else { 0 }) * self.columns();
        let mut out = MomentumRows { smoothed: vec![0.0; length], differentiated: vec![0.0; length] };
        let (base_s, joints_s) = out.smoothed.split_at_mut(6 * self.columns());
        let (base_d, joints_d) = out.differentiated.split_at_mut(6 * self.columns());
        momentum::base_rows(&self.states, &self.base, base_s, base_d)?;
        if !joints {
            return Ok(out);
        }
        let mut room = Workspace { screws: &mut self.screws, first: &mut self.first };
        momentum::joint_rows(&self.links, &self.states, &self.base, &mut room, joints_s, joints_d)?;
        Ok(out)
    }
}

/// First three of some numbers, zero where there are fewer.
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

/// A joint's motion from its share of the numbers.
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
