//! Factors of several runs as one: errors of one rig are one, and runs of one body are compared.

use std::collections::BTreeMap;

use super::error::ModelDifference;
use super::{PoolError, PooledFactor, folding};
use crate::{Factor, Parameter, RigRows};

/// Weights of a sum that differ by less are rounding.
const SAME_WEIGHT: f64 = 1e-9;

impl PooledFactor {
    /// Returns all of them as one. Unless the offsets are shared those of each factor are eliminated first;
    /// the order of the factors does not matter but for rounding. An error that several runs of a rig share
    /// counts once.
    ///
    /// # Errors
    /// [`PoolError`]: the same recording twice, or factors that do not fit.
    pub fn merged(factors: Vec<Self>, shared_offsets: bool) -> Result<Self, PoolError> {
        let several = factors.len() > 1;
        let old = factors.iter().find(|f| f.errors_inside).filter(|_| several);
        if let Some(old) = old {
            return Err(PoolError::Old { name: old.name.clone() });
        }
        let mut factors = factors.into_iter();
        let prepare = |f: Self| if shared_offsets || !several { f } else { f.without_offsets() };
        let mut whole = prepare(factors.next().ok_or(PoolError::Nothing)?);
        if !several {
            return Ok(whole);
        }
        let mut names = vec![whole.name.clone()];
        let known = whole.sources.iter().flat_map(|source| source.fingerprints());
        let mut seen: BTreeMap<u64, usize> = known.map(|fingerprint| (*fingerprint, 0)).collect();
        let mut ranks = whole.rank();
        let mut apart = Apart::default();
        apart.take(&whole.rigs);
        // The same with all that a difference between runs says of errors: to compare the runs.
        let mut compared = whole.rigs.clone();
        for other in factors.map(prepare) {
            if let Some((source, first)) = folding::repeated(&other.sources, &mut seen, names.len()) {
                return Err(PoolError::Repeated {
                    recording: source.in_words(),
                    first: names.get(first).unwrap_or(&other.name).clone(),
                    second: other.name,
                });
            }
            let rigs = other.in_order_of(&whole)?;
            ranks += other.rank();
            apart.take(&rigs);
            for rig in &rigs {
                whole.differing.extend(merge_into(&mut whole.rigs, rig, RigRows::merge_run));
                merge_into(&mut compared, rig, merge_all);
            }
            if !whole.rigs.iter().all(|rig| rig.factor().is_finite()) {
                return Err(PoolError::Overflow { name: other.name });
            }
            whole.differing.extend(other.differing.iter().cloned());
            whole.overlapping.extend(other.overlapping.iter().cloned());
            whole.disagreement += other.disagreement;
            whole.comparisons = whole.comparisons.saturating_add(other.comparisons);
            whole.eliminated = whole.eliminated.saturating_add(other.eliminated);
            whole.rounding = whole.rounding.max(other.rounding);
            whole.sources.extend(other.sources);
            names.push(other.name);
        }
        // `(RᵀR)⁻¹` already counts what the filter takes, so the sum is a χ² as it is.
        let left = own(&compared).residual_sum_of_squares();
        let between = (left - apart.residual_sum_of_squares()).max(0.0);
        whole.disagreement += between;
        if let Some(first) = whole.rigs.first_mut() {
            let squares = first.factor().residual_sum_of_squares();
            *first = first.clone().with_residual(squares + between);
        }
        whole.comparisons = whole.comparisons.saturating_add(ranks.saturating_sub(whole.rank()));
        whole.overlapping.extend(folding::overlapping(&whole.sources));
        for names in [&mut whole.differing, &mut whole.overlapping] {
            names.sort_unstable();
            names.dedup();
        }
        whole.overlapping.truncate(folding::OVERLAPS);
        whole.sources = folding::folded(whole.sources);
        Ok(whole)
    }

    /// Returns its rows with the columns in the order of another's parameters.
    fn in_order_of(&self, first: &Self) -> Result<Vec<RigRows>, PoolError> {
        let difference = || PoolError::Model {
            name: self.name.clone(),
            first: first.name.clone(),
            difference: difference(&first.parameters, &self.parameters),
        };
        let at: Option<Vec<usize>> = if self.parameters.len() == first.parameters.len() {
            first
                .parameters
                .iter()
                .enumerate()
                .map(|(k, wanted)| {
                    let is = |j: &usize| self.parameters.get(*j).is_some_and(|own| is_same(wanted, own));
                    Some(k).filter(is).or_else(|| (0..self.parameters.len()).find(is))
                })
                .collect()
        } else {
            None
        };
        let order =
            at.filter(|_| self.model_fingerprint == first.model_fingerprint).ok_or_else(difference)?;
        let in_order = |rig: &RigRows| if order.is_sorted() { rig.clone() } else { rig.select(&order) };
        Ok(self.rigs.iter().map(in_order).collect())
    }

    /// Returns the rank of what the rows say of the parameters for given errors.
    pub(super) fn rank(&self) -> u64 {
        let n = self.parameters.len();
        let mut own: Vec<Factor> = self.rigs.iter().map(|rig| rig.of_given_errors()).collect();
        let mut all = own.pop().unwrap_or_else(|| Factor::new(n));
        own.iter().for_each(|rig| all.merge(rig));
        rank(&all, self.rounding)
    }
}

