//! The best linear unbiased estimate of a body from recordings of the laboratory: the covariance that its
//! mechanics alone give, and so the least that an honest interval can be.
//!
//! The rows are slopes of the wrench that the laboratory's own equations let a load cell read, for what an
//! IMU reads; their noise is that of the cell and what the accelerometer's brings. That of the gyro is left
//! out: in the band of the motion it is a twentieth of the cell's.

use nalgebra::{DMatrix, DVector, SMatrix, Vector3};

use super::laboratory::{Body, Conditions, Motion, RATE_HZ, RECORDING_ERRORS, RIG_ERRORS, Rig, SECONDS};

/// Ten parameters and the errors of a rig.
const KEPT: usize = 10 + RIG_ERRORS;
/// Readings that are taken together: the motion is slow.
const TOGETHER: usize = 4;

type Square6 = SMatrix<f64, 6, 6>;

/// Returns the information of a recording on the ten parameters, SI, then on the errors of its rig, in their
/// standard deviations; its offsets and its own errors are eliminated.
pub fn information(body: &Body, seed: u64, conditions: &Conditions) -> DMatrix<f64> {
    let motion = Motion::of_seed(seed, conditions.slower);
    let truth = body.parameters();
    let whiten = whitening(&truth, conditions);
    let count = KEPT + 6 + RECORDING_ERRORS;
    let rows = (SECONDS * RATE_HZ) as usize / TOGETHER;
    let mut all = DMatrix::zeros(6 * rows, count);
    for row in 0..rows {
        let t = (row as f64 + 0.5) * TOGETHER as f64 / RATE_HZ;
        let told = |parameters: &[f64; 10], z: &[f64; RIG_ERRORS], own: &[f64; RECORDING_ERRORS]| {
            let rig = Rig::of(z, conditions);
            SMatrix::<f64, 6, 1>::from(rig.told(parameters, &motion, t, own, conditions))
        };
        let exact = ([0.0; RIG_ERRORS], [0.0; RECORDING_ERRORS]);
        for column in 0..count {
            let slope = match column {
                0..10 => told(&std::array::from_fn(|j| f64::from(u8::from(j == column))), &exact.0, &exact.1),
                10..KEPT => central(|by| {
                    let mut z = exact.0;
                    z[column - 10] = by;
                    told(&truth, &z, &exact.1)
                }),
                _ if column < KEPT + 6 => SMatrix::ith(column - KEPT, 1.0),
                _ => central(|by| {
                    let mut own = exact.1;
                    own[column - KEPT - 6] = by;
                    told(&truth, &exact.0, &own)
                }),
            };
            all.fixed_view_mut::<6, 1>(6 * row, column).copy_from(&(whiten * slope));
        }
    }
    let mut information = all.tr_mul(&all);
    for own in KEPT + 6..count {
        information[(own, own)] += 1.0;
    }
    marginal(&information, KEPT)
}

/// Returns the slope by central differences of half a standard deviation.
fn central(told: impl Fn(f64) -> SMatrix<f64, 6, 1>) -> SMatrix<f64, 6, 1> {
    told(0.5) - told(-0.5)
}

/// Returns what makes the noise of readings taken together white and of unit variance.
fn whitening(truth: &[f64; 10], conditions: &Conditions) -> Square6 {
    let [force, moment, accel, _] = conditions.noise();
    let mc = Vector3::new(truth[1], truth[2], truth[3]);
    let mut by_accel = SMatrix::<f64, 6, 3>::zeros();
    by_accel.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(truth[0]);
    by_accel.fixed_view_mut::<3, 3>(3, 0).copy_from(&mc.cross_matrix());
    let cell = SMatrix::<f64, 6, 1>::from_fn(|c, _| if c < 3 { force * force } else { moment * moment });
    let noise = Square6::from_diagonal(&cell) + accel * accel * by_accel * by_accel.transpose();
    let lower = (noise / TOGETHER as f64).cholesky().expect("noise of all channels").unpack();
    lower.try_inverse().expect("a triangle with a positive diagonal")
}

/// Returns what is known of the first `kept` whatever the others are.
fn marginal(information: &DMatrix<f64>, kept: usize) -> DMatrix<f64> {
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

/// Returns the standard deviations of the ten parameters by recordings of one body, those of each rig in a
/// list.
pub fn deviations(rigs: &[Vec<DMatrix<f64>>]) -> Vec<f64> {
    let sum = rigs.iter().fold(DMatrix::zeros(10, 10), |sum, rig| sum + of_rig(rig));
    roots(&inverse(&sum))
}

/// Returns those of a body by a recording with its fixture and one of the fixture alone, of one rig.
#[allow(dead_code, reason = "the table alone compares a tare with it")]
pub fn deviations_beyond(both: &DMatrix<f64>, bare: &DMatrix<f64>) -> Vec<f64> {
    let spread = |shares: [f64; 2]| {
        DMatrix::from_fn(KEPT, KEPT + 10, |i, j| match j {
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

fn inverse(information: &DMatrix<f64>) -> DMatrix<f64> {
    let scale = DVector::from_fn(information.nrows(), |j, _| 1.0 / information[(j, j)].sqrt());
    let scale = DMatrix::from_diagonal(&scale);
    let of_one = (&scale * information * &scale).cholesky().expect("rows that determine all").inverse();
    &scale * of_one * &scale
}

fn roots(covariance: &DMatrix<f64>) -> Vec<f64> {
    covariance.diagonal().iter().map(|v| v.sqrt()).collect()
}
