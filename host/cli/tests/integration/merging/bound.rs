//! The best linear unbiased estimate of a body from recordings of the laboratory: the covariance that its
//! mechanics alone give, and so the least that an honest interval can be.
//!
//! The rows are slopes of the wrench that the laboratory's own equations let a load cell read, for what an
//! IMU reads; their noise is that of the cell and what the accelerometer's brings. That of the gyro is left
//! out: in the band of the motion it is a twentieth of the cell's.

use nalgebra::{DMatrix, DVector, SMatrix, Vector3};

use super::laboratory::{
    Body, Conditions, Motion, RATE_HZ, RECORDING_ERRORS, RIG_ERRORS, Rig, SECONDS, There, wrench,
};

/// Readings that are taken together: the motion is slow.
const TOGETHER: usize = 4;

type Square6 = SMatrix<f64, 6, 6>;

/// The wrench of parameters, in which it is linear, at a time, s, of a motion.
type Exact<'a> = &'a dyn Fn(&[f64], f64, &There) -> [f64; 6];

/// Returns the information of a recording on the ten parameters, SI, then on the errors of its rig, in their
/// standard deviations; its offsets and its own errors are eliminated.
pub fn information(body: &Body, seed: u64, conditions: &Conditions) -> DMatrix<f64> {
    let exact =
        |parameters: &[f64], _: f64, there: &There| wrench(&std::array::from_fn(|k| parameters[k]), there);
    information_of(&body.parameters(), &exact, seed, conditions)
}

/// Returns the same of a machine of these parameters.
pub fn information_of(truth: &[f64], exact: Exact<'_>, seed: u64, conditions: &Conditions) -> DMatrix<f64> {
    let motion = Motion::of_seed(seed, conditions.slower);
    let whiten = whitening(&|there| exact(truth, 0.0, there), &motion.at(0.0), conditions);
    let (n, kept) = (truth.len(), truth.len() + RIG_ERRORS);
    let count = kept + 6 + RECORDING_ERRORS;
    let rows = (SECONDS * RATE_HZ) as usize / TOGETHER;
    let mut all = DMatrix::zeros(6 * rows, count);
    for row in 0..rows {
        let t = (row as f64 + 0.5) * TOGETHER as f64 / RATE_HZ;
        let wrench = |parameters: &[f64], z: &[f64; RIG_ERRORS], own: &[f64; RECORDING_ERRORS]| {
            let exact = |there: &There| exact(parameters, t, there);
            SMatrix::<f64, 6, 1>::from(Rig::of(z, conditions).wrench_read(exact, &motion, t, own, conditions))
        };
        let none = ([0.0; RIG_ERRORS], [0.0; RECORDING_ERRORS]);
        for column in 0..count {
            let slope = match column {
                _ if column < n => {
                    let unit: Vec<f64> = (0..n).map(|j| f64::from(u8::from(j == column))).collect();
                    wrench(&unit, &none.0, &none.1)
                }
                _ if column < kept => central(|by| {
                    let mut z = none.0;
                    z[column - n] = by;
                    wrench(truth, &z, &none.1)
                }),
                _ if column < kept + 6 => SMatrix::ith(column - kept, 1.0),
                _ => central(|by| {
                    let mut own = none.1;
                    own[column - kept - 6] = by;
                    wrench(truth, &none.0, &own)
                }),
            };
            all.fixed_view_mut::<6, 1>(6 * row, column).copy_from(&(whiten * slope));
        }
    }
    let mut information = all.tr_mul(&all);
    for own in kept + 6..count {
        information[(own, own)] += 1.0;
    }
    marginal(&information, kept)
}

/// Returns the slope by central differences of half a standard deviation.
fn central(wrench: impl Fn(f64) -> SMatrix<f64, 6, 1>) -> SMatrix<f64, 6, 1> {
    wrench(0.5) - wrench(-0.5)
}

/// Returns what makes the noise of readings taken together white and of unit variance: that of the cell, and
/// that of the specific force in the wrench.
fn whitening(exact: &dyn Fn(&There) -> [f64; 6], there: &There, conditions: &Conditions) -> Square6 {
    let [force, moment, accel, _] = conditions.noise();
    let before = exact(there);
    let mut by_accel = SMatrix::<f64, 6, 3>::zeros();
    for k in 0..3 {
        let after = exact(&There { specific: there.specific + Vector3::ith(k, 1.0), ..*there });
        (0..6).for_each(|c| by_accel[(c, k)] = after[c] - before[c]);
    }
    let cell = SMatrix::<f64, 6, 1>::from_fn(|c, _| if c < 3 { force * force } else { moment * moment });
    let noise = Square6::from_diagonal(&cell) + accel * accel * by_accel * by_accel.transpose();
    let lower = (noise / TOGETHER as f64).cholesky().expect("noise of all channels").unpack();
    lower.try_inverse().expect("a triangle with a positive diagonal")
}

