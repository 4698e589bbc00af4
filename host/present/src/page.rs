//! The page: headline, tables, figures, provenance. Well-formed XML as well as HTML; no script, nothing
//! loaded.

use super::data::{Decided, PrincipalAxis, Quantity};
use rigident_fit::figures::{NOT_IDENTIFIED, Rounded, beside, fixed, signed, significant, unit_symbol};

/// Returns everything before the content of an answer's page.
pub(super) fn beginning(title: &str) -> String {
    beginning_with(title, "inertial parameters", "")
}

/// Returns everything before a page's content: `about` is the kind of page, `head` is more markup of its
/// head.
pub(super) fn beginning_with(title: &str, about: &str, head: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{} - {about}</title>\n<style>\n{}</style>\n{head}</head>\n<body>\n<main>\n",
        escape(title),
        include_str!("style.css")
    )
}

/// All after it.
pub(super) const END: &str = "</main>\n</body>\n</html>\n";

/// Returns what was decided, and its result.
pub(super) fn decisions(decided: &[Decided]) -> String {
    if decided.is_empty() {
        return String::new();
    }
    let ratio = |v: f64| if v.is_finite() { format!("{v:.2}") } else { "not determined".to_owned() };
    let rows: String = decided
        .iter()
        .map(|d| {
            let got = d.got.map_or("–".to_owned(), ratio);
            let lasted = d.lasted_s.map_or("–".to_owned(), |s| format!("{s:.1}"));
            let ended = if d.whole { "" } else { ", ended early" };
            format!(
                "<tr><td class=\"right\">{:.1}</td><td>{}{ended}</td><td>{}</td><td \
                 class=\"right\">{}</td><td class=\"right\">{}</td><td class=\"right\">{got}</td><td \
                 class=\"right\">{lasted}</td></tr>\n",
                d.begun_s,
                escape(&d.name),
                escape(&d.purpose),
                ratio(d.before),
                ratio(d.expected)
            )
        })
        .collect();
    format!(
        "<h2>Decisions</h2>\n<p class=\"soft\">Worst 95 % uncertainty over what is asked for: before a \
         segment, expected at its end, and got. All is reached at 1.</p>\n<div class=\"scroll\"><table \
         class=\"tight\"><thead><tr><th class=\"right\" scope=\"col\">from, s</th><th \
         scope=\"col\">segment</th><th scope=\"col\">furthest off</th><th class=\"right\" \
         scope=\"col\">before</th><th class=\"right\" scope=\"col\">expected</th><th class=\"right\" \
         scope=\"col\">got</th><th class=\"right\" scope=\"col\">lasted, s</th></tr></thead>\n\
         <tbody>{rows}</tbody></table></div>\n"
    )
}

pub(super) const CONVERGENCE_NOTE: &str = "Estimate and its 95 % band; the scale fits the settled part.";

pub(super) fn section(html: &mut String, class: &str, title: &str, note: &str, figures: &str) {
    if figures.is_empty() {
        return;
    }
    html.push_str(&format!("<h2>{title}</h2>\n"));
    if !note.is_empty() {
        html.push_str(&format!("<p class=\"soft\">{}</p>\n", escape(note)));
    }
    html.push_str(&format!("<div class=\"{class}\">\n{figures}</div>\n"));
}

/// Returns the truth and the estimate's distance from it, or nothing.
pub(super) fn beside_words(quantity: &Quantity, u95: f64) -> String {
    match (quantity.truth.filter(|t| t.is_finite()), quantity.deviation_sd()) {
        (Some(truth), Some(sd)) => format!("truth {}, {}", number(&beside(truth, u95)), deviation(sd)),
        (Some(truth), None) => format!("truth {}", number(&beside(truth, u95))),
        (None, _) => String::new(),
    }
}

/// Returns a deviation in words, `+1.4 σ`.
fn deviation(sd: f64) -> String {
    format!("{} σ", number(&if sd.abs() < 1e4 { signed(sd, 1) } else { format!("{sd:+.1e}") }))
}

