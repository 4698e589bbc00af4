//! Errors of a rig: what is known of them beforehand, draws from that, and what the sensors make of them.

use nalgebra::Vector3;

use super::super::problem::Normal;
use rigident::rows::body::CHANNELS;

/// Errors of a rig, as large as they are, or their standard deviations.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    /// Place of the IMU, m.
    pub lever_arm: [f64; 3],
    /// Attitude of the IMU about the axes of S, rad.
    pub rotation: [f64; 3],
    /// Delay of the IMU's stamps, s.
    pub skew: f64,
    /// m/s²
    pub accel_bias: [f64; 3],
    pub accel_gain: [f64; 3],
    /// y reads x, z reads x, z reads y, rad.
    pub misalignment: [f64; 3],
    /// rad/s
    pub gyro_bias: [f64; 3],
    pub gyro_gain: [f64; 3],
    /// Attitude of the gyro against the IMU, rad.
    pub gyro_rotation: [f64; 3],
    pub cell_gain: [f64; 6],
    /// Row reads column, of full scale each.
    pub crosstalk: [[f64; 6]; 6],
    /// Legendre polynomials of first and second degree, N and N m.
    pub drift: [[f64; 6]; 2],
}

/// Full scale of the load cell, N and N m.
pub const FULL_SCALE: [f64; 6] = [100.0, 100.0, 100.0, 5.0, 5.0, 5.0];

/// A group of errors that the rig file has a key for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    LeverArm,
    Rotation,
    Skew,
    AccelBias,
    AccelGain,
    Misalignment,
    GyroBias,
    GyroGain,
    GyroRotation,
    CellGain,
    CrossTalk,
    Drift,
}

impl Group {
    pub const ALL: [Self; 12] = [
        Self::LeverArm,
        Self::Rotation,
        Self::Skew,
        Self::AccelBias,
        Self::AccelGain,
        Self::Misalignment,
        Self::GyroBias,
        Self::GyroGain,
        Self::GyroRotation,
        Self::CellGain,
        Self::CrossTalk,
        Self::Drift,
    ];

    /// Returns the name that a fit has for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::LeverArm => "lever arm",
            Self::Rotation => "IMU rotation",
            Self::Skew => "time skew",
            Self::AccelBias => "accelerometer bias",
            Self::AccelGain => "accelerometer scale",
            Self::Misalignment => "accelerometer misalignment",
            Self::GyroBias => "gyro bias",
            Self::GyroGain => "gyro scale",
            Self::GyroRotation => "gyro rotation",
            Self::CellGain => "load-cell gain",
            Self::CrossTalk => "cross-talk",
            Self::Drift => "load-cell drift",
        }
    }

    /// Returns the name of the nuisance parameter of one of its errors, in the order of [`Group::of`], and
    /// its value in the unit of the error here.
    pub fn nuisance(self, at: usize) -> (String, f64) {
        let axis = |group: &str| (format!("{group}_{}", ["x", "y", "z"][at % 3]), 1.0);
        match self {
            Self::LeverArm => axis("lever_arm"),
            Self::Rotation => axis("imu_rotation"),
            Self::Skew => ("time_skew".to_owned(), 1.0),
            Self::AccelBias => axis("accelerometer_bias"),
            Self::AccelGain => axis("accelerometer_scale"),
            Self::Misalignment => axis("accelerometer_misalignment"),
            Self::GyroBias => axis("gyro_bias"),
            Self::GyroGain => axis("gyro_scale"),
            Self::GyroRotation => axis("gyro_rotation"),
            Self::CellGain => (format!("gain_{}", CHANNELS[at % 6]), 1.0),
            Self::CrossTalk => {
                let (to, from) = (at / 6, at % 6);
                (format!("crosstalk_{}_{}", CHANNELS[to], CHANNELS[from]), FULL_SCALE[to] / FULL_SCALE[from])
            }
            Self::Drift => (format!("drift_{}_{}", ["line", "curve"][at / 6], CHANNELS[at % 6]), 1.0),
        }
    }

    /// Returns errors of the group, one a nuisance parameter.
    pub fn of(self, errors: &mut Errors) -> Vec<&mut f64> {
        match self {
            Self::LeverArm => errors.lever_arm.iter_mut().collect(),
            Self::Rotation => errors.rotation.iter_mut().collect(),
            Self::Skew => vec![&mut errors.skew],
            Self::AccelBias => errors.accel_bias.iter_mut().collect(),
            Self::AccelGain => errors.accel_gain.iter_mut().collect(),
            Self::Misalignment => errors.misalignment.iter_mut().collect(),
            Self::GyroBias => errors.gyro_bias.iter_mut().collect(),
            Self::GyroGain => errors.gyro_gain.iter_mut().collect(),
            Self::GyroRotation => errors.gyro_rotation.iter_mut().collect(),
            Self::CellGain => errors.cell_gain.iter_mut().collect(),
            Self::CrossTalk => errors.crosstalk.iter_mut().flatten().collect(),
            Self::Drift => errors.drift.iter_mut().flatten().collect(),
        }
    }
}

