//! The legs' forces while the plate is brought to rest on its path, from any instant of a program.

use hexapod::{Geometry, Load, MotionError, PlateState, Trajectory};

/// Instants that are examined, at most.
const INSTANTS: f64 = 2000.0;
/// They are no closer than this, s.
const STEP_S: f64 = 0.02;
/// The points of a stop that are checked: shares of its duration, the program's speed there, and how fast
/// that falls, in durations. It falls as the quintic `1 − u³ (10 − 15 u + 6 u²)`.
const WITHIN: [[f64; 2]; 4] = [[0.9, 0.7], [0.75, 1.45], [0.5, 1.875], [0.25, 1.45]];

/// The state of a plate whose program goes at a share `s` of its speed, which changes by `ds` 1/s:
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

/// Returns the greatest force of a leg, N, if the plate is brought to rest on its path in `stop_s` from whatever
/// instant is worst. The way that it goes meanwhile is left out, which is less than half of `stop_s` of it.
///
/// # Errors
/// A singular pose.
pub(super) fn stop_force_n(
    trajectory: &Trajectory,
    geometry: &Geometry,
    load: &Load,
    stop_s: f64,
) -> Result<f64, MotionError> {
    let step_s = (trajectory.duration_s() / INSTANTS).max(STEP_S);
    let mut most = 0.0_f64;
    for k in 0..=(trajectory.duration_s() / step_s).ceil() as usize {
        let time_s = (k as f64 * step_s).min(trajectory.duration_s());
        let state = trajectory.state(time_s);
        for [s, fall] in WITHIN {
            let ranges = geometry.leg_force_ranges(&slowed(&state, s, -fall / stop_s), time_s, load)?;
            most = ranges.iter().flatten().fold(most, |most, force| most.max(force.abs()));
        }
    }
    Ok(most)
}

#[cfg(test)]
mod tests {
    use hexapod::{BodyParameters, MotionProgram, Segment};

    use super::*;

    /// Straight down with 20 kg above the joints: each leg carries a sixth of m (g + z''), over the cosine of its slope. The stop is
    /// gone through in time steps, and z'' is taken from second differences.
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
            let found = stop_force_n(&trajectory, &geometry, &load, stop_s).unwrap();
            assert!((found / expected - 1.0).abs() < 0.04, "{stop_s} s: {found} N, {expected} N");
        }
    }
}
