//! The summary of several runs of one body as text.

use std::fmt::Write as _;

use rigident_identify::answer::repeated::Summary;

/// Returns the summary as a table.
pub fn text(summed: &Summary) -> String {
    let with_truth = summed.quantities.iter().any(|q| q.truth.is_some());
    let mut text = format!(
        "{} runs\n\n  {:<14} {:<6} {:>4} {:>13} {:>10} {:>10} {:>10} {:>6} {:>11}{}",
        summed.runs,
        "",
        "",
        "runs",
        "mean",
        "± U95",
        "std",
        "stated",
        "ratio",
        "probability",
        if with_truth { "        truth" } else { "" }
    );
    for q in &summed.quantities {
        let _ = write!(
            text,
            "\n  {:<14} {:<6} {:>4} {:>13.6} {:>10.2e} {:>10.2e} {:>10.2e} {:>6.2} {:>11}{}",
            q.name,
            q.unit,
            q.runs,
            q.mean,
            q.mean_u95,
            q.std,
            q.stated_std,
            q.std / q.stated_std,
            if q.probability < 1e-4 { "< 0.0001".to_owned() } else { format!("{:.4}", q.probability) },
            q.truth.map_or_else(String::new, |truth| format!(" {truth:>12.6}"))
        );
    }
    text += "\n\nThe uncertainty of the mean is by the scatter alone; what all runs have in common does not \
         scatter.";
    if !summed.left_out.is_empty() {
        let _ = write!(text, "\nIdentified in fewer than two runs: {}.", summed.left_out.join(", "));
    }
    if summed.quantities.is_empty() {
        text += "\nThere is nothing that two runs identify.";
    }
    if !summed.surprising.is_empty() {
        let _ = write!(
            text,
            "\nThe runs scatter more than their uncertainties explain: {}. Something changed between them \
             that none of them shows: \
             the mounting, the body, the offset, the temperature. Take the scatter for the uncertainty.",
            summed.surprising.join(", ")
        );
    }
    text
}
