//! Layouts that programs of laboratories write and that their own words announce: each gives what its file
//! does not say in the table itself: a rate instead of times, counts instead of units, where the rows end.
//!
//! Sources: Universal Robots, *RTDE Guide* (names and units of outputs); Franka
//! Robotics, `libfranka`, `logToCSV` (names, time in ms); Xsens, *MT Low Level Communication
//! Protocol* (counters, units); Vicon, *Nexus User Guide*, ASCII export; Qualisys, *QTM User Manual*, TSV
//! export; ATI, *Net F/T Manual*, Java demonstration; HBK, *catman*, ASCII export.

use std::borrow::Cow;

use super::layout::{self, Counter, Layout, Steps};
use super::rows::{Rows, Separator, separator};
use crate::rig::{Quantity, Unit};

/// Lines in which a header is sought.
const MOST_LINES: usize = 200;
/// Rows of an export that are counted within one frame.
const MOST_WITHIN: usize = 10_000;
/// Name of the column of a time that is made.
const TIME: &str = "Time";

/// A line of a text: where it begins and ends, bytes, and its number.
#[derive(Clone, Copy, Debug)]
struct Line<'a> {
    from: usize,
    to: usize,
    number: u64,
    text: &'a str,
}

impl Line<'_> {
    fn is_blank(&self) -> bool {
        self.text.trim_matches([',', ';', '\t', ' ', '"', '\r']).is_empty()
    }

    /// Returns where the next line begins.
    fn after(&self) -> (usize, u64) {
        (self.to, self.number + 1)
    }

    fn cells(&self, separator: Separator) -> Vec<Cow<'_, str>> {
        let mut cells = Vec::new();
        Rows::new(self.text, self.number, separator).next(&mut cells);
        cells
    }
}

fn lines(text: &str, first: u64) -> impl Iterator<Item = Line<'_>> + Clone {
    let mut from = 0;
    text.split_inclusive('\n').zip(first..).map(move |(line, number)| {
        let start = from;
        from += line.len();
        Line { from: start, to: from, number, text: line.trim_end_matches(['\n', '\r']) }
    })
}

/// Returns the layout of a text that one of these programs wrote; `None` of any other.
pub(super) fn find(text: &str, line: u64) -> Option<Result<Layout, String>> {
    xsens(text, line)
        .or_else(|| vicon(text, line))
        .or_else(|| qualisys(text, line))
        .or_else(|| net_ft(text, line))
        .or_else(|| universal_robots(text, line))
        .or_else(|| franka(text, line))
        .or_else(|| catman(text, line))
}

/// Returns the number after the last colon, tab or comma of a line: `// Update Rate: 100.0Hz`.
fn number_in(line: &str) -> Option<f64> {
    let value = line.rsplit([':', '\t', ',', ';']).find(|part| part.chars().any(|c| c.is_ascii_digit()))?;
    let value = value.trim().trim_end_matches(|c: char| c.is_alphabetic() || c == '"' || c == ' ');
    value.trim_start_matches(['"', ' ']).parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0)
}

