//! The centre of mass from a recording's still poses, by every estimator beside each other, and what the load
//! cell read less what the body takes (platform thesis, tables 13 to 20, whose figures are not in the text at
//! hand).

use nalgebra::{Matrix3, Vector3};
use rigident_shared::calibration::Reading;
use serde::Serialize;

use super::estimators::{
    StillReading, centre_of_mass, measured_forces_covariance, modelled, modelled_covariance,
    relative_covariance, relative_to, with_measured_forces,
};
use super::measure::{condition_number, normal_matrix};
use rigident_fit::COVERAGE_95;
use rigident_rows::body::Input;
use rigident_rows::body::imu_noise::gyro_sigma;
use rigident_rows::body::poses::still_poses;

/// Means over a tenth of a second stay within this much of each other at rest, rad/s and m/s², beside the
/// noise.
const STILL: [f64; 2] = [0.02, 0.15];
const NOISE_SD: f64 = 6.0;
/// The edges of a still pose still shake, s.
const MARGIN_S: f64 = 0.2;
/// Poses nearer than so, in the specific force over g, are one.
const SAME: f64 = 0.02;

/// A recording whose still poses tell nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StaticsError {
    /// There are too few poses.
    #[error(
        "{0} still poses that differ: three at least, as of `plan_poses(n=5)`, each held for a second or more"
    )]
    TooFew(usize),
    /// A number of a pose that is none.
    #[error("`reference` 0: poses are counted from 1")]
    CountedFromOne,
    /// No pose with this number.
    #[error("`reference` {reference}: there are {poses} still poses, counted from 1")]
    Reference {
        /// Asked for.
        reference: usize,
        /// The number of poses.
        poses: usize,
    },
}

/// A pose held still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Means, in the load cell's axes.
    pub reading: StillReading,
    /// The number of readings that they are the means of.
    pub count: usize,
    /// The index of the first reading.
    pub first: usize,
}

/// The result of one estimator from the poses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimated {
    /// The name in words.
    pub name: &'static str,
    /// Centre of mass, S, m; `None` where the poses leave it open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_m: Option<[f64; 3]>,
    /// The 95 % uncertainty of the centre of mass, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u95_m: Option<[f64; 3]>,
    /// 2-norm condition number of its normal matrix; infinite where the poses leave something open.
    #[serde(skip_serializing_if = "is_infinite")]
    pub condition_number_normal: f64,
}

/// Returns true of what JSON has no number for.
fn is_infinite(value: &f64) -> bool {
    !value.is_finite()
}

/// All of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statics {
    /// Estimates from measured forces; from the same relative to a reference pose; with gravity from the
    /// attitude.
    #[serde(rename = "estimators")]
    pub estimates: [Estimated; 3],
    /// Mass, kg, and offset of the wrench, N and N m, with gravity from the attitude, each with its U95;
    /// `None` where the poses leave them open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<[f64; 2]>,
    /// Value and U95.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_n_nm: Option<[[f64; 2]; 6]>,
    /// 1 σ of a pose's mean wrench: as stated, or what the model with gravity leaves where that is more.
    pub sigma_n_nm: [f64; 6],
    /// Wrench as read less that of the body at rest, pose by pose, N and N m.
    #[serde(rename = "differences_n_nm")]
    pub differences: Vec<[f64; 6]>,
}

/// Returns the still poses of readings in the order of their time, each pose once: readings without time are
/// a pose each.
pub fn held(input: &Input) -> Vec<Held> {
    let mean = |first: usize, readings: &[Reading<f64>]| {
        let mut sum = [Vector3::zeros(); 3];
        for reading in readings {
            let [ax, ay, az, .., fx, fy, fz, mx, my, mz, _, _, _] =
                input.mounting.mounted(&input.mounting.signals(reading));
            for (sum, v) in sum.iter_mut().zip([[ax, ay, az], [fx, fy, fz], [mx, my, mz]]) {
                *sum += Vector3::from(v);
            }
        }
        let [specific_force, force, moment] = sum.map(|sum| sum / readings.len() as f64);
        Held { reading: StillReading { specific_force, force, moment }, count: readings.len(), first }
    };
    let readings = &input.readings;
    if input.is_static {
        return readings
            .iter()
            .enumerate()
            .map(|(k, reading)| mean(k, std::slice::from_ref(reading)))
            .collect();
    }
    let sigma = input.gyro_sigma.unwrap_or_else(|| gyro_sigma(readings));
    let averaged = (0.1 * input.rate_hz).max(1.0).sqrt();
    let margin = (MARGIN_S * input.rate_hz).round() as usize;
    let mut poses: Vec<Held> = Vec::new();
    for rest in still_poses(readings, input.rate_hz, STILL[0] + NOISE_SD * sigma / averaged, STILL[1]) {
        let (first, last) = (rest.range.0 + margin, rest.range.1.saturating_sub(margin));
        let Some(inside) = readings.get(first..last).filter(|inside| !inside.is_empty()) else { continue };
        let pose = mean(first, inside);
        let a = pose.reading.specific_force;
        let same = |other: &Held| (other.reading.specific_force - a).norm() < SAME * a.norm();
        if !poses.iter().any(same) {
            poses.push(pose);
        }
    }
    poses
}

