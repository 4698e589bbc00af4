//! LabVIEW measurement files, after NI's *Specification for the LabVIEW Measurement File*: a header of keys,
//! a header of channels, then rows.

use super::layout::{Layout, Steps};
use super::rows::{Rows, Separator};

const MARK: &str = "LabVIEW Measurement";
const END: &str = "***End_of_Header***";

/// Returns the layout of a text that is such a file; `None` if it is none.
pub(super) fn find(text: &str, line: u64) -> Option<Result<Layout, String>> {
    text.starts_with(MARK).then(|| layout(text, line))
}

fn layout(text: &str, line: u64) -> Result<Layout, String> {
    let cut_off = || "as a LabVIEW measurement file it is cut off: its header has no end".to_owned();
    let key = |name: &str| {
        let own = |line: &str| {
            let rest = line.strip_prefix(name)?;
            let (separator, value) = (rest.chars().next()?, rest.get(1..)?);
            matches!(separator, '\t' | ',' | ';').then(|| value.trim_end_matches(['\t', ' ']).to_owned())
        };
        text.lines().take_while(|line| !line.starts_with(END)).find_map(own)
    };
    let separator = match key("Separator").as_deref() {
        Some("Comma") => b',',
        Some("Semicolon") => b';',
        _ => b'\t',
    };
    let comma = key("Decimal_Separator").map(|mark| mark.trim_matches('"') == ",");
    let x_columns = key("X_Columns").unwrap_or_else(|| "One".to_owned());
    let mut rows = Rows::new(text, line, Separator::One(separator));
    let (mut cells, mut preamble) = (Vec::new(), Vec::new());
    let (mut units, mut x0, mut delta) = (Vec::new(), None, None);
    let mut ends = 0;
    while ends < 2 {
        let from = rows.place().0;
        rows.next(&mut cells).ok_or_else(cut_off)?;
        let value = |k: usize| cells.get(k).map_or("", |cell| cell.as_ref());
        let number = || {
            let plain = value(1).replace(',', ".");
            plain.parse::<f64>().ok().filter(|v| v.is_finite())
        };
        match value(0) {
            END => ends += 1,
            "Y_Unit_Label" => units = cells.iter().skip(1).map(|cell| cell.to_string()).collect(),
            "X0" => x0 = number(),
            "Delta_X" => delta = number(),
            _ => {}
        }
        let whole = text.get(from..rows.place().0).unwrap_or_default().trim();
        if !whole.starts_with("***") {
            preamble.push(whole.to_owned());
        }
    }
    rows.next(&mut cells).ok_or_else(cut_off)?;
    let names: Vec<String> = cells.iter().map(|cell| cell.to_string()).collect();
    let place = rows.place();
    if text.get(place.0..).is_some_and(|rest| rest.contains(END)) {
        return Err(
            "it holds several measurements, each with its own header: save each to a file of its own"
                .to_owned(),
        );
    }
    let is_one = x_columns.eq_ignore_ascii_case("One");
    if !is_one && !x_columns.eq_ignore_ascii_case("No") {
        return Err(format!(
            "it has X_Columns {x_columns}: write one column of times for all channels (X_Columns One)"
        ));
    }
    // The first column is the times, of which no unit is written: they are seconds. Without them it is empty.
    let unit =
        |k: usize| k.checked_sub(1).and_then(|k| units.get(k)).filter(|unit: &&String| !unit.is_empty());
    let mut all: Vec<Option<String>> = (0..names.len()).map(|k| unit(k).cloned()).collect();
    all.iter_mut().take(1).for_each(|unit| *unit = Some("s".to_owned()));
    let steps = if is_one {
        None
    } else {
        let none = || "it has no times: its header has no X0 and Delta_X".to_owned();
        let (start_s, step_s) = (x0.ok_or_else(none)?, delta.filter(|step| *step > 0.0).ok_or_else(none)?);
        Some(Steps { start_s, step_s, column: Some(0), counter: None })
    };
    let mut layout = Layout::new(Separator::One(separator), names, all, preamble, place);
    (layout.comma, layout.may_be_short, layout.steps) = (comma, true, steps);
    layout.program = Some("LabVIEW");
    Ok(layout)
}
