//! Tables in text as other programs export them: how a file is written is found from the file.
//!
//! Lives here: encoding, separator, lines before and after the header, units, the way of writing numbers and
//! times. May not live here: what columns mean ([`super::csv`], [`super::conventions`]).

pub(super) mod clock;
pub(crate) mod decimal;
pub(super) mod encoding;
pub(super) mod layout;
mod lvm;
pub(super) mod rows;
pub(super) mod vendors;

/// Returns a text with blanks for its control characters: as a cell, or a comment, of a table in text it ends
/// no line.
pub(super) fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
