//! From a recording to a judged answer.
//!
//! A [`problem`] is a recording with the source of its rows; its fit becomes an [`answer`], of which the
//! state of every parameter is decided in one place. [`diagnosis`] looks for the cause where the data
//! contradict the model. A [`mod@reference`] body, known weights ([`load_cell`]), still poses of a robot
//! ([`joint_offsets`]) and known loads on its drives ([`drive_gains`]) calibrate; [`mass_properties`] has
//! tables of parts that are weighed.
//!
//! ```
//! use rigident_fit::{FitOptions, Silent};
//! use rigident_identify::answer::{Answer, Context, Status};
//! use rigident_identify::problem::{Problem, ProblemOptions};
//! use rigident_io::recording::Recording;
//!
//! let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/bracket.csv");
//! let recording = Recording::load(bracket.as_ref(), None).unwrap();
//! let problem = Problem::from_recording(&recording, None, &ProblemOptions::default()).unwrap();
//! let fit = problem.fit(&FitOptions::default(), &Silent).unwrap();
//! let answer = Answer::new(&fit, Context::default()).unwrap();
//! assert_eq!(answer.status, Status::Identified);
//! ```
#![forbid(unsafe_code)]

// Files that tests of several crates share name this crate as those do.
#[cfg(test)]
extern crate self as rigident_identify;

pub mod answer;
pub mod diagnosis;
pub mod drive_gains;
pub mod joint_offsets;
pub mod load_cell;
pub mod mass_properties;
mod named_table;
pub mod problem;
pub mod reference;

#[cfg(test)]
#[path = "../../cli/tests/integration/study_length.rs"]
mod study_length;
