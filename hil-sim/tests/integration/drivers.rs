//! The firmware's drivers against the simulator's register models, which were written apart from them.

use std::convert::Infallible;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use hexapod::FrameMotion;
use hexapod::{Axis, Geometry, MotionProgram, Segment, SineTerm, Trajectory};
use nalgebra::Vector3;
use rigident_firmware::drivers::ads131m08::{AdcConfig, AdcError, Ads131m08};
use rigident_firmware::drivers::imu::{Imu, ImuError, ImuSample};
use rigident_sim::devices::Device;
use rigident_sim::rig::{BusEvent, Rig, RigConfig, SharedRig};
use rigident_sim::sensors::SensorModels;

const GAIN: u8 = 64;
/// One code of the load cell's converter, V.
const STEP_V: f64 = 1.2 / 64.0 / 8_388_608.0;
/// One step of the IMU: 18 bits of ±16 g, 19 bits of ±2000 °/s.
const STEP_MPS2: f64 = 16.0 * 9.80665 / 131_072.0;
const STEP_RADPS: f64 = 2000.0 * std::f64::consts::PI / 180.0 / 262_144.0;

/// Chip select low, every byte, chip select high.
struct Wire {
    rig: SharedRig,
    device: Device,
}

impl ErrorType for Wire {
    type Error = Infallible;
}

impl SpiDevice for Wire {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let mut rig = self.rig.lock().unwrap();
        match operations {
            [Operation::TransferInPlace(bytes)] => rig.transfer(self.device, bytes),
            [Operation::Write(bytes)] => rig.transfer(self.device, &mut bytes.to_vec()),
            _ => panic!("not one transfer"),
        }
        Ok(())
    }
}

struct NoWait;

impl DelayNs for NoWait {
    fn delay_ns(&mut self, _: u32) {}
}

/// Returns a motion gentle enough for the simulated sensors' ranges, 75 °/s among them.
fn swing(duration_s: f64) -> MotionProgram {
    let term = |axis, amplitude, frequency_hz| SineTerm { axis, amplitude, frequency_hz, phase_rad: 0.4 };
    MotionProgram {
        start: Geometry::thesis().home(),
        segments: vec![Segment::Multisine {
            duration_s,
            ramp_s: 0.2,
            terms: vec![term(Axis::Roll, 0.04, 0.7), term(Axis::Pitch, 0.03, 0.9), term(Axis::X, 0.01, 1.1)],
        }],
    }
}

/// The readings that the sensors must give, from the motion and the body alone.
struct Expected {
    config: RigConfig,
    trajectory: Trajectory,
}

impl Expected {
    fn new(config: &RigConfig, duration_s: f64) -> Self {
        Self { config: config.clone(), trajectory: swing(duration_s).trajectory().unwrap() }
    }

    /// Returns the motion of S this long before `time_ns`, and gravity.
    fn motion(&self, time_ns: u64, delay_s: f64) -> (FrameMotion, Vector3<f64>) {
        let cell = &self.config.load_cell;
        let plate = self.trajectory.state(time_ns as f64 * 1e-9 - delay_s);
        let motion = FrameMotion::of_plate(&plate)
            .fixed_frame(&Vector3::from(cell.position_m), &cell.rotation().unwrap());
        (motion, Vector3::new(0.0, 0.0, -self.config.gravity_mps2))
    }

    /// Checks codes to half a step on each of six gauges, through the calibration's row.
    fn check_codes(&self, time_ns: u64, codes: &[i32; 8]) {
        let (motion, gravity) = self.motion(time_ns, self.config.load_cell_group_delay_s());
        let wrench = self.config.body.wrench(&motion, &gravity);
        for (component, (row, want)) in self.config.gauge_calibration.iter().zip(wrench).enumerate() {
            let got: f64 = row.iter().zip(codes).map(|(c, code)| c * f64::from(*code) * STEP_V).sum();
            let bound: f64 = row.iter().map(|c| c.abs() * STEP_V / 2.0).sum();
            assert!((got - want).abs() <= bound * 1.001, "{component} at {time_ns}: {got} {want}");
        }
        // The excitation, 1 V of 1.2 V at gain 1, and an input that is shorted.
        assert_eq!(codes[6..], [6_990_507, 0]);
    }

    /// Checks an IMU's sample to half a step, and the f32 arithmetic behind it: four roundings.
    fn check(&self, time_ns: u64, got: &ImuSample) {
        let (motion, gravity) = self.motion(time_ns, self.config.imu_group_delay_s());
        let imu = &self.config.imu;
        let motion = motion.fixed_frame(&Vector3::from(imu.position_m), &imu.rotation().unwrap());
        let (force, rate) = (motion.specific_force(&gravity), motion.body_rate());
        for axis in 0..3 {
            for (got, want, step) in [
                (got.specific_force_mps2[axis], force[axis], STEP_MPS2),
                (got.angular_rate_radps[axis], rate[axis], STEP_RADPS),
            ] {
                let bound = step / 2.0 * (1.0 + 1e-9) + 2.0 * f64::from(f32::EPSILON) * want.abs();
                assert!((f64::from(got) - want).abs() <= bound, "axis {axis} at {time_ns}: {got} {want}");
            }
        }
        assert_eq!(got.temperature_c, 25.0);
    }
}

