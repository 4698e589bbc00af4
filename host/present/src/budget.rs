//! Errors of the rig and the uncertainty budget, as text and as page.

use super::page::{escape, number};
use super::table::printable;
use rigident_fit::figures::{Rounded, significant, unit_symbol};
use rigident_identify::answer::Answer;
use rigident_identify::answer::result::{Budget, RigError};

/// Sources of a quantity that a terminal shows.
const SHOWN_SOURCES: usize = 4;
/// Errors that a terminal shows.
const SHOWN_ERRORS: usize = 8;
/// A share of the variance that is worth a word.
const LEAST_SHARE: f64 = 0.01;

/// Appends errors that were found, and the budget.
pub(super) fn text(out: &mut String, answer: &Answer) {
    let mut found: Vec<&RigError> = answer.errors.iter().filter(|e| e.value.abs() > e.u95).collect();
    found.sort_by(|a, b| (b.value / b.sigma).abs().total_cmp(&(a.value / a.sigma).abs()));
    if !found.is_empty() {
        out.push_str(if answer.is_contradicted() {
            "\nErrors of the rig found with it, no calibration\n"
        } else {
            "\nErrors of the rig found with it\n"
        });
        let width = found.iter().take(SHOWN_ERRORS).map(|e| e.name.len()).max().unwrap_or(0);
        for error in found.iter().take(SHOWN_ERRORS) {
            let Some(rounded) = Rounded::new(error.value, error.u95) else { continue };
            let (name, unit) = (printable(&error.name), symbol(&error.unit));
            let sd = error.value / error.sigma;
            out.push_str(&format!(
                "  {name:<width$}  {rounded}{unit}, {sd:+.1} sd of {}\n",
                printable(&error.basis)
            ));
        }
        if found.len() > SHOWN_ERRORS {
            out.push_str(&format!("  and {} more\n", found.len() - SHOWN_ERRORS));
        }
    }
    if !answer.budget.is_empty() {
        out.push_str("\nUncertainty budget, shares of the variance\n");
        let width = answer.budget.iter().map(|b| b.quantity.chars().count()).max().unwrap_or(0);
        for own in &answer.budget {
            let shares = own.contributions.iter().filter(|c| c.share >= LEAST_SHARE).take(SHOWN_SOURCES);
            let shares: Vec<String> =
                shares.map(|c| format!("{} {:.0} %", printable(&c.source), 100.0 * c.share)).collect();
            out.push_str(&format!("  {:<width$}  {}\n", printable(&own.quantity), shares.join(", ")));
        }
        if let Some(improvement) = &answer.improvement {
            out.push_str(&format!("{}\n", printable(improvement)));
        }
    }
}

/// Returns a unit with a space before it, nothing for a pure number.
fn symbol(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" {}", unit_symbol(unit)) }
}

/// Returns the tables of the page.
pub(super) fn html(answer: &Answer) -> String {
    format!("{}{}", budget(&answer.budget, answer.improvement.as_deref()), errors(answer))
}

