//! The knowledge of a person beside her markers.

use super::marker_file::MarkerFile;
use rigident_model::human::Sex;

/// A marker whose place is known better than this, m, tells of the stature.
pub(super) const ANATOMICAL_M: f64 = 0.1;

/// The knowledge of a person beside markers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// Stature, m; `None`: from the markers.
    pub height_m: Option<f64>,
    /// Mass, kg, that the table is scaled to.
    pub mass_kg: f64,
    /// The sex whose means the table has.
    pub sex: Sex,
    /// Right joints are where left ones are, mirrored.
    pub symmetric: bool,
    /// Markers whose names say nothing, or something else.
    pub own_markers: MarkerFile,
    /// Lengths from elsewhere, m, known to 15 mm (1 σ), by the names of [`Person::lengths_m`].
    pub lengths_m: Vec<(String, f64)>,
}

impl Known {
    /// Returns a length from elsewhere, m.
    pub(super) fn length(&self, name: &str) -> Option<f64> {
        self.lengths_m.iter().find(|(own, _)| own == name).map(|(_, length)| *length)
    }
}
