//! Notices of third parties: every package that the program holds, with the texts of its licence as they were
//! delivered with it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Result, ensure};

use super::graph::Part;

/// The C code compiled inside a package, and its licence.
const INSIDE: [(&str, &str); 2] = [
    ("libsqlite3-sys", "SQLite, in the public domain: https://sqlite.org/copyright.html"),
    ("zstd-sys", "Zstandard, Copyright (c) Meta Platforms, Inc. and affiliates, BSD-3-Clause"),
];
/// Beginnings of the names of files that hold licences.
const NAMES: [&str; 5] = ["license", "licence", "copying", "notice", "unlicense"];

/// Returns the whole file. Texts that several packages share are there once.
///
/// # Errors
/// A package names no licence.
pub fn text(parts: &[Part]) -> Result<String> {
    let mut out = format!(
        "Rigident is under MIT OR Apache-2.0. It holds {} packages of others. Sources of each, those under \
         MPL-2.0 among them, are at the address beside it and at https://crates.io.\n\n",
        parts.len()
    );
    let mut texts: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for part in parts {
        let Part { name, version, licence, repository, .. } = part;
        ensure!(!licence.is_empty(), "{name} {version} names no licence");
        writeln!(out, "{name} {version}: {licence}  {repository}")?;
        if let Some((_, words)) = INSIDE.iter().find(|(package, _)| package == name) {
            writeln!(out, "  holds {words}")?;
        }
        for text in licences(&part.folder)? {
            texts.entry(text).or_default().push(format!("{name} {version}"));
        }
    }
    for (text, names) in texts {
        writeln!(out, "\n{}\n{}\n\n{}", "=".repeat(100), names.join(", "), text.trim_end())?;
    }
    Ok(out)
}

/// Returns the texts in a package's folder.
fn licences(folder: &Path) -> Result<Vec<String>> {
    let mut texts = Vec::new();
    let mut files: Vec<_> =
        std::fs::read_dir(folder)?.map(|entry| entry.map(|e| e.path())).collect::<Result<_, _>>()?;
    files.sort();
    for file in files.iter().filter(|file| file.is_file()) {
        let name = file.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        if NAMES.iter().any(|begin| name.starts_with(begin)) {
            texts.push(String::from_utf8_lossy(&std::fs::read(file)?).replace('\r', ""));
        }
    }
    Ok(texts)
}