/// Sums of squares of factors that are merged, if each had parameters of its own and only the errors of rigs
/// were in common.
#[derive(Default)]
struct Apart {
    rigs: Vec<RigRows>,
    others: f64,
}

impl Apart {
    fn take(&mut self, rigs: &[RigRows]) {
        match rigs {
            [rig] if !rig.errors().is_empty() => {
                merge_into(&mut self.rigs, &rig.of_errors(), merge_all);
            }
            // Rows of several rigs have the parameters in common.
            _ => {
                self.others += own(rigs).residual_sum_of_squares();
            }
        }
    }

    fn residual_sum_of_squares(&self) -> f64 {
        let of_rigs = self.rigs.iter().map(|rig| rig.known().residual_sum_of_squares());
        self.others + of_rigs.sum::<f64>()
    }
}

/// Returns the rows of all rigs over the parameters alone.
pub(super) fn own(rigs: &[RigRows]) -> Factor {
    let mut own = rigs.iter().map(RigRows::own);
    let mut all = own.next().unwrap_or_else(|| Factor::new(0));
    own.for_each(|rig| all.merge(&rig));
    all
}

/// Merges all that rows say, also by their differences.
fn merge_all(rows: &mut RigRows, other: &RigRows) -> Vec<String> {
    rows.merge(other);
    Vec::new()
}

/// Merges rows into those of the rigs that they share errors with, which are one from then on; returns the
/// names of errors of which different things were known.
fn merge_into(
    rigs: &mut Vec<RigRows>,
    rows: &RigRows,
    merge: impl Fn(&mut RigRows, &RigRows) -> Vec<String>,
) -> Vec<String> {
    let (mut own, mut others): (Vec<_>, Vec<_>) =
        rigs.drain(..).partition(|rig| rig.shares_errors_with(rows));
    own.push(rows.clone());
    let mut own = own.into_iter();
    let mut differing = Vec::new();
    if let Some(mut all) = own.next() {
        own.for_each(|rig| differing.extend(merge(&mut all, &rig)));
        others.push(all);
    }
    *rigs = others;
    differing
}

/// Returns true if two parameters are the same quantity.
fn is_same(a: &Parameter, b: &Parameter) -> bool {
    let sorted = |p: &Parameter| {
        let mut terms = p.made_of.clone();
        terms.sort_by(|x, y| x.0.cmp(&y.0));
        terms
    };
    let alike =
        a.name == b.name && a.owner == b.owner && a.kind == b.kind && a.unit == b.unit && a.frame == b.frame;
    if !alike || a.made_of == b.made_of {
        return alike;
    }
    let (x, y) = (sorted(a), sorted(b));
    let largest = x.iter().map(|t| t.1.abs()).fold(1.0, f64::max);
    x.len() == y.len()
        && x.iter().zip(&y).all(|(x, y)| x.0 == y.0 && (x.1 - y.1).abs() <= SAME_WEIGHT * largest)
}

/// The parameters `other` against those of `first`.
pub(crate) fn difference(first: &[Parameter], other: &[Parameter]) -> ModelDifference {
    let by_name = |all: &'_ [Parameter], name: &str| all.iter().position(|p| p.name == name);
    let mut difference = ModelDifference::default();
    for wanted in first {
        match by_name(other, &wanted.name).and_then(|j| other.get(j)) {
            None => difference.missing.push(wanted.name.clone()),
            Some(own) if !is_same(wanted, own) => difference.changed.push(wanted.name.clone()),
            Some(_) => {}
        }
    }
    let foreign = other.iter().filter(|p| by_name(first, &p.name).is_none());
    difference.foreign = foreign.map(|p| p.name.clone()).collect();
    difference
}

/// Returns the rank of the triangle, columns scaled to unit length; less than `rounding` is nothing.
fn rank(factor: &Factor, rounding: f64) -> u64 {
    let n = factor.parameters();
    let r = factor.r_of_unit_columns();
    let rounding = rounding.max(n as f64 * f64::EPSILON);
    if is_well_conditioned(&r, rounding) {
        return n as u64;
    }
    // Bounded: a factor may hold numbers whose squares overflow.
    let Some(svd) = r.try_svd(false, false, f64::EPSILON, 1000) else { return 0 };
    let floor = rounding * svd.singular_values.max();
    svd.singular_values.iter().filter(|v| **v > floor).count() as u64
}

/// Returns true if `‖R‖ ‖R⁻¹‖`, which bounds the ratio of the singular values, is far below that of a
/// singular R.
fn is_well_conditioned(r: &nalgebra::DMatrix<f64>, rounding: f64) -> bool {
    let n = r.nrows();
    if (0..n).any(|j| r[(j, j)] == 0.0) {
        return false;
    }
    let mut inverse = nalgebra::DMatrix::identity(n, n);
    r.solve_upper_triangular_mut(&mut inverse) && r.norm() * inverse.norm() < 0.1 / rounding
}
