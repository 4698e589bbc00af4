//! The table of budgets.

use std::fmt::Write as _;

use anyhow::{Context, Result};

use super::Figure;
use crate::places;

/// The marks around the table in docs/measuring.md.
const MARKS: [&str; 2] = ["<!-- budgets -->\n", "<!-- end -->"];

/// Returns one line of it.
pub fn line(figure: &Figure) -> String {
    let Figure { name, value, limit, note } = figure;
    let mark = if figure.is_met() { "" } else { " **missed**" };
    format!("| {name} | {}{mark} | {} | {note} |", number(*value), number(*limit))
}

/// Returns all of it.
pub fn text(figures: &[Figure]) -> String {
    let mut text = "| figure | measured | at most | from |\n|---|--:|--:|---|\n".to_owned();
    for figure in figures {
        let _ = writeln!(text, "{}", line(figure));
    }
    text
}

/// Writes a number with two figures after the point where a limit has them.
fn number(value: f64) -> String {
    match value {
        v if !v.is_finite() => "–".to_owned(),
        v if v >= 100.0 => format!("{v:.0}"),
        v if v >= 10.0 => format!("{v:.1}"),
        v => format!("{v:.2}"),
    }
}

/// Puts it into docs/measuring.md.
///
/// # Errors
/// The document has no marks for it, or cannot be written.
pub fn write(figures: &[Figure]) -> Result<()> {
    let file = places::root().join("docs/measuring.md");
    let document = std::fs::read_to_string(&file).with_context(|| file.display().to_string())?;
    let written =
        replaced(&document, &text(figures)).context("docs/measuring.md has no marks of the table")?;
    std::fs::write(&file, written).with_context(|| file.display().to_string())
}

fn replaced(document: &str, table: &str) -> Option<String> {
    let begin = document.find(MARKS[0])? + MARKS[0].len();
    let end = begin + document[begin..].find(MARKS[1])?;
    Some(format!("{}{table}{}", &document[..begin], &document[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_takes_the_place_of_the_old_one() {
        let figure = |value| Figure { name: "a".into(), value, limit: 1.2, note: "b / c".into() };
        let table = text(&[figure(1.0), figure(1.3)]);
        assert!(table.ends_with("| a | 1.00 | 1.20 | b / c |\n| a | 1.30 **missed** | 1.20 | b / c |\n"));
        let found = replaced("x\n<!-- budgets -->\nold\n<!-- end -->\ny\n", &table).unwrap();
        assert_eq!(found, format!("x\n<!-- budgets -->\n{table}<!-- end -->\ny\n"));
        assert_eq!(replaced("nothing", &table), None);
    }
}
