//! Noise by bodies that do not explain the rows: the segments of a person are not rigid.
//!
//! Rows leave little where many parameters follow a slow motion, as of somebody who stands: breathing, the
//! heart and skin then resemble bodies that do not exist. How far the estimate is from all bodies shows how
//! much larger the noise is than what is left: `d²` of as many directions as rows determine is their number.

use super::Study;
use super::error::StudyError;
use rigident_identify::answer::physical_consistency::of_base_parameters;
use rigident_identify::answer::standard_parameters::BaseEstimate;

/// Rounds at most: errors of joint centres are not widened along.
const ROUNDS: usize = 4;
/// Noise that were more times larger is no person's: the recording is wrong.
const MOST: f64 = 5.0;

impl Study {
    /// Widens the noise until bodies explain the rows, if it need not be more than [`MOST`] times larger;
    /// `redraw` finds anew how joint centres move the parameters.
    pub(super) fn widen_to_bodies(
        &mut self,
        mut redraw: impl FnMut(&mut Self) -> Result<(), StudyError>,
    ) -> Result<(), StudyError> {
        for _ in 0..ROUNDS {
            let Some(by) = self.unexplained()?.filter(|by| by * self.noise_by_bodies <= MOST) else { break };
            self.motions.iter_mut().for_each(|motion| motion.widen(by));
            self.noise_by_bodies *= by;
            redraw(self)?;
        }
        Ok(())
    }

    /// Returns how much larger σ would have to be for bodies to explain the rows; `None` if they do, or if
    /// the signs are reversed.
    fn unexplained(&self) -> Result<Option<f64>, StudyError> {
        let all: Vec<usize> = (0..self.motions.len()).collect();
        let fit = self.with_calibration(self.together(&all)?, &all);
        let found = BaseEstimate::of(&fit, self.base());
        let judged = of_base_parameters(&self.model, &found);
        let wrong = judged.filter(|judged| !judged.is_consistent() && !judged.reversed);
        Ok(wrong.map(|judged| judged.distance_sd / (found.rank as f64).sqrt()).filter(|by| *by > 1.0))
    }

    /// Returns true if rigid segments explain the rows as they are, so that these tell of segments.
    pub fn tells_segments(&self) -> bool {
        self.noise_by_bodies == 1.0
    }

    /// Returns what to say of noise that was widened; `None` if it was not.
    pub fn misfit(&self) -> Option<String> {
        (!self.tells_segments()).then(|| {
            format!(
                "no rigid segments explain the forces: breathing, skin or what the model lacks is as large \
                 as what moves the segments, so these are not identified, and the intervals are {:.1} times \
                 wider. Record a motion in which all segments move",
                self.noise_by_bodies
            )
        })
    }
}
