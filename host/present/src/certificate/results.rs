//! The results of a certificate in the customer's units, with U = 2 u.

use rigident_io::rig::CertificateTable;

use super::COVERAGE_FACTOR;
use crate::data::Quantity;
use crate::page::{escape, number, parts, symbol};
use crate::quantities::{Group, by_owner, is_body, of_the_body, parameters, principal};
use rigident_fit::figures::{fixed, significant, unit_symbol};
use rigident_identify::answer::Answer;

/// U95 is this many standard uncertainties, here and in the answer.
const OF_U95: f64 = 1.96;

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
    if !is_body(answer) {
        by_owner(answer).iter().for_each(|group| html.push_str(&group_table(group, table)));
        return html;
    }
    let mass: Vec<Quantity> = parameters(answer).into_iter().filter(|q| q.name == "m").collect();
    html.push_str(&group_table(
        &Group { title: "Mass".to_owned(), quantities: mass, ..Group::default() },
        table,
    ));
    let (mut about, mut there) = of_the_body(answer);
    about
        .iter_mut()
        .for_each(|group| group.title = "Centre of mass in S, and tensor about it, axes of S".to_owned());
    for (group, frame) in there.iter_mut().zip(&answer.body_frame) {
        group.title = format!("Centre of mass in P, and tensor about the origin of P; P: {}", frame.name);
    }
    html.push_str("<div class=\"tables\">\n");
    about.iter().chain(&there).for_each(|group| html.push_str(&group_table(group, table)));
    html.push_str("</div>\n");
    html.push_str(&axes(answer, table));
    html.push_str(
        "<p class=\"soft\">S is the load cell's frame, P the part's. Products of inertia are elements of the \
         tensor: I<sub>xy</sub> = \u{2212}\u{222b} x y dm.</p>\n",
    );
    html
}

fn group_table(group: &Group, table: &CertificateTable) -> String {
    let rows: String = group.quantities.iter().map(|quantity| row(quantity, table)).collect();
    format!(
        "<div class=\"scroll\"><table class=\"tight results\"><caption>{}</caption>\n<thead><tr><th \
         scope=\"col\"></th><th class=\"value\" scope=\"col\">value</th><th scope=\"col\">U (k = 2)</th><th \
         scope=\"col\">unit</th></tr></thead>\n\
         <tbody>{rows}</tbody></table></div>\n",
        escape(&group.title)
    )
}

fn row(quantity: &Quantity, table: &CertificateTable) -> String {
    let (factor, unit) = unit_for(&quantity.unit, table);
    let name = symbol(&quantity.name);
    let Some(known) = quantity.known() else {
        let words = quantity.missing();
        return format!(
            "<tr><th scope=\"row\">{name}</th><td class=\"none\" colspan=\"3\">{words}</td></tr>\n"
        );
    };
    let (value, expanded) = parts(factor * known.value, factor * COVERAGE_FACTOR * known.u95 / OF_U95);
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
fn axes(answer: &Answer, table: &CertificateTable) -> String {
    let found = principal(answer);
    if found.is_empty() {
        return String::new();
    }
    let row = |axis: &crate::PrincipalAxis| {
        let (factor, unit) = unit_for(&axis.moment.unit, table);
        let moment = axis.moment.known().map_or(axis.moment.missing().to_owned(), |m| {
            let (value, expanded) = parts(factor * m.value, factor * COVERAGE_FACTOR * m.u95 / OF_U95);
            format!("{value} ± {expanded} {}", escape(&unit_symbol(unit)))
        });
        let direction = if axis.direction_u95_rad.is_finite() {
            let degrees = (COVERAGE_FACTOR * axis.direction_u95_rad / OF_U95).to_degrees();
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
        let shown = row(&quantity, &CertificateTable::default());
        assert!(shown.contains(">123.0<") && shown.contains("± 2.0<") && shown.contains("kg cm²"), "{shown}");
        let lost = Quantity { state: ParameterState::NotIdentified, ..quantity };
        assert!(row(&lost, &CertificateTable::default()).contains("not identified"));
    }
}
