//! Classes of data sheets: what is known of the errors of a sensor that nobody has calibrated.
//!
//! A data sheet gives a limit `±a`; where the error lies within is not known, so that its standard deviation
//! is `a/√3` (JCGM 100:2008, 4.3.7). The figures are those of common sensors of each class.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Class of an IMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ImuClass {
    /// A MEMS part as phones have it, uncalibrated.
    Consumer,
    /// A MEMS module with a factory calibration.
    Industrial,
    /// A module for navigation.
    Tactical,
    /// Without error beyond noise, mounting and time included: a simulated one.
    Exact,
}

/// Class of a load cell, by the accuracy that its data sheet gives in per cent of full scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum LoadCellClass {
    /// 1 %
    #[serde(rename = "1%")]
    One,
    /// 0.25 %
    #[serde(rename = "0.25%")]
    Quarter,
    /// 0.2 %
    #[serde(rename = "0.2%")]
    Fifth,
    /// 0.1 %
    #[serde(rename = "0.1%")]
    Tenth,
    /// 0.05 %
    #[serde(rename = "0.05%")]
    Twentieth,
    /// Without error beyond noise: a simulated one.
    #[serde(rename = "exact")]
    Exact,
}

/// Class of the joints and the base of a tree of links.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TreeClass {
    /// Joints zeroed at marks, a base set up by eye, torques from currents of motors.
    Assembled,
    /// A robot mastered by its maker's procedure and bolted to a levelled floor, with torque sensors.
    Industrial,
    /// A robot that was calibrated as a whole, and levelled with an inclinometer.
    Calibrated,
    /// Without error beyond noise: a simulated one.
    Exact,
}

/// Limits of a class, `±a`, of joints and base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeLimits {
    /// Zero of a joint that turns, rad.
    pub joint_zero_rad: f64,
    /// Zero of a joint that slides, m.
    pub joint_zero_m: f64,
    /// Tilt of the base, rad.
    pub base_tilt_rad: f64,
    /// Delay of the positions' stamps, s.
    pub skew_s: f64,
    /// Delay of the positions' stamps against efforts of drives, s.
    pub effort_skew_s: f64,
    /// Scale of an effort, relative, and its offset and drift, relative to the largest.
    pub effort: f64,
}

/// Limits of a data sheet, `±a`, of an IMU as it is mounted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuLimits {
    /// Place in S, m.
    pub position_m: f64,
    /// Attitude in S, rad.
    pub rotation_rad: f64,
    /// Delay of its stamps, s.
    pub skew_s: f64,
    /// Bias of the accelerometer, m/s².
    pub accel_bias_mps2: f64,
    /// Scale of the accelerometer, relative.
    pub accel_gain: f64,
    /// Angles between the accelerometer's axes, rad.
    pub accel_misalignment_rad: f64,
    /// Bias of the gyro, rad/s.
    pub gyro_bias_radps: f64,
    /// Scale of the gyro, relative.
    pub gyro_gain: f64,
    /// Attitude of the gyro's axes against those of the accelerometer, rad.
    pub gyro_rotation_rad: f64,
}

impl ImuClass {
    /// The class of an IMU of which nothing is stated.
    pub const DEFAULT: Self = Self::Industrial;

    /// Returns its name as in the rig file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Consumer => "consumer",
            Self::Industrial => "industrial",
            Self::Tactical => "tactical",
            Self::Exact => "exact",
        }
    }

    /// Returns the limits of the class. Place, attitude and delay are those of careful work with a ruler and
    /// a drawing, whatever the sensor: 3 mm, 0.5°, 2 ms.
    pub fn limits(self) -> ImuLimits {
        let of = |accel_bias_mps2, accel_gain, gyro_bias_radps, gyro_gain| ImuLimits {
            position_m: 3e-3,
            rotation_rad: 0.5_f64.to_radians(),
            skew_s: 2e-3,
            accel_bias_mps2,
            accel_gain,
            accel_misalignment_rad: accel_gain,
            gyro_bias_radps,
            gyro_gain,
            // Sheets give one cross-axis sensitivity of both, as large as the error of scale.
            gyro_rotation_rad: gyro_gain,
        };
        match self {
            Self::Consumer => of(0.6, 0.03, 0.1, 0.03),
            Self::Industrial => of(0.05, 5e-3, 0.01, 5e-3),
            Self::Tactical => of(0.015, 1e-3, 1e-3, 1e-3),
            Self::Exact => {
                ImuLimits { position_m: 0.0, rotation_rad: 0.0, skew_s: 0.0, ..of(0.0, 0.0, 0.0, 0.0) }
            }
        }
    }
}

impl TreeClass {
    /// The class of joints of which nothing is stated.
    pub const DEFAULT: Self = Self::Industrial;

    /// Returns its name as in the rig file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Assembled => "assembled",
            Self::Industrial => "industrial",
            Self::Calibrated => "calibrated",
            Self::Exact => "exact",
        }
    }

    /// Returns the limits of the class. Efforts of industrial robots are those of joints with torque sensors,
    /// 2 % of their range (KUKA LBR iiwa, data sheet); a torque from a motor's current has the tolerance of
    /// its torque constant, 10 %. Drivers filter efforts: a low-pass of 30 Hz makes them late by 5 ms.
    pub fn limits(self) -> TreeLimits {
        let of = |zero_deg: f64, joint_zero_m, tilt_deg: f64, [skew_s, effort_skew_s]: [f64; 2], effort| {
            TreeLimits {
                joint_zero_rad: zero_deg.to_radians(),
                joint_zero_m,
                base_tilt_rad: tilt_deg.to_radians(),
                skew_s,
                effort_skew_s,
                effort,
            }
        };
        match self {
            Self::Assembled => of(1.0, 1e-3, 1.0, [5e-3, 1e-2], 0.1),
            Self::Industrial => of(0.2, 3e-4, 0.5, [2e-3, 5e-3], 0.02),
            Self::Calibrated => of(0.02, 5e-5, 0.05, [2e-4; 2], 5e-3),
            Self::Exact => of(0.0, 0.0, 0.0, [0.0; 2], 0.0),
        }
    }
}

impl LoadCellClass {
    /// The class of a load cell of which nothing is stated.
    pub const DEFAULT: Self = Self::One;

    /// Returns its name as in the rig file.
    pub fn name(self) -> &'static str {
        match self {
            Self::One => "1%",
            Self::Quarter => "0.25%",
            Self::Fifth => "0.2%",
            Self::Tenth => "0.1%",
            Self::Twentieth => "0.05%",
            Self::Exact => "exact",
        }
    }

    /// Returns the limit of its errors, relative to full scale: of gain, of cross-talk, and of drift over a
    /// recording.
    pub fn limit(self) -> f64 {
        match self {
            Self::One => 1e-2,
            Self::Quarter => 2.5e-3,
            Self::Fifth => 2e-3,
            Self::Tenth => 1e-3,
            Self::Twentieth => 5e-4,
            Self::Exact => 0.0,
        }
    }
}

/// Returns the standard deviation of an error of which only its limits are known.
pub fn rectangular(limit: f64) -> f64 {
    limit / 3.0_f64.sqrt()
}
