//! URDFs that are no well-formed XML, as urdfdom's parser takes them.
//!
//! Older descriptions have prefixes that nobody declares (`<sensor:camera>`), `--` in comments, `&` in texts, or blanks before the
//! `<?xml … ?>`. These are made harmless byte by byte, so that every element stays where it is in the file.

use std::borrow::Cow;

use super::xml::parsed;

/// Returns a text as XML, of the same length, if it can be made some; otherwise as it is.
pub(super) fn tidied(text: &str) -> Cow<'_, str> {
    if parsed(text).is_ok() {
        return Cow::Borrowed(text);
    }
    let mut bytes = text.as_bytes().to_vec();
    let start = bytes.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(0);
    let mut at = start;
    while let Some(next) = step(text, &mut bytes, at, start) {
        at = next;
    }
    String::from_utf8(bytes).ok().filter(|tidy| parsed(tidy).is_ok()).map_or(Cow::Borrowed(text), Cow::Owned)
}

/// Makes what begins at a place harmless, and returns where it ends; `None` at the end of the text.
fn step(text: &str, bytes: &mut [u8], at: usize, start: usize) -> Option<usize> {
    let rest = text.as_bytes().get(at..).filter(|rest| !rest.is_empty())?;
    // Where the end of something is after which the text goes on.
    let after = |end: &str| find(rest, end).map(|n| at + n + end.len());
    if rest.starts_with(b"<!--") {
        let end = after("-->")?;
        blank(bytes.get_mut(at + 4..end - 3));
        return Some(end);
    }
    if rest.starts_with(b"<?") {
        let end = after("?>")?;
        if at == start && at > 0 {
            blank(bytes.get_mut(at..end));
        }
        return Some(end);
    }
    if rest.starts_with(b"<![CDATA[") {
        return after("]]>");
    }
    if rest.starts_with(b"<") {
        return Some(tag(text, bytes, at));
    }
    if rest.starts_with(b"&") && !is_entity(rest) {
        blank(bytes.get_mut(at..=at));
    }
    Some(at + 1)
}

/// Takes the prefixes that are not declared out of a tag and its attributes, and returns where it ends.
fn tag(text: &str, bytes: &mut [u8], at: usize) -> usize {
    let all = text.as_bytes();
    let (mut quote, mut word) = (None, at + 1);
    for (k, byte) in all.iter().enumerate().skip(at + 1) {
        match (quote, byte) {
            (Some(q), b) if q == b => quote = None,
            (_, b'&') if !is_entity(&all[k..]) => blank(bytes.get_mut(k..=k)),
            (Some(_), _) => {}
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'>') => return k + 1,
            (None, b':') => {
                let prefix = text.get(word..k).unwrap_or_default();
                let is_declared =
                    ["xmlns", "xml"].contains(&prefix) || text.contains(&format!("xmlns:{prefix}"));
                if let Some(colon) = bytes.get_mut(k).filter(|_| !is_declared) {
                    *colon = b'_';
                }
            }
            (None, b) if b.is_ascii_whitespace() || *b == b'/' => word = k + 1,
            _ => {}
        }
    }
    all.len()
}

fn find(bytes: &[u8], what: &str) -> Option<usize> {
    bytes.windows(what.len()).position(|window| window == what.as_bytes())
}

/// Returns whether bytes begin with one of the entities that XML has.
fn is_entity(bytes: &[u8]) -> bool {
    let own = ["&amp;", "&lt;", "&gt;", "&quot;", "&apos;", "&#"];
    own.iter().any(|entity| bytes.starts_with(entity.as_bytes()))
}

fn blank(bytes: Option<&mut [u8]>) {
    for byte in bytes.into_iter().flatten().filter(|byte| **byte != b'\n') {
        *byte = b' ';
    }
}
