//! Reading and checking a rig file; every complaint names key and line.

mod links;
mod places;
mod sensors;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use rigident_shared::printable;
use toml::de::DeTable;

use super::units::{Quantity, Unit};
use super::{ColumnSource, RigFile, labels};
use crate::recording::columns::{Known, nearest_known};
use crate::rig::spelling::nearest;

/// Why a rig file cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RigFileError {
    /// It cannot be read.
    #[error("rig file {path} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// The message of the system.
        reason: String,
    },
    /// Not TOML, an unknown key, a value of the wrong kind.
    #[error("rig file{}{}: {reason}", named(file), at_place(place))]
    Syntax {
        /// The file, if it is one.
        file: Option<String>,
        /// Line and column, in characters, both from 1.
        place: Option<(usize, usize)>,
        /// The fault.
        reason: String,
    },
    /// A value that makes no sense.
    #[error("rig file{}{}: {key} = {value}: {advice}", named(file), at(line))]
    Value {
        /// The file, if it is one.
        file: Option<String>,
        /// Line, from 1.
        line: Option<usize>,
        /// The key.
        key: String,
        /// The text there.
        value: String,
        /// The advice.
        advice: String,
    },
}

/// Returns whether a text is the number of a board's chip: 96 bits in hexadecimal digits.
pub fn is_number_of_chip(text: &str) -> bool {
    text.len() == 24 && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

fn named(file: &Option<String>) -> String {
    file.as_ref().map_or_else(String::new, |f| format!(" {f}"))
}

fn at(line: &Option<usize>) -> String {
    line.map_or_else(String::new, |n| format!(", line {n}"))
}

fn at_place(place: &Option<(usize, usize)>) -> String {
    place.map_or_else(String::new, |(line, column)| format!(", line {line}, column {column}"))
}

impl RigFileError {
    /// Returns the error with the name of the file.
    #[must_use]
    pub fn of_file(mut self, name: &str) -> Self {
        match &mut self {
            Self::Syntax { file, .. } | Self::Value { file, .. } => *file = Some(name.to_owned()),
            Self::Unreadable { .. } => {}
        }
        self
    }
}

impl RigFile {
    /// Reads and checks the text of a rig file.
    ///
    /// # Errors
    /// [`RigFileError`] names key and line.
    pub fn parse(text: &str) -> Result<Self, RigFileError> {
        if let Ok(table) = toml::from_str::<toml::Table>(text) {
            check_texts(text, "", &table)?;
        }
        let rig: Self = toml::from_str(text).map_err(|e| syntax(text, &e))?;
        let mut check = Check { text, rig: &rig };
        check.run()?;
        Ok(rig)
    }

    /// Reads and checks a rig file.
    ///
    /// # Errors
    /// It cannot be read, or [`RigFile::parse`] refuses it.
    pub fn load(path: &Path) -> Result<Self, RigFileError> {
        Self::load_with_text(path).map(|(rig, _)| rig)
    }

    /// Reads and checks a rig file, and gives its text too.
    ///
    /// # Errors
    /// Fails as [`RigFile::load`] does.
    pub fn load_with_text(path: &Path) -> Result<(Self, String), RigFileError> {
        let name = path.display().to_string();
        let text = rigident_files::read_text(path)
            .map_err(|e| RigFileError::Unreadable { path: name.clone(), reason: e.to_string() })?;
        let mut rig = Self::parse(&text).map_err(|e| e.of_file(&name))?;
        rig.read_calibration(path).map_err(|e| e.of_file(&name))?;
        if let Some(arm) = rig.platform.as_mut().and_then(|platform| platform.arm.as_mut()) {
            arm.beside(path);
        }
        Ok((rig, text))
    }
}

/// Returns a warning of each file that the text of a rig file at `path` names and that is not in the rig
/// file's folder: whoever wrote it has chosen what is read here.
pub fn files_outside(text: &str, path: &Path) -> Vec<String> {
    let table: toml::Table = toml::from_str(text).unwrap_or_default();
    let file = |table: &toml::Value| table.get("file")?.as_str().map(str::to_owned);
    let streams = table.get("stream").and_then(toml::Value::as_array).into_iter().flatten();
    let arm = table.get("platform").and_then(|platform| platform.get("arm")?.get("model")?.as_str());
    let named = streams.chain(table.get("calibration")).filter_map(file).chain(arm.map(str::to_owned));
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let own = folder.canonicalize();
    let is_outside = |file: &String| match (&own, folder.join(file).canonicalize()) {
        (Ok(own), Ok(found)) => !found.starts_with(own),
        // What is not there is not read.
        _ => false,
    };
    let words = |file: String| {
        format!(
            "the rig file {} names {file}, which is outside its folder: is it meant to be read?",
            path.display()
        )
    };
    named.filter(is_outside).map(words).collect()
}

/// Refuses keys and texts that could steer what they are shown by or written into.
fn check_texts(text: &str, place: &str, table: &toml::Table) -> Result<(), RigFileError> {
    let refuse = |key: &str, shown: &str| RigFileError::Value {
        file: None,
        line: locate(text, key),
        key: printable::name(key).to_string(),
        value: format!("{:?}", printable::name(shown).to_string()),
        advice: format!(
            "no name or text may have control characters, or be longer than {} bytes",
            printable::LONGEST_NAME
        ),
    };
    for (key, value) in table {
        let path = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
        if !printable::is_name(key) {
            return Err(refuse(&path, key));
        }
        let mut left = vec![(path, value)];
        while let Some((path, value)) = left.pop() {
            match value {
                toml::Value::String(shown) if !printable::is_name(shown) => return Err(refuse(&path, shown)),
                toml::Value::Table(inside) => check_texts(text, &path, inside)?,
                toml::Value::Array(items) => {
                    left.extend(
                        items.iter().enumerate().rev().map(|(k, item)| (format!("{path}[{k}]"), item)),
                    );
                }
                _ => {}
            }
        }
    }
    Ok(())
}

/// Returns the line on which a stretch of the text begins.
fn line_of(text: &str, span: &Range<usize>) -> usize {
    text.bytes().take(span.start).filter(|b| *b == b'\n').count() + 1
}

/// Returns line and column, in characters, at which a stretch of the text begins.
fn place_of(text: &str, span: &Range<usize>) -> (usize, usize) {
    // A stretch that begins inside a character has no column; its line still has.
    let before = text.get(..span.start).and_then(|before| before.rsplit('\n').next()).unwrap_or_default();
    (line_of(text, span), before.chars().count() + 1)
}

/// Returns the parser's message with the place, and the key that an unknown key was probably meant to be.
fn syntax(text: &str, error: &toml::de::Error) -> RigFileError {
    let message = error.message().trim().replace('\n', ", ");
    let reason = match unknown_key(&message) {
        Some((key, known)) => {
            let near = nearest(key, known.iter().copied());
            format!(
                "key {key} is not known{}; known here: {}",
                near.map_or_else(String::new, |n| format!(" (is it {n}?)")),
                known.join(", ")
            )
        }
        None => message,
    };
    RigFileError::Syntax { file: None, place: error.span().map(|span| place_of(text, &span)), reason }
}

/// Splits ``unknown field `a`, expected one of `b`, `c` `` into a and [b, c].
fn unknown_key(message: &str) -> Option<(&str, Vec<&str>)> {
    let (key, expected) = message.strip_prefix("unknown field `")?.split_once("`, expected ")?;
    // Words in backquotes are every second part.
    Some((key, expected.split('`').skip(1).step_by(2).collect()))
}

/// Returns the place of a value: `imu[0].position_m`.
fn locate(text: &str, path: &str) -> Option<usize> {
    let document = DeTable::parse(text).ok()?;
    let mut table = Some(document.get_ref());
    let mut span = None;
    for part in path.split('.') {
        let (name, index) = match part.split_once('[') {
            Some((name, index)) => (name, index.trim_end_matches(']').parse::<usize>().ok()),
            None => (part, None),
        };
        let Some((key, found)) = table?.iter().find(|(key, _)| key.get_ref() == name) else { break };
        span = Some(key.span());
        let mut value = found.get_ref();
        if let Some(item) = index.and_then(|i| value.as_array()?.get(i)) {
            // Tables of an array begin at their headers.
            span = Some(item.span());
            value = item.get_ref();
        }
        table = value.as_table();
    }
    span.map(|span| line_of(text, &span))
}

const FINITE: &str = "every number must be finite";
const POSITIVE: &str = "must be finite and greater than zero";
const NOT_NEGATIVE: &str = "must be finite and not negative";
const NOISE: &str =
    "1 σ must be finite and greater than zero; leave the key out to have it estimated from the residuals";
const IMU_NOISE: &str =
    "1 σ must be finite and greater than zero; leave the key out to have it taken from the readings";

struct Check<'a> {
    text: &'a str,
    rig: &'a RigFile,
}

