//! The budget: what the uncertainty of each quantity is made of (JCGM 100:2008, 5.1 and 8).
//!
//! Noise, each group of errors and what was added after the fit are independent, so that their variances add.
//! An error that is known to ± σ_k beforehand brings `(N⁻¹)_jk/σ_k` to parameter j, N being the normal
//! matrix; what is known of the body takes the same share off all of them: with the covariance Σ before and
//! Σ′ after, `c′ = Σ′ Σ⁻¹ c`. Derived quantities follow to first order.

use nalgebra::{DMatrix, DVector};

use super::derived;
use super::result::{Budget, Contribution};
use rigident_fit::{Basis, Fit, Nuisance};

/// The source that is left when all others are taken off.
const NOISE: &str = "noise";
/// All errors that a calibration of the rig found.
const CALIBRATION: &str = "rig calibration";

/// The source that is stated of the body itself.
const KNOWN: &str = "known beforehand";

/// A source's contributions to the parameters: columns that are independent of each other.
struct Source {
    name: String,
    columns: DMatrix<f64>,
}

/// Returns the budget of mass, centre of mass and tensor about it of one body, or of the parameters of
/// anything else, as far as they are `known`; empty where nothing is known but the factor.
pub(super) fn budget(fit: &Fit, is_body: bool, known: impl Fn(usize) -> bool) -> Vec<Budget> {
    if fit.nuisances.is_empty() && fit.added.is_empty() {
        return Vec::new();
    }
    let sources = sources(fit);
    let of =
        |quantity: &str, unit: &str, weights: &DVector<f64>| split(fit, &sources, quantity, unit, weights);
    let n = fit.parameters.len();
    let unit_vector = |j: usize| DVector::from_fn(n, |i, _| f64::from(u8::from(i == j)));
    if !is_body {
        let all = fit.parameters.iter().enumerate().filter(|(j, _)| known(*j));
        return all.filter_map(|(j, p)| of(&p.name, &p.unit, &unit_vector(j))).collect();
    }
    let mut all: Vec<Budget> =
        known(0).then(|| of("m", "kg", &unit_vector(0))).flatten().into_iter().collect();
    let wide = |row: Vec<f64>| DVector::from_fn(n, |i, _| row.get(i).copied().unwrap_or(0.0));
    if (0..4).all(&known) {
        let rows = derived::centre_of_mass_by_parameters(&fit.estimate);
        all.extend(
            ["com_x", "com_y", "com_z"].iter().zip(rows).filter_map(|(name, row)| of(name, "m", &wide(row))),
        );
    }
    if (0..10).all(&known) {
        let rows = derived::inertia_com_by_parameters(&fit.estimate);
        let names = ["Ixx_com", "Iyy_com", "Izz_com", "Iyz_com", "Izx_com", "Ixy_com"];
        all.extend(names.iter().zip(rows).filter_map(|(name, row)| of(name, "kg m2", &wide(row))));
    }
    all
}

/// Returns the source that an error is counted to: those of a calibration are correlated, and one source
/// between them.
fn group(nuisance: &Nuisance) -> &str {
    match &nuisance.basis {
        Basis::Calibration(_) => CALIBRATION,
        Basis::Stated(_) | Basis::Class(_) => &nuisance.group,
    }
}

fn sources(fit: &Fit) -> Vec<Source> {
    let n = fit.parameters.len();
    // What is known of the body comes last.
    let after = fit.estimate.unjudged().covariance;
    let before = fit.prior.as_ref().map(|prior| prior.data_alone.unjudged().covariance.clone());
    let shrink = before.clone().and_then(|before| Some(after * before.try_inverse()?));
    let shrunk = |columns: DMatrix<f64>| shrink.as_ref().map_or(columns.clone(), |shrink| shrink * &columns);
    let mut all: Vec<Source> = Vec::new();
    let mut groups: Vec<&str> = Vec::new();
    for found in &fit.nuisances {
        let group = group(&found.nuisance);
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    for group in groups {
        let own: Vec<DVector<f64>> = fit
            .nuisances
            .iter()
            .filter(|found| self::group(&found.nuisance) == group)
            .map(|found| DVector::from_fn(n, |j, _| found.contributions.get(j).copied().unwrap_or(0.0)))
            .collect();
        all.push(Source { name: group.to_owned(), columns: shrunk(DMatrix::from_columns(&own)) });
    }
    for (name, covariance) in &fit.added {
        all.push(Source { name: name.clone(), columns: shrunk(root(covariance)) });
    }
    if let Some((shrink, before)) = shrink.as_ref().zip(before) {
        let own = after - shrink * before * shrink.transpose();
        all.push(Source { name: KNOWN.to_owned(), columns: root(&own) });
    }
    all
}

/// Returns B with `B Bᵀ` a covariance.
fn root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = nalgebra::SymmetricEigen::new(covariance.clone());
    &eigen.eigenvectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0).sqrt()))
}

fn split(
    fit: &Fit,
    sources: &[Source],
    quantity: &str,
    unit: &str,
    weights: &DVector<f64>,
) -> Option<Budget> {
    let variance = weights.dot(&(fit.estimate.unjudged().covariance * weights));
    if !variance.is_finite() || variance <= 0.0 {
        return None;
    }
    let of = |source: &Source| source.columns.tr_mul(weights).norm_squared();
    let mut shares: Vec<(&str, f64)> = sources.iter().map(|s| (s.name.as_str(), of(s))).collect();
    let rest = variance - shares.iter().map(|(_, v)| v).sum::<f64>();
    shares.push((NOISE, rest.max(0.0)));
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let contributions = shares.into_iter().filter(|(_, v)| *v > 0.0).map(|(source, v)| Contribution {
        source: source.to_owned(),
        sd: v.sqrt(),
        share: v / variance,
    });
    Some(Budget {
        quantity: quantity.to_owned(),
        unit: unit.to_owned(),
        sd: variance.sqrt(),
        contributions: contributions.collect(),
    })
}

/// Returns what would make the uncertainties smaller, by the source that has the largest share of most of
/// them.
pub(super) fn improvement(budget: &[Budget]) -> Option<String> {
    let mut shares: Vec<(&str, f64)> = Vec::new();
    for contribution in budget.iter().flat_map(|b| &b.contributions) {
        match shares.iter_mut().find(|(name, _)| *name == contribution.source) {
            Some((_, sum)) => *sum += contribution.share,
            None => shares.push((&contribution.source, contribution.share)),
        }
    }
    let (source, sum) = shares.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let share = 100.0 * sum / budget.len() as f64;
    let what = match source {
        NOISE => "record for longer, or move more",
        CALIBRATION => {
            "calibrate the rig with a reference body that is known better, in longer runs, or turned as well"
        }
        "load-cell gain" | "cross-talk" => {
            "run a body of known properties with `calibrate_rig()`, or state what the load cell's \
             calibration says"
        }
        "accelerometer scale"
        | "gyro scale"
        | "gyro rotation"
        | "accelerometer misalignment"
        | "accelerometer bias"
        | "gyro bias" => "calibrate the IMU, or state what its calibration says",
        "lever arm" | "IMU rotation" => "measure where the IMU sits, or state how well that is known",
        KNOWN => "know it better beforehand",
        "fixture" => "record the bare fixture for longer",
        "clocks" => "record all sensors with one clock",
        _ => "state in the rig file how small it is",
    };
    Some(format!("{share:.0} % of the variance, on average, come from {source}: {what}"))
}

#[cfg(test)]
#[path = "budget_tests.rs"]
mod tests;