/// Returns what the estimators make of still poses. `sigma` is the noise of a reading, 1 σ, N and N m;
/// `None`: from the residuals. `reference` is the index of the pose that the relative estimator takes the
/// others from.
///
/// # Errors
/// Too few poses, or no such reference.
pub fn statics(poses: &[Held], sigma: Option<&[f64; 6]>, reference: usize) -> Result<Statics, StaticsError> {
    if poses.len() < 3 {
        return Err(StaticsError::TooFew(poses.len()));
    }
    let Some(from) = poses.get(reference) else {
        return Err(StaticsError::Reference { reference: reference + 1, poses: poses.len() });
    };
    let readings: Vec<StillReading> = poses.iter().map(|pose| pose.reading).collect();
    // Means of the shortest: none is believed more than it is worth.
    let fewest = poses.iter().map(|pose| pose.count).min().unwrap_or(1).max(1) as f64;
    let stated = sigma.map_or([1.0; 6], |sigma| sigma.map(|s| s / fewest.sqrt()));
    let scatter = scatter(&readings, &stated);
    // Noise that is not white, drift, a pose that was not still: the poses show what a mean is worth.
    let larger = |scatter: f64| if sigma.is_some() { scatter.max(1.0) } else { scatter };
    let sigma: [f64; 6] = std::array::from_fn(|k| stated[k] * larger(scatter[k / 3]));
    let factor = modelled(&readings, &sigma, None);
    let sd = factor.standard_deviations();
    let phi = factor.well_determined(&sd);
    let centre = centre_of_mass(&factor);
    let covariance = phi.zip(centre).and_then(|(phi, centre)| modelled_covariance(&factor, phi[0], &centre));
    let offset = phi.map_or([0.0; 6], |[.., a, b, c, d, e, f]| [a, b, c, d, e, f]);

    let forces: Vec<_> = readings.iter().map(|r| r.force).collect();
    let others: Vec<StillReading> =
        readings.iter().enumerate().filter(|(k, _)| *k != reference).map(|(_, r)| *r).collect();
    let turned: Vec<_> = others.iter().map(|r| r.force).collect();
    let measured = with_measured_forces(&readings);
    let relative = relative_to(&from.reading, &others);
    let estimate =
        |name, centre: Option<Vector3<f64>>, covariance: Option<Matrix3<f64>>, normal: Matrix3<f64>| {
            Estimated {
                name,
                com_m: centre.map(Into::into),
                u95_m: covariance.map(|c| c.diagonal().map(|v| COVERAGE_95 * v.sqrt()).into()),
                condition_number_normal: condition_number(&normal),
            }
        };
    let estimates = [
        estimate(
            "measured forces",
            measured,
            // The offset that the third finds is an error of the first.
            measured.and_then(|r| measured_forces_covariance(&forces, &r, &sigma, &offset)),
            normal_matrix(forces.iter().copied()),
        ),
        estimate(
            "measured forces, relative",
            relative,
            relative.and_then(|r| relative_covariance(&turned, &from.reading.force, &r, &sigma)),
            normal_matrix(turned.iter().map(|f| f - from.reading.force)),
        ),
        estimate(
            "gravity from the attitude",
            centre,
            covariance,
            normal_matrix(readings.iter().map(|r| r.specific_force)),
        ),
    ];
    let with = |k: usize| phi.map(|phi| [phi[k], COVERAGE_95 * sd[k]]);
    Ok(Statics {
        estimates,
        mass_kg: with(0),
        offset_n_nm: phi.map(|phi| std::array::from_fn(|k| [phi[4 + k], COVERAGE_95 * sd[4 + k]])),
        sigma_n_nm: sigma,
        differences: phi.map_or_else(Vec::new, |phi| readings.iter().map(|r| difference(r, &phi)).collect()),
    })
}

/// Returns the wrench as read less `[a m; mc × a]`.
fn difference(reading: &StillReading, phi: &[f64; 10]) -> [f64; 6] {
    let [m, x, y, z, ..] = *phi;
    let force = reading.force - m * reading.specific_force;
    let moment = reading.moment - Vector3::new(x, y, z).cross(&reading.specific_force);
    [force.x, force.y, force.z, moment.x, moment.y, moment.z]
}

