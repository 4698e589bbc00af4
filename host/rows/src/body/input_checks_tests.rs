use rigident_shared::calibration::ImuMounting;
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, SpecificForce, Wrench};

use super::*;

const G: f64 = 9.80665;

/// Returns ten seconds at 100 Hz: shaken with twice gravity, twice a second, at rest for the last two
/// seconds if so asked.
fn input(rests: bool, unit: f64, rate: [f64; 3]) -> Input {
    let readings = (0..1000_u32)
        .map(|n| {
            let t = f64::from(n) * 0.01;
            let shake =
                if rests && n >= 800 { 0.001 * t } else { 2.0 * G * (2.0 * std::f64::consts::TAU * t).sin() };
            Reading {
                time_ns: u64::from(n) * 10_000_000,
                wrench: Wrench::from_array([t, 0.0, 30.0, 0.0, 0.0, 0.0]),
                specific_force: SpecificForce::from_array([shake / unit, 0.0, G / unit]),
                angular_rate: AngularRate::from_array(rate),
            }
        })
        .collect();
    Input {
        readings,
        is_static: false,
        rate_hz: 100.0,
        mounting: ImuMounting::default(),
        channel_sigma: None,
        gyro_sigma: None,
        known_offset: None,
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        limits: Limits::none(),
    }
}

fn unit_named(found: Result<(), Implausible>) -> Option<(&'static str, f64)> {
    match found {
        Err(Implausible::NotGravity { unit, .. }) => unit,
        other => panic!("{other:?}"),
    }
}

#[test]
fn metres_per_second_squared_pass_shaken_or_at_rest() {
    for rests in [true, false] {
        assert_eq!(check(&input(rests, 1.0, [0.0; 3]), G, false), Ok(()));
    }
}

#[test]
fn an_accelerometer_in_g_or_thousandths_is_refused_by_name_shaken_or_at_rest() {
    for rests in [true, false] {
        let g = check(&input(rests, G, [0.0; 3]), G, false);
        assert!(g.clone().unwrap_err().to_string().contains("looks like g: give scale = 9.80665"), "{g:?}");
        // A body that turns all the time is no excuse.
        assert_eq!(unit_named(check(&input(rests, G, [0.0, 0.0, 1.0]), G, false)), Some(("g", G)));
        assert_eq!(unit_named(check(&input(rests, 1e-3 * G, [0.0; 3]), G, false)), Some(("mg", 1e-3 * G)));
    }
    // Feet per second squared.
    assert_eq!(unit_named(check(&input(true, 0.3048, [0.0; 3]), G, false)), None);
}

#[test]
fn a_scale_in_the_rig_file_counts_and_so_does_the_gravity_stated() {
    let mut scaled = input(true, G, [0.0; 3]);
    scaled.mounting.accel_scale = [G; 3];
    assert_eq!(check(&scaled, G, false), Ok(()));
    assert_eq!(check(&input(true, G, [0.0; 3]), 1.0, false), Ok(()));
}

/// Three g outwards at 7 rad/s are half a metre of lever.
#[test]
fn a_centrifuge_is_no_wrong_unit() {
    let mut turning = input(true, 1.0, [0.0, 0.0, 7.0]);
    for (n, reading) in turning.readings.iter_mut().enumerate() {
        reading.specific_force = SpecificForce::from_array([0.5 * 49.0, 1e-3 * n as f64, G]);
    }
    assert_eq!(check(&turning, G, false), Ok(()));
}

/// A body that turns to and fro all the time, its IMU 1.16 m away: nowhere |a| is near gravity.
#[test]
fn an_imu_far_away_is_no_wrong_unit_and_millimetres_are_reported() {
    let lever = [1.0, -0.3, 0.5];
    let mut far = input(true, 1.0, [0.0; 3]);
    for (n, reading) in far.readings.iter_mut().enumerate() {
        let t = n as f64 * 0.01;
        let (w, rate) = (std::f64::consts::TAU * 0.6, 1.0 + 2.5 * (std::f64::consts::TAU * 0.6 * t).cos());
        let gained = -2.5 * w * (w * t).sin();
        // About z: a = g − ω² p + ω̇ × p.
        let [x, y, _] = lever;
        let force = [-rate * rate * x - gained * y, -rate * rate * y + gained * x, G];
        reading.specific_force = SpecificForce::from_array(force);
        reading.angular_rate = AngularRate::from_array([0.0, 0.0, rate]);
    }
    let at = |scale: f64, unit: f64| {
        let mut scaled = far.clone();
        for reading in &mut scaled.readings {
            let force = reading.specific_force.array().map(|a| scale * a / unit);
            reading.specific_force = SpecificForce::from_array(force);
        }
        scaled.mounting.position = Position::from_array(lever);
        check(&scaled, G, false)
    };
    assert_eq!(at(1.0, 1.0), Ok(()));
    // In thousandths of g, and three times as large as any lever makes it.
    assert!(at(1.0, 1e-3 * G).is_err() && at(4.0, 1.0).is_err());
    assert_eq!((far_away(lever), far_away([0.0, 0.0, 3.0])), (None, None));
    assert!(far_away([50.0, -20.0, 30.0]).is_some_and(|said| said.contains("millimetres")));
}

