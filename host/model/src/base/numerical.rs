//! Base parameters from random motions.
//!
//! The rows of as many random motions as are needed are reduced by a QR with column pivoting. Before that the
//! model is brought to natural units: its reach is the unit of length, and time is such that gravity is one.
//! So columns of mass, first moment and inertia are of one size whatever the robot's, and the rank can be cut
//! where the diagonal drops most, with nothing but rounding as the scale: ε · max(rows, columns) takes the
//! place of everything below.

use nalgebra::{DMatrix, Vector3};
use rigident_shared::tree::{BaseMotion, Joint, TreeError};

use super::Situation;
use super::qr::Columns;
#[cfg(test)]
use super::qr::dot;
use crate::rows::{Moving, Rows};
use crate::tree::Model;

/// Between what the rank was cut, in natural units, over the largest column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Smallest singular value that counts.
    pub kept: f64,
    /// No singular value that was dropped is larger.
    pub dropped: f64,
}

/// Rows of random motions, column by column, in natural units.
#[derive(Clone, Debug)]
pub struct Sampled {
    matrix: Columns,
    reach: f64,
}

impl Sampled {
    /// Columns of all standard parameters.
    pub fn columns(&self) -> usize {
        self.matrix.columns()
    }

    /// Returns the unit of length.
    pub(super) fn reach(&self) -> f64 {
        self.reach
    }
}

/// Independent columns and how the others depend on them.
#[derive(Clone, Debug)]
pub struct Reduction {
    /// The columns that were examined.
    pub columns: Vec<usize>,
    /// The independent columns, as indices into `columns`.
    pub independent: Vec<usize>,
    /// `Y = Y_independent · map`, SI units: one row for each independent column, one column for each
    /// examined.
    pub map: DMatrix<f64>,
    /// The gap where the rank was cut.
    pub gap: Gap,
}

/// Steele's splitmix64: the same motions in every run.
struct Random(u64);

