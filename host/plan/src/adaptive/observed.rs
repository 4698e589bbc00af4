//! The information of a device's factor, as far as planning may use it.

use rigident_shared::conditioning::Kernel;

use super::goal::Asked;
use super::information::{Information, RigModel};
use super::planner::Known;
use rigident_fit::{ESTIMATOR_TAPS, Estimate, Factor, Noise, RowSet, filter_width_s, judge, row_every};
use rigident_identify::answer::identified_of_body;

/// Rows a device makes at one instant.
const CHANNELS: u64 = 6;

/// The information of a factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Observed {
    /// Information on all sixteen.
    pub information: Information,
    /// The ten parameters, if all of them are identified by the answer's own rule. At rest noise makes a
    /// factor of full rank: what it determines then is no body.
    pub estimate: Option<[f64; 10]>,
    /// Mass and first moment, if these are identified, whatever is known of the tensor.
    pub first: Option<[f64; 4]>,
    /// Variance of the noise relative to what was stated.
    pub variance_scale: f64,
}

impl Observed {
    /// Returns it as the planner takes it.
    pub fn known(&self) -> Known<'_> {
        Known {
            information: &self.information,
            estimate: self.estimate.as_ref().map(<[f64; 10]>::as_slice),
            first: self.first,
            variance_scale: self.variance_scale,
        }
    }

    /// Returns the worst uncertainty over what is asked for; at most 1 when all is reached, infinite as long
    /// as it is not known what that is.
    pub fn worst(&self, asked: &Asked, rig: &RigModel) -> f64 {
        if !asked.is_known(self.known().estimate) {
            return f64::INFINITY;
        }
        asked.goal(self.known().estimate, &rig.compact()).worst(&self.information, self.variance_scale)
    }
}

impl RigModel {
    /// Judges a factor as the answer does.
    pub fn observed(&self, factor: &Factor) -> Observed {
        let rounding = factor.rounding();
        let fitted = factor.solve(rounding).determined.iter().filter(|d| **d).count();
        let rows = RowSet {
            rows: factor.rows(),
            channels: CHANNELS as usize,
            noise_gain: self.noise_gain(),
            sigma_given: true,
        };
        let judged = judge(&[rows], factor.residual_sum_of_squares(), fitted as f64);
        let estimate = Estimate::new(factor, rounding, judged.variance_scale, Noise::Given);
        let identified = identified_of_body(&estimate, self.spurious_information(factor));
        Observed {
            information: self.of_factor(factor),
            estimate: estimate.unjudged().values.first_chunk::<10>().filter(|_| identified >= 10).copied(),
            first: estimate.unjudged().values.first_chunk::<4>().filter(|_| identified >= 4).copied(),
            variance_scale: judged.variance_scale,
        }
    }

    /// Returns the information that noise of the gyro alone brings to a moment of inertia, 1/(kg m²)².
    fn spurious_information(&self, factor: &Factor) -> f64 {
        let kernel = Kernel::<f64, ESTIMATOR_TAPS>::new(self.rate_hz, filter_width_s(self.rate_hz), 1);
        let gain = kernel.map_or(0.0, |kernel| kernel.derivative_noise_gain());
        let blocks = (factor.rows() / CHANNELS) as f64 * f64::from(row_every(self.rate_hz));
        let sigma = self.channel_sigma[3..].iter().copied().fold(f64::INFINITY, f64::min);
        blocks * gain * (self.gyro_noise_radps / sigma).powi(2)
    }
}
