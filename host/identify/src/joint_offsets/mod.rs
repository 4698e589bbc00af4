//! Offsets of joint angles, from poses in which a robot stands with flat soles on a level floor, touches
//! planes or is held.
//!
//! Lives here: the tree of joints that turn or slide one by one (`kinematics`), what poses share
//! ([`shared`]), what a pose says as whitened rows ([`pose`]), the search for the offsets ([`search`]) by
//! two methods ([`solve`], `gradient`), what they are worth and how many poses are enough ([`result`]), the
//! fault that explains poses that contradict each other ([`faults`]), the texts about all this
//! ([`remarks`]), the drawing of a pose ([`drawn`]), and the files of poses and contacts ([`poses_file`],
//! [`contacts_file`]).
//! May not live here: options, pages, and models beyond their joints (`rigident_model`).
//!
//! The theory is that of K. Yamane, *Practical kinematic and dynamic calibration methods for force-controlled
//! humanoid robots*, with every row divided by its standard deviation.

pub mod contacts_file;
pub mod drawn;
pub mod faults;
mod gradient;
mod kinematics;
#[cfg(test)]
mod laboratory;
pub mod pose;
pub mod poses_file;
pub mod remarks;
pub mod result;
pub mod search;
pub mod shared;
pub mod solve;
#[cfg(test)]
mod tests;
mod turns;

use nalgebra::{UnitQuaternion, Vector3};

pub use kinematics::{JointTree, TreeProblem};

/// A sole, or another face of a link that touches a plane with its corners.
#[derive(Clone, Debug, PartialEq)]
pub struct Sole {
    /// Its name.
    pub name: String,
    /// Index of its link in the model.
    pub link: usize,
    /// Its corners in the link's frame, m.
    pub corners_m: Vec<[f64; 3]>,
    /// Place of its plane in [`Contacts::planes`]; 0 is the floor.
    pub plane: usize,
}

/// A plane that soles touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Its name.
    pub name: String,
    /// Its unit normal in the world's axes, z up.
    pub normal: Vector3<f64>,
    /// 1 σ of its normal about each axis along it, rad; zero if it is exact.
    pub tilt_rad: f64,
    /// Whether heights count from it, as from the floor; of another plane the distance along its normal is
    /// unknown.
    pub at_origin: bool,
}

/// A link that is at the same place in all poses in which it is held.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// Its name.
    pub name: String,
    /// Index of its link in the model.
    pub link: usize,
    /// The point of the link that stays where it is, in the link's frame, m.
    pub point_m: [f64; 3],
    /// Whether the link may turn about that point from pose to pose.
    pub turns: bool,
}

/// An IMU whose axes are not those of its link.
#[derive(Clone, Debug, PartialEq)]
pub struct Imu {
    /// Index of its link in the model.
    pub link: usize,
    /// Link axes ← axes of the IMU.
    pub rotation: UnitQuaternion<f64>,
}

/// The parts that touch or hold the robot. Names are in the order of soles, then held links.
#[derive(Clone, Debug, PartialEq)]
pub struct Contacts {
    /// The soles.
    pub soles: Vec<Sole>,
    /// The planes, of which the first is the floor.
    pub planes: Vec<Plane>,
    /// The held links.
    pub held: Vec<Held>,
    /// IMUs whose axes are not those of their links.
    pub imus: Vec<Imu>,
}

impl From<Vec<Sole>> for Contacts {
    fn from(soles: Vec<Sole>) -> Self {
        let floor = Plane { name: "floor".to_owned(), normal: Vector3::z(), tilt_rad: 0.0, at_origin: true };
        Self { soles, planes: vec![floor], held: Vec::new(), imus: Vec::new() }
    }
}

impl Contacts {
    /// Returns the names of all contacts, soles first.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let soles = self.soles.iter().map(|sole| sole.name.as_str());
        soles.chain(self.held.iter().map(|held| held.name.as_str()))
    }

    /// Returns the links of all contacts.
    pub fn links(&self) -> impl Iterator<Item = usize> + '_ {
        self.soles.iter().map(|sole| sole.link).chain(self.held.iter().map(|held| held.link))
    }

    /// Returns the number of contacts.
    pub fn count(&self) -> usize {
        self.soles.len() + self.held.len()
    }
}