#[test]
fn sensors_that_never_change_are_frozen_and_not_without_noise() {
    let mut wrench = input(true, 1.0, [0.0; 3]);
    let mut imu = wrench.clone();
    for (w, i) in wrench.readings.iter_mut().zip(&mut imu.readings) {
        w.wrench = Wrench::from_array([1.0; 6]);
        i.specific_force = SpecificForce::from_array([0.0; 3]);
    }
    assert_eq!(check(&wrench, G, false), Err(Implausible::FrozenWrench(1000)));
    assert_eq!(check(&imu, G, false), Err(Implausible::FrozenImu(1000)));
    // A few equal readings may be chance.
    wrench.readings.truncate(49);
    assert_eq!(check(&wrench, G, false), Ok(()));
}

#[test]
fn still_poses_of_gravity_in_units_of_g_are_refused_as_such() {
    let mut poses = input(true, G, [0.0; 3]);
    poses.is_static = true;
    poses.readings.retain(|r| r.time_ns >= 8_000_000_000);
    let error = check(&poses, G, true).unwrap_err().to_string();
    assert!(error.contains("the gravity columns") && error.contains("looks like g"), "{error}");
}

#[test]
fn a_gyro_tells_a_turning_body_from_still_poses_whatever_its_bias() {
    let swing = |amplitude: f64| -> Vec<[f64; 3]> {
        (0..500).map(|n| [0.7, amplitude * (f64::from(n) * 0.1).sin(), 0.0]).collect()
    };
    // |sin| is above 0.1/0.3 in 78 % of the time.
    match check_still(&swing(0.3)) {
        Err(Implausible::Turning { turning, rows: 500, fastest }) => {
            assert!((380..=400).contains(&turning) && (fastest - 0.3).abs() < 0.01, "{turning} {fastest}");
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(check_still(&swing(0.05)), Ok(()));
    // The odd knock between poses is no motion.
    let mut knocked = swing(0.0);
    knocked[7] = [0.7, 3.0, 0.0];
    assert_eq!(check_still(&knocked), Ok(()));
}

#[test]
fn poses_a_millisecond_apart_are_reported_and_minutes_apart_are_not() {
    let every = |step: f64| hurried_poses(&(0..100).map(|n| f64::from(n) * step).collect::<Vec<_>>());
    assert!(every(1e-3).is_some_and(|w| w.contains("every 1.000 ms")));
    assert_eq!((every(20.0), hurried_poses(&[]), hurried_poses(&[3.0])), (None, None, None));
}

/// Twelve poses all around with lengths that noise of 0.02 % has, and the same with a scale, of one axis too.
#[test]
fn gravity_columns_have_the_length_of_gravity() {
    let attitudes: Vec<[f64; 3]> = (0..12)
        .map(|k| {
            let (azimuth, z) = (2.4 * f64::from(k), 1.0 - (2.0 * f64::from(k) + 1.0) / 12.0);
            let across = (1.0 - z * z).sqrt();
            [across * azimuth.cos(), across * azimuth.sin(), z]
        })
        .collect();
    let lengths = |scale: [f64; 3]| -> Vec<f64> {
        let of = |(k, v): (usize, &[f64; 3])| {
            let noise = 1.0 + 2e-4 * (7.0 * k as f64).sin();
            9.80665 * noise * super::length(std::array::from_fn(|i| scale[i] * v[i]))
        };
        attitudes.iter().enumerate().map(of).collect()
    };
    let check = |scale| super::check_length(&lengths(scale), 9.80665, 0.0173);
    assert_eq!(check([1.0; 3]), Ok(()));
    assert_eq!(check([1.005; 3]), Ok(()));
    assert!(matches!(check([1.03; 3]), Err(Implausible::GravityLength { length, .. }) if length > 10.09));
    assert!(check([1.03; 3]).unwrap_err().to_string().contains("correct their scale"));
    let of_axis = check([1.0, 1.0, 1.1]).unwrap_err();
    assert!(of_axis.to_string().contains("an axis of them"), "{of_axis}");
    // Columns of few digits beside a gravity of many.
    assert_eq!(super::check_length(&[9.81; 12], 9.8123, 6e-4), Ok(()));
}
