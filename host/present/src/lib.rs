//! An answer as text ([`plain`]) and as a page ([`report`]).
//!
//! Lives here: the terminal's columns (`table`), the self-contained HTML page with
//! its plots and the series that they show ([`Series`]), and figures that are files of their own: normal
//! probability plots ([`probability`]), the map of a [`workspace`], uncertainty over the number of poses
//! ([`over_n`]), [`directions`] on the sphere; a growing answer in a terminal and in Foxglove ([`monitor`]).
//! May not live here: estimation, files, rounding ([`rigident_fit::figures`]), the JSON object, which is the
//! answer itself. Before this:
//! [`rigident_identify::answer`].

mod budget;
pub mod certificate;
mod data;
pub mod directions;
mod envelope;
mod figures;
mod html;
pub mod joint_offsets;
pub mod merged;
pub mod modes_page;
pub mod monitor;
pub mod motion;
pub mod over_n;
mod page;
pub mod person;
mod person_drawing;
pub mod plain;
mod plot;
pub mod posture_sets;
pub mod prediction;
pub mod probability;
mod quantities;
pub mod reference;
pub mod repeated;
mod sentences;
mod series;
mod table;
#[cfg(test)]
mod tests;
pub mod vibration;
pub mod workspace;

pub use data::{Along, Convergence, Decided, Drift, PrincipalAxis, Quantity, Residual, Stage, TimePlot};
pub use envelope::envelope;
pub use html::report;
pub use series::Series;
