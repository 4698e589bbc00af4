//! Texts in tables that other programs open.

use std::borrow::Cow;

use rigident_shared::printable;

/// Returns a text as a field of CSV. A spreadsheet takes a text that begins with `=`, `+`, `-` or `@` for a
/// formula and runs it: an apostrophe before it makes it a text again. What steers is replaced; separators
/// and quotes are quoted.
pub fn field(text: &str) -> String {
    let is_formula = text.starts_with(['=', '+', '-', '@']) && text.parse::<f64>().is_err();
    let shown = printable::line(text).to_string();
    let shown = if is_formula { format!("'{shown}") } else { shown };
    quoted(shown.into()).into_owned()
}

fn quoted(text: Cow<'_, str>) -> Cow<'_, str> {
    if text.contains(['"', ',', ';', '|', '#']) || text != text.trim() {
        format!("\"{}\"", text.replace('"', "\"\"")).into()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_is_a_formula_or_ends_its_field() {
        for (text, written) in [
            ("shoulder_rad", "shoulder_rad"),
            ("-1.5e3", "-1.5e3"),
            ("=cmd|x!A1", "\"'=cmd|x!A1\""),
            ("@SUM(1)", "'@SUM(1)"),
            ("+1+1", "'+1+1"),
            ("-1+1", "'-1+1"),
            ("q,\"a\nr: [x]", "\"q,\"\"a\u{fffd}r: [x]\""),
            ("\t=1", "\u{fffd}=1"),
            (" a ", "\" a \""),
        ] {
            assert_eq!(field(text), written, "{text:?}");
        }
    }
}
