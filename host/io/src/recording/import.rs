//! Files of other programs: how they are written, what their columns may be, and a rig file that says so.

mod choices;
mod joints;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use super::columns::{Group, Known};
use super::conventions::{self, Meaning};
use super::csv::careful;
use super::text::clock::Stamp;
use super::text::decimal::is_number;
use super::text::encoding::decode;
use super::text::layout::Stepper;
use super::text::one_line;
use super::{Recording, RecordingError, columnar, extension, is_text, sheet};
use crate::rig::{ColumnSource, DecimalMark, RigFile, ScaledColumn, Unit, WrenchSign};

pub use choices::{ChoiceError, Columns};
pub use joints::JointColumns;

/// Rows that are shown.
const SHOWN: usize = 3;

/// A column of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileColumn {
    /// The name of the column in the file.
    pub name: String,
    /// The unit of the column, if the file states it.
    pub unit: Option<String>,
    /// The meaning by its name and unit.
    pub meaning: Option<Meaning>,
    /// It holds times of day.
    pub is_clock: bool,
    /// The first cells of the column.
    pub cells: Vec<String>,
}

/// The format of a file, and its columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Understood {
    /// The file's name.
    pub file: String,
    /// The format, by what is said of it: `encoding`, `separator`, `numbers`.
    pub written: Vec<(&'static str, String)>,
    /// Line of its header or, if that is above it, of its row of units; `None` of a file of columns.
    pub header_line: Option<u64>,
    /// The columns of the file.
    pub columns: Vec<FileColumn>,
    bytes: Vec<u8>,
}

/// A user's statements about a file beyond what is found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices {
    /// Columns here, each with its name in the file and its unit.
    pub columns: Columns,
    /// Units of columns by their name in the file.
    pub units: BTreeMap<String, String>,
    /// Mark before the decimals.
    pub decimal: Option<DecimalMark>,
}

/// Reads how a file is written.
///
/// # Errors
/// [`RecordingError`]: it cannot be read, or holds no table.
pub fn understand(path: &Path) -> Result<Understood, RecordingError> {
    let file = path.file_name().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let kind = extension(path);
    let is_workbook = sheet::is_workbook(&kind);
    if !is_text(&kind) && !columnar::is_columnar(&kind) && !is_workbook {
        return Err(super::unknown(path, &kind));
    }
    let bytes = rigident_files::read_or_pipe(path, rigident_files::MOST_OF_RECORDING).map_err(|e| {
        RecordingError::Unreadable { path: path.display().to_string(), reason: e.to_string() }
    })?;
    if columnar::is_columnar(&kind) {
        return of_columns(file, &kind, bytes);
    }
    let not = |reason: String| RecordingError::NotARecording { name: file.clone(), reason };
    if is_workbook {
        let sheet = sheet::read(&bytes, None).map_err(not)?;
        let written = vec![("form", kind), ("sheet", sheet.name.clone())];
        return of_text(file.clone(), &sheet.text, written, true, bytes.clone());
    }
    let (text, encoding) = decode(&bytes).map_err(not)?;
    of_text(file.clone(), &text, vec![("encoding", encoding.to_owned())], false, bytes.clone())
}

