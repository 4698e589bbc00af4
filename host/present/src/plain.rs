//! An answer as text for a terminal.

use super::data::Quantity;
use super::quantities::{self, Group, headline};
use super::table::{aligned, head, principal, printable, row};
use crate::sentences::{nearest_words, time_base_words};
use rigident_fit::figures::{NOT_IDENTIFIED, significant, unit_symbol};
use rigident_identify::answer::Answer;
use rigident_identify::answer::result::{
    Complete, CompleteDrive, CompleteTerm, Consistency, StandardParameters, Tracking,
};
use rigident_model::base::names::legend;

/// The note about the numbers that must not be used.
pub(super) const UNUSABLE: &str = "The recording cannot be true, so nothing of it is identified. \
                                   `fit` of the JSON object has the numbers of the fit, which must \
                                   not be used but help to find the fault.";

/// Returns the answer as lines of text, one group after another, columns aligned, with a final newline.
pub fn text(answer: &Answer) -> String {
    let mut text = format!("{}\n", printable(&headline(answer)));
    line(&mut text, "error: ", answer.error.iter());
    if let (Some(model), Some(situation)) = (&answer.model, quantities::situation(answer)) {
        text.push_str(&format!("{}: {situation}\n", printable(&model.name)));
    }
    let groups = quantities::by_owner(answer);
    if quantities::is_body(answer) {
        let (own, offsets) = groups.split_at(groups.len().min(1));
        own.iter().for_each(|g| group(&mut text, g));
        let (about, there) = quantities::of_the_body(answer);
        about.iter().filter(|_| !answer.is_contradicted()).for_each(|g| group(&mut text, g));
        principal(&mut text, &quantities::principal(answer));
        there.iter().for_each(|g| group(&mut text, g));
        offsets.iter().for_each(|g| group(&mut text, g));
    } else {
        groups.iter().for_each(|g| group(&mut text, g));
        if let Some((inside, all)) = quantities::inside(answer) {
            text.push_str(&format!(
                "\n{inside} of {all} identified parameters have the truth in their interval\n"
            ));
        }
    }
    if let Some(legend) = legend(answer.parameters.iter().map(|p| p.name.as_str())) {
        text.push_str(&format!("\n{legend}\n"));
    }
    answer.standard_parameters.iter().for_each(|found| standard_parameters(&mut text, found));
    answer.complete.iter().for_each(|found| drives(&mut text, found));
    super::budget::text(&mut text, answer);
    text.push('\n');
    if answer.fit.is_some() {
        text.push_str(&format!("{UNUSABLE}\n"));
    }
    quality(&mut text, answer);
    for base in answer.time_base.iter().flat_map(time_base_words) {
        line(&mut text, "time base: ", [&base]);
    }
    line(&mut text, "known beforehand: ", answer.known.iter().map(|k| &k.text));
    line(&mut text, "note: ", &answer.notes);
    line(&mut text, "warning: ", &answer.warnings);
    line(&mut text, "to identify more: ", &answer.advice);
    answer.tracking.iter().for_each(|t| tracking(&mut text, t));
    text
}

fn line<'a>(text: &mut String, label: &str, lines: impl IntoIterator<Item = &'a String>) {
    for line in lines {
        text.push_str(&format!("{label}{}\n", printable(line)));
    }
}

fn group(text: &mut String, group: &Group) {
    if group.quantities.is_empty() {
        return;
    }
    let with_truth = |q: &Quantity| q.known().is_some() && q.truth.is_some();
    let mut rows = vec![head(group.quantities.iter().any(with_truth))];
    rows.extend(group.quantities.iter().map(row));
    text.push_str(&format!("\n{}\n", printable(&group.title)));
    let table = aligned(&rows);
    let made_of =
        std::iter::once("").chain(group.made_of.iter().map(String::as_str)).chain(std::iter::repeat(""));
    let width = table.lines().map(|l| l.chars().count()).max().unwrap_or(0);
    for (line, made_of) in table.lines().zip(made_of) {
        match made_of {
            "" => text.push_str(line),
            made_of => text.push_str(&format!("{line:<width$}   (with {})", printable(made_of))),
        }
        text.push('\n');
    }
}

