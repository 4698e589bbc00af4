//! URDFs that are no well-formed XML, as urdfdom's parser takes them.
//!
//! Older descriptions have prefixes that nobody declares (`<sensor:camera>`), `--` in comments, `&` in texts,
//! or blanks before the `<?xml … ?>`. These are made harmless byte by byte, so that every element stays where
//! it is in the file.

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

/// Returns a text with a blank between attributes that nothing separates (`name="a"type="b"`), which MuJoCo's
/// and urdfdom's parser take for two.
pub(super) fn spaced(text: String) -> String {
    let all = text.as_bytes();
    let mut missing = Vec::new();
    let mut at = 0;
    while let Some(rest) = all.get(at..).filter(|rest| !rest.is_empty()) {
        let past = |end: &str| find(rest, end).map_or(all.len(), |n| at + n + end.len());
        at = if rest.starts_with(b"<!--") {
            past("-->")
        } else if rest.starts_with(b"<![CDATA[") {
            past("]]>")
        } else if rest.starts_with(b"<") {
            unspaced(all, at, &mut missing)
        } else {
            at + rest.iter().position(|byte| *byte == b'<').unwrap_or(rest.len())
        };
    }
    let mut out = String::with_capacity(text.len() + missing.len());
    let mut from = 0;
    for place in missing {
        out.push_str(&text[from..place]);
        out.push(' ');
        from = place;
    }
    if from == 0 { text } else { out + &text[from..] }
}

/// Notes the places in a tag where a blank is missing, and returns where it ends.
fn unspaced(all: &[u8], at: usize, missing: &mut Vec<usize>) -> usize {
    let (mut quote, mut ended) = (None, false);
    for (k, byte) in all.iter().enumerate().skip(at + 1) {
        match quote {
            Some(own) if own == byte => (quote, ended) = (None, true),
            Some(_) => {}
            None => {
                if ended && (byte.is_ascii_alphabetic() || *byte == b'_') {
                    missing.push(k);
                }
                ended = false;
                match byte {
                    b'"' | b'\'' => quote = Some(byte),
                    b'>' => return k + 1,
                    _ => {}
                }
            }
        }
    }
    all.len()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// tinyxml2 reads such attributes as two.
    #[test]
    fn attributes_that_nothing_separates_are_two() {
        let text = "<?xml version='1.0'?><a b=\"1\"c='2' d=\"x\"/><!-- e=\"1\"f --><g>\"h\"i<j \
                    k=\"'l'm\"n=\"\"/></g>";
        let right = "<?xml version='1.0'?><a b=\"1\" c='2' d=\"x\"/><!-- e=\"1\"f --><g>\"h\"i<j k=\"'l'm\" \
                     n=\"\"/></g>";
        let wrapped = |text: &str| text.replace("?><a", "?><all><a") + "</all>";
        assert!(parsed(&wrapped(text)).is_err());
        assert_eq!(spaced(text.to_owned()), right);
        assert!(parsed(&wrapped(right)).is_ok());
        assert_eq!(spaced(right.to_owned()), right);
        for cut in 0..text.len() {
            let _ = spaced(text[..cut].to_owned());
        }
    }
}
