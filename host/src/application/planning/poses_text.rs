//! Planned poses as text.

use super::PlannedPoses;
use rigident_plan::poses::measure::least_condition_number_in_cone;

impl PlannedPoses {
    /// Returns the poses with their measures as text.
    pub fn text(&self) -> String {
        let plan = &self.plan;
        let (mut text, steepest) = self.table();
        text += &format!(
            "\n\nCondition number of the stacked [F] {:.3}, of the normal matrix {:.3}",
            plan.condition_number_normal.sqrt(),
            plan.condition_number_normal
        );
        if plan.relative_condition_number_normal.is_finite() {
            text += &format!("; relative to the level pose {:.3}", plan.relative_condition_number_normal);
        }
        let n = plan.poses.len();
        text += &format!(
            ". Determinant {:.4}.\n{n} poses that tilt by {steepest:.1}° at most have a normal matrix of \
             {:.3} at least.\n",
            plan.determinant,
            least_condition_number_in_cone(n, steepest.to_radians())
        );
        text += &match plan.predicted_u95 {
            Some([m, x, y, z]) => format!(
                "One reading a pose, offsets unknown, predicted U95: mass {m:.2} kg, first moment {x:.3}, \
                 {y:.3}, {z:.3} kg m."
            ),
            None => {
                "These poses alone leave a part of the first moment open if the offsets are unknown: add \
                     the level pose."
                    .to_owned()
            }
        };
        text
    }

    /// Returns the poses line by line, and the steepest tilt, degrees.
    fn table(&self) -> (String, f64) {
        let (least, largest) = self.region.tilt_range_rad();
        let [low, high] = self.reach.geometry().leg_length_m;
        let mut text = format!(
            "Legs from {low:.4} m to {high:.4} m tilt the plate by {:.1}° to {:.1}°, depending on the \
             direction.\n\n  pose     roll    pitch     tilt        x        y        z\n          °        \
             °        °        m        m        m",
            least.to_degrees(),
            largest.to_degrees()
        );
        let mut steepest: f64 = 0.0;
        let poses = self.plan.poses.iter().zip(self.plan.poses_deg()).zip(&self.held);
        for (k, ((pose, [roll, pitch]), held)) in poses.enumerate() {
            let tilt = (roll.to_radians().cos() * pitch.to_radians().cos()).acos().to_degrees();
            steepest = steepest.max(tilt);
            text += &format!("\n  {:>4} {roll:>8.2} {pitch:>8.2} {tilt:>8.2}", k + 1);
            let [x, y, z] = pose.position_m;
            text += &match held {
                true => format!(" {x:>8.4} {y:>8.4} {z:>8.4}"),
                false => "   the platform cannot hold it".to_owned(),
            };
        }
        (text, steepest)
    }
}