impl Errors {
    /// Returns the standard deviations of a rig that is known by its data sheets alone: limits of 3 mm, 0.5°,
    /// 2 ms, 0.05 m/s², 10 mrad/s and 0.2 % of full scale, over √3; scales and angles between axes to 0.5 %.
    pub fn data_sheet() -> Self {
        let of = |limit: f64| limit / 3.0_f64.sqrt();
        let crosstalk = |to: usize| std::array::from_fn(|from| if from == to { 0.0 } else { of(2e-3) });
        Self {
            lever_arm: [of(3e-3); 3],
            rotation: [of(0.5_f64.to_radians()); 3],
            skew: of(2e-3),
            accel_bias: [of(0.05); 3],
            accel_gain: [5e-3; 3],
            misalignment: [5e-3; 3],
            gyro_bias: [of(0.01); 3],
            gyro_gain: [5e-3; 3],
            gyro_rotation: [5e-3; 3],
            cell_gain: [5e-3; 6],
            crosstalk: std::array::from_fn(crosstalk),
            drift: [FULL_SCALE.map(|f| of(2e-3 * f)); 2],
        }
    }

    /// Returns the standard deviations of a load cell of which no more is known than the class of its data
    /// sheet, 1 %, and an IMU of the class industrial: those of a rig file that states nothing.
    pub fn default_classes() -> Self {
        let of = |limit: f64| limit / 3.0_f64.sqrt();
        let crosstalk = |to: usize| std::array::from_fn(|from| if from == to { 0.0 } else { of(1e-2) });
        Self {
            accel_gain: [of(5e-3); 3],
            misalignment: [of(5e-3); 3],
            gyro_gain: [of(5e-3); 3],
            gyro_rotation: [of(5e-3); 3],
            cell_gain: [of(1e-2); 6],
            crosstalk: std::array::from_fn(crosstalk),
            drift: [FULL_SCALE.map(|f| of(1e-2 * f)); 2],
            ..Self::data_sheet()
        }
    }

    /// Returns the standard deviations with one group alone; all others are zero.
    pub fn only(mut self, group: Group) -> Self {
        for other in Group::ALL.into_iter().filter(|other| *other != group) {
            other.of(&mut self).into_iter().for_each(|value| *value = 0.0);
        }
        self
    }

    /// Returns independent normal draws, these being their standard deviations, `wide` times as large.
    pub fn draw(mut self, wide: f64, normal: &mut Normal) -> Self {
        for group in Group::ALL {
            group.of(&mut self).into_iter().for_each(|value| *value *= wide * normal.draw());
        }
        self
    }

    /// Returns the rig file of somebody who knows these standard deviations, of an IMU at `position`.
    pub fn rig_file(&self, position: &Vector3<f64>, quaternion: &[f64; 4], noise: &Noise) -> String {
        let [x, y, z] = [position.x, position.y, position.z];
        format!(
            "[recording]\ngravity_mps2 = {gravity}\n\n[[imu]]\nposition_m = [{x}, {y}, {z}]\nrotation_wxyz = \
             {quaternion:?}\n\
             accel_noise_mps2 = {accel}\ngyro_noise_radps = {gyro}\n\
             position_std_m = {lever}\nrotation_std_rad = {rotation}\nskew_std_s = \
             {skew}\naccel_bias_std_mps2 = {bias}\n\
             accel_gain_std = {scale}\naccel_misalignment_std_rad = {misalignment}\ngyro_bias_std_radps = \
             {gyro_bias}\n\
             gyro_gain_std = {gyro_gain}\ngyro_rotation_std_rad = {gyro_rotation}\n\n[load_cell]\nnoise_n_nm \
             = {cell:?}\nrange_n_nm = {FULL_SCALE:?}\n\
             gain_uncertainty = {gain:?}\ncrosstalk_std = {crosstalk}\ndrift_std_n_nm = {drift:?}\n",
            gravity = super::mechanics::GRAVITY,
            accel = noise.accel,
            gyro = noise.gyro,
            cell = noise.cell,
            lever = self.lever_arm[0],
            rotation = self.rotation[0],
            skew = self.skew,
            bias = self.accel_bias[0],
            scale = self.accel_gain[0],
            misalignment = self.misalignment[0],
            gyro_bias = self.gyro_bias[0],
            gyro_gain = self.gyro_gain[0],
            gyro_rotation = self.gyro_rotation[0],
            gain = self.cell_gain,
            crosstalk = self.crosstalk[0][1],
            drift = self.drift[0],
        )
    }
}

/// White noise, 1 σ a sample.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    /// N and N m.
    pub cell: [f64; 6],
    /// m/s²
    pub accel: f64,
    /// rad/s
    pub gyro: f64,
}

impl Noise {
    /// Returns a load cell for hand-held bodies and a good IMU.
    pub fn lab() -> Self {
        Self { cell: [0.05, 0.05, 0.08, 0.002, 0.002, 0.0015], accel: 0.01, gyro: 5e-4 }
    }
}