fn standard_parameters(text: &mut String, found: &StandardParameters) {
    text.push_str(&format!("\n{}\n", found.note));
    let width = found.links.iter().map(|l| l.name.chars().count()).max().unwrap_or(0);
    let list = |v: &[f64]| v.iter().map(|x| significant(*x, 4)).collect::<Vec<_>>().join(" ");
    for link in &found.links {
        text.push_str(&format!(
            "  {:<width$}  {} kg, centre of mass [{}] m, tensor about it [{}] {}\n",
            printable(&link.name),
            significant(link.mass_kg, 4),
            list(&link.com_m),
            list(&link.inertia_com_kgm2),
            unit_symbol("kg m2")
        ));
    }
    text.push_str(&format!(
        "  their base parameters are {:.2} standard deviations from those identified\n",
        found.distance_sd
    ));
}

fn drives(text: &mut String, found: &Complete) {
    if found.drives.is_empty() {
        return;
    }
    text.push_str("\nDrives beside these links, to predict with\n");
    let width = found.drives.iter().map(|drive| drive.name.chars().count()).max().unwrap_or(0);
    for drive in &found.drives {
        text.push_str(&format!("  {:<width$}  {}\n", printable(&drive.name), drive_words(drive)));
    }
}

/// Returns a drive's parameters in words; what is not identified by itself is said.
pub(super) fn drive_words(drive: &CompleteDrive) -> String {
    let of = |term: &CompleteTerm| {
        let state = match (term.identified, term.together_with.is_empty()) {
            (true, _) => String::new(),
            (false, true) => format!(" ({NOT_IDENTIFIED})"),
            (false, false) => format!(" (only together, {})", term.together_with.join(", ")),
        };
        let unit = if term.unit == "1" { String::new() } else { format!(" {}", unit_symbol(&term.unit)) };
        let value = term.value.map_or_else(|| "–".to_owned(), |value| significant(value, 4) + &unit);
        format!("{} {value}{state}", term.term)
    };
    drive.terms.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// Returns the judgement of physical consistency in words.
pub(super) fn consistency(answer: &Answer) -> String {
    match (answer.physically_consistent, &answer.consistency) {
        (Some(true), _) => "yes".to_owned(),
        (Some(false), _) if quantities::is_body(answer) => {
            "NO: no rigid body has these parameters".to_owned()
        }
        (Some(false), Some(Consistency { distance_sd, .. })) => {
            format!("NO: the nearest bodies are {distance_sd:.1} standard deviations away")
        }
        (Some(false), None) => "NO: no bodies have these parameters".to_owned(),
        (None, _) => "unknown".to_owned(),
    }
}

fn quality(text: &mut String, answer: &Answer) {
    if let Some(condition) = answer.condition_number {
        text.push_str(&format!("condition number       {}\n", significant(condition, 3)));
    }
    if !answer.is_contradicted() {
        text.push_str(&format!("physically consistent  {}\n", consistency(answer)));
    }
    if let Some((distance, body)) = nearest(answer) {
        text.push_str(&format!("nearest body           {}\n", nearest_words(&body, distance)));
    }
    if quantities::is_body(answer) {
        return;
    }
    for channel in &answer.channels {
        if let (Some(residual), Some(measured)) = (channel.residual_rms, channel.measured_rms) {
            text.push_str(&format!(
                "residual {}: {} of {} rms\n",
                printable(&channel.name),
                significant(residual, 3),
                significant(measured, 3)
            ));
        }
    }
}

/// Returns the nearest body and its distance, standard deviations.
pub(super) fn nearest(answer: &Answer) -> Option<(f64, rigident_identify::answer::result::NearestBody)> {
    let found = answer.consistency.as_ref()?;
    Some((found.distance_sd, found.nearest_body?))
}

fn tracking(text: &mut String, t: &Tracking) {
    let milli = |v: [f64; 3]| v.map(|v| 1e3 * v);
    let row = |position: [f64; 3], attitude: [f64; 3]| {
        let ([x, y, z], [rx, ry, rz]) = (milli(position), milli(attitude));
        format!("  x {x:.3}, y {y:.3}, z {z:.3} mm; about x {rx:.3}, y {ry:.3}, z {rz:.3} mrad\n")
    };
    text.push_str(&format!("\nPlatform, measured less commanded, RMS of {} samples:\n", t.samples));
    text.push_str(&row(t.rms_m, t.rms_rad));
    text.push_str(&format!("  it came {:.1} ms late; without that:\n", 1e3 * t.delay_s));
    text.push_str(&row(t.rms_without_delay_m, t.rms_without_delay_rad));
}
