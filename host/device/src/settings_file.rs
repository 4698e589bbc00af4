//! A device's settings as data: TOML or JSON files, and what differs between two.
//!
//! The keys are those of [`Settings`], and numbers are printed with as many digits as tell them apart in
//! single precision: what is written is read again to the bit.

use std::collections::BTreeMap;
use std::path::Path;

use rigident_shared::wire::Settings;
use serde_json::Value;

/// Says why a text holds no settings.
#[derive(Debug, thiserror::Error)]
pub enum SettingsFileError {
    /// The file's name says neither format.
    #[error("{0}: settings are a .toml or a .json file")]
    Kind(String),
    /// The file cannot be read.
    #[error("{0}: {1}; `configure(write=FILE)` writes a device's settings into one")]
    Unreadable(String, std::io::Error),
    /// The text is no such text, or a key is missing or of another kind.
    #[error("{file}: {why}\nNothing was sent. `configure(write=FILE)` shows how a whole file looks")]
    Text {
        /// The file.
        file: String,
        /// The message of its reader, with the line.
        why: String,
    },
    /// A key that means nothing.
    #[error("{file}: {key} is no setting. Nothing was sent; docs/formats.md lists them")]
    Unknown {
        /// The file.
        file: String,
        /// The key, with the tables that it is in.
        key: String,
    },
    /// A number that single precision does not hold.
    #[error(
        "{file}: {key} is no number that the device can hold: a finite one below 3.4e38. Nothing was sent"
    )]
    Number {
        /// The file.
        file: String,
        /// The key, with the tables that it is in.
        key: String,
    },
}

/// Names a setting that differs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Change {
    /// The key, with the tables that it is in: `imu.rate_hz`.
    pub key: String,
    /// The old value; null: it was not there.
    pub from: Value,
    /// The new value; null: it is not there.
    pub to: Value,
}

/// Returns settings as JSON. Through text, so that 0.1 is 0.1 and not what single precision makes of it.
pub fn to_json(settings: &Settings) -> Value {
    serde_json::to_string(settings).ok().and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
}

/// Returns settings as TOML. What is none is left out: a key that is not there.
pub fn to_toml(settings: &Settings) -> String {
    let table = toml_value(&to_json(settings)).unwrap_or(toml::Value::Table(toml::Table::new()));
    toml::to_string(&table).unwrap_or_default()
}

fn toml_value(value: &Value) -> Option<toml::Value> {
    Some(match value {
        Value::Null => return None,
        Value::Bool(is) => toml::Value::Boolean(*is),
        Value::Number(number) => match number.as_i64() {
            Some(whole) => toml::Value::Integer(whole),
            None => toml::Value::Float(number.as_f64()?),
        },
        Value::String(text) => toml::Value::String(text.clone()),
        Value::Array(list) => toml::Value::Array(list.iter().filter_map(toml_value).collect()),
        Value::Object(map) => toml::Value::Table(
            map.iter().filter_map(|(key, value)| Some((key.clone(), toml_value(value)?))).collect(),
        ),
    })
}

/// Reads settings from a `.toml` or `.json` file.
///
/// # Errors
/// [`SettingsFileError`] says what is wrong and where.
pub fn read(path: &Path) -> Result<Settings, SettingsFileError> {
    let file = path.display().to_string();
    let is_json = match rigident_io::recording::extension(path).as_str() {
        "json" => true,
        "toml" => false,
        _ => return Err(SettingsFileError::Kind(file)),
    };
    let text = rigident_files::read_text(path).map_err(|e| SettingsFileError::Unreadable(file.clone(), e))?;
    parse(&file, &text, is_json)
}

/// Reads settings from a text; `file` is for messages.
///
/// # Errors
/// [`SettingsFileError`] says what is wrong and where.
pub fn parse(file: &str, text: &str, is_json: bool) -> Result<Settings, SettingsFileError> {
    let wrong = |why: &dyn std::fmt::Display| SettingsFileError::Text {
        file: file.to_owned(),
        why: why.to_string().trim_end().to_owned(),
    };
    let (settings, given): (Settings, Value) = if is_json {
        (
            serde_json::from_str(text).map_err(|e| wrong(&e))?,
            serde_json::from_str(text).map_err(|e| wrong(&e))?,
        )
    } else {
        let table: toml::Table = toml::from_str(text).map_err(|e| wrong(&e))?;
        (toml::from_str(text).map_err(|e| wrong(&e))?, serde_json::to_value(table).map_err(|e| wrong(&e))?)
    };
    let (given, held) = (flat(&given), flat(&to_json(&settings)));
    for (key, value) in &given {
        match held.get(key) {
            // Nothing but a number that is not finite is printed as null.
            Some(Value::Null) if !value.is_null() => {
                return Err(SettingsFileError::Number { file: file.to_owned(), key: key.clone() });
            }
            Some(_) => {}
            // A list, of which one number is none.
            None if held
                .keys()
                .any(|inner| inner.strip_prefix(key).is_some_and(|rest| rest.starts_with('.'))) =>
            {
                return Err(SettingsFileError::Number { file: file.to_owned(), key: key.clone() });
            }
            None => return Err(SettingsFileError::Unknown { file: file.to_owned(), key: key.clone() }),
        }
    }
    // TOML knows numbers that are not finite, which the comparison above has as null on both sides.
    match held.iter().find(|(key, value)| value.is_null() && given.contains_key(*key) && !is_json) {
        Some((key, _)) => Err(SettingsFileError::Number { file: file.to_owned(), key: key.clone() }),
        None => Ok(settings),
    }
}

