//! Finds the meaning of each column of a file: by its name, by the rig file, or by the names that other
//! programs use.

use std::collections::BTreeMap;

use rigident_shared::printable;

use super::{Column, Reader, Sink, shorten};
use crate::recording::columns::{Known, PLACE, TIME, is_printable, other_unit};
use crate::recording::conventions::Meaning;
use crate::recording::{RecordingError, conventions};
use crate::rig::spelling::nearest;
use crate::rig::{ColumnSource, Quantity, Unit};

/// By the name of a column in the file: what it is, with scale and offset.
type Sources<'a> = BTreeMap<&'a str, (&'a str, (f64, f64))>;

impl Reader<'_> {
    /// Finds columns by the names and units that other programs give them, where the rig file names none and
    /// no name is known.
    pub(super) fn look_up(&mut self, header: &[String]) -> Result<(), RecordingError> {
        let is_known = |name: &String| matches!(Known::parse(name), Some(Known::Member(..)));
        if !self.rig.recording.columns.is_empty() || header.iter().any(is_known) {
            return Ok(());
        }
        let meanings = conventions::meanings(header, &self.units, &self.above);
        let is_clock = |k: usize| self.clocks.contains(&k);
        let columns = conventions::columns(header, &meanings, is_clock).map_err(|without| {
            if let Some((column, cell)) = self.strange_time(header, &meanings) {
                return self.columns_error(conventions::unknown_time(column, &shorten(cell)));
            }
            let first = without.first().map_or("Fx", String::as_str);
            let of_first = conventions::meaning(first, None);
            self.columns_error(format!(
                "its columns are named as elsewhere, and the unit of {} is written nowhere: name the columns \
                 in [recording] columns of a rig file, as in {} = {{ name = {first:?}, unit = \"{}\" }}",
                shorten(&without.join(", ")),
                of_first.as_ref().map_or("fx_n", |meaning| meaning.known.as_str()),
                of_first.as_ref().map_or("N", |meaning| meaning.quantity.si())
            ))
        })?;
        let is_group = |known: &String| known != TIME;
        if !columns.keys().any(is_group) {
            let Some((known, names)) = conventions::repeated(header, &meanings) else { return Ok(()) };
            return Err(self.columns_error(format!(
                "{known} could be {}: name the columns in [recording] columns of a rig file",
                conventions::either(&names)
            )));
        }
        let said = columns.iter().map(|(known, source)| match source.parts() {
            (name, 1.0) => format!("{known} = {name:?}"),
            (name, scale) => format!("{known} = {name:?} times {scale:?}"),
        });
        let program = self.program.map_or_else(String::new, |program| format!(" as {program} writes them"));
        self.assumed = Some(format!(
            "columns taken by their names and units{program}: {}",
            said.collect::<Vec<_>>().join(", ")
        ));
        self.rig.recording.columns = columns;
        Ok(())
    }

    /// Returns the column of a time that is neither a number nor a form of time that is known, with its first
    /// cell.
    fn strange_time<'a>(
        &'a self,
        header: &'a [String],
        meanings: &[Option<Meaning>],
    ) -> Option<(&'a str, &'a str)> {
        let is_time = |k: &usize| meanings.get(*k).and_then(Option::as_ref).is_some_and(|m| m.known == TIME);
        let k = (0..header.len()).find(is_time)?;
        Some((header.get(k)?.as_str(), self.strange.get(&k)?.as_str()))
    }

    /// Returns what each column is, by its name or by the rig file.
    pub(super) fn assign(&self, header: Vec<String>) -> Result<Vec<Column>, RecordingError> {
        let mapping = &self.rig.recording.columns;
        let sources = self.sources(&header)?;
        self.check_names(&header)?;
        // Without a place they are no pose of the plate.
        let has_place = header.iter().any(|name| PLACE.contains(&name.as_str()))
            || PLACE.iter().any(|name| mapping.contains_key(*name));
        let attitude = self.rig.recording.attitude_wxyz.iter().flatten().filter(|_| !has_place);
        let attitude: Vec<String> = attitude.cloned().collect();
        let mut columns: Vec<Column> = Vec::new();
        let mut known_columns = Vec::new();
        for (place, name) in header.into_iter().enumerate() {
            if columns.iter().any(|c| c.header == name) {
                return Err(self.columns_error(format!("column {name:?} appears twice: rename one")));
            }
            let source = sources.get(name.as_str()).copied();
            let own = || Known::parse(&name).filter(|_| !attitude.contains(&name));
            let known = source.map_or_else(own, |(known, _)| Known::parse(known));
            let sink = self.sink(&name, known, source.map_or((1.0, 0.0), |(_, unit)| unit))?;
            if let Some(known) = known {
                let is_given = source.is_some_and(|(own, _)| mapping.get(own).is_some_and(has_unit));
                self.check_unit(place, &name, known, is_given)?;
                if known_columns.contains(&known) {
                    return Err(self.columns_error(format!(
                        "{} is in two columns, {name:?} and another one: the file or the rig file must name \
                         one",
                        known.name()
                    )));
                }
                known_columns.push(known);
            }
            columns.push(Column { header: name, sink });
        }
        if known_columns.is_empty() {
            return Err(RecordingError::NotARecording {
                name: self.label.to_owned(),
                reason: format!(
                    "none of its columns is known ({}); name them in [recording] columns of a rig file",
                    shorten(&columns.iter().map(|c| c.header.as_str()).collect::<Vec<_>>().join(", "))
                ),
            });
        }
        Ok(columns)
    }

    /// Returns the columns that the rig file names.
    fn sources(&self, header: &[String]) -> Result<Sources<'_>, RecordingError> {
        let mut sources = Sources::new();
        for (known, source) in &self.rig.recording.columns {
            let ((name, scale), offset) = (source.parts(), source.offset());
            if !header.iter().any(|h| h == name) {
                let near = nearest(name, header.iter().map(String::as_str));
                return Err(self.columns_error(format!(
                    "the rig file says that {known} is in column {name:?}, and there is none{}; the columns \
                     are {}",
                    near.map_or_else(String::new, |n| format!(" (is it {n:?}?)")),
                    header.join(", ")
                )));
            }
            if let Some((other, _)) = sources.insert(name, (known.as_str(), (scale, offset))) {
                return Err(self.columns_error(format!(
                    "the rig file names column {name:?} for {other} and for {known}: it can be one of them"
                )));
            }
        }
        Ok(sources)
    }

    /// Refuses names that cannot be shown.
    fn check_names(&self, header: &[String]) -> Result<(), RecordingError> {
        if !printable::is_name(self.label) {
            return Err(self.columns_error("its name has control characters: give it another one".to_owned()));
        }
        if let Some(n) = header.iter().position(|name| !is_printable(name)) {
            return Err(self.columns_error(format!(
                "the name of its column {} has control characters, or is longer than {} bytes: {:?}",
                n + 1,
                printable::LONGEST_NAME,
                printable::name(&header[n]).to_string()
            )));
        }
        Ok(())
    }

    /// Returns where the cells of a column go, with the scale and the offset that the rig file says.
    fn sink(
        &self,
        name: &str,
        known: Option<Known>,
        (scale, offset): (f64, f64),
    ) -> Result<Sink, RecordingError> {
        let sink = match known {
            Some(Known::Time) if self.rig.recording.is_static => Sink::Text(Vec::new()),
            Some(Known::Time) => Sink::Time { scale, times: Vec::new() },
            Some(known) => {
                let cells = (scale != 1.0 || offset != 0.0).then(Vec::new);
                Sink::Number { known, group: 0, scale, offset, count: 0, cells }
            }
            None => {
                if let Some(meant) = other_unit(name) {
                    return Err(self.columns_error(format!(
                        "column {name} is a known quantity in an unknown unit: it must be {meant}, or be \
                         named with its scale in the rig file, [recording] columns = \
                         {{ {meant} = {{ name = \"{name}\", scale = … }} }}"
                    )));
                }
                Sink::Text(Vec::new())
            }
        };
        Ok(sink)
    }

    /// Refuses a column whose unit in the file is another than the one it is read in.
    fn check_unit(
        &self,
        place: usize,
        header: &str,
        known: Known,
        is_given: bool,
    ) -> Result<(), RecordingError> {
        let name = known.name();
        let Some(own) = Quantity::of_name(&name).filter(|_| !is_given && !self.clocks.contains(&place))
        else {
            return Ok(());
        };
        let unit = |text: &str| Unit::parse(text).filter(|unit| unit.quantity == own);
        // A unit over the numbers that is not known is another one, too; the end of a name may be anything.
        let above = self.units.get(place).and_then(Option::as_deref);
        let above = above.filter(|text| unit(text).is_none_or(|unit| unit.scale != 1.0));
        let named = conventions::unit_of(header);
        let named = named.filter(|text| unit(text).is_some_and(|unit| unit.scale != 1.0));
        let Some(stated) = above.or(named) else { return Ok(()) };
        Err(self.columns_error(format!(
            "{name} is read in {}, and the file says {stated:?} of column {header:?}: write its unit in \
             [recording] columns of the rig file",
            own.si()
        )))
    }
}

/// Returns true if a rig file says in which unit a column is.
fn has_unit(source: &ColumnSource) -> bool {
    matches!(source, ColumnSource::Scaled(column) if column.unit.is_some() || column.scale != 1.0)
}
