//! The results of a certificate in the customer's units, with their expanded uncertainties.

use rigident_io::rig::CertificateTable;

use super::COVERAGE_FACTOR;
use crate::data::Quantity;
use crate::page::{escape, number, parts, symbol};
use crate::quantities::{Group, by_owner, is_body, of_the_body, parameters, principal};
use rigident_fit::figures::{fixed, significant, unit_symbol};
use rigident_identify::answer::Answer;

/// Standard uncertainties in U95 of a normal distribution.
const OF_U95: f64 = 1.96;

/// The way in which expanded uncertainties of a certificate are made of those of its answer.
#[derive(Clone, Copy)]
pub(super) enum Expanded {
    /// U = 2 u.
    Twice,
    /// U95 as it is: noise was estimated from few residuals, and u is smaller by Student's factors, of which
    /// this is the largest.
    Student(f64),
}

impl Expanded {
    /// Chooses by the coverage factors of the answer.
    pub(super) fn of(answer: &Answer) -> Self {
        answer.coverage_factor.map_or(Self::Twice, Self::Student)
    }

    fn factor(self) -> f64 {
        match self {
            Self::Twice => COVERAGE_FACTOR / OF_U95,
            Self::Student(_) => 1.0,
        }
    }

    fn heading(self) -> &'static str {
        match self {
            Self::Twice => "U (k = 2)",
            Self::Student(_) => "U (95 %)",
        }
    }

    /// Returns the statement on the expanded uncertainties.
    pub(super) fn statement(self) -> String {
        match self {
            Self::Twice => {
                "Expanded uncertainties are U = k u with the coverage factor k = 2, about 95 % for a \
                            normal distribution; standard uncertainties were evaluated after JCGM 100."
                    .to_owned()
            }
            Self::Student(most) => format!(
                "Expanded uncertainties U cover 95 %. Noise was estimated from few readings: the coverage \
                 factor of its part is Student's, k = {}, that of the rest k = 1.96; standard uncertainties \
                 were evaluated after JCGM 100.",
                fixed(most, 2)
            ),
        }
    }
}

/// Returns a factor from an SI unit to the customer's, and the customer's in ASCII.
fn unit_for<'a>(unit: &'a str, table: &CertificateTable) -> (f64, &'a str) {
    match unit {
        "kg" => table.mass_unit.unwrap_or_default().of_si(),
        "m" => table.length_unit.unwrap_or_default().of_si(),
        "kg m2" => table.inertia_unit.unwrap_or_default().of_si(),
        other => (1.0, other),
    }
}

/// Returns the tables of results.
pub(super) fn html(answer: &Answer, table: &CertificateTable) -> String {
    let mut html = "<h2>Results</h2>\n".to_owned();
    let expanded = Expanded::of(answer);
    if !is_body(answer) {
        by_owner(answer).iter().for_each(|group| html.push_str(&group_table(group, table, expanded)));
        return html;
    }
    let mass: Vec<Quantity> = parameters(answer).into_iter().filter(|q| q.name == "m").collect();
    html.push_str(&group_table(
        &Group { title: "Mass".to_owned(), quantities: mass, ..Group::default() },
        table,
        expanded,
    ));
    let (mut about, mut there) = of_the_body(answer);
    about
        .iter_mut()
        .for_each(|group| group.title = "Centre of mass in S, and tensor about it, axes of S".to_owned());
    for (group, frame) in there.iter_mut().zip(&answer.body_frame) {
        group.title = format!("Centre of mass in P, and tensor about the origin of P; P: {}", frame.name);
    }
    html.push_str("<div class=\"tables\">\n");
    about.iter().chain(&there).for_each(|group| html.push_str(&group_table(group, table, expanded)));
    html.push_str("</div>\n");
    html.push_str(&axes(answer, table, expanded));
    html.push_str(
        "<p class=\"soft\">S is the load cell's frame, P the part's. Products of inertia are elements of the \
         tensor: I<sub>xy</sub> = \u{2212}\u{222b} x y dm.</p>\n",
    );
    html
}

fn group_table(group: &Group, table: &CertificateTable, expanded: Expanded) -> String {
    let rows: String = group.quantities.iter().map(|quantity| row(quantity, table, expanded)).collect();
    format!(
        "<div class=\"scroll\"><table class=\"tight results\"><caption>{}</caption>\n<thead><tr><th \
         scope=\"col\"></th><th class=\"value\" scope=\"col\">value</th><th scope=\"col\">{}</th><th \
         scope=\"col\">unit</th></tr></thead>\n\
         <tbody>{rows}</tbody></table></div>\n",
        escape(&group.title),
        expanded.heading()
    )
}

