use nalgebra::{Matrix3, UnitQuaternion};
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use super::*;
use crate::body::{BodySource, prepare};
use rigident_fit::{FitOptions, NuisanceFit, Silent, fit};
use rigident_io::rig::RigFile;

const G: f64 = 9.80665;
const RATE_HZ: f64 = 100.0;
const NOISE: f64 = 0.01;
/// Sum of the scales' effect: each is this many of the 0.29 % that the class lets expect.
const SIGMA: f64 = 5e-3 / 1.732_050_8;

/// Returns a number of unit variance, of four signs.
fn noise(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (0..4).map(|k| if state.wrapping_shr(60 + k) & 1 == 0 { -0.5 } else { 0.5 }).sum()
}

/// Returns fourteen directions: faces and corners of a cube.
fn directions() -> Vec<Vector3<f64>> {
    let mut all = Vec::new();
    for x in -1..=1 {
        for y in -1..=1 {
            for z in -1..=1_i32 {
                let v = Vector3::new(f64::from(x), f64::from(y), f64::from(z));
                if v.norm_squared() == 1.0 || v.norm_squared() == 3.0 {
                    all.push(v.normalize());
                }
            }
        }
    }
    all
}

/// Makes readings of a body of 3.2 kg that is held for 3 s each way. Its accelerometer reads `a + E a + b`.
fn held(errors: &Matrix3<f64>, bias: &Vector3<f64>) -> Vec<Reading<f64>> {
    let mut state = 11;
    let mut readings = Vec::new();
    for (k, up) in directions().iter().enumerate() {
        for n in 0..300_u64 {
            let force = up * G;
            let read = force + errors * force + bias + Vector3::from_fn(|_, _| NOISE * noise(&mut state));
            let com = Vector3::new(0.03, -0.02, 0.08);
            let wrench = force * 3.2;
            let moment = com.cross(&wrench);
            let mut cell = [wrench.x, wrench.y, wrench.z, moment.x, moment.y, moment.z];
            cell.iter_mut()
                .enumerate()
                .for_each(|(c, v)| *v += if c < 3 { 0.05 } else { 0.002 } * noise(&mut state));
            readings.push(Reading {
                time_ns: (k as u64 * 400 + n) * 10_000_000,
                wrench: Wrench::from_array(cell),
                specific_force: SpecificForce::from_array(read.into()),
                angular_rate: AngularRate::from_array([0.0; 3].map(|_: f64| 1e-3 * noise(&mut state))),
            });
        }
    }
    readings
}

#[test]
fn rests_are_rows_of_the_accelerometer_s_errors() {
    let (scale, angles) = ([0.004, -0.002, 0.001], [0.003, -0.001, 0.002]);
    let mut errors = Matrix3::from_diagonal(&Vector3::from(scale));
    (errors[(1, 0)], errors[(2, 0)], errors[(2, 1)]) = (angles[0], angles[1], angles[2]);
    let bias = Vector3::new(0.03, -0.02, 0.05);
    let readings = held(&errors, &bias);
    let rows = of_motion(&readings, &ImuMounting::PERFECT, RATE_HZ, [NOISE, 1e-3], G);
    assert_eq!(rows.len(), directions().len());
    for row in rows {
        assert!(row.sd < 2.0 * UNSEEN_MPS2);
        let of = |(name, factor): &(String, f64)| {
            let axis = ["x", "y", "z"].iter().position(|axis| name.ends_with(axis));
            let truth = match axis {
                _ if name == GRAVITY => 0.0,
                Some(k) if name.contains("bias") => bias[k],
                Some(k) if name.contains("scale") => scale[k],
                Some(k) => angles[k],
                None => panic!("{name}"),
            };
            factor * truth
        };
        let predicted: f64 = row.terms.iter().map(of).sum();
        // Squares of the errors are left out.
        assert!((row.value - predicted).abs() < 1e-3 + NOISE * 4.0 / 300_f64.sqrt(), "{row:?}: {predicted}");
    }
}

