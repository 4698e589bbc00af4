//! Trees of links: from a recording and a model to the rows of base wrench and joint torques.
//!
//! Lives here: a recording brought to frames of joints and base ([`prepare`]), feet on the ground
//! ([`contact`]) with the columns that joints have ([`columns`]), their coordinates from attitudes and gyros
//! ([`joints`]) or as slopes of polynomials ([`polynomial`]), checks whether columns tell of one motion
//! ([`input_checks`]), drives with friction ([`drive`]) when they are at rest (`standstill`) and which rotors
//! are parts of base parameters (`rotors`), laws of friction that the recording shows (`friction_speed`,
//! `friction_terms`), errors that do not average out (`errors`, `sensitivities`), those
//! of the ground's wrench (`ground_errors`), what may act beside the model ([`unmodelled`]), the rows of a
//! frame ([`rows`]), and the source that hands them to the fit ([`TreeSource`]). May not live here: the
//! formulas of the rows (`rigident_shared::tree`), which parameters there are ([`rigident_model::base`]), and
//! whatever is done with rows ([`rigident_fit`]).

pub mod columns;
pub mod contact;
pub mod drive;
mod effort_factors;
mod error;
mod errors;
mod frames;
mod friction_speed;
mod friction_terms;
mod ground_errors;
pub mod input_checks;
mod instant;
pub mod joints;
pub mod limits;
mod neighbours;
mod options;
pub mod polynomial;
pub mod prepare;
mod rotors;
pub mod rows;
#[cfg(test)]
mod rows_tests;
mod sensitivities;
mod signals;
mod source;
mod standstill;
#[cfg(test)]
mod tracked_tests;
pub mod unmodelled;

pub use contact::{Contact, Foot, Ground};
pub use drive::FrictionPart;
pub use error::{TreePrepareError, TreeSourceError};
pub use errors::SignalError;
pub use frames::{BaseSensor, Frame, Input, NoisySignal, SignalKind};
pub use ground_errors::UnknownZero;
pub use ground_errors::with_wrenches;
pub use options::ProblemOptions;
pub use source::TreeSource;
