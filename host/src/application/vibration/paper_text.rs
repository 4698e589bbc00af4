//! The tables of the vibration paper's experiment.

use std::fmt;

use super::paper::PaperExperiment;
use rigident_fit::figures::{NOT_IDENTIFIED, with_u95};

impl fmt::Display for PaperExperiment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tables = [
            ("Table 3: determined by three locked postures", &self.table_3),
            ("Table 4: with the motion of link 1", &self.table_4),
        ];
        for (title, rows) in tables {
            writeln!(
                f,
                "{title}\n  {:<14} {:>10} {:>24} {:>10} {:>10} {:>10}",
                "", "truth", "ours ± U95", "error", "paper", "its error"
            )?;
            for row in rows {
                let cell =
                    row.measured.map_or_else(|| NOT_IDENTIFIED.to_owned(), |m| with_u95(m.value, m.u95, ""));
                let error = row.measured.map_or_else(String::new, |m| format!("{:.4}", m.value - row.truth));
                writeln!(
                    f,
                    "  {:<14} {:>10.4} {cell:>24} {error:>10} {:>10.4} {:>10.4}",
                    row.name,
                    row.truth,
                    row.paper,
                    row.paper - row.truth
                )?;
            }
            writeln!(f)?;
        }
        writeln!(
            f,
            "Table 5: largest errors\n                       E_MS / M_0 (mm)       paper     E_J / I_m \
             (%)       paper"
        )?;
        for row in &self.table_5 {
            writeln!(
                f,
                "  {:<14} {:>21.3} {:>11.1} {:>17.3} {:>11.3}",
                row.link,
                1e3 * row.first_moment_by_mass_m,
                1e3 * row.paper_first_moment_by_mass_m,
                100.0 * row.tensor_by_largest,
                100.0 * row.paper_tensor_by_largest
            )?;
        }
        let j = &self.jyy;
        write!(
            f,
            "\nJyy of the base, kg m²: {:.4} < {:.4} < {:.4} (Eq. 19)\n  bounded search, as the \
             paper  {:.4}\n  least squares                 {:.4}\n  \
             all rows merged               {:.4} ± {:.4}\n  truth {:.4}, paper {:.4}",
            j.least,
            j.truth,
            j.most,
            j.bounded_search,
            j.least_squares,
            j.merged,
            j.merged_u95,
            j.truth,
            j.paper
        )
    }
}
