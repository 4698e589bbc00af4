//! The information of a set of orientations.
//!
//! Held still, the body's reaction is `f = m g u`, with `u` the direction of "up" in the plate's axes, and
//! the moment is `M = r × f = [f] r`. The normal matrix of the centre of mass r is
//! `Σ [f]ᵀ[f] = (m g)² Σ (1 − u uᵀ)`; the scale cancels in its condition number.

use nalgebra::{Matrix3, Vector3};

/// The unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Objective {
    /// The least condition number of the normal matrix, as in the thesis.
    Condition,
    /// The largest determinant of the normal matrix: the smallest ellipsoid of confidence (D-optimality).
    Determinant,
    /// The least of the largest uncertainties of the first moment `m r` along the load cell's axes, where the
    /// wrench has an unknown offset and gravity is known from the attitude. The moments' noise, 1 σ, N m, by
    /// axes of the load cell, and the rotation from the plate's axes to the load cell's.
    WorstUncertainty {
        /// Mx, My, Mz, N m.
        moment_sigma_nm: [f64; 3],
        /// Plate's axes to load cell's axes.
        plate_to_cell: Matrix3<f64>,
    },
}

/// Returns "up" in the plate's axes for roll and pitch in rad; yaw does not matter.
/// `Rᵀ z = (−sin θ, cos θ sin ψ, cos θ cos ψ)` for `R = Rz(yaw) Ry(θ) Rx(ψ)`.
pub fn up_in_plate([roll, pitch]: [f64; 2]) -> Vector3<f64> {
    let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
    Vector3::new(-sp, cp * sr, cp * cr)
}

/// Returns roll and pitch, rad, that bring "up" to where `up` points in the plate's axes.
pub fn roll_pitch(up: &Vector3<f64>) -> [f64; 2] {
    [up.y.atan2(up.z), (-up.x).clamp(-1.0, 1.0).asin()]
}

/// Returns `Σ [f]ᵀ[f]` of any vectors f.
pub fn normal_matrix(forces: impl IntoIterator<Item = Vector3<f64>>) -> Matrix3<f64> {
    let mut sum = Matrix3::zeros();
    for f in forces {
        sum += Matrix3::from_diagonal_element(f.norm_squared()) - f * f.transpose();
    }
    sum
}

/// Returns the normal matrix of the forces less that of a reference orientation: the thesis' relative
/// measurement, which removes a constant offset.
pub fn relative_normal_matrix(ups: &[Vector3<f64>], reference: &Vector3<f64>) -> Matrix3<f64> {
    normal_matrix(ups.iter().map(|u| u - reference))
}

/// Returns the 2-norm condition number of a normal matrix, which is the square of that of the stacked `[F]`;
/// infinite for a singular one.
pub fn condition_number(normal: &Matrix3<f64>) -> f64 {
    let eigen = normal.symmetric_eigenvalues();
    let (least, largest) = (eigen.min(), eigen.max());
    if least > 1e-12 * largest { largest / least } else { f64::INFINITY }
}

/// Returns the information on the first moment `m r` in the load cell's axes, 1/(kg m)², where six constant
/// offsets of the wrench are unknown.
///
/// `M = −[a] mc + b` with the specific force a. The best b for given mc leaves the rows with a less its mean
/// ã, so that the information is `Σ [ã]ᵀ diag(σ)⁻² [ã]`. The forces hold nothing of mc.
pub fn first_moment_information(
    ups: &[Vector3<f64>],
    gravity_mps2: f64,
    moment_sigma_nm: &[f64; 3],
    plate_to_cell: &Matrix3<f64>,
) -> Matrix3<f64> {
    let mean: Vector3<f64> = ups.iter().sum::<Vector3<f64>>() / ups.len().max(1) as f64;
    let weights = Matrix3::from_diagonal(&Vector3::from(moment_sigma_nm.map(|s| s.powi(-2))));
    ups.iter()
        .map(|u| {
            let cross = (plate_to_cell * (u - mean) * gravity_mps2).cross_matrix();
            cross.transpose() * weights * cross
        })
        .sum()
}

