//! The tables of locked postures.

use std::fmt;

use super::postures::IdentifiedPostures;
use rigident_fit::figures::{NOT_IDENTIFIED, significant, unit_symbol, with_u95};
use rigident_vibration::suspension::posture_sets::Stand;

impl fmt::Display for IdentifiedPostures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let with_reference = self.subset.iter().any(|v| v.reference.is_some());
        writeln!(
            f,
            "{} of {} base parameters' directions are determined; uncertainty from {}\n\n  \
             {:<14} {:>24} {:>8}{}",
            self.determined,
            self.parameters,
            self.from,
            "",
            "value ± U95",
            "",
            if with_reference { "   reference  difference" } else { "" }
        )?;
        for value in &self.subset {
            let own = &value.found;
            let cell =
                own.measured.map_or_else(|| NOT_IDENTIFIED.to_owned(), |m| with_u95(m.value, m.u95, ""));
            write!(f, "  {:<14} {cell:>24} {:<8}", own.name, unit_symbol(&own.unit))?;
            if let Some((reference, own)) = value.reference.zip(own.measured) {
                write!(f, " {reference:>11.4} {:>11.4}", own.value - reference)?;
            }
            writeln!(f)?;
        }
        if let Some(open) = &self.open {
            let least = significant(open.least, 4);
            write!(f, "\n{0} is left open: {least} < {0} < {1:.4} kg m²", open.name, open.most)?;
            if let Some(most) = open.most_of_leaf {
                write!(f, "; < {most:.4} as the mass of the other link is known")?;
            }
            writeln!(f)?;
        }
        write!(f, "\nSets of postures                                     rank   condition")?;
        for set in &self.sets {
            let (names, condition) = (set.postures.join(", "), significant(set.condition, 3));
            write!(f, "\n  {names:<50} {:>4} {condition:>11}", set.rank)?;
        }
        let share = |s: &super::postures::PostureShare| format!("{} {:.0} %", s.posture, 100.0 * s.share);
        let shares: Vec<String> = self.shares.iter().map(share).collect();
        if shares.len() > 1 {
            write!(f, "\n\nOf the variance, on average, come from {}", shares.join(", "))?;
        }
        let Some(next) = &self.next else { return Ok(()) };
        let stands: Vec<String> = next.joints.iter().map(stand).collect();
        write!(
            f,
            "\n\nTake next: {}\n  rank {}, condition {}",
            stands.join("; "),
            next.rank,
            significant(next.condition, 3)
        )?;
        next.gain.map_or(Ok(()), |gain| write!(f, ", mean uncertainty {:.0} % of what it is", 100.0 * gain))
    }
}

fn stand(stand: &Stand) -> String {
    match stand.turn_deg() {
        Some((axis, angle)) => format!(
            "{} turned by {angle:.0}° about ({:.2}, {:.2}, {:.2}), quaternion {:.3?}",
            stand.link, axis.x, axis.y, axis.z, stand.stands
        ),
        None => format!("{} at {:.3?}", stand.link, stand.stands),
    }
}
