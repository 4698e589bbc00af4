//! The parts of a rig, and the fixed frames that follow from it.

use hexapod::{
    BadRotation, BodyParameters, FrameMotion, Geometry, IdealSensors, MotionError, Mounting, Payload,
    PlateState,
};
use nalgebra::{Matrix3, Vector3};

use crate::devices::Ads131m08;
use crate::links::{JointState, SecondLink};
use crate::sensors::{Experiment, ImuModel, PerExperiment, SensorModels};

/// Errors in the use of the rig.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RigError {
    /// The motion program.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// The gauge calibration has no inverse.
    #[error("the gauge calibration matrix is singular: no voltages belong to some wrenches")]
    SingularCalibration,
    /// A mounting without a rotation.
    #[error(transparent)]
    BadRotation(#[from] BadRotation),
    /// The plate moves.
    #[error("the platform is moving: stop it or wait for the end of its program")]
    Busy,
    /// Nothing to start.
    #[error("no motion program is loaded")]
    NoProgram,
    /// A point of a stream after its time.
    #[error("a set point came after its time: the stream was interrupted and the platform came to rest")]
    Late,
    /// A rate for readings that makes no sense.
    #[error("{0} Hz is not a rate at which readings can be taken")]
    BadRate(f64),
}

/// The description of a rig. Frames: P plate, S load cell, U IMU.
#[derive(Clone, Debug, PartialEq)]
pub struct RigConfig {
    /// The body, in S.
    pub body: BodyParameters,
    /// S on the plate.
    pub load_cell: Mounting,
    /// U in S: the lever arm and `R_SU`.
    pub imu: Mounting,
    /// The link that hangs on the body, with an IMU of its own like the first.
    pub second: Option<SecondLink>,
    /// The sensors.
    pub sensors: SensorModels,
    /// Rate the load cell's converter is meant to be set to, Hz: 250, 500, 1000, …; its registers decide.
    pub adc_hz: f64,
    /// Rate the IMU is meant to be set to, Hz: 200, 500, 1000, …; its registers decide.
    pub imu_hz: f64,
    /// The IMU's samples come this much after the load cell's, s.
    pub imu_phase_s: f64,
    /// `wrench = calibration · gauges`, N/V and N m/V.
    pub gauge_calibration: [[f64; 6]; 6],
    /// Gravity, downward positive, m/s².
    pub gravity_mps2: f64,
    /// The platform.
    pub geometry: Geometry,
    /// Seed of everything random.
    pub seed: u64,
}

impl RigConfig {
    /// Returns the thesis' rig with its test body lying across the platform.
    pub fn thesis_horizontal() -> Self {
        let Payload { body, load_cell, imu, gravity_mps2 } = Payload::thesis_horizontal();
        Self {
            body,
            load_cell,
            imu,
            second: None,
            sensors: SensorModels::thesis(),
            adc_hz: 1000.0,
            imu_hz: 1000.0,
            imu_phase_s: 0.37e-3,
            gauge_calibration: Self::default_calibration(),
            gravity_mps2,
            geometry: Geometry::thesis(),
            seed: 1,
        }
    }

    /// Returns the thesis' rig with its test body standing upright.
    pub fn thesis_vertical() -> Self {
        Self { body: BodyParameters::thesis_vertical(), ..Self::thesis_horizontal() }
    }

    /// Returns the thesis' rig with an arm hanging on its test body. Both IMUs are calibrated: with links
    /// that turn against each other an accelerometer's bias is no constant wrench, which the offset could
    /// take up. The arm is faster than the thesis' gyro.
    pub fn two_links() -> Self {
        let rig = Self::thesis_horizontal();
        let imu = ImuModel {
            accel_bias_mps2: PerExperiment::ZERO,
            gyro_bias_radps: PerExperiment::ZERO,
            gyro_range_radps: 2000.0_f64.to_radians(),
            ..rig.sensors.imu.clone()
        };
        let sensors = SensorModels { imu, ..rig.sensors.clone() };
        rig.with_sensors(sensors).with_second(SecondLink::arm())
    }

    /// Returns the rig with another seed.
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Returns the rig with other sensors.
    pub fn with_sensors(self, sensors: SensorModels) -> Self {
        Self { sensors, ..self }
    }

    /// Returns the rig with another body.
    pub fn with_body(self, body: BodyParameters) -> Self {
        Self { body, ..self }
    }

