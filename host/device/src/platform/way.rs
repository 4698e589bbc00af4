//! The way from where the plate is to where a program begins: gently, as a program of its own, so that the
//! experiment's time is the program's.

use hexapod::{Geometry, Load, MotionError, MotionProgram, Pose, Segment};

use super::clock::Clock;
use super::{Motion, Platform, PlatformError, Stop, check};

/// Poses that are nearer than this are the same, m and rad: what a controller's answer leaves out is less.
pub(super) const SAME: f64 = 1e-5;
/// A plate that is nearer than this to where it should be is there, m and rad.
const NEAR: f64 = 2e-3;
/// The longest way, s.
const LONGEST_S: f64 = 120.0;
/// The plate is examined this often, s.
const LOOK_EVERY_S: f64 = 0.02;
/// The time that it may take to come to rest, s.
const REST_S: f64 = 4.0;

fn far(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).fold(0.0, |m: f64, (p, q)| m.max((p - q).abs()))
}

/// Returns whether two poses are the same.
pub(super) fn same(a: &Pose, b: &Pose) -> bool {
    far(a.position_m, b.position_m).max(far(a.rpy_rad, b.rpy_rad)) < SAME
}

/// Returns whether a plate is where it should, within 2 mm and 2 mrad, as encoders read it.
pub fn near(a: &Pose, b: &Pose) -> bool {
    far(a.position_m, b.position_m).max(far(a.rpy_rad, b.rpy_rad)) < NEAR
}

/// Returns how long the way takes at least: at most 0.1 m/s or 0.4 rad/s.
fn gentle_s(from: &Pose, to: &Pose) -> f64 {
    (1.875 * (far(from.position_m, to.position_m) / 0.1).max(far(from.rpy_rad, to.rpy_rad) / 0.4)).max(0.5)
}

/// Returns the way between two poses, as slow as the legs need it; without segments if they are the same.
///
/// # Errors
/// A straight way that the legs do not reach, or on which they would be loaded too much by what they carry.
pub(super) fn between(
    from: &Pose,
    to: &Pose,
    geometry: &Geometry,
    load: Option<&Load>,
) -> Result<MotionProgram, PlatformError> {
    if same(from, to) {
        return Ok(MotionProgram { start: *to, segments: Vec::new() });
    }
    if let Err(violation) = geometry.check_pose(from) {
        return Err(PlatformError::Refused(format!(
            "its plate is at {}, beyond the limits of the rig file: {violation}. Bring it home by its \
             own program first, or correct [platform]",
            check::words(from)
        )));
    }
    let mut duration_s = gentle_s(from, to);
    loop {
        let way = MotionProgram { start: *from, segments: vec![Segment::Move { to: *to, duration_s }] };
        match check::check(&way, geometry, load) {
            Ok(_) => return Ok(way),
            Err(PlatformError::Motion(MotionError::Limit { violation, .. }))
                if violation.limit.is_of_speed() && duration_s < LONGEST_S =>
            {
                duration_s *= 2.0;
            }
            Err(other) => return Err(other),
        }
    }
}

/// Drives a way to its end; what was measured on it is of no experiment.
///
/// # Errors
/// The platform's errors; [`PlatformError::Interrupted`] once it has come to rest after `go_on` has said no,
/// and [`PlatformError::Unseen`] where it did not.
pub(super) fn drive(
    platform: &mut dyn Platform,
    way: &MotionProgram,
    go_on: &dyn Fn() -> bool,
    clock: &Clock,
) -> Result<(), PlatformError> {
    if way.segments.is_empty() {
        return Ok(());
    }
    platform.load(way)?;
    platform.start()?;
    while platform.motion()? == Motion::Moving {
        if !go_on() {
            platform.stop(Stop::Alarm)?;
            let stopped_s = clock.now_s();
            while platform.motion()? == Motion::Moving {
                if clock.now_s() - stopped_s > REST_S {
                    return Err(PlatformError::Unseen(format!(
                        "it still moves {REST_S} s after the command to stop: use its own emergency stop"
                    )));
                }
                clock.wait_s(LOOK_EVERY_S);
            }
            return Err(PlatformError::Interrupted);
        }
        clock.wait_s(LOOK_EVERY_S);
    }
    platform.samples();
    Ok(())
}
