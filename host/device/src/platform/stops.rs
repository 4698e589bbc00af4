//! The legs' forces while the plate is brought to rest on its path, from any instant of a program.

use hexapod::{Geometry, Limit, Load, MotionError, PlateState, Trajectory, Violation};

/// Instants that are examined, at most.
const INSTANTS: f64 = 2000.0;
/// The least time between instants that are examined, s.
const STEP_S: f64 = 0.02;
/// The points of a stop that are checked: shares of its duration, the program's speed there, and how fast
/// that falls, in durations. It falls as the quintic `1 − u³ (10 − 15 u + 6 u²)`.
const WITHIN: [[f64; 2]; 4] = [[0.9, 0.7], [0.75, 1.45], [0.5, 1.875], [0.25, 1.45]];

/// Returns the state of a plate whose program goes at a share `s` of its speed, which changes by `ds` 1/s:
/// `v s`, `a s² + v ds`.
fn slowed(state: &PlateState, s: f64, ds: f64) -> PlateState {
    PlateState {
        velocity: state.velocity * s,
        acceleration: state.acceleration * (s * s) + state.velocity * ds,
        angular_rate: state.angular_rate * s,
        angular_acceleration: state.angular_acceleration * (s * s) + state.angular_rate * ds,
        ..*state
    }
}

/// Returns the states of a plate that is brought to rest on its path in `stop_s`, with the times of the
/// program at which that begins, s. The way that it goes meanwhile is left out, which is less than half of
/// `stop_s` of it.
pub fn states(trajectory: &Trajectory, stop_s: f64) -> impl Iterator<Item = (f64, PlateState)> + '_ {
    let step_s = (trajectory.duration_s() / INSTANTS).max(STEP_S);
    (0..=(trajectory.duration_s() / step_s).ceil() as usize).flat_map(move |k| {
        let time_s = (k as f64 * step_s).min(trajectory.duration_s());
        let state = trajectory.state(time_s);
        WITHIN.map(|[s, fall]| (time_s, slowed(&state, s, -fall / stop_s)))
    })
}

/// The forces and accelerations of the legs in a stop from whatever instant is worst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stopped {
    /// The time that the stop takes, s.
    pub stop_s: f64,
    /// Greatest force of a leg, N.
    pub leg_force_n: f64,
    /// Greatest acceleration of a leg, m/s².
    pub leg_acceleration_mps2: f64,
    /// The first limit of a force that is exceeded, and the time of the program, s.
    pub overloads: Option<(Violation, f64)>,
    /// The first limit of an acceleration that is exceeded, and the time of the program, s.
    pub too_quick: Option<(Violation, f64)>,
}

/// Returns the forces and accelerations of the legs if the plate is brought to rest on its path in `stop_s`.
///
/// # Errors
/// A singular pose.
pub fn stopped(
    trajectory: &Trajectory,
    geometry: &Geometry,
    load: &Load,
    stop_s: f64,
) -> Result<Stopped, MotionError> {
    let mut found =
        Stopped { stop_s, leg_force_n: 0.0, leg_acceleration_mps2: 0.0, overloads: None, too_quick: None };
    let limits = &geometry.limits;
    for (time_s, state) in states(trajectory, stop_s) {
        let ranges = geometry.leg_force_ranges(&state, time_s, load)?;
        let lengths = limits.leg_buckling_nm2.map_or([0.0; 6], |_| geometry.leg_lengths(&state.pose()));
        for (leg, range) in ranges.into_iter().enumerate() {
            found.leg_force_n = found.leg_force_n.max(range[1]).max(-range[0]);
            if let Some((limit, [value, most])) = limits.overloaded(range, lengths[leg]) {
                found.overloads.get_or_insert((violation(limit, leg, value, most), time_s));
            }
        }
        for (leg, value) in geometry.leg_accelerations(&state).into_iter().enumerate() {
            found.leg_acceleration_mps2 = found.leg_acceleration_mps2.max(value.abs());
            if let Some(most) = limits.leg_acceleration_mps2.filter(|most| value.abs() > *most) {
                found.too_quick.get_or_insert((violation(Limit::LegAcceleration, leg, value, most), time_s));
            }
        }
    }
    Ok(found)
}