/// Returns what is known of the first `kept` whatever the others are.
pub fn marginal(information: &DMatrix<f64>, kept: usize) -> DMatrix<f64> {
    let others = information.nrows() - kept;
    let cross = information.view((kept, 0), (others, kept)).into_owned();
    let own = information.view((kept, kept), (others, others)).into_owned();
    let solved = own.cholesky().expect("others that are known").solve(&cross);
    information.view((0, 0), (kept, kept)) - cross.tr_mul(&solved)
}

/// Returns the information of recordings of one rig on the first columns, of which the last
/// [`RIG_ERRORS`] are the errors of the rig; what is known of these counts once.
fn of_rig(recordings: &[DMatrix<f64>]) -> DMatrix<f64> {
    let count = recordings[0].nrows();
    let mut sum = recordings.iter().fold(DMatrix::zeros(count, count), |sum, own| sum + own);
    for error in count - RIG_ERRORS..count {
        sum[(error, error)] += 1.0;
    }
    marginal(&sum, count - RIG_ERRORS)
}

/// Returns the standard deviations of the parameters by recordings of one body, those of each rig in a list.
pub fn deviations(rigs: &[Vec<DMatrix<f64>>]) -> Vec<f64> {
    let sum = rigs.iter().map(|rig| of_rig(rig)).reduce(|sum, own| sum + own).expect("a rig");
    roots(&inverse(&sum))
}

/// Returns those by recordings of a rig and by one of a body whose ten parameters have this covariance
/// beforehand.
#[allow(dead_code, reason = "the table alone calibrates")]
pub fn deviations_calibrated(
    mut runs: Vec<DMatrix<f64>>,
    reference: &DMatrix<f64>,
    known: &DMatrix<f64>,
) -> Vec<f64> {
    let mut of_reference = reference.clone();
    let mut own = of_reference.view_mut((0, 0), (10, 10));
    own += inverse(known);
    // The errors come first, so that the reference's parameters are those eliminated.
    let count = of_reference.nrows();
    let order: Vec<usize> = (10..count).chain(0..10).collect();
    let of_errors = marginal(&of_reference.select_rows(&order).select_columns(&order), RIG_ERRORS);
    let first = &mut runs[0];
    let n = first.nrows() - RIG_ERRORS;
    let mut errors = first.view_mut((n, n), (RIG_ERRORS, RIG_ERRORS));
    errors += of_errors;
    deviations(&[runs])
}

/// Returns those of a body by a recording with its fixture and one of the fixture alone, of one rig.
#[allow(dead_code, reason = "the table alone compares a tare with it")]
pub fn deviations_beyond(both: &DMatrix<f64>, bare: &DMatrix<f64>) -> Vec<f64> {
    let kept = 10 + RIG_ERRORS;
    let spread = |shares: [f64; 2]| {
        DMatrix::from_fn(kept, kept + 10, |i, j| match j {
            0..10 => shares[0] * f64::from(u8::from(i == j)),
            10..20 => shares[1] * f64::from(u8::from(i == j - 10)),
            _ => f64::from(u8::from(i == j - 10)),
        })
    };
    let of = |information: &DMatrix<f64>, shares| {
        let spread = spread(shares);
        spread.tr_mul(information) * spread
    };
    let covariance = inverse(&of_rig(&[of(both, [1.0, 1.0]), of(bare, [1.0, 0.0])]));
    roots(&covariance.view((10, 10), (10, 10)).into_owned())
}

/// Returns the inverse of a positive definite matrix.
pub fn inverse(information: &DMatrix<f64>) -> DMatrix<f64> {
    let scale = DVector::from_fn(information.nrows(), |j, _| 1.0 / information[(j, j)].sqrt());
    let scale = DMatrix::from_diagonal(&scale);
    let of_one = (&scale * information * &scale).cholesky().expect("rows that determine all").inverse();
    &scale * of_one * &scale
}

/// Returns the roots of the diagonal.
pub fn roots(covariance: &DMatrix<f64>) -> Vec<f64> {
    covariance.diagonal().iter().map(|v| v.sqrt()).collect()
}
