//! Why factors do not come together, and what tells models apart.

use crate::factor_file::FactorFileError;

/// Names that a message lists.
pub(super) const NAMES_LISTED: usize = 4;

/// Why factors are not read, merged or written.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PoolError {
    /// The file cannot be opened, read or written.
    #[error("{name}: {reason}")]
    Access {
        /// Its name.
        name: String,
        /// Why.
        reason: String,
    },
    /// The bytes are not a usable factor file.
    #[error("{name}: {error}")]
    File {
        /// Its name.
        name: String,
        /// Why.
        error: FactorFileError,
    },
    /// The same readings are in two factors.
    #[error(
        "the recording {recording} is in it twice ({first} and {second}): counting the same noise twice \
         would halve the variance without knowing more; leave one of them out"
    )]
    Repeated {
        /// The recording.
        recording: String,
        /// Name of the first factor that holds it.
        first: String,
        /// Name of the second.
        second: String,
    },
    /// A factor has other parameters than the first one.
    #[error("{name} is of another model than {first}: {difference}")]
    Model {
        /// The factor that differs.
        name: String,
        /// The first one.
        first: String,
        /// Its parameters against those of the first.
        difference: ModelDifference,
    },
    /// A factor holds what is known of errors in its rows.
    #[error(
        "{name} was written by an older program: it does not hold the errors of its rig apart, and merged \
         they would average out as noise does; write it anew from its recording"
    )]
    Old {
        /// The factor.
        name: String,
    },
    /// Numbers too large.
    #[error("{name}: merged with the others its numbers overflow: it is no factor of a real recording")]
    Overflow {
        /// The factor.
        name: String,
    },
    /// Its runs have no value, or several, of a label that factors are distinguished by.
    #[error("{name} cannot be sorted by the label {key}: {reason}; `factor(label={key}=…)` gives runs one")]
    Label {
        /// The factor.
        name: String,
        /// The key of the label.
        key: String,
        /// The labels of its runs.
        reason: String,
    },
    /// Nothing was given.
    #[error("there is nothing to merge: give at least one factor")]
    Nothing,
}

/// The parameters of one model against those of another.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ModelDifference {
    /// Names that only the first has.
    pub missing: Vec<String>,
    /// Names that only the other has.
    pub foreign: Vec<String>,
    /// Names that both have with another unit, kind or frame, or made of other standard parameters.
    pub changed: Vec<String>,
}

impl std::fmt::Display for ModelDifference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut said = Vec::new();
        for (what, names) in [
            ("it lacks", &self.missing),
            ("it has besides", &self.foreign),
            ("of another unit, frame or geometry are its", &self.changed),
        ] {
            if !names.is_empty() {
                said.push(format!("{what} {}", names_in_words(names, ", ")));
            }
        }
        if said.is_empty() {
            said.push(
                "its parameters have the same names, the links' geometry differs: use the same model file \
                 for all"
                    .to_owned(),
            );
        }
        f.write_str(&said.join("; "))
    }
}

/// The first few names, and how many more there are.
pub fn names_in_words<S: AsRef<str>>(names: &[S], between: &str) -> String {
    names_of_many(names, 0, between)
}

/// The first few names, and how many more there are, with those that are `hidden`.
pub(super) fn names_of_many<S: AsRef<str>>(names: &[S], hidden: u64, between: &str) -> String {
    let first: Vec<&str> = names.iter().take(NAMES_LISTED).map(AsRef::as_ref).collect();
    match (names.len() - first.len()) as u64 + hidden {
        0 => first.join(between),
        more => format!("{}{between}{more} more", first.join(between)),
    }
}