/// Returns what differs between two settings, in the order of the keys.
pub fn changes(from: Option<&Settings>, to: &Settings) -> Vec<Change> {
    let before = from.map(|settings| flat(&to_json(settings))).unwrap_or_default();
    let after = flat(&to_json(to));
    let keys: std::collections::BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    let of = |values: &BTreeMap<String, Value>, key: &String| values.get(key).cloned().unwrap_or_default();
    let change = |key: &String| Change { key: key.clone(), from: of(&before, key), to: of(&after, key) };
    keys.into_iter().map(change).filter(|change| change.from != change.to).collect()
}

/// Puts nested values side by side under their whole keys; a list of numbers is one value.
fn flat(value: &Value) -> BTreeMap<String, Value> {
    fn add(value: &Value, key: String, into: &mut BTreeMap<String, Value>) {
        let inner = |part: &dyn std::fmt::Display| {
            if key.is_empty() { part.to_string() } else { format!("{key}.{part}") }
        };
        match value {
            Value::Object(map) => map.iter().for_each(|(part, value)| add(value, inner(part), into)),
            Value::Array(list)
                if list.iter().any(|entry| entry.is_object() || entry.is_array() || entry.is_null()) =>
            {
                list.iter().enumerate().for_each(|(k, value)| add(value, inner(&k), into));
            }
            other => drop(into.insert(key, other.clone())),
        }
    }
    let mut into = BTreeMap::new();
    add(value, String::new(), &mut into);
    into
}

#[cfg(test)]
mod tests {
    use rigident_shared::wire::{Source, StopLimit, StopRule};

    use super::*;
    use crate::session::{DeviceTiming, settings};
    use rigident_io::rig::RigFile;

    fn example() -> Settings {
        let timing = DeviceTiming {
            rate_hz: 1000.0,
            is_static: false,
            source: Source::Injected,
            host_timeout_ms: 2000,
        };
        let mut limit = StopLimit { u95: 0.05, ..StopLimit::default() };
        limit.add(3);
        let stop = StopRule { limits: [limit].into_iter().collect(), ..StopRule::default() };
        let noise = [0.1, 1.0 / 3.0, 1e-12, 0.7, 1e9, 2.0];
        settings(&RigFile::default(), &timing, Some(noise), Some(stop)).unwrap()
    }

    #[test]
    fn settings_come_back_from_both_formats_to_the_bit() {
        let settings = example();
        let toml = to_toml(&settings);
        assert!(toml.contains("0.33333334") && !toml.contains("0.333333343"), "{toml}");
        assert_eq!(parse("a.toml", &toml, false).unwrap(), settings, "{toml}");
        let json = to_json(&settings).to_string();
        assert_eq!(parse("a.json", &json, true).unwrap(), settings);
        assert_eq!(changes(Some(&settings), &settings), []);
    }

    #[test]
    fn differences_are_named_with_their_table() {
        let (old, mut new) = (example(), example());
        new.imu.rate_hz = 500.0;
        new.load_cell.known_offset_n_nm = Some([0.5; 6]);
        new.stop = None;
        let found = changes(Some(&old), &new);
        let keys: Vec<&str> = found.iter().map(|change| change.key.as_str()).collect();
        assert!(keys.contains(&"imu.rate_hz") && keys.contains(&"load_cell.known_offset_n_nm"), "{keys:?}");
        assert!(keys.iter().any(|key| key.starts_with("stop")), "{keys:?}");
        let rate = found.iter().find(|change| change.key == "imu.rate_hz").unwrap();
        assert_eq!((&rate.from, &rate.to), (&Value::from(1000.0), &Value::from(500.0)));
    }

    #[test]
    fn a_key_that_is_none_a_missing_one_and_a_number_out_of_range_are_refused_by_name() {
        let toml = to_toml(&example());
        let of = |text: &str| parse("a.toml", text, false).unwrap_err();
        let typo = of(&toml.replacen("[imu]", "[imu]\nrate_hzz = 3.0", 1));
        assert!(matches!(&typo, SettingsFileError::Unknown { key, .. } if key == "imu.rate_hzz"), "{typo}");
        let missing = of(&toml.replacen("frozen_after", "frozen_afterwards", 1));
        assert!(
            matches!(&missing, SettingsFileError::Text { why, .. } if why.contains("frozen_after")),
            "{missing}"
        );
        for number in ["1e300", "nan", "-inf"] {
            let line = toml.lines().find(|line| line.starts_with("knock_limit_sd")).unwrap();
            let error = of(&toml.replacen(line, &format!("knock_limit_sd = {number}"), 1));
            assert!(
                matches!(&error, SettingsFileError::Number { key, .. } if key == "knock_limit_sd"),
                "{number}: {error}"
            );
            let list = toml
                .replacen("noise_n_nm = [", &format!("noise_n_nm = [{number}, "), 1)
                .replacen(", 2.0]", "]", 1);
            let error = of(&list);
            let of_noise = |key: &str| key.starts_with("load_cell.noise_n_nm");
            assert!(
                matches!(&error, SettingsFileError::Number { key, .. } if of_noise(key)),
                "{number}: {error}"
            );
        }
        assert!(matches!(of("frozen_after = ["), SettingsFileError::Text { .. }));
        assert!(matches!(parse("a.json", "[1, 2", true), Err(SettingsFileError::Text { .. })));
        assert!(matches!(read(Path::new("a.yaml")), Err(SettingsFileError::Kind(_))));
    }
}
