//! The reference body: its known properties calibrate a rig, or verify what a rig measures.
//!
//! Lives here: the file of a reference body and its covariance ([`body`]), the errors of a rig from runs with
//! it ([`mod@calibrate`]), and an answer against it ([`compare`]). May not live here: how rows are solved;
//! that is [`rigident_fit::fit`], to which a reference is what is known beforehand.

pub mod body;
pub mod calibrate;
mod cause;
pub mod compare;
mod quantity;
mod read;

pub use body::{ReferenceBody, ReferenceError};
pub use calibrate::{CalibrateError, Calibrated, Run, calibrate, contradiction};
pub use compare::{Comparison, Mismatch};
pub use quantity::Quantity;
