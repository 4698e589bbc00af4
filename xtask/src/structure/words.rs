//! Words that no textbook has, comments wider than a screen and functions longer than a page.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::places;

/// Columns of a comment at most.
const COLUMNS: usize = 110;

/// Lines of a function at most.
const FUNCTION: usize = 80;

/// Folders of no sources: built, fetched or recorded.
const LEFT_OUT: [&str; 6] = ["target", ".git", "goldens", "corpus", "node_modules", "__pycache__"];

/// Endings of files that people read.
const READ: [&str; 8] = ["rs", "py", "md", "toml", "ts", "js", "html", "yml"];

/// Words of a private language, in two halves so that this file has none of them, and what to say.
const PRIVATE: [([&str; 2], &str); 6] = [
    (["to", "ld"], "determined, reported, stated, distinguished"),
    (["unto", "ld"], "missing, undetermined"),
    (["foreto", "ld"], "predicted, expected"),
    (["men", "ded"], "corrected, repaired"),
    (["so ma", "ny"], "this many, this number of"),
    (["held aga", "inst"], "compared with"),
];

/// Returns complaints about every file of this repository that people read.
pub fn complaints() -> Result<Vec<String>> {
    let mut found = Vec::new();
    for file in files(places::root())? {
        let text = std::fs::read_to_string(&file).with_context(|| file.display().to_string())?;
        let name = file.strip_prefix(places::root()).unwrap_or(&file).display().to_string();
        found.extend(of(&name, &text));
    }
    Ok(found)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let entry = entry?;
        let (path, kind) = (entry.path(), entry.file_type()?);
        let is_left_out = LEFT_OUT.iter().any(|name| entry.file_name() == *name);
        if kind.is_dir() && !is_left_out {
            found.extend(files(&path)?);
        } else if kind.is_file() && path.extension().is_some_and(|e| READ.iter().any(|end| e == *end)) {
            found.push(path);
        }
    }
    Ok(found)
}

/// Returns complaints about one file.
fn of(name: &str, text: &str) -> Vec<String> {
    let is_rust = name.ends_with(".rs");
    let mut found = Vec::new();
    for (k, line) in text.lines().enumerate().filter(|(_, line)| !line.contains("alias = \"")) {
        for (halves, instead) in PRIVATE {
            if has_word(line, &halves.concat()) {
                found.push(format!("{name}:{}: \"{}\": say {instead}", k + 1, halves.concat()));
            }
        }
        if is_rust && is_wide_comment(line) {
            found.push(format!("{name}:{}: a comment of more than {COLUMNS} columns", k + 1));
        }
    }
    if is_rust {
        found.extend(long_functions(text).into_iter().map(|(line, function, lines)| {
            format!("{name}:{line}: `{function}` has {lines} lines: split it by subject")
        }));
    }
    found
}

/// Returns whether `word` is in the line, by itself or as a part of a name.
fn has_word(line: &str, word: &str) -> bool {
    let line = line.to_lowercase();
    line.match_indices(word).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + word.len()..].chars().next();
        !before.is_some_and(char::is_alphabetic) && !after.is_some_and(char::is_alphabetic)
    })
}

/// Tables and formulas are as wide as they must be, and an address cannot be broken.
fn is_wide_comment(line: &str) -> bool {
    let text = line.trim_start();
    text.starts_with("//")
        && line.chars().count() > COLUMNS
        && !["|", "=", "]: ", "://", "`{"].iter().any(|mark| text[2..].contains(mark))
        && text.split(' ').all(|word| word.len() < COLUMNS / 2)
}

/// Returns line, name and length of functions that are longer than [`FUNCTION`], as rustfmt lays them out.
fn long_functions(text: &str) -> Vec<(usize, String, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (k, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let Some(name) = function(code) else { continue };
        let close = format!("{}}}", &line[..line.len() - code.len()]);
        let end = lines[k..].iter().position(|later| *later == close);
        if let Some(end) = end.filter(|end| *end >= FUNCTION && !code.ends_with([';', '}'])) {
            found.push((k + 1, name.to_owned(), end + 1));
        }
    }
    found
}

/// Returns the name of the function that a line begins.
fn function(code: &str) -> Option<&str> {
    let (before, after) = code.split_once("fn ")?;
    let words = ["pub", "pub(crate)", "pub(super)", "const", "unsafe", "async", "extern", "\"C\""];
    let is_head = before.split_whitespace().all(|word| words.contains(&word));
    is_head.then(|| after.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn private_words_are_found_alone_and_in_names() {
        let word = PRIVATE[0].0.concat();
        assert_eq!(of("a.md", &format!("All is well.\nIt is {word}.")).len(), 1);
        assert_eq!(of("a.rs", &format!("fn is_{word}_twice() {{}}")).len(), 1);
        assert!(of("a.rs", &format!("#[serde(alias = \"{word}\")]")).is_empty());
        assert!(of("a.md", &format!("s{word}er and {word}o")).is_empty());
    }

    #[test]
    fn wide_comments_are_found_and_tables_and_code_are_not() {
        let words = "word ".repeat(24);
        assert_eq!(of("a.rs", &format!("    /// {words}")).len(), 1);
        for line in [format!("/// | {words}"), format!("let a = \"{words}\";"), format!("// a = {words}")] {
            assert!(of("a.rs", &line).is_empty(), "{line}");
        }
        assert!(of("a.md", &words).is_empty());
    }

    #[test]
    fn long_functions_are_found_by_name_and_length() {
        let of_length =
            |body: usize| format!("    pub fn walk() {{\n{}    }}\n", "        step();\n".repeat(body));
        assert!(long_functions(&of_length(78)).is_empty());
        assert_eq!(long_functions(&of_length(79)), [(1, "walk".to_owned(), 81)]);
        assert!(long_functions(&format!("fn one();\n{}", "// x\n".repeat(90))).is_empty());
    }
}
