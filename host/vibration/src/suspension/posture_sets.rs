//! The information of sets of postures, and which posture to take next.
//!
//! Of n links on spherical joints, tensors are determined up to `J_0 + Σ α_j 1, J_j − α_j 1`. In differences
//! and the sum of the Jyy, all but one number of each such link is determined: Φ_s of the vibration paper.
//! The open numbers are bounded (Eq. 19): tensors have no negative moments.

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, UnitQuaternion, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::Body;
use rigident_shared::tree::Joint;
use serde::Serialize;

use super::postures::{PostureSource, base_columns, composite};
use rigident_fit::{Estimate, Factor, Fit, Measured, Parameter};
use rigident_model::Model;
use rigident_model::rows::Moving;

/// Sets of this many postures are gone through one by one; of more only those that begin with the first.
const MOST_IN_SETS: usize = 10;
/// Postures that are tried for the next.
const CANDIDATES: usize = 2000;
/// Steps of bisection to a bound.
const BISECTIONS: usize = 60;
/// Smaller singular values of columns of unit length are none: angles are known to the digits that people
/// write.
pub const RANK: f64 = 1e-6;

/// A quantity of Φ_s.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SubsetValue {
    /// The name of the quantity: `base.MSx`, `base.Jxx-Jyy`, `sum of Jyy`.
    pub name: String,
    /// SI unit in ASCII.
    pub unit: String,
    /// The value of the quantity; `None` if the postures do not determine it.
    #[serde(flatten)]
    pub measured: Option<Measured>,
}

/// Rank and condition of a set of postures.
#[derive(Clone, Debug, PartialEq)]
pub struct PostureSet {
    /// The postures.
    pub postures: Vec<usize>,
    /// Rank over the base parameters.
    pub rank: usize,
    /// Condition number of the whitened rows, columns of unit length, over what they tell.
    pub condition: f64,
}

/// Bounds of what a single link on a spherical joint leaves open: Jyy of the base.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OpenBounds {
    /// The name: `base.Jyy`.
    pub name: String,
    /// Least value, kg m².
    pub least: f64,
    /// Greatest value by Eq. 19, kg m².
    pub most: f64,
    /// Greatest value by all that a leaf of known mass must be, kg m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_of_leaf: Option<f64>,
}

/// The position of a joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stand {
    /// The joint's link.
    pub link: String,
    /// The joint's coordinate, rad or m, or its quaternion w, x, y, z.
    pub stands: Vec<f64>,
}

/// A posture to take next.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextPosture {
    /// The joints.
    pub joints: Vec<Stand>,
    /// Rank of all postures with it.
    pub rank: usize,
    /// Condition with it.
    pub condition: f64,
    /// Mean standard deviation of what is determined, with it by without it; `None` where the rank grows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
}

/// The map from Φ_s, what is left open among it, to the base parameters.
pub struct Subset {
    names: Vec<String>,
    units: Vec<String>,
    map: DMatrix<f64>,
    open: Vec<usize>,
    /// Base and spherical links, by the places of Jxx, Jyy, Jzz.
    tensors: Vec<(String, [usize; 3])>,
}

impl Subset {
    /// Returns the subset of the base parameters of a tree.
    pub fn new(parameters: &[Parameter], model: &Model) -> Self {
        let place = |name: String| parameters.iter().position(|p| p.name == name);
        let tensor = |link: &str| {
            Some([
                place(format!("{link}.Jxx"))?,
                place(format!("{link}.Jyy"))?,
                place(format!("{link}.Jzz"))?,
            ])
        };
        let spherical = model.links.iter().skip(1).filter(|l| matches!(l.link.joint, Joint::Spherical));
        let base = model.links.first();
        let tensors: Vec<(String, [usize; 3])> = base
            .into_iter()
            .chain(spherical)
            .filter_map(|l| Some((l.name.clone(), tensor(&l.name)?)))
            .collect();
        let n = parameters.len();
        let mut names: Vec<String> = parameters.iter().map(|p| p.name.clone()).collect();
        let units = parameters.iter().map(|p| p.unit.clone()).collect();
        let mut map = DMatrix::identity(n, n);
        let mut open = Vec::new();
        for (k, (link, [xx, yy, zz])) in tensors.iter().enumerate() {
            names[*xx] = format!("{link}.Jxx-Jyy");
            names[*zz] = format!("{link}.Jzz-Jyy");
            map[(*xx, *yy)] = 1.0;
            map[(*zz, *yy)] = 1.0;
            if k > 0 {
                open.push(*yy);
            }
        }
        if let Some((_, [xx, yy, zz])) = tensors.first().filter(|_| !open.is_empty()) {
            names[*yy] = "sum of Jyy".to_owned();
            for other in &open {
                for row in [xx, yy, zz] {
                    map[(*row, *other)] = -1.0;
                }
            }
        }
        Self { names, units, map, open, tensors }
    }