fn preamble(text: &str, to: usize) -> Vec<String> {
    let above = text.get(..to).unwrap_or_default().lines().map(str::trim);
    above.filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

/// Appends the column of a time that is made of a count.
fn with_time(mut layout: Layout, step_s: f64, counter: Option<Counter>) -> Layout {
    layout.names.push(TIME.to_owned());
    layout.units.push(Some("s".to_owned()));
    layout.steps = Some(Steps { start_s: 0.0, step_s, column: None, counter });
    layout
}

/// Xsens MT Manager and MTw: lines that begin with `//`, then a header. Its units are not in the file: those
/// of the device's messages, m/s² and rad/s.
fn xsens(text: &str, line: u64) -> Option<Result<Layout, String>> {
    let header =
        lines(text, line).take(MOST_LINES).find(|line| !line.is_blank() && !line.text.starts_with("//"))?;
    let separator = Separator::One(separator(header.text));
    let names: Vec<String> = header.cells(separator).iter().map(|cell| cell.to_string()).collect();
    let names: Vec<String> = names.into_iter().rev().skip_while(String::is_empty).collect();
    let names: Vec<String> = names.into_iter().rev().collect();
    let place = |name: &str| names.iter().position(|own| own == name);
    if place("PacketCounter").is_none() || place("Acc_X").is_none() {
        return None;
    }
    let mut first = Vec::new();
    let (from, number) = header.after();
    Rows::new(text.get(from..).unwrap_or_default(), number, separator).next(&mut first);
    let has_cell = |k: &usize| first.get(*k).is_some_and(|cell| cell.parse::<u64>().is_ok());
    let rate = lines(text, line)
        .take_while(|line| line.from < header.from)
        .find(|line| line.text.to_lowercase().contains("rate"))
        .and_then(|line| number_in(line.text));
    let clock = match (place("SampleTimeFine").filter(has_cell), rate) {
        (Some(column), _) => (1e-4, Counter { column, within: None, wraps_at: 1 << 32 }),
        (None, Some(rate)) => {
            let column = place("PacketCounter").unwrap_or(0);
            (1.0 / rate, Counter { column, within: None, wraps_at: 1 << 16 })
        }
        (None, None) => {
            return Some(Err(
                "it has no SampleTimeFine, and no line above its header says its rate: export it with \
                 SampleTimeFine"
                    .to_owned(),
            ));
        }
    };
    let unit = |name: &String| match name.as_str() {
        "Acc_X" | "Acc_Y" | "Acc_Z" => Some("m/s^2".to_owned()),
        "Gyr_X" | "Gyr_Y" | "Gyr_Z" => Some("rad/s".to_owned()),
        _ => None,
    };
    let units = names.iter().map(unit).collect();
    let mut layout = Layout::new(separator, names, units, preamble(text, header.from), header.after());
    layout.program = Some("Xsens MT Manager");
    layout.may_be_short = true;
    Some(Ok(with_time(layout, clock.0, Some(clock.1))))
}

/// Reads the layout of Vicon Nexus: sections, each with its name, its rate, groups, names and units. Forces
/// are in the section of devices.
fn vicon(text: &str, line: u64) -> Option<Result<Layout, String>> {
    const SECTIONS: [&str; 7] =
        ["Devices", "Model Outputs", "Trajectories", "Joints", "Segments", "Events", "EVENTS"];
    let bare = |line: &Line<'_>| line.text.trim_matches([',', ';', '\t', ' ', '"']).to_owned();
    let first = lines(text, line).find(|line| !line.is_blank())?;
    if !SECTIONS.contains(&bare(&first).as_str()) {
        return None;
    }
    let torn = |what: &str| Some(Err(format!("as an export of Vicon Nexus it is damaged: {what}")));
    let mut section = lines(text, line).skip_while(|line| bare(line) != "Devices");
    if section.next().is_none() {
        return Some(Err(
            "it is an export of Vicon Nexus without the section Devices: export devices too, or give the C3D \
             file"
                .to_owned(),
        ));
    }
    let Some(rate) = section.next().and_then(|line| bare(&line).parse::<f64>().ok()).filter(|r| *r > 0.0)
    else {
        return torn("the line after Devices is no rate");
    };
    let (Some(group), Some(header), Some(unit)) = (section.next(), section.next(), section.next()) else {
        return torn("names and units are missing");
    };
    let separator = Separator::One(separator(header.text));
    let cells = header.cells(separator);
    let width = cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
    if cells.first().map(Cow::as_ref) != Some("Frame") || width < 3 {
        return torn("the names do not begin with Frame");
    }
    let names = layout::names(&cells, Some(&group.cells(separator)), width);
    let units = layout::units(&unit.cells(separator), width);
    let end = section.clone().find(Line::is_blank).map_or(text.len(), |line| line.from);
    let frame = |line: &Line<'_>| line.cells(separator).first().map(|cell| cell.to_string());
    let mut rows = section.clone().take_while(|line| line.from < end).take(MOST_WITHIN);
    let one = rows.next().and_then(|line| frame(&line));
    let parts = 1 + rows.take_while(|line| frame(line) == one).count() as u64;
    let is_within = cells.get(1).is_some_and(|cell| cell == "Sub Frame");
    let within = is_within.then_some((1, parts));
    let step_s = 1.0 / rate;
    let mut layout = Layout::new(separator, names, units, preamble(text, header.from), unit.after());
    layout.program = Some("Vicon Nexus");
    layout.end = Some(end);
    layout.comma = matches!(separator, Separator::One(b',')).then_some(false);
    Some(Ok(with_time(layout, step_s, Some(Counter { column: 0, within, wraps_at: u64::MAX }))))
}

/// Qualisys Track Manager: keys with values, then rows with or without names. No unit is in the file.
fn qualisys(text: &str, line: u64) -> Option<Result<Layout, String>> {
    let first = lines(text, line).find(|line| !line.is_blank())?;
    if !first.text.starts_with("NO_OF_SAMPLES\t") && !first.text.starts_with("NO_OF_FRAMES\t") {
        return None;
    }
    let tab = Separator::One(b'\t');
    let (mut rate, mut listed, mut header, mut is_force) = (None, None, None, false);
    let mut rows = None;
    for line in lines(text, line).take(MOST_LINES).filter(|line| !line.is_blank()) {
        let cells = line.cells(tab);
        let key = cells.first().map_or("", Cow::as_ref);
        let rest = || cells.iter().skip(1).map(|cell| cell.to_string()).collect::<Vec<_>>();
        match key {
            "FREQUENCY" => rate = number_in(line.text),
            "MARKER_NAMES" => {
                return Some(Err("it holds trajectories of markers: export them as C3D, or TRC".to_owned()));
            }
            "CHANNEL_NAMES" => listed = Some(rest()),
            "FORCE_PLATE_NAME" => is_force = true,
            "SAMPLE" | "Force_X" => {
                header = Some(cells.iter().map(|cell| cell.to_string()).collect::<Vec<_>>());
            }
            _ if cells.len() > 2 && cells.iter().all(|c| c.is_empty() || layout::is_number(c)) => {
                rows = Some((line, cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |k| k + 1)));
                break;
            }
            _ => {}
        }
    }
    let Some((begin, width)) = rows else {
        return Some(Err("as an export of Qualisys it has no rows".to_owned()));
    };
    let plate = || {
        let of = |what: &str| ["X", "Y", "Z"].map(|axis| format!("{what}_{axis}"));
        [of("Force"), of("Moment"), of("COP")].concat()
    };
    let counted = |names: Vec<String>| match width.checked_sub(names.len()) {
        Some(2) => ["SAMPLE".to_owned(), "TIME".to_owned()].into_iter().chain(names).collect(),
        _ => names,
    };
    let names: Option<Vec<String>> = header
        .or_else(|| listed.map(counted))
        .or_else(|| is_force.then(|| counted(plate())))
        .map(|names| names.into_iter().take(width).collect());
    let Some(names) = names.filter(|names: &Vec<String>| names.len() == width) else {
        return Some(Err(format!(
            "as an export of Qualisys it has {width} columns and not as many names: export it with column \
             headers"
        )));
    };
    let units: Vec<_> = names.iter().map(|name| (name == "TIME").then(|| "s".to_owned())).collect();
    let has_time = names.iter().any(|name| name == "TIME");
    let mut layout = Layout::new(tab, names, units, preamble(text, begin.from), (begin.from, begin.number));
    layout.program = Some("Qualisys Track Manager");
    Some(match (has_time, rate) {
        (true, _) => Ok(layout),
        (false, Some(rate)) => Ok(with_time(layout, 1.0 / rate, None)),
        (false, None) => Err("it has neither times nor FREQUENCY: export it with column headers".to_owned()),
    })
}

