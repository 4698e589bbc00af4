//! The centre of mass from still readings, in three ways, and what each is worth.
//!
//! 1. The thesis': the measured forces are the regressor, `M = r × F`. Their noise acts through the lever r,
//!    and an offset of the load cell is an error.
//! 2. Relative, the thesis' way out of the offsets: forces and moments less those of a reference orientation.
//! 3. Modelled: gravity in the load cell's axes is known from the attitude, the offsets are parameters. What
//!    `rigident identify` does.

use nalgebra::{Matrix3, SMatrix, Vector3};
use rigident_shared::factor::InformationFactor;

/// Mass, first moment, offset of the wrench.
pub const MODELLED_PARAMETERS: usize = 10;

/// A still reading, all in the load cell's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StillReading {
    /// Specific force, which is g upwards, m/s².
    pub specific_force: Vector3<f64>,
    /// Force on the body, N.
    pub force: Vector3<f64>,
    /// Moment on the body about the load cell's origin, N m.
    pub moment: Vector3<f64>,
}

/// Returns `[F]` of the thesis: `[F] r = r × F`.
fn lever_matrix(force: &Vector3<f64>) -> Matrix3<f64> {
    -force.cross_matrix()
}

/// Returns `r = (Σ [F]ᵀ[F])⁻¹ Σ [F]ᵀ M` from forces and moments; `None` where they leave it open.
fn least_squares(pairs: impl Iterator<Item = (Vector3<f64>, Vector3<f64>)>) -> Option<Vector3<f64>> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (force, moment) in pairs {
        let f = lever_matrix(&force);
        normal += f.transpose() * f;
        right += f.transpose() * moment;
    }
    super::measure::condition_number(&normal)
        .is_finite()
        .then(|| normal.cholesky())
        .flatten()
        .map(|c| c.solve(&right))
}

/// Estimates by the thesis' estimator.
pub fn with_measured_forces(readings: &[StillReading]) -> Option<Vector3<f64>> {
    least_squares(readings.iter().map(|r| (r.force, r.moment)))
}

/// Estimates by the thesis' estimator relative to a reference orientation.
pub fn relative_to(reference: &StillReading, readings: &[StillReading]) -> Option<Vector3<f64>> {
    least_squares(readings.iter().map(|r| (r.force - reference.force, r.moment - reference.moment)))
}

/// Returns the factor of `[m, mcx, mcy, mcz, offset (6)]` with gravity from the attitude. `sigma` is the load
/// cell's noise, 1 σ of a reading, N, N m; `weighed`, if given, a mass and its standard deviation, kg.
pub fn modelled(
    readings: &[StillReading],
    sigma: &[f64; 6],
    weighed: Option<(f64, f64)>,
) -> InformationFactor<f64, MODELLED_PARAMETERS> {
    let mut factor = InformationFactor::new();
    for StillReading { specific_force: a, force, moment } in readings {
        // F = a m + b_F, M = −[a] mc + b_M.
        let turn = lever_matrix(a);
        let mut columns = [[0.0; 6]; MODELLED_PARAMETERS];
        for i in 0..3 {
            columns[0][i] = a[i] / sigma[i];
            for j in 0..3 {
                columns[1 + j][3 + i] = turn[(i, j)] / sigma[3 + i];
            }
        }
        for (i, s) in sigma.iter().enumerate() {
            columns[4 + i][i] = 1.0 / s;
        }
        let wrench = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        factor.absorb(&columns, &std::array::from_fn::<_, 6, _>(|i| wrench[i] / sigma[i]));
    }
    if let Some((mass_kg, sd_kg)) = weighed {
        let columns: [[f64; 1]; MODELLED_PARAMETERS] =
            std::array::from_fn(|j| [if j == 0 { 1.0 / sd_kg } else { 0.0 }]);
        factor.absorb(&columns, &[mass_kg / sd_kg]);
    }
    factor
}

/// Returns the centre of mass by a factor of [`modelled`], m; `None` where it is open.
pub fn centre_of_mass(factor: &InformationFactor<f64, MODELLED_PARAMETERS>) -> Option<Vector3<f64>> {
    let [m, x, y, z, ..] = factor.well_determined(&factor.standard_deviations())?;
    (m != 0.0).then(|| Vector3::new(x, y, z) / m)
}

/// Returns the first-order covariance, m², of [`centre_of_mass`] for a true mass, kg, and centre of mass `r`:
/// with `r = mc/m`, `δr = (δmc − r δm)/m`.
pub fn modelled_covariance(
    factor: &InformationFactor<f64, MODELLED_PARAMETERS>,
    mass_kg: f64,
    r: &Vector3<f64>,
) -> Option<Matrix3<f64>> {
    factor.well_determined(&factor.standard_deviations())?;
    let covariance = factor.covariance();
    let block = SMatrix::<f64, 4, 4>::from_fn(|i, j| covariance[i][j]);
    let jacobian = SMatrix::<f64, 3, 4>::from_fn(|i, j| match j {
        0 => -r[i] / mass_kg,
        j if j == i + 1 => 1.0 / mass_kg,
        _ => 0.0,
    });
    Some(jacobian * block * jacobian.transpose())
}

/// Returns the first-order covariance, m², of [`with_measured_forces`] for a centre of mass `r`: with the
/// true forces f and `e = δM − r × δF` the error is `(Σ [f]ᵀ[f])⁻¹ Σ [f]ᵀ e`.
///
/// `noise` is 1 σ of each reading, `offset` 1 σ of an offset that all readings share; N, N m.
pub fn measured_forces_covariance(
    forces: &[Vector3<f64>],
    r: &Vector3<f64>,
    noise: &[f64; 6],
    offset: &[f64; 6],
) -> Option<Matrix3<f64>> {
    propagate(forces, r, noise, offset)
}

/// Returns the first-order covariance, m², of [`relative_to`]: of forces less the reference's, with the
/// reference's noise in place of the offset.
pub fn relative_covariance(
    forces: &[Vector3<f64>],
    reference: &Vector3<f64>,
    r: &Vector3<f64>,
    noise: &[f64; 6],
) -> Option<Matrix3<f64>> {
    let differences: Vec<_> = forces.iter().map(|f| f - reference).collect();
    propagate(&differences, r, noise, noise)
}

fn propagate(
    forces: &[Vector3<f64>],
    r: &Vector3<f64>,
    each: &[f64; 6],
    shared: &[f64; 6],
) -> Option<Matrix3<f64>> {
    let lever = r.cross_matrix();
    let spread = |sigma: &[f64; 6]| {
        let [fx, fy, fz, mx, my, mz] = sigma.map(|s| s * s);
        Matrix3::from_diagonal(&Vector3::new(mx, my, mz))
            + lever * Matrix3::from_diagonal(&Vector3::new(fx, fy, fz)) * lever.transpose()
    };
    let (each, shared) = (spread(each), spread(shared));
    let (mut normal, mut middle, mut sum) = (Matrix3::zeros(), Matrix3::zeros(), Matrix3::zeros());
    for force in forces {
        let f = lever_matrix(force);
        normal += f.transpose() * f;
        middle += f.transpose() * each * f;
        sum += f;
    }
    middle += sum.transpose() * shared * sum;
    let inverse =
        super::measure::condition_number(&normal).is_finite().then(|| normal.try_inverse()).flatten()?;
    Some(inverse * middle * inverse)
}