/// One pose as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// Its name in messages.
    pub name: String,
    /// Measured positions of all joints that count, rad or m, in the order of [`Setup::joints`].
    pub positions: Vec<f64>,
    /// Measured attitudes of links, link axes to world axes with z up, in the order of
    /// [`Setup::measured_links`].
    pub attitudes: Vec<UnitQuaternion<f64>>,
    /// Whether each contact is made, in the order of [`Contacts::names`].
    pub stands: Vec<bool>,
}

/// A heading with a larger σ than this, rad, says nothing (30°).
pub const HEADING_FREE: f64 = 0.52;

/// Standard deviations of everything that is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// 1 σ of a measured attitude about any level axis, rad.
    pub attitude_rad: f64,
    /// 1 σ of its heading, rad; above [`HEADING_FREE`] headings say nothing.
    pub yaw_rad: f64,
    /// 1 σ of a corner's distance from its plane and of a held point's from its place, m.
    pub height_m: f64,
    /// 1 σ of the floor's slope about any level axis, rad; zero if it is level.
    pub floor_rad: f64,
    /// 1 σ of a measured joint angle, pose by pose, rad.
    pub encoder_rad: f64,
    /// 1 σ of the measured position of a joint that slides, pose by pose, m.
    pub slide_m: f64,
    /// 1 σ of the constant error of each IMU's mounting about any axis, rad; zero if it is calibrated.
    pub mounting_rad: f64,
}

impl Default for Noise {
    /// The noise that the command assumes where nothing is given.
    fn default() -> Self {
        Self {
            attitude_rad: 0.2_f64.to_radians(),
            yaw_rad: 0.2_f64.to_radians(),
            height_m: 1e-3,
            floor_rad: 0.1_f64.to_radians(),
            encoder_rad: 0.05_f64.to_radians(),
            slide_m: 5e-4,
            mounting_rad: 0.0,
        }
    }
}

/// The data that are the same in all poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The robot's joints.
    pub tree: JointTree,
    /// The parts that touch or hold it.
    pub contacts: Contacts,
    /// Indices of the links whose attitudes are measured.
    pub measured_links: Vec<usize>,
    /// Indices of the links on whose joints a contact or a measured link depends: the joints that count.
    pub joints: Vec<usize>,
    /// Places in `joints` of those whose offsets are asked for.
    pub asked: Vec<usize>,
    /// Standard deviations.
    pub noise: Noise,
}

impl Setup {
    /// Builds the setup of a tree; without names, offsets of all joints between the base and the contacts are
    /// asked for.
    ///
    /// # Errors
    /// Says which joint is not there or does not count, or that no offset is left.
    pub fn new(
        tree: JointTree,
        contacts: impl Into<Contacts>,
        measured_links: Vec<usize>,
        names: &[String],
        noise: Noise,
    ) -> Result<Self, String> {
        let mut contacts = contacts.into();
        if let Some(floor) = contacts.planes.first_mut() {
            floor.tilt_rad = noise.floor_rad;
        }
        let of_contacts = tree.joints_to(contacts.links())?;
        let joints = tree.joints_to(contacts.links().chain(measured_links.iter().copied()))?;
        let mut asked = Vec::new();
        for name in names {
            let known = || joints.iter().map(|i| tree.joint_name(*i)).collect::<Vec<_>>().join(", ");
            let place = joints.iter().position(|i| tree.joint_name(*i) == name).ok_or_else(|| {
                format!(
                    "`joints` {name}: no such joint moves a contact or a measured link against the base; \
                     those that do are {}",
                    known()
                )
            })?;
            if asked.contains(&place) {
                return Err(format!("`joints` {name}: it is given twice"));
            }
            asked.push(place);
        }
        if names.is_empty() {
            asked = (0..joints.len())
                .filter(|k| joints.get(*k).is_some_and(|i| of_contacts.contains(i)))
                .collect();
        }
        if asked.is_empty() {
            return Err(
                "no joint is between the base and the contacts: there is no offset to find".to_owned()
            );
        }
        Ok(Self { tree, contacts, measured_links, joints, asked, noise })
    }

    /// Returns the names of the joints whose offsets are asked for.
    pub fn asked_names(&self) -> Vec<&str> {
        self.asked.iter().filter_map(|k| self.joints.get(*k)).map(|i| self.tree.joint_name(*i)).collect()
    }
}
