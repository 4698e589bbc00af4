use clap::Args;
use rigident_shared::wire::Settings;

use crate::Failure;
use rigident::application::DeviceError;
use rigident::device::stop_criterion;
use rigident_fit::Parameter;

/// What the device does while it estimates.
#[derive(Args, Debug, Clone, Default)]
pub struct StopCriterion {
    /// End as soon as these have at most these 95 % uncertainties, SI, in the load cell's frame:
    /// Ixx=0.002,m=0.01. Any of m, mc, I, offset, a link, and single names. The device decides; Ctrl-C ends
    /// sooner
    #[arg(long, value_name = "NAME=U95", value_delimiter = ',')]
    pub until: Vec<String>,
    /// With --until: report when the uncertainties are reached, but finish the program
    #[arg(long, alias = "go-on", requires = "until")]
    pub keep_going: bool,
}

impl StopCriterion {
    /// Returns it as the device's crate takes it.
    pub(crate) fn typed(&self) -> stop_criterion::StopCriterion {
        stop_criterion::StopCriterion { until: self.until.clone(), keep_going: self.keep_going }
    }

    /// Returns what is asked for: `estimate` if that names anything, else what is to become so certain.
    pub(crate) fn asked(&self, estimate: &[String]) -> Vec<String> {
        self.typed().asked(estimate)
    }

    /// Puts it into the settings of a device that estimates these parameters, in this order.
    ///
    /// # Errors
    /// Returns bad input if the criterion cannot be used.
    pub(crate) fn put_into(&self, settings: &mut Settings, parameters: &[Parameter]) -> Result<(), Failure> {
        settings.stop = self.typed().rule(parameters).map_err(DeviceError::from)?;
        Ok(())
    }
}
