//! Tables 8 and 9: the best condition numbers with the whole stroke.

use rigident::plan::poses::Objective;

use super::still_poses::{Platform, difference};

const TABLE_8: [f64; 5] = [2.00, 1.07, 1.20, 1.31, 1.24];
const TABLE_9: [f64; 5] = [2.0, 1.0, 1.0, 1.0, 1.0];

/// Returns the table.
pub fn table() -> String {
    let platform = Platform::with_stroke(None);
    let mut text =
        "| n | Table 9 | ours | difference | Table 8, sequence alone | ours |\n|---|---|---|---|---|---|\n"
            .to_owned();
    for ((n, printed), alone) in (2..).zip(TABLE_9).zip(TABLE_8) {
        let plan = platform.plan(n, Objective::Condition);
        let ours = plan.condition_number_normal;
        let difference = difference(ours, printed, 3);
        text += &format!(
            "| {n} | {printed} | {ours:.3} | {difference} | {alone:.2} | {:.2} |\n",
            plan.screened_cost
        );
    }
    text
}
