//! The rig through its registers, read by hand.

use super::*;
use crate::sensors::SensorModels;
use hexapod::{Axis, Geometry, Segment, SineTerm};

fn swing() -> MotionProgram {
    let term = |axis, amplitude, frequency_hz| SineTerm { axis, amplitude, frequency_hz, phase_rad: 0.4 };
    MotionProgram {
        start: Geometry::thesis().home(),
        segments: vec![Segment::Multisine {
            duration_s: 4.0,
            ramp_s: 1.0,
            terms: vec![term(Axis::Roll, 0.15, 0.7), term(Axis::Pitch, 0.1, 0.9), term(Axis::X, 0.02, 1.1)],
        }],
    }
}

fn write_adc(rig: &mut Rig, address: u16, value: u16) {
    let mut frame = [0; 30];
    frame[..2].copy_from_slice(&(0x6000 | address << 7).to_be_bytes());
    frame[3..5].copy_from_slice(&value.to_be_bytes());
    rig.transfer(Device::LoadCell, &mut frame);
}

/// Sets the converter to 1 kHz at gain 64 and the IMU to 1 kHz with 20-bit packets and a watermark interrupt.
fn bring_up(rig: &mut Rig) {
    write_adc(rig, 0x03, 0xFF16);
    write_adc(rig, 0x04, 0x6666);
    write_adc(rig, 0x05, 0x6666);
    for (address, value) in
        [(0x16, 0xC0), (0x5F, 0x37), (0x60, 20), (0x65, 0x04), (0x4F, 0x06), (0x50, 0x06), (0x4E, 0x0F)]
    {
        rig.transfer(Device::Imu, &mut [address, value]);
    }
}

fn read_wrench(rig: &mut Rig) -> [f64; 6] {
    let mut frame = [0; 30];
    rig.transfer(Device::LoadCell, &mut frame);
    let mut gauges = [0.0; 6];
    for (g, b) in gauges.iter_mut().zip(frame[3..].chunks(3)) {
        *g = f64::from(i32::from_be_bytes([b[0], b[1], b[2], 0]) >> 8) * 1.2 / 64.0 / 8_388_608.0;
    }
    rig.config().gauge_calibration.map(|row| row.iter().zip(gauges).map(|(c, g)| c * g).sum())
}

fn read_imu(rig: &mut Rig) -> ([f64; 3], [f64; 3]) {
    let mut packet = [0; 21];
    packet[0] = 0xB0;
    rig.transfer(Device::Imu, &mut packet);
    let value = |i: usize, nibble: u8| {
        let at = 2 + 2 * i;
        let wide = i32::from_be_bytes([packet[at], packet[at + 1], nibble << 4, 0]) >> 12;
        f64::from(wide) / 524_288.0
    };
    let mut out = ([0.0; 3], [0.0; 3]);
    for i in 0..3 {
        out.0[i] = value(i, packet[18 + i] >> 4) * 16.0 * 9.80665;
        out.1[i] = value(i + 3, packet[18 + i] & 15) * 2000_f64.to_radians();
    }
    out
}

fn rig(sensors: SensorModels) -> Rig {
    let mut rig = Rig::new(RigConfig::thesis_horizontal().with_sensors(sensors)).unwrap();
    bring_up(&mut rig);
    rig.load_program(swing()).unwrap();
    rig.start().unwrap();
    rig
}