impl Random {
    /// Returns a number of (−1, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Returns the longest way from the base to a link along the links; 1 if there is none.
fn reach(model: &Model) -> f64 {
    let mut from_base = vec![0.0; model.links.len()];
    for (i, link) in model.links.iter().enumerate().skip(1) {
        from_base[i] = from_base[link.link.parent] + link.link.position.norm();
    }
    let longest = from_base.into_iter().fold(0.0, f64::max);
    if longest > 0.0 { longest } else { 1.0 }
}

/// A joint that follows: its place among the freedoms, its leader's, factor and offset.
type Tie = (usize, usize, f64, f64);

/// Places of first coordinate and first freedom of every link.
fn places(model: &Model) -> Vec<(usize, usize)> {
    let mut at = (0, 0);
    let mut places = vec![(0, 0)];
    for link in model.links.iter().skip(1) {
        places.push(at);
        at = (at.0 + link.link.joint.coordinates(), at.1 + link.link.joint.freedoms());
    }
    places
}

/// Ties by link index, leaders resolved to joints that follow nobody.
fn ties(model: &Model) -> Vec<Tie> {
    let mut ties = Vec::new();
    for (i, link) in model.links.iter().enumerate() {
        let (mut at, mut factor, mut offset) = (i, 1.0, 0.0);
        // q_i = factor · q_at + offset
        while let Some((mimic, leader)) =
            model.links[at].mimic.as_ref().and_then(|m| Some((m, model.joint(&m.leader)?)))
        {
            offset += factor * mimic.offset;
            factor *= mimic.multiplier;
            at = leader;
        }
        if at != i && link.mimic.is_some() {
            ties.push((i, at, factor, offset));
        }
    }
    ties
}

/// Samples the rows of enough random motions. The model has no fixed joints.
///
/// # Errors
/// [`TreeError`] if the links are in no order.
pub fn sample(model: &Model, situation: &Situation) -> Result<Sampled, TreeError> {
    let reach = reach(model);
    let mut links = model.tree();
    for link in &mut links {
        link.position /= reach;
    }
    let mut moving = Moving::new(links)?;
    let (places, ties) = (places(model), if situation.mimic { ties(model) } else { Vec::new() });
    let columns = moving.columns();
    let (with_base, with_joints) = (situation.rows != Rows::Joint, situation.rows != Rows::Base);
    let per_motion = if with_base { 6 } else { 0 } + if with_joints { moving.freedoms() } else { 0 };
    // A fifth more rows than columns, and of joints' rows, which see only what is beyond, twice as many and
    // then some.
    let generous = if with_joints { 2 * columns + 120 } else { columns + columns / 5 + 12 };
    let motions = generous.div_ceil(per_motion.max(1)).max(if with_joints { 24 } else { 2 });
    let rows = motions * per_motion;
    let mut matrix = Columns { rows, data: vec![0.0; rows * columns] };
    // Gravity has the size one; a file may state another direction, or none.
    let down = model.gravity_mps2.map_or([0.0, 0.0, -1.0], |stated| {
        let stated = Vector3::from(stated);
        stated.try_normalize(0.0).unwrap_or_else(Vector3::zeros).into()
    });
    let mut random = Random(1);
    let (mut q, mut v, mut dv) =
        (vec![0.0; moving.coordinates()], vec![0.0; moving.freedoms()], vec![0.0; moving.freedoms()]);
    for motion in 0..motions {
        // Angles over more than a turn, lengths up to the reach; rates and accelerations of the size of
        // gravity's.
        q.iter_mut().for_each(|x| *x = random.next());
        for (link, (at, _)) in model.links.iter().zip(&places).skip(1) {
            if matches!(link.link.joint, Joint::Revolute(_) | Joint::Universal(..)) {
                for k in 0..link.link.joint.coordinates() {
                    q[at + k] *= std::f64::consts::PI;
                }
            }
        }
        v.iter_mut().chain(&mut dv).for_each(|x| *x = 2.0 * random.next());
        for (follower, leader, factor, offset) in &ties {
            let ((fq, fv), (lq, lv)) = (places[*follower], places[*leader]);
            q[fq] = factor * q[lq] + offset;
            (v[fv], dv[fv]) = (factor * v[lv], factor * dv[lv]);
        }
        let mut three = || Vector3::new(random.next(), random.next(), random.next()) * 1.5;
        let base = if situation.floating {
            BaseMotion { specific_force: three(), rate: three(), angular_acceleration: three() }
        } else {
            BaseMotion::still(down)
        };
        moving.set(&q, &v, &dv, &base)?;
        let mut row = motion * per_motion;
        let mut put = |values: &[f64]| {
            for (c, value) in values.iter().enumerate() {
                matrix.data[c * rows + row] = *value;
            }
            row += 1;
        };
        if with_base {
            moving.base_rows()?.chunks_exact(columns).for_each(&mut put);
        }
        if with_joints {
            let mut joints = moving.joint_rows()?.to_vec();
            for (follower, leader, factor, _) in &ties {
                let (from, to) = (places[*follower].1 * columns, places[*leader].1 * columns);
                for c in 0..columns {
                    joints[to + c] += factor * joints[from + c];
                    joints[from + c] = 0.0;
                }
            }
            joints.chunks_exact(columns).for_each(&mut put);
        }
    }
    Ok(Sampled { matrix, reach })
}

impl Reduction {
    /// Reduces some of the columns.
    pub fn of(sampled: &Sampled, columns: &[usize]) -> Self {
        let data = columns.iter().flat_map(|c| sampled.matrix.column(*c).iter().copied()).collect();
        Self::reduce(Columns { rows: sampled.matrix.rows, data }, columns, sampled.reach)
    }

