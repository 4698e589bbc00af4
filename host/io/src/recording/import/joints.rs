//! Joints of robots' own logs: the columns of each, by the names that the makers' programs give them.
//!
//! Sources: Universal Robots, *RTDE Guide*; Franka Robotics, `libfranka`, `logToCSV`.

use std::fmt::Write as _;

use super::{Understood, one_line, quoted};

/// The columns of a joint in a robot's own log.
#[derive(Clone, Debug, PartialEq)]
pub struct JointColumns {
    /// The joint in the robot's model.
    pub name: &'static str,
    /// The column of the joint's angle, rad.
    pub position: String,
    /// The column of the joint's rate, rad/s.
    pub rate: Option<String>,
    /// The column of the joint's torque, N m.
    pub effort: Option<String>,
    /// The current of its motor, A.
    pub current: Option<String>,
    maker: &'static Maker,
}

/// The way a maker's programs name joints and their columns; `#` is the number of the joint, from 0.
#[derive(Debug, PartialEq)]
struct Maker {
    /// Joints from the base on, as their URDF names them.
    joints: &'static [&'static str],
    position: &'static str,
    rate: &'static str,
    effort: &'static str,
    current: Option<&'static str>,
    /// The words above the joints in a rig file.
    words: &'static str,
}

static MAKERS: [Maker; 2] = [
    Maker {
        joints: &[
            "shoulder_pan_joint",
            "shoulder_lift_joint",
            "elbow_joint",
            "wrist_1_joint",
            "wrist_2_joint",
            "wrist_3_joint",
        ],
        position: "actual_q_#",
        rate: "actual_qd_#",
        effort: "actual_current_as_torque_#",
        current: Some("actual_current_#"),
        words: "Joints as Universal Robots' URDF names them; angles in rad, rates in rad/s. Forces at the TCP \
                are in axes of the base, and not used.",
    },
    Maker {
        joints: &[
            "fr3_joint1",
            "fr3_joint2",
            "fr3_joint3",
            "fr3_joint4",
            "fr3_joint5",
            "fr3_joint6",
            "fr3_joint7",
        ],
        position: "state.q[#]",
        rate: "state.dq[#]",
        effort: "state.tau_J[#]",
        current: None,
        words: "Joints as the URDF of Franka's FR3 names them (those of the Panda are panda_joint1 …); angles \
                in rad, rates in rad/s, torques measured behind the gears in N m.",
    },
];

impl Understood {
    /// Returns the joints whose columns are named as a maker's programs name them; none of other files.
    pub fn joints(&self) -> Vec<JointColumns> {
        MAKERS.iter().find_map(|maker| self.joints_of(maker)).unwrap_or_default()
    }

    fn joints_of(&self, maker: &'static Maker) -> Option<Vec<JointColumns>> {
        let joint = |(k, name): (usize, &&'static str)| {
            let has = |pattern: &str| {
                let name = pattern.replace('#', &k.to_string());
                self.columns.iter().any(|column| column.name == name).then_some(name)
            };
            Some(JointColumns {
                name,
                position: has(maker.position)?,
                rate: has(maker.rate),
                effort: has(maker.effort),
                current: maker.current.and_then(has),
                maker,
            })
        };
        maker.joints.iter().enumerate().map(joint).collect()
    }
}

/// Writes the columns of a robot's joints.
pub(super) fn write(text: &mut String, joints: &[JointColumns]) -> std::fmt::Result {
    if let Some(first) = joints.first() {
        writeln!(text, "\n# {}", first.maker.words)?;
    }
    for joint in joints {
        writeln!(text, "\n[[joint]]\nname = {}\nposition = {}", quoted(joint.name), quoted(&joint.position))?;
        if let Some(rate) = &joint.rate {
            writeln!(text, "rate = {}", quoted(rate))?;
        }
        match (&joint.effort, &joint.current) {
            (Some(effort), _) => writeln!(text, "effort = {}", quoted(effort))?,
            (None, Some(current)) => writeln!(
                text,
                "# {} is a current, A, and no torque: give N m for an ampere as scale\n# effort = \
                 {{ name = {}, scale = 10.0 }}",
                one_line(current),
                quoted(current)
            )?,
            (None, None) => {}
        }
    }
    Ok(())
}