#[test]
fn a_slow_heave_and_a_slow_turn_are_no_rest() {
    let still = |t: f64, turning: bool| {
        let angle = if turning { 0.3 * (0.1 * t).sin() } else { 0.0 };
        let force = UnitQuaternion::from_euler_angles(angle, 0.0, 0.0) * Vector3::new(0.0, 0.0, G);
        let heave = if turning { 0.0 } else { 0.12 * (std::f64::consts::TAU * 0.1 * t).sin() };
        Reading {
            time_ns: (t * 1e9) as u64,
            wrench: Wrench::zero(),
            specific_force: SpecificForce::from_array((force + Vector3::z() * heave).into()),
            angular_rate: AngularRate::from_array([
                if turning { 0.03 * (0.1 * t).cos() } else { 0.0 },
                0.0,
                0.0,
            ]),
        }
    };
    for turning in [false, true] {
        let readings: Vec<_> = (0..6000).map(|k| still(f64::from(k) / RATE_HZ, turning)).collect();
        let rows = of_motion(&readings, &ImuMounting::PERFECT, RATE_HZ, [1e-3, 1e-4], G);
        for row in rows {
            assert!(row.value.abs() < 2.0 * row.sd, "{turning}: {row:?}");
        }
    }
}

/// A scale that all axes share cannot be distinguished from the load cell's gain by any motion; a rest shows
/// it.
#[test]
fn a_scale_that_all_axes_share_is_named_and_the_mass_is_right() {
    let mut rig = RigFile::default();
    rig.recording.gravity_std_mps2 = Some(1e-3);
    let fitted = |common: f64| {
        let readings = held(&(Matrix3::identity() * common), &Vector3::zeros());
        let source = BodySource::new(prepare::input(&rig, readings, false, RATE_HZ), rig.imu.first());
        fit(&source, &FitOptions::default(), &Silent).unwrap()
    };
    for common in [0.0, 5.0 * SIGMA] {
        let found = fitted(common);
        let scale = || found.nuisances.iter().filter(|k| k.nuisance.group == "accelerometer scale");
        let pull: Vec<f64> = scale().map(NuisanceFit::pull).collect();
        for k in scale() {
            let off = k.value - common;
            assert!(
                off.abs() < 2.0 * k.sd && k.sd < 0.4 * SIGMA,
                "{}: {} ± {}",
                k.nuisance.name,
                k.value,
                k.sd
            );
        }
        assert_eq!(pull.iter().any(|pull| *pull > 4.42), common > 0.0, "{pull:?}");
        let mass = found.estimate.measured(0).unwrap();
        assert!((mass.value - 3.2).abs() < mass.u95, "{mass:?}");
        // Without rests each of three scales brings a third of its own share.
        let brought = scale().map(|k| k.contributions[0].powi(2)).sum::<f64>().sqrt();
        assert!(brought < 0.2 * 3.2 * SIGMA / 3_f64.sqrt(), "{brought}");
    }
}

/// Makes readings of a body that turns by up to 0.7 rad about every axis and sways by centimetres. Its
/// accelerometer reads `scale` times the true value.
fn swaying(scale: f64, seconds: usize) -> Vec<Reading<f64>> {
    let attitude = |t: f64| {
        let angles = [0.7 * (1.3 * t).sin(), 0.6 * (2.1 * t + 1.0).sin(), 0.5 * (1.7 * t + 2.0).sin()];
        UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2])
    };
    let step = 1e-4;
    (0..seconds * RATE_HZ as usize)
        .map(|k| {
            let t = k as f64 / RATE_HZ;
            let sway = Vector3::new(0.4 * (3.0 * t).sin(), 0.3 * (5.0 * t).cos(), 0.5 * (4.0 * t).sin());
            let now = attitude(t);
            let force = now.inverse() * (Vector3::new(0.0, 0.0, G) + sway) * scale;
            let rate = (attitude(t - step).inverse() * attitude(t + step)).scaled_axis() / (2.0 * step);
            Reading {
                time_ns: (t * 1e9).round() as u64,
                wrench: Wrench::from_array([0.0; 6]),
                specific_force: SpecificForce::from_array(force.into()),
                angular_rate: AngularRate::from_array(rate.into()),
            }
        })
        .collect()
}

#[test]
fn a_body_that_never_rests_and_stays_where_it_is_shows_gravity() {
    let row = |scale, seconds| of_turning(&swaying(scale, seconds), &ImuMounting::default(), RATE_HZ, G);
    assert!(row(1.0, 20).is_none() && row(1.02, 20).is_none());
    for scale in [0.9, 1.1] {
        let found = row(scale, 20).unwrap();
        assert!((found.value - (scale - 1.0) * G).abs() < 0.15, "{}", found.value);
        // All three scales together are the error.
        let scales = found.terms.iter().filter(|(name, _)| name.starts_with("accelerometer_scale"));
        let sum: f64 = scales.map(|(_, along)| along).sum();
        assert!((sum / (scale * G) - 1.0).abs() < 0.02, "{sum}");
    }
    // Nothing is said of less than a stretch.
    assert!(row(0.9, 4).is_none());
}
