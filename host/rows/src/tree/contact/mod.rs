//! Feet on the ground: what a robot that stands measures of the wrenches on its feet, and the rows that are
//! left without the rest.
//!
//! Lives here: the feet and the states of contact (`states`), the wrenches' part in the equations of motion
//! (`forces`), and the combinations of rows that are free of what is not measured (`availability`). Next:
//! `forces`.
//!
//! With G the six columns that a foot's wrench w has in the equations of base and joints,
//! ```text
//! Y φ = [0; τ] + Σ G w
//! ```
//! Some components of w and τ are not measured. Their columns are H, and rows N with N H = 0 are free of them
//! (K. Yamane, Humanoids 2011, equation 15).

pub(super) mod availability;
pub(super) mod forces;
pub(super) mod states;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, Vector3};

/// Names of the components of a foot's wrench.
pub const COMPONENTS: [&str; 6] = ["fx", "fy", "fz", "mx", "my", "mz"];

/// A foot with its sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Foot {
    /// The name of the foot.
    pub name: String,
    /// The link that it is part of, by its index in the model.
    pub link: usize,
    /// Origin of the sensor in the link's frame, m.
    pub position: Vector3<f64>,
    /// Link axes ← sensor axes.
    pub rotation: Matrix3<f64>,
    /// Components that are known where it stands: measured, or zero.
    pub known: [bool; 6],
    /// Components that a sensor measures.
    pub measured: [bool; 6],
    /// 1 σ of each component per sample, N and N m.
    pub sigma: [f64; 6],
}

impl Foot {
    /// Returns true if a sensor measures all of its wrench that is not zero by what the foot is.
    pub fn is_measured(&self) -> bool {
        self.known == [true; 6] && self.measured.contains(&true)
    }
}

/// A way to stand: which feet touch the ground, and which rows are given for what is not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactState {
    /// One a foot.
    pub touching: Vec<bool>,
    /// Freedoms whose torque is not known.
    pub unknown_efforts: Vec<usize>,
    /// The rows by which what is not measured is eliminated.
    pub pivots: Vec<usize>,
}

/// The knowledge of the ground's wrenches throughout a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// The feet.
    pub feet: Vec<Foot>,
    /// Freedoms whose torque is not measured.
    pub unmeasured: Vec<usize>,
    /// 1 σ per sample of the base's six rows beside the feet's noise, then of the efforts.
    pub sigma: Vec<f64>,
    /// The states of contact that occur.
    pub states: Vec<ContactState>,
}

/// The ground's part of an instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ground {
    /// Wrench on each foot in its sensor's axes about its origin, N and N m; zero where it is not measured,
    /// and of a foot of which not all is measured where it does not stand.
    pub wrenches: Vec<[f64; 6]>,
    /// The feet that stand.
    pub touching: Vec<bool>,
    /// The state of contact, by its number.
    pub state: usize,
}
