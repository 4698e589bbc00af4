//! Recordings of people: markers, force plates, joint angles.
//!
//! Lives here: readers of the files of motion-capture laboratories ([`c3d`]). May not live here: models of
//! people and what follows from a recording (that is the model's and the problem's). A name of a person in a
//! file stays there: nothing but what is asked for by its place in the format is read, and of a label only
//! what follows its last colon.

pub mod c3d;
mod frames;
pub mod ground;
pub mod markers;
pub mod motive;
pub mod opensim;
pub mod registration;
pub mod trial;
mod upright;
pub mod zeroing;
