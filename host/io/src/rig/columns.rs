//! Where a column's numbers are.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Unit, is_zero, unscaled};

/// Where a column's numbers are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be a column's name, or { name = \"…\", scale = …, offset = … }")]
pub enum ColumnSource {
    /// Under another name.
    Name(String),
    /// Under another name and in another unit.
    Scaled(ScaledColumn),
}

/// A column in another unit, or counted from another zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScaledColumn {
    /// Name of the column in the file.
    pub name: String,
    /// Multiplies its numbers to give SI.
    #[serde(default = "unscaled")]
    pub scale: f64,
    /// Their unit by name, in place of `scale`: `kgf`, `deg/s`, `N mm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Is added after that, SI.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub offset: f64,
    /// Other columns that are added, each with its factor to SI: of a joint whose drive turns with another's.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub plus: BTreeMap<String, f64>,
}

impl ColumnSource {
    /// Returns the name in the file and the factor to SI.
    pub fn parts(&self) -> (&str, f64) {
        match self {
            Self::Name(name) => (name, 1.0),
            Self::Scaled(column) => (&column.name, column.scale * self.unit().map_or(1.0, |unit| unit.scale)),
        }
    }

    /// Returns its unit, if it is given by name; `None` too if the name is none of a unit, which a rig file's
    /// check refuses.
    pub fn unit(&self) -> Option<Unit> {
        match self {
            Self::Name(_) => None,
            Self::Scaled(column) => Unit::parse(column.unit.as_deref()?),
        }
    }

    /// Returns what is added after that, SI.
    pub fn offset(&self) -> f64 {
        match self {
            Self::Name(_) => 0.0,
            Self::Scaled(column) => column.offset,
        }
    }

    /// Returns the other columns that are added, each with its factor to SI.
    pub fn plus(&self) -> impl Iterator<Item = (&str, f64)> {
        let columns = match self {
            Self::Name(_) => None,
            Self::Scaled(column) => Some(&column.plus),
        };
        columns.into_iter().flatten().map(|(name, factor)| (name.as_str(), *factor))
    }
}
