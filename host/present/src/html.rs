//! The page of an answer: one for every kind of body. Well-formed XML as well as HTML; no script, nothing
//! loaded.

use super::data::Along;
use super::figures;
use super::page::{
    CONVERGENCE_NOTE, END, beginning, beside_words, decisions, escape, fact, notes, number, parts, principal,
    section, symbol, table_or_nothing, tensor_rows, truth_cells, value_cells,
};
use super::plain::{UNUSABLE, consistency, drive_words, nearest};
use super::quantities::{self, Group, headline, is_body};
use super::series::Series;
use crate::sentences::{nearest_words, time_base_words};
use rigident_fit::figures::{NOT_IDENTIFIED, count, duration, significant, unit_symbol};
use rigident_identify::answer::Answer;
use rigident_identify::answer::result::{Channel, Complete, CompleteDrive, StandardParameters, Status};
use rigident_model::base::names::legend;

/// Returns the whole report as one self-contained HTML file.
pub fn report(answer: &Answer, series: &Series) -> String {
    let mut html = beginning(&title(answer));
    html.push_str(&header(answer));
    html.push_str(&remarks(answer));
    if is_body(answer) {
        html.push_str(&cards(answer));
    }
    answer.person.iter().for_each(|found| html.push_str(&super::person::html(found)));
    html.push_str(&results(answer, series));
    answer.standard_parameters.iter().for_each(|found| html.push_str(&standard_parameters(found)));
    answer.complete.iter().for_each(|found| html.push_str(&drives(found)));
    html.push_str(&super::budget::html(answer));
    html.push_str(&residual_table(&answer.channels));
    html.push_str(&plots(answer, series));
    if let Some(drift) = quantities::drift(answer) {
        let elapsed = escape(&duration(drift.elapsed_s));
        html.push_str(&format!("<h2>Drift check after {elapsed}</h2>\n{}", figures::drift(&drift)));
    }
    html.push_str(&decisions(&series.decisions));
    html.push_str(&provenance(answer, series));
    html.push_str(&footer(answer));
    html.push_str(END);
    html
}

/// Returns the name of what was identified.
fn title(answer: &Answer) -> String {
    if let Some(person) = &answer.person {
        return super::person::title(person);
    }
    let of_model = answer.model.as_ref().map(|m| m.name.as_str());
    let of_body = answer.body_frame.as_ref().map(|b| b.name.as_str());
    let named = [of_model, of_body].into_iter().flatten().find(|name| !name.trim().is_empty());
    named.unwrap_or(if answer.model.is_some() { "Tree of links" } else { "Body without a name" }).to_owned()
}

fn header(answer: &Answer) -> String {
    let class = match (answer.status, answer.physically_consistent) {
        (Status::Identified, Some(false)) | (Status::PartlyIdentified, _) => "fair",
        // The whole mass is asked for; who looks for segments finds none.
        (Status::Identified, _)
            if answer.person.as_ref().is_some_and(|p| !super::person::tells_segments(p)) =>
        {
            "fair"
        }
        (Status::Identified, _) => "good",
        (Status::NotIdentified | Status::Implausible | Status::Failed, _) => "bad",
    };
    let mut words = headline(answer);
    if answer.status == Status::Identified && answer.physically_consistent == Some(false) {
        words.push_str(", but no rigid body has these parameters");
    }
    let situation = quantities::situation(answer)
        .map_or_else(String::new, |s| format!("<p class=\"soft\">{}.</p>\n", escape(&s)));
    format!(
        "<header><h1>{}</h1>\n{}<p class=\"status {class}\">{}</p>\n{situation}</header>\n",
        escape(&title(answer)),
        source(answer),
        escape(&words)
    )
}

fn source(answer: &Answer) -> String {
    let from = &answer.source;
    let mut parts = Vec::new();
    if !from.recording.is_empty() {
        parts.push(escape(&from.recording));
    }
    parts.push(match from.mcu.as_str() {
        "inproc" => "firmware in process".to_owned(),
        "qemu" => "firmware on the emulated Cortex-M4F".to_owned(),
        "host" | "" => "batch on the host".to_owned(),
        port => format!("firmware at {}", escape(port)),
    });
    parts.push(format!("{} rows", count(from.rows)));
    parts.extend(from.rate_hz.map(|rate| format!("{} Hz", significant(rate, 6))));
    parts.push(from.duration_s.map_or("still poses".to_owned(), duration));
    if !answer.date.is_empty() {
        parts.push(escape(&answer.date));
    }
    let parts: String = parts.iter().map(|part| format!("<span>{part}</span>")).collect();
    format!("<p class=\"source\">{parts}</p>\n")
}

