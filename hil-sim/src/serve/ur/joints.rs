//! The arm itself: a UR5 by Denavit and Hartenberg's parameters as the maker publishes them, and how its
//! joints follow commands.

use hexapod::Pose;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// `a`, `d` (m) and `alpha` (rad) of each joint, from "DH parameters for calculations of kinematics and
/// dynamics".
const UR5: [[f64; 3]; 6] = [
    [0.0, 0.089_159, std::f64::consts::FRAC_PI_2],
    [-0.425, 0.0, 0.0],
    [-0.392_25, 0.0, 0.0],
    [0.0, 0.109_15, std::f64::consts::FRAC_PI_2],
    [0.0, 0.094_65, -std::f64::consts::FRAC_PI_2],
    [0.0, 0.0823, 0.0],
];
/// Positions when the arm is switched on, rad: the flange points down.
pub const HOME: [f64; 6] = [0.0, -1.9, -1.9, -0.9, std::f64::consts::FRAC_PI_2, 0.0];
/// Largest speed of every joint, rad/s: 180 degrees per second.
pub const FASTEST: f64 = std::f64::consts::PI;
/// Range of every joint, rad: a turn to either side.
pub const RANGE: f64 = std::f64::consts::TAU;
/// Deceleration of a joint where the controller stops it by itself, rad/s². The maker publishes stopping
/// times, not this.
const BRAKE: f64 = 12.0;
/// A joint slower than this is at rest, rad/s.
const REST: f64 = 1e-9;

/// The command of the joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Nothing: they hold.
    Hold,
    /// The joints follow a target, rad, as `servoj` does, with its look-ahead, s, and gain.
    Servo { target: [f64; 6], lookahead_s: f64, gain: f64 },
    /// The joints come to rest with this deceleration of the fastest joint, rad/s².
    Stop(f64),
}

/// The joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Joints {
    /// Positions, rad.
    pub q: [f64; 6],
    /// Rates, rad/s.
    pub qd: [f64; 6],
    pub command: Command,
}

impl Joints {
    /// Returns joints at rest at home.
    pub fn new() -> Self {
        Self { q: HOME, qd: [0.0; 6], command: Command::Hold }
    }

    /// Lets the joints brake by themselves.
    pub fn brake(&mut self) {
        self.command = Command::Stop(BRAKE);
    }

    /// Returns whether none of them moves.
    pub fn rest(&self) -> bool {
        self.qd.iter().all(|rate| rate.abs() < REST)
    }

    /// Does one cycle, s. Returns false if a joint would be faster than it may, or beyond its range.
    ///
    /// The law of `servoj` is not published. Taken is `gain (target − q − lookahead q')`, which lags a steady
    /// ramp by the look-ahead, as the script manual describes it.
    pub fn step(&mut self, cycle_s: f64) -> bool {
        match self.command {
            Command::Hold => self.qd = [0.0; 6],
            Command::Servo { target, lookahead_s, gain } => {
                for i in 0..6 {
                    let acceleration = gain * (target[i] - self.q[i] - lookahead_s * self.qd[i]);
                    self.qd[i] += acceleration * cycle_s;
                }
            }
            Command::Stop(deceleration) => {
                let fastest = self.qd.iter().fold(0.0_f64, |most, rate| most.max(rate.abs()));
                let left = (fastest - deceleration * cycle_s).max(0.0);
                let share = if fastest > 0.0 { left / fastest } else { 0.0 };
                self.qd = self.qd.map(|rate| share * rate);
                if left == 0.0 {
                    self.command = Command::Hold;
                }
            }
        }
        self.q.iter_mut().zip(self.qd).for_each(|(q, rate)| *q += rate * cycle_s);
        self.qd.iter().all(|rate| rate.abs() <= FASTEST) && self.q.iter().all(|q| q.abs() <= RANGE)
    }
}

/// Returns the fixed part of a joint, which comes after its turn.
fn after([a, d, alpha]: [f64; 3]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), alpha);
    Isometry3::from_parts(Translation3::new(a, 0.0, d), turn)
}

/// Returns the flange in the base.
pub fn flange(q: &[f64; 6]) -> Isometry3<f64> {
    UR5.iter().zip(q).fold(Isometry3::identity(), |so_far, (parameters, q)| {
        so_far * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *q) * after(*parameters)
    })
}

