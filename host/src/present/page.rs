//! The page: headline, tables, figures, provenance. Well-formed XML as well as HTML; no script, nothing loaded.

use super::data::{Along, Decided, PrincipalAxis, Quantity, ReportData, Results, Source, Status};
use super::figures;
use super::series::Series;
use super::text::{
    NOT_IDENTIFIED, Rounded, beside, count, duration, fixed, nearest_words, significant, time_base_words,
    unit_symbol,
};

/// The whole report as one self-contained HTML file.
pub fn html(data: &ReportData) -> String {
    let title =
        if data.source.body_name.trim().is_empty() { "Body without a name" } else { &data.source.body_name };
    let mut html = beginning(title);
    html.push_str(&format!(
        "<header><h1>{}</h1>\n{}{}{}</header>\n",
        escape(title),
        source(&data.source),
        status(data.results.status, &status_words(&data.results)),
        plain_notes(&data.results.notes)
    ));
    html.push_str(&cards(&data.results));
    let base = data.results.time_base.as_ref().map(time_base_words).unwrap_or_default();
    html.push_str(&notes("Common time base", &base));
    html.push_str(&notes("Known beforehand", &data.results.known));
    html.push_str(&notes("Warnings", &data.results.warnings));
    html.push_str(&notes("What would identify the rest", &data.results.advice));
    html.push_str(&format!("<h2>Results</h2>\n<div class=\"tables\">\n{}</div>\n", tables(data)));
    let series = Series::from(data);
    let time = figures::time_axis(&series);
    let dotted =
        if data.stages.is_empty() { "" } else { " Dotted lines separate the stages of the experiment." };
    section(
        &mut html,
        "grid",
        "Convergence",
        &format!("{CONVERGENCE_NOTE}{dotted}"),
        &figures::convergence(&data.results.parameters, &series, &time),
    );
    section(&mut html, "grid", "Residuals", &residual_note(data), &figures::residuals(&series, &time));
    let motion = if data.along == Along::Poses { "Still poses" } else { "Motion" };
    section(&mut html, "wide", motion, "", &figures::motion(&series, &time));
    if let Some(drift) = &data.drift {
        let elapsed = escape(&duration(drift.elapsed_s));
        html.push_str(&format!("<h2>Drift check after {elapsed}</h2>\n{}", figures::drift(drift)));
    }
    html.push_str(&decisions(&data.decisions));
    if !data.provenance.is_empty() {
        let rows: String = data.provenance.iter().map(|(label, value)| fact(label, &escape(value))).collect();
        html.push_str(&format!(
            "<h2>Provenance</h2>\n<table class=\"plainrows\"><tbody>{rows}</tbody></table>\n"
        ));
    }
    html.push_str(FOOTER);
    html.push_str(END);
    html
}

/// All before the page's content.
pub(super) fn beginning(title: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{} - inertial parameters</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n",
        escape(title),
        include_str!("style.css")
    )
}

/// All after it.
pub(super) const END: &str = "</main>\n</body>\n</html>\n";

/// What was decided, and what came of it.
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
                "<tr><td class=\"right\">{:.1}</td><td>{}{ended}</td><td>{}</td><td class=\"right\">{}</td>\
                 <td class=\"right\">{}</td><td class=\"right\">{got}</td><td class=\"right\">{lasted}</td></tr>\n",
                d.begun_s,
                escape(&d.name),
                escape(&d.purpose),
                ratio(d.before),
                ratio(d.expected)
            )
        })
        .collect();
    format!(
        "<h2>Decisions</h2>\n<p class=\"soft\">Worst 95 % uncertainty over what is asked for: before a segment, expected at its \
         end, and got. All is reached at 1.</p>\n<div class=\"scroll\"><table class=\"tight\"><thead><tr>\
         <th class=\"right\" scope=\"col\">from, s</th><th scope=\"col\">segment</th><th scope=\"col\">furthest off</th>\
         <th class=\"right\" scope=\"col\">before</th><th class=\"right\" scope=\"col\">expected</th>\
         <th class=\"right\" scope=\"col\">got</th><th class=\"right\" scope=\"col\">lasted, s</th></tr></thead>\n\
         <tbody>{rows}</tbody></table></div>\n"
    )
}

pub(super) const CONVERGENCE_NOTE: &str = "Estimate and its 95 % band; the scale fits the settled part.";

