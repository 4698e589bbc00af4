//! The distance of a state from what a hexapod must not do.

use super::bulk::Nearest;
use super::geometry::Geometry;
use super::kinematics::PlateState;
use super::legs::Legs;
use super::limits::{Bulk, JointCones, Limit, Part, Violation};
use super::load::Load;
use super::travel::Travel;

/// The value of every limited quantity at one state, beside its limit. Quantities without a limit are given
/// too, with an infinite one, so that a planner can see them; forces are there if a load was given.
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
    /// Highest of a leg that pushes, N.
    pub leg_push_limit_n: f64,
    /// Highest of a leg that pulls, N.
    pub leg_pull_limit_n: f64,
    /// Highest of a leg that pushes, times its length squared, N m².
    pub leg_buckling_limit_nm2: f64,
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
    /// The two parts that are nearest to each other; absent where collisions are not checked.
    pub nearest: Option<Nearest>,
    /// Least distance, m.
    pub clearance_limit_m: f64,
    /// The distance allowed beyond that for a margin of one, m.
    pub clearance_range_m: f64,
    /// The part used of the travel of a machine without joints; nothing of the above is of account then.
    pub travel: Option<TravelMargins>,
}

/// The part used of a [`Travel`] at a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TravelMargins {
    /// Share of the travel: one is all of it.
    pub share: f64,
    /// Speed of the plate's origin, m/s.
    pub speed_mps: f64,
    /// Highest, m/s.
    pub speed_limit_mps: f64,
    /// Angular rate, rad/s.
    pub rate_radps: f64,
    /// Highest, rad/s.
    pub rate_limit_radps: f64,
}

impl TravelMargins {
    /// Returns each quantity's margin.
    pub fn all(self) -> [Margin; 3] {
        let of = |limit, value: f64, most: f64| Margin {
            at: Violation { limit, leg: None, between: None, value, allowed: [0.0, most] },
            relative: if most.is_infinite() { 1.0 } else { 1.0 - value / most },
        };
        [
            of(Limit::Travel, self.share, 1.0),
            of(Limit::PlateSpeed, self.speed_mps, self.speed_limit_mps),
            of(Limit::PlateRate, self.rate_radps, self.rate_limit_radps),
        ]
    }
}

impl Travel {
    /// Returns what is used of it at a state.
    pub fn margins(&self, state: &PlateState) -> TravelMargins {
        TravelMargins {
            share: self.share(&state.pose().coordinates()),
            speed_mps: state.velocity.norm(),
            speed_limit_mps: self.speed_mps.unwrap_or(f64::INFINITY),
            rate_radps: state.angular_rate.norm(),
            rate_limit_radps: self.rate_radps.unwrap_or(f64::INFINITY),
        }
    }
}

/// One limit's distance at a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// Value and limit.
    pub at: Violation,
    /// Distance to the limit as a share of what is allowed: 1 far away, 0 on the limit, negative beyond it.
    /// Of a length, the distance to the nearer end over half the stroke; of `cond(H)`, `1 − cond / limit`; of
    /// everything else `1 − |value| / limit`.
    pub relative: f64,
}

impl LimitMargins {
    /// Returns every limit's margin at every leg, or the plate's where nothing is known of legs.
    pub fn all(&self) -> impl Iterator<Item = Margin> + '_ {
        let of_legs = self.travel.is_none().then(|| self.of_legs());
        of_legs.into_iter().flatten().chain(self.travel.into_iter().flat_map(TravelMargins::all))
    }

    fn of_legs(&self) -> impl Iterator<Item = Margin> + '_ {
        let [lo, hi] = self.leg_length_limit_m;
        let lengths = self.leg_length_m.into_iter().enumerate().map(move |(i, l)| Margin {
            at: Violation {
                limit: Limit::LegLength,
                leg: Some(i + 1),
                between: None,
                value: l,
                allowed: [lo, hi],
            },
            relative: (l - lo).min(hi - l) / (0.5 * (hi - lo)),
        });
        let within = |limit, max: f64, values: Option<[f64; 6]>| {
            values.into_iter().flatten().enumerate().map(move |(i, value)| Margin {
                at: Violation { limit, leg: Some(i + 1), between: None, value, allowed: [-max, max] },
                relative: if max.is_infinite() { 1.0 } else { 1.0 - value.abs() / max },
            })
        };
        let larger = |[a, b]: [f64; 2]| if b.abs() >= a.abs() { b } else { a };
        let push = self.leg_force_n.map(|f| f.map(|[_, high]| high.max(0.0)));
        let buckling = push.map(|f| std::array::from_fn(|i| f[i] * self.leg_length_m[i].powi(2)));
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
            .chain(within(Limit::LegPush, self.leg_push_limit_n, push))
            .chain(within(
                Limit::LegPull,
                self.leg_pull_limit_n,
                self.leg_force_n.map(|f| f.map(|[low, _]| (-low).max(0.0))),
            ))
            .chain(within(Limit::LegBuckling, self.leg_buckling_limit_nm2, buckling))
            .chain(std::iter::once(Margin {
                at: Violation {
                    limit: Limit::Conditioning,
                    leg: None,
                    between: None,
                    value: self.condition_number,
                    allowed: [1.0, self.condition_limit],
                },
                relative: if self.condition_limit.is_infinite() {
                    1.0
                } else {
                    1.0 - self.condition_number / self.condition_limit
                },
            }))
            .chain(self.nearest.map(|nearest| Margin {
                at: too_near(nearest.distance_m, nearest.between, self.clearance_limit_m),
                relative: ((nearest.distance_m - self.clearance_limit_m) / self.clearance_range_m).min(1.0),
            }))
    }

    /// Returns the limit that is nearest, or furthest overstepped. A value that is not a number counts as
    /// overstepped.
    pub fn tightest(&self) -> Margin {
        let order = |m: &Margin| if m.relative.is_nan() { f64::NEG_INFINITY } else { m.relative };
        let mut all = self.all();
        let Some(mut tightest) = all.next() else {
            unreachable!("six lengths or the travel are always there")
        };
        for margin in all {
            if order(&margin) < order(&tightest) {
                tightest = margin;
            }
        }
        tightest
    }

    /// Returns the first limit that is violated, in the order of [`Limit`]'s cheap ones first.
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

