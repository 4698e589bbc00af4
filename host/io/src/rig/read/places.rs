//! The customer's frame, the platform and the true body.

use std::f64::consts::FRAC_PI_2;

use hexapod::BodyParameters;

use super::{Check, RigFileError};
use crate::rig::{OfJoints, PlatformTable};

impl Check<'_> {
    pub(super) fn body_frame(&self) -> Result<(), RigFileError> {
        let Some(body) = &self.rig.body else { return Ok(()) };
        self.finite("body.position_m", &body.position_m)?;
        self.rotation("body.rotation_wxyz", &body.rotation_wxyz)?;
        Ok(())
    }

    pub(super) fn platform(&self) -> Result<(), RigFileError> {
        let Some(platform) = &self.rig.platform else { return Ok(()) };
        for (name, joints) in [
            ("base_joints_m", platform.base_joints_m),
            ("plate_joints_m", platform.plate_joints_m),
            ("base_joint_axes", platform.base_joint_axes),
            ("plate_joint_axes", platform.plate_joint_axes),
        ] {
            for joint in joints.iter().flatten() {
                self.finite(&format!("platform.{name}"), joint)?;
            }
        }
        self.leg_length(platform)?;
        self.platform_numbers(platform)?;
        self.travel(platform)?;
        self.arm(platform)?;
        for (n, part) in platform.part.iter().enumerate() {
            self.body(&format!("platform.part[{n}]"), part.mass_kg, part.com_m, part.inertia_com_kgm2)?;
        }
        if let Some(place) = &platform.load_cell {
            self.finite("platform.load_cell.position_m", &place.position_m)?;
            self.rotation("platform.load_cell.rotation_wxyz", &place.rotation_wxyz)?;
        }
        Ok(())
    }

    fn leg_length(&self, platform: &PlatformTable) -> Result<(), RigFileError> {
        if let Some([least, most]) = platform.leg_length_m
            && !(least > 0.0 && most > least && most.is_finite())
        {
            let advice = if !(least.is_finite() && most.is_finite()) {
                "must be two finite numbers, the least and the greatest length"
            } else if least <= 0.0 || most <= 0.0 {
                "must be the least and the greatest length, both greater than zero"
            } else if least == most {
                "leaves the legs no stroke: the greatest length must be more than the least"
            } else {
                "is the wrong way round: the least length comes first, then the greatest"
            };
            return Err(self.refuse("platform.leg_length_m", [least, most], advice));
        }
        Ok(())
    }

    /// Checks the numbers that are positive.
    fn platform_numbers(&self, platform: &PlatformTable) -> Result<(), RigFileError> {
        for (name, value) in [
            ("leg_rate_mps", platform.leg_rate_mps),
            ("leg_acceleration_mps2", platform.leg_acceleration_mps2),
            ("leg_jerk_mps3", platform.leg_jerk_mps3),
            ("leg_force_n", platform.leg_force_n),
            ("leg_push_n", platform.leg_push_n),
            ("leg_pull_n", platform.leg_pull_n),
            ("leg_buckling_nm2", platform.leg_buckling_nm2),
            ("base_joint_angle_rad", platform.base_joint_angle_rad),
            ("plate_joint_angle_rad", platform.plate_joint_angle_rad),
            ("leg_radius_m", platform.leg_radius_m),
            ("joint_length_m", platform.joint_length_m),
            ("plate_radius_m", platform.plate_radius_m),
            ("base_radius_m", platform.base_radius_m),
            ("clearance_m", platform.clearance_m),
            ("cond_max", platform.cond_max),
            ("plate_speed_mps", platform.plate_speed_mps),
            ("plate_rate_radps", platform.plate_rate_radps),
            ("load_max_kg", platform.load_max_kg),
            ("load_within_m", platform.load_within_m),
        ] {
            self.positive(&format!("platform.{name}"), value.as_slice())?;
        }
        Ok(())
    }

    fn travel(&self, platform: &PlatformTable) -> Result<(), RigFileError> {
        for (name, travel) in [("travel_m", platform.travel_m), ("travel_rad", platform.travel_rad)] {
            self.positive(&format!("platform.{name}"), travel.as_ref().map_or(&[][..], |all| &all[..]))?;
        }
        if let Some(turns) = platform.travel_rad.filter(|turns| turns.iter().any(|v| *v >= FRAC_PI_2)) {
            let advice = "is how far the plate turns to either side, in rad: each less than a right angle";
            return Err(self.refuse("platform.travel_rad", turns, advice));
        }
        Ok(())
    }

    fn arm(&self, platform: &PlatformTable) -> Result<(), RigFileError> {
        let Some(arm) = &platform.arm else { return Ok(()) };
        self.finite("platform.arm.home_rad", &arm.home_rad)?;
        self.positive("platform.arm.acceleration_radps2", &arm.acceleration_radps2.each())?;
        let rates = arm.rate_radps.as_ref().map(OfJoints::each);
        self.positive("platform.arm.rate_radps", rates.as_ref().map_or(&[][..], |all| &all[..]))?;
        self.positive("platform.arm.payload_kg", arm.payload_kg.as_slice())
    }

    pub(super) fn truth(&self) -> Result<(), RigFileError> {
        let Some(truth) = &self.rig.truth else { return Ok(()) };
        self.body("truth", truth.mass_kg, truth.com_m, truth.inertia_com_kgm2)?;
        let platform = self.rig.platform.as_ref();
        let away = truth.com_m.iter().map(|v| v * v).sum::<f64>().sqrt();
        if platform.and_then(|p| p.load_max_kg).is_some_and(|most| truth.mass_kg > most) {
            let advice =
                "is more than platform.load_max_kg, the heaviest body that is ever put on the load cell";
            return Err(self.refuse("truth.mass_kg", truth.mass_kg, advice));
        }
        if platform.and_then(|p| p.load_within_m).is_some_and(|most| away > most) {
            let advice = "is farther from the load cell's origin than platform.load_within_m, which no \
                          part of the body is";
            return Err(self.refuse("truth.com_m", truth.com_m, advice));
        }
        Ok(())
    }

    /// Checks a rigid body: its mass is positive, and some body has its tensor.
    fn body(&self, key: &str, mass_kg: f64, com_m: [f64; 3], inertia: [f64; 6]) -> Result<(), RigFileError> {
        self.positive(&format!("{key}.mass_kg"), &[mass_kg])?;
        self.finite(&format!("{key}.com_m"), &com_m)?;
        self.finite(&format!("{key}.inertia_com_kgm2"), &inertia)?;
        let body = BodyParameters { mass_kg, com_m, inertia_com_kgm2: inertia };
        if !body.is_possible() {
            return Err(self.refuse(
                &format!("{key}.inertia_com_kgm2"),
                inertia,
                "is the tensor of no body: about any axis the moment is positive and at most the sum of the \
                 other two; the order is Ixx, Iyy, Izz, Iyz, Izx, Ixy",
            ));
        }
        Ok(())
    }
}
