//! The three estimators side by side, bias and precision errors acting together.

use rigident::plan::poses::montecarlo::{Errors, Mounting};

use super::poses_montecarlo::find;

/// Returns the table.
pub fn table() -> String {
    let mut text =
        "| n | standing: measured forces (thesis) | relative (thesis) | modelled, offsets unknown \
                    | and mass weighed | lying: measured forces | relative | modelled | and mass weighed | \
                    found / predicted, all axes |\n\
                    |---|---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    for n in 2..=10 {
        text += &format!("| {n} |");
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        for mounting in Mounting::ALL {
            for spread in find(n, mounting, Errors::Both).spreads.iter().flatten() {
                text += &format!(" {:.1} |", 3e3 * spread.sd.max());
                for ratio in spread.sd.component_div(&spread.predicted_sd).iter() {
                    (least, most) = (least.min(*ratio), most.max(*ratio));
                }
            }
        }
        text += &format!(" {least:.2}–{most:.2} |\n");
    }
    text
}
