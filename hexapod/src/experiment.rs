//! Motions that are worth running.
//!
//! Lives here: the default experiment: still poses, then a motion with several frequencies per axis, then the
//! first pose again. May not live here: planning for a particular body (that is the host's).

use super::geometry::Geometry;
use super::payload::THESIS_GYRO_RANGE_RADPS;
use super::pose::Pose;
use super::program::{Axis, MotionProgram, Segment, SineTerm};

/// Roll and pitch of the thesis' best five orientations (Table 11, n = 5), degrees.
pub const THESIS_POSES_DEG: [[f64; 2]; 5] =
    [[-29.1, 15.5], [-2.7, 30.9], [27.7, -16.0], [-19.0, -24.4], [29.1, 15.5]];

/// The shortest experiment that [`thesis_program`] can make, s.
pub const SHORTEST_S: f64 = 20.0;

/// Highest angular rate of the experiment, rad/s: 0.9 of the gyro's range, whatever the IMU's mounting.
pub const HIGHEST_RATE_RADPS: f64 = 0.9 * THESIS_GYRO_RANGE_RADPS;

/// Peak rate of the moves between poses, rad/s on the path of the angles.
const MOVE_RATE_RADPS: f64 = 1.1;
/// Angular rate that each sine of the motion contributes, rad/s.
const TERM_RATE_RADPS: f64 = 0.36;

/// Returns the default experiment of `duration_s`: from home through the five poses of Table 11, home again,
/// a multisine on all six coordinates, and the first pose once more as a check for drift.
///
/// The moves always take the same time; poses and multisine share the rest, the multisine gets most of it.
/// Durations below [`SHORTEST_S`] are treated as that.
pub fn thesis_program(geometry: &Geometry, duration_s: f64) -> MotionProgram {
    let home = geometry.home();
    let pose =
        |[roll, pitch]: [f64; 2]| Pose { rpy_rad: [roll.to_radians(), pitch.to_radians(), 0.0], ..home };
    let poses = THESIS_POSES_DEG.map(pose);
    let [first, ..] = poses;
    let to_first = move_s(&home, &first);

    let duration_s = duration_s.max(SHORTEST_S);
    let hold_s = (0.03 * duration_s).clamp(0.6, 3.0);
    let mut segments = vec![Segment::Hold { duration_s: 0.5 * hold_s }];
    let mut at = home;
    for to in poses.into_iter().chain([home]) {
        segments.push(Segment::Move { to, duration_s: move_s(&at, &to) });
        segments.push(Segment::Hold { duration_s: if to == home { 0.25 * hold_s } else { hold_s } });
        at = to;
    }
    let spent_s: f64 = segments.iter().map(Segment::duration_s).sum();
    segments.push(multisine(duration_s - spent_s - to_first - hold_s));
    segments.push(Segment::Move { to: first, duration_s: to_first });
    segments.push(Segment::Hold { duration_s: hold_s });
    MotionProgram { start: home, segments }
}

/// Returns the time of a move by the quintic's peak rate, 15/8 of its mean.
fn move_s(from: &Pose, to: &Pose) -> f64 {
    let square: f64 = from.rpy_rad.iter().zip(to.rpy_rad).map(|(a, b)| (a - b).powi(2)).sum();
    1.875 * square.sqrt() / MOVE_RATE_RADPS
}