impl Check<'_> {
    fn refuse(&self, key: &str, value: impl std::fmt::Debug, advice: impl Into<String>) -> RigFileError {
        RigFileError::Value {
            file: None,
            line: locate(self.text, key),
            key: key.to_owned(),
            value: format!("{value:?}"),
            advice: advice.into(),
        }
    }

    fn all(
        &self,
        key: &str,
        values: &[f64],
        good: impl Fn(f64) -> bool,
        advice: &str,
    ) -> Result<(), RigFileError> {
        if values.iter().all(|v| v.is_finite() && good(*v)) {
            Ok(())
        } else {
            Err(self.refuse(key, values, advice))
        }
    }

    fn finite(&self, key: &str, values: &[f64]) -> Result<(), RigFileError> {
        self.all(key, values, |_| true, FINITE)
    }

    fn positive(&self, key: &str, values: &[f64]) -> Result<(), RigFileError> {
        self.all(key, values, |v| v > 0.0, POSITIVE)
    }

    fn rotation(&self, key: &str, q: &[f64; 4]) -> Result<(), RigFileError> {
        let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        if (norm - 1.0).abs() < 0.01 {
            return Ok(());
        }
        Err(self.refuse(key, q, format!("must be a unit quaternion w, x, y, z; its norm is {norm:.4}")))
    }

    fn delay(&self, key: &str, value: f64) -> Result<(), RigFileError> {
        self.all(key, &[value], |v| (0.0..=1.0).contains(&v), "must be between 0 and 1 s")
    }

    fn columns(&self, key: &str, columns: &BTreeMap<String, ColumnSource>) -> Result<(), RigFileError> {
        for (name, source) in columns {
            let key = format!("{key}.{name}");
            let (column, scale) = source.parts();
            if Known::parse(name).is_none() {
                let near = nearest_known(name);
                return Err(self.refuse(
                    &key,
                    column,
                    format!(
                        "{name} is no column of a recording{}; write it as known name = \"name in the \
                         file\"",
                        near.map_or_else(String::new, |n| format!(" (is it {n}?)"))
                    ),
                ));
            }
            if column.trim() != column || column.is_empty() {
                return Err(self.refuse(&key, column, "must be the column's name, without blanks around it"));
            }
            if !scale.is_finite() || scale == 0.0 {
                return Err(self.refuse(&format!("{key}.scale"), scale, "must be finite and not zero"));
            }
            self.all(&format!("{key}.offset"), &[source.offset()], f64::is_finite, "must be finite")?;
            if let Some((other, _)) = source.plus().next() {
                let advice = "columns are added in [[joint]] only";
                return Err(self.refuse(&format!("{key}.plus"), other, advice));
            }
            self.unit(&key, source, Quantity::of_name(name).as_slice())?;
        }
        Ok(())
    }

    /// Checks a unit that is given by name.
    fn unit(&self, key: &str, source: &ColumnSource, of: &[Quantity]) -> Result<(), RigFileError> {
        let ColumnSource::Scaled(column) = source else { return Ok(()) };
        let Some(name) = &column.unit else { return Ok(()) };
        let key = format!("{key}.unit");
        if column.scale != 1.0 {
            return Err(self.refuse(&key, name, "a unit has its own scale: give unit or scale"));
        }
        if Unit::parse(name).is_some_and(|unit| of.contains(&unit.quantity)) {
            return Ok(());
        }
        let known: Vec<&str> = of.iter().flat_map(|quantity| quantity.names()).collect();
        Err(self.refuse(
            &key,
            name,
            if known.is_empty() {
                "it has no unit".to_owned()
            } else {
                format!("must be a unit of it: {}; any other by its scale", known.join(", "))
            },
        ))
    }

    fn run(&mut self) -> Result<(), RigFileError> {
        self.recording()?;
        self.imus()?;
        self.load_cell()?;
        self.body_frame()?;
        self.platform()?;
        self.truth()?;
        self.links()?;
        self.tree()?;
        self.joints()?;
        self.feet()?;
        self.suspension()?;
        self.calibration()
    }

    fn suspension(&self) -> Result<(), RigFileError> {
        let Some(table) = &self.rig.suspension else { return Ok(()) };
        super::suspension_check::check(table).map_err(|(key, value, advice)| {
            self.refuse(&format!("suspension.{key}"), format_args!("{value}"), advice)
        })
    }

    fn calibration(&self) -> Result<(), RigFileError> {
        let Some(calibration) = self.rig.calibrated() else { return Ok(()) };
        let refuse = |advice: String| self.refuse("calibration", &calibration.name, advice);
        calibration.check().map_err(refuse)?;
        // Taking it once more asks whether it is of this rig.
        self.rig.clone().calibrate(calibration.clone()).map_err(|error| refuse(error.to_string()))
    }

    fn recording(&self) -> Result<(), RigFileError> {
        let recording = &self.rig.recording;
        self.positive("recording.rate_hz", recording.rate_hz.as_slice())?;
        self.positive("recording.gravity_mps2", &[recording.gravity_mps2])?;
        let down = recording.gravity_direction;
        let advice = "must be finite and not zero";
        self.all("recording.gravity_direction", &down, f64::is_finite, advice)?;
        if down == [0.0; 3] {
            return Err(self.refuse("recording.gravity_direction", "0, 0, 0", advice));
        }
        let std = recording.gravity_std_mps2;
        self.all("recording.gravity_std_mps2", std.as_slice(), |v| v >= 0.0, NOT_NEGATIVE)?;
        self.columns("recording.columns", &recording.columns)?;
        for (name, topic) in &recording.topics {
            if !matches!(name.as_str(), "wrench" | "imu") {
                let key = format!("recording.topics.{name}");
                return Err(self.refuse(&key, topic, "topics are named for wrench and imu"));
            }
        }
        for (key, value) in &recording.labels {
            labels::check(key, value)
                .map_err(|advice| self.refuse(&format!("recording.labels.{key}"), value, advice))?;
        }
        for (n, stream) in self.rig.stream.iter().enumerate() {
            self.columns(&format!("stream[{n}].columns"), &stream.columns)?;
            let (offset, rate) = (stream.clock_offset_s, stream.clock_rate);
            if !offset.is_finite() || offset.abs() > 1e10 {
                let key = format!("stream[{n}].clock_offset_s");
                return Err(self.refuse(&key, offset, "must be a time in s, less than three centuries"));
            }
            // No clock is that far off.
            if !(0.5..=2.0).contains(&rate) {
                let key = format!("stream[{n}].clock_rate");
                return Err(self.refuse(
                    &key,
                    rate,
                    "must be near 1; a unit of time is a scale of t_s in columns",
                ));
            }
            if let Some(matrix) = &stream.rotation_matrix
                && !matches!(matrix.frame.as_str(), "S in A" | "A in S")
            {
                let key = format!("stream[{n}].rotation_matrix.frame");
                let advice = "must be \"S in A\" (the columns are S's axes in A) or \"A in S\"";
                return Err(self.refuse(&key, &matrix.frame, advice));
            }
        }
        Ok(())
    }
}
