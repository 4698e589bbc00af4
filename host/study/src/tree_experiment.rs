//! The description of an experiment with a tree: rate, length, what is measured, and the noise.

use rigident_io::recording::Recording;
use rigident_io::rig::{ImuClass, ImuTable, JointTable};
use rigident_laboratory::trees::{TreeInstant, TreeNoise, arm_recording, person_recording};
use rigident_model::Model;

/// An experiment with a tree.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeExperiment {
    /// Rate of the readings, 1/s.
    pub rate_hz: f64,
    /// The length of the experiment, s.
    pub duration_s: f64,
    /// Torques of the joints are measured on a base that is held still; else the wrench on a base that moves.
    pub has_torques: bool,
    /// With torques: rates of the joints are measured; else they are slopes of the positions.
    pub has_rates: bool,
    /// Noise of the sensors.
    pub noise: TreeNoise,
    /// States that noise to the estimator; else it finds it in the readings.
    pub state_noise: bool,
}

impl Default for TreeExperiment {
    fn default() -> Self {
        Self {
            rate_hz: 200.0,
            duration_s: 20.0,
            has_torques: false,
            has_rates: true,
            noise: TreeNoise {
                wrench: [0.5, 0.5, 0.5, 0.03, 0.03, 0.03],
                torque: 0.3,
                accel: 0.02,
                gyro: 1e-4,
                attitude: 0.0,
                position: 0.0,
                rate: 1e-3,
            },
            state_noise: true,
        }
    }
}

impl TreeExperiment {
    /// Returns the number of readings.
    pub(super) fn samples(&self) -> usize {
        (self.rate_hz * self.duration_s) as usize
    }

    /// Returns the motion at a reading.
    pub(super) fn instant(&self, model: &Model, reading: f64) -> TreeInstant {
        TreeInstant::new(model, !self.has_torques, reading / self.rate_hz)
    }

    /// Returns its recording without noise, with the rig file.
    pub(super) fn recording(&self, model: &Model) -> Recording {
        let mut recording = if self.has_torques {
            arm_recording(model, self.rate_hz, self.duration_s, self.has_rates)
        } else {
            person_recording(model, self.rate_hz, self.duration_s)
        };
        recording.name.clone_from(&model.name);
        let stated = |sigma: f64| Some(sigma).filter(|sigma| self.state_noise && *sigma > 0.0);
        let noise = &self.noise;
        if self.has_torques {
            let table = |name: &str| JointTable {
                name: name.to_owned(),
                position: None,
                rate: None,
                effort: None,
                position_noise: stated(noise.position),
                rate_noise: stated(noise.rate),
                effort_noise: stated(noise.torque),
                zero_std: None,
                effort_gain_std: None,
                effort_lowpass_hz: None,
            };
            recording.rig.joint = model.links.iter().skip(1).map(|link| table(&link.joint_name)).collect();
            return recording;
        }
        recording.rig.load_cell.noise_n_nm = Some(noise.wrench).filter(|_| self.state_noise);
        let imu = |link| ImuTable {
            link,
            accel_noise_mps2: stated(noise.accel),
            gyro_noise_radps: stated(noise.gyro),
            attitude_noise_rad: stated(noise.attitude),
            class: Some(ImuClass::Exact),
            ..ImuTable::default()
        };
        recording.rig.imu = (0..model.links.len()).map(imu).collect();
        recording
    }
}
