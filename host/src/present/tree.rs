//! The page about a tree of links: what is identified link by link, what is not and why, residuals channel by channel, and the
//! full parameters, which are marked as not identified.

use super::data::{Along, Quantity, ReportData, Residual, Source, Status};
use super::figures;
use super::page::{END, beginning, escape, fact, notes, number, section, source, status, value_cells};
use super::series::Series;
use super::text::{NOT_IDENTIFIED, significant, unit_symbol};

/// Parameters of one owner: a link, the load cell, a drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkRows {
    /// Whose.
    pub owner: String,
    /// The parameters, named without their owner, and what else each is made of.
    pub rows: Vec<(Quantity, String)>,
}

/// A link's full parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FullRow {
    /// The link.
    pub link: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link's frame, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass in the order of the parameters, axes of the link, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// Relative distance from the nominal model's.
    pub distance: f64,
}

/// What is left of a channel, its unit's root mean squares.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChannelRow {
    /// The channel.
    pub name: String,
    /// `N` or `N m`.
    pub unit: String,
    /// Of the residual.
    pub residual_rms: f64,
    /// Of the measurement.
    pub measured_rms: f64,
    /// 1 σ of the filtered residual that the intervals rest on.
    pub sigma: f64,
    /// Factor by which the slowest part of its noise is larger than white noise would be, if it is.
    pub colour: Option<f64>,
}

/// All that the page shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TreeReport {
    /// Name of the model.
    pub model: String,
    /// Where the data came from.
    pub source: Source,
    /// Whether the question was answered.
    pub status: Status,
    /// The same in words.
    pub status_words: String,
    /// What was measured on what kind of base.
    pub situation: String,
    /// Base parameters, offsets and drives by owner.
    pub owners: Vec<LinkRows>,
    /// Why what is not identified is not.
    pub reasons: Vec<String>,
    /// Whatever the reader should know before using the numbers.
    pub warnings: Vec<String>,
    /// What the full parameters are, in a sentence.
    pub full_note: String,
    /// The full parameters, where there is a nominal model.
    pub full: Vec<FullRow>,
    /// Residuals channel by channel.
    pub channels: Vec<ChannelRow>,
    /// The same over time.
    pub residuals: Vec<Residual>,
    /// Label and value of what else there is to say.
    pub facts: Vec<(String, String)>,
}

/// The whole report as one self-contained HTML file.
pub fn html_of_tree(report: &TreeReport) -> String {
    let title = if report.model.trim().is_empty() { "Tree of links" } else { &report.model };
    let mut html = beginning(title);
    html.push_str(&format!(
        "<header><h1>{}</h1>\n{}{}<p class=\"soft\">{}</p>\n</header>\n",
        escape(title),
        source(&report.source),
        status(report.status, &report.status_words),
        escape(&report.situation)
    ));
    html.push_str(&notes("Warnings", &report.warnings));
    html.push_str(&notes("What would identify the rest", &report.reasons));
    let tables: String = report.owners.iter().map(owner).collect();
    html.push_str(&format!(
        "<h2>Base parameters</h2>\n<p class=\"soft\">All that rows of this kind can tell apart, in the axes of each link and about \
         its origin. Each stands for a combination, named beside it.</p>\n<div class=\"tables\">\n{tables}</div>\n"
    ));
    html.push_str(&full(report));
    html.push_str(&format!("<h2>Residuals by channel</h2>\n{}", channels(&report.channels)));
    let data = ReportData {
        residuals: report.residuals.clone(),
        along: if report.source.duration_s.is_none() { Along::Poses } else { Along::Time },
        ..ReportData::default()
    };
    let note = "Filtered measurement less what the answer predicts; every drawn interval shows its smallest and largest value.";
    section(
        &mut html,
        "grid",
        "Residuals over time",
        note,
        &figures::residuals(&Series::from(&data), &figures::time_axis(&Series::from(&data))),
    );
    let facts: String = report.facts.iter().map(|(label, value)| fact(label, &escape(value))).collect();
    if !facts.is_empty() {
        html.push_str(&format!(
            "<h2>Quality</h2>\n<table class=\"plainrows\"><tbody>{facts}</tbody></table>\n"
        ));
    }
    html.push_str(
        "<footer><p>\u{b1} is the 95 % expanded uncertainty U95. M mass, MS first moments, J moments of inertia about the link's \
         origin; products are tensor elements: J<sub>xy</sub> = \u{2212}\u{222b} x y dm. A prime marks axes turned so that z' is \
         the joint's.</p></footer>\n",
    );
    html.push_str(END);
    html
}

