//! The documents name everything that the program has, and nothing that it has not.

pub mod command_line;
mod formats;
mod links;
mod tutorials;

use std::collections::BTreeSet;

/// Reads a document of the repository.
fn document(name: &str) -> String {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Returns the text below a heading, up to the next one of its level or a higher one.
fn section<'a>(text: &'a str, heading: &str) -> &'a str {
    let level = heading.split(' ').next().unwrap().len();
    let from = text.find(&format!("\n{heading}\n")).unwrap_or_else(|| panic!("no heading {heading}"));
    let body = &text[from + heading.len() + 2..];
    let ends = |line: &str| {
        let hashes = line.chars().take_while(|c| *c == '#').count();
        (1..=level).contains(&hashes) && line[hashes..].starts_with(' ')
    };
    let end: usize = body.split_inclusive('\n').take_while(|line| !ends(line)).map(str::len).sum();
    &body[..end]
}

/// Returns the words in backquotes of the first cells of all tables.
fn first_cells(section: &str) -> BTreeSet<String> {
    let cells = section.lines().filter_map(|line| line.strip_prefix("| ")?.split(" |").next());
    // Words in backquotes are every second part.
    cells.flat_map(|cell| cell.split('`').skip(1).step_by(2)).map(str::to_owned).collect()
}

/// Fails with what is missing and what is too much.
fn same(what: &str, documented: &BTreeSet<String>, real: &BTreeSet<String>) {
    let missing: Vec<_> = real.difference(documented).collect();
    let gone: Vec<_> = documented.difference(real).collect();
    assert!(
        missing.is_empty() && gone.is_empty(),
        "{what}: not in the document: {missing:?}; only there: {gone:?}"
    );
}

#[test]
fn sections_and_cells_are_found() {
    let text = "# a\n\n## b\n\n| `x`, `y` | `z` |\n|---|---|\n| `v` or w | u |\n### c\n| `d` | e |\n## f\n| \
                `g` | h |\n";
    let words = |heading| first_cells(section(text, heading)).into_iter().collect::<Vec<_>>();
    assert_eq!(words("## b"), ["d", "v", "x", "y"]);
    assert_eq!(words("### c"), ["d"]);
    assert_eq!(words("## f"), ["g"]);
}