pub(super) const FOOTER: &str = "<footer><p>S is the wrench sensor's frame. Products of inertia are tensor elements: \
    I<sub>xy</sub> = \u{2212}\u{222b} x y dm.</p>\n<p>\u{b1} is the 95 % expanded uncertainty U95; \u{3c3} = U95 / \
    1.96. The deviation is estimate minus truth. In the small diagrams the bar is the interval, the upright line \
    the truth.</p></footer>\n";

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

fn residual_note(data: &ReportData) -> String {
    let what = "Measured minus modelled wrench; every drawn interval shows its smallest and largest value.";
    format!("{what} {}", data.residual_note).trim_end().to_owned()
}

pub(super) fn source(source: &Source) -> String {
    let mut parts = Vec::new();
    if !source.recording.is_empty() {
        parts.push(escape(&source.recording));
    }
    parts.push(match source.mcu.as_str() {
        "inproc" => "firmware in process".to_owned(),
        "qemu" => "firmware on the emulated Cortex-M4F".to_owned(),
        "host" | "" => "batch on the host".to_owned(),
        port => format!("firmware at {}", escape(port)),
    });
    parts.push(format!("{} rows", count(source.rows)));
    parts.extend(source.rate_hz.map(|rate| format!("{} Hz", significant(rate, 6))));
    parts.push(source.duration_s.map_or("still poses".to_owned(), duration));
    let parts: String = parts.iter().map(|part| format!("<span>{part}</span>")).collect();
    format!("<p class=\"source\">{parts}</p>\n")
}

/// The status in words.
pub(super) fn status_words(results: &Results) -> String {
    let missing: Vec<&str> =
        results.parameters.iter().filter(|q| q.known().is_none()).map(|q| q.name.as_str()).collect();
    let prior: Vec<&str> = results
        .parameters
        .iter()
        .filter(|q| q.known().is_some() && q.state.is_prior_dominated())
        .map(|q| q.name.as_str())
        .collect();
    let words = match results.status {
        Status::Identified if missing.is_empty() && !prior.is_empty() => {
            "Identified what was asked for".to_owned()
        }
        Status::Identified if missing.is_empty() => {
            "Identified: the data determine every parameter".to_owned()
        }
        Status::Identified => {
            format!("Identified what was asked for. Not identified: {}", missing.join(", "))
        }
        Status::PartlyIdentified if missing.is_empty() => "Partly identified".to_owned(),
        Status::PartlyIdentified => format!("Partly identified. Not identified: {}", missing.join(", ")),
        // The body is there, and was not what was asked for.
        Status::NotIdentified if missing.len() < results.parameters.len() => {
            "What was asked for is not identified".to_owned()
        }
        Status::NotIdentified => "Not identified".to_owned(),
        Status::Failed => "Failed: the experiment did not come to its end".to_owned(),
    };
    if prior.is_empty() {
        words
    } else {
        format!("{words}. Only with what was known beforehand: {}", prior.join(", "))
    }
}

pub(super) fn status(status: Status, words: &str) -> String {
    let class = match status {
        Status::Identified => "good",
        Status::PartlyIdentified => "fair",
        Status::NotIdentified | Status::Failed => "bad",
    };
    format!("<p class=\"status {class}\">{}</p>\n", escape(words))
}

fn cards(results: &Results) -> String {
    let mut html = "<div class=\"cards\">\n<section class=\"card\"><h3>Mass</h3>\n".to_owned();
    match results.parameters.iter().find(|q| q.name == "m").and_then(|q| q.known().map(|m| (q, m))) {
        Some((quantity, m)) => {
            let (value, u95) = parts(m.value, m.u95);
            html.push_str(&format!("<p class=\"big\">{value} <small>± {u95} kg</small></p>\n"));
            let beside = beside_words(quantity, m.u95);
            if !beside.is_empty() {
                html.push_str(&format!("<p class=\"soft\">{beside}</p>\n"));
            }
        }
        None => html.push_str(&format!("<p class=\"big none\">{NOT_IDENTIFIED}</p>\n")),
    }
    html.push_str("</section>\n<section class=\"card\"><h3>Centre of mass in S, m</h3>\n");
    let rows: String = results
        .centre_of_mass
        .iter()
        .map(|q| {
            let beside = q.known().map_or(String::new(), |m| beside_words(q, m.u95));
            let (name, cells) = (escape(&q.name), value_cells(q));
            format!("<tr><th scope=\"row\">{name}</th>{cells}<td class=\"soft\">{beside}</td></tr>\n")
        })
        .collect();
    html.push_str(&table_or_nothing("xyz", &rows));
    html.push_str("</section>\n<section class=\"card\"><h3>Inertia about the centre of mass, kg m²</h3>\n");
    let some = results.inertia_com.iter().any(|q| q.known().is_some());
    let rows = if some && results.inertia_com.len() == 6 {
        tensor_rows(&results.inertia_com)
    } else {
        String::new()
    };
    html.push_str(&table_or_nothing("tensor", &rows));
    html.push_str("</section>\n</div>\n");
    html
}

