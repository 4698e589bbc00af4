//! The matrix and its uncertainty from the answers of the bridges.

use nalgebra::{DMatrix, Matrix6};
use rigident_fit::Fit;
use serde::Serialize;

use super::rows::Loadings;

/// A matrix with what is known of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Matrix {
    /// `wrench = matrix · (gauges − zero)`, N/V and N m/V. Not written as it is: it may be too coarse to be
    /// used.
    #[serde(skip)]
    pub matrix: [[f64; 6]; 6],
    /// 95 % expanded uncertainty of its entries.
    #[serde(skip)]
    pub matrix_u95: [[f64; 6]; 6],
    /// 1 σ of each gain, relative.
    #[serde(rename = "gain_uncertainty")]
    pub gain_std: [f64; 6],
    /// Root mean square over all components of 1 σ of the cross-talk, each relative to its own full scale.
    pub crosstalk_std: f64,
    /// U95 of what is read of component k at full scale, row by row, as a share of the component's own full
    /// scale: gains on the
    /// diagonal, cross-talk beside it.
    pub error_u95: [[f64; 6]; 6],
    /// Largest force and moment of the loadings: full scale, N and N m.
    #[serde(rename = "full_scale_n_nm")]
    pub full_scale: [f64; 2],
    /// Zeros of the bridges in each run, V.
    pub zeros_v: Vec<[f64; 6]>,
    /// 1 σ of a mean reading, V: stated, or found.
    #[serde(rename = "reading_std_v")]
    pub reading_v: f64,
    /// Condition number of the bridges' answers to wrenches at full scale: how much of a bridge's error the
    /// matrix enlarges.
    pub condition_number: f64,
    /// The largest residual of all loadings over full scale.
    pub largest_residual: f64,
    /// The residuals of each loading, N and N m, in the order of the table.
    #[serde(rename = "residuals_n_nm")]
    pub residuals: Vec<[f64; 6]>,
}

impl Matrix {
    /// Reads the fit; `None` if the bridges' answers cannot be inverted or were not all determined.
    pub(super) fn new(rows: &Loadings, fit: &Fit, answers: &Matrix6<f64>) -> Option<Self> {
        let (runs, each) = (rows.runs(), rows.runs() + 6);
        let found = fit.estimate.unjudged();
        let place = |bridge: usize, k: usize| each * bridge + runs + k;
        if (0..36).any(|n| !fit.estimate.is_determined(place(n / 6, n % 6))) {
            return None;
        }
        let full_scale = rows.full_scale();
        let scale = |k: usize| full_scale[k / 3];
        let scaled = Matrix6::from_fn(|j, k| answers[(j, k)] * scale(k));
        let singular = scaled.svd(false, false).singular_values;
        let condition_number = singular.max() / singular.min();
        let matrix = answers.try_inverse().filter(|_| condition_number < 1e6)?;
        let places: Vec<usize> = (0..36).map(|n| place(n / 6, n % 6)).collect();
        let covariance = DMatrix::from_fn(36, 36, |a, b| found.covariance[(places[a], places[b])]);
        let sd = |weights: &DMatrix<f64>| (weights.transpose() * &covariance * weights)[0].max(0.0).sqrt();
        let k95 = fit.estimate.coverage_factor();
        // ΔK = −K ΔB K, and what it makes of a wrench: ΔK B = −K ΔB.
        let of_entry =
            |a: usize, b: usize| sd(&DMatrix::from_fn(36, 1, |n, _| matrix[(a, n / 6)] * matrix[(n % 6, b)]));
        let of_wrench = |a: usize, b: usize| {
            let share = scale(b) / scale(a);
            sd(&DMatrix::from_fn(36, 1, |n, _| if n % 6 == b { matrix[(a, n / 6)] * share } else { 0.0 }))
        };
        let error: [[f64; 6]; 6] = std::array::from_fn(|a| std::array::from_fn(|b| of_wrench(a, b)));
        let beside = (0..36).filter(|n| n / 6 != n % 6).map(|n| error[n / 6][n % 6].powi(2)).sum::<f64>();
        let zeros_v: Vec<[f64; 6]> =
            (0..runs).map(|run| std::array::from_fn(|j| found.values[each * j + run])).collect();
        let residuals = residuals(rows, &matrix, answers, &zeros_v);
        let largest = |residual: &[f64; 6]| (0..6).fold(0.0, |l: f64, k| l.max(residual[k].abs() / scale(k)));
        Some(Self {
            matrix: std::array::from_fn(|a| std::array::from_fn(|b| matrix[(a, b)])),
            matrix_u95: std::array::from_fn(|a| std::array::from_fn(|b| k95 * of_entry(a, b))),
            error_u95: error.map(|row| row.map(|sd| k95 * sd)),
            gain_std: std::array::from_fn(|a| error[a][a]),
            crosstalk_std: (beside / 30.0).sqrt(),
            condition_number,
            reading_v: fit.channels.first().map_or(0.0, |channel| channel.sigma),
            largest_residual: residuals.iter().map(largest).fold(0.0, f64::max),
            residuals,
            zeros_v,
            full_scale,
        })
    }

    /// Returns the largest U95 of gain or cross-talk, relative to full scale.
    pub fn worst_u95(&self) -> f64 {
        self.error_u95.iter().flatten().fold(0.0, |largest: f64, u95| largest.max(*u95))
    }
}

/// Returns what each bridge answers to each component, V/N and V/(N m).
pub(super) fn answers(rows: &Loadings, fit: &Fit) -> Matrix6<f64> {
    let (values, runs) = (fit.estimate.unjudged().values, rows.runs());
    Matrix6::from_fn(|j, k| values[(runs + 6) * j + runs + k])
}

/// Returns what is left of each loading, as a wrench.
fn residuals(
    rows: &Loadings,
    matrix: &Matrix6<f64>,
    answers: &Matrix6<f64>,
    zeros_v: &[[f64; 6]],
) -> Vec<[f64; 6]> {
    let of = |(loading, run): (&super::table::Loading, &usize)| {
        let zero = zeros_v.get(*run).copied().unwrap_or_default();
        let wrench = nalgebra::Vector6::from(loading.wrench());
        let read = nalgebra::Vector6::from_fn(|j, _| loading.gauges_v[j] - zero[j]);
        (matrix * (read - answers * wrench)).into()
    };
    rows.loadings().iter().zip(rows.run_of()).map(of).collect()
}