/// Returns the plate that is fixed to the flange: A and P coincide at home, with the base's axes.
pub fn plate(q: &[f64; 6]) -> Pose {
    let (home, now) = (flange(&HOME), flange(q));
    let turn = now.rotation * home.rotation.inverse();
    let way = now.translation.vector - home.translation.vector;
    Pose::from_quaternion(way.into(), [turn.w, turn.i, turn.j, turn.k])
}

/// Returns the tool as the controller reports it: its position, m, and rotation vector in the base.
pub fn tool(q: &[f64; 6]) -> [f64; 6] {
    let now = flange(q);
    let (at, turn) = (now.translation.vector, now.rotation.scaled_axis());
    [at.x, at.y, at.z, turn.x, turn.y, turn.z]
}

/// Returns the model of the arm as a URDF: its joints, and nothing of its masses.
pub fn urdf() -> String {
    let mut text = String::from("<?xml version=\"1.0\"?>\n<robot name=\"ur5\">\n  <link name=\"base\"/>\n");
    let names = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"];
    let mut parent = "base".to_owned();
    for (i, name) in names.iter().enumerate() {
        let [a, d, alpha] = if i == 0 { [0.0; 3] } else { UR5[i - 1] };
        text += &format!(
            "  <link name=\"{name}_link\"/>\n  <joint name=\"{name}_joint\" type=\"revolute\">\n    <parent \
             link=\"{parent}\"/>\n    <child link=\"{name}_link\"/>\n    <origin xyz=\"{a} 0 {d}\" \
             rpy=\"{alpha} 0 0\"/>\n    <axis xyz=\"0 0 1\"/>\n    <limit lower=\"{low}\" upper=\"{RANGE}\" \
             velocity=\"{FASTEST}\" effort=\"150\"/>\n  </joint>\n",
            low = -RANGE
        );
        parent = format!("{name}_link");
    }
    let [a, d, alpha] = UR5[5];
    text + &format!(
        "  <link name=\"tool0\"/>\n  <joint name=\"flange\" type=\"fixed\">\n    <parent \
         link=\"{parent}\"/>\n    <child link=\"tool0\"/>\n    <origin xyz=\"{a} 0 {d}\" rpy=\"{alpha} 0 \
         0\"/>\n  </joint>\n</robot>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the maker's table of the UR5: stretched straight up, and straight out.
    #[test]
    fn the_flange_is_where_the_lengths_say() {
        let up = flange(&[0.0, -std::f64::consts::FRAC_PI_2, 0.0, -std::f64::consts::FRAC_PI_2, 0.0, 0.0]);
        let at = up.translation.vector;
        assert!(
            (at - Vector3::new(0.0, -(0.109_15 + 0.0823), 0.089_159 + 0.425 + 0.392_25 + 0.094_65)).norm()
                < 1e-12,
            "{at}"
        );
        let out = flange(&[0.0; 6]).translation.vector;
        assert!(
            (out - Vector3::new(-(0.425 + 0.392_25), -(0.109_15 + 0.0823), 0.089_159 - 0.094_65)).norm()
                < 1e-12,
            "{out}"
        );
        // At home the flange points down.
        let down = flange(&HOME).rotation * Vector3::z();
        assert!((down + Vector3::z()).norm() < 0.2, "{down}");
    }

    #[test]
    fn a_ramp_is_followed_with_the_look_ahead_behind_it_and_a_stop_takes_its_deceleration() {
        let (mut joints, cycle) = (Joints::new(), 0.002);
        for k in 1..=1000 {
            let target =
                std::array::from_fn(|i| HOME[i] + 0.5 * cycle * f64::from(k) * f64::from(u8::from(i == 2)));
            joints.command = Command::Servo { target, lookahead_s: 0.1, gain: 300.0 };
            assert!(joints.step(cycle));
        }
        let lag = (HOME[2] + 1.0 - joints.q[2]) / 0.5;
        assert!((lag - 0.1).abs() < 0.003, "{lag}");
        let before = joints.q[2];
        joints.command = Command::Stop(2.0);
        let cycles = (0..).take_while(|_| {
            joints.step(cycle);
            !joints.rest()
        });
        assert!((cycles.count() as f64 * cycle - 0.25).abs() < 0.006);
        assert!((joints.q[2] - before - 0.0625).abs() < 0.001);
    }
}