/// Returns the boxes above the numbers: what failed, what to act on, what to know.
fn remarks(answer: &Answer) -> String {
    let error: Vec<String> = answer.error.iter().cloned().collect();
    let base = answer.time_base.as_ref().map(time_base_words).unwrap_or_default();
    let known: Vec<String> = answer.known.iter().map(|k| k.text.clone()).collect();
    [
        boxed("bad", "Failed", &error),
        notes("Warnings", &answer.warnings),
        boxed("plain", "Notes", &answer.notes),
        boxed("plain", "Common time base", &base),
        boxed("plain", "Known beforehand", &known),
        // Nobody moves a person's every segment to 10 % of its own: the table beside the segments says what
        // is determined.
        if answer.person.is_some() {
            String::new()
        } else {
            boxed("plain", "What would identify the rest", &answer.advice)
        },
    ]
    .concat()
}

/// Returns a list in a box of its own colour.
fn boxed(class: &str, title: &str, lines: &[String]) -> String {
    notes(title, lines).replacen("class=\"box\"", &format!("class=\"box {class}\""), 1)
}

fn cards(answer: &Answer) -> String {
    let missing = quantities::missing(answer);
    let mass = quantities::parameters(answer).into_iter().next().and_then(|q| q.known().map(|m| (q, m)));
    let mass = match mass {
        Some((quantity, m)) => {
            let (value, u95) = parts(m.value, m.u95);
            let beside = beside_words(&quantity, m.u95);
            let beside = if beside.is_empty() { beside } else { format!("<p class=\"soft\">{beside}</p>\n") };
            format!("<p class=\"big\">{value} <small>± {u95} kg</small></p>\n{beside}")
        }
        None => format!("<p class=\"big none\">{missing}</p>\n"),
    };
    let centre: String = quantities::centre_of_mass(answer)
        .iter()
        .map(|q| {
            let beside = q.known().map_or(String::new(), |m| beside_words(q, m.u95));
            let (name, cells) = (escape(&q.name), value_cells(q));
            format!("<tr><th scope=\"row\">{name}</th>{cells}<td class=\"soft\">{beside}</td></tr>\n")
        })
        .collect();
    let tensor = quantities::inertia_com(answer);
    let tensor =
        if tensor.iter().any(|q| q.known().is_some()) { tensor_rows(&tensor) } else { String::new() };
    let card = |title: &str, content: &str| {
        format!("<section class=\"card\"><h3>{title}</h3>\n{content}</section>\n")
    };
    format!(
        "<div class=\"cards\">\n{}{}{}</div>\n",
        card("Mass", &mass),
        card("Centre of mass in S, m", &table_or_nothing("xyz", &centre, missing)),
        card("Inertia about the centre of mass, kg m²", &table_or_nothing("tensor", &tensor, missing))
    )
}

fn results(answer: &Answer, series: &Series) -> String {
    let groups = quantities::by_owner(answer);
    let mut tables = String::new();
    let mut note = String::new();
    if is_body(answer) {
        let (own, rest) = groups.split_at(groups.len().min(1));
        let (about, there) = quantities::of_the_body(answer);
        let about = about.filter(|_| !answer.is_contradicted());
        let all = own.iter().chain(&about).chain(&there).chain(rest);
        tables.extend(all.map(|g| table(g, false)));
        tables.push_str(&principal(&quantities::principal(answer)));
    } else {
        tables.extend(groups.iter().map(|g| table(g, true)));
        if answer.model.is_some() {
            note = "<p class=\"soft\">All that rows of this kind can tell apart, in the axes of each link \
                    and about its origin. Each is a combination, named beside it.</p>\n"
                .to_owned();
        }
    }
    tables.push_str(&quality(answer, series));
    if answer.fit.is_some() {
        note.push_str(&format!("<p>{UNUSABLE}</p>\n"));
    }
    format!("<h2>Results</h2>\n{note}<div class=\"tables\">\n{tables}</div>\n")
}

/// Returns the name of a quantity under the caption of its owner.
fn own_name(group: &Group, name: &str) -> String {
    let own = name.strip_prefix(group.title.as_str()).and_then(|rest| rest.strip_prefix('.'));
    symbol(own.unwrap_or(name))
}

/// Characters that fit beside the numbers of a table that takes half the page.
const BESIDE: usize = 6;

