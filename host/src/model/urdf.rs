//! Models from URDF.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Rotation3, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{Joint, Link};
use urdf_rs::JointType;

use super::finding::{Finding, ModelError};
use super::inertial::{Parameters, in_parent};
use super::tree::{Mimic, Model, ModelLink, RawLink};
use super::urdf_fault::{fault, has_macro_elements};

/// Reads a file.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn read(path: &Path) -> Result<Model, ModelError> {
    let text =
        std::fs::read_to_string(path).map_err(|source| ModelError::Read { path: path.to_owned(), source })?;
    parse(&text, &path.display().to_string())
}

/// What to do with macros.
const EXPAND: &str = "it holds macros, which are not followed: expand them first (`xacro FILE > robot.urdf`)";

/// Reads the text of a URDF; `what` names it in complaints.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn parse(text: &str, what: &str) -> Result<Model, ModelError> {
    let robot = urdf_rs::read_from_string(text)
        .map_err(|error| ModelError::Syntax { what: what.to_owned(), reason: reason(&error, text) })?;
    let refuse = |problem: String| ModelError::Structure { what: what.to_owned(), problem };
    if has_macro_elements(text) {
        return Err(refuse(EXPAND.to_owned()));
    }
    if robot.links.is_empty() {
        return Err(refuse("there is no link in it".to_owned()));
    }
    let mut findings = Vec::new();
    let mut held: BTreeMap<&str, &urdf_rs::Joint> = BTreeMap::new();
    for joint in &robot.joints {
        if let Some(other) = held.insert(&joint.child.link, joint) {
            return Err(refuse(format!(
                "joints {} and {} both hold link {}: the model has a loop; only trees can be identified, cut it at one \
                 of them",
                other.name, joint.name, joint.child.link
            )));
        }
        if !robot.links.iter().any(|l| l.name == joint.child.link) {
            return Err(refuse(format!(
                "joint {} holds link {}, which is not there",
                joint.name, joint.child.link
            )));
        }
        let limit = &joint.limit;
        if matches!(joint.joint_type, JointType::Revolute | JointType::Prismatic)
            && limit.lower == limit.upper
            // Without a <limit> there is nothing to go by.
            && *limit != urdf_rs::JointLimit::default()
        {
            findings.push(Finding {
                place: format!("joint {}", joint.name),
                text: format!(
                    "never moves by its limits ({0} to {0}): counted as a joint that does; if it does not, say --lock {1}",
                    limit.lower, joint.name
                ),
            });
        }
    }
    let raw = robot
        .links
        .iter()
        .map(|link| {
            let nominal = nominal(&link.inertial);
            let base = ModelLink::new(link.name.clone(), String::new(), Link {
                    parent: 0,
                    joint: Joint::Free,
                    rotation: Matrix3::identity(),
                    position: Vector3::zeros(),
                }, nominal);
            let Some(joint) = held.get(link.name.as_str()) else {
                return Ok(RawLink { link: base, parent: None });
            };
            let (rotation, position) = place(&joint.origin);
            let axis = Vector3::from(joint.axis.xyz.0);
            let kind = match joint.joint_type {
                JointType::Revolute | JointType::Continuous => Joint::Revolute(axis),
                JointType::Prismatic => Joint::Prismatic(axis),
                JointType::Fixed => Joint::Fixed,
                JointType::Floating => Joint::Free,
                JointType::Spherical => Joint::Spherical,
                JointType::Planar => {
                    return Err(refuse(format!(
                        "joint {} is planar, which is not known here; give it as two prismatic joints and a revolute one",
                        joint.name
                    )));
                }
            };
            let mimic = joint.mimic.as_ref().map(|m| Mimic {
                leader: m.joint.clone(),
                multiplier: m.multiplier.unwrap_or(1.0),
                offset: m.offset.unwrap_or(0.0),
            });
            let link =
                ModelLink { joint_name: joint.name.clone(), link: Link { parent: 0, joint: kind, rotation, position }, mimic, ..base };
            Ok(RawLink { link, parent: Some(joint.parent.link.clone()) })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut model = Model::assemble(what, raw, findings)?;
    if !robot.name.is_empty() {
        model.name.clone_from(&robot.name);
    }
    Ok(model)
}

/// What is wrong, where; what the reader says where nothing more is known.
fn reason(error: &urdf_rs::UrdfError, text: &str) -> String {
    if text.contains("${") || has_macro_elements(text) {
        return EXPAND.to_owned();
    }
    if let Some(fault) = fault(text) {
        return fault;
    }
    let hint = if text.contains("<robot") { "" } else { "; it has no <robot> element" };
    format!("{error}{hint}")
}

fn place(pose: &urdf_rs::Pose) -> (Matrix3<f64>, Vector3<f64>) {
    let [roll, pitch, yaw] = pose.rpy.0;
    // Fixed axes: Rz(yaw) Ry(pitch) Rx(roll).
    (Rotation3::from_euler_angles(roll, pitch, yaw).into_inner(), Vector3::from(pose.xyz.0))
}

/// About the link's origin in its axes; `None` if there is no mass and no inertia.
fn nominal(inertial: &urdf_rs::Inertial) -> Option<Parameters> {
    let i = &inertial.inertia;
    let mass = inertial.mass.value;
    let tensor = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    if mass == 0.0 && tensor.iter().all(|v| *v == 0.0) {
        return None;
    }
    let (rotation, position) = place(&inertial.origin);
    let about_com =
        InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::zero(), tensor).to_vector();
    Some(in_parent(&about_com, &rotation, &position))
}