pub(super) fn table_or_nothing(class: &str, rows: &str, missing: &str) -> String {
    if rows.is_empty() {
        return format!("<p class=\"none\">{missing}</p>\n");
    }
    format!("<table class=\"{class}\"><tbody>\n{rows}</tbody></table>\n")
}

/// Returns `[xx, yy, zz, yz, zx, xy]` as three rows; the lower triangle is a pale copy.
pub(super) fn tensor_rows(elements: &[Quantity]) -> String {
    let cell = |row: usize, column: usize| {
        let index = if row == column { row } else { 6 - row - column };
        let class = if column < row { " class=\"mirror\"" } else { "" };
        let content = match elements.get(index).and_then(Quantity::known) {
            Some(m) => {
                let (value, u95) = parts(m.value, m.u95);
                format!("{value}<br/><small>± {u95}</small>")
            }
            None => format!("<span class=\"none\">{NOT_IDENTIFIED}</span>"),
        };
        format!("<td{class}>{content}</td>")
    };
    (0..3).map(|row| format!("<tr>{}</tr>\n", (0..3).map(|c| cell(row, c)).collect::<String>())).collect()
}

pub(super) fn notes(title: &str, notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    let items: String = notes.iter().map(|note| format!("<li>{}</li>", escape(note))).collect();
    format!("<section class=\"box\"><h3>{title}</h3><ul>{items}</ul></section>\n")
}

/// Returns value and uncertainty, or the words in place of both.
pub(super) fn value_cells(quantity: &Quantity) -> String {
    let Some(m) = quantity.known() else {
        return format!("<td class=\"none\" colspan=\"2\">{}</td>", quantity.missing());
    };
    let (value, u95) = parts(m.value, m.u95);
    let tag = if quantity.state.is_prior_dominated() { " <span class=\"tag\">prior</span>" } else { "" };
    format!("<td class=\"value\">{value}</td><td>± {u95}{tag}</td>")
}

pub(super) fn truth_cells(quantity: &Quantity, u95: f64) -> String {
    let Some(truth) = quantity.truth.filter(|t| t.is_finite()) else {
        return "<td></td><td></td><td></td>".to_owned();
    };
    let deviation = quantity.deviation_sd().map_or(String::new(), deviation);
    let glyph = quantity.deviation_sd().map_or(String::new(), |sd| glyph(sd / 1.96));
    format!(
        "<td class=\"right\">{}</td><td class=\"right\">{deviation}</td><td class=\"glyph\">{glyph}</td>",
        number(&beside(truth, u95))
    )
}

/// Draws interval and truth, the deviation in units of U95; the scale ends at 2.4.
fn glyph(deviation: f64) -> String {
    let x = |v: f64| 46.0 + 19.0 * v.clamp(-2.4, 2.4);
    let class = if deviation.abs() > 1.0 { " class=\"off\"" } else { "" };
    let (from, mean, to) = (x(deviation - 1.0), x(deviation), x(deviation + 1.0));
    format!(
        "<svg viewBox=\"0 0 92 14\" aria-hidden=\"true\"><line class=\"rail\" x1=\"1\" y1=\"7\" x2=\"91\" \
         y2=\"7\"/><rect{class} x=\"{from:.1}\" y=\"4\" width=\"{:.1}\" height=\"6\"/><line class=\"mean\" \
         x1=\"{mean:.1}\" y1=\"3\" x2=\"{mean:.1}\" y2=\"11\"/><line class=\"at\" x1=\"46\" y1=\"0\" \
         x2=\"46\" y2=\"14\"/></svg>",
        (to - from).max(0.5)
    )
}

