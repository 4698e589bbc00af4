//! How zeros of force plates that are not known move the parameters.
//!
//! Rows do not tell such a zero: what people's soft parts and markers leave would be taken for it, and a long trial would tell
//! it surely and wrongly. The parameters are found as if zeros were those that were recorded. A zero moves a motion's own estimate by
//! `X = (AᵀWA)⁺ AᵀW Z`, Z its wrench in the rows, and that of several motions with factors R and the table's Σ by
//! `J = (Σ⁻¹ + Σₖ RₖᵀRₖ)⁻¹ Σₖ RₖᵀRₖ Xₖ`; their covariance grows by `J σ² Jᵀ`.

use nalgebra::DMatrix;

use super::error::StudyError;
use super::motion::Motion;
use crate::problem::person::Person;
use crate::problem::tree::{UnknownZero, with_wrenches};
use rigident_fit::{Factor, RowSource as _, Silent, parallel, plain_factor};

/// What zeros of all trials do to estimates.
#[derive(Default)]
pub(super) struct Zeros {
    /// How many there are.
    count: usize,
    /// `X σ` of each motion: the first of its trial's zeros, and a column for each of these.
    moved: Vec<(usize, DMatrix<f64>)>,
}

impl Zeros {
    /// Returns the zeros of a person's motions over `n` parameters.
    ///
    /// # Errors
    /// [`StudyError`] if a motion has no rows.
    pub(super) fn of(person: &Person, motions: &[Motion], n: usize) -> Result<Self, StudyError> {
        let mut first = vec![0];
        first.extend(person.trials.iter().scan(0, |sum, tracked| {
            *sum += 6 * tracked.unzeroed.len();
            Some(*sum)
        }));
        let count = first.last().copied().unwrap_or(0);
        let moved = parallel::map(parallel::threads(), motions.len(), |k| -> Result<_, StudyError> {
            let motion = &motions[k];
            let unzeroed = person.trials.get(motion.trial).map_or(&[][..], |tracked| &tracked.unzeroed);
            let columns = own_columns(person, motion, unzeroed, n)?;
            Ok((first.get(motion.trial).copied().unwrap_or(0), columns))
        });
        Ok(Self { count, moved: moved.into_iter().collect::<Result<_, _>>()? })
    }

    /// Returns `J σ` of some motions together with what is known of the parameters: one column a zero.
    pub(super) fn moved(&self, motions: &[Motion], which: &[usize], known: &Factor) -> DMatrix<f64> {
        let n = known.parameters();
        if self.count == 0 {
            return DMatrix::zeros(n, 0);
        }
        let mut all = known.clone();
        let mut sum = DMatrix::zeros(n, self.count);
        for (motion, (first, columns)) in
            which.iter().filter_map(|k| Some((motions.get(*k)?, self.moved.get(*k)?)))
        {
            let rows = motion.pooled.factor();
            let r = rows.r();
            all.merge(&rows);
            let mut own = sum.columns_mut(*first, columns.ncols());
            own += r.transpose() * (&r * columns);
        }
        let r = all.r();
        let solved = r.tr_solve_upper_triangular(&sum).and_then(|half| r.solve_upper_triangular(&half));
        solved.unwrap_or(sum)
    }
}

/// `X σ` of a motion.
fn own_columns(
    person: &Person,
    motion: &Motion,
    unzeroed: &[UnknownZero],
    n: usize,
) -> Result<DMatrix<f64>, StudyError> {
    let wrenches: Vec<[f64; 6]> = unzeroed.iter().flat_map(UnknownZero::wrenches).collect();
    let mut columns = DMatrix::zeros(n, wrenches.len());
    if wrenches.is_empty() {
        return Ok(columns);
    }
    let source = motion.source(person)?;
    let wide = with_wrenches(&source, wrenches.len(), |_| wrenches.clone());
    let r = plain_factor(&wide, &motion.sigma, &Silent)?.r();
    let [own, zeros] =
        [0..n, n..n + wrenches.len()].map(|columns| r.columns_range(columns).rows(0, n).into_owned());
    let sigma = unzeroed.iter().flat_map(UnknownZero::sigmas);
    for ((mut to, zero), sigma) in columns.column_iter_mut().zip(zeros.column_iter()).zip(sigma) {
        let mut factor = Factor::new(n);
        factor.absorb_matrix(&own, zero.as_slice());
        to.copy_from_slice(&factor.solve(source.rounding()).estimate);
        to *= sigma;
    }
    Ok(columns)
}