    /// Reduces the columns of combinations `map · φ` of full row rank, of which `Y = Y_combined · map` is
    /// known; `columns[k]` has the unit of the k-th.
    pub fn of_combinations(sampled: &Sampled, map: &DMatrix<f64>, columns: &[usize]) -> Option<Self> {
        let natural = DMatrix::from_fn(map.nrows(), map.ncols(), |row, column| {
            map[(row, column)] * sampled.reach.powi(power(column) - power(columns[row]))
        });
        // Y_combined = Y mapᵀ (map mapᵀ)⁻¹
        let gram = &natural * natural.transpose();
        let all = DMatrix::from_column_slice(sampled.matrix.rows, sampled.columns(), &sampled.matrix.data);
        let combined = gram.cholesky()?.solve(&(natural * all.transpose())).transpose();
        let data = Columns { rows: sampled.matrix.rows, data: combined.as_slice().to_vec() };
        Some(Self::reduce(data, columns, sampled.reach))
    }

    fn reduce(data: Columns, columns: &[usize], reach: f64) -> Self {
        let rows = data.rows;
        let pivoted = data.pivot();
        let rank = rank(&pivoted.diagonal, pivoted.floor, columns.len().min(rows));
        let scale = pivoted.diagonal.first().copied().unwrap_or(1.0);
        let gap = Gap {
            kept: if rank > 0 { pivoted.smallest_singular_value(rank) / scale } else { 0.0 },
            dropped: pivoted.dropped(rank) / scale,
        };
        let mut map = DMatrix::zeros(rank, columns.len());
        // So w_SI = w' ℓ^(power of the independent − of the dependent).
        for (place, k) in pivoted.order.iter().enumerate() {
            if place < rank {
                map[(place, *k)] = 1.0;
                continue;
            }
            let mut weights = pivoted.triangle.column(place)[..rank].to_vec();
            pivoted.solve(&mut weights);
            for (row, weight) in weights.into_iter().enumerate() {
                let powers = power(columns[pivoted.order[row]]) - power(columns[*k]);
                map[(row, *k)] = weight * reach.powi(powers);
            }
        }
        Self { columns: columns.to_vec(), independent: pivoted.order[..rank].to_vec(), map, gap }
    }

    /// Returns how many columns are independent.
    pub fn rank(&self) -> usize {
        self.independent.len()
    }
}

/// Returns the power of length in the unit of a column's parameter. Natural units are
/// `m' = m, mc' = mc/ℓ, I' = I/ℓ²`.
pub(super) fn power(column: usize) -> i32 {
    match column % 10 {
        0 => 0,
        1..=3 => 1,
        _ => 2,
    }
}

/// Returns where the diagonal drops most. What lies below rounding counts as rounding, and so does what comes
/// after the end.
pub(super) fn rank(diagonal: &[f64], floor: f64, most: usize) -> usize {
    let at = |k: usize| diagonal.get(k).copied().unwrap_or(0.0).max(floor);
    let drop = |k: usize| at(k - 1) / at(k);
    (1..=diagonal.len().min(most)).max_by(|a, b| drop(*a).total_cmp(&drop(*b))).unwrap_or(0)
}

/// Returns the largest error of `Y φ = Y_B φ_B` over the sampled rows, relative to Y's largest column.
#[cfg(test)]
pub(super) fn residual(sampled: &Sampled, columns: &[usize], reduction: &Reduction) -> f64 {
    let largest = columns.iter().map(|c| dot(sampled.matrix.column(*c), sampled.matrix.column(*c)).sqrt());
    let scale = largest.fold(0.0, f64::max);
    let mut worst: f64 = 0.0;
    for (k, column) in columns.iter().enumerate() {
        let mut rest = sampled.matrix.column(*column).to_vec();
        for (row, independent) in reduction.independent.iter().enumerate() {
            let powers = power(*column) - power(columns[*independent]);
            let weight = reduction.map[(row, k)] * sampled.reach.powi(powers);
            for (r, y) in rest.iter_mut().zip(sampled.matrix.column(columns[*independent])) {
                *r -= weight * y;
            }
        }
        worst = worst.max(dot(&rest, &rest).sqrt() / scale);
    }
    worst
}