#[test]
fn registers_hold_the_physics_of_the_instant_less_the_stated_delays() {
    let mut sensors = SensorModels::ideal();
    sensors.imu.delay_s = 0.6e-3;
    let mut rig = rig(sensors);
    let mechanics = Mechanics::new(rig.config()).unwrap();
    let trajectory = swing().trajectory().unwrap();
    let (cell_delay, imu_delay) = (rig.config().load_cell_group_delay_s(), rig.config().imu_group_delay_s());
    let (mut wrenches, mut samples) = (0, 0);
    loop {
        match rig.next_event() {
            BusEvent::Idle => break,
            BusEvent::SecondImuReady(_) => panic!("there is no second IMU"),
            BusEvent::LoadCellReady(t) => {
                let want = mechanics.wrench(&trajectory.state(t as f64 * 1e-9 - cell_delay));
                let got = read_wrench(&mut rig);
                for (i, (g, w)) in got.iter().zip(want).enumerate() {
                    // Half a converter step (1.1 nV) on each of six gauges through the calibration's row.
                    let step = 1.2 / 64.0 / 8_388_608.0 / 2.0;
                    let row: f64 = rig.config().gauge_calibration[i].iter().map(|c| c.abs()).sum();
                    assert!((g - w).abs() <= row * step * 1.001, "{i} at {t}: {got:?} {want:?}");
                }
                wrenches += 1;
            }
            BusEvent::ImuReady(t) => {
                let (a, g) = mechanics.imu(&trajectory.state(t as f64 * 1e-9 - imu_delay));
                let (got_a, got_g) = read_imu(&mut rig);
                for i in 0..3 {
                    assert!((got_a[i] - a[i]).abs() <= 16.0 * 9.80665 / 131_072.0 / 2.0 * 1.001);
                    assert!((got_g[i] - g[i]).abs() <= 2000_f64.to_radians() / 262_144.0 / 2.0 * 1.001);
                }
                samples += 1;
            }
        }
    }
    assert!(rig.is_done());
    // 4 s at 1 kHz each; the IMU's first sample is 0.37 ms late and its last one falls behind the end.
    assert_eq!((wrenches, samples), (4000, 3999));
    assert_eq!(rig.now_ns(), 4_000_000_000);
}

#[test]
fn events_come_in_time_order_and_none_while_no_program_runs() {
    let mut rig = rig(SensorModels::thesis());
    let mut last = 0;
    let mut count = 0;
    while let BusEvent::LoadCellReady(t) | BusEvent::ImuReady(t) = rig.next_event() {
        assert!(t >= last);
        (last, count) = (t, count + 1);
    }
    assert!(count > 7000);
    let now = rig.now_ns();
    for _ in 0..10 {
        assert_eq!(rig.next_event(), BusEvent::Idle);
    }
    assert_eq!(rig.now_ns(), now);
}

#[test]
fn free_running_sensors_sample_a_resting_plate_up_to_the_given_time() {
    let mut rig = Rig::new(RigConfig::thesis_horizontal().with_sensors(SensorModels::ideal())).unwrap();
    bring_up(&mut rig);
    let mut events = 0;
    while rig.next_event_before(10_000_000) != BusEvent::Idle {
        events += 1;
    }
    assert_eq!((events, rig.now_ns(), rig.motion()), (19, 10_000_000, MotionState::Holding));
    let wrench = read_wrench(&mut rig);
    assert!((wrench[2] - 20.0 * 9.80665).abs() < 1e-3 && wrench[0].abs() < 1e-3, "{wrench:?}");
}

#[test]
fn the_same_seed_gives_the_same_words_and_another_seed_others() {
    let words = |seed| {
        let mut rig = Rig::new(RigConfig::thesis_horizontal().with_seed(seed)).unwrap();
        bring_up(&mut rig);
        rig.load_program(swing()).unwrap();
        rig.start().unwrap();
        let mut out = Vec::new();
        for _ in 0..200 {
            match rig.next_event() {
                BusEvent::LoadCellReady(_) => {
                    let mut frame = [0; 30];
                    rig.transfer(Device::LoadCell, &mut frame);
                    out.extend_from_slice(&frame);
                }
                _ => out.extend(read_imu(&mut rig).0.map(|a| a as u8)),
            }
        }
        out
    };
    assert_eq!(words(4), words(4));
    assert_ne!(words(4), words(5));
}

