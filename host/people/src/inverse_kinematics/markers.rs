//! Markers that are fixed to links.

use nalgebra::Vector3;

/// A marker on a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Attached {
    /// The name of the marker in the recording.
    pub name: String,
    /// The number of the marker in the recording.
    pub label: usize,
    /// The link, by its index in the model.
    pub link: usize,
    /// The place of it on the link, link axes, m.
    pub position_m: Vector3<f64>,
    /// The uncertainty of that before any frame is seen: 1 σ, m; infinite of a marker that may be anywhere on
    /// the link.
    pub position_sigma_m: f64,
    /// The uncertainty of the marker's place on its link, 1 σ, m: its own noise, and skin that moves over
    /// bone.
    pub sigma_m: f64,
    /// True if its height determines the stature. Markers on arms are raised with them.
    pub tells_stature: bool,
}

/// Markers of a frame, in the order of the attached ones; `None` where one was not seen.
pub type Seen = Vec<Option<Vector3<f64>>>;
