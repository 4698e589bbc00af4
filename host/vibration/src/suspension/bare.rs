//! The bare platform as what is known of it: rows over its ten parameters, which the answer is less.
//!
//! The springs move with it: a coil whose ends move by 0 and δ has `m_s δ̇² / 6` of kinetic energy, as a
//! third of its mass at the moved end has (Lord Rayleigh, The Theory of Sound, 1877, § 156). Mass at the
//! ends, bending and waves in it make that 0.28 to 0.40.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};
use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
use rigident_shared::spatial::{Body, Position};

use super::whitened::pooled;
use rigident_fit::Factor;
use rigident_fit::pool::PooledFactor;
use rigident_fit::tare::{Tare, TareError};
use rigident_io::rig::{SpringTable, SuspendedPlatformTable, SuspensionTable};
use rigident_model::inertial::map_to_parent;
use rigident_rows::body;
use rigident_rows::tree::joints::attitude;

/// Parameters of a body.
const TEN: usize = 10;
/// Share of a spring's mass that moves with the platform.
const MOVED: f64 = 1.0 / 3.0;
/// 1 σ of that share, the same of all springs.
const MOVED_STD: f64 = 0.035;
/// The accuracy that nobody exceeds, relative to the quantity's scale: exact values are treated as if known
/// to it.
const EXACT: f64 = 1e-9;

/// Returns whether a rig file states anything that moves beside the body: the platform, or the mass of the
/// springs.
pub fn is_stated(table: &SuspensionTable) -> bool {
    table.platform.is_some() || table.spring.iter().any(|own| own.mass_kg > 0.0)
}

/// Returns what is to be known of springs whose mass is not stated.
pub fn massless(table: &SuspensionTable) -> Option<String> {
    let is_massless = !table.spring.is_empty() && table.spring.iter().all(|own| own.mass_kg == 0.0);
    is_massless.then(|| {
        format!(
            "the springs are taken to weigh nothing, and no interval has it: a third of what they weigh counts \
             as the body's ({:.2} kg if each weighs 0.1 kg, and its moments of inertia); state mass_kg of each",
            0.1 * MOVED * table.spring.len() as f64
        )
    })
}

/// Returns the ten parameters of the bare platform of a rig file in S, the springs' moved share with it, and
/// their covariance; `None` if neither is stated.
pub fn bare_parameters(table: &SuspensionTable) -> Option<(SVector<f64, TEN>, SMatrix<f64, TEN, TEN>)> {
    if !is_stated(table) {
        return None;
    }
    let springs = springs(table);
    let own = springs * MOVED;
    let (mean, changes) = match &table.platform {
        Some(platform) => (SVector::from(parameters(platform)) + own, changes(platform)),
        None => (own, SMatrix::from_diagonal(&SVector::repeat(EXACT * own.amax()))),
    };
    let share = springs * MOVED_STD;
    // S axes ← P axes, and the origin of P in S.
    let q = table.base_rotation_wxyz.unwrap_or([1.0, 0.0, 0.0, 0.0]);
    let rotation = attitude(&q).unwrap_or_else(Matrix3::identity).transpose();
    let map = map_to_parent(&rotation, &-(rotation * Vector3::from(table.base_position_m)));
    let (moves, share) = (map * changes, map * share);
    Some((map * mean, moves * moves.transpose() + share * share.transpose()))
}

/// Returns the ten parameters in P of the whole mass of the springs at their places.
fn springs(table: &SuspensionTable) -> SVector<f64, TEN> {
    let of = |own: &SpringTable| {
        let body = InertialParameters::<Body, f64>::from_centre_of_mass(
            own.mass_kg,
            Position::from_array(own.at_m),
            tensor_from_elements([0.0; 6]),
        );
        SVector::<f64, TEN>::from(body.to_vector())
    };
    table.spring.iter().map(of).sum()
}

/// Returns the bare platform of a rig file as a fixture to be taken off; `None` if none is stated.
///
/// # Errors
/// [`TareError`] if it is none that could be.
pub fn fixture(table: &SuspensionTable) -> Result<Option<Tare>, TareError> {
    bare_platform(table).map(Tare::new).transpose()
}

