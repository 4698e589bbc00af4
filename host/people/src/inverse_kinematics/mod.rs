//! Inverse kinematics: from markers to the coordinates of a person's joints.
//!
//! Lives here: a tree of links in a pose ([`skeleton`]), markers that are fixed to its links ([`markers`])
//! with what is known of common marker sets ([`landmarks`]), the pose of a frame ([`solve`]), joint centres
//! and marker places from frames of one person ([`calibrate`]), its lengths beside those from elsewhere
//! (`lengths`), the stature (`stature`), the model of that person ([`subject`]), and skin that slides
//! ([`soft`]). May not live here: files, and whatever follows from the coordinates.

pub mod calibrate;
mod known;
pub mod landmarks;
mod lengths;
pub mod marker_file;
pub mod marker_sets;
pub mod markers;
mod normal;
mod pelvis;
mod sides;
pub mod skeleton;
pub mod soft;
pub mod solve;
mod stature;
pub mod subject;
#[cfg(test)]
mod tests;
