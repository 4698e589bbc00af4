//! Columns of a TDMS file of National Instruments: channels of one length, with their units, times from a
//! channel or from the increment that their properties state.

mod daqmx;
mod scales;
mod segments;

use std::collections::BTreeMap;

use self::segments::{Object, Values};
use super::{Room, Table, number};
use crate::recording::conventions;
use crate::recording::text::one_line;
use crate::recording::time;

/// Name of the column of a time that channels have by their increment.
const TIME: &str = "Time";

/// Returns the columns of a file.
pub(super) fn table(bytes: &[u8]) -> Result<Table, String> {
    if !segments::is_tdms(bytes) {
        return Err(
            "it is no TDMS file (or it is the index of one, .tdms_index: give the .tdms itself)".to_owned()
        );
    }
    let objects = segments::read(bytes)?;
    let channels: Vec<&Object> = objects
        .iter()
        .filter(|object| object.path.len() == 2 && object.values.as_ref().is_some_and(|v| v.len() > 0))
        .collect();
    let rows = most_common(channels.iter().map(|channel| length(channel)));
    let rows = rows.ok_or("none of its channels holds values")?;
    let (kept, others): (Vec<&Object>, Vec<&Object>) =
        channels.into_iter().partition(|channel| length(channel) == rows);
    let mut table = Table::default();
    if !others.is_empty() {
        table.warnings.push(format!(
            "left out, as not {rows} values long: {}",
            others.iter().map(|o| format!("{} ({})", o.name(), length(o))).collect::<Vec<_>>().join(", ")
        ));
    }
    let mut room = Room::of_file(bytes.len());
    for channel in &kept {
        let name = column_name(channel, &kept);
        let cells =
            cells(channel, &objects, &mut room).map_err(|reason| format!("channel {name}: {reason}"))?;
        let unit = ["unit_string", "NI_UnitDescription", "unit"].iter().find_map(|key| channel.text(key));
        let unit = match channel.values {
            Some(Values::Times(_)) => Some("s".to_owned()),
            _ => unit.map(str::to_owned),
        };
        if matches!(channel.values, Some(Values::Times(_))) {
            table.times.push((name.clone(), 1.0));
        }
        table.columns.push((name, cells));
        table.units.push(unit);
    }
    add_time(&mut table, &kept, rows, &mut room)?;
    table.above = remarks(&objects);
    Ok(table)
}

fn length(channel: &Object) -> usize {
    channel.values.as_ref().map_or(0, Values::len)
}

fn most_common(lengths: impl Iterator<Item = usize>) -> Option<usize> {
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    lengths.for_each(|length| *counts.entry(length).or_default() += 1);
    counts.into_iter().max_by_key(|(length, count)| (*count, *length)).map(|(length, _)| length)
}

/// Returns the channel's name, with its group where another channel has the same.
fn column_name(channel: &Object, all: &[&Object]) -> String {
    let own = channel.path.last();
    let is_alone = all.iter().filter(|other| other.path.last() == own).count() == 1;
    own.filter(|_| is_alone).cloned().unwrap_or_else(|| channel.name())
}

/// Returns the cells of a channel, scaled as its properties say.
fn cells(channel: &Object, objects: &[Object], room: &mut Room) -> Result<Vec<String>, String> {
    let scale = scales::of(channel, objects)?;
    let mut all = Vec::with_capacity(length(channel));
    let mut push = |cell: String| {
        room.take_cells(1, cell.len())?;
        all.push(cell);
        Ok::<_, String>(())
    };
    match (&channel.values, scale) {
        (Some(Values::Numbers(values)), None) => values.iter().try_for_each(|v| push(number(*v)))?,
        (Some(Values::Numbers(values)), Some(scale)) => {
            values.iter().try_for_each(|v| push(number(scale.apply(*v))))?;
        }
        (Some(Values::Whole(values)), None) => values.iter().try_for_each(|v| push(v.to_string()))?,
        (Some(Values::Whole(values)), Some(scale)) => {
            values.iter().try_for_each(|v| push(number(scale.apply(*v as f64))))?;
        }
        (Some(Values::Times(values)), _) => values.iter().try_for_each(|ns| push(time::signed_text(*ns)))?,
        (Some(Values::Texts(values)), _) => values.iter().try_for_each(|text| push(one_line(text)))?,
        (None, _) => {}
    }
    Ok(all)
}

/// Adds the column of times that the channels' increment makes, where no channel holds them.
fn add_time(table: &mut Table, channels: &[&Object], rows: usize, room: &mut Room) -> Result<(), String> {
    let is_time = |(k, (name, _)): (usize, &(String, Vec<String>))| {
        let unit = table.units.get(k).and_then(Option::as_deref);
        let found = conventions::meaning(name, unit);
        found.is_some_and(|meaning| meaning.known == "t_s" && meaning.unit.is_some())
    };
    let stated = channels.iter().filter_map(|c| c.number("wf_increment").map(|step| (c, step)));
    let stated: Vec<(&&Object, f64)> = stated.filter(|(_, step)| *step > 0.0 && step.is_finite()).collect();
    let Some((first, step)) = stated.first() else { return Ok(()) };
    if table.columns.iter().enumerate().any(is_time) || table.columns.iter().any(|(name, _)| name == "t_s") {
        return Ok(());
    }
    let begin = |channel: &Object| {
        let start = channel.time("wf_start_time").filter(|ns| *ns > 0).unwrap_or(0);
        start.saturating_add((1e9 * channel.number("wf_start_offset").unwrap_or(0.0)).round() as i128)
    };
    let start = begin(first);
    if let Some((other, own)) = stated.iter().find(|(c, own)| own != step || begin(c).abs_diff(start) > 1_000)
    {
        return Err(format!(
            "its channels are not at the same times: {} begins at {} s with steps of {step} s, {} at {} s \
             with steps of {own} s; save those of one rate to a file of their own",
            first.name(),
            time::signed_text(start),
            other.name(),
            time::signed_text(begin(other)),
        ));
    }
    let name = if table.columns.iter().any(|(name, _)| name == TIME) { "wf_time" } else { TIME };
    let mut cells = Vec::with_capacity(rows);
    for row in 0..rows {
        let cell = time::signed_text(start.saturating_add((1e9 * step * row as f64).round() as i128));
        room.take_cells(1, cell.len())?;
        cells.push(cell);
    }
    table.times.push((name.to_owned(), 1.0));
    table.columns.push((name.to_owned(), cells));
    table.units.push(Some("s".to_owned()));
    Ok(())
}

/// Returns texts that the file and its groups carry, as lines.
fn remarks(objects: &[Object]) -> Vec<String> {
    const MOST: usize = 64;
    let mut lines = Vec::new();
    for object in objects.iter().filter(|object| object.path.len() < 2) {
        let mut names: Vec<&String> = object.properties.keys().collect();
        names.sort();
        lines.extend(names.into_iter().filter_map(|name| Some(format!("{name}: {}", object.text(name)?))));
    }
    lines.truncate(MOST);
    lines
}

#[cfg(test)]
mod tests;