/// Returns the factor of the bare platform of a rig file, in S; `None` if none is stated.
fn bare_platform(table: &SuspensionTable) -> Option<PooledFactor> {
    let (mean, covariance) = bare_parameters(table)?;
    let whitening = covariance.cholesky()?.inverse().cholesky()?.l().transpose();
    let right = whitening * mean;
    let mut factor = Factor::new(TEN);
    factor.absorb_matrix(&DMatrix::from_fn(TEN, TEN, |i, j| whitening[(i, j)]), right.as_slice());
    Some(pooled("the bare platform", body::parameters(TEN), factor, mean.iter().copied(), true))
}

fn parameters(platform: &SuspendedPlatformTable) -> [f64; TEN] {
    InertialParameters::<Body, f64>::from_centre_of_mass(
        platform.mass_kg,
        Position::from_array(platform.com_m),
        tensor_from_elements(platform.inertia_com_kgm2),
    )
    .to_vector()
}

/// Returns what one standard deviation of each stated number changes, a column each.
fn changes(platform: &SuspendedPlatformTable) -> SMatrix<f64, TEN, TEN> {
    let own = SVector::<f64, TEN>::from(parameters(platform));
    let largest = platform.inertia_com_kgm2.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
    let length = (largest / platform.mass_kg).sqrt();
    let column = |k: usize| {
        let mut other = platform.clone();
        // The parameters are at most quadratic in each number: differences either way are exact.
        let mut shift = |by: f64| {
            other.clone_from(platform);
            match k {
                0 => other.mass_kg += by * platform.mass_std_kg.max(EXACT * platform.mass_kg),
                1..4 => other.com_m[k - 1] += by * platform.com_std_m.max(EXACT * length),
                _ => other.inertia_com_kgm2[k - 4] += by * platform.inertia_std_kgm2.max(EXACT * largest),
            }
            SVector::<f64, TEN>::from(parameters(&other)) - own
        };
        (shift(1.0) - shift(-1.0)) * 0.5
    };
    let columns: Vec<DVector<f64>> =
        (0..TEN).map(|k| DVector::from_column_slice(column(k).as_slice())).collect();
    let all = DMatrix::from_columns(&columns);
    SMatrix::from_fn(|i, j| all[(i, j)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_io::rig::RigFile;

    #[test]
    fn a_third_of_the_springs_is_taken_off_with_the_platform_and_without_one() {
        let springs = "spring = [{ at_m = [0.4, 0.3, 0.1], axial_npm = 9e3, mass_kg = 0.6 }, \
                       { at_m = [-0.4, 0.3, 0.1], axial_npm = 9e3, mass_kg = 0.3 }]\n";
        let platform = "[suspension.platform]\nmass_kg = 10.0\ncom_m = [0.0, 0.0, 0.0]\ninertia_com_kgm2 = \
                        [1.0, 1.0, 1.5, 0.0, 0.0, 0.0]\n";
        let of = |more: &str| {
            let rig =
                RigFile::parse(&format!("[suspension]\nbase_position_m = [0.0, 0.0, 0.1]\n{springs}{more}"));
            bare_parameters(&rig.unwrap().suspension.unwrap()).unwrap()
        };
        let ((alone, own), (both, _)) = (of(""), of(platform));
        // S is at the springs' height: 0.3 kg, moments 0.4 (0.2 − 0.1) and 0.3 · 0.3.
        for (k, wanted) in [0.3, 0.04, 0.09, 0.0].into_iter().enumerate() {
            assert!((alone[k] - wanted).abs() < 1e-12, "{k}: {} {wanted}", alone[k]);
        }
        assert!((alone[6] - 0.3 * (0.16 + 0.09)).abs() < 1e-12, "{alone}");
        assert!(
            (both[0] - alone[0] - 10.0).abs() < 1e-12 && (both[3] - alone[3] + 1.0).abs() < 1e-12,
            "{both}"
        );
        // The share is known to 0.035, of all springs alike.
        assert!((own[(0, 0)].sqrt() - 0.035 * 0.9).abs() < 1e-6, "{own}");
        let none = RigFile::parse(&format!(
            "[suspension]\n{}",
            springs.replace("0.6", "0.0").replace("mass_kg = 0.3", "mass_kg = 0.0")
        ));
        let table = none.unwrap().suspension.unwrap();
        assert!(bare_parameters(&table).is_none() && massless(&table).is_some());
    }
}
