//! `--adaptive`: segments decided one by one while the device estimates.

use clap::Args;

use crate::Failure;
use rigident::application::driving;
use rigident::device::session::Axes;

/// Whether somebody decides, and how far.
#[derive(Args, Debug, Clone)]
pub struct Adaptive {
    /// Decide every segment by what the device knows by then; end as soon as what is asked for is reached
    ///
    /// Asked for is --until, or every tensor element, about S and about the centre of mass, to
    /// --until-relative.
    #[arg(long, conflicts_with_all = ["plan", "duration_s", "keep_going", "forget", "window"])]
    pub adaptive: bool,
    /// With --adaptive: largest 95 % uncertainty of every tensor element, as a share of the largest principal
    /// moment
    /// [default: 0.01]
    #[arg(long, value_name = "SHARE", requires = "adaptive", conflicts_with = "until")]
    pub until_relative: Option<f64>,
    /// End after so long, s, wherever the programme is; with --adaptive begin no further segment then
    /// [default there: 300]
    #[arg(long, value_name = "S")]
    pub at_most_s: Option<f64>,
}

impl Adaptive {
    /// Returns the end as the application takes it.
    pub(crate) fn typed(&self) -> driving::End {
        driving::End { until_relative: self.until_relative, at_most_s: self.at_most_s }
    }

    /// Refuses what cannot be asked for: bad input.
    ///
    /// # Errors
    /// A share or a time that is no positive number.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        Ok(self.typed().check()?)
    }

    /// Returns what becomes of an axis that does not follow.
    pub(crate) fn axes(&self) -> Axes {
        if self.adaptive { Axes::LeftToPlanner } else { Axes::Each }
    }
}
