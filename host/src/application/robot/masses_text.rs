//! The table of masses.

use std::fmt;

use super::masses::{LinkMass, MassProperties};
use rigident_fit::figures::{counted, significant};

impl fmt::Display for MassProperties {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}, of whose directions {} rows in {} determine {}, condition number {:.1e}; {} base parameters\n",
            counted(self.unknowns, "unknown", "unknowns"),
            self.rows,
            counted(self.parts, "part", "parts"),
            self.rank,
            self.condition,
            self.base_parameters
        )?;
        let cost = |value: f64| format!("{:.4}", value / self.nominal_cost);
        let mut row = |mark: &str, [way, setting, own, left, negative, impossible]: [&str; 6]| {
            writeln!(f, "{mark} {way:<11} {setting:<18} {own:>9} {left:>10} {negative:>9} {impossible:>11}")
        };
        row(" ", ["way", "setting", "cost", "left out", "mass ≤ 0", "impossible"])?;
        let nominal = cost(self.nominal_cost);
        row(" ", ["nominal", "", &nominal, &nominal, "", ""])?;
        for own in &self.ways {
            let left = own.left_out_cost.map_or_else(|| "–".to_owned(), cost);
            let [negative, impossible] = [own.negative_masses, own.impossible_links].map(|n| n.to_string());
            let mark = if self.chosen == Some(own.way) { "*" } else { " " };
            row(mark, [own.way, &own.setting, &cost(own.cost), &left, &negative, &impossible])?;
        }
        writeln!(
            f,
            "\nCost: squares left, relative to what the nominal model leaves; left out: each part by what \
             the others gave."
        )?;
        if let Some(way) = self.chosen {
            writeln!(
                f,
                "\nLinks by the way {way}, beside the model: single ones are not identified and have no \
                 interval: as far as rows do not determine them they \
                 are the model's:\n"
            )?;
            links(f, &self.links)?;
        }
        if !self.eliminated.is_empty() {
            f.write_str("\nEliminated, as it acts beside the model:\n\n")?;
            for own in &self.eliminated {
                writeln!(f, "  {}", own.in_words())?;
            }
        }
        if let Some(mass) = self.whole_mass_kg {
            writeln!(f, "\n  All links: {mass:.3} kg, nominal {:.3} kg.", self.nominal_whole_mass_kg)?;
        }
        match self.identified_whole_mass_kg.zip(self.identified_whole_mass_u95_kg) {
            Some((mass, u95)) => {
                write!(f, "  The whole mass by the rows alone: {mass:.3} ± {u95:.3} kg (U95).")
            }
            None => f.write_str("  The whole mass is not identified: it is the model's."),
        }
    }
}

fn links(f: &mut fmt::Formatter<'_>, links: &[LinkMass]) -> fmt::Result {
    let width = links.iter().map(|link| link.link.chars().count()).max().unwrap_or(4);
    writeln!(
        f,
        "  {:<width$} {:>10} {:>10} {:>8}   centre of mass, mm (change)",
        "link", "kg", "nominal", "change"
    )?;
    for link in links.iter().filter(|link| link.nominal_mass_kg > 0.0) {
        let centre: Vec<String> = (0..3)
            .map(|k| {
                let (own, nominal) = (link.centre_of_mass_m[k], link.nominal_centre_of_mass_m[k]);
                format!("{:.1} ({:+.1})", 1e3 * own, 1e3 * (own - nominal))
            })
            .collect();
        writeln!(
            f,
            "  {:<width$} {:>10} {:>10} {:>7} %   {}",
            link.link,
            significant(link.mass_kg, 4),
            significant(link.nominal_mass_kg, 4),
            format!("{:+.1}", 100.0 * (link.mass_kg / link.nominal_mass_kg - 1.0)),
            centre.join(", ")
        )?;
    }
    Ok(())
}
