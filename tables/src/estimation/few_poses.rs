//! Few still poses whose noise comes from their residuals: the share of truths in the intervals.

use super::report::{Job, in_parallel};

#[path = "../../../host/cli/tests/integration/few_poses/poses.rs"]
mod poses;

use poses::{QUANTITIES, off};

/// Sets of poses a row.
const SETS: usize = 1500;

/// Returns the table.
pub fn table() -> String {
    let mut text = String::from(
        "| error of the gains, 1 σ | poses | sets | inside U95, % | least–largest of nine quantities |\n\
         |---|--:|--:|--:|--:|\n",
    );
    let sets = super::merging::most_rigs().min(SETS);
    for gain in [0.0, 5e-4, 5e-3] {
        for poses in [6, 8, 12, 24] {
            let job = |seed| Box::new(move || off(seed as u64, poses, gain)) as Job<'_, _>;
            let all: Vec<[(f64, f64); QUANTITIES]> = in_parallel((0..sets).map(job).collect());
            let inside = |k: usize| {
                let held = all.iter().filter(|own| own[k].0.abs() <= 1.0).count();
                100.0 * held as f64 / sets as f64
            };
            let shares: [f64; QUANTITIES] = std::array::from_fn(inside);
            let mean = shares.iter().sum::<f64>() / QUANTITIES as f64;
            let [least, most] = [f64::min, f64::max].map(|of| shares.into_iter().fold(mean, of));
            text.push_str(&format!(
                "| {} % | {poses} | {sets} | {mean:.1} | {least:.1}–{most:.1} |\n",
                100.0 * gain
            ));
        }
    }
    text
}
