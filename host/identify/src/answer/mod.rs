//! From a fit to the answer: one object for one body, two links and trees, of which text, JSON and page are
//! made.
//!
//! Lives here: the answer ([`result`]) and its making ([`Answer::new`]), the one judgement of all that was
//! found (`judgement`), states of parameters ([`states`]), what must be identified ([`selection`]),
//! quantities derived from the ten parameters of a body ([`derived`]), physical consistency
//! ([`physical_consistency`], [`nearest_body`]), standard parameters of links ([`standard_parameters`]), a
//! value for every column (`complete`) and what these predict ([`predictor`]), and what the motion lacks
//! ([`excitation_advice`]). May not live here: raw data, files, screens. Before this: [`rigident_fit`]; after
//! it: [`rigident_present`].

mod budget;
mod checks;
mod complete;
mod context;
mod contradictions;
pub mod derived;
mod drive_signs;
pub mod excitation_advice;
mod judgement;
pub mod lack_of_fit;
mod load;
pub mod nearest_body;
mod new;
pub mod payload;
pub mod person;
pub mod physical_consistency;
mod plausibility;
pub mod predictor;
mod read;
mod reliance;
mod remarks;
pub mod repeated;
pub mod result;
mod rig_errors;
#[cfg(test)]
mod samples;
pub mod selection;
pub mod standard_beside;
pub mod standard_parameters;
pub mod states;
#[cfg(test)]
mod tests;

pub use checks::checks;
pub use context::now;
pub use context::{Context, Finding, Links, StandardRequest};
pub use contradictions::contradictions;
pub use judgement::WITHHELD;
pub use new::AnswerError;
pub(crate) use plausibility::{lacks_something_of_drives, leaves_little_of_poses, scaled};
pub use read::ReadError;
pub use result::{Answer, Drift, DriftChange, Source, Status, TimeBase, Tracking};
pub use states::identified_of_body;