/// Returns root mean squares, over the degrees of freedom, of what the model with gravity leaves of forces
/// and of moments, over `sigma`.
fn scatter(readings: &[StillReading], sigma: &[f64; 6]) -> [f64; 2] {
    let factor = modelled(readings, sigma, None);
    let Some(phi) = factor.well_determined(&factor.standard_deviations()) else { return [f64::NAN; 2] };
    let mut squares = [0.0; 2];
    for reading in readings {
        let left = difference(reading, &phi);
        for (k, v) in left.iter().enumerate() {
            squares[k / 3] += ((v - phi[4 + k]) / sigma[k]).powi(2);
        }
    }
    // Mass and three offsets; first moment and three offsets.
    let rows = 3.0 * readings.len() as f64;
    [(squares[0] / (rows - 4.0)).sqrt(), (squares[1] / (rows - 6.0)).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::poses::measure::up_in_plate;

    const MASS_KG: f64 = 20.0;
    const COM_M: [f64; 3] = [0.01, -0.02, 0.2];
    /// Table 11, n = 5, after the level pose.
    const POSES_DEG: [[f64; 2]; 6] =
        [[0.0, 0.0], [-29.1, 15.5], [-2.7, 30.9], [27.7, -16.0], [-19.0, -24.4], [29.1, 15.5]];

    fn poses(offset: [f64; 6], noise: &mut dyn FnMut(usize) -> f64) -> Vec<Held> {
        let pose = |(k, deg): (usize, &[f64; 2])| {
            let a = 9.80665 * up_in_plate(deg.map(f64::to_radians));
            let (force, moment) = (MASS_KG * a, Vector3::from(COM_M).cross(&(MASS_KG * a)));
            let mut add = |v: Vector3<f64>, from: usize| {
                Vector3::from_fn(|i, _| v[i] + offset[from + i] + noise(from + i))
            };
            let (force, moment) = (add(force, 0), add(moment, 3));
            Held { reading: StillReading { specific_force: a, force, moment }, count: 1, first: k }
        };
        POSES_DEG.iter().enumerate().map(pose).collect()
    }

    #[test]
    fn without_noise_all_three_find_it_and_an_offset_is_an_error_of_the_first_alone() {
        let sigma = [1e-6; 6];
        let exact = statics(&poses([0.0; 6], &mut |_| 0.0), Some(&sigma), 0).unwrap();
        for estimated in &exact.estimates {
            let com = estimated.com_m.unwrap();
            assert!((0..3).all(|k| (com[k] - COM_M[k]).abs() < 1e-9), "{estimated:?}");
        }
        let offset = [3.0, -2.0, 4.0, 0.5, -0.4, 0.3];
        let off = statics(&poses(offset, &mut |_| 0.0), Some(&sigma), 0).unwrap();
        let error = |e: &Estimated| {
            let com = e.com_m.unwrap();
            (0..3).map(|k| (com[k] - COM_M[k]).abs()).fold(0.0, f64::max)
        };
        let [measured, relative, gravity] = &off.estimates;
        assert!(error(measured) > 1e-3 && error(relative) < 1e-9 && error(gravity) < 1e-9, "{off:?}");
        // It is counted.
        assert!(measured.u95_m.unwrap().iter().any(|u| *u > 1e-3));
        for difference in &off.differences {
            assert!((0..6).all(|k| (difference[k] - offset[k]).abs() < 1e-6), "{difference:?}");
        }
        assert!((off.mass_kg.unwrap()[0] - MASS_KG).abs() < 1e-6);
        // CNR of the printed angles is 1.8, CNT with the level pose among them another than 3.25.
        assert!((relative.condition_number_normal - 1.83).abs() < 0.01);
    }

    /// Errors of many experiments over the standard deviations that are said.
    #[test]
    fn intervals_hold_the_truth() {
        use rand_chacha::rand_core::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let sigma = [2.0, 2.0, 4.0, 0.2, 0.2, 0.2];
        let (mut inside, mut all) = ([0; 3], 0);
        for _ in 0..400 {
            let mut normal = |k: usize| {
                let drawn: f64 = StandardNormal.sample(&mut random);
                sigma[k] * drawn
            };
            let found = statics(&poses([0.0; 6], &mut normal), Some(&sigma), 0).unwrap();
            all += 3;
            for (inside, e) in inside.iter_mut().zip(&found.estimates) {
                let (com, u95) = (e.com_m.unwrap(), e.u95_m.unwrap());
                *inside += (0..3).filter(|k| (com[*k] - COM_M[*k]).abs() <= u95[*k]).count();
            }
        }
        // The first counts an offset that is none, and is wide.
        assert!(inside[0] as f64 > 0.94 * f64::from(all), "{inside:?} of {all}");
        for k in [1, 2] {
            let share = inside[k] as f64 / f64::from(all);
            assert!((0.92..0.98).contains(&share), "{k}: {share}");
        }
    }

    #[test]
    fn impossible_poses_are_refused() {
        let poses = poses([0.0; 6], &mut |_| 0.0);
        assert_eq!(statics(&poses[..2], None, 0), Err(StaticsError::TooFew(2)));
        let error = statics(&poses, None, 6).unwrap_err();
        assert_eq!(error, StaticsError::Reference { reference: 7, poses: 6 });
    }
}
