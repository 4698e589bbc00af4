//! The limits of a hexapod.

use std::fmt;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Guard against singular poses: highest `cond(H)`, thesis, moments over
/// [`super::Geometry::moment_length_m`].
pub const COND_MAX: f64 = 40.0;

/// Limits beyond length and speed of the legs. What is absent does not bind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Largest acceleration of a leg, m/s².
    pub leg_acceleration_mps2: Option<f64>,
    /// Largest jerk of a leg, m/s³.
    pub leg_jerk_mps3: Option<f64>,
    /// Largest force of a leg, pushing or pulling, N.
    pub leg_force_n: Option<f64>,
    /// Largest force of a leg that pushes, N.
    pub leg_push_n: Option<f64>,
    /// Largest force of a leg that pulls, N.
    pub leg_pull_n: Option<f64>,
    /// Largest product of a pushing leg's force and the square of its length, N m²: Euler's `π² E I` of a leg
    /// hinged at both ends, over the safety factor.
    pub leg_buckling_nm2: Option<f64>,
    /// The angle by which a leg may lean at its base joint. Axes in A.
    pub base_joints: Option<JointCones>,
    /// The angle by which a leg may lean at its plate joint. Axes in P; a leg points from the base to the
    /// plate.
    pub plate_joints: Option<JointCones>,
    /// Highest `cond(H)`, moments over [`super::Geometry::moment_length_m`].
    pub cond_max: f64,
    /// The thickness of legs, plate and base; without it collisions are not checked.
    pub bulk: Option<Bulk>,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            leg_acceleration_mps2: None,
            leg_jerk_mps3: None,
            leg_force_n: None,
            leg_push_n: None,
            leg_pull_n: None,
            leg_buckling_nm2: None,
            base_joints: None,
            plate_joints: None,
            cond_max: COND_MAX,
            bulk: None,
        }
    }
}

impl Limits {
    /// Returns the first key of a limit that depends on what the legs carry; `None` if there is no such
    /// limit.
    pub fn of_force(&self) -> Option<&'static str> {
        [
            ("leg_force_n", self.leg_force_n),
            ("leg_push_n", self.leg_push_n),
            ("leg_pull_n", self.leg_pull_n),
            ("leg_buckling_nm2", self.leg_buckling_nm2),
        ]
        .into_iter()
        .find_map(|(key, limit)| limit.map(|_| key))
    }

    /// Returns the first limit of force that a leg's least and greatest force, N, exceed at a length, m: its
    /// name, the value and the limit in the name's unit.
    pub fn overloaded(&self, [low, high]: [f64; 2], length_m: f64) -> Option<(Limit, [f64; 2])> {
        let push = high.max(0.0);
        [
            (Limit::LegForce, high.max(-low), self.leg_force_n),
            (Limit::LegPush, push, self.leg_push_n),
            (Limit::LegPull, (-low).max(0.0), self.leg_pull_n),
            (Limit::LegBuckling, push * length_m * length_m, self.leg_buckling_nm2),
        ]
        .into_iter()
        .find_map(|(limit, value, most)| Some((limit, [value, most.filter(|most| value > *most)?])))
    }
}

/// The thickness of legs, plate and base, and how far from each other they must stay. What is on the plate is
/// not examined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bulk {
    /// Radius of each leg, m.
    pub leg_radius_m: f64,
    /// The part of a leg that belongs to its joint, at either end, m: it touches plate, base and its
    /// neighbour there by design.
    pub joint_length_m: f64,
    /// Radius of the bars between any two of the plate's joints, m; absent if the plate is not examined.
    pub plate_radius_m: Option<f64>,
    /// Radius of the bars between any two of the base's joints, m; absent if the base is not examined.
    pub base_radius_m: Option<f64>,
    /// Least distance of one surface from another, m.
    pub clearance_m: f64,
}

/// The parts that can touch something else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// 1 to 6.
    Leg(u8),
    /// The plate.
    Plate,
    /// The base.
    Base,
}

impl Part {
    /// Returns two parts in words.
    pub fn both(between: [Self; 2]) -> String {
        match between {
            [Self::Leg(a), Self::Leg(b)] => format!("legs {a} and {b}"),
            [Self::Leg(leg), Self::Plate] => format!("leg {leg} and the plate"),
            [Self::Leg(leg), Self::Base] => format!("leg {leg} and the base"),
            _ => "plate and base".to_owned(),
        }
    }
}

impl Bulk {
    /// Returns a leg's diameter, m: a margin is a share of that, and what is farther apart has all of it.
    pub fn range_m(&self) -> f64 {
        2.0 * self.leg_radius_m
    }

    /// Returns the bulk with a larger clearance, for which only a share of the range is used.
    pub(super) fn within(&self, share: f64) -> Self {
        Self { clearance_m: self.clearance_m + (1.0 - share) * self.range_m(), ..self.clone() }
    }
}

