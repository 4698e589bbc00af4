//! Section 6.3, the thesis' estimator: uncertainty over the number of poses in both mountings.

use rigident::plan::poses::montecarlo::{Errors, Mounting, Row, Spread, reduction};

use super::still_poses::campaign;

/// Returns the row of an experiment.
pub fn find(n: usize, mounting: Mounting, errors: Errors) -> &'static Row {
    let found = campaign().iter().find(|r| r.n == n && r.mounting == mounting && r.errors == errors);
    found.expect("the campaign has every combination")
}

/// Returns the spread of the thesis' estimator.
pub fn thesis(n: usize, mounting: Mounting, errors: Errors) -> Spread {
    find(n, mounting, errors).spreads[0].expect("two poses determine the centre of mass")
}

/// Writes the 99.7 % spread of each axis, mm.
fn axes(spread: &Spread) -> String {
    spread.sd.iter().map(|sd| format!("{:.1}", 3e3 * sd)).collect::<Vec<_>>().join(" ")
}

/// Returns the table.
pub fn table() -> String {
    let mut text = "| n | standing, precision | bias | both | lying, precision | bias | both | reduction of \
                    the worst axis: precision | bias | both |\n|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for n in 2..=10 {
        text += &format!("| {n} |");
        for mounting in Mounting::ALL {
            for errors in Errors::ALL {
                text += &format!(" {} |", axes(&thesis(n, mounting, errors)));
            }
        }
        for errors in Errors::ALL {
            let [v, h] = Mounting::ALL.map(|mounting| thesis(n, mounting, errors));
            text += &format!(" {:.0} % |", 100.0 * reduction(&v, &h));
        }
        text += "\n";
    }
    text
}
