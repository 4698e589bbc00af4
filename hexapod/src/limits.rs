//! What a hexapod must not do, and how far a state is from doing it.

use std::fmt;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::Geometry;
use super::kinematics::PlateState;
use super::legs::Legs;
use super::load::Load;

/// Guard against singular poses: highest `cond(H)`, thesis.
pub const COND_MAX: f64 = 40.0;

/// Limits beyond length and speed of the legs. What is absent does not bind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Largest acceleration of a leg, m/s².
    pub leg_acceleration_mps2: Option<f64>,
    /// Largest force of a leg, pushing or pulling, N.
    pub leg_force_n: Option<f64>,
    /// How far a leg may lean at its base joint. Axes in A.
    pub base_joints: Option<JointCones>,
    /// How far a leg may lean at its plate joint. Axes in P; a leg points from the base to the plate.
    pub plate_joints: Option<JointCones>,
    /// Highest `cond(H)`.
    pub cond_max: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            leg_acceleration_mps2: None,
            leg_force_n: None,
            base_joints: None,
            plate_joints: None,
            cond_max: COND_MAX,
        }
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
    /// Angle between each axis and the direction there, rad; exact to rounding at small angles too.
    fn angles(&self, directions: &[Vector3<f64>; 6]) -> [f64; 6] {
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
    /// Force of a leg, N.
    LegForce,
    /// Angle at a base joint, rad.
    BaseJointAngle,
    /// Angle at a plate joint, rad.
    PlateJointAngle,
    /// `cond(H)`.
    Conditioning,
}

/// A limit that is not kept. `Display` names the leg, what it would do and what it may.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// Which limit.
    pub limit: Limit,
    /// 1 to 6; absent for `cond(H)`.
    pub leg: Option<usize>,
    /// What was asked for, in the limit's unit.
    pub value: f64,
    /// From where to where it may be.
    pub allowed: [f64; 2],
}

impl Violation {
    /// What can be done about it.
    pub fn advice(&self) -> &'static str {
        match self.limit {
            Limit::LegLength | Limit::BaseJointAngle | Limit::PlateJointAngle => {
                "use smaller tilts or translations"
            }
            Limit::LegRate | Limit::LegAcceleration => "give the motion more time",
            Limit::LegForce => "use smaller tilts, more time where it moves, or a lighter body",
            Limit::Conditioning => "use less yaw or smaller tilts",
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { value, allowed: [min, max], .. } = self;
        let leg = self.leg.unwrap_or(0);
        match self.limit {
            Limit::LegLength => {
                let nearer = if value < min { min } else { max };
                let (value, digits) = apart(*value, *nearer, 4);
                let [min, max] = [min, max].map(|v| number(*v, digits));
                write!(f, "leg {leg} would be {value} m long, it reaches from {min} m to {max} m")
            }
            Limit::LegRate => {
                let (value, digits) = apart(value.abs(), *max, 3);
                write!(f, "leg {leg} would move at {value} m/s, its limit is {} m/s", number(*max, digits))
            }
            Limit::LegAcceleration => {
                let (value, digits) = apart(value.abs(), *max, 3);
                write!(
                    f,
                    "leg {leg} would accelerate at {value} m/s², its limit is {} m/s²",
                    number(*max, digits)
                )
            }
            Limit::LegForce => {
                let (value, digits) = apart(value.abs(), *max, 1);
                write!(f, "leg {leg} would carry {value} N, its limit is {} N", number(*max, digits))
            }
            Limit::BaseJointAngle | Limit::PlateJointAngle => {
                let (value, digits) = apart(value.to_degrees(), max.to_degrees(), 1);
                write!(
                    f,
                    "leg {leg} would lean {value}° at its {} joint, which allows {}°",
                    if self.limit == Limit::BaseJointAngle { "base" } else { "plate" },
                    number(max.to_degrees(), digits)
                )
            }
            Limit::Conditioning if value.is_infinite() => {
                write!(f, "the pose is singular, or lies beyond a singular one as seen from home")
            }
            Limit::Conditioning => {
                let (value, digits) = apart(*value, *max, 3);
                write!(
                    f,
                    "the pose is too near a singular one: cond(H) would be {value}, its limit is {}",
                    number(*max, digits)
                )
            }
        }
    }
}

