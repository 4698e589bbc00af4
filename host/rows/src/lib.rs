//! Rows of one rigid body and of trees of links, made from recordings.
//!
//! [`body`] makes the six rows an instant of a wrench on a load cell, in motion or in still poses; [`tree`]
//! those of joint torques, base wrenches and contacts. [`smoothing`] filters and differentiates what they
//! need, and `white_noise` finds what it is uncertain by. The solution of the rows is in [`rigident_fit`].
//!
//! ```
//! use rigident_fit::RowSource;
//! use rigident_io::recording::Recording;
//! use rigident_rows::body::BodySource;
//! use rigident_rows::body::prepare::prepare;
//!
//! let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/bracket.csv");
//! let prepared = prepare(&Recording::load(bracket.as_ref(), None).unwrap()).unwrap();
//! let source = BodySource::new(prepared.input, prepared.rig.imu_on(0));
//! assert_eq!(source.parameters()[0].name, "m");
//! ```

pub mod body;
pub mod imu;
pub mod moved;
pub mod named_model;
pub mod smoothing;
pub mod tree;
pub mod white_noise;