/// Returns the violation of a distance, m, where `least` must be left.
pub(super) fn too_near(distance_m: f64, between: [Part; 2], least: f64) -> Violation {
    Violation {
        limit: Limit::Clearance,
        leg: None,
        between: Some(between),
        value: distance_m,
        allowed: [least, f64::INFINITY],
    }
}

impl Geometry {
    /// Returns which of legs, plate and base are nearest to each other; `None` where their thickness is not
    /// given.
    pub fn nearest(&self, legs: &Legs) -> Option<Nearest> {
        self.limits.bulk.as_ref().map(|bulk| bulk.nearest(self, legs))
    }

    /// Returns whether a pose is limited by nothing but lengths of legs and `cond(H)`.
    pub fn has_lengths_alone(&self) -> bool {
        let limits = &self.limits;
        limits.base_joints.is_none() && limits.plate_joints.is_none() && limits.bulk.is_none()
    }

    /// Cones of half-angle `half_angle_rad` about the legs' directions at [`Geometry::home`], for the base
    /// joints (axes in A) or, home being level, for the plate joints (axes in P).
    pub fn cones_about_home(&self, half_angle_rad: f64) -> JointCones {
        JointCones { axes: self.legs(&self.home()).directions.map(Into::into), half_angle_rad }
    }

    /// Returns every limited quantity at `state` beside its limit; with `load`, the forces of the legs too.
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
            leg_push_limit_n: most(limits.leg_push_n),
            leg_pull_limit_n: most(limits.leg_pull_n),
            leg_buckling_limit_nm2: most(limits.leg_buckling_nm2),
            base_joint_rad,
            base_joint_limit_rad: widest(&limits.base_joints),
            plate_joint_rad,
            plate_joint_limit_rad: widest(&limits.plate_joints),
            condition_number: self.guarded_condition(&legs),
            condition_limit: limits.cond_max,
            nearest: self.nearest(&legs),
            clearance_limit_m: limits.bulk.as_ref().map_or(0.0, |bulk| bulk.clearance_m),
            clearance_range_m: limits.bulk.as_ref().map_or(f64::INFINITY, Bulk::range_m),
            travel: self.travel.as_ref().map(|travel| travel.margins(state)),
        }
    }

    /// Returns `det H` at home. A pose at which it has the other sign lies beyond a singular one: whatever
    /// its own `cond(H)`, no path of finite `cond(H)` leads there from home.
    pub(super) fn home_determinant(&self) -> f64 {
        self.legs(&self.home()).force_transmission().determinant()
    }

    /// Returns `cond(H)`, or infinity where `det H` has not the sign that it has at home.
    pub fn guarded_condition(&self, legs: &Legs) -> f64 {
        let h = legs.force_transmission();
        if h.determinant() * self.home_determinant() > 0.0 {
            legs.condition_over(self.moment_length_m())
        } else {
            f64::INFINITY
        }
    }

    /// Returns whether `cond(H)` is within the guard, on home's side of every singular pose.
    pub fn is_guarded(&self, legs: &Legs) -> bool {
        legs.is_conditioned_within(self.limits.cond_max, self.moment_length_m())
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
