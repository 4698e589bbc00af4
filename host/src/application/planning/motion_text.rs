//! A planned motion as text.

use hexapod::{Part, Peak};

use super::PlannedMotion;
use super::motion::key;

impl PlannedMotion {
    /// Returns the motion with its guarantees and predictions as text.
    pub fn text(&self) -> String {
        let (plan, task) = (&self.plan, &self.task);
        let ([from, to], [rate, acceleration]) = (plan.motion_s, self.coverage);
        let mut text = format!(
            "{}: {:.1} s, the motion from {from:.1} s to {to:.1} s; it turns into {:.0} % of all directions, \
             its angular acceleration points into {:.0} %.\n\n  guaranteed at every instant        seen       \
             below     allowed   margin",
            self.words(),
            plan.program.duration_s(),
            100.0 * rate,
            100.0 * acceleration
        );
        plan.guarantee.peaks.iter().for_each(|peak| text += &line(peak));
        if let Some(bulk) = &task.equipment.geometry.limits.bulk
            && let Some((peak, between)) = plan.guarantee.peaks.iter().find_map(|p| Some((p, p.between?)))
        {
            let distance_mm = 1e3 * (bulk.clearance_m + bulk.range_m() - peak.seen);
            let between = Part::both(between);
            text += &format!(
                "\n\nNearest to each other are {between} at t = {:.2} s, {distance_mm:.1} mm.",
                peak.time_s
            );
        }
        let p = &plan.prediction;
        let [x, y, z] = p.com_m.map(|v| 1e3 * v);
        text += &format!(
            "\n\nThe body: {}, {:.3} kg.\nPredicted U95 at {:.0} readings/s, offsets unknown: mass {:.4} kg; \
             centre of mass {x:.3}, {y:.3}, {z:.3} mm;\n\
             tensor about it (Ixx, Iyy, Izz, Iyz, Izx, Ixy) {}, 1e-3 kg m².\nCondition number of the columns, \
             scaled: {:.2}; with the offsets eliminated {:.2}.",
            self.body,
            task.equipment.payload.body.mass_kg,
            task.rate_hz,
            p.parameters[0],
            p.inertia_com_kgm2.map(|v| format!("{:.3}", 1e3 * v)).join(", "),
            p.condition_number,
            p.condition_eliminated
        );
        if !p.determined {
            text += "\nThis motion leaves a part of the body undetermined.";
        }
        text
    }
}

/// Returns the line of a guaranteed quantity.
fn line(peak: &Peak) -> String {
    let allowed = if peak.allowed.is_finite() {
        format!("{:>11.4} {:>6.1} %", peak.allowed, 100.0 * peak.margin())
    } else {
        format!("{:>11} {:>8}", "–", "–")
    };
    format!("\n  {:<30} {:>10.4}  {:>10.4} {allowed}", name(peak), peak.seen, peak.bound)
}

/// Returns what a guaranteed quantity is, with its unit.
fn name(peak: &Peak) -> &'static str {
    match key(peak) {
        "leg_length" => "leg length from the middle, m",
        "leg_rate" => "leg speed, m/s",
        "leg_acceleration" => "leg acceleration, m/s²",
        "leg_jerk" => "leg jerk, m/s³",
        "leg_force" => "leg force, N",
        "leg_push" => "leg force that pushes, N",
        "leg_pull" => "leg force that pulls, N",
        "leg_buckling" => "push times length squared, N m²",
        "base_joint_angle" => "base joint, rad",
        "plate_joint_angle" => "plate joint, rad",
        "conditioning" => "cond(H)",
        "travel" => "share of the travel",
        "plate_speed" => "speed of the plate, m/s",
        "plate_rate" => "turning of the plate, rad/s",
        "arm_reach" => "reach of the arm",
        "arm_position" => "joint from its middle, rad",
        "arm_rate" => "joint rate, rad/s",
        "arm_acceleration" => "joint acceleration, rad/s²",
        "arm_payload" => "mass at the flange, kg",
        "clearance" => "clearance short of ⌀ leg, m",
        _ => "angular rate, rad/s",
    }
}
