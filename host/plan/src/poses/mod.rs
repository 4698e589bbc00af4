//! Orientations in which a body is held still, so that its weight tells the centre of mass.
//!
//! Lives here: how good a set of orientations is ([`measure`]), where the plate can go ([`reach`],
//! [`region`]), the search for the best set ([`search`]), its result ([`plan`]) as a motion
//! ([`program`]), what to make of the readings ([`estimators`], [`statics`]) and what that is
//! worth (`montecarlo`, with the simulator). May not live here: driving the platform, motions. After the
//! platform thesis (Barreto Melgarejo, 2010), sections 6.1 and 6.2.

pub mod estimators;
pub mod measure;
#[cfg(feature = "simulator")]
pub mod montecarlo;
pub mod plan;
pub mod program;
pub mod reach;
pub mod region;
pub mod search;
pub mod statics;

pub use measure::Objective;
pub use plan::{PlanError, PosePlan};
pub use reach::Reach;
pub use reach::RegionError;
pub use region::Region;
pub use search::{Found, Search};
