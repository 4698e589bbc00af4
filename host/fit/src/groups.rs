//! Factors of a collection by the labels of their runs.

use std::collections::BTreeMap;

use super::pool::{PoolError, PooledFactor};

/// Holds the values of some labels, in the order of their keys.
pub type Values = Vec<String>;

/// Returns the values that all runs of a factor have under the keys.
///
/// # Errors
/// [`PoolError::Label`] if a run has none under a key, or two runs have different ones.
pub fn values(factor: &PooledFactor, keys: &[String]) -> Result<Values, PoolError> {
    let refuse = |key: &String, reason: String| PoolError::Label {
        name: factor.name.clone(),
        key: key.clone(),
        reason,
    };
    let value = |key: &String| {
        let mut found: Option<&String> = None;
        for run in &factor.sources {
            let own = run.labels.get(key).ok_or_else(|| {
                let there: Vec<&str> = run.labels.keys().map(String::as_str).collect();
                let there = if there.is_empty() { "no labels".to_owned() } else { there.join(", ") };
                refuse(key, format!("its run {} has {there}", run.recording))
            })?;
            match found {
                Some(first) if first != own => {
                    return Err(refuse(key, format!("its runs are of {first:?} and of {own:?}")));
                }
                _ => found = Some(own),
            }
        }
        found.cloned().ok_or_else(|| refuse(key, "it has no runs".to_owned()))
    };
    keys.iter().map(value).collect()
}

/// Returns which of the things have the same values, each group in the order of the things.
pub fn grouped<T>(things: impl IntoIterator<Item = (Values, T)>) -> BTreeMap<Values, Vec<T>> {
    let mut groups: BTreeMap<Values, Vec<T>> = BTreeMap::new();
    for (values, thing) in things {
        groups.entry(values).or_default().push(thing);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::{Run, body, truth};

    fn factor(labels: &[(&str, &str)]) -> PooledFactor {
        let parameters = body();
        let labels = labels.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        Run::new(&parameters, &truth(parameters.len()), 60, 3.0, 1).pooled.labelled(&labels)
    }

    #[test]
    fn runs_are_distinguished_by_their_labels() {
        let keys = ["rig".to_owned(), "body".to_owned()];
        let one = factor(&[("body", "a"), ("rig", "2"), ("day", "monday")]);
        assert_eq!(values(&one, &keys), Ok(vec!["2".to_owned(), "a".to_owned()]));
        let without = values(&factor(&[("body", "a")]), &keys).unwrap_err().to_string();
        assert!(without.contains("rig") && without.contains("has body"), "{without}");
        let mut both = one.clone();
        both.sources.extend(factor(&[("body", "b"), ("rig", "2")]).sources);
        let mixed = values(&both, &keys).unwrap_err().to_string();
        assert!(mixed.contains("\"a\"") && mixed.contains("\"b\""), "{mixed}");
    }
}
