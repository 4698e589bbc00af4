//! The tables of `docs/estimation.md` are those that `cargo xtask tables` makes.

#[path = "../examples/estimation_tables/document.rs"]
mod document;

#[test]
fn the_document_has_a_place_for_every_table_and_no_other() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/estimation.md");
    let text = std::fs::read_to_string(path).unwrap();
    assert_eq!(document::complaint(&text), None);
    // No place is empty.
    for name in document::names(&text) {
        let emptied = document::replaced(&text, name, "").unwrap();
        assert!(emptied.len() + 100 < text.len(), "table {name} has not been made");
    }
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
