//! The table of quantities against a reference body.

use rigident_fit::figures::{NOT_IDENTIFIED, fixed, with_u95};
use rigident_identify::reference::Quantity;

/// Returns the table of E_n numbers with the bound on the largest.
pub fn table(quantities: &[Quantity], limit: f64) -> String {
    let row = |q: &Quantity| {
        let measured = q.value.zip(q.u95).map(|(value, u95)| with_u95(value, u95, &q.unit));
        [
            q.name.clone(),
            measured.unwrap_or_else(|| NOT_IDENTIFIED.to_owned()),
            with_u95(q.reference, q.reference_u95, &q.unit),
            q.e_n.map_or_else(String::new, |e_n| fixed(e_n, 2)),
            match (q.passed, q.is_beyond(limit)) {
                (true, _) => "pass",
                (false, false) => "above 1",
                (false, true) => "fail",
            }
            .to_owned(),
        ]
    };
    let head = ["", "measured, ± U95", "reference, ± U95", "E_n", ""].map(str::to_owned);
    let rows: Vec<[String; 5]> = std::iter::once(head).chain(quantities.iter().map(row)).collect();
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let [a, b, c, d] = [0, 1, 2, 3].map(width);
    let line = |[name, measured, reference, e_n, verdict]: &[String; 5]| {
        format!(" {name:<a$}  {measured:<b$}  {reference:<c$}  {e_n:>d$}  {verdict}").trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}
