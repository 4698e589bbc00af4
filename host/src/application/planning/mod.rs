//! Plans of poses and motions for a platform.

mod motion;
mod motion_text;
mod poses;
mod poses_text;

use hexapod::Geometry;

pub use motion::{ComparedMotions, MotionOptions, PlannedMotion, compare_motions, plan_motion};
pub use poses::{PlannedPoses, PoseObjective, PoseOptions, plan_poses};
use rigident_device::platform::check::{OF_ARMS, WITHOUT_JOINTS};

/// Says which collisions are not checked, where a rig file does not say how thick things are; what else is
/// not where it gives no joints.
pub fn unchecked(geometry: &Geometry) -> Option<&'static str> {
    if geometry.arm.is_some() {
        Some(OF_ARMS)
    } else if !geometry.has_joints() {
        Some(WITHOUT_JOINTS)
    } else if geometry.limits.bulk.is_none() {
        Some(
            "collisions of legs, plate and base are not looked at: [platform] has no leg_radius_m that says \
             how thick a leg is",
        )
    } else {
        None
    }
}
