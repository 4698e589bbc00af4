//! The tables of `docs/estimation.md`, `docs/platform.md` and `docs/trees.md` are those that `cargo xtask tables` makes.

#![cfg(feature = "simulator")]

#[path = "../examples/tables/document.rs"]
mod document;
#[path = "../examples/estimation_tables/filter_response.rs"]
mod filter_response;
#[path = "../examples/estimation_tables/names.rs"]
mod names;
#[path = "../examples/platform_tables/names.rs"]
mod platform_names;
#[allow(dead_code, reason = "the tables use the rest")]
#[path = "../examples/estimation_tables/report.rs"]
mod report;
#[path = "../examples/tree_tables/names.rs"]
mod tree_names;

fn estimation() -> String {
    std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/estimation.md")).unwrap()
}

#[test]
fn the_document_has_a_place_for_every_table_and_no_other() {
    let text = estimation();
    assert_eq!(document::complaint(&text, &names::TABLES), None);
    // No place is empty.
    for name in document::names(&text) {
        let emptied = document::replaced(&text, name, "").unwrap();
        assert!(emptied.len() + 100 < text.len(), "table {name} has not been made");
    }
}

/// The others take longer: `cargo xtask tables --check NAME`.
#[test]
fn the_filter_in_the_document_is_the_one_that_ships() {
    let text = estimation();
    assert_eq!(document::replaced(&text, "filter-response", &filter_response::table()), Some(text));
}

#[test]
fn a_table_is_replaced_and_nothing_else() {
    let text = "a\n<!-- table: x -->\n| 1 |\n<!-- end -->\nb\n<!-- table: y -->\n<!-- end -->\n";
    let expected = "a\n<!-- table: x -->\n| 2 |\n<!-- end -->\nb\n<!-- table: y -->\n<!-- end -->\n";
    assert_eq!(document::replaced(text, "x", "\n| 2 |\n").as_deref(), Some(expected));
    assert_eq!(document::replaced(text, "z", ""), None);
    assert_eq!(document::names(text), ["x", "y"]);
    let unfinished = "<!-- table: x -->\n<!-- table: y -->\n<!-- end -->\n";
    assert_eq!(document::replaced(unfinished, "x", ""), None);
}

#[test]
fn the_platforms_document_has_a_place_for_every_table_and_no_other() {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/platform.md")).unwrap();
    assert_eq!(document::complaint(&text, &platform_names::TABLES), None);
    for name in document::names(&text) {
        let emptied = document::replaced(&text, name, "").unwrap();
        assert!(emptied.len() + 100 < text.len(), "table {name} has not been made");
    }
}

#[test]
fn the_document_on_trees_has_a_place_for_every_table_and_no_other() {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/trees.md")).unwrap();
    assert_eq!(document::complaint(&text, &tree_names::TABLES), None);
    for name in document::names(&text) {
        let emptied = document::replaced(&text, name, "").unwrap();
        assert!(emptied.len() + 100 < text.len(), "table {name} has not been made");
    }
}