fn table(group: &Group, with_made_of: bool) -> String {
    if group.quantities.is_empty() {
        return String::new();
    }
    let with_truth = group.quantities.iter().any(|q| q.known().is_some() && q.truth.is_some());
    let made_of = |k: usize| group.made_of.get(k).map_or("", String::as_str);
    let with_made_of = with_made_of && (0..group.quantities.len()).any(|k| !made_of(k).is_empty());
    let mut heads = String::new();
    if with_truth {
        heads.push_str(
            "<th class=\"right\" scope=\"col\">truth</th><th class=\"right\" \
                        scope=\"col\">deviation</th><th></th>",
        );
    }
    if with_made_of {
        heads.push_str("<th scope=\"col\">with</th>");
    }
    let row = |k: usize| {
        let quantity = &group.quantities[k];
        let mut cells = match quantity.known() {
            None => format!(
                "<td class=\"none\" colspan=\"{}\">{}</td>",
                if with_truth { 6 } else { 3 },
                quantity.missing()
            ),
            Some(m) => {
                let truth = if with_truth { truth_cells(quantity, m.u95) } else { String::new() };
                format!("{}<td>{}</td>{truth}", value_cells(quantity), escape(&unit_symbol(&quantity.unit)))
            }
        };
        if with_made_of {
            cells.push_str(&format!("<td class=\"soft made\">{}</td>", escape(made_of(k))));
        }
        format!("<tr><th scope=\"row\">{}</th>{cells}</tr>\n", own_name(group, &quantity.name))
    };
    // Half a page holds the numbers and a word beside them.
    let long = with_made_of && (0..group.quantities.len()).any(|k| made_of(k).chars().count() > BESIDE);
    let place = if long { "scroll whole" } else { "scroll" };
    format!(
        "<div class=\"{place}\"><table class=\"{}\"><caption>{}</caption>\n<thead><tr><th></th><th \
         class=\"value\" scope=\"col\">estimate</th><th scope=\"col\">± U95</th><th \
         scope=\"col\">unit</th>{heads}</tr></thead>\n<tbody>\n{}</tbody></table></div>\n",
        if with_truth { "full" } else { "short" },
        escape(&group.title),
        (0..group.quantities.len()).map(row).collect::<String>()
    )
}

fn quality(answer: &Answer, series: &Series) -> String {
    let mut rejected = count(answer.rejected_rows);
    let reasons: Vec<String> = series
        .rejected
        .iter()
        .filter(|(_, number)| *number > 0)
        .map(|(reason, number)| format!("{} {}", count(*number), escape(reason)))
        .collect();
    if !reasons.is_empty() {
        rejected.push_str(&format!(": {}", reasons.join(", ")));
    }
    let mut rows =
        fact("rows", &format!("{} for {} unknowns", count(answer.counts.rows), answer.parameters.len()));
    rows.push_str(&fact("rejected samples", &rejected));
    if let Some(condition) = answer.condition_number {
        rows.push_str(&fact("condition number", &number(&significant(condition, 3))));
    }
    let words = consistency(answer);
    let words = match answer.physically_consistent {
        Some(false) => format!("<span class=\"none\">{}</span>", escape(&words)),
        _ => escape(&words),
    };
    if !answer.is_contradicted() {
        rows.push_str(&fact("physically consistent", &words));
    }
    if let Some((distance, body)) = nearest(answer) {
        rows.push_str(&fact("nearest body", &escape(&nearest_words(&body, distance))));
    }
    if let Some((inside, all)) = quantities::inside(answer) {
        rows.push_str(&fact("truth in its interval", &format!("{inside} of {all} parameters")));
    }
    format!("<table class=\"plainrows\"><caption>Quality</caption>\n<tbody>{rows}</tbody></table>\n")
}

fn standard_parameters(found: &StandardParameters) -> String {
    let figure = |v: f64| format!("<td class=\"right\">{}</td>", number(&significant(v, 4)));
    let rows: String = found
        .links
        .iter()
        .map(|link| {
            let numbers = [link.mass_kg].into_iter().chain(link.com_m).chain(link.inertia_com_kgm2);
            let cells: String = numbers.map(figure).collect();
            let far = link.distance_from_nominal.map_or_else(String::new, |d| number(&significant(d, 2)));
            format!(
                "<tr><th scope=\"row\">{}</th>{cells}<td class=\"right\">{far}</td></tr>\n",
                escape(&link.name)
            )
        })
        .collect();
    let heads: String =
        ["mass, kg", "x, m", "y", "z", "Ixx, kg m²", "Iyy", "Izz", "Iyz", "Izx", "Ixy", "from nominal"]
            .map(|head| format!("<th class=\"right\" scope=\"col\">{head}</th>"))
            .concat();
    format!(
        "<h2>Standard parameters <span class=\"tag\">{NOT_IDENTIFIED}</span></h2>\n<p class=\"soft\">{}. \
         Centre of mass in the link's frame, tensor about it. Their base parameters are {:.2} standard \
         deviations from those identified.</p>\n\
         <div class=\"scroll\"><table \
         class=\"tight\"><thead><tr><th></th>{heads}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n",
        escape(&found.note),
        found.distance_sd
    )
}