/// Returns the table of a budget, and the words on what would make it smaller.
pub(super) fn budget(budget: &[Budget], improvement: Option<&str>) -> String {
    if budget.is_empty() {
        return String::new();
    }
    let mut sources: Vec<(&str, f64)> = Vec::new();
    for contribution in budget.iter().flat_map(|b| &b.contributions) {
        match sources.iter_mut().find(|(name, _)| *name == contribution.source) {
            Some((_, share)) => *share += contribution.share,
            None => sources.push((&contribution.source, contribution.share)),
        }
    }
    sources.sort_by(|a, b| b.1.total_cmp(&a.1));
    let share = |own: &Budget, source: &str| {
        own.contributions.iter().find(|c| c.source == source).map_or(0.0, |c| c.share)
    };
    sources.retain(|(name, _)| budget.iter().any(|own| share(own, name) >= LEAST_SHARE));
    let quantity = |own: &Budget| {
        let (sd, unit) = (number(&significant(own.sd, 2)), unit_symbol(&own.unit));
        [escape(&own.quantity), format!("{sd} {}", escape(&unit))]
    };
    let cell = |own: &Budget, source: &str| {
        let share = share(own, source);
        let text = if share < 0.1 * LEAST_SHARE { "–".to_owned() } else { significant(100.0 * share, 2) };
        format!("<td class=\"right\">{text}</td>")
    };
    let column = |name: &str| format!("<th class=\"right\" scope=\"col\">{name}</th>");
    // The longer list goes down the page.
    let (head, rows) = if sources.len() > budget.len() {
        let head: String = budget.iter().map(|own| column(&quantity(own).join("<br/>"))).collect();
        let row = |name: &str| {
            let cells: String = budget.iter().map(|own| cell(own, name)).collect();
            format!("<tr><th scope=\"row\">{}, %</th>{cells}</tr>\n", escape(name))
        };
        let rows: String = sources.iter().map(|(name, _)| row(name)).collect();
        (format!("<th scope=\"col\">source</th>{head}"), rows)
    } else {
        let head: String = sources.iter().map(|(name, _)| column(&format!("{}, %", escape(name)))).collect();
        let row = |own: &Budget| {
            let [name, sd] = quantity(own);
            let cells: String = sources.iter().map(|(name, _)| cell(own, name)).collect();
            format!("<tr><th scope=\"row\">{name}</th><td class=\"right\">{sd}</td>{cells}</tr>\n")
        };
        let rows: String = budget.iter().map(row).collect();
        (format!("<th scope=\"col\">quantity</th>{}{head}", column("standard uncertainty")), rows)
    };
    let improvement = improvement.map_or_else(String::new, |text| format!("<p>{}</p>\n", escape(text)));
    format!(
        "<h2>Uncertainty budget</h2>\n<p class=\"soft\">Standard uncertainty of each quantity, and the share \
         of its variance that each source brings, after JCGM 100.</p>\n{improvement}<div \
         class=\"scroll\"><table \
         class=\"tight\"><thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table></div>\n"
    )
}

fn errors(answer: &Answer) -> String {
    if answer.errors.is_empty() {
        return String::new();
    }
    let row = |error: &RigError| {
        let unit = symbol(&error.unit);
        let (value, u95) = Rounded::new(error.value, error.u95)
            .map_or((String::new(), String::new()), |r| (number(&r.value_alone()), number(&r.u95_alone())));
        let sd = error.value / error.sigma;
        format!(
            "<tr><th scope=\"row\">{}</th><td class=\"right\">{value}</td><td>± {u95}{}</td><td \
             class=\"right\">{}</td><td class=\"right\">{}</td><td \
             class=\"right\">{:.0}</td><td>{}{}</td></tr>\n",
            escape(&error.name),
            escape(&unit),
            number(&significant(error.sigma, 2)),
            number(&format!("{sd:+.1}")),
            100.0 * error.learned,
            escape(&error.basis),
            if error.stated { "" } else { " (default)" },
        )
    };
    let rows: String = answer.errors.iter().map(row).collect();
    let unusable =
        if answer.is_contradicted() { " The recording cannot be true: they are no calibration." } else { "" };
    format!(
        "<h2>Errors of the rig</h2>\n<p class=\"soft\">Estimated with the body and eliminated: each is zero \
         beforehand, give or take σ; learned is the share of that variance that the recording has \
         removed.{unusable}</p>\n\
         <div class=\"scroll\"><table class=\"tight\"><thead><tr><th scope=\"col\">error</th><th \
         class=\"right\" scope=\"col\">estimate</th><th scope=\"col\">± U95</th><th class=\"right\" \
         scope=\"col\">σ beforehand</th><th class=\"right\" scope=\"col\">in σ</th><th class=\"right\" \
         scope=\"col\">learned, %</th><th \
         scope=\"col\">from</th></tr></thead>\n<tbody>{rows}</tbody></table></div>\n"
    )
}
