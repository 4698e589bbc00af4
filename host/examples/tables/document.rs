//! Where tables stand in a document.

const END: &str = "<!-- end -->";

fn marker(name: &str) -> String {
    format!("<!-- table: {name} -->")
}

/// Names that the document's markers have, in their order.
pub fn names(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| line.trim().strip_prefix("<!-- table: ")?.strip_suffix(" -->")).collect()
}

/// What is wrong between the document's markers and the tables there are, in the same order, if anything.
pub fn complaint(text: &str, known: &[&str]) -> Option<String> {
    let found = names(text);
    if found != known {
        return Some(format!("the document has the tables {found:?}, the command makes {known:?}"));
    }
    known
        .iter()
        .find(|name| replaced(text, name, "").is_none())
        .map(|name| format!("table {name} has no end"))
}

/// The document with one table replaced; `None` if its markers are not there.
pub fn replaced(text: &str, name: &str, table: &str) -> Option<String> {
    let marker = marker(name);
    let start = text.find(&marker)? + marker.len();
    let (before, after) = text.split_at_checked(start)?;
    let end = after.find(END)?;
    let between = after.get(..end)?;
    (!between.contains("<!-- table:")).then(|| format!("{before}\n{}\n{}", table.trim(), &after[end..]))
}