/// The cones in which six joints let their legs lean.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointCones {
    /// Axis of each cone; need not be of unit length.
    pub axes: [[f64; 3]; 6],
    /// Largest angle between axis and leg, rad.
    pub half_angle_rad: f64,
}

impl JointCones {
    /// Returns the angle between each axis and the direction there, rad; exact to rounding at small angles
    /// too.
    pub(super) fn angles(&self, directions: &[Vector3<f64>; 6]) -> [f64; 6] {
        std::array::from_fn(|i| {
            let axis = Vector3::from(self.axes[i]);
            axis.cross(&directions[i]).norm().atan2(axis.dot(&directions[i]))
        })
    }
}

/// One of the things that are limited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Length of a leg, m.
    LegLength,
    /// Speed of a leg, m/s.
    LegRate,
    /// Acceleration of a leg, m/s².
    LegAcceleration,
    /// Jerk of a leg, m/s³.
    LegJerk,
    /// Force of a leg, N.
    LegForce,
    /// Force of a leg that pushes, N.
    LegPush,
    /// Force of a leg that pulls, N.
    LegPull,
    /// Force of a leg that pushes, times its length squared, N m².
    LegBuckling,
    /// Angle at a base joint, rad.
    BaseJointAngle,
    /// Angle at a plate joint, rad.
    PlateJointAngle,
    /// `cond(H)`.
    Conditioning,
    /// Distance of legs, plate and base from each other, m.
    Clearance,
    /// Share of what the plate can go, of a machine without joints.
    Travel,
    /// Speed of the plate's origin, m/s, of a machine without joints.
    PlateSpeed,
    /// Angular rate of the plate, rad/s, of a machine without joints.
    PlateRate,
    /// A pose that an arm does not reach, or only in another posture.
    ArmReach,
    /// Position of an arm's joint, rad.
    ArmPosition,
    /// Rate of an arm's joint, rad/s.
    ArmRate,
    /// Acceleration of an arm's joint, rad/s².
    ArmAcceleration,
    /// Mass at an arm's flange, kg.
    ArmPayload,
}

impl Limit {
    /// Returns true if it is one of a plate whose joints are not published.
    pub fn is_of_travel(self) -> bool {
        matches!(self, Self::Travel | Self::PlateSpeed | Self::PlateRate)
    }

    /// Returns true if a motion keeps it where it only takes long enough.
    pub fn is_of_speed(self) -> bool {
        matches!(
            self,
            Self::LegRate
                | Self::LegAcceleration
                | Self::LegJerk
                | Self::PlateSpeed
                | Self::PlateRate
                | Self::ArmRate
                | Self::ArmAcceleration
        )
    }

    /// Returns true if it depends on what the legs carry.
    pub fn is_of_force(self) -> bool {
        matches!(self, Self::LegForce | Self::LegPush | Self::LegPull | Self::LegBuckling)
    }
}

/// A limit that is violated. `Display` names the leg, what it would do and what it may.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// The limit.
    pub limit: Limit,
    /// 1 to 6, a leg or a joint of an arm; absent for `cond(H)` and the clearance.
    pub leg: Option<usize>,
    /// The two parts that come too near to each other.
    pub between: Option<[Part; 2]>,
    /// The value asked for, in the limit's unit.
    pub value: f64,
    /// The range that is allowed, from the lowest to the highest value.
    pub allowed: [f64; 2],
}

impl Violation {
    /// Returns what can be done about it.
    pub fn advice(&self) -> &'static str {
        match self.limit {
            Limit::LegLength
            | Limit::BaseJointAngle
            | Limit::PlateJointAngle
            | Limit::Clearance
            | Limit::Travel
            | Limit::ArmReach
            | Limit::ArmPosition => "use smaller tilts or translations",
            Limit::ArmPayload => "use a lighter body",
            Limit::LegRate
            | Limit::LegAcceleration
            | Limit::LegJerk
            | Limit::PlateSpeed
            | Limit::PlateRate
            | Limit::ArmRate
            | Limit::ArmAcceleration => "give the motion more time",
            Limit::LegForce | Limit::LegPush | Limit::LegPull | Limit::LegBuckling => {
                "use smaller tilts, more time where it moves, or a lighter body"
            }
            Limit::Conditioning => "use less yaw or smaller tilts",
        }
    }
}