    /// Returns the rig with a second link.
    pub fn with_second(self, second: SecondLink) -> Self {
        Self { second: Some(second), ..self }
    }

    /// Returns the rig with other rates at which it is meant to run, Hz.
    pub fn with_rates(self, adc_hz: f64, imu_hz: f64) -> Self {
        Self { adc_hz, imu_hz, ..self }
    }

    /// Returns the assumed calibration: a gauge gives 6 mV at full range (bridges of 1.2 mV/V on 5 V), with
    /// up to 6 % of every other gauge in each component.
    fn default_calibration() -> [[f64; 6]; 6] {
        let per_volt = [110e3, 110e3, 330e3, 10e3, 10e3, 10e3];
        let mut matrix = [[0.0; 6]; 6];
        for (i, (row, scale)) in matrix.iter_mut().zip(per_volt).enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                let mixed = ((7 * i + 11 * j + 3 * i * j) % 13) as f64 / 100.0 - 0.06;
                *entry = scale * if i == j { 1.0 } else { mixed };
            }
        }
        matrix
    }

    /// Returns what the plate carries, a second link left out.
    pub fn payload(&self) -> Payload {
        Payload { body: self.body, load_cell: self.load_cell, imu: self.imu, gravity_mps2: self.gravity_mps2 }
    }

    /// Returns the group delay of the load cell's chain that a rig file states: amplifiers and the
    /// converter's filter at [`Self::adc_hz`], s.
    pub fn load_cell_group_delay_s(&self) -> f64 {
        self.sensors.load_cell.stated_delay_s() + Ads131m08::group_delay_at_s(self.adc_hz)
    }

    /// Returns the group delay of the IMU that a rig file states, s.
    pub fn imu_group_delay_s(&self) -> f64 {
        self.sensors.imu.stated_delay_s()
    }
}

/// The gauges' excitation at the converter's seventh input while it is the one of the calibration, V.
pub const EXCITATION_V: f64 = 1.0;

/// The fixed frames and matrices of a rig, ready for use.
#[derive(Clone, Debug)]
pub(super) struct Mechanics {
    sensors: IdealSensors,
    /// The second link, with `R` of its IMU's mounting.
    second: Option<(SecondLink, Matrix3<f64>)>,
    volts_per_wrench: [[f64; 6]; 6],
}

impl Mechanics {
    pub(super) fn new(config: &RigConfig) -> Result<Self, RigError> {
        Ok(Self {
            second: match config.second {
                Some(link) => Some((link, link.imu.rotation().ok_or(BadRotation("the second IMU"))?)),
                None => None,
            },
            sensors: config.payload().sensors()?,
            volts_per_wrench: inverse(config.gauge_calibration).ok_or(RigError::SingularCalibration)?,
        })
    }

    pub(super) fn body(&self) -> BodyParameters {
        *self.sensors.body()
    }

    pub(super) fn sensor_motion(&self, plate: &PlateState) -> FrameMotion {
        self.sensors.sensor_motion(plate)
    }

    /// Returns the true wrench on the body at S's origin, in S.
    pub(super) fn wrench(&self, plate: &PlateState) -> [f64; 6] {
        self.sensors.wrench(plate)
    }

    /// Returns what a second link adds to it, at its joint's position.
    pub(super) fn second_wrench(&self, plate: &PlateState, joint: &JointState) -> [f64; 6] {
        self.second.map_or([0.0; 6], |(link, _)| {
            link.wrench(&self.sensor_motion(plate), joint, self.sensors.gravity())
        })
    }

    /// Returns the true specific force and angular rate at the second IMU's origin, in its axes; none without
    /// a second link.
    pub(super) fn second_imu(&self, plate: &PlateState, joint: &JointState) -> Option<([f64; 3], [f64; 3])> {
        let (link, rotation) = self.second?;
        let motion = link
            .motion(&self.sensor_motion(plate), joint)
            .fixed_frame(&Vector3::from(link.imu.position_m), &rotation);
        Some((motion.specific_force(self.sensors.gravity()).into(), motion.body_rate().into()))
    }

    /// Returns the true specific force and angular rate at U's origin, in U.
    pub(super) fn imu(&self, plate: &PlateState) -> ([f64; 3], [f64; 3]) {
        self.sensors.imu(plate)
    }

