//! Readings of one body with their settings.

use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::screening::Limits;

use rigident_fit::{ErrorRow, Gaussian, Nuisance};

/// Readings of one body, with all that the rig file says of them.
#[derive(Clone, Debug)]
pub struct Input {
    /// Readings in the order of their time.
    pub readings: Vec<Reading<f64>>,
    /// Each reading is a still pose of its own, without time.
    pub is_static: bool,
    /// Rate of the readings, 1/s; not used for still poses.
    pub rate_hz: f64,
    /// The IMU on link 0.
    pub mounting: ImuMounting<f64>,
    /// 1 σ of the wrench per reading, N and N m; `None`: from the residuals.
    pub channel_sigma: Option<[f64; 6]>,
    /// 1 σ of the gyro per reading, rad/s; `None`: from its second differences.
    pub gyro_sigma: Option<f64>,
    /// Known wrench offset; `None`: estimated with the body.
    pub known_offset: Option<[f64; 6]>,
    /// Errors of sensors and mounting that do not average out.
    pub nuisances: Vec<Nuisance>,
    /// The information of rests on these, beside the rows.
    pub rests: Vec<ErrorRow>,
    /// The prior knowledge of these, and of the body, together: a calibration of the rig.
    pub beforehand: Option<Gaussian>,
    /// Ranges of the sensors.
    pub limits: Limits<f64>,
}

impl Input {
    /// Returns the same settings without readings.
    pub fn without_readings(&self) -> Self {
        Self {
            readings: Vec::new(),
            nuisances: self.nuisances.clone(),
            rests: self.rests.clone(),
            beforehand: self.beforehand.clone(),
            ..*self
        }
    }
}