    /// Returns the estimate of Φ_s, what is left open among it.
    fn estimate(&self, fit: &Fit) -> Estimate {
        Estimate::new(&self.factor(&fit.scaled_factor()), RANK, 1.0, fit.estimate.noise)
    }

    /// Returns the factor over Φ_s and what is left open among it, of the same rows as that over the base
    /// parameters.
    pub fn factor(&self, over_base: &Factor) -> Factor {
        let sizes = over_base.r().abs() * self.map.abs();
        let least: Vec<f64> = sizes.column_iter().map(|column| RANK * column.norm()).collect();
        over_base.substitute(&self.map).without_columns_below(&least)
    }

    /// Returns the places of what is left open.
    pub fn open(&self) -> &[usize] {
        &self.open
    }

    /// Returns the values of Φ_s, those left out that are open by theory.
    pub fn values(&self, fit: &Fit) -> Vec<SubsetValue> {
        let estimate = self.estimate(fit);
        (0..self.names.len())
            .filter(|k| !self.open.contains(k))
            .map(|k| SubsetValue {
                name: self.names[k].clone(),
                unit: self.units[k].clone(),
                measured: estimate.measured(k),
            })
            .collect()
    }

    /// Returns the bounds of the base's Jyy, of one link on a spherical joint; `mass_kg` is that link's, if
    /// it is known.
    pub fn bounds(&self, fit: &Fit, mass_kg: Option<f64>) -> Option<OpenBounds> {
        let [(base, [xx, yy, zz]), (leaf, [leaf_xx, _, leaf_zz])] = self.tensors.as_slice() else {
            return None;
        };
        let estimate = self.estimate(fit);
        let of = |k: usize| estimate.measured(k).map(|m| m.value);
        let (sum, x, z) = (of(*yy)?, of(*leaf_xx)?, of(*leaf_zz)?);
        let least = (-of(*xx)?).max(-of(*zz)?).max(0.0);
        let most = sum.min(sum + x).min(sum + z);
        let named =
            |name: &str| self.names.iter().position(|own| *own == format!("{leaf}.{name}")).and_then(of);
        let fits = |open: f64, mass: f64| {
            let y = sum - open;
            let ms = [named("MSx")?, named("MSy")?, named("MSz")?];
            let off = [named("Jyz")?, named("Jzx")?, named("Jxy")?];
            let ten = [mass, ms[0], ms[1], ms[2], y + x, y, y + z, off[0], off[1], off[2]];
            let body = InertialParameters::<Body, f64>::from_vector(ten);
            Some(body.is_physically_consistent())
        };
        let most_of_leaf = mass_kg.and_then(|mass| {
            if !fits(least, mass)? {
                return None;
            }
            let (mut low, mut high) = (least, most);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                if fits(middle, mass)? { low = middle } else { high = middle }
            }
            Some(low)
        });
        Some(OpenBounds { name: format!("{base}.Jyy"), least, most, most_of_leaf })
    }
}

/// Returns rank and condition of every set of postures; of many, of those that begin with the first.
pub fn sets(source: &PostureSource) -> Vec<PostureSet> {
    let n = source.names().len();
    let chosen: Vec<Vec<usize>> = match n <= MOST_IN_SETS {
        true => (1_usize..1 << n).map(|bits| (0..n).filter(|k| bits >> k & 1 == 1).collect()).collect(),
        false => (1..=n).map(|k| (0..k).collect()).collect(),
    };
    let mut all: Vec<PostureSet> = chosen
        .into_iter()
        .map(|postures| {
            let (rank, condition) = rank_and_condition(&source.factor(postures.iter().copied()));
            PostureSet { postures, rank, condition }
        })
        .collect();
    all.sort_by(|a, b| a.postures.len().cmp(&b.postures.len()).then(a.postures.cmp(&b.postures)));
    all
}

/// Returns what the errors of each posture have of the variance of what all of them tell, on average: `(C I_k
/// C)_jj / C_jj` with the
/// information I_k of each and the covariance C of all.
pub fn shares(source: &PostureSource, subset: &Subset) -> Vec<f64> {
    let n = source.names().len();
    let solution = subset.factor(&source.factor(0..n)).solve(RANK);
    let determined = |j: &usize| solution.determined[*j] && !subset.open.contains(j);
    let determined: Vec<usize> = (0..subset.names.len()).filter(determined).collect();
    let covariance = solution.covariance.select_rows(&determined).select_columns(&determined);
    let share = |k: usize| {
        let rows = subset.factor(&source.factor([k])).r().select_columns(&determined);
        let taken = rows * &covariance;
        let each = taken.column_iter().enumerate().map(|(j, own)| own.norm_squared() / covariance[(j, j)]);
        each.sum::<f64>() / determined.len().max(1) as f64
    };
    let all: Vec<f64> = (0..n).map(share).collect();
    let whole: f64 = all.iter().sum();
    all.into_iter().map(|own| if whole > 0.0 { own / whole } else { 0.0 }).collect()
}

