//! LabVIEW measurement files, after NI's *Specification for the LabVIEW Measurement File*: a header of keys,
//! a header of channels, then rows.

use super::clock::{Stamp, Survey};
use super::layout::{Layout, Steps};
use super::rows::{Rows, Separator};

const MARK: &str = "LabVIEW Measurement";
/// Steps of channels are equal within this share, and their beginnings within this share of a step.
const SAME_STEP: f64 = 1e-9;
const SAME_BEGIN: f64 = 1e-3;
const END: &str = "***End_of_Header***";

/// Returns the layout of a text that is such a file; `None` if it is none.
pub(super) fn find(text: &str, line: u64) -> Option<Result<Layout, String>> {
    text.starts_with(MARK).then(|| layout(text, line))
}

/// Times of the channels, as the header of channels states them.
#[derive(Default)]
struct Times {
    date: Vec<String>,
    clock: Vec<String>,
    x0: Vec<Option<f64>>,
    delta: Vec<Option<f64>>,
}

impl Times {
    /// Returns when a channel begins, s; `None` where the header does not say.
    fn begin_s(&self, k: usize) -> Option<f64> {
        let of = |all: &[String]| all.get(k).map_or("", |text| text.trim()).to_owned();
        let clock = of(&self.clock);
        let stamp =
            if clock.is_empty() { None } else { Stamp::parse(&format!("{} {clock}", of(&self.date))) };
        let since = stamp.and_then(|stamp| {
            let mut survey = Survey::default();
            survey.see(&stamp);
            survey.clock().ok()?.0.ns(&stamp)
        });
        let x0 = self.x0.get(k).copied().flatten()?;
        Some(since.unwrap_or(0) as f64 * 1e-9 + x0)
    }

    /// Refuses channels that are not at the same times.
    fn agree(&self, names: &[String]) -> Result<(), String> {
        let step = |k: usize| self.delta.get(k).copied().flatten();
        let (Some(first), Some(begin)) = (step(0), self.begin_s(0)) else { return Ok(()) };
        let name = |k: usize| names.get(k + 1).map_or("", String::as_str);
        for k in 1..self.x0.len().min(self.delta.len()) {
            let (Some(own), Some(at)) = (step(k), self.begin_s(k)) else { continue };
            let later = at - begin;
            if (own - first).abs() > SAME_STEP * first.abs() || later.abs() > SAME_BEGIN * first.abs() + 1e-6
            {
                return Err(format!(
                    "its channels are not at the same times: {} begins {later:.6} s after {}, with steps of \
                     {own} s and {first} s; save those of one device to a file of their own, and list the \
                     files as [[stream]] in a rig file",
                    name(k),
                    name(0)
                ));
            }
        }
        Ok(())
    }
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
    let mut units = Vec::new();
    let mut times = Times::default();
    let mut ends = 0;
    while ends < 2 {
        let from = rows.place().0;
        rows.next(&mut cells).ok_or_else(cut_off)?;
        let value = |k: usize| cells.get(k).map_or("", |cell| cell.as_ref());
        let number = |cell: &str| cell.replace(',', ".").parse::<f64>().ok().filter(|v| v.is_finite());
        let numbers = || cells.iter().skip(1).map(|cell| number(cell)).collect();
        let texts = || cells.iter().skip(1).map(|cell| cell.to_string()).collect();
        match value(0) {
            END => ends += 1,
            "Y_Unit_Label" => units = texts(),
            "X0" => times.x0 = numbers(),
            "Delta_X" => times.delta = numbers(),
            // Those of the channels, not of the file.
            "Date" if ends > 0 => times.date = texts(),
            "Time" if ends > 0 => times.clock = texts(),
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
    times.agree(&names)?;
    // The first column is the times, of which no unit is written: they are seconds. Without them it is empty.
    let unit =
        |k: usize| k.checked_sub(1).and_then(|k| units.get(k)).filter(|unit: &&String| !unit.is_empty());
    let mut all: Vec<Option<String>> = (0..names.len()).map(|k| unit(k).cloned()).collect();
    all.iter_mut().take(1).for_each(|unit| *unit = Some("s".to_owned()));
    let steps = if is_one {
        None
    } else {
        let none = || "it has no times: its header has no X0 and Delta_X".to_owned();
        let first = |all: &[Option<f64>]| all.first().copied().flatten();
        let start_s = first(&times.x0).ok_or_else(none)?;
        let step_s = first(&times.delta).filter(|step| *step > 0.0).ok_or_else(none)?;
        Some(Steps { start_s, step_s, column: Some(0), counter: None })
    };
    let mut layout = Layout::new(Separator::One(separator), names, all, preamble, place);
    (layout.comma, layout.may_be_short, layout.steps) = (comma, true, steps);
    layout.program = Some("LabVIEW");
    Ok(layout)
}
