//! Labels: what tells recordings of a collection apart.

/// Characters of a key, and of a value, at most.
const MOST: (usize, usize) = (40, 100);

/// Checks a label.
///
/// # Errors
/// Says what a key or a value has to be.
pub fn check(key: &str, value: &str) -> Result<(), String> {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if key.is_empty() || key.len() > MOST.0 || !key.chars().all(word) {
        return Err(format!(
            "the name of a label has letters, digits, '-' and '_', at most {}: {key:?} has not",
            MOST.0
        ));
    }
    if value.trim() != value
        || value.is_empty()
        || value.chars().count() > MOST.1
        || value.chars().any(char::is_control)
    {
        return Err(format!(
            "the value of a label is a text of 1 to {} characters in one line, without spaces about it",
            MOST.1
        ));
    }
    Ok(())
}

/// Reads `KEY=VALUE`.
///
/// # Errors
/// Says what is wrong with it.
pub fn parse(text: &str) -> Result<(String, String), String> {
    let (key, value) =
        text.split_once('=').ok_or_else(|| format!("{text:?} is no KEY=VALUE: body=bracket-7"))?;
    check(key, value)?;
    Ok((key.to_owned(), value.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn malformed_labels_are_refused() {
        assert_eq!(parse("body=bracket 7=b"), Ok(("body".to_owned(), "bracket 7=b".to_owned())));
        for text in
            ["body", "=a", "body=", "b y=a", "body= a", "body=a\nb", &format!("body={}", "a".repeat(101))]
        {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
