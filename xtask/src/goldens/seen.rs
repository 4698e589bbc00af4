//! The part of a command's output that is stored: exit status, parameters, other numbers, printed numbers,
//! factors.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Output;

use anyhow::{Context as _, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// One parameter: its state, and value and 95 % uncertainty where it has them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter(pub String, pub Option<f64>, pub Option<f64>);

/// The data stored of one command.
#[derive(Default, Serialize, Deserialize)]
pub struct Seen {
    /// Words after `rigident`, for who reads the file.
    pub command: String,
    /// Exit status.
    pub exit: i32,
    /// Name of the object's schema.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// The object's status.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub status: Option<String>,
    /// The object's parameters by name.
    pub parameters: BTreeMap<String, Parameter>,
    /// The object's other numbers by path.
    pub numbers: BTreeMap<String, f64>,
    /// First word and numbers of printed lines that have any.
    pub printed: Vec<String>,
    /// Factors by the name of the file: every entry's bits.
    pub factors: BTreeMap<String, Vec<String>>,
    /// Bytes of the factor files; not stored.
    #[serde(skip)]
    pub files: BTreeMap<String, Vec<u8>>,
}

impl Seen {
    /// Returns what a command left behind.
    pub fn of(folder: &Path, words: &[&str], output: &Output) -> Result<Self> {
        let mut seen = Self { exit: output.status.code().unwrap_or(-1), ..Self::default() };
        let after = |flag: &str| words.iter().position(|w| *w == flag).and_then(|n| words.get(n + 1));
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        let object = after("--out").map(|out| folder.join(out).join("result.json"));
        if words.contains(&"--json") {
            seen.object(&serde_json::from_str(&printed).context("standard output is not JSON")?);
        } else {
            seen.printed = printed.lines().filter_map(numbers_of).collect();
            if let Some(file) = object.filter(|file| file.is_file()) {
                seen.object(&serde_json::from_str(&std::fs::read_to_string(file)?)?);
            }
        }
        if let Some(file) = after("-o") {
            seen.factor(&folder.join(file))?;
        }
        let out = after("--out").map(|out| folder.join(out)).filter(|out| out.is_dir());
        for entry in out.iter().flat_map(std::fs::read_dir).flatten().flatten() {
            if entry.path().extension().is_some_and(|e| e == "factor") {
                seen.factor(&entry.path())?;
            }
        }
        Ok(seen)
    }

    fn object(&mut self, object: &Value) {
        let word = |name: &str| object[name].as_str().map(str::to_owned);
        (self.schema, self.status) = (word("schema"), word("status"));
        let with_states = |list: &&Vec<Value>| list.iter().all(|p| p["state"].is_string());
        let list = object["parameters"].as_array().filter(with_states);
        for parameter in list.into_iter().flatten() {
            let state = parameter["state"].as_str().unwrap_or_default().to_owned();
            let name = parameter["name"].as_str().unwrap_or_default().to_owned();
            let kept = Parameter(state, parameter["value"].as_f64(), parameter["u95"].as_f64());
            self.parameters.insert(name, kept);
        }
        let known = list.is_some();
        for (key, value) in object.as_object().into_iter().flatten() {
            if !(known && key == "parameters") && key != "elapsed_s" {
                leaves(key, value, &mut self.numbers);
            }
        }
    }

    fn factor(&mut self, file: &Path) -> Result<()> {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if file.is_file() {
            let bytes = std::fs::read(file)?;
            let entries = entries(&bytes).with_context(|| format!("{} is no factor file", file.display()))?;
            self.factors
                .insert(name.clone(), entries.iter().map(|v| format!("{:016x}", v.to_bits())).collect());
            self.files.insert(name, bytes);
        }
        Ok(())
    }

    /// Reads a golden.
    pub fn read(file: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
        serde_json::from_str(&text).with_context(|| file.display().to_string())
    }

    /// Writes a golden, one entry a line.
    pub fn write(&self, file: &Path, command: &str) -> Result<()> {
        let mut object = serde_json::to_value(self)?;
        object["command"] = command.into();
        let mut text = "{\n".to_owned();
        let fields: Vec<String> = object
            .as_object()
            .into_iter()
            .flatten()
            .map(|(key, value)| {
                let lines = |begin: &str, list: Vec<String>, end: &str| {
                    if list.is_empty() {
                        format!("{begin}{end}")
                    } else {
                        format!("{begin}\n  {}\n {end}", list.join(",\n  "))
                    }
                };
                let value = match value {
                    Value::Object(map) => lines(
                        "{",
                        map.iter().map(|(k, v)| format!("{}: {v}", Value::from(k.as_str()))).collect(),
                        "}",
                    ),
                    Value::Array(list) => lines("[", list.iter().map(ToString::to_string).collect(), "]"),
                    other => other.to_string(),
                };
                format!(" {}: {value}", Value::from(key.as_str()))
            })
            .collect();
        text += &fields.join(",\n");
        text += "\n}\n";
        std::fs::write(file, text).with_context(|| file.display().to_string())
    }
}

/// Collects every number in a value, by its path.
fn leaves(path: &str, value: &Value, into: &mut BTreeMap<String, f64>) {
    match value {
        Value::Number(number) => {
            into.insert(path.to_owned(), number.as_f64().unwrap_or(f64::NAN));
        }
        Value::Bool(yes) => {
            into.insert(path.to_owned(), f64::from(u8::from(*yes)));
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(n, v)| leaves(&format!("{path}.{n}"), v, into));
        }
        Value::Object(map) => map.iter().for_each(|(k, v)| leaves(&format!("{path}.{k}"), v, into)),
        Value::Null | Value::String(_) => {}
    }
}

/// Returns the first word of a line and its numbers, if it has any; the names of files are left out.
pub fn numbers_of(line: &str) -> Option<String> {
    if line.starts_with("Files in") {
        return None;
    }
    let trimmed = |word: &str| {
        let word = word.trim_matches(|c: char| "[](),;:%°".contains(c));
        // A printed zero that is rounding has other digits on another machine.
        if word.parse::<f64>().is_ok_and(|v| v.abs() < 1e-12) { "0".to_owned() } else { word.to_owned() }
    };
    let words: Vec<String> = line.split_whitespace().map(trimmed).collect();
    let is_number = |word: &&String| word.parse::<f64>().is_ok_and(f64::is_finite);
    let numbers: Vec<&str> = words.iter().filter(is_number).map(String::as_str).collect();
    let first = words.first().filter(|word| !is_number(word)).map_or("", String::as_str);
    (!numbers.is_empty()).then(|| format!("{first} {}", numbers.join(" ")))
}

/// Returns the numbers at the end of a factor file of version 8, before its check sum. The version, the
/// numbers of parameters and of runs and that of these numbers follow the magic, in bytes of seven bits.
fn entries(bytes: &[u8]) -> Option<Vec<f64>> {
    let body = bytes.get(8..bytes.len().checked_sub(4)?)?;
    let mut at = 0;
    let mut varint = || {
        let mut value = 0_usize;
        for shift in (0..35).step_by(7) {
            let byte = *body.get(at)?;
            at += 1;
            value |= usize::from(byte & 127) << shift;
            if byte < 128 {
                return Some(value);
            }
        }
        None
    };
    let (version, _parameters, _runs, count) = (varint()?, varint()?, varint()?, varint()?);
    let numbers = body.get(body.len().checked_sub(8 * count)?..)?.chunks_exact(8);
    (version == 8).then(|| numbers.map(|c| f64::from_le_bytes(c.try_into().unwrap_or_default())).collect())
}