impl Violation {
    /// Returns value and limit in the unit that they are shown in, and with how many decimals at least.
    fn worded(&self) -> (f64, f64, usize) {
        let Self { value, allowed: [min, max], .. } = *self;
        match self.limit {
            Limit::LegLength => (value, if value < min { min } else { max }, 4),
            Limit::LegRate | Limit::LegAcceleration => (value.abs(), max, 3),
            Limit::LegJerk | Limit::LegBuckling => (value.abs(), max, 2),
            Limit::LegForce | Limit::LegPush | Limit::LegPull => (value.abs(), max, 1),
            Limit::BaseJointAngle | Limit::PlateJointAngle => (value.to_degrees(), max.to_degrees(), 1),
            Limit::Clearance => (1e3 * value, 1e3 * min, 1),
            Limit::Travel => (100.0 * value, 100.0, 1),
            Limit::PlateSpeed | Limit::PlateRate | Limit::Conditioning => (value, max, 3),
            Limit::ArmReach | Limit::ArmRate | Limit::ArmAcceleration => (value, max, 3),
            Limit::ArmPosition => (value.to_degrees(), max.to_degrees(), 1),
            Limit::ArmPayload => (value, max, 2),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (value, limit, digits) = self.worded();
        let (value, digits) = apart(value, limit, digits);
        let (leg, max) = (self.leg.unwrap_or(0), number(limit, digits));
        match self.limit {
            Limit::LegLength => {
                let [min, max] = self.allowed.map(|v| number(v, digits));
                write!(f, "leg {leg} would be {value} m long, it reaches from {min} m to {max} m")
            }
            Limit::LegRate => write!(f, "leg {leg} would move at {value} m/s, its limit is {max} m/s"),
            Limit::LegAcceleration => {
                write!(f, "leg {leg} would accelerate at {value} m/s², its limit is {max} m/s²")
            }
            Limit::LegForce => write!(f, "leg {leg} would carry {value} N, its limit is {max} N"),
            Limit::LegJerk => write!(
                f,
                "the jerk of leg {leg} is not known to stay below its limit of {max} m/s³, its bound is \
                 {value} m/s³"
            ),
            Limit::LegPush => write!(f, "leg {leg} would push with {value} N, its limit is {max} N"),
            Limit::LegPull => write!(f, "leg {leg} would pull with {value} N, its limit is {max} N"),
            Limit::LegBuckling => write!(
                f,
                "leg {leg} would push with {value} N m² of force times length squared, its limit against \
                 buckling is {max} N m²"
            ),
            Limit::BaseJointAngle | Limit::PlateJointAngle => {
                let joint = if self.limit == Limit::BaseJointAngle { "base" } else { "plate" };
                write!(f, "leg {leg} would lean {value}° at its {joint} joint, which allows {max}°")
            }
            Limit::Clearance => {
                let between = Part::both(self.between.unwrap_or([Part::Plate, Part::Base]));
                write!(f, "{between} would come to {value} mm of each other, {max} mm must be left")
            }
            Limit::Travel => {
                write!(f, "the plate would use {value} % of its travel, the limit is {max} %")
            }
            Limit::PlateSpeed => {
                write!(f, "the plate would move at {value} m/s, its limit is {max} m/s")
            }
            Limit::PlateRate => {
                write!(f, "the plate would turn at {value} rad/s, its limit is {max} rad/s")
            }
            Limit::Conditioning if self.value.is_infinite() => {
                write!(f, "the pose is singular, or lies beyond a singular one as seen from home")
            }
            Limit::Conditioning => {
                write!(f, "the pose is too near a singular one: cond(H) would be {value}, its limit is {max}")
            }
            Limit::ArmReach => {
                write!(f, "the arm does not reach the pose in the posture that it has at home")
            }
            Limit::ArmPosition => write!(
                f,
                "joint {leg} of the arm would turn {value}° from the middle of its range, which allows {max}°"
            ),
            Limit::ArmRate => {
                write!(f, "joint {leg} of the arm would turn at {value} rad/s, its limit is {max} rad/s")
            }
            Limit::ArmAcceleration => {
                write!(
                    f,
                    "joint {leg} of the arm would accelerate at {value} rad/s², its limit is {max} rad/s²"
                )
            }
            Limit::ArmPayload => write!(f, "the arm would carry {value} kg, its limit is {max} kg"),
        }
    }
}

/// Writes a number with the given number of decimals, or in powers of ten where those would show nothing, or
/// nothing but digits.
fn number(value: f64, digits: usize) -> String {
    let magnitude = value.abs();
    if value != 0.0
        && magnitude.is_finite()
        && (magnitude >= 1e9 || magnitude < 0.5 * 0.1_f64.powi(digits as i32))
    {
        format!("{value:.2e}")
    } else {
        format!("{value:.digits$}")
    }
}

/// Writes a value beyond a limit with as many decimals, `digits` or more, as show that it is. Returns the
/// number of those, too.
fn apart(value: f64, limit: f64, digits: usize) -> (String, usize) {
    const MOST: usize = 9;
    let enough = |d: &usize| number(value, *d) != number(limit, *d);
    let digits = (digits..=MOST).find(enough).unwrap_or(MOST);
    (number(value, digits), digits)
}