/// The truth and how far the estimate is from it, or nothing.
pub(super) fn beside_words(quantity: &Quantity, u95: f64) -> String {
    match (quantity.truth.filter(|t| t.is_finite()), quantity.deviation_sd()) {
        (Some(truth), Some(sd)) => format!("truth {}, {}", number(&beside(truth, u95)), deviation(sd)),
        (Some(truth), None) => format!("truth {}", number(&beside(truth, u95))),
        (None, _) => String::new(),
    }
}

/// `+1.4 σ`.
fn deviation(sd: f64) -> String {
    format!("{} σ", number(&if sd.abs() < 1e4 { format!("{sd:+.1}") } else { format!("{sd:+.1e}") }))
}

pub(super) fn table_or_nothing(class: &str, rows: &str) -> String {
    if rows.is_empty() {
        return format!("<p class=\"none\">{NOT_IDENTIFIED}</p>\n");
    }
    format!("<table class=\"{class}\"><tbody>\n{rows}</tbody></table>\n")
}

/// `[xx, yy, zz, yz, zx, xy]` as three rows; the lower triangle is a pale copy.
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

/// Notes without a box.
fn plain_notes(notes: &[String]) -> String {
    notes.iter().map(|note| format!("<p class=\"soft\">{}</p>\n", escape(note))).collect()
}

pub(super) fn notes(title: &str, notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    let items: String = notes.iter().map(|note| format!("<li>{}</li>", escape(note))).collect();
    format!("<section class=\"box\"><h3>{title}</h3><ul>{items}</ul></section>\n")
}

fn tables(data: &ReportData) -> String {
    let results = &data.results;
    let mut html = table("In S, about the origin of S", &results.parameters);
    let about_com: Vec<Quantity> =
        results.centre_of_mass.iter().chain(&results.inertia_com).cloned().collect();
    html.push_str(&table("About the centre of mass, axes of S", &about_com));
    if let Some(frame) = &results.body_frame {
        html.push_str(&table(&format!("In the body's frame, {}", frame.name), &frame.quantities));
    }
    html.push_str(&table("Apparent wrench offsets, on the body", &results.offsets));
    html.push_str(&principal(&results.principal));
    html.push_str(&quality(data));
    html
}

