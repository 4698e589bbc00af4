//! The parameter section: groups, and parameters in them.

use std::collections::HashMap;

use super::bytes::Bytes;
use super::error::{C3dError, parameter};

/// More points, channels and samples of a channel in a frame than this are a broken file.
pub(super) const MOST: usize = 65_535;

/// The data of a parameter.
enum Data {
    Text(Vec<u8>),
    Numbers(Vec<f64>),
}

struct Parameter {
    dimensions: Vec<usize>,
    data: Data,
}

/// Parameters by the names of their group and their own, in capitals.
pub(super) struct Parameters {
    all: HashMap<(String, String), Parameter>,
}

impl Parameters {
    /// Reads the section at `begin`.
    pub(super) fn parse(bytes: Bytes, begin: usize) -> Result<Self, C3dError> {
        const WHAT: &str = "a parameter";
        let (mut groups, mut found) = (HashMap::new(), Vec::new());
        let mut at = begin + 4;
        loop {
            let length = usize::from((bytes.u8(at, WHAT)? as i8).unsigned_abs());
            let group = bytes.u8(at + 1, WHAT)? as i8;
            if length == 0 || group == 0 {
                break;
            }
            let name = Bytes::slice(bytes.file, at + 2, length, WHAT)?;
            let name = String::from_utf8_lossy(name).trim().to_uppercase();
            let link = at + 2 + length;
            let next = usize::from(bytes.u16(link, WHAT)?);
            if group < 0 {
                groups.insert(group.unsigned_abs(), name);
            } else if let Some(value) = value(bytes, link + 2)? {
                found.push((group.unsigned_abs(), name, value));
            }
            if next == 0 {
                break;
            }
            at = link + next;
        }
        // Groups may come after what is in them.
        let named = |(group, name, value)| Some(((groups.get(&group)?.clone(), name), value));
        Ok(Self { all: found.into_iter().filter_map(named).collect() })
    }

    fn get(&self, group: &str, name: &str) -> Option<&Parameter> {
        self.all.get(&(group.to_owned(), name.to_owned()))
    }

    /// Returns whether there is such a parameter.
    pub(super) fn has(&self, group: &str, name: &str) -> bool {
        self.get(group, name).is_some()
    }

    /// Returns all numbers of a parameter; `None` if there is no such parameter.
    pub(super) fn numbers(
        &self,
        group: &'static str,
        name: &'static str,
    ) -> Result<Option<Vec<f64>>, C3dError> {
        match self.get(group, name).map(|found| &found.data) {
            None => Ok(None),
            Some(Data::Numbers(numbers)) => Ok(Some(numbers.clone())),
            Some(Data::Text(_)) => Err(parameter(group, name, "it holds text, not numbers".to_owned())),
        }
    }

    /// Returns how many values a column of a table has: its first dimension; `None` of what is no table.
    pub(super) fn column_length(&self, group: &str, name: &str) -> Option<usize> {
        let dimensions = &self.get(group, name)?.dimensions;
        dimensions.first().copied().filter(|_| dimensions.len() > 1)
    }

    /// Returns the first number of a parameter.
    pub(super) fn number(&self, group: &'static str, name: &'static str) -> Result<Option<f64>, C3dError> {
        Ok(self.numbers(group, name)?.and_then(|numbers| numbers.first().copied()))
    }

    /// Returns the first number of a parameter as a count; sixteen bits count from zero on, whatever their
    /// sign.
    pub(super) fn count(&self, group: &'static str, name: &'static str) -> Result<Option<usize>, C3dError> {
        let Some(number) = self.number(group, name)? else { return Ok(None) };
        let number = if (-32_768.0..0.0).contains(&number) { number + 65_536.0 } else { number };
        if number.fract() != 0.0 || !(0.0..=MOST as f64).contains(&number) {
            return Err(parameter(group, name, format!("{number} is no count")));
        }
        Ok(Some(number as usize))
    }

    /// Returns the points' unit, m.
    pub(super) fn unit_m(&self) -> Result<f64, C3dError> {
        let stated = self.text("POINT", "UNITS").unwrap_or_default();
        // Programs that have four letters for it write the beginning of a word.
        let letters: String = stated.chars().filter(char::is_ascii_alphabetic).collect();
        match letters.to_ascii_lowercase().as_str() {
            "" | "mm" => Ok(1e-3),
            "cm" => Ok(1e-2),
            "dm" => Ok(1e-1),
            "m" => Ok(1.0),
            "in" => Ok(0.0254),
            "ft" | "feet" | "foot" => Ok(0.3048),
            word if word.starts_with("mil") => Ok(1e-3),
            word if word.starts_with("cen") => Ok(1e-2),
            word if word.starts_with("dec") => Ok(1e-1),
            word if word.starts_with("met") => Ok(1.0),
            word if word.starts_with("inch") => Ok(0.0254),
            _ => Err(parameter("POINT", "UNITS", format!("{stated:?} is none of mm, cm, dm, m, in and ft"))),
        }
    }

    /// Returns the first text of a parameter, without blanks around it.
    pub(super) fn text(&self, group: &str, name: &str) -> Option<String> {
        self.texts(group, name).into_iter().next()
    }

    /// Returns all texts of a parameter, without blanks around them.
    pub(super) fn texts(&self, group: &str, name: &str) -> Vec<String> {
        let Some(Parameter { dimensions, data: Data::Text(bytes) }) = self.get(group, name) else {
            return Vec::new();
        };
        let width = dimensions.first().copied().unwrap_or(1).max(1);
        bytes
            .chunks(width)
            .map(|text| String::from_utf8_lossy(text).trim_matches(['\0', ' ']).to_owned())
            .collect()
    }
}

/// Returns a parameter's type, dimensions and data; `None` if its type is unknown.
fn value(bytes: Bytes, at: usize) -> Result<Option<Parameter>, C3dError> {
    const WHAT: &str = "a parameter";
    let kind = bytes.u8(at, WHAT)? as i8;
    let rank = usize::from(bytes.u8(at + 1, WHAT)?);
    let dimensions: Vec<usize> =
        Bytes::slice(bytes.file, at + 2, rank, WHAT)?.iter().map(|size| usize::from(*size)).collect();
    let Some(count) = dimensions.iter().try_fold(1_usize, |all, size| all.checked_mul(*size)) else {
        return Ok(None);
    };
    let begin = at + 2 + rank;
    let size = match kind {
        -1 | 1 => 1,
        2 => 2,
        4 => 4,
        _ => return Ok(None),
    };
    let Some(length) = count.checked_mul(size) else { return Ok(None) };
    // What is there is examined before anything of that size is made.
    let raw = Bytes::slice(bytes.file, begin, length, WHAT)?;
    let data = match kind {
        -1 => Data::Text(raw.to_vec()),
        1 => Data::Numbers(raw.iter().map(|byte| f64::from(*byte)).collect()),
        2 => Data::Numbers(
            (0..count).map(|k| bytes.i16(begin + 2 * k, WHAT).map(f64::from)).collect::<Result<_, _>>()?,
        ),
        _ => Data::Numbers(
            (0..count).map(|k| bytes.f32(begin + 4 * k, WHAT).map(f64::from)).collect::<Result<_, _>>()?,
        ),
    };
    Ok(Some(Parameter { dimensions, data }))
}
