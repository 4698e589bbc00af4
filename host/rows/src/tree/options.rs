//! The columns beside those of the links.

use super::drive::Friction;

/// The parameters identified beside the links of a tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProblemOptions {
    /// Friction columns of the joints.
    pub friction: Friction,
    /// Drives that turn with several joints: `NAME=J1+J2`.
    pub drives: Vec<String>,
    /// Efforts that are not recorded are zero: they are to be predicted.
    pub without_efforts: bool,
}