fn row(quantity: &Quantity, table: &CertificateTable, expanded: Expanded) -> String {
    let (factor, unit) = unit_for(&quantity.unit, table);
    let name = symbol(&quantity.name);
    let Some(known) = quantity.known() else {
        let words = quantity.missing();
        return format!(
            "<tr><th scope=\"row\">{name}</th><td class=\"none\" colspan=\"3\">{words}</td></tr>\n"
        );
    };
    let (value, expanded) = parts(factor * known.value, factor * expanded.factor() * known.u95);
    let tag = if quantity.state.is_prior_dominated() {
        " <span class=\"tag\">with what was known beforehand</span>"
    } else {
        ""
    };
    format!(
        "<tr><th scope=\"row\">{name}</th><td class=\"value\">{value}</td><td>± \
         {expanded}</td><td>{}{tag}</td></tr>\n",
        escape(&unit_symbol(unit))
    )
}

/// Returns the principal moments with their axes in S, as markup.
fn axes(answer: &Answer, table: &CertificateTable, expanded: Expanded) -> String {
    let found = principal(answer);
    if found.is_empty() {
        return String::new();
    }
    let row = |axis: &crate::PrincipalAxis| {
        let (factor, unit) = unit_for(&axis.moment.unit, table);
        let moment = axis.moment.known().map_or(axis.moment.missing().to_owned(), |m| {
            let (value, own) = parts(factor * m.value, factor * expanded.factor() * m.u95);
            format!("{value} ± {own} {}", escape(&unit_symbol(unit)))
        });
        let direction = if axis.direction_u95_rad.is_finite() {
            let degrees = (expanded.factor() * axis.direction_u95_rad).to_degrees();
            let components = axis.axis.map(|c| number(&fixed(c, 3))).join(", ");
            format!("[{components}] ± {}°", number(&significant(degrees, 2)))
        } else {
            "free: moments equal within their uncertainty".to_owned()
        };
        format!("<tr><td>{moment}</td><td>{direction}</td></tr>\n")
    };
    format!(
        "<div class=\"scroll\"><table class=\"tight\"><caption>Principal moments about the centre of mass, \
         and their axes in S</caption>\n\
         <tbody>{}</tbody></table></div>\n",
        found.iter().map(row).collect::<String>()
    )
}

/// Returns the budget, its standard uncertainties in the customer's units and without advice.
pub(super) fn budget(answer: &Answer, table: &CertificateTable) -> String {
    let mut budget = answer.budget.clone();
    for own in &mut budget {
        let (factor, unit) = unit_for(&own.unit, table);
        own.sd *= factor;
        own.unit = unit.to_owned();
    }
    crate::budget::budget(&budget, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_identify::answer::result::{Measured, ParameterState};

    #[test]
    fn values_are_in_the_customers_units_with_twice_their_standard_uncertainty() {
        let measured = Measured { value: 0.0123, u95: 1.96e-4 };
        let quantity = Quantity {
            name: "Ixx".to_owned(),
            unit: "kg m2".to_owned(),
            state: ParameterState::Identified(measured),
            truth: None,
        };
        let shown = row(&quantity, &CertificateTable::default(), Expanded::Twice);
        assert!(shown.contains(">123.0<") && shown.contains("± 2.0<") && shown.contains("kg cm²"), "{shown}");
        let lost = Quantity { state: ParameterState::NotIdentified, ..quantity };
        assert!(row(&lost, &CertificateTable::default(), Expanded::Twice).contains("not identified"));
    }

    /// Five degrees of freedom: t = 2.571 (JCGM 100:2008, table G.2).
    #[test]
    fn few_readings_are_covered_by_students_factor() {
        let answer = |k| Answer { coverage_factor: k, ..Answer::default() };
        let few = Expanded::of(&answer(Some(2.571)));
        assert!(few.factor() == 1.0 && few.statement().contains("k = 2.57") && few.heading() == "U (95 %)");
        let many = Expanded::of(&answer(None));
        assert!((many.factor() * 1.96 - 2.0).abs() < 1e-12 && many.statement().contains("k = 2,"));
    }
}