/// Returns the standard deviations, kg m, of the first moment; `None` where some combination is undetermined.
pub fn first_moment_deviations(information: &Matrix3<f64>) -> Option<[f64; 3]> {
    if !condition_number(information).is_finite() {
        return None;
    }
    information.try_inverse().map(|covariance| covariance.diagonal().map(f64::sqrt).into())
}

impl Objective {
    /// Returns what is made small; infinite where the orientations leave something undetermined.
    pub fn cost(&self, ups: &[Vector3<f64>]) -> f64 {
        match self {
            Self::Condition => condition_number(&normal_matrix(ups.iter().copied())),
            Self::Determinant => {
                let determinant = normal_matrix(ups.iter().copied()).determinant();
                if determinant > 1e-12 { -determinant.ln() } else { f64::INFINITY }
            }
            Self::WorstUncertainty { moment_sigma_nm, plate_to_cell } => {
                let information = first_moment_information(ups, 1.0, moment_sigma_nm, plate_to_cell);
                first_moment_deviations(&information)
                    .map_or(f64::INFINITY, |sd| sd.into_iter().fold(0.0, f64::max))
            }
        }
    }

    /// Returns a cost below which nothing can be better.
    pub(super) fn floor(&self) -> f64 {
        match self {
            Self::Condition => 1.0,
            Self::Determinant | Self::WorstUncertainty { .. } => f64::NEG_INFINITY,
        }
    }
}

/// Returns the fewest orientations. Two determine the centre of mass, but nothing beside it: their difference
/// is one vector, and what is along it stays open where an offset is unknown too.
pub fn fewest_orientations(objective: &Objective) -> usize {
    match objective {
        Objective::Condition | Objective::Determinant => 2,
        Objective::WorstUncertainty { .. } => 3,
    }
}