/// With so many decimals, or in powers of ten where those would show nothing, or nothing but digits.
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

/// A value beyond a limit with as many decimals, `digits` or more, as show that it is; and how many those are.
fn apart(value: f64, limit: f64, digits: usize) -> (String, usize) {
    const MOST: usize = 9;
    let enough = |d: &usize| number(value, *d) != number(limit, *d);
    let digits = (digits..=MOST).find(enough).unwrap_or(MOST);
    (number(value, digits), digits)
}

/// What every limited quantity is at one state, beside its limit. Quantities without a limit are given too, with an
/// infinite one, so that a planner can see them; forces are there if a load was given.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitMargins {
    /// Lengths, m.
    pub leg_length_m: [f64; 6],
    /// Shortest and longest, m.
    pub leg_length_limit_m: [f64; 2],
    /// Speeds, m/s.
    pub leg_rate_mps: [f64; 6],
    /// Highest, m/s.
    pub leg_rate_limit_mps: f64,
    /// Accelerations, m/s².
    pub leg_acceleration_mps2: [f64; 6],
    /// Highest, m/s².
    pub leg_acceleration_limit_mps2: f64,
    /// Least and greatest force of each leg, N, over all bodies that the load may be; equal for a known body.
    pub leg_force_n: Option<[[f64; 2]; 6]>,
    /// Highest magnitude, N.
    pub leg_force_limit_n: f64,
    /// Angles at the base joints, rad; absent without cones.
    pub base_joint_rad: Option<[f64; 6]>,
    /// Largest, rad.
    pub base_joint_limit_rad: f64,
    /// Angles at the plate joints, rad; absent without cones.
    pub plate_joint_rad: Option<[f64; 6]>,
    /// Largest, rad.
    pub plate_joint_limit_rad: f64,
    /// `cond(H)`, infinite beyond a singular pose as [`Geometry::guarded_condition`] has it.
    pub condition_number: f64,
    /// Highest.
    pub condition_limit: f64,
}

/// One limit's distance at a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// Value and limit.
    pub at: Violation,
    /// Distance to the limit as a share of what is allowed: 1 far away, 0 on the limit, negative beyond it. Of a
    /// length, the distance to the nearer end over half the stroke; of `cond(H)`, `1 − cond / limit`; of everything
    /// else `1 − |value| / limit`.
    pub relative: f64,
}

impl LimitMargins {
    /// Every limit's margin at every leg.
    pub fn all(&self) -> impl Iterator<Item = Margin> + '_ {
        let [lo, hi] = self.leg_length_limit_m;
        let lengths = self.leg_length_m.into_iter().enumerate().map(move |(i, l)| Margin {
            at: Violation { limit: Limit::LegLength, leg: Some(i + 1), value: l, allowed: [lo, hi] },
            relative: (l - lo).min(hi - l) / (0.5 * (hi - lo)),
        });
        let within = |limit, max: f64, values: Option<[f64; 6]>| {
            values.into_iter().flatten().enumerate().map(move |(i, value)| Margin {
                at: Violation { limit, leg: Some(i + 1), value, allowed: [-max, max] },
                relative: if max.is_infinite() { 1.0 } else { 1.0 - value.abs() / max },
            })
        };
        let larger = |[a, b]: [f64; 2]| if b.abs() >= a.abs() { b } else { a };
        lengths
            .chain(within(Limit::LegRate, self.leg_rate_limit_mps, Some(self.leg_rate_mps)))
            .chain(within(
                Limit::LegAcceleration,
                self.leg_acceleration_limit_mps2,
                Some(self.leg_acceleration_mps2),
            ))
            .chain(within(Limit::BaseJointAngle, self.base_joint_limit_rad, self.base_joint_rad))
            .chain(within(Limit::PlateJointAngle, self.plate_joint_limit_rad, self.plate_joint_rad))
            .chain(within(Limit::LegForce, self.leg_force_limit_n, self.leg_force_n.map(|f| f.map(larger))))
            .chain(std::iter::once(Margin {
                at: Violation {
                    limit: Limit::Conditioning,
                    leg: None,
                    value: self.condition_number,
                    allowed: [1.0, self.condition_limit],
                },
                relative: if self.condition_limit.is_infinite() {
                    1.0
                } else {
                    1.0 - self.condition_number / self.condition_limit
                },
            }))
    }

    /// The limit that is nearest, or furthest overstepped. A value that is not a number counts as overstepped.
    pub fn tightest(&self) -> Margin {
        let order = |m: &Margin| if m.relative.is_nan() { f64::NEG_INFINITY } else { m.relative };
        let mut all = self.all();
        let Some(mut tightest) = all.next() else { unreachable!("six lengths are always there") };
        for margin in all {
            if order(&margin) < order(&tightest) {
                tightest = margin;
            }
        }
        tightest
    }

    /// The first limit that is not kept, in the order of [`Limit`]'s cheap ones first.
    ///
    /// # Errors
    /// The limit, leg and value.
    pub fn check(&self) -> Result<(), Violation> {
        match self.all().find(|m| m.relative < 0.0 || m.relative.is_nan()) {
            Some(margin) => Err(margin.at),
            None => Ok(()),
        }
    }
}

