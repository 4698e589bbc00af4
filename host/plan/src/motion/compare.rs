//! The objectives side by side: what each motion is predicted to tell of the thesis' body in both mountings.

use std::sync::atomic::AtomicBool;

use hexapod::BodyParameters;

use super::coverage;
use super::plan::{MotionPlan, Objective, PlanError, Task, plan};

/// The objectives in the order of the table, with their names.
pub const OBJECTIVES: [(Objective, &str); 4] = [
    (Objective::RollPitchYaw, "rpy"),
    (Objective::Spheres, "spheres"),
    (Objective::Multisine, "multisine"),
    (Objective::DOptimal, "d-optimal"),
];

/// Returns the bodies, with their names.
pub fn bodies() -> [(BodyParameters, &'static str); 2] {
    [(BodyParameters::thesis_horizontal(), "horizontal"), (BodyParameters::thesis_vertical(), "vertical")]
}

/// One motion of one mounting.
#[derive(Clone, Debug)]
pub struct Row {
    /// Mounting.
    pub body: &'static str,
    /// Objective.
    pub objective: &'static str,
    /// The plan, static step included.
    pub plan: MotionPlan,
    /// Condition number, columns scaled, of the same motion without the static step.
    pub condition_alone: f64,
    /// Condition number, columns scaled and offsets eliminated, of the same motion without the static step.
    pub condition_alone_eliminated: f64,
    /// Share of directions that angular rate and acceleration visit.
    pub coverage: [f64; 2],
    /// Largest principal moment, kg m².
    pub largest_moment_kgm2: f64,
}

impl Row {
    /// Returns the largest predicted U95 of the tensor's elements, as a share of the largest principal
    /// moment.
    pub fn worst(&self) -> f64 {
        self.plan.prediction.inertia_com_kgm2.iter().fold(0.0_f64, |m, u| m.max(*u))
            / self.largest_moment_kgm2
    }
}

/// Compares every objective in both mountings; `task` gives the rest.
///
/// # Errors
/// See [`plan`].
pub fn compare(task: &Task, stop: &AtomicBool, mut note: impl FnMut(String)) -> Result<Vec<Row>, PlanError> {
    let mut rows = Vec::new();
    for (parameters, body) in bodies() {
        for (objective, name) in OBJECTIVES {
            let mut task = Task { objective, ..task.clone() };
            task.equipment.payload.body = parameters;
            let made = plan(&task, stop, |text| note(format!("{body}, {name}: {text}")))?;
            // The motion as it is, between two rests.
            let [from, _] = made.motion_s;
            let mut alone = made.program.clone();
            let mut begin = 0.0;
            alone.segments.retain(|s| {
                let keep = (begin - from).abs() < 1e-9;
                begin += s.duration_s();
                keep
            });
            let of_motion = super::predict::predict(&task.equipment, &alone, task.rate_hz)?;
            let trajectory = made.program.trajectory();
            let covered = trajectory.map(|t| coverage::of_motion(&t, made.motion_s[0], made.motion_s[1]));
            rows.push(Row {
                body,
                objective: name,
                plan: made,
                condition_alone: of_motion.condition_number,
                condition_alone_eliminated: of_motion.condition_eliminated,
                coverage: covered.unwrap_or_default(),
                largest_moment_kgm2: parameters.inertia_com().symmetric_eigenvalues().max(),
            });
        }
    }
    Ok(rows)
}

/// Returns the comparison in Markdown.
pub fn table(rows: &[Row]) -> String {
    let mut text = "| mounting | motion | condition, motion alone | offsets eliminated | and static step | \
                    offsets eliminated | directions of ω, ω̇ | CoM, mm | Ixx | Iyy | Izz | Iyz | Izx | Ixy, \
                    1e-3 kg m² | worst, % of the largest moment \
                    |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for row in rows {
        let p = &row.plan.prediction;
        let elements = p.inertia_com_kgm2.map(|u| format!("{:.2}", 1e3 * u)).join(" | ");
        let com = p.com_m.map(|u| format!("{:.3}", 1e3 * u)).join(" ");
        let [w, dw] = row.coverage.map(|c| 100.0 * c);
        text += &format!(
            "| {} | {} | {:.1} | {:.1} | {:.1} | {:.1} | {w:.0} %, {dw:.0} % | {com} | {elements} | {:.2} \
             |\n",
            row.body,
            row.objective,
            row.condition_alone,
            row.condition_alone_eliminated,
            p.condition_number,
            p.condition_eliminated,
            100.0 * row.worst()
        );
    }
    text
}