fn owner(owner: &LinkRows) -> String {
    let rows: String = owner
        .rows
        .iter()
        .map(|(quantity, made_of)| {
            let cells = match quantity.known() {
                None => format!("<td class=\"none\" colspan=\"3\">{NOT_IDENTIFIED}</td>"),
                Some(_) => {
                    format!("{}<td>{}</td>", value_cells(quantity), escape(&unit_symbol(&quantity.unit)))
                }
            };
            format!(
                "<tr><th scope=\"row\">{}</th>{cells}<td class=\"soft made\">{}</td></tr>\n",
                escape(&quantity.name),
                escape(made_of)
            )
        })
        .collect();
    format!(
        "<div class=\"scroll\"><table class=\"short\"><caption>{}</caption>\n<thead><tr><th></th><th class=\"value\" \
         scope=\"col\">estimate</th><th scope=\"col\">± U95</th><th scope=\"col\">unit</th><th scope=\"col\">with</th></tr></thead>\n\
         <tbody>\n{rows}</tbody></table></div>\n",
        escape(&owner.owner)
    )
}

fn full(report: &TreeReport) -> String {
    if report.full.is_empty() {
        return String::new();
    }
    let figure = |v: f64| format!("<td class=\"right\">{}</td>", number(&significant(v, 4)));
    let rows: String = report
        .full
        .iter()
        .map(|row| {
            let numbers = [row.mass_kg].into_iter().chain(row.com_m).chain(row.inertia_com_kgm2);
            let cells: String = numbers.map(figure).collect();
            let far = format!("<td class=\"right\">{}</td>", number(&significant(row.distance, 2)));
            format!("<tr><th scope=\"row\">{}</th>{cells}{far}</tr>\n", escape(&row.link))
        })
        .collect();
    let heads: String =
        ["mass, kg", "x, m", "y", "z", "Ixx, kg m²", "Iyy", "Izz", "Iyz", "Izx", "Ixy", "from nominal"]
            .map(|head| format!("<th class=\"right\" scope=\"col\">{head}</th>"))
            .concat();
    format!(
        "<h2>Full parameters <span class=\"tag\">{NOT_IDENTIFIED}</span></h2>\n<p class=\"soft\">{}. Centre of mass in the link's \
         frame, tensor about it.</p>\n<div class=\"scroll\"><table class=\"tight\"><thead><tr><th></th>{heads}</tr></thead>\n<tbody>\n{rows}\
         </tbody></table></div>\n",
        escape(&report.full_note)
    )
}

fn channels(channels: &[ChannelRow]) -> String {
    let rows: String = channels
        .iter()
        .map(|row| {
            let figure = |v: f64| format!("<td class=\"right\">{}</td>", number(&significant(v, 3)));
            let share = 100.0 * row.residual_rms / row.measured_rms;
            let share = if share.is_finite() { format!("{share:.1} %") } else { String::new() };
            let colour = row.colour.map_or_else(|| "not told from white".to_owned(), |factor| format!("slow part × {factor:.1}"));
            format!(
                "<tr><th scope=\"row\">{}</th>{}{}{}<td>{}</td><td class=\"right\">{share}</td><td>{colour}</td></tr>\n",
                escape(&row.name),
                figure(row.residual_rms),
                figure(row.sigma),
                figure(row.measured_rms),
                escape(&unit_symbol(&row.unit)),
            )
        })
        .collect();
    let heads: String = ["residual, rms", "expected", "measured, rms"]
        .map(|head| format!("<th class=\"right\" scope=\"col\">{head}</th>"))
        .concat();
    format!(
        "<div class=\"scroll\"><table class=\"short\"><thead><tr><th></th>{heads}<th scope=\"col\">unit</th><th class=\"right\" \
         scope=\"col\">share</th><th scope=\"col\">noise</th></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
    )
}
