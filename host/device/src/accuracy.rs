//! The deviation of a device's answer allowed from that of the same rows in double precision.

use rigident_fit::Estimate;

/// A device may differ by this many standard deviations, …
const ALLOWED_SD: f64 = 0.05;
/// … or by this many roundings, times condition and size of the parameters.
const ALLOWED_ROUNDINGS: f64 = 20.0;

/// A device's answer beside that of the same rows in double precision.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accuracy {
    /// Largest difference of a parameter, in standard deviations.
    pub largest_difference_sd: f64,
    /// The number of that parameter.
    pub parameter: usize,
    /// Largest difference by what is allowed: no more than one.
    pub share_of_allowed: f64,
}

impl Accuracy {
    /// Returns the accuracy of a device's estimate; parameters that the rows do not determine do not count.
    pub fn of(device: &Estimate, host: &Estimate) -> Self {
        let determined: Vec<usize> = (0..host.len()).filter(|j| host.is_determined(*j)).collect();
        let size = determined.iter().map(|j| host.unjudged().values[*j].powi(2)).sum::<f64>().sqrt();
        let roundings = ALLOWED_ROUNDINGS * f64::from(f32::EPSILON) * host.condition_number * size;
        let mut all = Self::default();
        for j in determined {
            let sd = host.unjudged().covariance[(j, j)].sqrt();
            let off = (device.unjudged().values[j] - host.unjudged().values[j]).abs();
            if off / sd >= all.largest_difference_sd {
                (all.largest_difference_sd, all.parameter) = (off / sd, j);
            }
            let share = off / (ALLOWED_SD * sd).max(roundings);
            // NaN is larger than anything.
            all.share_of_allowed = if share <= all.share_of_allowed { all.share_of_allowed } else { share };
        }
        all
    }

    /// Returns true if the device is as accurate as it should be.
    pub fn is_met(&self) -> bool {
        self.share_of_allowed <= 1.0
    }

    /// Returns what to warn of if it is not; `name` is that of the parameter.
    pub fn complaint(&self, name: &str) -> Option<String> {
        (!self.is_met()).then(|| {
            format!(
                "the microcontroller's parameters differ from those of the same rows in double precision by \
                 up to {:.2} standard deviations ({name})",
                self.largest_difference_sd
            )
        })
    }
}
