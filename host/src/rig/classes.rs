//! Classes of data sheets: what is known of the errors of a sensor that nobody has calibrated.
//!
//! A data sheet gives a limit `±a`; where the error lies within is not known, so that its standard deviation is `a/√3`
//! (JCGM 100:2008, 4.3.7). The figures are those of common sensors of each class.

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
    /// 0.2 %
    #[serde(rename = "0.2%")]
    Fifth,
    /// 0.05 %
    #[serde(rename = "0.05%")]
    Twentieth,
    /// Without error beyond noise: a simulated one.
    #[serde(rename = "exact")]
    Exact,
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

    /// Returns the limits of the class. Place, attitude and delay are those of careful work with a ruler and a drawing,
    /// whatever the sensor: 3 mm, 0.5°, 2 ms.
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

impl LoadCellClass {
    /// The class of a load cell of which nothing is stated.
    pub const DEFAULT: Self = Self::One;

    /// Returns its name as in the rig file.
    pub fn name(self) -> &'static str {
        match self {
            Self::One => "1%",
            Self::Fifth => "0.2%",
            Self::Twentieth => "0.05%",
            Self::Exact => "exact",
        }
    }

    /// Returns the limit of its errors, relative to full scale: of gain, of cross-talk, and of drift over a recording.
    pub fn limit(self) -> f64 {
        match self {
            Self::One => 1e-2,
            Self::Fifth => 2e-3,
            Self::Twentieth => 5e-4,
            Self::Exact => 0.0,
        }
    }
}

/// Returns the standard deviation of an error of which only its limits are known.
pub fn rectangular(limit: f64) -> f64 {
    limit / 3.0_f64.sqrt()
}
