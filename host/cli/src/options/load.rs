//! The mass and size that the body on the load cell may have.

use clap::Args;

use crate::Failure;
use rigident::application::driving::LoadBounds;
use rigident_io::rig::RigFile;

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
    /// Returns them as the application takes them.
    pub(crate) fn typed(self) -> LoadBounds {
        LoadBounds { load_max_kg: self.load_max_kg, load_within_m: self.load_within_m }
    }

    /// Puts what was given in the place of what the rig file says.
    ///
    /// # Errors
    /// Bad input: no positive number.
    pub(crate) fn put_into(self, rig: &mut RigFile) -> Result<(), Failure> {
        Ok(self.typed().put_into(rig)?)
    }
}