fn rank_and_condition(factor: &Factor) -> (usize, f64) {
    let singular = factor.r_of_unit_columns().singular_values();
    let most = singular.max();
    let nonzero: Vec<f64> = singular.iter().copied().filter(|s| *s > RANK * most).collect();
    (nonzero.len(), most / nonzero.iter().copied().fold(most, f64::min))
}

/// Returns the posture that tells most with those there are: it raises the rank, else it makes the variance
/// of Φ_s least.
///
/// Postures are spread evenly (J. H. Halton 1960): spherical joints over all attitudes (K. Shoemake 1992),
/// others within half a turn.
pub fn next(source: &PostureSource) -> Option<NextPosture> {
    let model = source.model();
    let mut moving = Moving::new(model.tree()).ok()?;
    let subset = Subset::new(source.parameters(), model);
    let before = source.factor(0..source.names().len());
    let sigma =
        source.sigma().iter().fold([0.0_f64; 10], |all, own| std::array::from_fn(|k| all[k].max(own[k])));
    let (rank_before, _) = rank_and_condition(&before);
    let trace = |factor: &Factor| {
        let solution = subset.factor(factor).solve(RANK);
        let scale =
            |k: usize| if subset.open.contains(&k) { 0.0 } else { solution.covariance[(k, k)].sqrt() };
        (0..subset.names.len()).filter(|k| solution.determined[*k]).map(scale).sum::<f64>()
    };
    let spread = trace(&before);
    let mut best: Option<(usize, f64, NextPosture)> = None;
    for k in 1..=CANDIDATES {
        let joints = spread_stand(model, k);
        let positions: Vec<f64> = joints.iter().flat_map(|own| own.stands.iter().copied()).collect();
        let Ok(whole) = composite(&mut moving, &positions) else { continue };
        let columns = base_columns(source.base(), &whole);
        let white = DMatrix::from_fn(10, columns.ncols(), |i, j| columns[(i, j)] / sigma[i]);
        let mut with = before.clone();
        with.absorb_matrix(&white, &[0.0; 10]);
        let (rank, condition) = rank_and_condition(&with);
        let left = if rank > rank_before { condition } else { trace(&with) };
        let is_better = best.as_ref().is_none_or(|(r, l, _)| rank > *r || (rank == *r && left < *l));
        if is_better {
            let gain = (rank == rank_before).then(|| left / spread);
            best = Some((rank, left, NextPosture { joints, rank, condition, gain }));
        }
    }
    best.map(|(_, _, posture)| posture)
}

/// Returns the k-th of evenly spread postures.
fn spread_stand(model: &Model, k: usize) -> Vec<Stand> {
    let mut base = 1;
    let mut even = || {
        base += 1;
        while (2..base).any(|d| base % d == 0) {
            base += 1;
        }
        halton(k, base)
    };
    let of = |link: &rigident_model::ModelLink| {
        let stands = match link.link.joint {
            Joint::Spherical => {
                let (share, a, b) = (even(), TAU * even(), TAU * even());
                let (near, far) = ((1.0 - share).sqrt(), share.sqrt());
                vec![far * b.cos(), near * a.sin(), near * a.cos(), far * b.sin()]
            }
            Joint::Revolute(_) => vec![PI * (2.0 * even() - 1.0)],
            _ => vec![0.1 * (2.0 * even() - 1.0)],
        };
        Stand { link: link.name.clone(), stands }
    };
    model.links.iter().skip(1).map(of).collect()
}

/// Returns the digits of k to a base, mirrored at the point.
fn halton(mut k: usize, base: usize) -> f64 {
    let (mut value, mut share) = (0.0, 1.0 / base as f64);
    while k > 0 {
        value += share * (k % base) as f64;
        k /= base;
        share /= base as f64;
    }
    value
}

impl Stand {
    /// Returns axis and angle, in degrees, of a joint whose position is a quaternion; `None` if it is not
    /// turned.
    pub fn turn_deg(&self) -> Option<(Vector3<f64>, f64)> {
        let [w, x, y, z] = self.stands.as_slice().try_into().ok()?;
        let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        let (axis, angle) = turn.axis_angle()?;
        Some((axis.into_inner(), angle.to_degrees()))
    }
}
