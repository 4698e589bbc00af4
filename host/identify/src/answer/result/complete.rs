//! A value for every column of a tree's rows, to predict with.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A value for every column of the rows of a tree, to predict with. They belong together: what is not
/// identified has the value that fits best beside the nominal model, or, where there is none, beside zero.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Complete {
    /// What they are, in a sentence.
    pub note: String,
    /// Base parameters of the links and offsets, in the order of `parameters`.
    pub links: Vec<CompleteParameter>,
    /// What the drives of the joints have beside them: friction, offsets, rotors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<CompleteDrive>,
}

/// A parameter that may be identified or not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CompleteParameter {
    /// Its name, as in `parameters`.
    pub name: String,
    /// Its value in the SI unit of its parameter.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// True if the data alone determine it.
    pub identified: bool,
}

/// A drive's parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CompleteDrive {
    /// Its name, that of its joint.
    pub name: String,
    /// The joints that it turns with: `joint_5+joint_6`.
    pub turns_with: String,
    /// Its columns.
    pub terms: Vec<CompleteTerm>,
}

/// A parameter of a drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CompleteTerm {
    /// Its word, as `--friction` takes it: `viscous`, `stribeck:0.05`.
    pub term: String,
    /// Its value in the SI unit of its parameter; absent where only a sum is known, which the links have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Its unit.
    pub unit: String,
    /// True if the data alone determine it by itself.
    pub identified: bool,
    /// The base parameters that it occurs together with only: their sums are identified or not, see
    /// `parameters`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub together_with: Vec<String>,
}

impl CompleteTerm {
    /// Returns its word without a number: `stribeck` of `stribeck:0.05`.
    pub fn name(&self) -> &str {
        Self::name_in(&self.term)
    }

    /// Returns what a word is without its number.
    pub fn name_in(word: &str) -> &str {
        word.split(':').next().unwrap_or(word)
    }
}
