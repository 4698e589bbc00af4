//! Files of OpenSim's laboratories: markers (TRC), tables over time (MOT, STO), and wrenches of the ground in
//! them.
//!
//! Coordinates stay in the file's axes. OpenSim's ground has x forward, y up, z to the right.

pub mod error;
mod functions;
pub mod ground_reaction;
mod lines;
pub mod model;
pub mod storage;
pub mod trc;

pub use error::OpenSimError;