    /// Voltages at the converter's eight inputs, with an excitation that is this many times the one of the
    /// calibration: six bridges, what a divider leaves of the excitation, and an input that is shorted.
    pub(super) fn inputs_v(&self, wrench: &[f64; 6], excitation: f64) -> [f64; 8] {
        let mut volts = [0.0; 8];
        for (v, row) in volts.iter_mut().zip(&self.volts_per_wrench) {
            *v = excitation * row.iter().zip(wrench).map(|(c, w)| c * w).sum::<f64>();
        }
        volts[6] = excitation * EXCITATION_V;
        volts
    }

    /// Returns the apparent offset; see [`super::Truth::apparent_offset_n_nm`].
    pub(super) fn apparent_offset(&self, experiment: &Experiment) -> [f64; 6] {
        let body = self.body();
        let bias = self.sensors.imu_rotation() * Vector3::from(experiment.accel_bias_mps2);
        let force = body.mass_kg * bias;
        let moment = body.mass_kg * Vector3::from(body.com_m).cross(&bias);
        let [fx, fy, fz, mx, my, mz] = experiment.load_cell_offset_n_nm;
        [fx - force.x, fy - force.y, fz - force.z, mx - moment.x, my - moment.y, mz - moment.z]
    }
}

/// Inverts a matrix by Gauss–Jordan with row pivoting. `None` if a pivot vanishes against its row's scale.
fn inverse(matrix: [[f64; 6]; 6]) -> Option<[[f64; 6]; 6]> {
    let mut a = matrix;
    let mut inv = [[0.0; 6]; 6];
    for (i, row) in inv.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    // Rows are brought to a common scale first, so that newtons and newton metres are alike.
    for (row, out) in a.iter_mut().zip(&mut inv) {
        let scale = row.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        if !(scale.is_finite() && scale > 0.0) {
            return None;
        }
        row.iter_mut().chain(out.iter_mut()).for_each(|v| *v /= scale);
    }
    for c in 0..6 {
        let pivot = (c..6).max_by(|&i, &j| a[i][c].abs().total_cmp(&a[j][c].abs()))?;
        if a[pivot][c].abs() < 1e-12 {
            return None;
        }
        a.swap(c, pivot);
        inv.swap(c, pivot);
        let p = a[c][c];
        a[c].iter_mut().chain(inv[c].iter_mut()).for_each(|v| *v /= p);
        let (row_a, row_inv) = (a[c], inv[c]);
        for r in (0..6).filter(|r| *r != c) {
            let f = a[r][c];
            for k in 0..6 {
                a[r][k] -= f * row_a[k];
                inv[r][k] -= f * row_inv[k];
            }
        }
    }
    Some(inv)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_calibration_times_the_gauges_is_the_wrench() {
        let config = RigConfig::thesis_horizontal();
        let mechanics = Mechanics::new(&config).unwrap();
        let wrench = [100.0, -200.0, 900.0, 5.0, -20.0, 3.0];
        let gauges = mechanics.inputs_v(&wrench, 1.0);
        for (row, want) in config.gauge_calibration.iter().zip(wrench) {
            let got: f64 = row.iter().zip(gauges).map(|(c, g)| c * g).sum();
            assert!((got - want).abs() < 1e-10, "{got} {want}");
        }
        assert_eq!(gauges[6..], [EXCITATION_V, 0.0]);
    }

    #[test]
    fn full_range_fits_a_gain_of_64() {
        let mechanics = Mechanics::new(&RigConfig::thesis_horizontal()).unwrap();
        for signs in 0..64_u32 {
            let mut wrench = [660.0, 660.0, 1980.0, 60.0, 60.0, 60.0];
            for (i, w) in wrench.iter_mut().enumerate() {
                *w *= if signs >> i & 1 == 1 { -1.0 } else { 1.0 };
            }
            assert!(mechanics.inputs_v(&wrench, 1.0)[..6].iter().all(|v| v.abs() < 1.2 / 64.0));
        }
    }

    #[test]
    fn bad_configurations_are_named() {
        let mut config = RigConfig::thesis_horizontal();
        config.imu.rotation_wxyz = [0.0; 4];
        assert_eq!(Mechanics::new(&config).unwrap_err(), RigError::BadRotation(BadRotation("the IMU")));
        let mut config = RigConfig::thesis_horizontal();
        config.gauge_calibration[3] = config.gauge_calibration[4];
        assert_eq!(Mechanics::new(&config).unwrap_err(), RigError::SingularCalibration);
    }
}