pub(super) fn principal(axes: &[PrincipalAxis]) -> String {
    if axes.is_empty() {
        return String::new();
    }
    let with_truth = axes.iter().any(|a| a.moment.known().is_some() && a.moment.truth.is_some());
    let truth_head = if with_truth {
        "<th scope=\"col\">truth</th><th class=\"right\" scope=\"col\">deviation</th>"
    } else {
        ""
    };
    let mut html = format!(
        "<div class=\"scroll\"><table class=\"tight\"><caption>Principal moments, kg m², and their axes in \
         S</caption>\n<thead><tr><th class=\"value\" scope=\"col\">moment</th><th scope=\"col\">± \
         U95</th>{truth_head}<th scope=\"col\">axis</th><th scope=\"col\">± \
         U95</th></tr></thead>\n<tbody>\n"
    );
    for axis in axes {
        html.push_str(&format!("<tr>{}", value_cells(&axis.moment)));
        let known = axis.moment.known();
        if with_truth {
            let truth =
                known.zip(axis.moment.truth).map_or(String::new(), |(m, t)| number(&beside(t, m.u95)));
            let deviation = axis.moment.deviation_sd().map_or(String::new(), deviation);
            html.push_str(&format!("<td>{truth}</td><td class=\"right\">{deviation}</td>"));
        }
        if known.is_none() {
            html.push_str("<td></td><td></td>");
        } else if axis.direction_u95_rad.is_finite() {
            let direction = axis.axis.map(|c| number(&fixed(c, 3))).join(", ");
            let degrees = number(&significant(axis.direction_u95_rad.to_degrees(), 2));
            html.push_str(&format!("<td>[{direction}]</td><td>{degrees}°</td>"));
        } else {
            html.push_str("<td class=\"soft\" colspan=\"2\">free: moments equal within U95</td>");
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table></div>\n");
    html
}

pub(super) fn fact(label: &str, value: &str) -> String {
    format!("<tr><th scope=\"row\">{}</th><td>{value}</td></tr>\n", escape(label))
}

/// Returns value and uncertainty as markup.
pub(super) fn parts(value: f64, u95: f64) -> (String, String) {
    match Rounded::new(value, u95) {
        Some(r) => (number(&r.value_alone()), number(&r.u95_alone())),
        None => (NOT_IDENTIFIED.to_owned(), String::new()),
    }
}

/// Returns `20.013 ± 0.021 kg`, or the words in its place.
pub(super) fn measured_markup(quantity: &Quantity) -> String {
    quantity.known().map_or(quantity.missing().to_owned(), |m| {
        let (value, u95) = parts(m.value, m.u95);
        format!("{value} ± {u95} {}", escape(&unit_symbol(&quantity.unit)))
    })
}

/// Returns a printed number with a true minus and its power of ten raised.
pub(super) fn number(text: &str) -> String {
    let minus = |t: &str| t.replace('-', "\u{2212}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{}×10<sup>{}</sup>", minus(mantissa), minus(exponent)),
        None => minus(text),
    }
}

/// Returns a parameter's name as markup: `Ixx` with its subscript.
pub(super) fn symbol(name: &str) -> String {
    let short = name.strip_prefix("offset_").unwrap_or(name);
    let split = match short {
        "mcx" | "mcy" | "mcz" => 2,
        "Ixx" | "Iyy" | "Izz" | "Iyz" | "Izx" | "Ixy" => 1,
        "fx" | "fy" | "fz" | "mx" | "my" | "mz" => 1,
        _ => short.len(),
    };
    match short.split_at_checked(split) {
        Some((stem, index)) if !index.is_empty() => format!("{stem}<sub>{index}</sub>"),
        _ => escape(short),
    }
}

/// Returns what a parameter is, in words.
pub(super) fn describe(name: &str) -> &'static str {
    match name {
        "m" => "mass",
        "mcx" | "mcy" | "mcz" => "first moment",
        "Ixx" | "Iyy" | "Izz" => "moment of inertia",
        "Iyz" | "Izx" | "Ixy" => "product of inertia",
        _ => "",
    }
}

/// Returns a text as content or attribute of HTML and XML; characters that neither allows are replaced.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\t' | '\n' => escaped.push(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}
