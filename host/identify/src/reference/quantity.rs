//! A quantity of a body that was measured, beside its reference.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One quantity against the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Quantity {
    /// Its name: `m`, `com_x`, `Ixx_com`.
    pub name: String,
    /// Unit in ASCII.
    pub unit: String,
    /// Measured; absent where it is not identified.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Its 95 % expanded uncertainty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub u95: Option<f64>,
    /// The reference's value.
    pub reference: f64,
    /// Its 95 % expanded uncertainty.
    pub reference_u95: f64,
    /// `(value − reference)/√(u95² + reference_u95²)`, ISO/IEC 17043.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub e_n: Option<f64>,
    /// True if the quantity is identified and |E_n| is at most 1.
    pub passed: bool,
}

impl Quantity {
    /// Returns true if the quantity is not identified, or its |E_n| is beyond a bound.
    pub fn is_beyond(&self, limit: f64) -> bool {
        self.e_n.is_none_or(|e_n| e_n.abs() > limit)
    }
}
