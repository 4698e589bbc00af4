//! The cost of each objective in the others: five poses with 20 cm of stroke.

use rigident::plan::poses::Objective;
use rigident::plan::poses::plan::Task;

use super::still_poses::Platform;

/// Returns the table.
pub fn table() -> String {
    let platform = Platform::with_stroke(Some(0.20));
    let task = Task::thesis(5);
    let [_, _, _, mx, my, mz] = task.noise_n_nm;
    let worst =
        Objective::WorstUncertainty { moment_sigma_nm: [mx, my, mz], plate_to_cell: task.plate_to_cell };
    let mut text =
        "| objective | condition number, normal | determinant | worst U95 of the first moment, kg \
                    m | U95 of the mass, kg |\n\
                    |---|---|---|---|---|\n"
            .to_owned();
    for (name, objective) in [
        ("condition", Objective::Condition),
        ("determinant", Objective::Determinant),
        ("worst-uncertainty", worst),
    ] {
        let plan = platform.plan(5, objective);
        let [m, x, y, z] = plan.predicted_u95.expect("five poses determine the first moment");
        text += &format!(
            "| `{name}` | {:.3} | {:.2} | {:.4} | {m:.3} |\n",
            plan.condition_number_normal,
            plan.determinant,
            x.max(y).max(z)
        );
    }
    text
}
