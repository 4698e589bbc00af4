//! The known word that an unknown one was probably meant to be.

/// Returns the candidate with the fewest edits, case aside, if it is near enough to be a slip. A unit that is
/// missing or too much (`Fx` for `fx_n`) counts as one edit.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = word.to_lowercase();
    let allowed = (lower.chars().count() / 2).clamp(1, 5);
    candidates
        .into_iter()
        .map(|candidate| {
            let other = candidate.to_lowercase();
            let unit_aside = is_stem(&lower, &other) || is_stem(&other, &lower);
            (if unit_aside { 1 } else { edits(&lower, &other) }, candidate)
        })
        .filter(|(edits, _)| *edits <= allowed)
        .min_by_key(|(edits, _)| *edits)
        .map(|(_, candidate)| candidate)
}

/// Returns whether `stem` is the stem of a word, as `fx` of `fx_n`.
fn is_stem(stem: &str, word: &str) -> bool {
    !stem.is_empty() && word.strip_prefix(stem).is_some_and(|rest| rest.starts_with('_'))
}

/// Letters to insert, delete or replace (Levenshtein), row by row.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(100).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().take(100).enumerate() {
        let mut diagonal = i;
        let mut left = i + 1;
        row[0] = left;
        for (above, other) in row.iter_mut().skip(1).zip(&b) {
            let replaced = diagonal + usize::from(letter != *other);
            diagonal = *above;
            left = replaced.min(left + 1).min(*above + 1);
            *above = left;
        }
    }
    row.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_are_those_of_the_textbook() {
        for (a, b, n) in
            [("kitten", "sitting", 3), ("", "abc", 3), ("abc", "", 3), ("same", "same", 0), ("ab", "ba", 2)]
        {
            assert_eq!(edits(a, b), n, "{a} {b}");
        }
    }

    #[test]
    fn slips_are_recognised_and_strangers_are_not() {
        let keys = ["noise_n_nm", "offset_n_nm", "group_delay_s"];
        assert_eq!(nearest("noise_nm", keys), Some("noise_n_nm"));
        assert_eq!(nearest("Group_Delay", keys), Some("group_delay_s"));
        assert_eq!(nearest("colour", keys), None);
        assert_eq!(nearest("My", ["mx_nm", "my_nm"]), Some("my_nm"));
        assert_eq!(nearest("fx_lbf", ["fz", "fx"]), Some("fx"));
    }
}