fn drives(found: &Complete) -> String {
    if found.drives.is_empty() {
        return String::new();
    }
    let row = |drive: &CompleteDrive| {
        let words = escape(&drive_words(drive));
        format!("<tr><th scope=\"row\">{}</th><td>{words}</td></tr>\n", escape(&drive.name))
    };
    let rows: String = found.drives.iter().map(row).collect();
    format!(
        "<h2>Drives</h2>\n<p class=\"soft\">Beside these links, to predict with.</p>\n<div \
         class=\"scroll\"><table class=\"tight\">\n\
         <tbody>\n{rows}</tbody></table></div>\n"
    )
}

fn residual_table(channels: &[Channel]) -> String {
    if channels.iter().all(|c| c.residual_rms.is_none()) {
        return String::new();
    }
    let figure = |v: Option<f64>| {
        format!("<td class=\"right\">{}</td>", v.map_or_else(String::new, |v| number(&significant(v, 3))))
    };
    let rows: String = channels
        .iter()
        .map(|c| {
            let share =
                c.residual_rms.zip(c.measured_rms).map(|(residual, measured)| 100.0 * residual / measured);
            let share = share.filter(|s| s.is_finite()).map_or_else(String::new, |s| format!("{s:.1} %"));
            let noise = c.autocorrelation.map_or_else(
                || "white".to_owned(),
                |factor| {
                    format!(
                        "slow part × \
                    {factor:.1}"
                    )
                },
            );
            format!(
                "<tr><th scope=\"row\">{}</th>{}{}<td>{}</td><td class=\"right\">{share}</td>{}<td \
                 class=\"right\">{}</td><td>{noise}</td></tr>\n",
                symbol(&c.name),
                figure(c.residual_rms),
                figure(c.measured_rms),
                escape(&unit_symbol(&c.unit)),
                figure(c.sigma),
                count(c.outliers)
            )
        })
        .collect();
    let right = |head: &str| format!("<th class=\"right\" scope=\"col\">{head}</th>");
    format!(
        "<h2>Residuals by channel</h2>\n<p class=\"soft\">Root mean squares after the filter; σ is that of \
         one sample before it.</p>\n<div class=\"scroll\"><table class=\"short\"><thead><tr><th></th>{}{}<th \
         scope=\"col\">unit</th>{}{}{}<th \
         scope=\"col\">noise</th></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n",
        right("residual"),
        right("measured"),
        right("share"),
        right("σ"),
        right("outliers")
    )
}

fn plots(answer: &Answer, series: &Series) -> String {
    let time = figures::time_axis(series);
    let mut html = String::new();
    let dotted =
        if series.stages.is_empty() { "" } else { " Dotted lines separate the stages of the experiment." };
    let poses = series.along == Along::Poses;
    let residual_note = if poses {
        "Measurement less what the answer predicts, pose by pose."
    } else {
        "Filtered measurement less what the answer predicts; every drawn interval shows its smallest and \
         largest value."
    };
    let own = quantities::parameters(answer);
    if !series.convergence.is_empty() {
        let shown = figures::convergence(&own, series, &time);
        section(&mut html, "grid", "Convergence", &format!("{CONVERGENCE_NOTE}{dotted}"), &shown);
    }
    section(&mut html, "grid", "Residuals", residual_note, &figures::residuals(series, &time));
    let motion = if poses { "Still poses" } else { "Motion" };
    section(&mut html, "wide", motion, "", &figures::motion(series, &time));
    html
}

fn provenance(answer: &Answer, series: &Series) -> String {
    let mut rows: String =
        series.provenance.iter().map(|(label, value)| fact(label, &escape(value))).collect();
    if !answer.schema.is_empty() {
        rows.push_str(&fact("schema of result.json", &escape(&answer.schema)));
    }
    format!("<h2>Provenance</h2>\n<table class=\"plainrows\"><tbody>{rows}</tbody></table>\n")
}

fn footer(answer: &Answer) -> String {
    let frames = if is_body(answer) {
        "S is the wrench sensor's frame. Products of inertia are tensor elements: I<sub>xy</sub> \
         = \u{2212}\u{222b} x y dm."
            .to_owned()
    } else {
        let names = answer.parameters.iter().map(|p| p.name.as_str());
        legend(names).map_or_else(String::new, |legend| escape(&legend))
    };
    format!(
        "<footer><p>{frames}</p>\n<p>\u{b1} is the 95 % expanded uncertainty U95; \u{3c3} = U95 / 1.96. The \
         deviation is estimate minus truth. In the small diagrams the bar is the interval, the upright line \
         the truth.</p></footer>\n"
    )
}
