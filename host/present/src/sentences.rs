//! Sentences about parts of an answer that text and page share.

use rigident_fit::figures::{significant, with_u95};
use rigident_identify::answer::result::{NearestBody, TimeBase};

/// Returns the nearest body and its distance, standard deviations, in one line.
pub fn nearest_words(nearest: &NearestBody, distance_sd: f64) -> String {
    let list = |values: &[f64]| values.iter().map(|v| significant(*v, 4)).collect::<Vec<_>>().join(", ");
    format!(
        "{} standard deviations away: m {} kg; centre of mass {} m; Ixx, Iyy, Izz, Iyz, Izx, Ixy about it {} \
         kg m²",
        significant(distance_sd, 2),
        significant(nearest.mass_kg, 6),
        list(&nearest.com_m),
        list(&nearest.inertia_com_kgm2)
    )
}

/// Returns how several files became one recording, line by line.
pub fn time_base_words(base: &TimeBase) -> Vec<String> {
    let mut lines = vec![format!(
        "{} rows per second, every stream through a local cubic {} ms wide",
        significant(base.rate_hz, 6),
        significant(1e3 * base.kernel_width_s, 3)
    )];
    lines.extend(base.streams.iter().map(|stream| {
        let clock = match stream.skew_s.map(|skew| skew.measured()) {
            None => "the clock of all".to_owned(),
            Some(None) => "skew not identified, taken as zero".to_owned(),
            Some(Some(skew)) => skew_words(skew.value, skew.u95),
        };
        format!(
            "{} ({}): {} rows at {} Hz, {clock}",
            stream.file,
            stream.carries.join(", "),
            stream.rows,
            significant(stream.rate_hz, 4)
        )
    }));
    lines
}

/// Returns how late stamps are, s, in ms.
fn skew_words(late_s: f64, u95_s: f64) -> String {
    let late = if late_s < 0.0 { "early" } else { "late" };
    format!("stamps {late} by {}", with_u95(1e3 * late_s.abs(), 1e3 * u95_s, "ms"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn early_is_not_negatively_late() {
        assert_eq!(skew_words(-2.46e-3, 0.12e-3), "stamps early by 2.46 ± 0.12 ms");
        assert_eq!(skew_words(2.46e-3, 0.12e-3), "stamps late by 2.46 ± 0.12 ms");
    }
}