/// Reads the layout of the demonstration of ATI's Net F/T: counts at a rate, with the number of counts in a
/// unit in its header.
fn net_ft(text: &str, line: u64) -> Option<Result<Layout, String>> {
    let named = |key: &str| {
        let own = lines(text, line).take(MOST_LINES).find(|line| line.text.contains(key))?;
        let (_, value) = own.text.split_once(key)?;
        number_in(value.split([',', ';']).next()?)
    };
    let (force, moment) = (named("Counts per Unit Force")?, named("Counts per Unit Torque")?);
    let header = lines(text, line).take(MOST_LINES).find(|line| line.text.contains("RDT Sequence"))?;
    let comma = Separator::One(b',');
    let names: Vec<String> = header.cells(comma).iter().map(|cell| cell.to_string()).collect();
    let counter = names.iter().position(|name| name == "RDT Sequence")?;
    let Some(rate) = named("RDT Sample Rate") else {
        return Some(Err(
            "it is a log of ATI's Net F/T without its RDT Sample Rate: write that line again".to_owned()
        ));
    };
    let (from, number) = header.after();
    let axis = |name: &String| match name.as_str() {
        "Fx" | "Fy" | "Fz" => Some(force),
        "Tx" | "Ty" | "Tz" => Some(moment),
        _ => None,
    };
    let mut counts: Vec<Option<f64>> = names.iter().map(axis).collect();
    let time = names.iter().position(|name| name == TIME);
    let (mut rows, mut cells) = (Rows::new(text.get(from..).unwrap_or_default(), number, comma), Vec::new());
    for _ in 0..MOST_LINES {
        if rows.next(&mut cells).is_none() {
            break;
        }
        let is_count =
            |(cell, counts): (&Cow<'_, str>, &Option<f64>)| counts.is_none() || cell.parse::<i64>().is_ok();
        // Other programs write the same lines above numbers in units: a count has no decimals.
        if !cells.iter().zip(&counts).all(is_count) {
            if time.is_some() {
                return None;
            }
            counts.clear();
            break;
        }
    }
    let none = vec![None; names.len()];
    let mut layout = Layout::new(comma, names, none, preamble(text, header.from), header.after());
    let counter = Some(Counter { column: counter, within: None, wraps_at: 1 << 32 });
    layout.program = Some("ATI Net F/T");
    layout.counts = counts;
    Some(Ok(match time {
        // The time of day there has whole seconds.
        Some(column) => {
            layout.units[column] = Some("s".to_owned());
            layout.steps = Some(Steps { start_s: 0.0, step_s: 1.0 / rate, column: Some(column), counter });
            layout
        }
        None => with_time(layout, 1.0 / rate, counter),
    }))
}

/// Recorders of Universal Robots' RTDE: names of outputs, the controller's time in s among them.
fn universal_robots(text: &str, line: u64) -> Option<Result<Layout, String>> {
    let header = lines(text, line).find(|line| !line.is_blank())?;
    let outputs = ["actual_q_0", "actual_TCP_force_0", "ft_raw_wrench_0"];
    if !header.text.contains("timestamp") || !outputs.iter().any(|name| header.text.contains(name)) {
        return None;
    }
    let has = |mark: char| header.text.contains(mark);
    let own = if has(',') || has(';') || has('\t') {
        Separator::One(separator(header.text))
    } else {
        Separator::Blanks
    };
    // numpy writes names as a comment.
    let bare = header.text.trim_start_matches(['#', ' ']);
    let (mut rows, mut cells) = (Rows::new(bare, header.number, own), Vec::new());
    rows.next(&mut cells)?;
    let names: Vec<String> = cells.iter().map(|cell| cell.to_string()).collect();
    let units = names.iter().map(|name| (name == "timestamp").then(|| "s".to_owned())).collect();
    let mut layout = Layout::new(own, names, units, Vec::new(), header.after());
    layout.program = Some("Universal Robots RTDE");
    layout.comma = (own != Separator::One(b';')).then_some(false);
    Some(Ok(layout))
}

/// Logs that libfranka writes: the robot's time is in ms.
fn franka(text: &str, line: u64) -> Option<Result<Layout, String>> {
    let header = lines(text, line).find(|line| !line.is_blank())?;
    if !header.text.contains("state.q[0]") || !header.text.contains("state.dq[0]") {
        return None;
    }
    let own = Separator::One(separator(header.text));
    let names: Vec<String> = header.cells(own).iter().map(|cell| cell.to_string()).collect();
    let units = names.iter().map(|name| (name == "time").then(|| "ms".to_owned())).collect();
    let mut layout = Layout::new(own, names, units, Vec::new(), header.after());
    layout.program = Some("libfranka");
    layout.comma = (own != Separator::One(b';')).then_some(false);
    Some(Ok(layout))
}

/// Reads the layout of HBK catman: names, units, then up to forty lines about the channels, then rows.
fn catman(text: &str, line: u64) -> Option<Result<Layout, String>> {
    let header = lines(text, line)
        .take(MOST_LINES)
        .find(|line| line.text.split(['\t', ';']).next().is_some_and(|cell| is_catman_time(cell.trim())))?;
    let separator = Separator::One(separator(header.text));
    let cells = header.cells(separator);
    let width = cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
    let names = layout::names(&cells, None, width);
    let (from, number) = header.after();
    let rest = text.get(from..).unwrap_or_default();
    let lines = layout::sample(rest, number, separator);
    let Some((start, _)) = layout::longest_run(&lines) else {
        return Some(Err("as an export of catman it has no rows".to_owned()));
    };
    let units = lines.iter().take(start).find(|line| line.cells.first().is_some_and(|c| is_second(c)));
    let units = layout::units(units.map_or(&[], |line| &line.cells), width);
    let begin = lines.get(start).map_or((0, number), |line| line.from);
    let mut layout =
        Layout::new(separator, names, units, preamble(text, header.from), (from + begin.0, begin.1));
    layout.program = Some("HBK catman");
    Some(Ok(layout))
}

/// Returns true for the name that catman gives to a column of times: `Time  1 - default sample rate`,
/// `Zeit  2 - Schnelle Messrate`; a unit may follow it.
pub(in crate::recording) fn is_catman_time(name: &str) -> bool {
    let word = ["Time", "Zeit", "Temps", "Tiempo", "Tempo"].iter().find_map(|word| name.strip_prefix(word));
    let digits = word.map(str::trim_start).filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    let rest = digits.map(|rest| rest.trim_start_matches(|c: char| c.is_ascii_digit()).trim_start());
    rest.is_some_and(|rest| rest.starts_with("- "))
}

/// Returns true for the unit of a time, in brackets or not.
fn is_second(cell: &str) -> bool {
    Unit::parse(cell).is_some_and(|unit| unit.quantity == Quantity::Time)
}

#[cfg(test)]
mod tests;