fn of_text(
    file: String,
    text: &str,
    mut written: Vec<(&'static str, String)>,
    is_plain: bool,
    bytes: Vec<u8>,
) -> Result<Understood, RecordingError> {
    let mut found = careful::find(&file, text, &RigFile::default())?;
    found.layout.is_plain = is_plain;
    let layout = &found.layout;
    let (mut rows, mut stepper) = (layout.rows(found.body), Stepper::default());
    let (mut cells, mut shown) = (Vec::new(), vec![Vec::new(); layout.names.len()]);
    for _ in 0..SHOWN {
        let Some(line) = rows.next(&mut cells) else { break };
        layout.complete(&mut cells, &mut stepper).map_err(|reason| RecordingError::At {
            name: file.clone(),
            line,
            column: None,
            reason,
        })?;
        shown.iter_mut().zip(&cells).for_each(|(column, cell)| column.push(cell.to_string()));
    }
    if let Some(program) = layout.program {
        written.insert(0, ("program", program.to_owned()));
    }
    if !is_plain {
        written.push(("separator", layout.separator.name().to_owned()));
        written.push(("numbers", careful::numbers(&found)));
    }
    let meanings = conventions::meanings(&layout.names, &layout.units, &layout.preamble);
    let header_line = Some(layout.line.saturating_sub(1));
    let columns = layout.names.iter().zip(meanings).zip(shown).enumerate();
    let columns = columns.map(|(k, ((name, meaning), cells))| FileColumn {
        name: name.clone(),
        unit: meaning
            .as_ref()
            .and_then(|m| m.unit.clone())
            .or_else(|| layout.units.get(k).cloned().flatten()),
        meaning,
        is_clock: cells.first().is_some_and(|cell| Stamp::parse(cell).is_some()),
        cells,
    });
    Ok(Understood { columns: columns.collect(), file, written, header_line, bytes })
}

fn of_columns(file: String, kind: &str, bytes: Vec<u8>) -> Result<Understood, RecordingError> {
    let table = columnar::columns(&file, kind, bytes.clone())?;
    let in_seconds = |name: &String| table.times.iter().any(|(own, _)| own == name);
    let names: Vec<String> = table.columns.iter().map(|(name, _)| name.clone()).collect();
    let unit = |(k, name): (usize, &String)| {
        in_seconds(name).then(|| "s".to_owned()).or_else(|| table.units.get(k).cloned().flatten())
    };
    let units: Vec<Option<String>> = names.iter().enumerate().map(unit).collect();
    let meanings = conventions::meanings(&names, &units, &table.above);
    let columns = table.columns.iter().zip(units).zip(meanings);
    let columns = columns.map(|(((name, cells), unit), meaning)| FileColumn {
        name: name.clone(),
        unit: meaning.as_ref().and_then(|m| m.unit.clone()).or(unit),
        meaning,
        is_clock: false,
        cells: cells.iter().take(SHOWN).cloned().collect(),
    });
    let columns = columns.collect();
    let written = vec![("form", kind.to_owned())];
    Ok(Understood { file, written, header_line: None, columns, bytes })
}

impl Understood {
    /// Returns the known columns with where they are: as a user says, by a name of the notation, or by what
    /// other programs call them; a group only if all of it is there.
    ///
    /// # Errors
    /// Says what a choice names that is not there, or the columns whose unit is nowhere.
    pub fn proposal(&self, choices: &Choices) -> Result<Columns, Undecided> {
        let names: Vec<String> = self.columns.iter().map(|column| column.name.clone()).collect();
        let mut found = BTreeMap::new();
        let units: BTreeMap<&str, &FileColumn> =
            self.columns.iter().map(|column| (column.name.as_str(), column)).collect();
        let mut meanings = Vec::new();
        for column in &self.columns {
            let chosen = choices.units.get(&column.name);
            let mut meaning = column.meaning.clone();
            if let (Some(meaning), Some(unit)) = (&mut meaning, chosen) {
                meaning.unit = Some(unit.clone());
            }
            // A name of the notation means itself.
            if Known::parse(&column.name).is_some() {
                found.insert(column.name.clone(), (column.name.clone(), None));
                meaning = None;
            }
            meanings.push(meaning);
        }
        let is_clock = |k: usize| self.columns.get(k).is_some_and(|column| column.is_clock);
        let chosen: Vec<&String> = choices.columns.values().map(|(name, _)| name).collect();
        let others = meanings.iter().enumerate().map(|(k, meaning)| {
            let is_free = names.get(k).is_some_and(|name| !chosen.contains(&name));
            meaning.clone().filter(|meaning| is_free && !choices.columns.contains_key(&meaning.known))
        });
        let others: Vec<Option<Meaning>> = others.collect();
        let whole = self.whole(&others, &choices.columns);
        let proposed = conventions::columns(&names, &whole, is_clock);
        let proposed = proposed.map_err(|without| self.without_units(without, choices))?;
        for (known, source) in proposed {
            let name = source.parts().0.to_owned();
            let column = units.get(name.as_str());
            let unit = choices.units.get(&name).cloned().or_else(|| column.and_then(|c| c.unit.clone()));
            let unit = unit.filter(|_| !column.is_some_and(|c| c.is_clock));
            found.entry(known).or_insert((name, unit));
        }
        for (known, (name, unit)) in &choices.columns {
            if !names.contains(name) {
                return Err(Undecided::NoColumn(name.clone()));
            }
            let own = units.get(name.as_str()).and_then(|column| column.unit.clone());
            let own = own.filter(|own| Unit::parse(own).is_some());
            found.insert(known.clone(), (name.clone(), unit.clone().or(own)));
        }
        Ok(found)
    }

    /// Says why columns have no unit.
    fn without_units(&self, without: Vec<String>, choices: &Choices) -> Undecided {
        let is_time = |column: &&FileColumn| {
            let known = column.meaning.as_ref().is_some_and(|meaning| meaning.known == "t_s");
            known && without.contains(&column.name) && !choices.units.contains_key(&column.name)
        };
        let strange = |column: &FileColumn| {
            let cell = column.cells.first().filter(|cell| !cell.is_empty() && !is_number(cell))?;
            Some(Undecided::TimeForm { column: column.name.clone(), cell: cell.clone() })
        };
        self.columns.iter().find(is_time).and_then(strange).unwrap_or(Undecided::Units(without))
    }

    /// Leaves the meanings whose group is whole together with what is chosen.
    fn whole(&self, meanings: &[Option<Meaning>], chosen: &Columns) -> Vec<Option<Meaning>> {
        // Groups that are partly chosen are filled by the chooser.
        let is_touched = |known: &str| match Known::parse(known) {
            Some(Known::Member(group, _)) => group.names().iter().any(|name| chosen.contains_key(name)),
            _ => false,
        };
        meanings.iter().map(|m| m.clone().filter(|meaning| !is_touched(&meaning.known))).collect()
    }

    /// Reads the file with what is proposed.
    ///
    /// # Errors
    /// [`RecordingError`] of the file.
    pub fn read(&self, rig: &RigFile) -> Result<Recording, RecordingError> {
        Recording::from_columns(&self.file, self.bytes.clone(), rig)
    }
}

/// The statements that a user is to make before a rig file can be written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Undecided {
    /// Units of columns.
    #[error("the unit of {} is written nowhere", .0.join(", "))]
    Units(Vec<String>),
    /// Times in a form that is not known.
    #[error("{}", conventions::unknown_time(.column, .cell))]
    TimeForm {
        /// The column.
        column: String,
        /// Its first cell.
        cell: String,
    },
    /// A quantity that several columns mean.
    #[error("{known} could be {}: say which is which", conventions::either(.names))]
    Twice {
        /// The column here.
        known: String,
        /// The columns of the file.
        names: Vec<String>,
    },
    /// A column that is not there.
    #[error("there is no column {0:?}")]
    NoColumn(String),
    /// The meaning of every column.
    #[error("none of its columns is known by its name: say which is which")]
    NoneKnown,
}