/// Returns the least condition number of the normal matrix when n orientations may tilt by at most
/// `tilt_rad`, in any direction.
///
/// n = 2: opposite tilts, eigenvalues 2 and `1 ± cos 2τ`, down to 2 at 45°, two orthogonal directions. n ≥ 3:
/// equal spacing around a cone, eigenvalues `n s²` and `n (1 − s²/2)` with `s = sin τ`, down to 1 at 54.74°.
pub fn least_condition_number_in_cone(n: usize, tilt_rad: f64) -> f64 {
    let square = tilt_rad.min(std::f64::consts::FRAC_PI_2).sin().powi(2);
    if n == 2 {
        return 2.0 / (1.0 - (2.0 * tilt_rad).cos().max(0.0));
    }
    ((1.0 - 0.5 * square) / square).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 11 with its fourth row's third pitch as printed.
    const N4_PRINTED: [[f64; 2]; 4] = [[-28.9, 16.0], [14.1, 26.5], [28.2, -25.0], [-19.5, -24.1]];

    fn ups(degrees: &[[f64; 2]]) -> Vec<Vector3<f64>> {
        degrees.iter().map(|d| up_in_plate(d.map(f64::to_radians))).collect()
    }

    #[test]
    fn up_is_the_third_row_of_the_platforms_rotation() {
        use hexapod::Coordinates;
        for rpy in [[0.3, -0.7, 0.0], [-1.2, 0.4, 2.0], [0.0, 0.0, 0.0]] {
            let [roll, pitch, yaw] = rpy;
            let value = [0.0, 0.0, 0.7, roll, pitch, yaw];
            let state = Coordinates { value, ..Coordinates::default() }.plate_state();
            let up = state.rotation.transpose() * Vector3::z();
            assert!((up - up_in_plate([roll, pitch])).norm() < 1e-15);
            let back = roll_pitch(&up);
            assert!((back[0] - roll).abs() < 1e-14 && (back[1] - pitch).abs() < 1e-14);
        }
    }

    #[test]
    fn the_normal_matrix_is_that_of_the_stacked_cross_product_matrices() {
        let ups = ups(&N4_PRINTED);
        let stacked = nalgebra::DMatrix::from_fn(12, 3, |i, j| ups[i / 3].cross_matrix()[(i % 3, j)]);
        let singular = stacked.singular_values();
        let want = (singular.max() / singular.min()).powi(2);
        let got = condition_number(&normal_matrix(ups.iter().copied()));
        assert!((got / want - 1.0).abs() < 1e-12, "{got} {want}");
    }

    /// Two orthogonal directions have 2, three have 1 (Table 9): only the normal matrix gives both.
    #[test]
    fn orthogonal_directions_have_two_and_one() {
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        assert!((condition_number(&normal_matrix([x, y])) - 2.0).abs() < 1e-12);
        assert!((condition_number(&normal_matrix([x, y, z])) - 1.0).abs() < 1e-12);
        assert_eq!(condition_number(&normal_matrix([x, x])), f64::INFINITY);
    }

    /// Minus fifteen gives both of the printed figures, minus twenty-five neither.
    #[test]
    fn the_printed_pitch_of_minus_25_in_table_11_is_a_slip_for_minus_15() {
        let mut meant = N4_PRINTED;
        meant[2][1] = -15.0;
        let figures = |degrees: &[[f64; 2]]| {
            let ups = ups(degrees);
            let level = up_in_plate([0.0, 0.0]);
            let tilt = ups.iter().map(|u| u.z.acos().to_degrees()).fold(0.0, f64::max);
            [
                condition_number(&normal_matrix(ups.iter().copied())),
                condition_number(&relative_normal_matrix(&ups, &level)),
                tilt,
            ]
        };
        let [absolute, relative, tilt] = figures(&meant);
        assert!((absolute - 3.27).abs() < 0.005 && (relative - 1.8).abs() < 0.05 && tilt < 33.0);
        let [absolute, relative, tilt] = figures(&N4_PRINTED);
        assert!((absolute - 3.27).abs() > 0.2 && (relative - 1.8).abs() > 0.1 && tilt > 36.0);
    }

    /// Eliminating the offsets by hand against the factor of all ten unknowns, n blocks of six rows.
    #[test]
    fn the_first_moments_deviations_are_those_of_the_factor_with_offsets() {
        use rigident_shared::factor::InformationFactor;
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.2, 1.1).into_inner();
        let (sigma_f, sigma_m) = ([5.0, 5.0, 10.0], [0.38, 0.46, 0.5]);
        let ups = ups(&N4_PRINTED);
        let mut factor = InformationFactor::<f64, 10>::new();
        for up in &ups {
            let a = turn * up * 9.80665;
            let minus_cross = -a.cross_matrix();
            let mut columns = [[0.0; 6]; 10];
            for i in 0..3 {
                columns[0][i] = a[i] / sigma_f[i];
                columns[4 + i][i] = 1.0 / sigma_f[i];
                columns[7 + i][3 + i] = 1.0 / sigma_m[i];
                for j in 0..3 {
                    columns[1 + j][3 + i] = minus_cross[(i, j)] / sigma_m[i];
                }
            }
            factor.absorb(&columns, &[0.0; 6]);
        }
        let want = factor.standard_deviations();
        let information = first_moment_information(&ups, 9.80665, &sigma_m, &turn);
        let got = first_moment_deviations(&information).unwrap();
        for k in 0..3 {
            assert!((got[k] / want[1 + k] - 1.0).abs() < 1e-10, "{k}: {} {}", got[k], want[1 + k]);
        }
        assert_eq!(first_moment_deviations(&first_moment_information(&ups[..2], 9.8, &sigma_m, &turn)), None);
    }
}
