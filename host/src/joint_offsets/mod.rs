//! Offsets of joint angles, from poses in which a robot stands with flat soles on a level floor.
//!
//! Lives here: the tree of joints that turn or slide one by one (`kinematics`), what a pose says as whitened rows ([`pose`]), the search for
//! the offsets ([`search`]) by two methods ([`solve`], `gradient`), what they are worth and how many poses are enough ([`result`]), and the files of poses
//! and contacts ([`poses_file`], [`contacts_file`]). May not live here: options, words for people, and models beyond their joints
//! (`crate::model`).
//!
//! The theory is that of K. Yamane, *Practical kinematic and dynamic calibration methods for force-controlled humanoid robots*, with every
//! row divided by its standard deviation.

pub mod contacts_file;
mod gradient;
mod kinematics;
pub mod pose;
pub mod poses_file;
pub mod result;
pub mod search;
pub mod solve;
#[cfg(test)]
mod tests;

use nalgebra::UnitQuaternion;

pub use kinematics::{JointTree, TreeProblem};

/// A sole: a link and the corners that touch the floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Sole {
    /// Its name.
    pub name: String,
    /// Index of its link in the model.
    pub link: usize,
    /// Its corners in the link's frame, m.
    pub corners_m: Vec<[f64; 3]>,
}

/// One pose as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// Its name in messages.
    pub name: String,
    /// Measured positions of all joints that count, rad or m, in the order of [`Setup::joints`].
    pub positions: Vec<f64>,
    /// Measured attitudes of links, link axes to world axes with z up, in the order of [`Setup::measured_links`].
    pub attitudes: Vec<UnitQuaternion<f64>>,
    /// Whether each sole stands on the floor, in the order of [`Setup::soles`].
    pub stands: Vec<bool>,
}

/// Standard deviations of everything that is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// 1 σ of a measured attitude about any axis, rad.
    pub attitude_rad: f64,
    /// 1 σ of a corner's height above the floor, m.
    pub height_m: f64,
    /// 1 σ of a measured joint angle, pose by pose, rad (m of a joint that slides).
    pub encoder_rad: f64,
    /// 1 σ of the constant error of each IMU's mounting about any axis, rad; zero if it is calibrated.
    pub mounting_rad: f64,
}

impl Default for Noise {
    /// The noise that the command assumes where nothing is given.
    fn default() -> Self {
        Self {
            attitude_rad: 0.2_f64.to_radians(),
            height_m: 1e-3,
            encoder_rad: 0.05_f64.to_radians(),
            mounting_rad: 0.0,
        }
    }
}

/// What is the same in all poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The robot's joints.
    pub tree: JointTree,
    /// Its soles.
    pub soles: Vec<Sole>,
    /// Indices of the links whose attitudes are measured.
    pub measured_links: Vec<usize>,
    /// Indices of the links on whose joints a sole or a measured link depends: the joints that count.
    pub joints: Vec<usize>,
    /// Places in `joints` of those whose offsets are asked for.
    pub asked: Vec<usize>,
    /// Standard deviations.
    pub noise: Noise,
}

impl Setup {
    /// Builds the setup of a tree; without names, offsets of all joints between the base and the soles are asked for.
    ///
    /// # Errors
    /// Says which joint is not there or does not count, or that no offset is left.
    pub fn new(
        tree: JointTree,
        soles: Vec<Sole>,
        measured_links: Vec<usize>,
        names: &[String],
        noise: Noise,
    ) -> Result<Self, String> {
        let of_soles = tree.joints_to(soles.iter().map(|sole| sole.link))?;
        let joints =
            tree.joints_to(soles.iter().map(|sole| sole.link).chain(measured_links.iter().copied()))?;
        let mut asked = Vec::new();
        for name in names {
            let known = || joints.iter().map(|i| tree.joint_name(*i)).collect::<Vec<_>>().join(", ");
            let place = joints.iter().position(|i| tree.joint_name(*i) == name).ok_or_else(|| {
                format!(
                    "--joints {name}: no such joint moves a sole or a measured link against the base; those that do are {}",
                    known()
                )
            })?;
            if asked.contains(&place) {
                return Err(format!("--joints {name}: it is given twice"));
            }
            asked.push(place);
        }
        if names.is_empty() {
            asked =
                (0..joints.len()).filter(|k| joints.get(*k).is_some_and(|i| of_soles.contains(i))).collect();
        }
        if asked.is_empty() {
            return Err(
                "no joint stands between the base and the soles: there is no offset to find".to_owned()
            );
        }
        Ok(Self { tree, soles, measured_links, joints, asked, noise })
    }

    /// Returns the names of the joints whose offsets are asked for.
    pub fn asked_names(&self) -> Vec<&str> {
        self.asked.iter().filter_map(|k| self.joints.get(*k)).map(|i| self.tree.joint_name(*i)).collect()
    }

    /// Returns the number of columns that all poses share: the offsets, then three numbers of each IMU's mounting if it is not exact.
    pub fn shared_columns(&self) -> usize {
        self.asked.len() + self.mounting_columns()
    }

    /// Returns the number of columns of the IMUs' mountings.
    pub fn mounting_columns(&self) -> usize {
        if self.noise.mounting_rad > 0.0 { 3 * self.measured_links.len() } else { 0 }
    }
}