impl Undecided {
    /// Returns a unit that a column of this name could have: the SI unit of the quantity that it is named
    /// after.
    pub fn example(name: &str) -> &'static str {
        conventions::meaning(name, None).map_or("N", |meaning| meaning.quantity.si())
    }
}

/// A file with its known columns, each with its name in the file and its unit.
pub type Proposed<'a> = (&'a Understood, Columns);

/// Returns the text of a rig file for one file, or for several as `[[stream]]`, with what is known of their
/// recordings.
pub fn rig_text(
    files: &[Proposed<'_>],
    recordings: &[Option<Recording>],
    sign: WrenchSign,
    decimal: Option<DecimalMark>,
) -> String {
    let mut text = String::new();
    // Writing into memory has no way to fail.
    let _ = write_rig(&mut text, files, recordings, sign, decimal);
    text
}

fn write_rig(
    text: &mut String,
    files: &[Proposed<'_>],
    recordings: &[Option<Recording>],
    sign: WrenchSign,
    decimal: Option<DecimalMark>,
) -> std::fmt::Result {
    let has = |group: fn(Group) -> bool| {
        let is = |known: &String| matches!(Known::parse(known), Some(Known::Member(own, _)) if group(own));
        files.iter().any(|(_, columns)| columns.keys().any(is))
    };
    writeln!(
        text,
        "# What was understood of these files; change what is wrong. The files themselves stay as they are."
    )?;
    for (file, _) in files {
        let how: Vec<String> = file.written.iter().map(|(key, value)| format!("{key} {value}")).collect();
        writeln!(text, "# {}: {}", one_line(&file.file), how.join(", "))?;
    }
    writeln!(text, "\n[recording]")?;
    if let ([_], [Some(recording)]) = (files, recordings)
        && let Some(rate) = recording.rate_hz
    {
        writeln!(
            text,
            "# Rows per second as the times have it; a file of another rate is then refused.\n# rate_hz = \
             {rate:?}"
        )?;
    }
    if has(|group| group == Group::Wrench) {
        let sign = if sign == WrenchSign::OnSensor { "on_sensor" } else { "on_body" };
        writeln!(
            text,
            "# \"on_body\": the force of the sensor on the body; where the sensor carries a body at rest, it \
             points up.\n\
             # \"on_sensor\": the reaction, pointing down, as a scale shows it.\nwrench_sign = \"{sign}\""
        )?;
    }
    if let Some(mark) = decimal {
        writeln!(text, "decimal = \"{}\"", if mark == DecimalMark::Comma { "comma" } else { "point" })?;
    }
    for (file, columns) in files {
        if files.len() > 1 {
            writeln!(text, "\n[[stream]]\nfile = {}", quoted(&file.file))?;
            writeln!(text, "\n[stream.columns]")?;
        } else {
            writeln!(text, "\n[recording.columns]")?;
        }
        for (known, (name, unit)) in columns {
            match unit {
                Some(unit) => {
                    writeln!(text, "{known} = {{ name = {}, unit = {} }}", quoted(name), quoted(unit))?
                }
                None if known == name => writeln!(text, "# {known} has this name in the file")?,
                None => writeln!(text, "{known} = {}", quoted(name))?,
            }
        }
        let joints = file.joints();
        let of_joints = joints.iter().flat_map(|j| [Some(&j.position), j.rate.as_ref(), j.effort.as_ref()]);
        let used: Vec<&String> = columns.values().map(|(name, _)| name).chain(of_joints.flatten()).collect();
        for column in file.columns.iter().filter(|column| !used.contains(&&column.name)) {
            writeln!(text, "# not used: {}", one_line(&column.name))?;
        }
    }
    for (file, _) in files {
        joints::write(text, &file.joints())?;
    }
    if has(|group| matches!(group, Group::Accel(_) | Group::Gyro(_))) {
        writeln!(
            text,
            "\n# Write its origin in the axes of the load cell, m, and the rotation from its axes to those \
             of the load cell, w, x, y, z.\n\
             [[imu]]\n# position_m = [0.0, 0.0, 0.0]\n# rotation_wxyz = [1.0, 0.0, 0.0, 0.0]"
        )?;
    }
    Ok(())
}

/// Returns a text as TOML writes it.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// Returns where columns are, as a rig file has it.
pub fn sources(columns: &Columns) -> BTreeMap<String, ColumnSource> {
    let source = |(name, unit): &(String, Option<String>)| match unit {
        None => ColumnSource::Name(name.clone()),
        Some(unit) => ColumnSource::Scaled(ScaledColumn {
            name: name.clone(),
            scale: 1.0,
            unit: Some(unit.clone()),
            offset: 0.0,
            plus: BTreeMap::new(),
        }),
    };
    columns.iter().map(|(known, own)| (known.clone(), source(own))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn understood(text: &str) -> (tempfile::TempDir, Understood) {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.csv"), text).unwrap();
        let found = understand(&folder.path().join("a.csv")).unwrap();
        (folder, found)
    }

    #[test]
    fn the_rig_file_that_is_written_reads_the_file() {
        let rows = (0..9).map(|k| format!("{};0,5;1,5;2,5;3,5;4,5;5,{k}\n", 2 * k)).collect::<String>();
        let text =
            "Halter \"7\"\n\nt;Fx;Fy;Fz;Mx;My;Mz\n[ms];[kN];[N];[N];[Nm];[Nm];[Nm]\n".to_owned() + &rows;
        let (_folder, found) = understood(&text);
        assert_eq!(found.header_line, Some(4));
        assert!(found.written.contains(&("numbers", "decimal comma".to_owned())), "{:?}", found.written);
        let columns = found.proposal(&Choices::default()).unwrap();
        assert_eq!(columns["t_s"], ("t".to_owned(), Some("ms".to_owned())));
        let text = rig_text(&[(&found, columns)], &[None], WrenchSign::OnSensor, None);
        let rig = RigFile::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let read = found.read(&rig).unwrap();
        assert_eq!(read.wrench.unwrap()[8], [-500.0, -1.5, -2.5, -3.5, -4.5, -5.8]);
        assert_eq!((read.rate_hz, read.assumed), (Some(500.0), None));
    }

    #[test]
    fn a_choice_comes_before_a_guess() {
        let rows = (0..9).map(|k| format!("{k},0.5,1.5,2.5,3.5,4.5,5.5,7.5\n")).collect::<String>();
        let (_folder, found) = understood(&("tick,Fx,Fy,Fz,Mx,My,Mz,\"Fx new\"\n".to_owned() + &rows));
        let undecided = found.proposal(&Choices::default()).unwrap_err();
        assert!(matches!(&undecided, Undecided::Units(names) if names.len() == 6), "{undecided:?}");
        let mut choices = Choices::default();
        for (known, name, unit) in [
            ("t_s", "tick", "ms"),
            ("fx_n", "Fx new", "N"),
            ("fy_n", "Fy", "N"),
            ("fz_n", "Fz", "N"),
            ("mx_nm", "Mx", "N mm"),
            ("my_nm", "My", "N mm"),
            ("mz_nm", "Mz", "N mm"),
        ] {
            choices.columns.insert(known.to_owned(), (name.to_owned(), Some(unit.to_owned())));
        }
        let columns = found.proposal(&choices).unwrap();
        assert_eq!(columns["fx_n"].0, "Fx new");
        choices.columns.insert("fx_n".to_owned(), ("Fq".to_owned(), None));
        assert_eq!(found.proposal(&choices), Err(Undecided::NoColumn("Fq".to_owned())));
    }
}
