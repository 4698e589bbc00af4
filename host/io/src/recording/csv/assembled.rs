//! The columns of a file, put together to a recording.

use std::collections::{BTreeMap, BTreeSet};

use super::{Reader, Sink};
use crate::recording::columns::{Group, Known, TIME};
use crate::recording::time::Time;
use crate::recording::{Recording, RecordingError, stem};
use crate::rig::WrenchSign;
use crate::rig::spelling::nearest;

/// The members of each group that there are columns of.
type Members = BTreeMap<Group, BTreeSet<usize>>;

impl Reader<'_> {
    /// Puts the columns together; they are of a file or of arrays.
    ///
    /// # Errors
    /// A column is missing, times do not increase, or the rig file contradicts them.
    pub(in super::super) fn into_recording(mut self, of_file: bool) -> Result<Recording, RecordingError> {
        let headers: Vec<String> = self.columns.iter().map(|c| c.header.clone()).collect();
        let mut recording = Recording {
            name: stem(self.label),
            assumed: self.assumed.take(),
            warnings: std::mem::take(&mut self.warnings),
            ..Recording::default()
        };
        let usual = 2 + self.comments.len() as u64;
        recording.first_line = self.lines.first().copied().filter(|line| *line != usual);
        let (members, times) = self.take_columns(&headers, &mut recording);
        self.take_groups(members, &headers, &mut recording)?;
        match times {
            Some(times) => self.set_times(&mut recording, &times)?,
            None if self.rig.recording.is_static => {}
            None => return Err(self.without_times(&headers)),
        }
        // The sign is applied below; stated again it would be applied again.
        if self.rig.recording.wrench_sign == WrenchSign::OnSensor {
            self.comments.retain(|(key, _)| key != "wrench_sign");
        }
        // What is above the header is retained; an equals sign would make it a key.
        let above = self.above.iter().map(|line| (String::new(), line.replace('=', ":")));
        recording.comments = self.comments.into_iter().chain(above).collect();
        if !of_file {
            // There is no file whose lines could be named.
            recording.order.clear();
        }
        recording.rig = self.rig;
        recording.settle(self.label)
    }

    /// Takes the columns' names and the cells of those that are text; returns the members of groups that
    /// there are, and the times.
    fn take_columns(
        &mut self,
        headers: &[String],
        recording: &mut Recording,
    ) -> (Members, Option<Vec<Time>>) {
        let mut members = Members::new();
        let mut times = None;
        for column in std::mem::take(&mut self.columns) {
            match column.sink {
                Sink::Time { times: found, .. } => {
                    recording.order.push(TIME.to_owned());
                    times = Some(found);
                }
                Sink::Number { known: Known::Member(group, k), cells, .. } => {
                    recording.order.push(Known::Member(group, k).name());
                    members.entry(group).or_default().insert(k);
                    if let Some(cells) = cells {
                        // The number before scaling, so that nothing is lost in a conversion.
                        recording.extra.push((raw_name(&column.header, headers), cells));
                    }
                }
                Sink::Number { .. } => {}
                Sink::Text(cells) => {
                    recording.order.push(column.header.clone());
                    recording.extra.push((column.header, cells));
                }
            }
        }
        (members, times)
    }

    /// Takes the rows of the groups, of which no member may be missing.
    fn take_groups(
        &mut self,
        mut members: Members,
        headers: &[String],
        recording: &mut Recording,
    ) -> Result<(), RecordingError> {
        let mut groups = std::mem::take(&mut self.groups);
        groups.sort_by_key(|(group, _)| *group);
        for (group, rows) in groups {
            let (names, own) = (group.names(), members.remove(&group).unwrap_or_default());
            let missing: Vec<&str> = names
                .iter()
                .enumerate()
                .filter(|(k, _)| !own.contains(k))
                .map(|(_, name)| name.as_str())
                .collect();
            if !missing.is_empty() {
                return Err(self.missing(&missing, &names, headers));
            }
            rows.put_into(group, recording);
        }
        Ok(())
    }

    fn without_times(&self, headers: &[String]) -> RecordingError {
        let near = headers.iter().find(|h| {
            let h = h.to_lowercase();
            h == "t" || h.contains("time") || h.contains("stamp")
        });
        self.columns_error(format!(
            "column t_s is missing: {}, or say static = true there if every row is a still pose",
            near.map_or_else(
                || "name the column of the time in [recording] columns of the rig file".to_owned(),
                |n| format!(
                    "is it {n:?}? then say so in the rig file, [recording] columns = \
                     {{ t_s = {{ name = {n:?}, scale = … }} }}"
                )
            )
        ))
    }

    fn missing(&self, missing: &[&str], names: &[String], headers: &[String]) -> RecordingError {
        let there: Vec<&str> =
            names.iter().map(String::as_str).filter(|name| !missing.contains(name)).collect();
        let strangers = headers.iter().map(String::as_str).filter(|h| Known::parse(h).is_none());
        let near = missing.first().and_then(|name| nearest(name, strangers));
        self.columns_error(format!(
            "{} {} missing beside {}{}: add what is missing, or name it in [recording] columns of the rig \
             file",
            if missing.len() == 1 {
                format!("column {}", missing[0])
            } else {
                format!("columns {}", missing.join(", "))
            },
            if missing.len() == 1 { "is" } else { "are" },
            there.join(", "),
            near.map_or_else(String::new, |n| format!(" (is it {n:?}?)"))
        ))
    }

    /// Checks that times increase and brings them to nanoseconds.
    fn set_times(&self, recording: &mut Recording, times: &[Time]) -> Result<(), RecordingError> {
        let name = self.label.to_owned();
        let at = |row: usize, reason: String| match self.lines.get(row).copied() {
            Some(line) => {
                RecordingError::At { name: name.clone(), line, column: Some(TIME.to_owned()), reason }
            }
            None => RecordingError::Cell {
                name: name.clone(),
                index: row as u64,
                column: TIME.to_owned(),
                reason,
            },
        };
        let line = |row: usize| self.lines.get(row).map_or_else(String::new, |line| format!(", line {line}"));
        for (row, pair) in times.windows(2).enumerate() {
            let increases = pair[1].nanoseconds() > pair[0].nanoseconds();
            if !increases {
                let (before, after) = (pair[0].seconds(), pair[1].seconds());
                return Err(at(
                    row + 1,
                    format!(
                        "time {} from {before:?} s (row {}{}) to {after:?} s (row {}): t_s must increase; \
                         sort the rows, or split the file where the clock starts anew",
                        if after < before { "runs backwards" } else { "stands still" },
                        row + 1,
                        line(row),
                        row + 2,
                    ),
                ));
            }
        }
        let first = times.first().map_or(0, |t| t.nanoseconds());
        // Nanoseconds have no sign: a recording that begins before zero counts from its first row.
        let origin = first.min(0);
        recording.time_ns.reserve_exact(times.len());
        for (row, t) in times.iter().enumerate() {
            let ns = t.nanoseconds().saturating_sub(origin);
            let ns = u64::try_from(ns).ok().filter(|ns| *ns < i64::MAX as u64).ok_or_else(|| {
                at(row, format!("{:?} s is centuries away: check the scale of the time", t.seconds()))
            })?;
            recording.time_ns.push(ns);
        }
        if origin < 0 || times.iter().any(|t| matches!(t, Time::Seconds(_))) {
            recording.exact_time_s = Some(times.iter().map(|t| t.seconds()).collect());
        }
        Ok(())
    }
}

/// Returns a name for the unscaled cells that no other column has.
fn raw_name(header: &str, headers: &[String]) -> String {
    let mut name = format!("raw_{header}");
    while headers.contains(&name) {
        name.insert_str(0, "raw_");
    }
    name
}
