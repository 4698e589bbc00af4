//! Finds where the free decay of a recording begins: after its release, and where its amplitude is small
//! enough.

use nalgebra::DMatrix;

use crate::modal_analysis::{Finding, ModalError, Modes, Severity};

/// Length of a block of samples, s.
const BLOCK_S: f64 = 0.25;
/// Energy of a block by the largest one, below which nothing moves yet, and from which on it swings.
const QUIET: f64 = 0.01;
const SWINGS: f64 = 0.5;
/// Parts of a recording that are left out at its beginning where its amplitude is too large.
const CUTS: [f64; 2] = [0.25, 0.5];

/// Returns the number of samples before the release: those of a quiet beginning, until it swings; none if the
/// recording begins with its decay.
pub(super) fn quiet_beginning(values: &DMatrix<f64>, rate_hz: f64) -> usize {
    let block = ((BLOCK_S * rate_hz) as usize).max(1);
    let sizes: Vec<f64> =
        values.column_iter().map(|column| column.variance().max(f64::MIN_POSITIVE)).collect();
    let means: Vec<f64> = values.column_iter().map(|column| column.mean()).collect();
    let energy = |row: usize| -> f64 {
        let of = |c: usize| (values[(row, c)] - means[c]).powi(2) / sizes[c];
        (0..values.ncols()).map(of).sum()
    };
    let blocks: Vec<f64> =
        (0..values.nrows() / block).map(|k| (k * block..(k + 1) * block).map(energy).sum()).collect();
    let largest = blocks.iter().copied().fold(0.0, f64::max);
    match blocks.first() {
        Some(first) if *first < QUIET * largest => {
            blocks.iter().position(|own| *own > SWINGS * largest).map_or(0, |k| (k + 1) * block)
        }
        _ => 0,
    }
}

/// Returns how many samples are left out at the beginning, and the modes of the others, where those of all
/// are not those of a linear system and those of a later part are; `None` otherwise.
pub(super) fn later(
    values: &DMatrix<f64>,
    modes: &Modes,
    identify: impl Fn(&DMatrix<f64>) -> Result<Modes, ModalError>,
) -> Option<(usize, Modes)> {
    let is_nonlinear = |finding: &Finding| {
        let may_be = finding.is_change() || matches!(finding, Finding::TooClose { .. });
        may_be && finding.severity() == Severity::Error
    };
    if !modes.findings.iter().any(is_nonlinear) {
        return None;
    }
    CUTS.into_iter().find_map(|part| {
        let first = (part * values.nrows() as f64) as usize;
        let found = identify(&values.rows(first, values.nrows() - first).into_owned()).ok()?;
        found.is_sound().then_some((first, found))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rest_before_the_release_is_no_part_of_the_decay() {
        let decay = |t: f64| if t < 2.0 { 0.0 } else { (-0.1 * (t - 2.0)).exp() * (12.0 * t).cos() };
        let noise = |row: usize| 1e-3 * ((row * 7919 % 101) as f64 / 50.0 - 1.0);
        let held =
            DMatrix::from_fn(2400, 2, |row, c| decay(row as f64 / 100.0) * (1.0 + c as f64) + noise(row));
        let first = quiet_beginning(&held, 100.0);
        assert!((200..=250).contains(&first), "{first}");
        assert_eq!(quiet_beginning(&held.rows(300, 2000).into_owned(), 100.0), 0);
    }

    #[test]
    fn beats_are_no_release() {
        let beats = |t: f64| (-0.05 * t).exp() * ((12.0 * t).sin() - (12.6 * t).sin());
        let values = DMatrix::from_fn(3000, 1, |row, _| beats(row as f64 / 100.0));
        let other = DMatrix::from_fn(3000, 2, |row, c| match c {
            0 => values[(row, 0)],
            _ => (-0.05 * row as f64 / 100.0).exp() * (9.0 * row as f64 / 100.0).cos(),
        });
        assert_eq!(quiet_beginning(&other, 100.0), 0);
    }
}
