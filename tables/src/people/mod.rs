//! The tables of `docs/people.md`.

mod motions;
mod room;
mod subjects;

use crate::document::{Document, Table};

/// The document and its tables, in its order.
pub const DOCUMENT: Document = Document {
    file: "docs/people.md",
    tables: &[
        Table { name: "motions-long", make: motions::table },
        Table { name: "people-long", make: subjects::table },
        Table { name: "racket-long", make: subjects::racket_table },
        Table { name: "room-long", make: room::table },
    ],
};