fn violation(limit: Limit, leg: usize, value: f64, most: f64) -> Violation {
    Violation { limit, leg: Some(leg + 1), between: None, value, allowed: [-most, most] }
}

#[cfg(test)]
mod tests {
    use hexapod::{BodyParameters, MotionProgram, Segment};

    use super::*;

    /// Straight down with 20 kg above the joints: each leg carries a sixth of m (g + z''), over the cosine of
    /// its slope. The stop is gone through in time steps, and z'' is taken from second differences.
    #[test]
    fn a_stop_on_the_way_down_loads_the_legs_as_its_deceleration_does() {
        let geometry = Geometry::thesis();
        let mut to = geometry.home();
        to.position_m[2] -= 0.08;
        let segments = vec![Segment::Move { to, duration_s: 1.0 }];
        let program = MotionProgram { start: geometry.home(), segments };
        let trajectory = program.trajectory().unwrap();
        let body = BodyParameters { mass_kg: 20.0, com_m: [0.0; 3], inertia_com_kgm2: [0.1; 6] };
        let load = Load::body(BodyParameters { inertia_com_kgm2: [0.1, 0.1, 0.1, 0.0, 0.0, 0.0], ..body });
        for stop_s in [0.1, 0.35] {
            let z = |time_s: f64| trajectory.state(time_s).position.z;
            let mut expected = 0.0_f64;
            for begin in 1..50 {
                let (h, mut at) = (1e-4, 0.02 * f64::from(begin));
                let mut heights = Vec::new();
                for n in 0..(stop_s / h) as usize {
                    heights.push(z(at));
                    let u = (n as f64 + 0.5) * h / stop_s;
                    at += h * (1.0 - u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u));
                }
                for three in heights.windows(3) {
                    let bend = (three[2] - 2.0 * three[1] + three[0]) / (h * h);
                    let mut pose = geometry.home();
                    pose.position_m[2] = three[1];
                    let length = geometry.leg_lengths(&pose)[0];
                    // The plate's joints lie 0.123 m below its origin, and the base's in the plane z = 0.
                    let slope = (three[1] - 0.123) / length;
                    expected = expected.max(20.0 * (9.80665 + bend) / (6.0 * slope));
                }
            }
            let found = stopped(&trajectory, &geometry, &load, stop_s).unwrap().leg_force_n;
            assert!((found / expected - 1.0).abs() < 0.04, "{stop_s} s: {found} N, {expected} N");
        }
    }
    #[test]
    fn a_stop_that_overloads_a_leg_is_named_with_leg_and_time_though_the_program_does_not() {
        let mut geometry = Geometry::thesis();
        let mut to = geometry.home();
        to.position_m[2] -= 0.08;
        let segments = vec![Segment::Move { to, duration_s: 1.0 }];
        let trajectory = MotionProgram { start: geometry.home(), segments }.trajectory().unwrap();
        let inertia = [0.1, 0.1, 0.1, 0.0, 0.0, 0.0];
        let load = Load::body(BodyParameters { mass_kg: 20.0, com_m: [0.0; 3], inertia_com_kgm2: inertia });
        let peak =
            geometry.peak_leg_forces(&trajectory, 1e-3, &load).unwrap().into_iter().fold(0.0, f64::max);
        geometry.limits.leg_push_n = Some(1.01 * peak);
        geometry.check_loaded(&trajectory, &load).unwrap();
        let (violation, time_s) = stopped(&trajectory, &geometry, &load, 0.1).unwrap().overloads.unwrap();
        assert_eq!(violation.limit, Limit::LegPush);
        assert!(violation.leg.is_some() && (0.1..0.9).contains(&time_s), "{violation} at {time_s}");
        geometry.limits.leg_push_n = Some(1e4);
        assert_eq!(stopped(&trajectory, &geometry, &load, 0.1).unwrap().overloads, None);
    }
}
