//! The documents have a place for every table, and the quick ones are what is made.

use super::{DOCUMENTS, names, replaced};

#[test]
fn documents_have_a_filled_place_for_every_table_and_no_other() {
    for document in &DOCUMENTS {
        let text = document.read().unwrap();
        assert_eq!(document.complaint(&text), None);
        for name in names(&text) {
            let emptied = replaced(&text, name, "").unwrap();
            assert!(emptied.len() + 100 < text.len(), "table {name} has not been made");
        }
    }
}

/// The others take longer: `cargo xtask tables --check NAME`.
#[test]
fn the_filter_in_the_document_is_the_one_that_ships() {
    let [estimation, ..] = &DOCUMENTS;
    let text = estimation.read().unwrap();
    let table = estimation.tables.iter().find(|table| table.name == "filter-response").unwrap();
    assert_eq!(replaced(&text, table.name, &(table.make)()), Some(text));
}

#[test]
fn a_table_is_replaced_and_nothing_else() {
    let text = "a\n<!-- table: x -->\n| 1 |\n<!-- end -->\nb\n<!-- table: y -->\n<!-- end -->\n";
    let expected = "a\n<!-- table: x -->\n| 2 |\n<!-- end -->\nb\n<!-- table: y -->\n<!-- end -->\n";
    assert_eq!(replaced(text, "x", "\n| 2 |\n").as_deref(), Some(expected));
    assert_eq!(replaced(text, "z", ""), None);
    assert_eq!(names(text), ["x", "y"]);
    let unfinished = "<!-- table: x -->\n<!-- table: y -->\n<!-- end -->\n";
    assert_eq!(replaced(unfinished, "x", ""), None);
}