/// Returns a multisine of three well separated frequencies on each angle and two on each translation, no two
/// alike, all multiples of 0.05 Hz. With a single frequency a tilt's `I ω̇` and `mc × g` would be collinear.
/// The phases were searched for a low peak of the angular rate over the common period of 20 s.
fn multisine(duration_s: f64) -> Segment {
    let turns = [
        (Axis::Roll, [(0.55, 4.59), (1.15, 5.51), (1.95, 5.92)]),
        (Axis::Pitch, [(0.65, 5.11), (1.35, 0.93), (2.15, 4.63)]),
        (Axis::Yaw, [(0.75, 0.69), (1.55, 0.42), (2.35, 1.93)]),
    ];
    let shifts = [
        (Axis::X, [(0.45, 0.3), (1.05, 2.1)]),
        (Axis::Y, [(0.50, 1.4), (1.25, 4.0)]),
        (Axis::Z, [(0.85, 2.6), (1.45, 5.2)]),
    ];
    let mut terms = Vec::new();
    for (axis, sines) in turns {
        for (frequency_hz, phase_rad) in sines {
            let amplitude = TERM_RATE_RADPS / (std::f64::consts::TAU * frequency_hz);
            terms.push(SineTerm { axis, amplitude, frequency_hz, phase_rad });
        }
    }
    for (axis, sines) in shifts {
        for (frequency_hz, phase_rad) in sines {
            // 0.5 m/s² from each.
            let amplitude = 0.5 / (std::f64::consts::TAU * frequency_hz).powi(2);
            terms.push(SineTerm { axis, amplitude, frequency_hz, phase_rad });
        }
    }
    Segment::Multisine { duration_s, ramp_s: 1.0, terms }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BodyParameters, FrameMotion, STANDARD_GRAVITY_MPS2, THESIS_WRENCH_NOISE_N_NM};
    use nalgebra::Vector3;

    const DURATIONS_S: [f64; 4] = [20.0, 30.0, 60.0, 90.0];

    #[test]
    fn the_program_lasts_as_long_as_asked_and_ends_at_the_first_pose() {
        for duration in DURATIONS_S {
            let program = thesis_program(&Geometry::thesis(), duration);
            assert!((program.duration_s() - duration).abs() < 1e-9);
            let end = program.trajectory().unwrap().end_pose();
            assert_eq!(end.rpy_rad, [(-29.1_f64).to_radians(), 15.5_f64.to_radians(), 0.0]);
        }
    }

    #[test]
    fn angular_rate_stays_inside_the_gyro_and_the_legs_inside_their_reach() {
        for duration in DURATIONS_S {
            let geometry = Geometry::thesis();
            let trajectory = thesis_program(&geometry, duration).trajectory().unwrap();
            geometry.check(&trajectory).unwrap();
            let peak = (0..(duration * 250.0) as usize)
                .map(|k| trajectory.state(k as f64 * 4e-3).angular_rate)
                .fold(0.0_f64, |m, w| m.max(w.dot(&w).sqrt()));
            assert!(peak < HIGHEST_RATE_RADPS && peak > 0.9, "{duration} s: {peak}");
        }
    }

    /// Returns row blocks of the linear map from the ten parameters to the wrench, column by column from the
    /// body's own physics: unit bodies, and for a first moment a unit mass at unit distance less what else
    /// that is.
    fn columns(program: &MotionProgram, rate_hz: f64) -> Vec<Vec<[f64; 6]>> {
        let run = |mass_kg, com_m, inertia_com_kgm2| -> Vec<[f64; 6]> {
            let body = BodyParameters { mass_kg, com_m, inertia_com_kgm2 };
            let gravity = Vector3::new(0.0, 0.0, -STANDARD_GRAVITY_MPS2);
            let trajectory = program.trajectory().unwrap();
            (0..=(trajectory.duration_s() * rate_hz) as usize)
                .map(|k| FrameMotion::of_plate(&trajectory.state(k as f64 / rate_hz)))
                .map(|motion| body.wrench(&motion, &gravity))
                .collect()
        };
        let mass = run(1.0, [0.0; 3], [0.0; 6]);
        let inertia: Vec<_> = (0..6)
            .map(|i| {
                let mut unit = [0.0; 6];
                unit[i] = 1.0;
                run(0.0, [0.0; 3], unit)
            })
            .collect();
        let mut all = vec![mass.clone()];
        for axis in 0..3 {
            let mut com = [0.0; 3];
            com[axis] = 1.0;
            let (p, q) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut column = run(1.0, com, [0.0; 6]);
            for (k, row) in column.iter_mut().enumerate() {
                for i in 0..6 {
                    row[i] -= mass[k][i] + inertia[p][k][i] + inertia[q][k][i];
                }
            }
            all.push(column);
        }
        all.extend(inertia);
        all
    }

    /// Returns the condition number of the column-scaled system and the diagonal of its Cholesky inverse,
    /// from its Gram matrix.
    fn scaled_condition_and_sigma(gram: &[[f64; 16]; 16]) -> (f64, [f64; 16]) {
        let scale: Vec<f64> = (0..16).map(|i| gram[i][i].sqrt()).collect();
        let mut a = *gram;
        for i in 0..16 {
            for j in 0..16 {
                a[i][j] /= scale[i] * scale[j];
            }
        }
        // Cyclic Jacobi, eigenvectors alongside.
        let mut v = [[0.0; 16]; 16];
        for (i, row) in v.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        for _ in 0..30 {
            for p in 0..16 {
                for q in p + 1..16 {
                    let theta = 0.5 * (2.0 * a[p][q]).atan2(a[q][q] - a[p][p]);
                    let (s, c) = theta.sin_cos();
                    for row in a.iter_mut().chain(v.iter_mut()) {
                        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                    }
                    let (rp, rq) = (a[p], a[q]);
                    for k in 0..16 {
                        (a[p][k], a[q][k]) = (c * rp[k] - s * rq[k], s * rp[k] + c * rq[k]);
                    }
                }
            }
        }
        let (lo, hi) = (0..16).fold((f64::MAX, 0.0_f64), |(l, h), i| (l.min(a[i][i]), h.max(a[i][i])));
        let mut sigma = [0.0; 16];
        for (i, s) in sigma.iter_mut().enumerate() {
            *s = (0..16).map(|k| v[i][k] * v[i][k] / a[k][k]).sum::<f64>().sqrt() / scale[i];
        }
        ((hi / lo).sqrt(), sigma)
    }

    fn excitation(duration: f64, rate_hz: f64) -> (f64, [f64; 16]) {
        let columns = columns(&thesis_program(&Geometry::thesis(), duration), rate_hz);
        let mut gram = [[0.0; 16]; 16];
        for k in 0..columns[0].len() {
            for (channel, sigma) in THESIS_WRENCH_NOISE_N_NM.iter().enumerate() {
                let mut row = [0.0; 16];
                for (r, c) in row.iter_mut().zip(&columns) {
                    *r = c[k][channel] / sigma;
                }
                row[10 + channel] = 1.0 / sigma;
                for i in 0..16 {
                    for j in 0..16 {
                        gram[i][j] += row[i] * row[j];
                    }
                }
            }
        }
        scaled_condition_and_sigma(&gram)
    }

    #[test]
    fn the_experiment_excites_every_parameter_and_offset() {
        for (duration, rate) in [(20.0, 200.0), (60.0, 200.0)] {
            let (condition, sigma) = excitation(duration, rate);
            println!(
                "{duration} s at {rate} Hz: column-scaled condition {condition:.1}, 1 sigma {sigma:.4?}"
            );
            assert!(condition < 15.0, "{duration} s: {condition}");
            // At the thesis' noise, 1 σ: 0.15 % of 20 kg, 0.2 mm of its place, 1 % of the largest moment of
            // inertia.
            assert!(sigma[0] < 0.03 && sigma[1..4].iter().all(|s| *s < 0.004), "{sigma:?}");
            assert!(sigma[4..10].iter().all(|s| *s < 0.0038), "{sigma:?}");
        }
    }
}
