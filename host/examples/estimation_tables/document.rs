//! Which tables there are, and where they stand in `docs/estimation.md`.

/// The names of all tables, on the command line and in the document's markers, in the document's order. Those that
/// end in `-long` are made only when named or with `--long`.
pub const TABLES: [&str; 7] = [
    "filter-response",
    "f32-accuracy",
    "f32-accuracy-long",
    "covariance-forms",
    "honest-covariance",
    "coloured-noise",
    "montecarlo",
];

const END: &str = "<!-- end -->";

fn marker(name: &str) -> String {
    format!("<!-- table: {name} -->")
}

/// Names that the document's markers have, in their order.
pub fn names(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| line.trim().strip_prefix("<!-- table: ")?.strip_suffix(" -->")).collect()
}

/// What is wrong between the document's markers and [`TABLES`], if anything.
pub fn complaint(text: &str) -> Option<String> {
    let (found, known): (Vec<&str>, Vec<&str>) = (names(text), TABLES.to_vec());
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