/// Returns a moving rig, ideal sensors, its converters brought up by the drivers.
fn moving(duration_s: f64, rate_hz: u32) -> (SharedRig, Expected, Ads131m08<Wire>, Imu<Wire>) {
    let config = RigConfig::thesis_horizontal()
        .with_sensors(SensorModels::ideal())
        .with_rates(f64::from(rate_hz), f64::from(rate_hz));
    let expected = Expected::new(&config, duration_s);
    let rig = Rig::new(config).unwrap().shared();
    let mut adc = Ads131m08::new(Wire { rig: rig.clone(), device: Device::LoadCell });
    let mut imu = Imu::new(Wire { rig: rig.clone(), device: Device::Imu });
    adc.bring_up(&mut NoWait, &AdcConfig { rate_hz, gain: GAIN }).unwrap();
    imu.bring_up(&mut NoWait, rate_hz).unwrap();
    let mut switched_on = rig.lock().unwrap();
    switched_on.load_program(swing(duration_s)).unwrap();
    switched_on.start().unwrap();
    drop(switched_on);
    (rig, expected, adc, imu)
}

fn next_event(rig: &SharedRig) -> BusEvent {
    rig.lock().unwrap().next_event()
}

/// Returns the next time of the IMU's signals, the load cell's left alone.
fn next_imu_event(rig: &SharedRig) -> u64 {
    loop {
        match next_event(rig) {
            BusEvent::ImuReady(time_ns) => return time_ns,
            BusEvent::LoadCellReady(_) | BusEvent::SecondImuReady(_) => {}
            BusEvent::Idle => panic!("the program is over"),
        }
    }
}

#[test]
fn the_converters_run_at_the_rates_asked_for() {
    for rate_hz in [500, 1000, 2000, 4000] {
        let (rig, ..) = moving(0.5, rate_hz);
        let rig = rig.lock().unwrap();
        assert_eq!(rig.load_cell_converter().rate_hz(), Some(f64::from(rate_hz)));
        assert_eq!(rig.imu_device().rate_hz(), Some(f64::from(rate_hz)));
    }
    let rig = Rig::new(RigConfig::thesis_horizontal()).unwrap().shared();
    let mut adc = Ads131m08::new(Wire { rig: rig.clone(), device: Device::LoadCell });
    adc.bring_up(&mut NoWait, &AdcConfig { rate_hz: 250, gain: 1 }).unwrap();
    assert_eq!(rig.lock().unwrap().load_cell_converter().rate_hz(), Some(250.0));
}

#[test]
fn every_sample_is_the_simulated_value_to_half_a_step() {
    for rate_hz in [500, 1000] {
        let (rig, expected, mut adc, mut imu) = moving(2.0, rate_hz);
        let (mut frames, mut samples) = (0, 0);
        loop {
            match next_event(&rig) {
                BusEvent::SecondImuReady(_) => panic!("there is no second IMU"),
                BusEvent::Idle => break,
                BusEvent::LoadCellReady(time_ns) => {
                    let frame = adc.read_frame().unwrap();
                    expected.check_codes(time_ns, &frame.codes);
                    for (volts, code) in frame.gauges_v(GAIN).into_iter().zip(frame.codes) {
                        let exact = f64::from(code) * STEP_V;
                        let bound = 2.0 * f64::from(f32::EPSILON) * exact.abs();
                        assert!((f64::from(volts) - exact).abs() <= bound);
                    }
                    assert_eq!(frame.saturated, 0);
                    frames += 1;
                }
                BusEvent::ImuReady(time_ns) => {
                    expected.check(time_ns, &imu.read().unwrap().unwrap());
                    samples += 1;
                }
            }
        }
        // The IMU's last sample falls 0.37 ms behind the end.
        assert_eq!((frames, samples), (2 * rate_hz, 2 * rate_hz - 1));
        assert_eq!((adc.crc_errors(), imu.errors(), imu.skipped()), (0, 0, 0));
    }
}

#[test]
fn a_flipped_bit_raises_the_crc_errors_by_exactly_one_and_costs_one_sample() {
    let (rig, _, mut adc, _) = moving(1.0, 1000);
    let mut frames = 0;
    let mut lost = 0;
    while frames < 3 * 240 {
        if !matches!(next_event(&rig), BusEvent::LoadCellReady(_)) {
            continue;
        }
        if frames % 3 == 0 {
            rig.lock().unwrap().flip_load_cell_bit(0, frames / 3);
            assert!(matches!(adc.read_frame(), Err(AdcError::Crc { .. })), "bit {}", frames / 3);
            lost += 1;
        } else {
            adc.read_frame().unwrap();
        }
        assert_eq!(adc.crc_errors(), lost);
        frames += 1;
    }
    assert_eq!(lost, 240);
}

#[test]
fn a_sample_belongs_to_its_signal_after_a_pause_and_after_an_overflow() {
    let (rig, expected, _, mut imu) = moving(1.0, 1000);
    for _ in 0..5 {
        next_imu_event(&rig);
    }
    let time_ns = next_imu_event(&rig);
    expected.check(time_ns, &imu.read().unwrap().unwrap());
    assert_eq!((imu.skipped(), imu.errors()), (5, 0));

    // 102 packets fill the FIFO.
    for _ in 0..150 {
        next_imu_event(&rig);
    }
    assert_eq!(imu.read(), Err(ImuError::Overflow));
    let time_ns = next_imu_event(&rig);
    expected.check(time_ns, &imu.read().unwrap().unwrap());
    assert_eq!((imu.skipped(), imu.errors(), imu.overflows()), (5, 1, 1));
}
