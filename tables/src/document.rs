//! Documents with tables, and where the tables are in them.

use std::path::{Path, PathBuf};

use crate::{estimation, faults, people, platform, trees};

/// All documents with tables.
pub const DOCUMENTS: [Document; 10] = [
    estimation::DOCUMENT,
    estimation::CALIBRATION,
    estimation::DIAGNOSIS,
    platform::DOCUMENT,
    platform::SAFETY,
    trees::DOCUMENT,
    trees::JOINT_OFFSETS,
    trees::MASSES,
    people::DOCUMENT,
    faults::DOCUMENT,
];

/// A document and its tables.
pub struct Document {
    /// The file's path from the root of the repository.
    pub file: &'static str,
    /// The tables in the document's order.
    pub tables: &'static [Table],
}

/// A table: what makes it, and its name on the command line and in the document's markers.
pub struct Table {
    /// Names that end in `-long` are made only when given or with `--long`.
    pub name: &'static str,
    /// Gives its Markdown.
    pub make: fn() -> String,
}

impl Document {
    fn path(&self) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(self.file)
    }

    /// Reads the document.
    pub fn read(&self) -> Result<String, String> {
        std::fs::read_to_string(self.path()).map_err(|e| format!("{}: {e}", self.file))
    }

    /// Replaces the document.
    pub fn write(&self, text: &str) -> Result<(), String> {
        std::fs::write(self.path(), text).map_err(|e| format!("{}: {e}", self.file))
    }

    /// Compares the document's markers with its tables, names and order, and says what differs.
    pub fn complaint(&self, text: &str) -> Option<String> {
        let known: Vec<&str> = self.tables.iter().map(|table| table.name).collect();
        let found = names(text);
        if found != known {
            return Some(format!("{} has the tables {found:?}, the command makes {known:?}", self.file));
        }
        let open = known.iter().find(|name| replaced(text, name, "").is_none())?;
        Some(format!("table {open} of {} has no end", self.file))
    }
}

const END: &str = "<!-- end -->";

fn marker(name: &str) -> String {
    format!("<!-- table: {name} -->")
}

/// Returns the names in the document's markers, in their order.
pub fn names(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| line.trim().strip_prefix("<!-- table: ")?.strip_suffix(" -->")).collect()
}

/// Returns the document with one table replaced; `None` if its markers are not there.
pub fn replaced(text: &str, name: &str, table: &str) -> Option<String> {
    let marker = marker(name);
    let start = text.find(&marker)? + marker.len();
    let (before, after) = text.split_at_checked(start)?;
    let end = after.find(END)?;
    let between = after.get(..end)?;
    (!between.contains("<!-- table:")).then(|| format!("{before}\n{}\n{}", table.trim(), &after[end..]))
}

#[cfg(test)]
mod tests;
