//! The best condition numbers with 20 cm of stroke: printed, of a cone, and of the built-in geometry.

use std::sync::atomic::AtomicBool;

use rigident::plan::poses::measure::least_condition_number_in_cone;
use rigident::plan::poses::{Objective, Region, Search};

use super::still_poses::Platform;

const CNT: [f64; 4] = [3.52, 2.99, 3.27, 3.25];
const TILT_DEG: f64 = 32.5;

/// Returns the table.
pub fn table() -> String {
    let platform = Platform::with_stroke(Some(0.20));
    let cone = Region::cone(TILT_DEG.to_radians());
    let (least, largest) = platform.region.tilt_range_rad();
    let mut text = format!(
        "| n | CNT printed | closed form, cone of {TILT_DEG}° | search, same cone | search, our geometry \
         ({:.1}–{:.1}°) |\n\
         |---|---|---|---|---|\n",
        least.to_degrees(),
        largest.to_degrees()
    );
    for (n, printed) in (2..).zip(CNT) {
        let search = Search { region: &cone, n, objective: Objective::Condition };
        let found = search.run(&AtomicBool::new(false), |_| ()).expect("a cone has combinations");
        text += &format!(
            "| {n} | {printed} | {:.3} | {:.3} | {:.3} |\n",
            least_condition_number_in_cone(n, TILT_DEG.to_radians()),
            found.cost,
            platform.plan(n, Objective::Condition).condition_number_normal
        );
    }
    text
}