impl Geometry {
    /// Cones of half-angle `half_angle_rad` about the legs' directions at [`Geometry::home`], for the base joints (axes
    /// in A) or, home being level, for the plate joints (axes in P).
    pub fn cones_about_home(&self, half_angle_rad: f64) -> JointCones {
        JointCones { axes: self.legs(&self.home()).directions.map(Into::into), half_angle_rad }
    }

    /// Every limited quantity at `state` beside its limit; with `load`, the forces of the legs too.
    pub fn margins(&self, state: &PlateState, load: Option<&Load>) -> LimitMargins {
        let legs = self.legs_at(&state.position, &state.rotation);
        let (w, dw) = (state.rotation * state.angular_rate, state.rotation * state.angular_acceleration);
        let limits = &self.limits;
        let [base_joint_rad, plate_joint_rad] = self.joint_angles(&legs, state);
        let most = |limit: Option<f64>| limit.unwrap_or(f64::INFINITY);
        let widest = |cones: &Option<JointCones>| most(cones.as_ref().map(|c| c.half_angle_rad));
        LimitMargins {
            leg_length_m: legs.lengths,
            leg_length_limit_m: self.leg_length_m,
            leg_rate_mps: legs.rates(&state.velocity, &w),
            leg_rate_limit_mps: self.leg_rate_mps,
            leg_acceleration_mps2: legs.accelerations(&state.velocity, &w, &state.acceleration, &dw),
            leg_acceleration_limit_mps2: most(limits.leg_acceleration_mps2),
            leg_force_n: load.map(|load| load.leg_forces_of(&legs, state)),
            leg_force_limit_n: most(limits.leg_force_n),
            base_joint_rad,
            base_joint_limit_rad: widest(&limits.base_joints),
            plate_joint_rad,
            plate_joint_limit_rad: widest(&limits.plate_joints),
            condition_number: self.guarded_condition(&legs),
            condition_limit: limits.cond_max,
        }
    }

    /// `det H` at home. A pose at which it has the other sign lies beyond a singular one: whatever its own `cond(H)`,
    /// no path of finite `cond(H)` leads there from home.
    pub(super) fn home_determinant(&self) -> f64 {
        self.legs(&self.home()).force_transmission().determinant()
    }

    /// `cond(H)`, or infinity where `det H` has not the sign that it has at home.
    pub fn guarded_condition(&self, legs: &Legs) -> f64 {
        let h = legs.force_transmission();
        if h.determinant() * self.home_determinant() > 0.0 { legs.condition_number() } else { f64::INFINITY }
    }

    /// Whether `cond(H)` is within the guard, on home's side of every singular pose.
    pub fn is_guarded(&self, legs: &Legs) -> bool {
        legs.is_conditioned_within(self.limits.cond_max)
            && legs.force_transmission().determinant() * self.home_determinant() > 0.0
    }

    pub(super) fn joint_angles(&self, legs: &Legs, state: &PlateState) -> [Option<[f64; 6]>; 2] {
        let base = self.limits.base_joints.as_ref().map(|cones| cones.angles(&legs.directions));
        let plate = self.limits.plate_joints.as_ref().map(|cones| {
            let back = state.rotation.transpose();
            cones.angles(&legs.directions.map(|n| back * n))
        });
        [base, plate]
    }
}