pub(super) fn table(caption: &str, quantities: &[Quantity]) -> String {
    if quantities.is_empty() {
        return String::new();
    }
    let with_truth = quantities.iter().any(|q| q.known().is_some() && q.truth.is_some());
    let class = if with_truth { "full" } else { "short" };
    let truth_head = if with_truth {
        "<th class=\"right\" scope=\"col\">truth</th><th class=\"right\" scope=\"col\">deviation</th><th></th>"
    } else {
        ""
    };
    let mut html = format!(
        "<div class=\"scroll\"><table class=\"{class}\"><caption>{}</caption>\n<thead><tr><th></th><th class=\"value\" scope=\"col\">estimate</th>\
         <th scope=\"col\">± U95</th><th scope=\"col\">unit</th>{truth_head}</tr></thead>\n<tbody>\n",
        escape(caption)
    );
    for quantity in quantities {
        html.push_str(&format!("<tr><th scope=\"row\">{}</th>", symbol(&quantity.name)));
        match quantity.known() {
            None => {
                let columns = if with_truth { 6 } else { 3 };
                html.push_str(&format!("<td class=\"none\" colspan=\"{columns}\">{NOT_IDENTIFIED}</td>"));
            }
            Some(m) => {
                html.push_str(&value_cells(quantity));
                html.push_str(&format!("<td>{}</td>", escape(&unit_symbol(&quantity.unit))));
                if with_truth {
                    html.push_str(&truth_cells(quantity, m.u95));
                }
            }
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table></div>\n");
    html
}

/// Value and uncertainty, or the words in place of both.
pub(super) fn value_cells(quantity: &Quantity) -> String {
    let Some(m) = quantity.known() else {
        return format!("<td class=\"none\" colspan=\"2\">{NOT_IDENTIFIED}</td>");
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

/// Interval and truth, the deviation in units of U95; the scale ends at 2.4.
fn glyph(deviation: f64) -> String {
    let x = |v: f64| 46.0 + 19.0 * v.clamp(-2.4, 2.4);
    let class = if deviation.abs() > 1.0 { " class=\"off\"" } else { "" };
    let (from, mean, to) = (x(deviation - 1.0), x(deviation), x(deviation + 1.0));
    format!(
        "<svg viewBox=\"0 0 92 14\" aria-hidden=\"true\"><line class=\"rail\" x1=\"1\" y1=\"7\" x2=\"91\" y2=\"7\"/>\
         <rect{class} x=\"{from:.1}\" y=\"4\" width=\"{:.1}\" height=\"6\"/><line class=\"mean\" x1=\"{mean:.1}\" \
         y1=\"3\" x2=\"{mean:.1}\" y2=\"11\"/><line class=\"at\" x1=\"46\" y1=\"0\" x2=\"46\" y2=\"14\"/></svg>",
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
        "<div class=\"scroll\"><table class=\"tight\"><caption>Principal moments, kg m², and their axes in S</caption>\n<thead><tr>\
         <th class=\"value\" scope=\"col\">moment</th><th scope=\"col\">± U95</th>{truth_head}\
         <th scope=\"col\">axis</th><th scope=\"col\">± U95</th></tr></thead>\n<tbody>\n"
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

fn quality(data: &ReportData) -> String {
    let results = &data.results;
    let total: u64 = data.rejected.iter().fold(0, |sum, r| sum.saturating_add(r.1));
    let mut rejected = count(total);
    let reasons: Vec<String> = data
        .rejected
        .iter()
        .filter(|r| r.1 > 0)
        .map(|(reason, number)| format!("{} {}", count(*number), escape(reason)))
        .collect();
    if !reasons.is_empty() {
        rejected.push_str(&format!(": {}", reasons.join(", ")));
    }
    let consistent = match results.physically_consistent {
        Some(true) => "yes: the pseudo-inertia is positive definite",
        Some(false) => "<span class=\"none\">no: no rigid body has these parameters</span>",
        None => "unknown: not all ten parameters are identified",
    };
    let mut rows = fact("rows", &count(data.source.rows));
    rows.push_str(&fact("rejected rows", &rejected));
    if let Some(condition) = results.condition_number.filter(|c| c.is_finite()) {
        rows.push_str(&fact("condition number", &number(&significant(condition, 3))));
    }
    rows.push_str(&fact("physically consistent", consistent));
    if let Some(nearest) = &results.nearest_body {
        rows.push_str(&fact("nearest body", &escape(&nearest_words(&nearest.into(), nearest.distance_sd))));
    }
    format!("<table class=\"plainrows\"><caption>Quality</caption>\n<tbody>{rows}</tbody></table>\n")
}

/// Value and uncertainty as markup.
pub(super) fn parts(value: f64, u95: f64) -> (String, String) {
    match Rounded::new(value, u95) {
        Some(r) => (number(&r.value_alone()), number(&r.u95_alone())),
        None => (NOT_IDENTIFIED.to_owned(), String::new()),
    }
}

/// `20.013 ± 0.021 kg`, or the words.
pub(super) fn measured_markup(quantity: &Quantity) -> String {
    quantity.known().map_or(NOT_IDENTIFIED.to_owned(), |m| {
        let (value, u95) = parts(m.value, m.u95);
        format!("{value} ± {u95} {}", escape(&unit_symbol(&quantity.unit)))
    })
}

/// A printed number with a true minus and its power of ten raised.
pub(super) fn number(text: &str) -> String {
    let minus = |t: &str| t.replace('-', "\u{2212}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{}×10<sup>{}</sup>", minus(mantissa), minus(exponent)),
        None => minus(text),
    }
}

/// A parameter's name as markup: `Ixx` with its subscript.
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

/// What a parameter is, in words.
pub(super) fn describe(name: &str) -> &'static str {
    match name {
        "m" => "mass",
        "mcx" | "mcy" | "mcz" => "first moment",
        "Ixx" | "Iyy" | "Izz" => "moment of inertia",
        "Iyz" | "Izx" | "Ixy" => "product of inertia",
        _ => "",
    }
}

/// Text as content or attribute of HTML and XML; characters that neither allows are replaced.
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