#[test]
fn the_apparent_offset_is_the_remainder_of_a_biased_accelerometer() {
    // Statics only: with the biased specific force the weight comes out wrong by exactly what the offset
    // takes off.
    let config = RigConfig::thesis_vertical();
    let mechanics = Mechanics::new(&config).unwrap();
    let experiment = config.sensors.draw(3);
    let plate =
        hexapod::Trajectory::resting(&Pose { position_m: [0.0, 0.0, 0.7], rpy_rad: [0.3, -0.2, 0.1] })
            .state(0.0);
    let (accel, _) = mechanics.imu(&plate);
    let rotation = config.imu.rotation().unwrap();
    let mut biased = nalgebra::Vector3::from(accel);
    biased += nalgebra::Vector3::from(experiment.accel_bias_mps2);
    let a = rotation * biased;
    let c = nalgebra::Vector3::from(config.body.com_m);
    let (force, moment) = (config.body.mass_kg * a, config.body.mass_kg * c.cross(&a));
    let believed = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
    let offset = mechanics.apparent_offset(&experiment);
    for (i, truth) in mechanics.wrench(&plate).into_iter().enumerate() {
        let read = truth + experiment.load_cell_offset_n_nm[i];
        assert!((read - believed[i] - offset[i]).abs() < 1e-11, "{i}");
    }
}

#[test]
fn readings_without_faults_are_the_ideal_rows_and_with_noise_scatter_about_them() {
    let ideal =
        Readings::new(&RigConfig::thesis_horizontal().with_sensors(SensorModels::ideal()), &swing(), 200.0)
            .unwrap();
    assert_eq!(ideal.ideal().len(), 801);
    assert!(ideal.measured(1).zip(ideal.ideal()).all(|(m, i)| m == *i));
    let noisy = Readings::new(&RigConfig::thesis_horizontal(), &swing(), 200.0).unwrap();
    assert_eq!(noisy.ideal(), ideal.ideal());
    let offset = noisy.truth(9).experiment.load_cell_offset_n_nm;
    let n = noisy.ideal().len() as f64;
    for i in 0..6 {
        let sum: f64 = noisy.measured(9).zip(noisy.ideal()).map(|(m, t)| m.wrench[i] - t.wrench[i]).sum();
        let sigma = SensorModels::thesis().load_cell.noise_n_nm[i];
        assert!((sum / n - offset[i]).abs() < 5.0 * sigma / n.sqrt());
    }
}

#[test]
fn an_undeclared_delay_shifts_the_load_cell_against_the_imu() {
    let mut sensors = SensorModels::ideal();
    sensors.load_cell.undeclared_delay_s = 5e-3;
    let config = RigConfig::thesis_horizontal();
    let shifted = Readings::new(&config.clone().with_sensors(sensors), &swing(), 200.0).unwrap();
    let straight = Readings::new(&config.with_sensors(SensorModels::ideal()), &swing(), 200.0).unwrap();
    for k in 1..straight.ideal().len() {
        let (late, row) = (&shifted.ideal()[k], &straight.ideal()[k]);
        assert_eq!(late.angular_rate, row.angular_rate);
        for i in 0..6 {
            assert!((late.wrench[i] - straight.ideal()[k - 1].wrench[i]).abs() < 1e-9);
        }
    }
}

#[test]
fn a_bandwidth_that_is_stated_costs_only_its_droop() {
    // The pole's delay is stated and taken off; what is left is second order: (f/f_c)² ≈ 5e-4 at 1.1 Hz of 50
    // Hz.
    let mut sensors = SensorModels::ideal();
    sensors.load_cell.bandwidth_hz = Some(50.0);
    let config = RigConfig::thesis_horizontal();
    let slow = Readings::new(&config.clone().with_sensors(sensors), &swing(), 1000.0).unwrap();
    let straight = Readings::new(&config.with_sensors(SensorModels::ideal()), &swing(), 1000.0).unwrap();
    let spread = |i: usize| straight.ideal().iter().fold(0.0_f64, |m, r| m.max(r.wrench[i].abs()));
    for (got, want) in slow.measured(1).zip(straight.ideal()).skip(100) {
        for i in 0..6 {
            assert!(
                (got.wrench[i] - want.wrench[i]).abs() < 2e-3 * spread(i).max(0.1),
                "{i} at {}",
                got.time_ns
            );
        }
    }
}
