//! A loading that contradicts the others.

use std::fmt;

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::rows::Loadings;

/// One table in this many is accused wrongly.
const WRONGLY: f64 = 1e-4;
/// The others agree this many times better without it, or it is one of many that do not quite fit.
const MATTERS: f64 = 1.5;
/// A loading that is off by less than this share of the largest reading is right: rounding is no slip.
const RIGHT: f64 = 1e-6;

/// Why loadings are not used.
#[derive(Clone, Debug, PartialEq)]
pub enum Contradiction {
    /// One loading is off.
    Loading {
        /// Its line in the table.
        line: u64,
        /// The others' scatter with it over that without it.
        times: f64,
    },
    /// An error of loads is much larger than was said.
    Error {
        /// Its name.
        name: String,
        /// The value it would have.
        value: f64,
        /// 1 σ as it was stated.
        sigma: f64,
        /// Its unit.
        unit: String,
    },
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Loading { line, times } => write!(
                f,
                "the loading in line {line} contradicts the others, which agree {times:.0} times better \
                 without it: check its mass, place, direction and readings, or take it out"
            ),
            Self::Error { name, value, sigma, unit } => {
                let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
                write!(
                    f,
                    "the readings contradict the {name}: it would be off by {value:.2e}{unit}, and 1 sigma \
                     of {sigma:.1e}{unit} was stated. Measure it again, or state a larger uncertainty"
                )
            }
        }
    }
}

/// Finds the loading without which the others agree best, if that cannot be chance and matters: an F test
/// over all six bridges, for as many tests as there are loadings.
///
/// Errors of loads are unknowns with what was stated of them, at the bridges' `answers` as they were fitted;
/// `sigma` is 1 σ of a mean reading, V. Without loading i the sum of squares is smaller by
/// `eᵢᵀ (1 − Hᵢᵢ)⁻¹ eᵢ` (Cook and Weisberg, *Residuals and influence in regression*, 1982, section 2.2).
pub(super) fn find(rows: &Loadings, answers: &Matrix6<f64>, sigma: f64) -> Option<Contradiction> {
    let design = rows.design();
    let (count, unknowns) = design.shape();
    let errors = rows.changes();
    let (data, columns) = (6 * count, 6 * unknowns);
    let mut whole = DMatrix::zeros(data + errors.len(), columns + errors.len());
    let mut measured = DVector::zeros(data + errors.len());
    for (i, loading) in rows.loadings().iter().enumerate() {
        for j in 0..6 {
            whole.view_mut((6 * i + j, unknowns * j), (1, unknowns)).copy_from(&(design.row(i) / sigma));
            measured[6 * i + j] = loading.gauges_v[j] / sigma;
        }
        for (k, changes) in errors.iter().enumerate() {
            let change = answers * Vector6::from(changes[i]) / sigma;
            whole.view_mut((6 * i, columns + k), (6, 1)).copy_from(&change);
        }
    }
    (0..errors.len()).for_each(|k| whole[(data + k, columns + k)] = 1.0);
    let free = (data as f64) - (columns as f64) - 6.0;
    let (q, _) = whole.qr().unpack();
    let left = &measured - &q * q.tr_mul(&measured);
    let all = left.norm_squared();
    let share = |i: usize| {
        let own = q.rows(6 * i, 6);
        let residual = left.rows(6 * i, 6);
        let free = DMatrix::identity(6, 6) - own * own.transpose();
        free.cholesky().map_or(0.0, |free| residual.dot(&free.solve(&residual.clone_owned())))
    };
    let (worst, taken) =
        (0..count).map(|i| (i, share(i))).fold((0, 0.0), |best, now| if now.1 > best.1 { now } else { best });
    let rest = (all - taken).max(all * f64::EPSILON);
    let times = (all / rest).sqrt();
    let chance = 1.0 - FisherSnedecor::new(6.0, free).ok()?.cdf((taken / 6.0) / (rest / free));
    let largest = rows.loadings().iter().flat_map(|own| own.gauges_v).fold(0.0, |a: f64, v| a.max(v.abs()));
    if taken.sqrt() * sigma < RIGHT * largest {
        return None;
    }
    let line = rows.loadings().get(worst).map_or(0, |loading| loading.line);
    (chance * (count as f64) < WRONGLY && times > MATTERS).then_some(Contradiction::Loading { line, times })
}
