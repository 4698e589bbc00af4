//! Bytes as text: UTF-8, UTF-16 and Windows-1252, with or without a mark of byte order.

use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// Bytes that are examined for the zeros of UTF-16.
const SAMPLE: usize = 4096;

/// Returns the text of a file and the name of its encoding.
///
/// # Errors
/// Says why the bytes are no text.
pub(crate) fn decode(bytes: &[u8]) -> Result<(Cow<'_, str>, &'static str), String> {
    let zeros = "it is not text (it holds zero bytes)";
    let (encoding, mark) = match Encoding::for_bom(bytes) {
        Some((encoding, mark)) => (encoding, mark),
        None => (utf_16(bytes).unwrap_or(UTF_8), 0),
    };
    let bytes = bytes.get(mark..).unwrap_or_default();
    if encoding != UTF_8 {
        let (text, is_damaged) = encoding.decode_without_bom_handling(bytes);
        if is_damaged {
            return Err(format!("it is not text: as {} it is damaged or cut off", encoding.name()));
        }
        return if text.contains('\0') { Err(zeros.to_owned()) } else { Ok((text, encoding.name())) };
    }
    if bytes.contains(&0) {
        return Err(zeros.to_owned());
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok((Cow::Borrowed(text), UTF_8.name())),
        Err(error) => {
            // Windows-1252 gives every byte a letter; what text does not hold is none.
            let is_control =
                |byte: &u8| matches!(byte, 1..=8 | 11 | 14..=31 | 127 | 0x81 | 0x8d | 0x8f | 0x90 | 0x9d);
            if mark > 0 || bytes.iter().any(is_control) {
                let line = bytes.iter().take(error.valid_up_to()).filter(|b| **b == b'\n').count() + 1;
                return Err(format!("it is not text (line {line})"));
            }
            Ok((WINDOWS_1252.decode_without_bom_handling(bytes).0, WINDOWS_1252.name()))
        }
    }
}

/// Returns the byte order of UTF-16 without a mark: digits and separators are every other byte a zero.
fn utf_16(bytes: &[u8]) -> Option<&'static Encoding> {
    let pairs = bytes.get(..SAMPLE.min(bytes.len()))?.as_chunks::<2>().0;
    let count = |of: fn(&[u8; 2]) -> bool| pairs.iter().filter(|pair| of(pair)).count();
    let (low, high) = (count(|p| p[1] == 0 && p[0] != 0), count(|p| p[0] == 0 && p[1] != 0));
    let most = pairs.len() * 3 / 4;
    (pairs.len() > 4).then_some(if low > most && high == 0 {
        UTF_16LE
    } else if high > most && low == 0 {
        UTF_16BE
    } else {
        return None;
    })
}
