//! The mass and size that the body on the load cell may have.

use clap::Args;

use crate::Failure;
use rigident_io::rig::{PlatformTable, RigFile};

/// Bounds of what the plate carries.
#[derive(Args, Debug, Clone, Copy, Default)]
pub struct LoadOptions {
    /// The heaviest body that may be on the load cell, kg; goes before load_max_kg of the rig file
    #[arg(long, value_name = "KG")]
    pub load_max_kg: Option<f64>,
    /// No part of it is farther from the load cell's origin, m; goes before load_within_m of the rig file
    #[arg(long, value_name = "M")]
    pub load_within_m: Option<f64>,
}

impl LoadOptions {
    /// Puts what was given in the place of what the rig file says.
    ///
    /// # Errors
    /// Bad input: no positive number.
    pub(crate) fn put_into(self, rig: &mut RigFile) -> Result<(), Failure> {
        for (name, value) in [("--load-max-kg", self.load_max_kg), ("--load-within-m", self.load_within_m)] {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                return Err(Failure::input(format!("{name} {value}: a positive number")));
            }
        }
        if self.load_max_kg.is_some() || self.load_within_m.is_some() {
            let platform = rig.platform.get_or_insert_with(PlatformTable::default);
            platform.load_max_kg = self.load_max_kg.or(platform.load_max_kg);
            platform.load_within_m = self.load_within_m.or(platform.load_within_m);
        }
        Ok(())
    }
}
