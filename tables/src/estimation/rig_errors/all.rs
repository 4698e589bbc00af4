//! All errors at once, rigs drawn at random from what is known of them; U95 are medians, of the moments
//! relative to each.

use super::super::problem::Normal;
use super::errors::Errors;
use super::mechanics::Motion;
use super::recording::{Disturbance, Rig, rig_file};
use super::study::{CENTRE, MASS, MOMENT, Runs, TENSOR, run, runs};
use rigident::answer::Status;

const RIGS: u64 = 500;

/// Rigs whose errors are `wide` times as large as stated.
fn drawn(name: &str, count: u64, wide: f64, disturbance: Disturbance) -> Runs {
    let known = Errors::data_sheet();
    let nominal = Rig { disturbance, ..Rig::lab() };
    let file = rig_file(&known, &nominal.noise);
    let motion = Motion::lab();
    runs(name, count, |seed| {
        let errors = known.draw(wide, &mut Normal::new(1_000_000 + seed));
        run(&Rig { errors, ..nominal }, &motion, &file, seed)
    })
}

/// Returns the table.
pub fn table() -> String {
    let flicker = Disturbance { flicker_hz: 1.0, ..Disturbance::default() };
    let cases = [
        ("as stated", 1.0, Disturbance::default()),
        ("as stated, flicker noise of the load cell below 1 Hz", 1.0, flicker),
        ("twice as large as stated", 2.0, Disturbance::default()),
    ];
    let mut text = "| errors | coverage of m | of mc, least–largest | of c | of I_c | U95 of m | of c | of \
                    I_c | residuals | implausible | silent |\n\
                    |---|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    let body = Rig::lab().body;
    for (name, wide, disturbance) in cases {
        let all = drawn(name, RIGS, wide, disturbance);
        let range = |group| format!("{:.1}–{:.1} %", all.worst(group), all.best(group));
        let typical = |k: usize| all.median(|run| run.u95[k]);
        let mean =
            |group: std::ops::Range<usize>| group.clone().map(typical).sum::<f64>() / group.len() as f64;
        let moment = |k: usize| typical(TENSOR.start + k) / body.inertia[(k, k)];
        text += &format!(
            "| {name} | {} | {} | {} | {} | {:.2} % | {:.2} mm | {:.2} % | {:.2} | {:.0} % | {:.0} % |\n",
            range(&MASS),
            range(&MOMENT),
            range(&CENTRE),
            range(&TENSOR),
            100.0 * mean(MASS) / body.mass,
            1e3 * mean(CENTRE),
            100.0 * (0..3).map(moment).sum::<f64>() / 3.0,
            all.median(|run| run.residual),
            all.share(|run| run.status == Status::Implausible),
            all.share(|run| run.status == Status::Identified && run.warnings.is_empty()),
        );
    }
    text
}
